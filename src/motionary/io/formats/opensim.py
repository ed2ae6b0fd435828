"""Where were points, according to a table of OpenSim (.sto, .mot)?

These tables hold whatever a tool computed. Places of points are read: tables of three-fold
cells (`DataType=Vec3`), and columns that come as `name_X`, `name_Y`, `name_Z`, as body
kinematics does. Joint angles are no places: without the model that they belong to nobody
knows where the joints are, so such a table is an error that says what to export.

Conventions: metres, y up, times in seconds.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import UnreadableFile
from motionary.io.formats.points import Points, number_doubles, to_motion
from motionary.io.text import read_text
from motionary.motion import Motion
from motionary.skeletons import SkeletonTable

Floats = NDArray[np.float64]

_END = "endheader"
_MOST_HEADER = 200
_EVEN = 0.02
_LATEST_S = 1e9


class _Table(NamedTuple):
    """Header, titles of the columns, rows as cells, and the line at which rows begin."""

    header: dict[str, str]
    titles: list[str]
    lines: list[str]
    line: int


def read_opensim(
    path: str | Path,
    *,
    rate_hz: float | None = None,
    skeleton: SkeletonTable | None = None,
    unit: float | str | None = None,
    up: str | None = None,
) -> Motion:
    """Read points of a .sto or .mot file.

    Parameters
    ----------
    path : the file
    skeleton : what the points are; by default what their names tell
    rate_hz, unit, up : as in `read`; by default what OpenSim has: its times, metres, y up

    Raises
    ------
    UnreadableFile
        If the file is missing or broken, holds joint angles, or no places of points.
    """
    path = Path(path)
    table = _read_table(read_text(path), path.name)
    if table.header.get("datatype", "double").lower() == "vec3":
        names = table.titles[1:]
        times, places = _read_threefold(table, path.name)
    else:
        names, columns = _find_points(table.titles, path.name)
        values = _read_plain(table, path.name)
        times, places = values[:, 0], values[:, columns]
    places[np.isnan(places).any(axis=2)] = np.nan
    points = Points(
        names=number_doubles(names),
        positions=places,
        rate_hz=_rate(times, path.name) if rate_hz is None else rate_hz,
        source=path.name,
        skeleton=skeleton,
        usual_unit="m",
        usual_up="y",
    )
    return to_motion(points, unit=unit, up=up)


def _read_table(text: str, name: str) -> _Table:
    lines = text.split("\n")
    header = {}
    ends = (i for i, line in enumerate(lines[:_MOST_HEADER]) if line.strip().lower() == _END)
    end = next(ends, None)
    if end is None:
        raise UnreadableFile(f"{name}: expected a table of OpenSim, found no line {_END!r}")
    for line in lines[:end]:
        key, _, value = line.partition("=")
        header[key.strip().lower()] = value.strip()
    start = next((i for i in range(end + 1, len(lines)) if lines[i].strip()), end)
    titles = lines[start].split()
    if titles[0].lower() != "time":
        raise UnreadableFile(f"{name}, line {start + 1}: expected columns that begin with time")
    return _Table(header, titles, lines[start + 1 :], start + 2)


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
            f"{name}: holds joint angles or other values ({', '.join(titles[1:4])}, ...), and no "
            "places of points: without the model nobody knows where joints are; export markers as "
            ".trc, or run OpenSim's body kinematics and read its *_pos_global.sto"
        )
    columns = [[index[f"{n}_{axis}"] for axis in "XYZ"] for n in names]
    return names, np.array(columns, dtype=np.intp)


def _read_plain(table: _Table, name: str) -> Floats:
    rows = [
        _numbers(line.split(), len(table.titles), where) for line, where in _filled(table, name)
    ]
    return np.array(rows).reshape(-1, len(table.titles))


def _read_threefold(table: _Table, name: str) -> tuple[Floats, Floats]:
    n_points = len(table.titles) - 1
    rows = [
        _numbers(line.replace(",", " ").split(), 1 + 3 * n_points, where)
        for line, where in _filled(table, name)
    ]
    values = np.array(rows).reshape(-1, 1 + 3 * n_points)
    return values[:, 0], values[:, 1:].reshape(-1, n_points, 3)


def _filled(table: _Table, name: str) -> list[tuple[str, str]]:
    """Rows that hold something, each with its place for errors."""
    return [
        (line, f"{name}, line {number}")
        for number, line in enumerate(table.lines, start=table.line)
        if line.strip()
    ]


def _numbers(words: list[str], count: int, where: str) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        raise UnreadableFile(f"{where}: expected numbers") from None
    if len(values) != count:
        raise UnreadableFile(f"{where}: expected {count} numbers, got {len(values)}")
    return [value if math.isfinite(value) else math.nan for value in values]


def _rate(times: Floats, name: str) -> float:
    # NaN and numbers that no clock shows give no rate.
    steps = np.diff(times) if (np.abs(times) < _LATEST_S).all() else np.empty(0)
    step = float(np.median(steps)) if len(steps) else math.nan
    if not 1e-6 < step < 1e6:
        raise UnreadableFile(
            f"{name}: its times give no frame rate; pass it with --rate (rate_hz=...)"
        )
    if np.abs(steps / step - 1).max() > _EVEN:
        raise UnreadableFile(f"{name}: its frames are not evenly spaced in time; resample it")
    rate = 1 / step
    return float(round(rate)) if abs(rate - round(rate)) < 1e-3 * rate else rate
