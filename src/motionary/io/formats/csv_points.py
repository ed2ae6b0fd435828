"""Points in tables of comma-separated values: OptiTrack Motive, Vicon Nexus, and plain ones.

A plain table names its columns `joint_x,joint_y,joint_z` (or `joint.X`, `joint:x`, `joint x`)
in its first line, with or without a column of time or of frame numbers. Motive and Nexus write
lines before it that say rate, unit, and what stands in which column.

Conventions: empty cells, and points whose coordinates are all zero, were not seen.
"""

import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.formats.content import (
    POINT_UNITS,
    RATE_HINT,
    FileContent,
    hide_sentinels,
    number_doubles,
)
from motionary.io.formats.numbers import UNKNOWN_NUMBERS, parse_number, read_table
from motionary.io.formats.times import time_frames
from motionary.io.normalise.units import NAMES_OF_UNITS, FileMetadata
from motionary.io.options import ReadOptions
from motionary.io.text import read_text

# Lines before the frames: Motive writes seven, Nexus five.
_MOST_HEAD = 40
_COORDINATE = re.compile(r"(.+?)[ ._:/-]?\(?([xyz])\)?", re.IGNORECASE)
_TIMES = {"time": 1.0, "time_s": 1.0, "timestamp": 1.0, "seconds": 1.0, "t": 1.0,
          "time (seconds)": 1.0, "time_ms": 1e-3, "timestamp_ms": 1e-3}  # fmt: skip
_FRAMES = ("frame", "frame#", "frames", "frame_number")
# Of what Motive tracks: solved joints before the markers they come from.
_KINDS = ("bone", "rigid body", "marker", "bone marker", "rigid body marker")


class _Columns(NamedTuple):
    """What stands where: names, their three columns, time and frame, and the first row."""

    names: list[str]
    places: list[list[int]]
    width: int
    row: int
    time: int | None = None
    time_scale: float = 1.0
    frame: int | None = None
    rate_hz: float = np.nan
    unit: str = ""


def read_csv(path: Path, options: ReadOptions) -> FileContent:
    """Content of a table of points.

    Raises
    ------
    UnreadableFile
        If the file is missing or broken, or no columns of points are found.
    InvalidInput
        If the file says no rate and none is given.
    """
    text = read_text(path)
    lines = text.split("\n", _MOST_HEAD)
    first = next((line for line in lines if line.strip()), "")
    separator = max(",;\t", key=first.count)
    head = list(csv.reader(lines[:_MOST_HEAD], delimiter=separator))
    columns = _find_columns(head, path.name)
    body = text.split("\n", columns.row)[columns.row :]
    content = body[0] if body else ""
    values = read_table(
        content.replace(",", ".") if separator == ";" else content,
        columns.width,
        source=path.name,
        line=columns.row + 1,
        separator=separator,
        gaps=("", *UNKNOWN_NUMBERS),
    )
    if not len(values):
        raise UnreadableFile("holds no frames", file=path.name)
    places = values[:, columns.places]
    places[(places == 0).all(axis=2) | np.isnan(places).any(axis=2)] = np.nan
    names = number_doubles(columns.names)
    notes = hide_sentinels(places, names)
    first_frame = values[0, columns.frame] if columns.frame is not None else 0.0
    if columns.time is not None:
        timed = time_frames(
            places,
            values[:, columns.time] * columns.time_scale,
            options=options,
            source=path.name,
            stated_hz=columns.rate_hz,
        )
        places, rate, notes = timed.positions, timed.rate_hz, (*notes, *timed.notes)
    else:
        rate = columns.rate_hz if options.rate_hz is None else options.rate_hz
        if not rate > 0:
            raise InvalidInput(f"a table without times has no rate; {RATE_HINT}", file=path.name)
    return FileContent(
        names=names,
        positions=places,
        rate_hz=rate,
        source=path.name,
        metadata=FileMetadata(unit=NAMES_OF_UNITS.get(columns.unit.lower()), likely=POINT_UNITS),
        first_frame=int(first_frame) if np.isfinite(first_frame) else 0,
        notes=notes,
    )


def _find_columns(head: Sequence[Sequence[str]], name: str) -> _Columns:
    cells = [[cell.strip() for cell in row] for row in head]
    for number, row in enumerate(cells):
        lower = [cell.lower() for cell in row]
        if lower[:2] == ["frame", "time (seconds)"]:
            return _of_motive(cells, number, name)
        if lower[:2] == ["frame", "sub frame"]:
            return _of_nexus(cells, number, name)
    for number, row in enumerate(cells):
        if any(row):
            return _of_plain(row, number, name)
    raise UnreadableFile("holds no rows", file=name)


def _of_motive(cells: list[list[str]], number: int, name: str) -> _Columns:
    head = dict(zip(cells[0][::2], cells[0][1::2], strict=False))
    titles = cells[number]
    above = [[*row, *[""] * (len(titles) - len(row))] for row in cells[:number]]
    rows = {row[1].lower(): row for row in above if row[1]}
    what = next((row for row in above if "Position" in row), None)
    kinds, names = rows.get("type"), rows.get("name")
    if what is None or kinds is None or names is None:
        raise UnreadableFile(
            "expected Motive's rows Type, Name and Position above Frame, Time; export "
            "with header information",
            file=name,
        )
    groups: dict[tuple[str, str], list[int]] = {}
    for i, title in enumerate(titles):
        if title.lower() in ("x", "y", "z") and what[i] == "Position":
            groups.setdefault((kinds[i].lower(), names[i]), []).append(i)
    there = {kind for kind, _ in groups}
    kind = next((kind for kind in _KINDS if kind in there), "")
    chosen = {n: p for (k, n), p in groups.items() if k == kind and len(p) == 3}
    if not chosen:
        raise UnreadableFile("no positions of bones, rigid bodies or markers found", file=name)
    rate = head.get("Export Frame Rate") or head.get("Capture Frame Rate") or ""
    return _Columns(
        [title.rpartition(":")[2] for title in chosen],
        list(chosen.values()),
        len(titles),
        number + 1,
        time=1,
        frame=0,
        rate_hz=parse_number(rate),
        unit=head.get("Length Units", ""),
    )


def _of_nexus(cells: list[list[str]], number: int, name: str) -> _Columns:
    titles, names = cells[number], cells[number - 1]
    starts = [i for i, title in enumerate(names) if title and 1 < i < len(titles) - 2]
    if not starts:
        raise UnreadableFile("names no markers in the line before Frame, Sub Frame", file=name)
    units = cells[number + 1] if number + 1 < len(cells) else []
    rate = next((row[0] for row in cells[:number] if row and parse_number(row[0]) > 0), "")
    return _Columns(
        [names[i].rpartition(":")[2] for i in starts],
        [[i, i + 1, i + 2] for i in starts],
        len(titles),
        number + 2,
        frame=0,
        rate_hz=parse_number(rate),
        unit=next((cell for cell in units if cell), ""),
    )


def _of_plain(row: list[str], number: int, name: str) -> _Columns:
    found: dict[str, dict[str, int]] = {}
    for i, title in enumerate(row):
        match = _COORDINATE.fullmatch(title)
        if match:
            found.setdefault(match[1], {})[match[2].lower()] = i
    points = {point: axes for point, axes in found.items() if len(axes) == 3}
    if not points:
        raise UnreadableFile(
            "expected a table of points with columns such as hip_x, hip_y, hip_z, got "
            f"{', '.join(row)[:80]!r}; angles and labels are no places",
            file=name,
        )
    lower = [title.lower() for title in row]
    time = next((i for i, title in enumerate(lower) if title in _TIMES), None)
    return _Columns(
        list(points),
        [[axes[axis] for axis in "xyz"] for axes in points.values()],
        len(row),
        number + 1,
        time=time,
        time_scale=1.0 if time is None else _TIMES[lower[time]],
        frame=next((i for i, title in enumerate(lower) if title in _FRAMES), None),
    )
