"""A body followed in images of several cameras by regions of colour, without keypoints.

After Baak (2012), section 6.2.3, and Schmaltz et al. (2007): the projected body splits each image
into an inside and an outside, each with its distribution of colours. Points of the contour move
along its normal to where both explain the image best, and rays of the moved points pull the
body's points (6.3, 6.4); again until it stands still.

Conventions: images are (height, width, 3) in [0, 1], of pinhole cameras; pixels are (x, y).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary import body as _body
from motionary.body import Body, Camera, Pose
from motionary.errors import InvalidInput
from motionary.rotations import (
    matrices_to_rotation_vectors,
    rotation_vectors_to_matrices,
)

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]

# A pixel's colour says at most so much, as a logarithm; colours never seen are so rare.
_MOST_EVIDENCE, _LEAST_DENSITY = 2.0, 1e-5
# So far on both sides of a moved contour colours must part, or it is none.
_CONTRAST_PX = 3
_STILL_PX, _MOST_ANGLE = 0.15, 0.3
# From one moment to the next so much of the last turns and step is expected again.
_ON_TURNS, _ON_ROOT = 0.6, 0.8


@dataclass(frozen=True, slots=True)
class RegionSettings:
    """How regions are told apart, and how far the body follows them.

    Attributes
    ----------
    bins : of each channel's colours
    reach_px : how far a point of the contour may move at once
    scale_px : points that move farther count little (Geman and McClure)
    turn_prior_m : a turn of one radian away from the start costs each joint like so many metres
    most_steps : contours drawn for each moment
    """

    bins: int = 16
    reach_px: int = 14
    scale_px: float = 8.0
    turn_prior_m: float = 0.3
    most_steps: int = 10


class Contour(NamedTuple):
    """The outline of a projected body, and where colours want it.

    `pixels` and outward `normals` (points, 2); `vertices` of the body nearest to each; `shifts`
    along the normals in pixels; `contrast`, 1 where colours beside the moved contour fall to
    their sides, 0 where it parts nothing.
    """

    pixels: Floats
    normals: Floats
    vertices: Indices
    shifts: Floats
    contrast: Floats


def follow_regions(
    body: Body,
    start: Pose,
    images: Iterable[Sequence[Floats]],
    cameras: Sequence[Camera],
    *,
    settings: RegionSettings | None = None,
) -> Pose:
    """Poses in images of all cameras, each started from those before; `start` is near the first.

    `images` are, moment by moment, one of each camera.
    """
    poses: list[Pose] = []
    for together in images:
        poses.append(fit_regions(body, start, together, cameras, settings=settings))
        start = _go_on(body, poses[-2:])
    if not poses:
        raise InvalidInput("regions need images, got none")
    return Pose(*(np.concatenate([one[part] for one in poses]) for part in (0, 1)))


def _go_on(body: Body, poses: Sequence[Pose]) -> Pose:
    """The pose after two, if the body nearly goes on as from the first to the second."""
    before, now = (_body.local_rotations(body, one) for one in (poses[0], poses[-1]))
    turned = _ON_TURNS * matrices_to_rotation_vectors(np.swapaxes(before, -1, -2) @ now)
    moved = _ON_ROOT * (poses[-1].joints[:, 0] - poses[0].joints[:, 0])
    roots = poses[-1].joints[:, 0] - body.joints[0] + moved
    return _body.pose_body(body, now @ rotation_vectors_to_matrices(turned), roots)


def fit_regions(
    body: Body,
    start: Pose,
    images: Sequence[Floats],
    cameras: Sequence[Camera],
    *,
    settings: RegionSettings | None = None,
) -> Pose:
    """The pose whose outlines part the colours of images best, from near it.

    Parameters
    ----------
    body : the person's
    start : one pose; what no contour tells stays as it is there
    images : one of each camera
    cameras : without distortion, see `straighten`
    """
    settings = settings or RegionSettings()
    if len(start.joints) != 1 or start.stretches is not None:
        raise InvalidInput("regions start from one pose of a body that keeps its lengths")
    shapes, wanted = [one.shape for one in images], [(c.height, c.width, 3) for c in cameras]
    if shapes != wanted:
        raise InvalidInput(f"these cameras need images of shapes {wanted}, got {shapes}")
    for one in images:
        if not (one.min() >= 0 and one.max() <= 1):
            raise InvalidInput(
                f"colours need to be from 0 to 1, got {one.min():g} to {one.max():g}; divide those "
                "of 8 bits by 255"
            )
    pose = start
    for _ in range(settings.most_steps):
        contours = find_contours(body, pose, images, cameras, settings=settings)
        if not sum(len(one.pixels) for one in contours):
            raise InvalidInput("no camera sees the body in this pose; start nearer to it")
        pose, moved_px = _step(body, start, pose, contours, cameras, settings)
        if moved_px < _STILL_PX:
            break
    return pose


def find_contours(
    body: Body,
    pose: Pose,
    images: Sequence[Floats],
    cameras: Sequence[Camera],
    *,
    settings: RegionSettings | None = None,
) -> tuple[Contour, ...]:
    """The outline of the body in each image, and where colours want it."""
    vertices = np.asarray(_body.skin(body, pose)[0], dtype=np.float64)
    settings = settings or RegionSettings()
    return tuple(
        _find_contour(vertices, body.faces, image, camera, settings)
        for image, camera in zip(images, cameras, strict=True)
    )


def _find_contour(
    vertices: Floats, faces: Indices, image: Floats, camera: Camera, settings: RegionSettings
) -> Contour:
    from scipy.ndimage import binary_erosion, gaussian_filter

    # Of what is beside the body, its surroundings count.
    near, first = camera.crop_around(vertices, margin_px=2 * settings.reach_px)
    seen = _body.render_depth(vertices, faces, near).faces
    inside = seen >= 0
    # Half of the edge is enough: neighbours say the same.
    rows, columns = (one[::2] for one in np.nonzero(inside & ~binary_erosion(inside)))
    pixels = np.stack([columns, rows], axis=1).astype(np.float64)
    if not len(pixels):
        return Contour(pixels, pixels, rows, pixels[:, 0], pixels[:, 0])
    down, right = np.gradient(gaussian_filter(inside.astype(np.float64), 1.5))
    normals = -np.stack([right, down], axis=-1)[rows, columns]
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    corners = faces[seen[rows, columns]]
    far = np.linalg.norm(near.project(vertices[corners]) - pixels[:, None], axis=-1)
    nearest = corners[np.arange(len(rows)), far.argmin(axis=1)]
    left, top = first.tolist()
    own = image[top : top + near.height, left : left + near.width]
    evidence = compare_colours(own, inside, bins=settings.bins)
    shifts, contrast = _shift(pixels, normals, evidence, inside, settings.reach_px)
    return Contour(pixels + first, normals, nearest, shifts, contrast)


def compare_colours(image: Floats, inside: Bools, *, bins: int) -> Floats:
    """By how much each pixel's colour speaks for the inside, as a logarithm (height, width)."""
    from scipy.ndimage import gaussian_filter

    cells = np.minimum((image * bins).astype(np.intp), bins - 1)
    cells = (cells[..., 0] * bins + cells[..., 1]) * bins + cells[..., 2]
    densities = []
    for own in (cells[inside], cells[~inside]):
        counts = np.bincount(own, minlength=bins**3).reshape(bins, bins, bins)
        density = gaussian_filter(counts.astype(np.float64), 0.7, mode="constant")
        densities.append(density / max(len(own), 1) + _LEAST_DENSITY)
    told = np.log(densities[0] / densities[1]).ravel()[cells]
    evidence: Floats = np.clip(told, -_MOST_EVIDENCE, _MOST_EVIDENCE)
    return evidence


def _shift(
    pixels: Floats, normals: Floats, evidence: Floats, inside: Bools, reach_px: int
) -> tuple[Floats, Floats]:
    """How far each point moves along its normal, pixels, and how well that parts the colours."""
    from scipy.ndimage import map_coordinates

    steps = np.arange(-reach_px, reach_px + 1)
    at = np.moveaxis((pixels[:, None] + steps[:, None] * normals[:, None])[..., ::-1], -1, 0)
    told = map_coordinates(evidence, at, order=1, mode="nearest")
    row, column = np.rint(at).astype(np.intp)
    height, width = inside.shape
    within = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    mask = inside[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    # Beyond the far side of a limb, or where another begins, other contours decide. Pixels next
    # to the contour may fall to either side of it.
    fits = within & (mask == (steps <= 0)) | (np.abs(steps) <= 1)
    inward = np.logical_and.accumulate(fits[:, reach_px::-1], axis=1)[:, :0:-1]
    outward = np.logical_and.accumulate(fits[:, reach_px:], axis=1)
    allowed = np.concatenate([inward, outward], axis=1)
    # All up to the step are inside, all after it outside.
    gain = np.cumsum(np.where(allowed, told, 0.0), axis=1)
    best = np.where(allowed, gain, -np.inf).argmax(axis=1)
    near = np.arange(1 - _CONTRAST_PX, _CONTRAST_PX + 1)
    # An edge at the end of what may be looked at is none: nothing speaks beyond it.
    known = np.pad(np.where(allowed, told, 0.0), ((0, 0), (_CONTRAST_PX, _CONTRAST_PX)))
    around = np.take_along_axis(known, best[:, None] + _CONTRAST_PX + near, axis=1)
    parted = (around * np.where(near <= 0, 1, -1)).mean(axis=1) / _MOST_EVIDENCE
    return steps[best].astype(np.float64), np.maximum(parted, 0.0)


def _step(
    body: Body,
    start: Pose,
    pose: Pose,
    contours: Sequence[Contour],
    cameras: Sequence[Camera],
    settings: RegionSettings,
) -> tuple[Pose, float]:
    """One step of (6.4), and how far it moved points of the contours, mean, in pixels."""
    n = len(body.names)
    matrix, slope = 1e-6 * np.eye(3 * n + 3), np.zeros(3 * n + 3)
    rows, sizes = [], []
    for contour, camera in zip(contours, cameras, strict=True):
        points = body.points(contour.vertices)
        places = np.asarray(_body.skin(body, pose, points)[0], dtype=np.float64)
        goals = camera.project(places) + contour.shifts[:, None] * contour.normals
        ray = np.concatenate([(goals - camera.centre) / camera.focal, np.ones((len(goals), 1))], 1)
        ray = ray @ camera.world_from_camera.T / np.linalg.norm(ray, axis=1, keepdims=True)
        # As long as x × n − m of (6.3): the way from the ray to the point.
        off = np.eye(3) - ray[:, :, None] * ray[:, None]
        missed = (off @ (places - camera.position)[..., None])[..., 0]
        weights = (1 + (contour.shifts / settings.scale_px) ** 2) ** -2 * contour.contrast
        rows.append(_body.jacobian(body, pose, points))
        across = off @ rows[-1]
        matrix += np.einsum("p,pik,pil->kl", weights, across, across, optimize=True)
        slope += np.einsum("p,pik,pi->k", weights, across, missed, optimize=True)
        sizes.append(camera.to_camera(places)[:, 2] / camera.focal[0])
    now, first = (_body.local_rotations(body, one)[0] for one in (pose, start))
    # The root turns and moves freely.
    joints = np.arange(3, 3 * n)
    matrix[joints, joints] += settings.turn_prior_m**2
    away = matrices_to_rotation_vectors(np.swapaxes(first, -1, -2) @ now).ravel()
    slope[joints] += settings.turn_prior_m**2 * away[joints]
    change = np.asarray(np.linalg.solve(matrix, -slope), dtype=np.float64)
    change *= _MOST_ANGLE / max(float(np.abs(change[: 3 * n]).max()), _MOST_ANGLE)
    turns = rotation_vectors_to_matrices(change[: 3 * n].reshape(n, 3))
    root = pose.joints[0, 0] - body.joints[0] + change[3 * n :]
    moved = np.linalg.norm(np.concatenate(rows) @ change, axis=1) / np.concatenate(sizes)
    return _body.pose_body(body, (now @ turns)[None], root[None]), float(moved.mean())
