"""How steady tracked points are: the floor, feet on it, how they slide, gaps and jitter.

Conventions: points are (frames, points, 3) in metres, y up.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.recording import find_runs

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Points of a foot by which it stands.
SOLE = ("BigToe", "SmallToe", "Heel", "Ankle")
# A foot stands where its slowest point is slower, and not higher above its lowest height.
_STANDING_SPEED, _STANDING_HEIGHT_M = 0.45, 0.06
_LEAST_STANCE_S = 0.1
_BELOW_M = 0.02
_SMOOTHED_S = 0.1


class Steadiness(NamedTuple):
    """Measures of a track; NaN where there is nothing to measure.

    `sliding` of planted feet in m/s, horizontally; `below` fraction of frames with a foot more than
    2 cm below the floor; `gaps` fraction of points not known; `jitter` mean change of
    acceleration in m/s².
    """

    sliding: float
    below: float
    gaps: float
    jitter: float


def sole_points(names: tuple[str, ...], side: str) -> list[int]:
    """Numbers of the points of a foot, without the ankle if there are others."""
    own = [names.index(side + part) for part in SOLE if side + part in names]
    ankle = [k for k in own if names[k].endswith("Ankle")]
    return [k for k in own if k not in ankle] or ankle


def floor_of(names: tuple[str, ...], points: Floats) -> float | None:
    """Height of the floor: where the lower foot mostly is; None without feet.

    Feet in the air, as of jumps, and single wrong frames do not move it.
    """
    own = [k for side in "LR" for k in sole_points(names, side)]
    if not own:
        return None
    heights = points[:, own, 1]
    known = ~np.isnan(heights).all(axis=1)
    if not known.any():
        return None
    return float(np.percentile(np.nanmin(heights[known], axis=1), 10))


def stances(names: tuple[str, ...], points: Floats, rate_hz: float) -> dict[str, Bools]:
    """Frames in which each foot stands, "L" and "R"."""
    result = {}
    # A longer kernel would make the result longer than the motion.
    width = max(1, min(round(_SMOOTHED_S * rate_hz), len(points)))
    for side in "LR":
        own = sole_points(names, side)
        if not own:
            continue
        feet = points[:, own]
        speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1) * rate_hz
        heights = feet[..., 1] - np.nanpercentile(feet[..., 1], 5, axis=0)
        kernel = np.ones(width) / width
        slow = np.convolve(np.nan_to_num(speed.min(axis=1), nan=9.0), kernel, "same")
        low = np.nan_to_num(heights.min(axis=1), nan=9.0)
        mask = (slow < _STANDING_SPEED) & (low < _STANDING_HEIGHT_M)
        result[side] = _without_short(mask, round(_LEAST_STANCE_S * rate_hz))
    return result


def _without_short(mask: Bools, least: int) -> Bools:
    result = mask.copy()
    for first, stop in find_runs(mask).tolist():
        if stop - first < least:
            result[first:stop] = False
    return result


def measure_steadiness(
    names: tuple[str, ...],
    points: Floats,
    rate_hz: float,
    *,
    standing: dict[str, Bools],
    floor: float | None,
) -> Steadiness:
    """Sliding, floor, gaps and jitter of points.

    Parameters
    ----------
    names, points, rate_hz : what is measured; NaN = not known
    standing : frames in which each foot stands, the same for all tracks that are compared
    floor : height of the floor
    """
    speeds = []
    for side, mask in standing.items():
        feet = points[:, sole_points(names, side)]
        # A foot rolls: its slowest point is the one that stands.
        step = np.linalg.norm(np.diff(feet[..., (0, 2)], axis=0), axis=-1) * rate_hz
        inside = mask[1:] & mask[:-1] & ~np.isnan(step).all(axis=1)
        speeds.append(np.nanmin(step[inside], axis=1))
    slid = np.concatenate(speeds) if speeds else np.zeros(0)
    below = np.nan
    own = [k for side in "LR" for k in sole_points(names, side)]
    if floor is not None and own:
        lowest = points[:, own, 1]
        below = float((np.nan_to_num(lowest, nan=np.inf) < floor - _BELOW_M).any(axis=1).mean())
    jerk = np.linalg.norm(np.diff(points, n=3, axis=0), axis=-1) * rate_hz**2
    return Steadiness(
        float(slid.mean()) if len(slid) else np.nan,
        below,
        float(np.isnan(points[..., 0]).mean()),
        float(np.nanmean(jerk)) if np.isfinite(jerk).any() else np.nan,
    )
