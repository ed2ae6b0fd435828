"""Depth images made ready: a person's pixels, cleaned, as points of the world.

After Baak (2012), section 8.3.1. Printed: the background is subtracted, contour pixels are
deleted, a 3 x 3 median is taken. Deleting all contours takes thin limbs away at three metres, so
that by default only pixels that float between surfaces are dropped.

Conventions: depth along the camera's axis in metres, NaN where nothing is; the world's y is up.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body.rendering import Camera
from motionary.errors import InvalidInput
from motionary.matching.distance import Engine, load_twin

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

COMPILED = "motionary.depth._compiled"
# A pixel belongs to a surface if so many of its 24 neighbours lie so near to its depth.
_LEAST_NEIGHBOURS = 5
_SAME_SURFACE_M = 0.10


@dataclass(frozen=True, slots=True)
class PreparationSettings:
    """What of a depth image is the person.

    Attributes
    ----------
    near_m, far_m : depths between which the person is
    floor_m : height of the floor in the world; what is less than 4 cm above it is dropped; None
        if no floor is seen
    margin_m : so much nearer than the background is in front of it; it grows with the noise
    contours : "floating" drops pixels between surfaces; "delete" drops all contours, as printed
    """

    near_m: float = 0.3
    far_m: float = 8.0
    floor_m: float | None = None
    margin_m: float = 0.05
    contours: str = "floating"

    def __post_init__(self) -> None:
        if not 0 < self.near_m < self.far_m:
            raise InvalidInput(
                f"the person needs to be between two depths, 0 < near < far, got {self.near_m:g} "
                f"and {self.far_m:g} m"
            )
        if self.contours not in ("floating", "delete"):
            raise InvalidInput(f"contours: choose floating or delete, got {self.contours!r}")


class Cloud(NamedTuple):
    """Points of one image.

    Attributes
    ----------
    points : array, shape (points, 3), metres, in the world
    pixels : array, shape (points,), row * width + column of each
    depth : array, shape (height, width), the cleaned image; NaN where no point is
    """

    points: Floats
    pixels: Indices
    depth: Floats


def prepare(
    image: Floats,
    camera: Camera,
    settings: PreparationSettings | None = None,
    *,
    background: Floats | None = None,
    engine: Engine = "auto",
) -> Cloud:
    """The points of what is in front of the background.

    Parameters
    ----------
    image : array, shape (height, width), depth in metres; 0 or NaN where nothing is
    camera : whose image it is
    settings : what of it is the person
    background : depth of the empty scene, as from `learn_background`
    engine : which twin computes

    Raises
    ------
    InvalidInput
        If the sizes of image, camera and background differ.
    """
    settings = settings or PreparationSettings()
    size = (camera.height, camera.width)
    for what, one in (("image", image), ("background", background)):
        if one is not None and one.shape != size:
            raise InvalidInput(
                f"the camera's images are {size[1]} x {size[0]}, got the {what} with shape "
                f"{one.shape}; give the intrinsics of this size"
            )
    depth = np.array(image, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        keep = (depth >= settings.near_m) & (depth <= settings.far_m)
        if background is not None:
            # The step of structured light grows with the square of the depth.
            margin = np.maximum(settings.margin_m, 2 * 2.78e-3 * background**2)
            keep &= ~(depth > background - margin)
    depth[~keep] = np.nan
    rows, columns = np.flatnonzero(keep.any(axis=1)), np.flatnonzero(keep.any(axis=0))
    if not len(rows):
        return Cloud(np.empty((0, 3)), np.empty(0, np.intp), depth)
    # Two pixels of margin: neighbours of neighbours are looked at.
    box = (
        slice(max(rows[0] - 2, 0), rows[-1] + 3),
        slice(max(columns[0] - 2, 0), columns[-1] + 3),
    )
    kernels = load_twin(COMPILED, engine, pays=True)
    part = np.ascontiguousarray(depth[box])
    if settings.contours == "delete":
        part[_contours(part)] = np.nan
    clean = _clean if kernels is None else kernels.clean
    depth[box] = clean(part, _LEAST_NEIGHBOURS, _SAME_SURFACE_M)
    pixels = np.flatnonzero(~np.isnan(depth))
    points = unproject_pixels(depth, pixels, camera)
    if settings.floor_m is not None:
        above = points[:, 1] > settings.floor_m + 0.04
        depth.reshape(-1)[pixels[~above]] = np.nan
        points, pixels = points[above], pixels[above]
    return Cloud(points, pixels, depth)


def unproject_pixels(depth: Floats, pixels: Indices, camera: Camera) -> Floats:
    """Places in the world of some pixels (n,) of a depth image, shape (n, 3)."""
    z = depth.reshape(-1)[pixels]
    seen = np.empty((len(pixels), 3))
    seen[:, 0] = (pixels % camera.width - camera.centre[0]) / camera.focal[0] * z
    seen[:, 1] = (pixels // camera.width - camera.centre[1]) / camera.focal[1] * z
    seen[:, 2] = z
    placed: Floats = seen @ camera.world_from_camera.T + camera.position
    return placed


def unpack_camera(camera: Camera) -> tuple[Floats, Floats, Floats]:
    """Focal lengths and centre (4,), turn and place of a camera, as kernels take them."""
    return (
        np.array([*camera.focal, *camera.centre]),
        np.ascontiguousarray(camera.world_from_camera),
        np.asarray(camera.position, dtype=np.float64),
    )


def learn_background(images: Floats) -> Floats:
    """The depth of the empty scene from images (n, height, width) of it; NaN where never seen."""
    if images.ndim != 3 or not len(images):
        raise InvalidInput(f"a background needs images (n, height, width), got {images.shape}")
    known = np.where(images > 0, images, np.nan)
    result = np.full(images.shape[1:], np.nan)
    seen = ~np.isnan(known).all(axis=0)
    result[seen] = np.nanmedian(known[:, seen], axis=0)
    return result


def _neighbours(depth: Floats, reach: int) -> Floats:
    """All pixels that are at most `reach` away, and the pixel itself, along a first axis."""
    padded = np.pad(depth, reach, constant_values=np.nan)
    height, width = depth.shape
    side = range(2 * reach + 1)
    return np.stack([padded[r : r + height, c : c + width] for r in side for c in side])


def _clean(depth: Floats, least: int, near: float) -> Floats:
    """Floating pixels dropped, then the 3 x 3 median of what is left."""
    with np.errstate(invalid="ignore"):
        # The pixel itself is among them.
        alike = (np.abs(_neighbours(depth, 2) - depth) < near).sum(axis=0) - 1
    kept = np.where(alike >= least, depth, np.nan)
    around = np.sort(_neighbours(kept, 1), axis=0)
    known = (~np.isnan(around)).sum(axis=0)
    middle = np.take_along_axis(around, np.maximum(known - 1, 0)[None] // 2, axis=0)[0]
    return np.where(np.isnan(kept), np.nan, middle)


def _contours(depth: Floats) -> Mask:
    """Pixels beside a hole or a jump, as the printed method deletes them."""
    around = _neighbours(depth, 1)
    with np.errstate(invalid="ignore"):
        return np.asarray(~(np.abs(around - depth) < _SAME_SURFACE_M).all(axis=0))
