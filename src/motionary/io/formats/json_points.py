"""Keypoints in three dimensions in JSON, as trackers and scripts write them.

Frames are a list, alone or under one of the usual names; a frame holds points by name, a list of
points whose names stand once in the file, or people of whom each has points. World landmarks of
MediaPipe, bodies of Azure Kinect and instances of MMPose are such lists. Numbers alone are an
array, as in .npy files. Keypoints in two dimensions are no places: they are refused.

Conventions: a point is [x, y, z], or has x, y, z; more numbers (scores) are left out; null, and
a point that a frame lacks, was not seen.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from motionary.errors import InvalidInput, NotAMotion, UnreadableFile, describe_cause
from motionary.files import open_regular
from motionary.io.formats.array_layouts import (
    NAMES,
    RATES,
    Layout,
    check_positions,
    name_joints,
    read_layout,
    split_array,
)
from motionary.io.formats.content import (
    POINT_UNITS,
    RATE_HINT,
    FileContent,
    choose_take,
    names_file,
    number_doubles,
    recall,
)
from motionary.io.formats.json_people import (
    FLAT,
    MEDIAPIPE,
    PEOPLE,
    WORLD,
    Person,
    fill_positions,
    find_people,
    is_number,
    refuse_flat,
    refuse_image,
)
from motionary.io.formats.times import timed_content
from motionary.io.normalise.units import NAMES_OF_UNITS, FileMetadata
from motionary.io.options import ReadOptions
from motionary.io.text import parse_json, read_text
from motionary.rotations import Floats
from motionary.skeletons import named_table

_FRAMES = (
    "frames", "instance_info", "data", "poses", "results", "sequence", "positions",
    "keypoints3d", "keypoints_3d", "joints3d", "keypoints", "joints", "landmarks",
)  # fmt: skip
_HEADS = ("metadata", "meta", "meta_info", "info", "header")
_MORE_NAMES = (*NAMES, "keypoint_names", "landmark_names", "joints")
# Seconds of a unit, by the name of a frame's time; what clocks give under names that do not say.
_TIMES = {"time_s": 1.0, "timestamp_s": 1.0, "time_ms": 1e-3, "timestamp_ms": 1e-3,
          "timestamp_us": 1e-6, "timestamp_usec": 1e-6}  # fmt: skip
_CLOCKS = ("time", "timestamp", "t")
_NUMBERS = ("frame", "frame_id", "frame_index", "frame_number")
_SECONDS = (1.0, 1e-3, 1e-6, 1e-9)
_LONGEST_STEP_S = 1.0

# An hour of MediaPipe takes 0.4 GB as text, and ten times as much as objects.
_MOST_BYTES = 1 << 30


@names_file
def read_json(path: Path, options: ReadOptions) -> FileContent:
    """Content of a JSON file of keypoints in three dimensions."""
    try:
        loaded = recall(path, lambda: _load(path), count=_Loaded.n_motions)
        if loaded.layout is not None:
            return _read_numbers(loaded.layout, loaded.head, path.name, options)
        takes = list(loaded.people)
        person = loaded.people[takes[choose_take(takes, options.take, path.name)]]
        keys, positions = fill_positions(person, len(loaded.frames), loaded.size)
    except RecursionError as error:
        raise UnreadableFile(describe_cause(error)) from None
    refuse_image(positions, person.key)
    head = loaded.head
    names, mapping = head.names or None, None
    notes: tuple[str, ...] = ()
    if all(isinstance(key, str) for key in keys):
        names = number_doubles([" ".join(str(key).split())[:200] for key in keys])
    else:
        table = options.skeleton_table()
        if table is None and names is None and person.key in WORLD:
            table = named_table("mediapipe") if len(keys) == MEDIAPIPE else None
        joints = name_joints(positions, table, names=names)
        names, notes, mapping = joints.names, joints.notes, joints.mapping
    times, first_frame, time_notes = _find_times(loaded.frames, options.rate_hz or head.rate_hz)
    content = timed_content(
        names or (),
        positions,
        times,
        options,
        metadata=head.metadata(person.key),
        stated_hz=head.rate_hz or np.nan,
        first_frame=first_frame,
        notes=(*notes, *time_notes),
    )
    return replace(content, mapping=mapping)


class _Loaded(NamedTuple):
    """What a file holds: its frames with the people in them, or numbers in a layout."""

    frames: list[Any]
    head: "_Head"
    people: dict[str, Person]
    layout: Layout | None
    size: int

    def n_motions(self) -> int:
        return len(self.people) if self.layout is None else len(self.layout.motions)


def _load(path: Path) -> _Loaded:
    with open_regular(path) as file:
        size = file.seek(0, 2)
    if size > _MOST_BYTES:
        raise UnreadableFile(
            f"{size >> 20} MB of JSON are more than is read; save positions and names as .npz"
        )
    text = read_text(path)
    content = parse_json(text)
    frames, head = _find_frames(content), _Head(content)
    if _is_array(frames):
        return _Loaded([], head, {}, _split_numbers(frames), len(text))
    return _Loaded(frames, head, find_people(frames), None, len(text))


class _Head:
    """What a file says of all frames."""

    def __init__(self, content: Any) -> None:
        self.parts: list[Mapping[str, Any]] = []
        if isinstance(content, dict):
            inner = [content.get(key) for key in _HEADS]
            self.parts = [content, *(part for part in inner if isinstance(part, dict))]
        self.names = self._find_names()

    @property
    def rate_hz(self) -> float | None:
        for value in (part[key] for part in self.parts for key in RATES if key in part):
            if is_number(value) and 0 < value < 1e6:
                return float(value)
        return None

    def metadata(self, key: str) -> FileMetadata:
        """What the file says of unit and axes."""
        if key in WORLD:
            return FileMetadata(usual_up="-y", origin="MediaPipe", likely=POINT_UNITS)
        said = (part.get(name) for part in self.parts for name in ("unit", "units"))
        unit = next((u for u in said if isinstance(u, str) and u.lower() in NAMES_OF_UNITS), "")
        return FileMetadata(unit=NAMES_OF_UNITS.get(unit.lower()), likely=POINT_UNITS)

    def _find_names(self) -> list[str]:
        for part in self.parts:
            by_number = part.get("keypoint_id2name")
            lists = [part.get(key) for key in _MORE_NAMES]
            if isinstance(by_number, dict):
                lists.append(list(by_number.values()))
            for names in lists:
                if isinstance(names, list) and names and all(isinstance(n, str) for n in names):
                    return [" ".join(name.split())[:200] for name in names]
        return []


# ---- frames


def _find_frames(content: Any) -> list[Any]:
    """The list of frames, of which one is there."""
    found = [content]
    if isinstance(content, dict):
        found = [content[key] for key in _FRAMES if key in content]
        if any(key in content for key in (*PEOPLE, *FLAT)):
            # One frame a file, as OpenPose writes, or those of a data set of images.
            found.append([content])
    for value in found:
        if isinstance(value, list) and value and not all(isinstance(v, str) for v in value):
            return value
        if isinstance(value, dict) and value and all(isinstance(v, dict) for v in value.values()):
            # By number, or by the name of an image.
            return list(value.values())
    raise NotAMotion(
        "holds no motion; expected keypoints in three dimensions: "
        '{"fps": 30, "frames": [{"joints": {"hip": [x, y, z]}}]}, or lists with "names"'
    )


def _is_array(value: Any) -> bool:
    """Whether a list holds numbers only, at least three lists deep."""
    depth = 0
    while isinstance(value, list):
        value = next((one for one in value if one not in (None, [])), None)
        depth += 1
    return depth >= 3 and is_number(value)


def _split_numbers(frames: list[Any]) -> Layout:
    try:
        array = np.array(frames, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise UnreadableFile(
            "frames differ in their number of points; give points names, or null to "
            "those that were not seen"
        ) from None
    if array.shape[-1] == 2:
        refuse_flat()
    # A fourth number of a point is its score.
    array = array[..., :3] if array.ndim >= 3 and array.shape[-1] == 4 else array
    return split_array(array)


def _read_numbers(layout: Layout, head: _Head, source: str, options: ReadOptions) -> FileContent:
    if layout.rate_hz is None:
        refuse_image(check_positions(layout.motions[0]), "")
    rate = options.rate_hz or head.rate_hz or layout.rate_hz
    return read_layout(layout, source, options, names=head.names or None, rate_hz=rate)


# ---- times


def _find_times(
    frames: Sequence[Any], rate_hz: float | None
) -> tuple[Floats | None, float, tuple[str, ...]]:
    """Times in seconds, the first frame's number, and a note on a unit told by steps.

    Times are those of the file, or of its frames' numbers at the rate; None where none are needed.
    """
    numbers = _column(frames, _NUMBERS)
    times, notes = _read_times(frames)
    if times is None and numbers is not None and rate_hz is not None:
        times = (numbers - numbers[0]) / rate_hz
    if times is None or len(times) < 2:
        if rate_hz is None:
            raise InvalidInput(f"says neither times nor a rate; {RATE_HINT}")
        times = None
    return times, 0 if numbers is None else float(numbers[0]), notes


def _read_times(frames: Sequence[Any]) -> tuple[Floats | None, tuple[str, ...]]:
    """Times in seconds, and a note where their unit is taken from their steps."""
    for key, seconds in _TIMES.items():
        times = _column(frames, (key,))
        if times is not None:
            return times * seconds, ()
    times = _column(frames, _CLOCKS)
    if times is None or len(times) < 2:
        return None, ()
    step = float(np.median(np.diff(times)))
    for seconds in _SECONDS:
        if step * seconds <= _LONGEST_STEP_S:
            unit = {1.0: "", 1e-3: "milliseconds", 1e-6: "microseconds"}.get(seconds, "nanoseconds")
            return times * seconds, ((f"times are taken for {unit}",) if unit else ())
    return times, ()


def _column(frames: Sequence[Any], keys: Sequence[str]) -> Floats | None:
    """A number that every frame has, under the first of the names that is there."""
    first = frames[0]
    key = next((k for k in keys if isinstance(first, dict) and is_number(first.get(k))), None)
    if key is None:
        return None
    values: list[Any] = [f.get(key) if isinstance(f, dict) else None for f in frames]
    numbers = [value for value in values if is_number(value) and abs(value) < 1e18]
    return np.array(numbers, dtype=np.float64) if len(numbers) == len(frames) else None
