"""Arrays of motions in the layouts that data sets and generators of motion use.

Joint positions come as (frames, joints, 3), from generators as (joints, 3, frames), in batches
with one axis more in front. HumanML3D (Guo et al. 2022) writes 263 numbers a frame, of KIT's 21
joints 251: from them the positions are recovered. Motion-X (Lin et al. 2023) writes 322
parameters of a body.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import NotAMotion
from motionary.io.formats.npz import Array
from motionary.rotations import rotate

Floats = NDArray[np.float64]

MOTION_X = 322
MOTION_X_HZ = 30.0
HUMANML3D_HZ = 20.0
_HUMANML3D = ("HumanML3D", HUMANML3D_HZ, "humanml3d")
_KIT = ("KIT-ML", 12.5, "kit_ml")

# Numbers of a frame, by joints: turn, way and height of the root, places, turns, velocities of the
# joints, and whether heels and toes are on the floor.
_RECOVERED = {4 + 9 * (n - 1) + 3 * n + 4: n for n in (22, 21)}
# Bodies of fewer joints are none, and of more no order is known.
_JOINTS = range(5, 128)
# By how much bones may change: those of numbers that were normalised change without limit.
_STEADY = 0.25
_THIGHS = {22: ((1, 4), (2, 5)), 21: ((11, 12), (16, 17))}


class Layout(NamedTuple):
    """Motions of an array, how they lay in it, and rate and skeleton where it has but one."""

    motions: list[Array]
    notes: tuple[str, ...] = ()
    rate_hz: float | None = None
    skeleton: str = ""


def split_array(array: Array, source: str) -> Layout:
    """Motions of an array, each (frames, joints, 3), or (frames, 322) of Motion-X.

    Raises
    ------
    NotAMotion
        If the shape is none of those that are known.
    """
    if array.dtype.kind in "fiu" and array.size:
        if array.ndim in (2, 3) and array.shape[-1] in _RECOVERED:
            return _split_recovered(array, source)
        if array.ndim in (2, 3) and array.shape[-1] == MOTION_X:
            return Layout(_in_front(array, 2), (), MOTION_X_HZ)
        if array.ndim in (3, 4) and array.shape[-1] == 3:
            return Layout(_in_front(array, 3))
        if array.ndim in (3, 4) and array.shape[-2] == 3:
            return _split_transposed(array)
    raise NotAMotion(
        "holds no motion; expected joint positions (frames, joints, 3), (joints, 3, "
        f"frames), a batch of them, or 263, 251 or {MOTION_X} numbers a frame (HumanML3D, "
        f"Motion-X), got an array of shape {array.shape} and type {array.dtype}",
        file=source,
    )


def _in_front(array: Array, n_axes: int) -> list[Array]:
    """The motions of a batch, whose axis is in front; the array alone if there is none."""
    return list(array) if array.ndim > n_axes else [array]


def _split_transposed(array: Array) -> Layout:
    """(joints, 3, frames), or (frames, 3, joints) where only that is a number of joints."""
    first, last = array.shape[-3], array.shape[-1]
    frames_first = last in _JOINTS and (first not in _JOINTS or last < first)
    moved = [
        np.moveaxis(motion, 1, 2) if frames_first else np.moveaxis(motion, 2, 0)
        for motion in _in_front(array, 3)
    ]
    layout = "(frames, 3, joints)" if frames_first else "(joints, 3, frames)"
    return Layout(moved, (f"read as {layout}: {moved[0].shape[1]} joints, {len(moved[0])} frames",))


def _split_recovered(array: Array, source: str) -> Layout:
    n_joints = _RECOVERED[array.shape[-1]]
    motions: list[Array] = [recover_positions(motion) for motion in _in_front(array, 2)]
    for motion in motions:
        _check_thighs(motion, source)
    name, rate, skeleton = _HUMANML3D if n_joints == 22 else _KIT
    notes = (
        f"positions recovered of {name}'s {array.shape[-1]} numbers a frame",
        f"rate assumed {rate:g} Hz, as {name} has",
    )
    return Layout(motions, notes, rate, skeleton)


def recover_positions(numbers: Array) -> Floats:
    """Joint positions of the numbers of HumanML3D, shape (frames, joints, 3), y up.

    The first number is half the turn of the body to the next frame, the next two its way in its
    own direction, the fourth its height; then come places of the joints beside the root.
    """
    numbers = numbers.astype(np.float64)
    n_joints = _RECOVERED[numbers.shape[1]]
    half = np.zeros(len(numbers))
    half[1:] = np.cumsum(numbers[:-1, 0])
    # The turn back, from the body's direction to the world.
    turns = np.zeros((len(numbers), 4))
    turns[:, 0], turns[:, 2] = np.cos(half), -np.sin(half)
    way = np.zeros((len(numbers), 3))
    way[1:, 0], way[1:, 2] = numbers[:-1, 1], numbers[:-1, 2]
    root = np.cumsum(rotate(turns, way), axis=0)
    positions = np.empty((len(numbers), n_joints, 3))
    own = numbers[:, 4 : 4 + 3 * (n_joints - 1)].reshape(len(numbers), -1, 3)
    positions[:, 1:] = rotate(turns[:, None], own) + root[:, None]
    positions[:, 0] = root
    positions[:, 0, 1] = numbers[:, 3]
    return positions


def _check_thighs(positions: Floats, source: str) -> None:
    ends = np.array(_THIGHS[positions.shape[1]])
    lengths = np.linalg.norm(positions[:, ends[:, 0]] - positions[:, ends[:, 1]], axis=2)
    mean = np.nanmean(lengths)
    if not mean > 0 or np.nanstd(lengths, axis=0).max() > _STEADY * mean:
        raise NotAMotion(
            "holds no motion; "
            "its bones change their length, as where numbers of HumanML3D "
            "were normalised: multiply by Std.npy and add Mean.npy first",
            file=source,
        )
