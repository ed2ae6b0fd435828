"""Where a limb is tracked wrongly: segments in which it and its sensor disagree.

A segment rises above one angle somewhere and stays above a smaller one, so that noise neither
begins nor splits it. The thesis asks for 45 degrees in a frame (section 7.6).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.inertial.calibration import (
    Calibration,
    CalibrationSettings,
    calibrate,
    match_limb,
)
from motionary.inertial.orientations import heading
from motionary.recording import find_runs
from motionary.rotations import conjugate_quaternions, multiply_quaternions

Floats = NDArray[np.float64]

_KNOTS_S, _SCALE_DEG = 8.0, 6.0
_ROUNDS = 2
# From which on a drift, a disagreement all the time, and gaps of the sensor are told.
_LARGE_DRIFT_DEG = 10.0
_DISAGREES_DEG = 15.0
_MOSTLY = 0.9
# So many times better must a sensor fit if it is read otherwise: of errors of tracking, planted
# into limbs of people on whom limits were chosen, none comes near 1.
_MISREAD = 1.3
_MISREADINGS = {
    "its axes are left-handed": np.array([1.0, -1.0, 1.0, -1.0]),
    "it turns from the world to the sensor": np.array([1.0, -1.0, -1.0, -1.0]),
}


@dataclass(frozen=True, slots=True)
class DetectionSettings:
    """What counts as wrong.

    Attributes
    ----------
    high_deg, low_deg : which a segment must reach, and above which it stays
    min_s : shorter ones are left out
    max_gap_s : shorter ones between two segments are bridged
    """

    high_deg: float = 25.0
    low_deg: float = 12.0
    min_s: float = 0.1
    max_gap_s: float = 0.2


#: For limbs of which only the direction is tracked.
OF_DIRECTIONS = DetectionSettings(high_deg=15.0, low_deg=8.0)


def find_wrong(
    residual_deg: Floats, rate_hz: float, settings: DetectionSettings | None = None
) -> list[tuple[int, int]]:
    """Segments of frames (first, one past the last) that are wrong, by time.

    Parameters
    ----------
    residual_deg : array, shape (frames,); NaN = not known, which is never wrong
    rate_hz : frames per second
    settings : what counts as wrong
    """
    settings = settings or DetectionSettings()
    known = np.asarray(np.nan_to_num(residual_deg, nan=0.0))
    gap = max(round(settings.max_gap_s * rate_hz), 0)
    joined: list[tuple[int, int]] = []
    for first, stop in find_runs(known > settings.low_deg).tolist():
        if joined and first - joined[-1][1] <= gap:
            joined[-1] = joined[-1][0], stop
        else:
            joined.append((first, stop))
    least = settings.min_s * rate_hz
    return [
        (first, stop)
        for first, stop in joined
        if stop - first >= least and known[first:stop].max() > settings.high_deg
    ]


def heading_drift(predicted: Floats, measured: Floats, rate_hz: float) -> Floats:
    """How the sensor's heading drifts, radians, (frames,): lines between knots 8 s apart.

    A slow turn of the limb about the vertical cannot be told from it, and is taken for drift.
    Nothing is found in what is shorter than two of these lines.
    """
    n = len(predicted)
    n_knots = int(n / rate_hz / _KNOTS_S) + 1
    if n_knots < 3:
        return np.zeros(n)
    between = multiply_quaternions(measured, conjugate_quaternions(predicted))
    known = np.asarray(~np.isnan(between).any(axis=1))
    angle = np.asarray(2 * np.arctan2(between[:, 3], between[:, 0]))
    angle = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
    at: Floats = np.linspace(0, n_knots - 1, n)
    left = np.minimum(at.astype(np.intp), n_knots - 2)
    rows = np.zeros((n, n_knots))
    rows[np.arange(n), left] = 1 - (at - left)
    rows[np.arange(n), left + 1] = at - left
    bends = np.diff(np.eye(n_knots), n=2, axis=0)
    knots: Floats = np.zeros(n_knots)
    weights: Floats = known.astype(np.float64)
    values, scale = np.where(known, angle, 0.0), np.radians(_SCALE_DEG)
    per_knot = n / n_knots
    for _ in range(10):
        normal = (rows * weights[:, None]).T @ rows + 0.2 * per_knot * bends.T @ bends
        normal += 1e-6 * np.eye(n_knots)
        solved = np.linalg.solve(normal, (rows * weights[:, None]).T @ values)
        knots = np.asarray(solved, dtype=np.float64)
        away = values - rows @ knots
        weights = 1.0 * known * (scale**2 / (away**2 + scale**2)) ** 2
    return np.asarray(rows @ knots)


class DriftingCalibration(NamedTuple):
    """A calibration, the sensor without the drift of its heading, and that drift in radians."""

    calibration: Calibration
    measured: Floats
    drift_rad: Floats


def calibrate_drifting(
    tracked: Floats,
    measured: Floats,
    rate_hz: float,
    settings: CalibrationSettings | None = None,
) -> DriftingCalibration:
    """World and mount of a sensor whose heading drifts slowly; see `calibrate`."""
    found = DriftingCalibration(
        calibrate(tracked, measured, settings), measured, np.zeros(len(measured))
    )
    for _ in range(_ROUNDS):
        drift = heading_drift(found.calibration.predict(tracked), measured, rate_hz)
        if not drift.any():
            break
        steadied = without_drift(measured, drift)
        found = DriftingCalibration(calibrate(tracked, steadied, settings), steadied, drift)
    return found


def without_drift(measured: Floats, drift_rad: Floats) -> Floats:
    """Orientations of a sensor with its heading's drift turned back."""
    return multiply_quaternions(conjugate_quaternions(heading(drift_rad)), measured)


def doubt(residual_deg: Floats, drift_deg: float = 0.0) -> tuple[str, ...]:
    """Notes on what makes a comparison of limb and sensor doubtful, whatever is wrong in it."""
    notes = []
    known = residual_deg[~np.isnan(residual_deg)]
    if len(known) < _MOSTLY * len(residual_deg):
        notes.append(f"known together in {len(known) / len(residual_deg):.0%} of the frames")
    if len(known) and np.median(known) > _DISAGREES_DEG:
        notes.append(
            f"limb and sensor disagree by {np.median(known):.0f} degrees (median): another limb, "
            "other axes or units, or tracked wrongly most of the time"
        )
    if drift_deg > _LARGE_DRIFT_DEG:
        notes.append(
            f"{drift_deg:.0f} degrees of slow turn about the vertical are taken for drift of the "
            "sensor's heading; of the limb they would be an error"
        )
    return tuple(notes)


def name_misreading(tracked: Floats, measured: Floats) -> str:
    """How a sensor's orientations seem to be misread, or nothing if they fit best as they are."""
    readings = {how: measured * signs for how, signs in _MISREADINGS.items()}
    readings["its numbers are in the order xyzw"] = measured[:, [3, 0, 1, 2]]
    costs = {how: match_limb(tracked, one) for how, one in readings.items()}
    best = min(costs, key=lambda how: costs[how])
    if match_limb(tracked, measured) <= _MISREAD * costs[best]:
        return ""
    return f"fits better as if {best}: check how it is read; nothing is called wrong here"
