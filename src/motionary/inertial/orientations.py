"""Orientations of sensors from what they measure, and how late their clocks are.

Orientations are by VQF (Laidig and Seel 2023), offline and without the magnetometer unless asked:
near the floor of a laboratory the field is disturbed by more than any filter forgives. Heading is
then free, and drifts a little. Distances and parts are after Baak (2012), (7.2) and (7.10).

Clocks are compared by how fast limbs turn. The rate of turn needs no calibration, and where on the
limb the sensor sits does not matter, as it does for accelerations (the thesis' way). Sensors of one
system share one clock.

Conventions: unit quaternions wxyz, either sign; angles in degrees where a name says so.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.sensors import SensorRecording
from motionary.rotations import (
    conjugate_quaternions,
    continuous_signs,
    multiply_quaternions,
    quaternions_to_rotation_vectors,
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
_WINDOW_S, _HOP_S = 20.0, 10.0
# From so many seconds on, windows can tell a drift from an offset.
_DRIFT_FROM_S = 60.0
# What is beyond so many times the fastest tenth is a fault, such as a rest pose before the
# first frame.
_CLIP = 2.0
_APART_FRAMES = 8


def orient_all(
    sensors: Sequence[SensorRecording], *, fused: bool = False, magnetic: bool = False
) -> tuple[dict[str, Floats], list[str]]:
    """Orientations of each sensor by name, and notes on those that have none or doubtful ones.

    `fused` takes orientations that the files bring instead of fusing raw measurements.
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


def speeds_of_turn(orientations: Floats, rate_hz: float) -> Floats:
    """Rates of turn of orientations (frames, 4), over two frames each, rad/s; NaN beside gaps."""
    if len(orientations) < 3:
        raise InvalidInput(f"a rate of turn needs at least 3 frames, got {len(orientations)}")
    steps = quaternions_to_rotation_vectors(
        multiply_quaternions(conjugate_quaternions(orientations[:-2]), orientations[2:])
    )
    speeds = np.linalg.norm(steps, axis=1) * rate_hz / 2
    return np.concatenate([speeds[:1], speeds, speeds[-1:]])


def speeds_of_directions(directions: Floats, rate_hz: float) -> Floats:
    """The same of unit vectors (frames, 3): twist about them does not show."""
    if len(directions) < 3:
        raise InvalidInput(f"a rate of turn needs at least 3 frames, got {len(directions)}")
    before, after = directions[:-2], directions[2:]
    sine = np.linalg.norm(np.cross(before, after), axis=1)
    speeds = np.arctan2(sine, (before * after).sum(axis=1)) * rate_hz / 2
    return np.concatenate([speeds[:1], speeds, speeds[-1:]])


# ---- clocks


class Lag(NamedTuple):
    """How clocks are apart: sensor time = tracker time * (1 + drift) + offset.

    `peak` is the correlation at the offset, `margin` by how much it is above any other one.
    """

    offset_s: float
    drift: float = 0.0
    peak: float = 1.0
    margin: float = 1.0

    def sensor_times(self, times_s: Floats) -> Floats:
        """Times of the sensor at times of the tracker."""
        return np.asarray(times_s * (1 + self.drift) + self.offset_s)


def synchronise(
    tracked: list[Floats], measured: list[Floats], *, rate_hz: float, most_s: float = 10.0
) -> Lag:
    """The lag of sensors behind a tracker that share one clock.

    Parameters
    ----------
    tracked, measured : rates of turn of the same limbs, at `rate_hz` both; NaN = not known
    rate_hz : of both
    most_s : beyond which no offset is looked for

    Raises
    ------
    InvalidInput
        If nothing moves, or they hardly overlap.
    """
    offset, peak, margin = _best_offset(tracked, measured, rate_hz, most_s)
    n_seconds = min(max(map(len, tracked)), max(map(len, measured))) / rate_hz
    if n_seconds < _DRIFT_FROM_S:
        return Lag(offset, 0.0, peak, margin)
    times, offsets = _windows(tracked, measured, rate_hz, offset)
    if len(times) < 4:
        return Lag(offset, 0.0, peak, margin)
    drift, at_zero = _robust_line(times, offsets)
    return Lag(at_zero, drift, peak, margin)


def correlate(tracked: Floats, measured: Floats, n_most: int) -> Floats:
    """Correlation at lags of -n_most to n_most frames, each over what then overlaps."""
    size = 1 << int(np.ceil(np.log2(len(tracked) + len(measured) + n_most)))
    a, b = _normalised(tracked), _normalised(measured)

    def cross(x: Floats, y: Floats) -> Floats:
        full = np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)
        return np.concatenate([full[size - n_most :], full[: n_most + 1]])

    seen_a, seen_b = ((~np.isnan(one)).astype(np.float64) for one in (tracked, measured))
    both = cross(seen_a, seen_b)
    power = np.sqrt(np.maximum(cross(a**2, seen_b) * cross(seen_a, b**2), 1e-12))
    least = 0.25 * min(len(tracked), len(measured))
    return np.where(both >= least, cross(a, b) / power, -1.0)


def _normalised(speeds: Floats) -> Floats:
    """Centred by the median, scaled by the fastest tenth, clipped; 0 where not known."""
    known = speeds[~np.isnan(speeds)]
    if len(known) < 3:
        return np.zeros_like(speeds)
    middle = np.median(known)
    # Not the median deviation: who stands for most of the time has none.
    spread = max(float(np.percentile(np.abs(known - middle), 90)), 1e-6)
    return np.nan_to_num(np.clip((speeds - middle) / spread, -_CLIP, _CLIP))


def _best_offset(
    tracked: list[Floats], measured: list[Floats], rate_hz: float, most_s: float
) -> tuple[float, float, float]:
    n_most = round(most_s * rate_hz)
    curves = [correlate(a, b, n_most) for a, b in zip(tracked, measured, strict=True)]
    total = np.mean(curves, axis=0)
    return peak_of(total, n_most, rate_hz)


def peak_of(curve: Floats, n_most: int, rate_hz: float) -> tuple[float, float, float]:
    """Offset in seconds at a correlation's peak, its height, and its margin over any other."""
    best = int(curve.argmax())
    if curve[best] <= 0:
        raise InvalidInput("the sensors' rates of turn are like the tracker's at no offset")
    fraction = 0.0
    if 0 < best < len(curve) - 1:
        left, middle, right = curve[best - 1 : best + 2]
        bend = left - 2 * middle + right
        fraction = float(0.5 * (left - right) / bend) if bend < 0 else 0.0
    far = np.abs(np.arange(len(curve)) - best) > _APART_FRAMES
    other = float(curve[far].max()) if far.any() else -1.0
    return (best + fraction - n_most) / rate_hz, float(curve[best]), float(curve[best]) - other


def _windows(
    tracked: list[Floats], measured: list[Floats], rate_hz: float, offset_s: float
) -> tuple[Floats, Floats]:
    """Offsets of windows of the tracker's time, and the middles of these."""
    window, hop = round(_WINDOW_S * rate_hz), round(_HOP_S * rate_hz)
    shift, times, offsets = round(offset_s * rate_hz), [], []
    around = round(0.5 * rate_hz)
    for first in range(0, max(map(len, tracked)) - window + 1, hop):
        pairs = [
            (a[first : first + window], b[max(first + shift, 0) : first + shift + window])
            for a, b in zip(tracked, measured, strict=True)
        ]
        pairs = [(a, b) for a, b in pairs if len(a) == window == len(b)]
        if not pairs:
            continue
        try:
            found = _best_offset(
                [a for a, _ in pairs], [b for _, b in pairs], rate_hz, around / rate_hz
            )
        except InvalidInput:
            continue
        if found[1] > 0.5 and abs(found[0]) < 0.9 * around / rate_hz:
            times.append((first + window / 2) / rate_hz)
            offsets.append(found[0] + shift / rate_hz)
    return np.array(times), np.array(offsets)


def _robust_line(times: Floats, values: Floats) -> tuple[float, float]:
    """Slope and value at 0 of a line that outliers do not turn."""
    weights = np.ones(len(times))
    for _ in range(20):
        slope, start = np.polyfit(times, values, 1, w=np.sqrt(weights))
        away = values - (slope * times + start)
        scale = max(1.4826 * float(np.median(np.abs(away))), 1e-5)
        weights = 1 / (1 + (away / (2 * scale)) ** 2) ** 2
    return float(slope), float(start)
