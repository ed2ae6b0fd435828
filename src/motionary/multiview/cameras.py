"""What calibrated cameras see: projection, undistortion, and rays of keypoints.

After Baak (2012), section 6.2.2: a ray is a direction n of length one and a moment m, and a
point x lies on it where x × n = m; the length of x × n − m is its distance from the ray.

Conventions: lengths in metres, pixels as OpenCV counts them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Camera
from motionary.errors import InvalidInput
from motionary.io.cameras import CalibratedCamera
from motionary.io.keypoints import Views

Floats = NDArray[np.float64]

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
