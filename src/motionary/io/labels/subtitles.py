"""Labels as lines of text with times: SubRip (.srt), WebVTT (.vtt), label tracks of Audacity.

Conventions: one recording a file, called as the file. A line says `walk`, or `[left hand] walk`
for a label of the track "left hand"; `[unassessed]` is what was not assessed, in WebVTT a
comment. Subtitles have whole milliseconds; WebVTT says the recording and its rate in a comment.
"""

import html
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from motionary.errors import InvalidInput, UnreadableFile, Where
from motionary.io.formats.numbers import parse_number
from motionary.io.labels.lanes import (
    UNASSESSED,
    build_tracks,
    join_track,
    make_label,
    only_one,
    part_track,
    plain_line,
)
from motionary.io.text import read_text, stem_of, write_text
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

RESOLUTION_S = 1e-3
#: Audacity writes six digits.
AUDACITY_RESOLUTION_S = 1e-6

_UNSEEN = f"[{UNASSESSED}]"
_TIMES = re.compile(r"((?:\d+:)?\d+:\d\d[.,]\d+)\s+-->\s+((?:\d+:)?\d+:\d\d[.,]\d+)(?:[ \t].*)?")
_NOTE = re.compile(r"NOTE (recording|rate_hz|frames|unassessed)[: ] *(.*)")
_TAG = re.compile(r"</?[A-Za-z][^>]*>|<[\d:.]+>")


def read_subtitles(path: Path, *, rate_hz: float | None = None) -> dict[str, LabelTrack]:
    """Labels of SubRip or WebVTT; see `read_labels`."""
    text = read_text(path)
    is_vtt = text.startswith("WEBVTT")
    notes: dict[str, str] = {}
    labels, unassessed = [], []
    for number, block in enumerate(re.split(r"\n[ \t]*\n", text.strip("\n")), start=1):
        where = Where(file=path.name, place=f"block {number}")
        lines = block.strip("\n").split("\n")
        note = _NOTE.fullmatch(lines[0]) if is_vtt else None
        if note and note[1] == UNASSESSED:
            unassessed.append(_segment(note[2], where))
        elif note:
            notes[note[1]] = _unescape(note[2])
        elif not (is_vtt and (number == 1 or re.match(r"NOTE|STYLE|REGION", lines[0]))):
            labels += _read_cue(lines, where, is_vtt=is_vtt)
    if not is_vtt:
        unassessed = [Segment(x.start_s, x.end_s) for x in labels if x.name == _UNSEEN]
        labels = [label for label in labels if label.name != _UNSEEN]
    recording = _recording(notes, path)
    name = recording.name
    return build_tracks(
        [(name, x) for x in labels], [(name, x) for x in unassessed], {name: recording}
    )


def _read_cue(lines: list[str], where: Where, *, is_vtt: bool) -> list[Label]:
    if not any(lines):
        return []
    at = next((i for i, line in enumerate(lines[:2]) if "-->" in line), None)
    if at is None:
        raise UnreadableFile(
            f"expected times as 00:00:01,500 --> 00:00:02,000, got {lines[0][:40]!r}", **where
        )
    segment = _segment(lines[at], where)
    text = " ".join(lines[at + 1 :]).strip()
    if is_vtt:
        text = _unescape(_TAG.sub("", text))
    track, name = ("", text) if text == _UNSEEN else part_track(text)
    return [make_label(name, *segment, where=where, track=track)] if name else []


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


def _recording(notes: dict[str, str], path: Path) -> Recording:
    rate = parse_number(notes.get("rate_hz", ""))
    frames = notes.get("frames", "")
    return Recording(
        notes.get("recording") or stem_of(path),
        rate_hz=rate if 0 < rate < float("inf") else 0.0,
        n_frames=int(frames) if frames.isdecimal() else 0,
    )


def write_srt(tracks: Iterable[LabelTrack], path: Path, *, excel: bool = False) -> None:
    """Write the track of one recording as SubRip; see `write_labels`."""
    track = only_one(list(tracks), path)
    cues = [*_lines(track), *((*segment, _UNSEEN) for segment in track.unassessed)]
    blocks = (
        f"{number}\n{_clock(start, ',')} --> {_clock(end, ',')}\n{text}\n\n"
        for number, (start, end, text) in enumerate(sorted(cues), start=1)
    )
    write_text(path, blocks)


def write_vtt(tracks: Iterable[LabelTrack], path: Path, *, excel: bool = False) -> None:
    """Write the track of one recording as WebVTT; see `write_labels`."""
    track = only_one(list(tracks), path)
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
    for start, end, text in _lines(track):
        yield f"{_clock(start, '.')} --> {_clock(end, '.')}\n{_escape(text)}\n\n"


def _lines(track: LabelTrack) -> list[tuple[float, float, str]]:
    lines = [(label.start_s, label.end_s, join_track(label)) for label in track.labels]
    if any(text in (_UNSEEN, f"[] {_UNSEEN}") for *_, text in lines):
        raise InvalidInput(
            f"a label cannot be called {_UNSEEN}, which stands for what was not seen"
        )
    return lines


def _clock(time_s: float, point: str) -> str:
    ms = round(time_s / RESOLUTION_S)
    hours, minutes, seconds = ms // 3_600_000, ms // 60_000 % 60, ms // 1000 % 60
    return f"{hours:02}:{minutes:02}:{seconds:02}{point}{ms % 1000:03}"


def _escape(text: str) -> str:
    # With the arrow's end escaped a text cannot look like times.
    return html.escape(text, quote=False)


def _unescape(text: str) -> str:
    return html.unescape(text)


_AUDACITY_LINE = re.compile(r"(-?[\d.]+)\t(-?[\d.]+)(?:\t(.*))?")


def is_audacity(content: str) -> bool:
    """Whether a text is a label track of Audacity."""
    lines = [line for line in content.split("\n") if line.strip()]
    return bool(lines) and _AUDACITY_LINE.fullmatch(lines[0].strip("\ufeff")) is not None


def read_audacity(path: Path, *, rate_hz: float | None = None) -> dict[str, LabelTrack]:
    """Labels of a label track of Audacity; see `read_labels`."""
    name = stem_of(path)
    labels, unassessed = [], []
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
        if parts[3] == _UNSEEN:
            unassessed.append((name, Segment(*times)))
            continue
        track, text = part_track((parts[3] or "").strip())
        labels.append((name, make_label(text or "?", *times, where=where, track=track)))
    return build_tracks(labels, unassessed, {name: Recording(name)})


def write_audacity(tracks: Iterable[LabelTrack], path: Path, *, excel: bool = False) -> None:
    """Write the track of one recording as a label track of Audacity; see `write_labels`."""
    track = only_one(list(tracks), path)
    cues = [*_lines(track), *((*segment, _UNSEEN) for segment in track.unassessed)]
    write_text(path, (f"{start:.6f}\t{end:.6f}\t{text}\n" for start, end, text in sorted(cues)))
