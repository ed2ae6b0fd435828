"""Alarms of the quality checks on recordings as they are, and on faults planted into them.

`python -m evidence.quality_checks` reads every recording below MOTIONARY_DATA, counts by source
those that raise an alarm, and plants each kind of fault into some of them. It prints JSON.
"""

import json
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import MotionaryError
from motionary.io import name_recordings, read
from motionary.io.normalise.anomalies import find_anomalies
from motionary.io.normalise.gaps import find_zeros
from motionary.io.normalise.quality import count_rest_frames
from motionary.motion import GENERIC_JOINTS, Motion

SEED = 20
#: Folders of recordings; in those of inputs with faults every alarm is right.
SOURCES = ("hdm05", "hdm05_takes", "cmu", "cmu_everyday", "accad", "bandai", "rigs", "ui_prmd")
#: Into every so many of a source's recordings faults are planted.
EVERY = 12
_SECONDS = 0.5

Floats = NDArray[np.float64]
Plant = Callable[[Floats, int, int], None]


def _freeze(places: Floats, start: int, stop: int) -> None:
    places[start:stop] = places[start]


def _repeat(places: Floats, start: int, stop: int) -> None:
    places[start:stop] = places[2 * start - stop : start]


def _hold(places: Floats, start: int, stop: int) -> None:
    joint = GENERIC_JOINTS.index("lwrist")
    places[start:stop, joint] = places[start, joint]


def _teleport(places: Floats, start: int, stop: int) -> None:
    places[start:stop] += np.array([2.0, 0.0, 0.0])


def _stretch(places: Floats, start: int, stop: int) -> None:
    places[start:stop, GENERIC_JOINTS.index("lknee")] += np.array([0.3, 0.0, 0.0])


def _swap(places: Floats, start: int, stop: int) -> None:
    pair = [GENERIC_JOINTS.index(joint) for joint in ("lwrist", "rwrist")]
    places[start:stop, pair] = places[start:stop, pair[::-1]]


def _still(places: Floats, start: int, _: int) -> None:
    places[:] = places[start]


def _zero(places: Floats, start: int, stop: int) -> None:
    places[start:stop] = 0.0


PLANTS: dict[str, Plant] = {
    "constant pose": _still,
    "frozen segment": _freeze,
    "repeated segment": _repeat,
    "held wrist": _hold,
    "teleport": _teleport,
    "knee moved": _stretch,
    "wrists exchanged": _swap,
    "zeros": _zero,
}


def measure(folder: Path) -> dict[str, Any]:
    """Alarms by source, and how many of the planted faults of each kind are told."""
    rng = np.random.default_rng(SEED)
    read_files, alarms, examples = Counter[str](), Counter[str](), []
    planted, told = Counter[str](), Counter[str]()
    for source in SOURCES:
        for number, (name, motion) in enumerate(_recordings(folder / source)):
            read_files[source] += 1
            notes = _alarms(motion)
            if notes:
                alarms[source] += 1
                examples.append(f"{source}/{name}: {notes[0]}")
            elif number % EVERY == 0 and motion.mapping is not None:
                for kind, found in _plant_all(motion, rng):
                    planted[kind] += 1
                    told[kind] += found
    return {
        "sources": {s: {"files": read_files[s], "alarms": alarms[s]} for s in SOURCES},
        "alarms": examples,
        "planted": {kind: {"files": planted[kind], "told": told[kind]} for kind in PLANTS},
    }


def _recordings(folder: Path) -> Iterator[tuple[str, Motion]]:
    if not folder.is_dir():
        return
    for name, path in name_recordings([folder]).items():
        try:
            yield name, read(path)
        except MotionaryError:
            continue


def _alarms(motion: Motion) -> list[str]:
    n_rest = count_rest_frames(motion.positions, motion.rate_hz)
    return find_anomalies(motion, first_frame=n_rest)


def _plant_all(motion: Motion, rng: np.random.Generator) -> Iterator[tuple[str, bool]]:
    """Each fault planted into the generic joints as points, and whether it is told."""
    body = motion.generic_positions()
    length = max(12, round(_SECONDS * motion.rate_hz))
    if motion.n_frames < 3 * length + 2:
        return
    for kind, plant in PLANTS.items():
        start = int(rng.integers(length, motion.n_frames - 2 * length))
        places = body.copy()
        plant(places, start, start + length)
        if kind == "zeros":
            yield kind, bool(find_zeros(places)[start : start + length].all())
            continue
        points = replace(
            motion, names=GENERIC_JOINTS, positions=places, skeleton=None, rotations=None,
            mapping=None,
        )  # fmt: skip
        yield kind, bool(_alarms(points))


if __name__ == "__main__":
    json.dump(measure(Path(os.environ["MOTIONARY_DATA"])), sys.stdout, indent=1)
