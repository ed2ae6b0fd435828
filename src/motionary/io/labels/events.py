"""Labels as pairs of moments: events of C3D files, markers of Blender's actions.

Conventions: a label is two moments, `walk start` and `walk end`; without duration one, `walk`.
Labels of one name that overlap are numbered, `walk #2 start`. A C3D file is copied and its
events are added to those it has; their times are half-open seconds. For Blender the motion is
written as BVH, its markers beside it as JSON; frames count from 1 there, both ends included.
"""

import json
import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile, Where
from motionary.files import read_bytes, write_atomically
from motionary.io.labels.lanes import (
    UNASSESSED,
    build_tracks,
    join_track,
    make_label,
    only_one,
    part_track,
)
from motionary.io.text import format_suffix, write_text
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

#: Seconds of events are 32-bit floats below a minute.
RESOLUTION_S = 1e-5
ADDON = "motionary_markers.py"

_UNSEEN = f"[{UNASSESSED}]"
_PART = re.compile(r"(.*?)(?: #(\d+))? (start|end)", re.DOTALL)
_NUMBERED = re.compile(r".* #\d+", re.DOTALL)


class Moment(NamedTuple):
    """One end of a label, or one without duration."""

    time_s: float
    text: str
    is_end: bool


def list_moments(track: LabelTrack) -> list[Moment]:
    """The moments of a track, those of labels that end before those that start then."""
    moments: list[Moment] = []
    ends: dict[tuple[str, int], float] = {}
    unseen = [(Label(_UNSEEN, *segment), _UNSEEN) for segment in track.unassessed]
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


def _build(
    recording: Recording, pairs: Iterable[tuple[str, Segment]], where: Where
) -> dict[str, LabelTrack]:
    labels, unassessed = [], []
    for text, segment in pairs:
        if text == _UNSEEN:
            unassessed.append((recording.name, segment))
            continue
        track, name = part_track(text)
        label = make_label(name or "?", *segment, where=where, track=track)
        labels.append((recording.name, label))
    return build_tracks(labels, unassessed, {recording.name: recording})


# -- C3D ----------------------------------------------------------------------------------


def read_c3d_events(path: Path, *, rate_hz: float | None = None) -> dict[str, LabelTrack]:
    """Labels of the events of a C3D file; see `read_labels`."""
    from motionary.io.recordings import read

    motion = read(path)
    sides = {"left": "Left ", "right": "Right "}
    moments = [(e.time_s, sides.get(e.side, "") + e.name) for e in motion.events]
    return _build(motion.recording, pair_moments(moments), Where(file=path.name))


def write_c3d_events(
    tracks: Iterable[LabelTrack], path: Path, *, recording: Path, excel: bool = False
) -> None:
    """Write the track of one recording into a copy of its C3D file; see `write_labels`."""
    from motionary.io.formats.c3d_events import copy_with_events
    from motionary.io.recordings import read

    track = only_one(list(tracks), path)
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
        is_pair = end > start or _is_pair(text, start, markers)
        pairs.append((text, Segment(start / rate, (end + is_pair) / rate)))
    return _build(recording, pairs, Where(file=path.name))


def _is_pair(text: str, start: float, markers: Sequence[tuple[int, str]]) -> bool:
    """Whether a label of one frame is one, and no moment."""
    return (int(start) + 1, text) not in markers


def write_markers(
    tracks: Iterable[LabelTrack], path: Path, *, recording: Path, excel: bool = False
) -> None:
    """Write the track of one recording for Blender; see `write_labels`.

    Beside the markers stand the motion as BVH and the add-on that reads both.
    """
    from motionary.io.recordings import read

    track = only_one(list(tracks), path)
    motion = read(recording)
    rate = motion.rate_hz
    markers = [
        {"frame": round(x.time_s * rate) + (not _ends(x)), "name": x.text}
        for x in list_moments(track)
    ]
    content = {
        "recording": track.recording.name, "rate_hz": rate, "frames": motion.n_frames,
        "bvh": f"{path.stem}.bvh", "markers": markers,
    }  # fmt: skip
    _place_bvh(recording, path.with_suffix(".bvh"))
    script = resources.files("motionary.io.labels") / "blender" / ADDON
    write_text(path.with_name(ADDON), [script.read_text("utf-8")])
    write_text(path, [json.dumps(content, ensure_ascii=False, indent=1) + "\n"])


def _ends(moment: Moment) -> bool:
    """Whether a moment is the end of a label with a duration: its frame is the one before."""
    return moment.is_end and moment.text.endswith(" end")


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
