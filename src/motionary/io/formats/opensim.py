"""Points in tables of OpenSim (.sto, .mot).

These tables hold whatever a tool computed. Places of points are read: tables of three-fold
cells (`DataType=Vec3`), and columns that come as `name_X`, `name_Y`, `name_Z`, as body
kinematics does. Joint angles are no places: without the model that they belong to nobody
knows where the joints are, so such a table is an error that says what to export.

Conventions: metres, y up, times in seconds.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import UnreadableFile
from motionary.io.formats.content import (
    POINT_UNITS,
    RATE_HINT,
    FileContent,
    number_doubles,
)
from motionary.io.formats.numbers import UNKNOWN_NUMBERS, read_table
from motionary.io.formats.times import time_frames
from motionary.io.normalise.units import FileMetadata
from motionary.io.options import ReadOptions
from motionary.io.text import read_text

Floats = NDArray[np.float64]

_END = "endheader"
_MOST_HEADER = 200
# OpenSim writes so what it could not compute.
_GAPS = (*UNKNOWN_NUMBERS, "inf", "infinity")


class _Table(NamedTuple):
    """Header, titles of the columns, rows as text, and the line at which rows begin."""

    header: dict[str, str]
    titles: list[str]
    text: str
    line: int


def read_opensim(path: Path, options: ReadOptions) -> FileContent:
    """Content of a .sto or .mot file; without a word about it in metres, y up.

    Raises
    ------
    UnreadableFile
        If the file is missing or broken, holds joint angles, or no places of points.
    """
    table = _read_table(read_text(path), path.name)
    if table.header.get("datatype", "double").lower() == "vec3":
        names = table.titles[1:]
        if not names:
            raise UnreadableFile("has a column of times and no points", file=path.name)
        values = _read_rows(table, table.text.replace(",", " "), 1 + 3 * len(names), path.name)
        places = values[:, 1:].reshape(-1, len(names), 3)
    else:
        names, columns = _find_points(table.titles, path.name)
        values = _read_rows(table, table.text, len(table.titles), path.name)
        places = values[:, columns]
    places[np.isnan(places).any(axis=2)] = np.nan
    if options.rate_hz is None and np.isnan(values[:, 0]).any():
        raise UnreadableFile(f"its times give no frame rate; {RATE_HINT}", file=path.name)
    timed = time_frames(places, values[:, 0], options=options, source=path.name)
    return FileContent(
        names=number_doubles(names),
        positions=timed.positions,
        rate_hz=timed.rate_hz,
        source=path.name,
        metadata=FileMetadata(likely=POINT_UNITS),
        notes=timed.notes,
    )


def _read_table(text: str, name: str) -> _Table:
    lines = text.split("\n")
    header = {}
    ends = (i for i, line in enumerate(lines[:_MOST_HEADER]) if line.strip().lower() == _END)
    end = next(ends, None)
    if end is None:
        raise UnreadableFile(f"expected a table of OpenSim, found no line {_END!r}", file=name)
    for line in lines[:end]:
        key, _, value = line.partition("=")
        header[key.strip().lower()] = value.strip()
    start = next((i for i in range(end + 1, len(lines)) if lines[i].strip()), end)
    titles = lines[start].split()
    if titles[0].lower() != "time":
        raise UnreadableFile(
            "expected columns that begin with time", file=name, place=f"line {start + 1}"
        )
    return _Table(header, titles, "\n".join(lines[start + 1 :]), start + 2)


def _find_points(titles: list[str], name: str) -> tuple[list[str], NDArray[np.intp]]:
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
            ".trc, or run OpenSim's body kinematics and read its *_pos_global.sto",
            file=name,
        )
    columns = [[index[f"{n}_{axis}"] for axis in "XYZ"] for n in names]
    return names, np.array(columns, dtype=np.intp)


def _read_rows(table: _Table, text: str, width: int, name: str) -> Floats:
    rows = read_table(
        text, width, source=name, line=table.line, gaps=(*UNKNOWN_NUMBERS, "inf", "infinity")
    )
    promised = table.header.get("nrows", "")
    if promised.isdecimal() and int(promised[:20]) > len(rows):
        raise UnreadableFile(
            f"promises {promised[:20]} rows, the file ends after {len(rows)}; get the "
            "whole file, or correct the number to read what is there",
            file=name,
        )
    return rows
