"""What calibrated cameras see: projection, undistortion, rays of keypoints, points where they meet.

After Baak (2012), section 6.2.2: a ray is a direction n of length one and a moment m, and a
point x lies on it where x × n = m; the length of x × n − m is its distance from the ray.
Points are weighted least squares in the images. Where the rest stays above the limit, the smallest
number of cameras is left out that brings it below, as Pose2Sim does (Pagnon et al. 2022).

Conventions: lengths in metres, pixels as OpenCV counts them.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Camera
from motionary.errors import InvalidInput
from motionary.io.cameras import CalibratedCamera
from motionary.io.keypoints import Views

Floats = NDArray[np.float64]

#: Mean distance in the images above which cameras are left out, in pixels at `USUAL_FOCAL`.
LIMIT_PX = 15.0
USUAL_FOCAL = 1200.0
# Beyond so many cameras, they are left out one after the other, not in all combinations.
_MOST_COMBINED = 6
_UNDISTORT_STEPS = 20
# Sums of quadrics of rays that are nearly parallel are nearly singular.
_NEARLY_SINGULAR = 1e-9


class Sight(NamedTuple):
    """Rays of keypoints.

    Attributes
    ----------
    directions : array, shape (cameras, frames, points, 3), unit; 0 where not detected
    origins : array, shape (cameras, 3), metres
    weights : array, shape (cameras, frames, points), scores; 0 = not detected
    focal : array, shape (cameras,), pixels
    names : of the points
    """

    directions: Floats
    origins: Floats
    weights: Floats
    focal: Floats
    names: tuple[str, ...]

    def exchanged(self, sources: NDArray[np.intp]) -> "Sight":
        """The sight with the rays of other points, `sources` (cameras, frames, points)."""
        weights = np.take_along_axis(self.weights, sources, axis=2)
        directions = np.take_along_axis(self.directions, sources[..., None], axis=2)
        return self._replace(directions=directions, weights=weights)

    def of_points(self, chosen: Sequence[int]) -> "Sight":
        """What is seen of some of the points."""
        own = np.asarray(chosen, dtype=np.intp)
        return self._replace(
            directions=self.directions[:, :, own], weights=self.weights[:, :, own],
            names=tuple(self.names[k] for k in own),
        )  # fmt: skip

    def of_frames(self, span: slice) -> "Sight":
        """What is seen in some of the frames."""
        return self._replace(directions=self.directions[:, span], weights=self.weights[:, span])

    def turned(self, turn: Floats) -> "Sight":
        """The sight in a world that is turned (3, 3)."""
        return self._replace(directions=self.directions @ turn.T, origins=self.origins @ turn.T)


def project(camera: CalibratedCamera, points: Floats) -> Floats:
    """Pixels (..., 2) of points (..., 3) in the calibration's unit; NaN behind the camera."""
    seen = points @ camera.rotation.T + camera.translation
    with np.errstate(divide="ignore", invalid="ignore"):
        flat = np.where(seen[..., 2:] > 0, seen[..., :2] / seen[..., 2:], np.nan)
    bent = distort(camera, flat)
    pixels: Floats = bent @ camera.matrix[:2, :2].T + camera.matrix[:2, 2]
    return pixels


def distort(camera: CalibratedCamera, flat: Floats) -> Floats:
    """Where the lens puts points of the plane at distance 1, shape (..., 2)."""
    if not camera.distortion.any() and not camera.fisheye:
        return flat
    x, y = flat[..., 0], flat[..., 1]
    if camera.fisheye:
        radius = np.hypot(x, y)
        angle = np.arctan(radius)
        series = np.polynomial.polynomial.polyval(angle**2, [1.0, *camera.distortion])
        factor = np.ones_like(radius)
        np.divide(angle * series, radius, out=factor, where=radius > 1e-9)
        bent: Floats = flat * factor[..., None]
        return bent
    k1, k2, p1, p2, k3 = camera.distortion
    square = x * x + y * y
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    return np.stack(
        (
            x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x),
            y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y,
        ),
        axis=-1,
    )


def undistort(camera: CalibratedCamera, pixels: Floats) -> Floats:
    """Points of the plane at distance 1 that the lens puts at pixels, shape (..., 2)."""
    bent: Floats = (pixels - camera.matrix[:2, 2]) @ np.linalg.inv(camera.matrix[:2, :2]).T
    flat = bent
    if camera.fisheye:
        size = np.linalg.norm(bent, axis=-1)
        angle = size
        for _ in range(_UNDISTORT_STEPS):
            series = np.polynomial.polynomial.polyval(angle**2, [1.0, *camera.distortion])
            angle = np.clip(size / series, 0, np.pi / 2 - 1e-3)
        scale = np.ones_like(size)
        np.divide(np.tan(angle), size, out=scale, where=size > 1e-9)
        flat = bent * scale[..., None]
    elif camera.distortion.any():
        for _ in range(_UNDISTORT_STEPS):
            flat = flat + (bent - distort(camera, flat))
    return flat


def see(views: Views, cameras: Sequence[CalibratedCamera], *, unit_m: float = 1.0) -> Sight:
    """The rays of all keypoints.

    Parameters
    ----------
    views : of as many cameras as `cameras`, in their sequence
    cameras : as calibrated
    unit_m : the calibration's unit of length, in metres
    """
    if len(views.cameras) != len(cameras):
        raise InvalidInput(
            f"keypoints are of {len(views.cameras)} cameras ({', '.join(views.cameras)}), the "
            f"calibration is of {len(cameras)} ({', '.join(one.name for one in cameras)})"
        )
    directions = np.zeros((*views.pixels.shape[:3], 3))
    weights = views.scores.copy()
    for k, camera in enumerate(cameras):
        outside = np.isnan(views.pixels[k]).any(axis=-1)
        if camera.size is not None:
            # Detectors guess beyond the edge; half a tenth more is left to rounding and scaling.
            limit = 1.05 * np.asarray(camera.size)
            with np.errstate(invalid="ignore"):
                outside |= ((views.pixels[k] < 0) | (views.pixels[k] > limit)).any(axis=-1)
        weights[k][outside] = 0.0
        flat = undistort(camera, np.where(outside[..., None], 0.0, views.pixels[k]))
        ahead = np.concatenate([flat, np.ones((*flat.shape[:-1], 1))], axis=-1) @ camera.rotation
        directions[k] = ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)
        directions[k][outside] = 0.0
    origins = np.stack([camera.position for camera in cameras]) * unit_m
    focal = np.array([camera.matrix[[0, 1], [0, 1]].mean() for camera in cameras])
    return Sight(directions, origins, weights, focal, views.names)


def quadrics(sight: Sight, weights: Floats | None = None) -> tuple[Floats, Floats]:
    """Squared distances from rays as x·M x − 2 b·x: M (..., 3, 3) and b (..., 3), by camera."""
    n = sight.directions
    w = sight.weights if weights is None else weights
    matrices = w[..., None, None] * (np.eye(3) - n[..., :, None] * n[..., None, :])
    return matrices, np.einsum("cfpij,cj->cfpi", matrices, sight.origins)


def solve(matrices: Floats, slopes: Floats) -> Floats:
    """Solutions (..., 3) of symmetric systems (..., 3, 3); NaN where one is singular."""
    a, b, c = matrices[..., 0, 0], matrices[..., 0, 1], matrices[..., 0, 2]
    d, e, f = matrices[..., 1, 1], matrices[..., 1, 2], matrices[..., 2, 2]
    u, v, w = slopes[..., 0], slopes[..., 1], slopes[..., 2]
    # Adjugate of a symmetric matrix.
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    s, t, z = a * f - c * c, b * c - a * e, a * d - b * b
    determinant = a * p + b * q + c * r
    size = (a + d + f) ** 3
    good = determinant > _NEARLY_SINGULAR * size
    determinant = np.where(good & (size > 0), determinant, np.nan)
    return np.stack(
        ((p * u + q * v + r * w), (q * u + s * v + t * w), (r * u + t * v + z * w)), axis=-1
    ) / determinant[..., None]  # fmt: skip


def distances(sight: Sight, points: Floats) -> tuple[Floats, Floats]:
    """Distance of points (frames, points, 3) from each camera's ray, and depth along it."""
    away = points - sight.origins[:, None, None]
    depth = (away * sight.directions).sum(axis=-1)
    across = away - depth[..., None] * sight.directions
    return np.linalg.norm(across, axis=-1), depth


def miss_pixels(sight: Sight, points: Floats) -> Floats:
    """Distances in the images, in pixels, (cameras, frames, points); NaN where not detected."""
    far, depth = distances(sight, points)
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = far / np.maximum(depth, 1e-6) * sight.focal[:, None, None]
    return np.where(sight.weights > 0, pixels, np.nan)


def straighten(
    image: Floats, camera: CalibratedCamera, *, unit_m: float = 1.0
) -> tuple[Floats, Camera]:
    """The image without its lens's distortion, and the pinhole camera that sees it so.

    Parameters
    ----------
    image : array, shape (height, width, 3)
    camera : as calibrated
    unit_m : the calibration's unit of length, in metres
    """
    from scipy.ndimage import map_coordinates

    height, width = image.shape[:2]
    focal, centre = camera.matrix[[0, 1], [0, 1]], camera.matrix[:2, 2]
    rows, columns = np.indices((height, width), dtype=np.float64)
    bent = distort(camera, (np.stack([columns, rows], axis=-1) - centre) / focal)
    column, row = np.moveaxis(bent * focal + centre, -1, 0)
    straight = np.stack(
        [map_coordinates(image[..., k], (row, column), order=1, mode="nearest") for k in range(3)],
        axis=-1,
    )
    (fx, fy), (x, y) = focal.tolist(), centre.tolist()
    place = camera.position * unit_m
    return straight, Camera(width, height, (fx, fy), (x, y), camera.rotation.T, place)


# ---- points


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
        # Rays of these points, as those of one frame.
        part = sight._replace(
            directions=sight.directions[:, poor][:, None], weights=sight.weights[:, poor][:, None]
        )
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
