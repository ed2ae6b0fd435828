"""Labels as lines of text: subtitles, Audacity, events of C3D, markers of Blender's actions.

Conventions: one recording a file. A line says `walk`, or `[left hand] walk` for a label of the
track "left hand"; `[unassessed]` is what was not assessed, in WebVTT a comment. Subtitles (.srt,
.vtt) and label tracks of Audacity say start and end; WebVTT names the recording and its rate in a
comment. As events and markers a label is two moments, `walk start` and `walk end`, without
duration one, `walk`; labels of one name that overlap are numbered, `walk #2 start`. A C3D file is
copied and its events are added to those it has; their times are half-open seconds. For Blender
the motion is written as BVH, its markers beside it as JSON; frames count from 1 there, both ends
included.
"""

import html
import json
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile, Where
from motionary.files import read_bytes, write_atomically
from motionary.io.formats.numbers import parse_number
from motionary.io.labels.lanes import (
    UNASSESSED,
    UNSEEN,
    Found,
    join_track,
    parse_recording,
    part_track,
    plain_line,
)
from motionary.io.text import format_suffix, read_text, stem_of, write_text
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

ADDON = "motionary_markers.py"

_TIMES = re.compile(r"((?:\d+:)?\d+:\d\d[.,]\d+)\s+-->\s+((?:\d+:)?\d+:\d\d[.,]\d+)(?:[ \t].*)?")
_NOTE = re.compile(r"NOTE (recording|rate_hz|frames|unassessed)[: ] *(.*)")
_TAG = re.compile(r"</?[A-Za-z][^>]*>|<[\d:.]+>")
_AUDACITY_LINE = re.compile(r"(-?[\d.]+)\t(-?[\d.]+)(?:\t(.*))?")
_PART = re.compile(r"(.*?)(?: #(\d+))? (start|end)", re.DOTALL)
_NUMBERED = re.compile(r".* #\d+", re.DOTALL)


def _list_cues(track: LabelTrack) -> list[tuple[float, float, str]]:
    """Start, end and line of each label."""
    cues = [(label.start_s, label.end_s, join_track(label)) for label in track.labels]
    if any(text in (UNSEEN, f"[] {UNSEEN}") for *_, text in cues):
        raise InvalidInput(f"a label cannot be called {UNSEEN}, which stands for what was not seen")
    return cues


def _list_all(track: LabelTrack) -> list[tuple[float, float, str]]:
    """The same, what was not assessed among them, by time."""
    return sorted([*_list_cues(track), *((*segment, UNSEEN) for segment in track.unassessed)])


# -- subtitles ----------------------------------------------------------------------------


def read_subtitles(path: Path) -> dict[str, LabelTrack]:
    """Labels of SubRip or WebVTT; see `read_labels`."""
    text = read_text(path)
    is_vtt = text.startswith("WEBVTT")
    blocks = [block.strip("\n").split("\n") for block in re.split(r"\n[ \t]*\n", text.strip("\n"))]
    found_notes = (_NOTE.fullmatch(lines[0]) for lines in blocks if is_vtt)
    notes = {note[1]: html.unescape(note[2]) for note in found_notes if note}
    name = notes.get("recording") or stem_of(path)
    found = Found(parse_recording(name, notes.get("rate_hz", ""), notes.get("frames", "")))
    for number, lines in enumerate(blocks, start=1):
        where = Where(file=path.name, place=f"block {number}")
        if not is_vtt:
            _read_cue(found, name, lines, where)
            continue
        note = _NOTE.fullmatch(lines[0])
        if note and note[1] == UNASSESSED:
            found.add(name, None, _segment(note[2], where), where=where)
        elif not (note or number == 1 or re.match(r"NOTE|STYLE|REGION", lines[0])):
            _read_cue(found, name, lines, where, is_vtt=True)
    return found.tracks()


def _read_cue(
    found: Found, name: str, lines: list[str], where: Where, *, is_vtt: bool = False
) -> None:
    if not any(lines):
        return
    at = next((i for i, line in enumerate(lines[:2]) if "-->" in line), None)
    if at is None:
        raise UnreadableFile(
            f"expected times as 00:00:01,500 --> 00:00:02,000, got {lines[0][:40]!r}", **where
        )
    segment = _segment(lines[at], where)
    text = " ".join(lines[at + 1 :]).strip()
    if is_vtt:
        text = html.unescape(_TAG.sub("", text))
    if is_vtt and text == UNSEEN:
        # There it is a comment, and this a label.
        found.add(name, text, segment, where=where)
    elif part_track(text)[1]:
        found.add_line(name, text, segment, where)


def _segment(text: str, where: Where) -> Segment:
    parts = _TIMES.fullmatch(text.strip())
    if parts is None:
        raise UnreadableFile(
            f"expected times as 00:00:01,500 --> 00:00:02,000, got {text[:60]!r}", **where
        )
    return Segment(_seconds(parts[1]), _seconds(parts[2]))


def _seconds(text: str) -> float:
    whole, _, fraction = text.replace(",", ".").partition(".")
    seconds = 0
    for part in whole.split(":"):
        seconds = 60 * seconds + int(part)
    return (seconds * 1000 + round(float(f"0.{fraction}") * 1000)) / 1000


def write_srt(track: LabelTrack, path: Path) -> None:
    """Write the track of one recording as SubRip; see `write_labels`."""
    blocks = (
        f"{number}\n{_clock(start, ',')} --> {_clock(end, ',')}\n{text}\n\n"
        for number, (start, end, text) in enumerate(_list_all(track), start=1)
    )
    write_text(path, blocks)


def write_vtt(track: LabelTrack, path: Path) -> None:
    """Write the track of one recording as WebVTT; see `write_labels`."""
    write_text(path, _format_vtt(track))


def _format_vtt(track: LabelTrack) -> Iterator[str]:
    recording = track.recording
    yield f"WEBVTT\n\nNOTE recording: {_escape(plain_line(recording.name))}\n\n"
    if recording.rate_hz:
        yield f"NOTE rate_hz: {float(recording.rate_hz)!r}\n\n"
    if recording.n_frames:
        yield f"NOTE frames: {recording.n_frames}\n\n"
    for start, end in track.unassessed:
        yield f"NOTE unassessed {_clock(start, '.')} --> {_clock(end, '.')}\n\n"
    for start, end, text in _list_cues(track):
        yield f"{_clock(start, '.')} --> {_clock(end, '.')}\n{_escape(text)}\n\n"


def _clock(time_s: float, point: str) -> str:
    ms = round(time_s / 1e-3)
    hours, minutes, seconds = ms // 3_600_000, ms // 60_000 % 60, ms // 1000 % 60
    return f"{hours:02}:{minutes:02}:{seconds:02}{point}{ms % 1000:03}"


def _escape(text: str) -> str:
    # With the arrow's end escaped a text cannot look like times.
    return html.escape(text, quote=False)


# -- Audacity -----------------------------------------------------------------------------


def is_audacity(content: str) -> bool:
    """Whether a text is a label track of Audacity."""
    lines = [line for line in content.split("\n") if line.strip()]
    return bool(lines) and _AUDACITY_LINE.fullmatch(lines[0].strip("\ufeff")) is not None


def read_audacity(path: Path) -> dict[str, LabelTrack]:
    """Labels of a label track of Audacity; see `read_labels`."""
    name = stem_of(path)
    found = Found(Recording(name))
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        where = Where(file=path.name, place=f"line {number}")
        # A second line says the frequencies that a label spans.
        if not line.strip() or line.startswith("\\"):
            continue
        parts = _AUDACITY_LINE.fullmatch(line)
        times = [parse_number(parts[i]) if parts else float("nan") for i in (1, 2)]
        if parts is None or any(time != time for time in times):
            raise UnreadableFile(
                f"expected start, end and label with tabs between them, got {line[:60]!r}", **where
            )
        found.add_line(name, (parts[3] or "").strip(), Segment(*times), where)
    return found.tracks()


def write_audacity(track: LabelTrack, path: Path) -> None:
    """Write the track of one recording as a label track of Audacity; see `write_labels`."""
    lines = (f"{start:.6f}\t{end:.6f}\t{text}\n" for start, end, text in _list_all(track))
    write_text(path, lines)


# -- moments ------------------------------------------------------------------------------


class Moment(NamedTuple):
    """One end of a label, or one without duration."""

    time_s: float
    text: str
    is_end: bool


def list_moments(track: LabelTrack) -> list[Moment]:
    """The moments of a track, those of labels that end before those that start then."""
    moments: list[Moment] = []
    ends: dict[tuple[str, int], float] = {}
    unseen = [(Label(UNSEEN, *segment), UNSEEN) for segment in track.unassessed]
    for label, text in [*((x, join_track(x)) for x in track.labels), *unseen]:
        if label.start_s == label.end_s:
            moments.append(Moment(label.start_s, text, is_end=True))
            continue
        number = 1
        while ends.get((text, number), -1.0) > label.start_s:
            number += 1
        ends[text, number] = label.end_s
        # What ends in a number would be read as one.
        is_plain = number == 1 and not _NUMBERED.fullmatch(text)
        full = text if is_plain else f"{text} #{number}"
        moments.append(Moment(label.start_s, f"{full} start", is_end=False))
        moments.append(Moment(label.end_s, f"{full} end", is_end=True))
    return sorted(moments, key=lambda x: (x.time_s, not x.is_end))


def pair_moments(moments: Iterable[tuple[float, str]]) -> list[tuple[str, Segment]]:
    """Labels of moments in the sequence of their times; what has no partner has no duration."""
    found: list[tuple[str, Segment]] = []
    running: dict[tuple[str, str], tuple[float, str]] = {}
    for time_s, text in moments:
        parts = _PART.fullmatch(text)
        if parts is None:
            found.append((text, Segment(time_s, time_s)))
            continue
        key = parts[1], parts[2] or ""
        if parts[3] == "start":
            before = running.pop(key, None)
            if before is not None:
                found.append((before[1], Segment(before[0], before[0])))
            running[key] = time_s, text
        elif key in running:
            found.append((parts[1], Segment(running.pop(key)[0], time_s)))
        else:
            found.append((text, Segment(time_s, time_s)))
    found += [(text, Segment(time_s, time_s)) for time_s, text in running.values()]
    return found


def _to_tracks(
    recording: Recording, pairs: Iterable[tuple[str, Segment]], where: Where
) -> dict[str, LabelTrack]:
    found = Found(recording)
    for text, segment in pairs:
        found.add_line(recording.name, text, segment, where)
    return found.tracks()


# -- C3D ----------------------------------------------------------------------------------


def read_c3d_events(path: Path) -> dict[str, LabelTrack]:
    """Labels of the events of a C3D file; see `read_labels`."""
    from motionary.io.recordings import read

    motion = read(path)
    sides = {"left": "Left ", "right": "Right "}
    moments = [(e.time_s, sides.get(e.side, "") + e.name) for e in motion.events]
    return _to_tracks(motion.recording, pair_moments(moments), Where(file=path.name))


def write_c3d_events(track: LabelTrack, path: Path, *, recording: Path) -> None:
    """Write the track of one recording into a copy of its C3D file; see `write_labels`."""
    from motionary.io.formats.c3d_writing import copy_with_events
    from motionary.io.recordings import read

    if format_suffix(recording) != ".c3d":
        raise InvalidInput(
            "events are written into a copy of a C3D file; make one first: "
            "motionary convert RECORDING -o RECORDING.c3d",
            file=recording.name,
        )
    if path.exists() and path.samefile(recording):
        raise UnwritableFile("is the recording itself; write to another file", file=path)
    motion = read(recording)
    before_s = (motion.first_frame - 1) / motion.rate_hz
    events = [(moment.text, moment.time_s + before_s) for moment in list_moments(track)]
    copy_with_events(recording, path, events)


# -- Blender ------------------------------------------------------------------------------


def is_markers(content: Any) -> bool:
    """Whether JSON says markers of an action."""
    return isinstance(content, dict) and isinstance(content.get("markers"), list)


def read_markers(content: Mapping[str, Any], path: Path) -> dict[str, LabelTrack]:
    """Labels of markers as the add-on writes them."""
    rate = float(content["rate_hz"])
    if not 0 < rate < float("inf"):
        raise UnreadableFile(f"rate_hz must be frames per second, got {rate}", file=path.name)
    recording = Recording(
        str(content.get("recording") or path.stem),
        rate_hz=rate,
        n_frames=int(content.get("frames") or 0),
    )
    markers = sorted((int(x["frame"]), str(x["name"])) for x in content["markers"])
    # A frame that one label ends on may be another's first; a start comes before its own end.
    markers.sort(key=lambda marker: (marker[0], marker[1].endswith(" end")))
    pairs = []
    for text, (start, end) in pair_moments((float(frame - 1), text) for frame, text in markers):
        # A label of one frame is one, and no moment.
        is_pair = end > start or (int(start) + 1, text) not in markers
        pairs.append((text, Segment(start / rate, (end + is_pair) / rate)))
    return _to_tracks(recording, pairs, Where(file=path.name))


def write_markers(track: LabelTrack, path: Path, *, recording: Path) -> None:
    """Write the track of one recording for Blender; see `write_labels`.

    Beside the markers stand the motion as BVH and the add-on that reads both.
    """
    from motionary.io.recordings import read

    motion = read(recording)
    rate = motion.rate_hz
    markers = []
    for time_s, text, is_end in list_moments(track):
        # The frame before ends a label with a duration.
        is_last = is_end and text.endswith(" end")
        markers.append({"frame": round(time_s * rate) + (not is_last), "name": text})
    content = {
        "recording": track.recording.name, "rate_hz": rate, "frames": motion.n_frames,
        "bvh": f"{path.stem}.bvh", "markers": markers,
    }  # fmt: skip
    _place_bvh(recording, path.with_suffix(".bvh"))
    script = resources.files("motionary.io.labels") / "blender" / ADDON
    write_text(path.with_name(ADDON), [script.read_text("utf-8")])
    write_text(path, [json.dumps(content, ensure_ascii=False, indent=1) + "\n"])


def _place_bvh(source: Path, target: Path) -> None:
    from motionary.io.recordings import read, write

    if target.exists() and target.samefile(source):
        return
    if target.exists():
        raise UnwritableFile("exists; write to another folder", file=target)
    if format_suffix(source) == ".bvh":
        read_bytes(source)
        with write_atomically(target) as beside:
            shutil.copyfile(source, beside)
    else:
        write(read(source), target)
