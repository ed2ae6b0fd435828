"""Rotations: quaternions, matrices and angles, joined and applied.

Conventions: right-handed, angles in radians, matrices act on column vectors from the
left, quaternions are unit and `wxyz`; leading axes of arrays are free. Components are
the last axes but lie first in memory, so that arithmetic runs along frames.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput

Floats = NDArray[np.float64]

_NEARLY_EQUAL = 1e-6


def unit_vectors(vectors: ArrayLike) -> Floats:
    """Vectors of length one; NaN where the length is zero, shape (..., 3)."""
    given = np.asarray(vectors, dtype=np.float64)
    length = np.linalg.norm(given, axis=-1, keepdims=True)
    result = np.full_like(given, np.nan)
    np.divide(given, length, out=result, where=length > 0)
    return result


def euler_to_quaternions(angles: Floats, order: str) -> Floats:
    """Quaternions of turns about the axes named in `order`, the first one outermost.

    `order` "ZYX" gives Rz Ry Rx: turns about the moving axes z, y, x, in this sequence,
    or about the fixed axes x, y, z.

    Parameters
    ----------
    angles : array, shape (..., n), radians, as named in `order`
    order : n letters of "XYZ", in any sequence, repeated or missing ones allowed

    Returns
    -------
    array, shape (..., 4), unit quaternions wxyz
    """
    axes = check_order(order)
    angles = np.asarray(angles, dtype=np.float64)
    if angles.shape[-1:] != (len(axes),):
        raise InvalidInput(
            f"order {order!r} needs {len(axes)} angles, got an array of shape {angles.shape}"
        )
    result = np.zeros((4, *angles.shape[:-1]))
    result[0] = 1.0
    cosines, sines = np.cos(angles / 2), np.sin(angles / 2)
    for i, axis in enumerate(axes):
        _turn_about_axis(result, axis, cosines[..., i], sines[..., i])
    return np.moveaxis(result, 0, -1)


def check_order(order: str) -> list[int]:
    """Axis numbers 0-2 of a rotation order such as "ZXY"."""
    axes = ["XYZ".find(letter) for letter in order.upper()]
    if -1 in axes:
        raise InvalidInput(f"a rotation order has letters X, Y and Z only, got {order!r}")
    return axes


def _turn_about_axis(quaternions: Floats, axis: int, c: Floats, s: Floats) -> None:
    """Multiply (4, ...) in place, from the right, by a turn about a coordinate axis."""
    i, j, k = 1 + axis, 1 + (axis + 1) % 3, 1 + (axis + 2) % 3
    for a, b, sign in ((0, i, -1.0), (j, k, 1.0)):
        first, second = quaternions[a], quaternions[b]
        quaternions[a], quaternions[b] = (
            c * first + sign * s * second,
            c * second - sign * s * first,
        )


def multiply_quaternions(left: Floats, right: Floats) -> Floats:
    """Product of quaternions wxyz: first the right turn, then the left one."""
    w1, x1, y1, z1 = np.moveaxis(np.asarray(left), -1, 0)
    w2, x2, y2, z2 = np.moveaxis(np.asarray(right), -1, 0)
    return np.stack(
        (
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        ),
        axis=-1,
    )


def conjugate_quaternions(quaternions: Floats) -> Floats:
    """The inverse turns of unit quaternions wxyz."""
    result = np.array(quaternions, dtype=np.float64)
    result[..., 1:] *= -1.0
    return result


def quaternions_to_matrices(quaternions: Floats) -> Floats:
    """Rotation matrices of unit quaternions wxyz, shape (..., 3, 3)."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions, dtype=np.float64), -1, 0)
    result = np.empty((3, 3, *w.shape))
    result[0, 0] = 1 - 2 * (y * y + z * z)
    result[0, 1] = 2 * (x * y - w * z)
    result[0, 2] = 2 * (x * z + w * y)
    result[1, 0] = 2 * (x * y + w * z)
    result[1, 1] = 1 - 2 * (x * x + z * z)
    result[1, 2] = 2 * (y * z - w * x)
    result[2, 0] = 2 * (x * z - w * y)
    result[2, 1] = 2 * (y * z + w * x)
    result[2, 2] = 1 - 2 * (x * x + y * y)
    return np.moveaxis(result, (0, 1), (-2, -1))


def matrices_to_quaternions(matrices: Floats) -> Floats:
    """Unit quaternions wxyz with w >= 0 of rotation matrices, shape (..., 4)."""
    m = np.asarray(matrices, dtype=np.float64)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    # Four times the square of each component; dividing by the largest keeps digits.
    squares = np.stack((1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz), -1)
    largest = squares.argmax(axis=-1)
    wx, wy, wz = (m[..., k, j] - m[..., j, k] for j, k in ((1, 2), (2, 0), (0, 1)))
    xy, xz, yz = (m[..., k, j] + m[..., j, k] for j, k in ((0, 1), (0, 2), (1, 2)))
    rows = np.stack(
        (
            np.stack((squares[..., 0], wx, wy, wz), -1),
            np.stack((wx, squares[..., 1], xy, xz), -1),
            np.stack((wy, xy, squares[..., 2], yz), -1),
            np.stack((wz, xz, yz, squares[..., 3]), -1),
        ),
        axis=-2,
    )
    row = np.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    result: Floats = row / np.linalg.norm(row, axis=-1, keepdims=True)
    result[result[..., 0] < 0] *= -1.0
    return result


def rotation_vectors_to_quaternions(vectors: ArrayLike) -> Floats:
    """Unit quaternions wxyz of turns about a vector by its length in radians, (..., 4)."""
    given = np.asarray(vectors, dtype=np.float64)
    half = np.linalg.norm(given, axis=-1) / 2
    result = np.empty((*given.shape[:-1], 4))
    result[..., 0] = np.cos(half)
    # sin(x) / x, also where x is 0; NumPy's sinc has a factor pi.
    result[..., 1:] = given * (np.sinc(half / np.pi) / 2)[..., None]
    return result


def quaternions_to_rotation_vectors(quaternions: ArrayLike) -> Floats:
    """Axis times angle in radians, at most half a turn, of unit quaternions wxyz, (..., 3)."""
    given = np.asarray(quaternions, dtype=np.float64)
    given = np.where(given[..., :1] < 0, -given, given)
    size = np.linalg.norm(given[..., 1:], axis=-1)
    # By the tangent: the cosine alone loses half the digits of small angles.
    angle = 2 * np.arctan2(size, given[..., 0])
    scale = np.full(size.shape, 2.0)
    np.divide(angle, size, out=scale, where=size > 1e-12)
    return np.asarray(given[..., 1:] * scale[..., None])


def rotation_vectors_to_matrices(vectors: ArrayLike) -> Floats:
    """Rotation matrices of turns about a vector by its length in radians, (..., 3, 3)."""
    return quaternions_to_matrices(rotation_vectors_to_quaternions(vectors))


def matrices_to_rotation_vectors(matrices: Floats) -> Floats:
    """Axis times angle in radians, at most half a turn, of rotation matrices, (..., 3)."""
    return quaternions_to_rotation_vectors(matrices_to_quaternions(matrices))


def shortest_turn(start: Floats, end: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) that turn unit vectors into others about their normal."""
    axis = np.cross(start, end)
    cosine = (start * end).sum(axis=-1)[..., None, None]
    cross = np.zeros((*axis.shape[:-1], 3, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = (
        -axis[..., 2],
        axis[..., 1],
        -axis[..., 0],
    )
    cross -= np.swapaxes(cross, -1, -2)
    # Opposite vectors have no one normal; what is left of the turn is then half a turn about any.
    result: Floats = np.eye(3) + cross + cross @ cross / np.maximum(1 + cosine, 1e-9)
    opposite = cosine[..., 0, 0] < -1 + 1e-9
    if np.any(opposite):
        start = np.broadcast_to(start, axis.shape)[opposite]
        side = np.cross(start, np.eye(3)[np.abs(start).argmin(axis=-1)])
        side = unit_vectors(side)
        result[opposite] = 2 * side[..., :, None] * side[..., None, :] - np.eye(3)
    return result


def slerp(before: Floats, after: Floats, fraction: Floats) -> Floats:
    """Unit quaternions that lie so far on the shorter arc between others; Shoemake (1985).

    Parameters
    ----------
    before, after : array, shape (frames, 4), in any order of components
    fraction : array, shape (frames, 1), 0 for `before` to 1 for `after`
    """
    cosine = (before * after).sum(axis=1, keepdims=True)
    after = np.where(cosine < 0, -after, after)
    angle = np.arccos(np.abs(cosine).clip(0.0, 1.0))
    sine = np.sin(angle)
    first, second = 1 - fraction, fraction
    # Of turns that are nearly equal the straight line is the arc.
    arc = sine > _NEARLY_EQUAL
    first = np.divide(np.sin(first * angle), sine, out=first.copy(), where=arc)
    second = np.divide(np.sin(second * angle), sine, out=second.copy(), where=arc)
    result: Floats = before * first + after * second
    return result


def continuous_signs(quaternions: Floats) -> Floats:
    """The same orientations (frames, 4), each with the sign that is nearer to the one before."""
    turned = np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0
    flips = np.concatenate([[False], np.logical_xor.accumulate(turned)])
    return np.where(flips[:, None], -quaternions, quaternions)


def quaternions_to_euler(quaternions: Floats, order: str) -> Floats:
    """Angles in radians that `euler_to_quaternions` turns into these quaternions.

    Parameters
    ----------
    quaternions : array, shape (..., 4), unit, wxyz
    order : the three letters of "XYZ" in any sequence

    Returns
    -------
    array, shape (..., 3), as named in `order`; the middle angle lies within a right angle,
    and where it is one, the last is 0
    """
    i, j, k = axes = check_order(order)
    if sorted(axes) != [0, 1, 2]:
        raise InvalidInput(f"angles need an order of three different letters, got {order!r}")
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    m = quaternions_to_matrices(quaternions)
    cosine = np.hypot(m[..., i, i], m[..., i, j])
    free = cosine > 1e-9
    first = np.arctan2(-sign * m[..., j, k], m[..., k, k])
    locked = np.arctan2(sign * m[..., k, j], m[..., j, j])
    last = np.arctan2(-sign * m[..., i, j], m[..., i, i])
    middle = np.arctan2(sign * m[..., i, k], cosine)
    return np.stack((np.where(free, first, locked), middle, np.where(free, last, 0.0)), axis=-1)


def rotate(quaternions: Floats, vectors: Floats) -> Floats:
    """Vectors turned by unit quaternions wxyz, shape (..., 3)."""
    axis = quaternions[..., 1:]
    across = 2.0 * np.cross(axis, vectors)
    result: Floats = vectors + quaternions[..., :1] * across + np.cross(axis, across)
    return result
