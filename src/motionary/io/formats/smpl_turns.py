"""Turns of SMPL's joints, whichever way they are written: told by shape and value.

Files write a turn as a rotation vector (radians, by mistake degrees), as a matrix of nine
numbers, as six of them (two columns, or two rows), or as a unit quaternion with w first or last.
Numbers of matrices are orthonormal, quaternions have length one; what is neither are vectors.
Whether six numbers in sequence are rows or columns no value tells: a knee bends but one way.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import UnreadableFile
from motionary.rotations import matrices_to_quaternions, rotation_vectors_to_quaternions

Floats = NDArray[np.float64]

_TOLERANCE = 2e-2
_LOOKED_AT = 200
# A joint turns by less than half a turn; vectors that were never wrapped may go on a while.
_LARGEST_RAD = 2 * np.pi
_MANY = 0.05
_LEFT_KNEE, _RIGHT_KNEE = 4, 5


class Turns(NamedTuple):
    """Unit quaternions wxyz, (frames, joints, 4), and notes on how they were written."""

    quaternions: Floats
    notes: tuple[str, ...]


def read_turns(numbers: Floats, per_joint: int | None, n_joints: int, source: str) -> Turns:
    """Turns of the first joints.

    Parameters
    ----------
    numbers : array, shape (frames, numbers of all joints)
    per_joint : numbers of a joint, where the shape of the array in the file says it
    n_joints : joints that are wanted
    source : name of the file

    Raises
    ------
    UnreadableFile
        If the numbers are no turns that are known.
    """
    some = numbers[:: 1 + len(numbers) // _LOOKED_AT]
    for kind in _KINDS:
        if per_joint not in (None, kind.size) or numbers.shape[1] % kind.size:
            continue
        if numbers.shape[1] < n_joints * kind.size:
            continue
        if kind.fits(some.reshape(len(some), -1, kind.size)):
            wanted = numbers[:, : n_joints * kind.size].reshape(len(numbers), n_joints, -1)
            return kind.read(wanted)
    shape = numbers.shape if per_joint is None else (len(numbers), "joints", per_joint)
    raise UnreadableFile(
        f"turns of shape {shape} of {n_joints} joints or more are neither rotation "
        f"vectors (3 numbers a joint), nor matrices (9), two of their columns (6) or unit "
        "quaternions (4)",
        file=source,
    )


def _are_unit(vectors: Floats) -> bool:
    return bool((np.abs(np.linalg.norm(vectors, axis=-1) - 1) < _TOLERANCE).all())


def _are_square(a: Floats, b: Floats) -> bool:
    """Whether vectors are of length one and at right angles."""
    return _are_unit(a) and _are_unit(b) and bool((np.abs((a * b).sum(-1)) < _TOLERANCE).all())


def _are_matrices(numbers: Floats) -> bool:
    a, b, c = np.moveaxis(numbers.reshape(*numbers.shape[:-1], 3, 3), -2, 0)
    return _are_square(a, b) and bool((np.abs(np.cross(a, b) - c) < _TOLERANCE).all())


def _matrices(numbers: Floats) -> Turns:
    matrices = numbers.reshape(*numbers.shape[:-1], 3, 3)
    return Turns(matrices_to_quaternions(matrices), ("turns are rotation matrices",))


def _are_columns_in_turn(numbers: Floats) -> bool:
    return _are_square(numbers[..., ::2], numbers[..., 1::2])


def _columns_in_turn(numbers: Floats) -> Turns:
    turns = _complete(numbers[..., ::2], numbers[..., 1::2])
    return Turns(turns, ("turns are two columns of a matrix (6 numbers), row by row",))


def _are_two_vectors(numbers: Floats) -> bool:
    return _are_square(numbers[..., :3], numbers[..., 3:])


def _two_vectors(numbers: Floats) -> Turns:
    by_columns = _complete(numbers[..., :3], numbers[..., 3:])
    # About x a knee bends forward: backwards by the wrong reading, which is the inverse.
    bends = by_columns[:, [_LEFT_KNEE, _RIGHT_KNEE], 1] * np.sign(
        by_columns[:, [_LEFT_KNEE, _RIGHT_KNEE], 0]
    )
    are_rows = bool(bends.mean() < 0)
    if are_rows:
        by_columns = by_columns * (1.0, -1.0, -1.0, -1.0)
    what = "rows" if are_rows else "columns"
    return Turns(by_columns, (f"turns are two {what} of a matrix (6 numbers), by the knees",))


def _complete(a: Floats, b: Floats) -> Floats:
    """Quaternions of matrices by their first two columns."""
    a = a / np.linalg.norm(a, axis=-1, keepdims=True)
    b = b - (a * b).sum(-1, keepdims=True) * a
    b = b / np.linalg.norm(b, axis=-1, keepdims=True)
    return matrices_to_quaternions(np.stack((a, b, np.cross(a, b)), axis=-1))


def _quaternions(numbers: Floats) -> Turns:
    # Most joints turn little: the largest component is the cosine.
    first, last = np.abs(numbers[..., 0]).mean(), np.abs(numbers[..., 3]).mean()
    w_is_last = bool(last > first)
    quaternions = np.roll(numbers, 1, axis=-1) if w_is_last else numbers
    quaternions = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    quaternions = np.where(quaternions[..., :1] < 0, -quaternions, quaternions)
    return Turns(quaternions, (f"turns are quaternions, w {'last' if w_is_last else 'first'}",))


def _vectors(numbers: Floats) -> Turns:
    lengths = np.linalg.norm(numbers[:, 1:], axis=-1)
    notes: tuple[str, ...] = ()
    if lengths.size and (lengths > _LARGEST_RAD).mean() > _MANY:
        numbers = np.radians(numbers)
        notes = (f"turns are in degrees, by their size (up to {lengths.max():.0f})",)
    return Turns(rotation_vectors_to_quaternions(numbers), notes)


class _Kind(NamedTuple):
    """A way to write turns: numbers of a joint, whether some are, and what they say."""

    size: int
    fits: Callable[[Floats], bool]
    read: Callable[[Floats], Turns]


_KINDS = (
    _Kind(9, _are_matrices, _matrices),
    _Kind(6, _are_columns_in_turn, _columns_in_turn),
    _Kind(6, _are_two_vectors, _two_vectors),
    _Kind(4, _are_unit, _quaternions),
    _Kind(3, lambda numbers: True, _vectors),
)
