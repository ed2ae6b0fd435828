"""Points in space from rays of several cameras, without cameras that contradict the others.

Weighted least squares in the images. Where the rest stays above the limit, the smallest number of
cameras is left out that brings it below, as Pose2Sim does (Pagnon et al. 2022).
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.multiview.cameras import Sight, miss_pixels, quadrics, solve

Floats = NDArray[np.float64]

#: Mean distance in the images above which cameras are left out, in pixels at `USUAL_FOCAL`.
LIMIT_PX = 15.0
USUAL_FOCAL = 1200.0
# Beyond so many cameras, they are left out one after the other, not in all combinations.
_MOST_COMBINED = 6


class Triangulated(NamedTuple):
    """Points from rays.

    `points` (frames, points, 3) in metres, NaN where fewer than two cameras agree; `errors`
    (frames, points), the mean distance in the images, in pixels at `USUAL_FOCAL`; `used`
    (cameras, frames, points).
    """

    points: Floats
    errors: Floats
    used: NDArray[np.bool_]


def triangulate(sight: Sight, *, limit_px: float | None = LIMIT_PX) -> Triangulated:
    """Points in space, each from the largest number of cameras that agree.

    Parameters
    ----------
    sight : rays of the keypoints
    limit_px : mean distance in the images above which cameras are left out; None keeps all
    """
    n_cameras = len(sight.origins)
    used = sight.weights > 0
    points, errors = _from_cameras(sight, used)
    if limit_px is None:
        return Triangulated(points, errors, used & ~np.isnan(points[..., 0]))
    for left_out in range(1, n_cameras - 1):
        poor = errors > limit_px
        if not poor.any():
            break
        best = errors[poor], points[poor], used[:, poor]
        part = _pick(sight, poor)
        for absent in _subsets(part, best[1], used[:, poor], left_out):
            kept = used[:, poor] & ~absent
            found, missed = _from_cameras(part, kept[:, None])
            better = missed[0] < best[0]
            best = (
                np.where(better, missed[0], best[0]),
                np.where(better[:, None], found[0], best[1]),
                np.where(better, kept, best[2]),
            )
        errors[poor], points[poor], used[:, poor] = best
    lost = ~(errors <= limit_px)
    points[lost] = np.nan
    return Triangulated(points, np.where(lost, np.nan, errors), used & ~lost)


def _pick(sight: Sight, poor: NDArray[np.bool_]) -> Sight:
    """Rays of some points, as those of one frame."""
    return sight._replace(
        directions=sight.directions[:, poor][:, None], weights=sight.weights[:, poor][:, None]
    )


def _subsets(
    part: Sight, points: Floats, used: NDArray[np.bool_], left_out: int
) -> list[NDArray[np.bool_]]:
    """Which cameras to leave out, (cameras, points): all combinations, or the worst one more."""
    n = len(part.origins)
    if n <= _MOST_COMBINED:
        rows = []
        for absent in combinations(range(n), left_out):
            mask = np.zeros((n, len(points)), dtype=bool)
            mask[list(absent)] = True
            rows.append(mask)
        return rows
    missed = np.nan_to_num(np.where(used, miss_pixels(part, points[None])[:, 0], -1.0), nan=-1.0)
    order = np.argsort(-missed, axis=0)
    mask = ~used
    worst = np.zeros_like(mask)
    np.put_along_axis(worst, order[:1], True, axis=0)
    return [mask | worst]


def _from_cameras(sight: Sight, used: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Points of the cameras used, and the mean distance in the images."""
    weights = np.where(used, sight.weights, 0.0)
    enough = (weights > 0).sum(axis=0) >= 2
    points = np.full((*enough.shape, 3), np.nan)
    scale = (USUAL_FOCAL / sight.focal)[:, None, None]
    own = weights
    # Distances in the images are those in space by depth, which the first solution tells.
    for _ in range(2):
        matrices, slopes = quadrics(sight, own)
        points = solve(matrices.sum(axis=0), slopes.sum(axis=0))
        away = np.nan_to_num(points, nan=1e3) - sight.origins[:, None, None]
        depth = (away * sight.directions).sum(axis=-1)
        own = weights / np.maximum(depth, 0.1) ** 2
    points[~enough] = np.nan
    missed = np.where(used & (depth > 0), miss_pixels(sight, points) * scale, np.nan)
    missed[used & (depth <= 0)] = np.inf
    total = np.where(weights > 0, weights * np.nan_to_num(missed, nan=0.0, posinf=1e6), 0.0)
    whole = weights.sum(axis=0)
    errors = np.divide(total.sum(axis=0), whole, out=np.full(whole.shape, np.nan), where=whole > 0)
    errors[np.isnan(points).any(axis=-1)] = np.nan
    return points, np.where(np.isnan(errors), np.inf, errors)


def bridge(points: Floats) -> Floats:
    """Points with gaps bridged in a straight line; the ends stay as they were last seen."""
    result = points.copy()
    frames = np.arange(len(points))
    for k in range(points.shape[1]):
        known = ~np.isnan(points[:, k, 0])
        if known.any():
            for axis in range(3):
                result[:, k, axis] = np.interp(frames, frames[known], points[known, k, axis])
    return result
