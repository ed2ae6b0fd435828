"""Points in tables: CSV of OptiTrack Motive, of Vicon Nexus, and plain; .sto and .mot of OpenSim.

A plain table names its columns `joint_x,joint_y,joint_z` (or `joint.X`, `joint:x`, `joint x`)
in its first line, with or without a column of time or of frame numbers. Motive and Nexus write
lines before it that say rate, unit, and what stands in which column.

Tables of OpenSim hold whatever a tool computed. Places of points are read: tables of three-fold
cells (`DataType=Vec3`), and columns that come as `name_X`, `name_Y`, `name_Z`, as body
kinematics does. Joint angles are no places: without the model that they belong to nobody
knows where the joints are, so such a table is an error that says what to export.

Conventions: in CSV empty cells, and points whose coordinates are all zero, were not seen. OpenSim
has metres, y up, times in seconds.
"""

import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.formats.content import (
    POINT_UNITS,
    RATE_HINT,
    FileContent,
    hide_unseen,
    names_file,
    number_doubles,
)
from motionary.io.formats.numbers import UNKNOWN_NUMBERS, check_length, parse_number, read_table
from motionary.io.formats.times import timed_content
from motionary.io.normalise.units import NAMES_OF_UNITS, FileMetadata
from motionary.io.options import ReadOptions
from motionary.io.text import read_text
from motionary.rotations import Floats

# Lines before the frames: Motive writes seven, Nexus five.
_MOST_HEAD = 40
_COORDINATE = re.compile(r"(.+?)[ ._:/-]?\(?([xyz])\)?", re.IGNORECASE)
_TIMES = {"time": 1.0, "time_s": 1.0, "timestamp": 1.0, "seconds": 1.0, "t": 1.0,
          "time (seconds)": 1.0, "time_ms": 1e-3, "timestamp_ms": 1e-3}  # fmt: skip
_FRAMES = ("frame", "frame#", "frames", "frame_number")
# OpenSim's header ends so, and what it could not compute is written so.
_END, _MOST_HEADER = "endheader", 200
_GAPS = (*UNKNOWN_NUMBERS, "inf", "infinity")
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


@names_file
def read_csv(path: Path, options: ReadOptions) -> FileContent:
    """Content of a table of points."""
    text = read_text(path)
    lines = text.split("\n", _MOST_HEAD)
    first = next((line for line in lines if line.strip()), "")
    separator = max(",;\t", key=first.count)
    columns = _find_columns(list(csv.reader(lines[:_MOST_HEAD], delimiter=separator)))
    content = "".join(text.split("\n", columns.row)[columns.row :])
    values = read_table(
        content.replace(",", ".") if separator == ";" else content,
        columns.width,
        line=columns.row + 1,
        separator=separator,
        gaps=("", *UNKNOWN_NUMBERS),
    )
    if not len(values):
        raise UnreadableFile("holds no frames")
    places = values[:, columns.places]
    names = number_doubles(columns.names)
    notes = hide_unseen(places, names)
    times = None if columns.time is None else values[:, columns.time] * columns.time_scale
    if times is None and options.rate_hz is None and not columns.rate_hz > 0:
        raise InvalidInput(f"a table without times has no rate; {RATE_HINT}")
    return timed_content(
        names,
        places,
        times,
        options,
        metadata=FileMetadata(unit=NAMES_OF_UNITS.get(columns.unit.lower()), likely=POINT_UNITS),
        stated_hz=columns.rate_hz,
        first_frame=0 if columns.frame is None else values[0, columns.frame],
        notes=notes,
    )


def _find_columns(head: Sequence[Sequence[str]]) -> _Columns:
    cells = [[cell.strip() for cell in row] for row in head]
    for number, row in enumerate(cells):
        lower = [cell.lower() for cell in row]
        if lower[:2] == ["frame", "time (seconds)"]:
            return _of_motive(cells, number)
        if lower[:2] == ["frame", "sub frame"]:
            return _of_nexus(cells, number)
    for number, row in enumerate(cells):
        if any(row):
            return _of_plain(row, number)
    raise UnreadableFile("holds no rows")


def _of_motive(cells: list[list[str]], number: int) -> _Columns:
    head = dict(zip(cells[0][::2], cells[0][1::2], strict=False))
    titles = cells[number]
    above = [[*row, *[""] * (len(titles) - len(row))] for row in cells[:number]]
    rows = {row[1].lower(): row for row in above if row[1]}
    what = next((row for row in above if "Position" in row), None)
    kinds, names = rows.get("type"), rows.get("name")
    if what is None or kinds is None or names is None:
        raise UnreadableFile(
            "expected Motive's rows Type, Name and Position above Frame, Time; export "
            "with header information"
        )
    groups: dict[tuple[str, str], list[int]] = {}
    for i, title in enumerate(titles):
        if title.lower() in ("x", "y", "z") and what[i] == "Position":
            groups.setdefault((kinds[i].lower(), names[i]), []).append(i)
    there = {kind for kind, _ in groups}
    kind = next((kind for kind in _KINDS if kind in there), "")
    chosen = {n: p for (k, n), p in groups.items() if k == kind and len(p) == 3}
    if not chosen:
        raise UnreadableFile("no positions of bones, rigid bodies or markers found")
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


def _of_nexus(cells: list[list[str]], number: int) -> _Columns:
    titles, names = cells[number], cells[number - 1]
    starts = [i for i, title in enumerate(names) if title and 1 < i < len(titles) - 2]
    if not starts:
        raise UnreadableFile("names no markers in the line before Frame, Sub Frame")
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


def _of_plain(row: list[str], number: int) -> _Columns:
    found: dict[str, dict[str, int]] = {}
    for i, title in enumerate(row):
        match = _COORDINATE.fullmatch(title)
        if match:
            found.setdefault(match[1], {})[match[2].lower()] = i
    points = {point: axes for point, axes in found.items() if len(axes) == 3}
    if not points:
        raise UnreadableFile(
            "expected a table of points with columns such as hip_x, hip_y, hip_z, got "
            f"{', '.join(row)[:80]!r}; angles and labels are no places"
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


# -- OpenSim ------------------------------------------------------------------------------


@names_file
def read_opensim(path: Path, options: ReadOptions) -> FileContent:
    """Content of a .sto or .mot file; without a word about it in metres, y up."""
    header, titles, text, line = _split_header(read_text(path))
    width = len(titles)
    if header.get("datatype", "double").lower() == "vec3":
        names = titles[1:]
        if not names:
            raise UnreadableFile("has a column of times and no points")
        width, text = 1 + 3 * len(names), text.replace(",", " ")
        columns = np.arange(1, width).reshape(-1, 3)
    else:
        names, columns = _find_points(titles)
    values = read_table(text, width, line=line, gaps=_GAPS)
    check_length(header.get("nrows", ""), len(values), what="rows")
    places: Floats = values[:, columns]
    places[np.isnan(places).any(axis=2)] = np.nan
    if options.rate_hz is None and np.isnan(values[:, 0]).any():
        raise UnreadableFile(f"its times give no frame rate; {RATE_HINT}")
    metadata = FileMetadata(likely=POINT_UNITS)
    return timed_content(names, places, values[:, 0], options, metadata=metadata)


def _split_header(text: str) -> tuple[dict[str, str], list[str], str, int]:
    """Header, titles of the columns, rows as text, and the line at which rows begin."""
    lines = text.split("\n")
    header = {}
    ends = (i for i, line in enumerate(lines[:_MOST_HEADER]) if line.strip().lower() == _END)
    end = next(ends, None)
    if end is None:
        raise UnreadableFile(f"expected a table of OpenSim, found no line {_END!r}")
    for line in lines[:end]:
        key, _, value = line.partition("=")
        header[key.strip().lower()] = value.strip()
    start = next((i for i in range(end + 1, len(lines)) if lines[i].strip()), end)
    titles = lines[start].split()
    if titles[0].lower() != "time":
        raise UnreadableFile("expected columns that begin with time", place=f"line {start + 1}")
    return header, titles, "\n".join(lines[start + 1 :]), start + 2


def _find_points(titles: list[str]) -> tuple[list[str], NDArray[np.intp]]:
    """Names of points and the places of their three columns, (points, 3)."""
    index = {title: i for i, title in enumerate(titles)}
    names = [
        t[:-2]
        for t in titles
        if t.endswith("_X") and {f"{t[:-2]}_Y", f"{t[:-2]}_Z"} <= index.keys()
    ]
    if not names:
        raise UnreadableFile(
            f"holds joint angles or other values ({', '.join(titles[1:4])}, ...), and no "
            "places of points: without the model nobody knows where joints are; export markers as "
            ".trc, or run OpenSim's body kinematics and read its *_pos_global.sto"
        )
    columns = [[index[f"{n}_{axis}"] for axis in "XYZ"] for n in names]
    return names, np.array(columns, dtype=np.intp)
