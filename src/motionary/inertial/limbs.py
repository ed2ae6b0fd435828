"""Limbs of a motion as sensors see them: turns, or directions, in a world with z up."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body.driving import read_turns
from motionary.inertial.orientations import SENSORS_FROM_TRACKING
from motionary.inertial.synchronising import speeds_of_directions, speeds_of_turn
from motionary.motion import Motion
from motionary.rotations import matrices_to_quaternions, multiply_quaternions, rotate

Floats = NDArray[np.float64]


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
