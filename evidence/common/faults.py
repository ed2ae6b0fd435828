"""Faults of a while, planted into points: what programs and cameras do and no body does.

Each changes positions in place, shape (frames, points, 3), from a start to a stop; it is told which
points a joint stands on. And alarms of the same checks on recordings that have none.
"""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import MotionaryError
from motionary.io import find_recordings, read
from motionary.io.normalise.quality import count_rest_frames, find_anomalies
from motionary.motion import Motion

Floats = NDArray[np.float64]

CONSTANT = "constant pose"
#: So long another fault lasts.
PLANTED_S = 0.5

Of = Callable[[str], list[int]]
Plant = Callable[[Floats, int, int, Of], None]


def _freeze(places: Floats, start: int, stop: int, of: Of) -> None:
    places[start:stop] = places[start]


def _repeat(places: Floats, start: int, stop: int, of: Of) -> None:
    places[start:stop] = places[2 * start - stop : start]


def _hold(places: Floats, start: int, stop: int, of: Of) -> None:
    places[start:stop, of("lwrist")] = places[start, of("lwrist")]


def _teleport(places: Floats, start: int, stop: int, of: Of) -> None:
    places[start:stop] += np.array([2.0, 0.0, 0.0])


def _stretch(places: Floats, start: int, stop: int, of: Of) -> None:
    places[start:stop, of("lknee")] += np.array([0.3, 0.0, 0.0])


def _exchange_wrists(places: Floats, start: int, stop: int, of: Of) -> None:
    left, right = of("lwrist"), of("rwrist")
    places[start:stop, left + right] = places[start:stop, right + left]


def _still(places: Floats, start: int, _: int, of: Of) -> None:
    places[:] = places[start]


def _zero(places: Floats, start: int, stop: int, of: Of) -> None:
    places[start:stop] = 0.0


PLANTS: dict[str, Plant] = {
    CONSTANT: _still,
    "frozen segment": _freeze,
    "repeated segment": _repeat,
    "wrist held": _hold,
    "teleport": _teleport,
    "knee moved": _stretch,
    "wrists exchanged": _exchange_wrists,
    "zeros": _zero,
}


def plant(
    kind: str, motion: Motion, rng: np.random.Generator
) -> tuple[Motion, tuple[float, float] | None]:
    """Points with a fault at a time that is drawn, and its seconds; of a pose that stays, none."""
    if motion.mapping is None:
        raise ValueError(f"{motion.source}: has no mapping")
    length = max(12, min(round(PLANTED_S * motion.rate_hz), motion.n_frames // 4))
    start = int(rng.integers(length, max(length + 1, motion.n_frames - 2 * length)))
    positions, weights = motion.positions.copy(), motion.mapping.weights
    index = {name: i for i, name in enumerate(motion.names)}
    stop = start + length
    PLANTS[kind](positions, start, stop, lambda joint: [index[n] for n in weights.get(joint, ())])
    part = None if kind == CONSTANT else (start / motion.rate_hz, stop / motion.rate_hz)
    return replace(motion, positions=positions, skeleton=None, rotations=None), part


def with_gaps(motion: Motion, rng: np.random.Generator) -> Motion:
    """The motion with a tenth of its points not seen for 0.1 to 1 s, three times over."""
    positions = motion.positions.copy()
    n_frames, n_points = positions.shape[:2]
    for point in rng.choice(n_points, max(1, n_points // 10), replace=False):
        for _ in range(3):
            length = round(rng.uniform(0.1, 1.0) * motion.rate_hz)
            start = int(rng.integers(max(1, n_frames - length)))
            positions[start : start + length, point] = np.nan
    return replace(motion, positions=positions)


#: Folders of recordings that nobody planted anything into.
ALARMED = ("hdm05", "hdm05_takes", "cmu", "cmu_everyday", "accad", "bandai", "rigs", "ui_prmd")


@cache
def count_alarms(folder: Path) -> dict[str, Any]:
    """Of every recording as it is, by source: how many raise an alarm that something is wrong."""
    rows: dict[str, Any] = {}
    for source in ALARMED:
        row = rows[source] = {
            "files": 0,
            "alarms": 0,
            "untold": 0,
            "in_place": 0,
            "minutes": 0.0,
            "which": [],
        }
        for motion in _readable(folder / source):
            alarms = find_anomalies(
                motion, first_frame=count_rest_frames(motion.positions, motion.rate_hz)
            )
            row["files"] += 1
            row["minutes"] += motion.n_frames / motion.rate_hz / 60
            row["alarms"] += bool(alarms)
            row["untold"] += any("does not tell" in note for note in motion.notes)
            row["in_place"] += motion.in_place
            row["which"] += [f"{motion.source}: {alarms[0]}"] if alarms else []
    return rows


def extent_of_alarms(folder: Path) -> tuple[int, float]:
    """Recordings that were looked at, and their minutes."""
    rows = count_alarms(folder)
    minutes = sum(row["minutes"] for row in rows.values())
    return sum(row["files"] for row in rows.values()), round(minutes, 2)


def _readable(folder: Path) -> Iterator[Motion]:
    for path in find_recordings(folder):
        with contextlib.suppress(MotionaryError):
            yield read(path)
