"""Recordings of inertial sensors: Xsens MTw and MVNX, OpenSense, APDM, Movella DOT, BROAD, CSV.

Conventions: quaternions wxyz from sensor to a world with z up, rates in radians a
second, specific force in m/s² (9.81 upwards at rest), fields as the file has them; NaN = not known.
MTw of Xsens and BROAD were tried on real files; APDM, Movella DOT, OpenSense and tables of others
on files written after their documented layout.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, MotionaryError, UnreadableFile, Where, describe_cause
from motionary.files import NO_SUCH_FILE, open_regular
from motionary.io.formats.mvnx import read_mvnx_sensors
from motionary.io.formats.numbers import read_table, to_number
from motionary.io.options import ReadOptions
from motionary.io.sensor_recordings import (
    GRAVITY,
    SensorRecording,
    fill_packets,
    normalise_sensor,
    write_mtw,
    write_orientations,
)
from motionary.io.text import read_text, read_toml

__all__ = [
    "SENSOR_FORMATS", "SensorRecording", "read_sensor_file", "read_sensors", "write_mtw",
    "write_orientations",
]  # fmt: skip

Floats = NDArray[np.float64]

_UNITS = {
    "rad/s": 1.0, "deg/s": np.radians(1), "m/s2": 1.0, "mm/s2": 0.001, "g": GRAVITY,
    "ut": 1.0, "": 1.0,
}  # fmt: skip
_MOST_FILES = 500
_ORDERS = ("wxyz", "xyzw")
_COMMENTS = ("//", "#", "sep=")


def read_sensors(
    source: str | Path, *, columns: Mapping[str, Any] | str | Path | None = None
) -> list[SensorRecording]:
    """All sensors of a file or of the files in a folder, by name; copies of one are left out.

    Parameters
    ----------
    source : a file or a folder
    columns : of tables of no known layout: a mapping as in the documentation, or a TOML file

    Raises
    ------
    UnreadableFile
        If nothing in it can be read.
    """
    place = Path(source)
    if not place.exists():
        raise UnreadableFile(NO_SUCH_FILE, file=place)
    mapping = read_toml(Path(columns)) if isinstance(columns, str | Path) else columns
    if place.is_file():
        return read_sensor_file(place, columns=mapping)
    found: list[SensorRecording] = []
    problems = []
    files = sorted(path for path in place.iterdir() if path.suffix.lower() in SENSOR_FORMATS)
    for path in files[:_MOST_FILES]:
        try:
            found += read_sensor_file(path, columns=mapping)
        except MotionaryError as error:
            problems.append(str(error))
    if not found:
        said = f": {problems[0]}" if problems else ""
        raise UnreadableFile(
            f"no recordings of sensors ({', '.join(SENSOR_FORMATS)}) were read{said}",
            file=place.name,
        )
    single = _without_copies(found)
    notes = tuple(f"not read: {problem}" for problem in problems)
    return [replace(single[0], notes=single[0].notes + notes), *single[1:]]


def read_sensor_file(
    path: Path, *, columns: Mapping[str, Any] | None = None
) -> list[SensorRecording]:
    """The sensors of one file.

    Raises
    ------
    UnreadableFile
        If it is missing, damaged, or of no known layout.
    """
    reader = SENSOR_FORMATS.get(path.suffix.lower())
    if reader is None:
        raise UnreadableFile(
            f"recordings of sensors are {', '.join(SENSOR_FORMATS)} files", file=path.name
        )
    try:
        sensors = reader(path, columns)
    except InvalidInput as error:
        raise UnreadableFile(str(error), file=path.name) from error
    return [normalise_sensor(sensor) for sensor in sensors]


def _without_copies(sensors: Sequence[SensorRecording]) -> list[SensorRecording]:
    """Each recording once; of equal ones the first, and a note on which were left out."""
    kept: dict[bytes, SensorRecording] = {}
    for sensor in sensors:
        arrays = [one for one in (sensor.gyr, sensor.orientations) if one is not None]
        key = b"".join(np.ascontiguousarray(one).tobytes() for one in arrays)
        if key in kept:
            kept[key] = kept[key].noted(f"{sensor.name} holds the same numbers and is left out")
        else:
            kept[key] = sensor
    return sorted(kept.values(), key=lambda one: one.name)


def _read_text_file(path: Path, columns: Mapping[str, Any] | None) -> list[SensorRecording]:
    """MTw, Movella DOT, or a table with a mapping of its columns."""
    lines = read_text(path).split("\n")
    known = (i for i, line in enumerate(lines) if line.strip() and not line.startswith(_COMMENTS))
    start = next(known, len(lines) - 1)
    head, first = lines[:start], lines[start]
    separator = max(",;\t", key=first.count)
    titles = [title.strip().strip('"') for title in first.rstrip(",;").split(separator)]
    text = "\n".join(lines[start + 1 :])
    rows = read_table(
        text, len(titles), source=path.name, line=start + 2, separator=separator, gaps=("",)
    )
    if len(rows) < 2:
        raise UnreadableFile("has no rows of numbers", file=path.name)
    if columns is not None:
        return [_by_columns(path, titles, rows, columns)]
    if {"PacketCounter", "Quat_q0"} <= set(titles) or {"PacketCounter", "Gyr_X"} <= set(titles):
        return [_xsens(path, head, titles, rows)]
    raise UnreadableFile(
        f"has columns {', '.join(titles[:6])}, ... of no known layout; name them in a "
        "TOML file (columns=, --columns): gyr = [...], acc = [...], rate_hz = 100",
        file=path.name,
    )


def _pick(titles: Sequence[str], rows: Floats, names: Sequence[str]) -> Floats | None:
    if not set(names) <= set(titles):
        return None
    found = rows[:, [titles.index(name) for name in names]]
    return found if np.isfinite(found).any() else None


def _xsens(path: Path, head: Sequence[str], titles: Sequence[str], rows: Floats) -> SensorRecording:
    """MTw text (rates in rad/s) and Movella DOT (degrees a second, `Quat_W`)."""
    # MT Manager writes a head of comments, the DOT application none.
    is_dot = "Quat_W" in titles or not any(line.startswith("//") for line in head)
    rate, notes = None, []
    for line in head:
        if "Update Rate" in line:
            value = line.partition(":")[2].strip().rstrip("HhzZ").strip()
            rate = to_number(value, Where(file=path.name, place="Update Rate"))
    counter = rows[:, titles.index("PacketCounter")]
    filled, missing = fill_packets(counter, rows)
    fine = _pick(titles, filled, ["SampleTimeFine"])
    if rate is None and fine is not None:
        step = np.nanmedian(np.remainder(np.diff(fine[:, 0]), 2**32))
        rate = 1e6 / step if step > 0 else None
    if rate is None:
        rate = 60.0 if is_dot else 100.0
        notes.append(f"the file has no rate: {rate:g} Hz is assumed")
    if missing:
        notes.append(f"{missing} packets are missing")
    parts = "WXYZ" if "Quat_W" in titles else ("q0", "q1", "q2", "q3")
    quaternion = [f"Quat_{part}" for part in parts]
    gyr, acc, mag = (
        _pick(titles, filled, [f"{kind}_{axis}" for axis in "XYZ"])
        for kind in ("Gyr", "Acc", "Mag")
    )
    if gyr is not None and is_dot:
        gyr = np.radians(gyr)
        notes.append("rates of turn are read as degrees a second")
    turns = _pick(titles, filled, quaternion)
    return SensorRecording(_name_of(path), float(rate), gyr, acc, mag, turns, notes=tuple(notes))


def _name_of(path: Path) -> str:
    """The sensor's own name: what MT Manager puts behind the last underscore, else the file's."""
    tail = path.stem.rpartition("_")[2]
    return tail if len(tail) == 8 and tail.isalnum() and tail.upper() == tail else path.stem


def _by_columns(
    path: Path, titles: Sequence[str], rows: Floats, columns: Mapping[str, Any]
) -> SensorRecording:
    """A table whose columns, units and order somebody named."""
    known = {"gyr", "acc", "mag", "quaternion", "rate_hz", "units", "order", "time"}
    unknown = sorted(set(columns) - known)
    if unknown:
        raise InvalidInput(
            f"a map of columns has no key {unknown[0]!r}; {', '.join(sorted(known))}"
        )
    units = columns.get("units", {})
    order = columns.get("order", "wxyz")
    if order not in _ORDERS:
        raise InvalidInput(f"order needs to be wxyz or xyzw, got {order!r}")

    def take(key: str, width: int) -> Floats | None:
        names = columns.get(key)
        if names is None:
            return None
        if not isinstance(names, list) or len(names) != width or not set(names) <= set(titles):
            raise InvalidInput(
                f"{key} needs {width} of the columns {', '.join(titles[:12])}, got {names!r}"
            )
        unit = str(units.get(key, "")).lower().replace("°", "deg").replace("²", "2")
        if unit not in _UNITS:
            raise InvalidInput(
                f"units of {key} need to be one of {', '.join(_UNITS)}, got {unit!r}"
            )
        values: Floats = rows[:, [titles.index(name) for name in names]] * _UNITS[unit]
        return values

    turns = take("quaternion", 4)
    if turns is not None and order == "xyzw":
        turns = turns[:, [3, 0, 1, 2]]
    rate = columns.get("rate_hz")
    if rate is None and columns.get("time") in titles:
        rate = _rate_of(rows[:, titles.index(columns["time"])])
    if rate is None:
        raise InvalidInput("a map of columns needs rate_hz, or time with the column of seconds")
    return SensorRecording(
        _name_of(path), float(rate), take("gyr", 3), take("acc", 3), take("mag", 3), turns
    )


def _read_sto(path: Path, columns: Mapping[str, Any] | None) -> list[SensorRecording]:
    """Orientations of OpenSense: `time`, and four numbers with commas for each sensor."""
    lines = read_text(path).splitlines()
    end = next((i for i, line in enumerate(lines) if line.strip().lower() == "endheader"), None)
    if end is None or len(lines) < end + 4:
        problem = "an STO of orientations needs a line endheader and rows"
        raise UnreadableFile(problem, file=path.name)
    head = {
        key.strip().lower(): value.strip()
        for key, sign, value in (line.partition("=") for line in lines[:end])
        if sign
    }
    if head.get("datatype", "").lower() != "quaternion":
        raise UnreadableFile(
            "an STO of orientations says DataType=Quaternion, this one "
            f"{head.get('datatype') or 'nothing'}",
            file=path.name,
        )
    names = [title.removesuffix("_imu") for title in lines[end + 1].split("\t")[1:]]
    text = "\n".join(lines[end + 2 :]).replace(",", " ")
    try:
        rows = read_table(text, 1 + 4 * len(names), source=path.name, line=end + 3)
    except UnreadableFile as error:
        raise UnreadableFile(
            f"{error}; a row needs its time and four numbers w,x,y,z for each of {len(names)} "
            "sensors"
        ) from None
    rate = _rate_of(rows[:, 0])
    turns = rows[:, 1:].reshape(len(rows), -1, 4)
    return [SensorRecording(name, rate, orientations=turns[:, k]) for k, name in enumerate(names)]


def _rate_of(times: Floats) -> float:
    span = float(times[-1] - times[0]) if len(times) else 0.0
    return (len(times) - 1) / span if span > 0 else np.nan


def _read_mvnx(path: Path, columns: Mapping[str, Any] | None) -> list[SensorRecording]:
    sensors = read_mvnx_sensors(path, ReadOptions())
    acc = None if sensors.free else sensors.accelerations
    found = []
    for k, name in enumerate(sensors.names):
        own = None if acc is None or np.isnan(acc[:, k]).all() else acc[:, k]
        turns = sensors.orientations[:, k]
        found.append(SensorRecording(name, sensors.rate_hz, acc=own, orientations=turns))
    return found


def _read_hdf5(path: Path, columns: Mapping[str, Any] | None) -> list[SensorRecording]:
    """APDM's HDF5, and that of BROAD."""
    try:
        import h5py
    except ImportError as error:
        raise UnreadableFile(
            "HDF5 needs h5py: pip install 'motionary[imu]'", file=path.name
        ) from error
    with open_regular(path) as content:
        if content.read(4) != b"\x89HDF":
            raise UnreadableFile("is no HDF5 file", file=path.name)
    try:
        with h5py.File(path, "r") as file:
            if "imu_gyr" in file:
                return [_broad(path, file)]
            if "Sensors" in file:
                return [_apdm(file, str(key)) for key in sorted(file["Sensors"])]
            held = ", ".join(map(str, list(file)[:6]))
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        problem = f"is no readable HDF5 of sensors: {describe_cause(error)}"
        raise UnreadableFile(problem, file=path.name) from error
    raise UnreadableFile(f"holds {held}; sensors of APDM or BROAD were expected", file=path.name)


def _broad(path: Path, file: Any) -> SensorRecording:
    rate = float(file.attrs["sampling_rate"])
    gyr, acc, mag = (
        np.array(file[f"imu_{key}"], dtype=np.float64) for key in ("gyr", "acc", "mag")
    )
    return SensorRecording(path.stem, rate, gyr, acc, mag)


def _apdm(file: Any, key: str) -> SensorRecording:
    group = file["Sensors"][key]
    label = group["Configuration"].attrs.get("Label 0", key) if "Configuration" in group else key
    name = label.decode("utf-8", "replace") if isinstance(label, bytes) else str(label)
    times = np.array(group["Time"], dtype=np.float64) * 1e-6
    turns = None
    if "Processed" in file and key in file["Processed"]:
        turns = np.array(file["Processed"][key]["Orientation"], dtype=np.float64)
    gyr, acc, mag = (
        np.array(group[k], dtype=np.float64) if k in group else None
        for k in ("Gyroscope", "Accelerometer", "Magnetometer")
    )
    return SensorRecording(name.strip() or key, _rate_of(times), gyr, acc, mag, turns)


#: Suffixes of recordings of sensors, and what reads them.
SENSOR_FORMATS: dict[str, Callable[[Path, Mapping[str, Any] | None], list[SensorRecording]]] = {
    ".txt": _read_text_file,
    ".csv": _read_text_file,
    ".tsv": _read_text_file,
    ".mvnx": _read_mvnx,
    ".sto": _read_sto,
    ".h5": _read_hdf5,
    ".hdf5": _read_hdf5,
}
