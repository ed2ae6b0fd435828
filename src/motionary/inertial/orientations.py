"""Orientations of a sensor from what it measures, by VQF (Laidig and Seel 2023).

Offline and without the magnetometer unless asked: near the floor of a laboratory the field is
disturbed by more than any filter forgives. Heading is then free, and drifts a little. Also
distances, means and parts of orientations, after Baak (2012), eqs. (7.2) and (7.10).

Conventions: unit quaternions wxyz, either sign; angles in degrees where a name says so.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.inertial.synchronising import speeds_of_turn
from motionary.io.sensors import SensorRecording
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
# Radians a second that no limb of a person stays below.
_STILL = 0.05
# A field that varies by more of its size between its 5 and 95 % is not the earth's.
_STEADY = 0.25


def orient_all(
    sensors: Sequence[SensorRecording], *, fused: bool = False, magnetic: bool = False
) -> tuple[dict[str, Floats], list[str]]:
    """Orientations of each sensor by name, and notes on those that have none or doubtful ones.

    Parameters
    ----------
    sensors : of one system
    fused : take orientations that the files bring instead of fusing raw measurements
    magnetic : let magnetometers tell headings
    """
    found: dict[str, Floats] = {}
    notes = []
    for sensor in sensors:
        if sensor.name in found:
            notes.append(f"{sensor.name} is there twice; the second one is left out")
            continue
        raw = sensor.gyr is not None and sensor.acc is not None
        try:
            if sensor.orientations is not None and (fused or not raw):
                turns = sensor.orientations
            else:
                turns = orient(sensor, magnetic=magnetic)
                notes += _note_field(sensor) if magnetic else []
        except InvalidInput as error:
            notes.append(str(error))
            continue
        if np.nanmax(speeds_of_turn(turns, sensor.rate_hz), initial=0.0) < _STILL:
            notes.append(f"{sensor.name} does not move and is left out")
        else:
            found[sensor.name] = turns
    return found, notes


def _note_field(sensor: SensorRecording) -> list[str]:
    """A note where the magnetic field about a sensor is disturbed."""
    assert sensor.mag is not None
    sizes = np.linalg.norm(sensor.mag, axis=1)
    low, middle, high = np.nanpercentile(sizes, [5, 50, 95])
    if high - low <= _STEADY * middle:
        return []
    return [
        f"the field about {sensor.name} varies by {(high - low) / middle:.0%} of its size: a "
        "magnetometer cannot tell headings there"
    ]


def orient(sensor: SensorRecording, *, magnetic: bool = False, online: bool = False) -> Floats:
    """Orientations (frames, 4) wxyz from sensor to world, z up; NaN where nothing was measured.

    Parameters
    ----------
    sensor : with rates of turn and accelerations
    magnetic : whether its field tells the heading
    online : as a filter that knows no future gives them; settles within seconds

    Raises
    ------
    InvalidInput
        If a measurement is missing, or the package is not installed.
    """
    if sensor.gyr is None or sensor.acc is None or (magnetic and sensor.mag is None):
        raise InvalidInput(
            f"{sensor.name}: orientations need rates of turn and accelerations"
            + (" and the field" if magnetic else "")
        )
    try:
        import vqf
    except ImportError as error:
        raise InvalidInput(
            "orientations from raw measurements need vqf: pip install 'motionary[imu]'"
        ) from error
    known = np.asarray(~np.isnan(np.concatenate([sensor.gyr, sensor.acc], axis=1)).any(axis=1))
    if not known.any():
        raise InvalidInput(f"{sensor.name}: measured nothing")
    gyr, acc = _bridge(sensor.gyr, known), _bridge(sensor.acc, known)
    mag = _bridge(sensor.mag, known) if magnetic and sensor.mag is not None else None
    step = 1.0 / sensor.rate_hz
    key = "quat9D" if magnetic else "quat6D"
    if online:
        result: Any = vqf.VQF(step).updateBatch(gyr, acc, mag)[key]
    else:
        result = vqf.offlineVQF(gyr, acc, mag, step)[key]
    turned = np.array(result, dtype=np.float64)
    turned[~known] = np.nan
    return turned


def _bridge(values: Floats, known: NDArray[np.bool_]) -> Floats:
    """Values with straight lines over gaps, contiguous."""
    at = np.arange(len(values))
    columns = [np.interp(at, at[known], column[known]) for column in np.nan_to_num(values).T]
    return np.ascontiguousarray(np.stack(columns, axis=1))


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
