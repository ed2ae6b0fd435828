"""What a sensor recorded, and the checks that every format shares."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.text import write_text

Floats = NDArray[np.float64]

GRAVITY = 9.81
# Below: a single glitch is no motion; above, no sensor of people's limbs goes.
_MOST_RATE = 100.0
_MOST_FORCE = 2000.0


@dataclass(frozen=True, slots=True, eq=False)
class SensorRecording:
    """What one sensor recorded; arrays of (frames, ...) or None where the file has none.

    Attributes
    ----------
    name : the sensor's own, or where it is worn if the file says so
    rate_hz : frames per second
    gyr, acc, mag : (frames, 3): radians a second, m/s², as in the file
    orientations : (frames, 4), wxyz, from sensor to world, z up
    start_s : time of the first frame on the clock that sensors of a system share
    notes : what was assumed or noticed, one sentence each
    """

    name: str
    rate_hz: float
    gyr: Floats | None = None
    acc: Floats | None = None
    mag: Floats | None = None
    orientations: Floats | None = None
    start_s: float = 0.0
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.rate_hz) and 1 <= self.rate_hz <= 10_000):
            raise InvalidInput(
                f"{self.name}: a sensor needs a rate of 1 to 10000 Hz, got {self.rate_hz}"
            )
        if self.gyr is None and self.orientations is None:
            raise InvalidInput(f"{self.name}: has neither rates of turn nor orientations")
        lengths = {len(one) for one in self._arrays() if one is not None}
        if len(lengths) != 1:
            raise InvalidInput(f"{self.name}: arrays need one length, got {sorted(lengths)}")

    def __repr__(self) -> str:
        return f"SensorRecording({self.name!r}, {self.n_frames} frames at {self.rate_hz:g} Hz)"

    def _arrays(self) -> tuple[Floats | None, ...]:
        return self.gyr, self.acc, self.mag, self.orientations

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return next(len(one) for one in self._arrays() if one is not None)

    def noted(self, *notes: str) -> "SensorRecording":
        """The recording with more notes."""
        return replace(self, notes=self.notes + notes)


def normalise_sensor(sensor: SensorRecording) -> SensorRecording:
    """The recording with unit quaternions, impossible values unknown, and notes on both.

    Raises
    ------
    UnreadableFile
        If quaternions are none.
    """
    notes: list[str] = []
    turns, off = _unit_turns(sensor)
    if off:
        notes.append(f"{off} orientations of another length than 1 are left out")
    gyr, fast = _without_impossible(sensor.gyr, _MOST_RATE)
    if fast:
        notes.append(f"{fast} impossible rates of turn are left out")
    acc, hard = _without_impossible(sensor.acc, _MOST_FORCE)
    if hard:
        notes.append(f"{hard} impossible accelerations are left out")
    if acc is not None and np.isfinite(acc).any():
        rest = np.nanmedian(np.linalg.norm(acc, axis=1))
        if 0.8 < rest < 1.2:
            acc = acc * GRAVITY
            notes.append("accelerations are read as multiples of g")
    return replace(sensor, gyr=gyr, acc=acc, orientations=turns).noted(*notes)


def _unit_turns(sensor: SensorRecording) -> tuple[Floats | None, int]:
    """Unit quaternions, NaN where none was measured, and how many of another length were there."""
    if sensor.orientations is None:
        return None, 0
    length = np.linalg.norm(sensor.orientations, axis=1, keepdims=True)
    known = np.isfinite(length)
    if not known.any():
        return None, 0
    off = known & (np.abs(length - 1) > 0.05)
    if off.sum() > known.sum() / 2:
        raise UnreadableFile(
            f"{sensor.name}: columns are read as quaternions wxyz, but their length is "
            f"{np.median(length[known]):.3g} instead of 1"
        )
    return sensor.orientations / np.where(known & ~off, length, np.nan), int(off.sum())


def _without_impossible(values: Floats | None, most: float) -> tuple[Floats | None, int]:
    """Values with NaN where they are beyond what can be, and in how many frames that was."""
    if values is None:
        return None, 0
    beyond = np.abs(values) > most
    return np.where(beyond, np.nan, values), int(beyond.any(axis=1).sum())


def fill_packets(counter: Floats, rows: Floats, *, modulus: int = 65536) -> tuple[Floats, int]:
    """Rows at consecutive packets, NaN where one is missing, and how many are.

    The counter starts again at `modulus`.
    """
    steps = np.remainder(np.diff(counter), modulus)
    if np.any((steps < 1) | (steps > 10_000)) or len(rows) < 2:
        raise InvalidInput("packets are counted backwards or jump by more than 10000")
    at = np.concatenate([[0], np.cumsum(steps)]).astype(np.intp)
    filled = np.full((at[-1] + 1, rows.shape[1]), np.nan)
    filled[at] = rows
    return filled, len(filled) - len(rows)


def write_mtw(path: str | Path, sensor: SensorRecording) -> None:
    """Write a sensor as MT Manager of Xsens does: a text of rates, forces, field and turns."""
    head = f"// Start Time: Unknown\n// Update Rate: {sensor.rate_hz:.1f}Hz\n"
    columns = ["PacketCounter", "SampleTimeFine"]
    parts = []
    for names, values in (
        (("Acc_X", "Acc_Y", "Acc_Z"), sensor.acc),
        (("Gyr_X", "Gyr_Y", "Gyr_Z"), sensor.gyr),
        (("Mag_X", "Mag_Y", "Mag_Z"), sensor.mag),
        (("Quat_q0", "Quat_q1", "Quat_q2", "Quat_q3"), sensor.orientations),
    ):
        if values is not None:
            columns += names
            parts.append(values)
    rows = np.concatenate(parts, axis=1)
    lines = (
        ",".join([str(k % 65536), "", *("" if np.isnan(x) else f"{x:.6f}" for x in row)]) + "\n"
        for k, row in enumerate(rows)
    )
    write_text(path, chain([head, ",".join(columns) + "\n"], lines))


def write_orientations(
    path: str | Path, orientations: Mapping[str, Floats], rate_hz: float
) -> None:
    """Write orientations (frames, 4) of sensors as an STO file of OpenSense.

    What is not known is the orientation before it; the format has no gaps.
    """
    longest = max(map(len, orientations.values()))
    columns = []
    for turns in orientations.values():
        known = ~np.isnan(turns).any(axis=1)
        if not known.any():
            raise InvalidInput("a sensor has no known orientation to write")
        last = np.maximum.accumulate(np.where(known, np.arange(len(turns)), known.argmax()))
        columns.append(turns[np.pad(last, (0, longest - len(last)), mode="edge")])
    head = (
        f"DataRate={rate_hz:.6f}\nDataType=Quaternion\nversion=3\nOpenSimVersion=4.1\nendheader\n"
    )
    titles = "\t".join(["time", *(f"{name}_imu" for name in orientations)]) + "\n"

    def format_row(frame: int) -> str:
        turns = (",".join(f"{x:.9f}" for x in one[frame]) for one in columns)
        return "\t".join([f"{frame / rate_hz:.6f}", *turns]) + "\n"

    write_text(path, chain([head, titles], map(format_row, range(longest))))
