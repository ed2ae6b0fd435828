"""Limbs of a motion as sensors see them, in a world with z up, and sensors simulated on them."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body.driving import read_turns
from motionary.body.sensors import SensorSettings, simulate_sensor
from motionary.errors import InvalidInput
from motionary.inertial.orientations import SENSORS_FROM_TRACKING, resample_orientations
from motionary.inertial.synchronising import speeds_of_directions, speeds_of_turn
from motionary.io.sensors import SensorRecording
from motionary.motion import Motion, resample
from motionary.rotations import matrices_to_quaternions, multiply_quaternions, rotate

Floats = NDArray[np.float64]

#: What people usually wear.
WORN = ("root", "lthigh", "lshank", "lfoot", "rthigh", "rshank", "rfoot", "lforearm", "rforearm")

# So many times faster than a limb no sensor on it turns.
_OTHER_UNIT = 8.0


class TrackedLimbs(NamedTuple):
    """A motion's limbs in a world with z up: turns (frames, 4), else directions (frames, 3)."""

    turns: dict[str, Floats]
    directions: dict[str, Floats]
    axes: dict[str, Floats]
    rate_hz: float

    @property
    def limbs(self) -> list[str]:
        """Names of the limbs."""
        return [*self.turns, *(name for name in self.directions if name not in self.turns)]

    def speeds(self, limb: str) -> Floats:
        """How fast a limb turns, rad/s, (frames,)."""
        if limb in self.turns:
            return speeds_of_turn(self.turns[limb], self.rate_hz)
        return speeds_of_directions(self.directions[limb], self.rate_hz)


def track_limbs(motion: Motion) -> TrackedLimbs:
    """Limbs of a motion in the sensors' world.

    Raises
    ------
    UnknownSkeleton, NotHuman
        If the motion's joints are not known.
    """
    turns = read_turns(motion)
    quaternions = {
        bone: multiply_quaternions(SENSORS_FROM_TRACKING, matrices_to_quaternions(matrices))
        for bone, matrices in turns.turns.items()
    }
    directions = {
        bone: rotate(np.broadcast_to(SENSORS_FROM_TRACKING, (len(one), 4)), one)
        for bone, one in turns.directions().items()
        if np.isfinite(one).all(axis=1).sum() >= 20
    }
    return TrackedLimbs(quaternions, directions, turns.rest, motion.rate_hz)


def compare_speeds(
    tracked: TrackedLimbs, seen: Mapping[str, Floats], placed: Mapping[str, str]
) -> list[str]:
    """Notes on sensors that turn many times as fast or as slowly as their limbs."""
    notes = []
    for name, limb in sorted(placed.items()):
        own, of_limb = (
            np.nanpercentile(one, 90) if np.isfinite(one).any() else np.nan
            for one in (speeds_of_turn(seen[name], tracked.rate_hz), tracked.speeds(limb))
        )
        if own > _OTHER_UNIT * of_limb or of_limb > _OTHER_UNIT * own:
            notes.append(
                f"{name} turns {own / of_limb:.2g} times as fast as {limb}: rates of turn need "
                "radians a second, or a unit in a map of columns"
            )
    return notes


def simulate_sensors(
    motion: Motion,
    limbs: Sequence[str] | None = None,
    *,
    rate_hz: float = 100.0,
    settings: SensorSettings | None = None,
    seed: int = 0,
) -> list[SensorRecording]:
    """What sensors on limbs of a motion would have measured; synthetic.

    Accelerations are those of the root, turned into each limb: near enough for orientations.

    Parameters
    ----------
    motion : with rotations
    limbs : that wear one; of `WORN` those that the motion has if None
    rate_hz, settings, seed : of the sensors

    Raises
    ------
    InvalidInput
        If the turns of a limb are not known.
    """
    tracked = track_limbs(motion)
    chosen = [limb for limb in WORN if limb in tracked.turns] if limbs is None else limbs
    there = ", ".join(tracked.turns) or "none: the motion holds positions without rotations"
    for limb in chosen:
        if limb not in tracked.turns:
            raise InvalidInput(f"the turns of {limb!r} are not known; known are {there}")
    if not chosen:
        raise InvalidInput(f"no limb can wear a sensor; turns are known of {there}")
    n_frames = int((motion.n_frames - 1) / motion.rate_hz * rate_hz) + 1
    at = np.arange(n_frames) / rate_hz * motion.rate_hz
    root = resample(motion.generic_positions()[:, 0], rate_hz=motion.rate_hz, to_hz=rate_hz)
    places = rotate(np.broadcast_to(SENSORS_FROM_TRACKING, (n_frames, 4)), root[:n_frames])
    made = []
    for number, limb in enumerate(chosen):
        read = simulate_sensor(
            resample_orientations(tracked.turns[limb], np.asarray(at)),
            np.nan_to_num(places),
            rate_hz=rate_hz,
            settings=settings,
            seed=seed + number,
        )
        made.append(SensorRecording(limb, rate_hz, read.gyr, read.acc, read.mag))
    return made
