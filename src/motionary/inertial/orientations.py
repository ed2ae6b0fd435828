"""Distances, means and parts of orientations.

After Baak (2012), section 7.3: eqs. (7.2) and (7.10).

Conventions: unit quaternions wxyz, either sign; angles in degrees where a name says so.
"""

import numpy as np
from numpy.typing import NDArray

from motionary.rotations import (
    conjugate_quaternions,
    continuous_signs,
    multiply_quaternions,
    rotate,
    slerp,
)

Floats = NDArray[np.float64]

#: The turn from motionary's world, y up, to the sensors', z up: +90 degrees about x.
SENSORS_FROM_TRACKING = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])


def distance_deg(first: Floats, second: Floats) -> Floats:
    """Angle between orientations in degrees (7.2), by the tangent: exact near 0, too."""
    between = multiply_quaternions(conjugate_quaternions(first), second)
    size = np.linalg.norm(between[..., 1:], axis=-1)
    return np.asarray(np.degrees(2 * np.arctan2(size, np.abs(between[..., 0]))))


def heading(angle: Floats | float) -> Floats:
    """Turns about z by angles in radians, (..., 4)."""
    half = np.asarray(angle, dtype=np.float64) / 2
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1)


def swing_twist_deg(first: Floats, second: Floats, axis: Floats) -> tuple[Floats, Floats]:
    """The turn between orientations as degrees across an axis of the limb, and about it."""
    between = multiply_quaternions(conjugate_quaternions(first), second)
    along = between[..., 1:] @ axis
    twist = np.abs(np.degrees(2 * np.arctan2(along, between[..., 0])))
    twist = np.minimum(twist, 360 - twist)
    moved = rotate(between, np.broadcast_to(axis, (*between.shape[:-1], 3)))
    swing = np.degrees(
        np.arctan2(np.linalg.norm(np.cross(axis, moved), axis=-1), (moved * axis).sum(axis=-1))
    )
    return np.asarray(swing), np.asarray(twist)


def direction_distance_deg(first: Floats, second: Floats) -> Floats:
    """Angle between unit vectors in degrees."""
    across = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.asarray(np.degrees(np.arctan2(across, (first * second).sum(axis=-1))))


def resample_orientations(orientations: Floats, at: Floats) -> Floats:
    """Orientations at fractional frames, along the shortest arc; NaN outside and beside gaps."""
    n = len(orientations)
    known = np.asarray(~np.isnan(orientations).any(axis=1))
    smooth = continuous_signs(np.where(known[:, None], orientations, 1.0))
    left = np.clip(np.floor(at).astype(np.intp), 0, max(n - 2, 0))
    right = np.minimum(left + 1, n - 1)
    share = at - left
    result = slerp(smooth[left], smooth[right], share[:, None])
    result /= np.linalg.norm(result, axis=1, keepdims=True)
    near = np.asarray(known[left] | (share == 1)) & (known[right] | (share == 0))
    outside = (at < 0) | (at > n - 1) | ~near
    result[outside] = np.nan
    return result
