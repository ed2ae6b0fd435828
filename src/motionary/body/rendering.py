"""Depth images of meshes by a z-buffer, and as structured light and time of flight measure them.

What cameras measure wrongly is synthetic: it follows published figures, no camera was measured.

Conventions: a camera looks along its z, x to the right and y down. Pixel centres have whole
numbers: the centre of the first pixel is (0, 0). Depth is z in metres, NaN where nothing is.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from motionary.body.driving import pose_from_motion
from motionary.body.model import Body, skin, sum_normals
from motionary.errors import InvalidInput
from motionary.matching.distance import Engine, load_twin
from motionary.motion import Motion
from motionary.rotations import unit_vectors

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

_COMPILED = "motionary.body._compiled"
# Pixels in boxes of triangles that the NumPy twin looks at together.
_AT_ONCE = 1 << 20
#: What a camera measures wrongly: nothing, as structured light, as time of flight.
NOISES = ("none", "kinect", "tof")

#: Step of the depth of a Kinect, in metres at one metre; it grows with the square.
KINECT_STEP = 2.78e-3
#: Standard deviation along the ray at one metre; it grows with the square.
KINECT_SPREAD = 1.4e-3
_KINECT_BASELINE_M = 0.075
_LATERAL_PX = 1.0
# A surface seen at less than this angle reflects no pattern.
_GRAZING = np.radians(10)
TIME_OF_FLIGHT_SPREAD = 1.5e-3


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A pinhole camera: image size, focal length and centre in pixels, and where it is.

    `world_from_camera` is its turn, shape (3, 3), `position` its place in metres; nothing nearer
    than `near_m` is seen.
    """

    width: int = 320
    height: int = 240
    focal: tuple[float, float] = (285.63, 285.63)
    centre: tuple[float, float] = (160.0, 120.0)
    world_from_camera: Floats = field(default_factory=lambda: np.eye(3))
    position: Floats = field(default_factory=lambda: np.zeros(3))
    near_m: float = 0.05

    def __post_init__(self) -> None:
        if not (self.width > 0 and self.height > 0 and min(self.focal) > 0 and self.near_m > 0):
            raise InvalidInput(
                "a camera needs a size, focal length and near plane above 0, got "
                f"{self.width} x {self.height}, {self.focal}, {self.near_m}"
            )
        turn = np.asarray(self.world_from_camera, dtype=np.float64)
        if turn.shape != (3, 3) or not np.allclose(turn @ turn.T, np.eye(3), atol=1e-6):
            raise InvalidInput("world_from_camera needs to be a rotation matrix (3, 3)")

    def looking_at(self, position: Floats, target: Floats) -> Self:
        """The camera at a place, upright, its axis through a target."""
        forward = unit_vectors(np.asarray(target, dtype=np.float64) - position)
        right = unit_vectors(np.cross(forward, (0.0, 1.0, 0.0)))
        if np.isnan(right).any():
            raise InvalidInput("a camera that is upright cannot look straight up or down")
        turn = np.stack([right, np.cross(forward, right), forward], axis=1)
        place = np.asarray(position, dtype=np.float64)
        return replace(self, world_from_camera=turn, position=place)

    def crop_around(self, points: Floats, *, margin_px: int) -> tuple[Self, Indices]:
        """The camera of the part of the image around points, and that part's first pixel."""
        size = np.array([self.width, self.height])
        if (self.to_camera(points)[:, 2] < self.near_m).any():
            return self, np.zeros(2, dtype=np.intp)
        flat = self.project(points)
        first = np.clip(np.floor(flat.min(axis=0)).astype(np.intp) - margin_px, 0, size - 1)
        last = np.clip(np.ceil(flat.max(axis=0)).astype(np.intp) + margin_px, first + 1, size)
        width, height = (last - first).tolist()
        x, y = (np.array(self.centre) - first).tolist()
        return replace(self, width=width, height=height, centre=(x, y)), first

    def to_camera(self, points: Floats) -> Floats:
        """Points of the world seen from the camera, shape (..., 3)."""
        result: Floats = (points - self.position) @ self.world_from_camera
        return result

    def project(self, points: Floats) -> Floats:
        """Pixel coordinates (..., 2) of points of the world."""
        return self._flat(self.to_camera(points))

    def _flat(self, seen: Floats) -> Floats:
        result: Floats = seen[..., :2] / seen[..., 2:] * self.focal + self.centre
        return result

    def unproject(self, depth: Floats) -> Floats:
        """Places in the world of all pixels of a depth image, shape (height, width, 3)."""
        rows, columns = np.indices(depth.shape)
        flat = (np.stack([columns, rows], axis=-1) - self.centre) / self.focal
        seen = np.concatenate([flat, np.ones((*depth.shape, 1))], axis=-1) * depth[..., None]
        result: Floats = seen @ self.world_from_camera.T + self.position
        return result


class DepthImage(NamedTuple):
    """What a camera sees of a mesh.

    `depth` (height, width) in metres, NaN where nothing is; `faces` the triangle seen, -1 where
    none is.
    """

    depth: Floats
    faces: Indices


def render_depth(
    vertices: Floats, faces: Indices, camera: Camera, *, engine: Engine = "auto"
) -> DepthImage:
    """The nearest surface at each pixel.

    Parameters
    ----------
    vertices : array, shape (vertices, 3), metres, in the world
    faces : array, shape (triangles, 3)
    camera : Camera
    engine : which twin computes; "auto" takes the compiled one where it is installed

    Raises
    ------
    InvalidInput
        If a vertex is not finite, or the camera is inside the body.
    """
    if not np.isfinite(vertices).all():
        raise InvalidInput("vertices must be finite; leave out frames in which a joint is unknown")
    seen = camera.to_camera(np.asarray(vertices, dtype=np.float64))
    around = (seen.min(axis=0) < 0).all() and (seen.max(axis=0) > 0).all()
    if around and _surrounds(seen, faces):
        raise InvalidInput("the camera is inside the body; move it away or the body from it")
    corners, owners = _clip(seen[faces], camera.near_m)
    flat = camera._flat(corners)
    depth = np.full((camera.height, camera.width), np.inf)
    which = np.full(depth.shape, -1, dtype=np.intp)
    kernels = load_twin(_COMPILED, engine, pays=True)
    fill = _fill_buffer if kernels is None else kernels.fill_buffer
    fill(flat, 1.0 / corners[..., 2], camera.width, camera.height, depth, which)
    missed = which < 0
    depth[missed] = np.nan
    if len(owners) != len(faces):
        which = np.where(missed, -1, owners[which] if len(owners) else -1)
    return DepthImage(depth, which)


def find_shares(image: DepthImage, vertices: Floats, faces: Indices, camera: Camera) -> Floats:
    """Barycentric coordinates (height, width, 3) of what is seen in its triangle; NaN beside it.

    They carry whatever vertices have, such as colours and normals, to the pixels.
    """
    result = np.full((*image.depth.shape, 3), np.nan)
    hit = image.faces >= 0
    corners = np.asarray(vertices)[faces[image.faces[hit]]]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    w = camera.unproject(image.depth)[hit] - corners[:, 0]
    uu, uv, vv = ((p * q).sum(axis=1) for p, q in ((u, u), (u, v), (v, v)))
    wu, wv = (w * u).sum(axis=1), (w * v).sum(axis=1)
    scale = uu * vv - uv * uv
    second, third = (vv * wu - uv * wv) / scale, (uu * wv - uv * wu) / scale
    result[hit] = np.stack([1 - second - third, second, third], axis=1)
    return result


def _surrounds(seen: Floats, faces: Indices) -> bool:
    """Whether triangles surround the origin: their solid angles sum to a full sphere."""
    a, b, c = (seen[faces[:, k]] for k in range(3))
    la, lb, lc = (np.linalg.norm(one, axis=1) for one in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    plane = (
        la * lb * lc
        + np.einsum("ij,ij->i", a, b) * lc
        + np.einsum("ij,ij->i", b, c) * la
        + np.einsum("ij,ij->i", c, a) * lb
    )
    return bool(abs(2 * np.arctan2(volume, plane).sum()) > 2 * np.pi)


def _clip(corners: Floats, near: float) -> tuple[Floats, Indices]:
    """Triangles (n, 3, 3) in front of the near plane, and which triangle each is of."""
    behind = (corners[..., 2] < near).sum(axis=1)
    whole = np.flatnonzero(behind == 0)
    parts, owners = [corners[whole]], [whole]
    for triangle in np.flatnonzero((behind > 0) & (behind < 3)):
        polygon = []
        for this, following in zip(
            corners[triangle], np.roll(corners[triangle], -1, axis=0), strict=True
        ):
            if this[2] >= near:
                polygon.append(this)
            if (this[2] >= near) != (following[2] >= near):
                share = (near - this[2]) / (following[2] - this[2])
                polygon.append(this + share * (following - this))
        for k in range(1, len(polygon) - 1):
            parts.append(np.array([[polygon[0], polygon[k], polygon[k + 1]]]))
            owners.append(np.array([triangle]))
    return np.concatenate(parts), np.concatenate(owners)


def _fill_buffer(
    corners: Floats, inverse: Floats, width: int, height: int, depth: Floats, which: Indices
) -> None:
    """Nearest depth and triangle at each pixel, written to `depth` and `which`.

    Ties go to the earlier triangle. `corners` (n, 3, 2) in pixels, `inverse` (n, 3) of depth.
    """
    (x0, y0), (x1, y1), (x2, y2) = (corners[:, k].T for k in range(3))
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    low = np.maximum(np.ceil(corners.min(axis=1)), 0)
    high = np.minimum(np.floor(corners.max(axis=1)), (width - 1, height - 1))
    sizes = np.maximum(high - low + 1, 0).astype(np.intp)
    counts = np.where(area != 0, sizes.prod(axis=1), 0)
    ends = np.cumsum(counts)
    first = 0
    while first < len(counts):
        done = ends[first - 1] if first else 0
        last = max(first + 1, int(np.searchsorted(ends, done + _AT_ONCE, side="right")))
        part = np.arange(first, last)
        owner = np.repeat(part, counts[part])
        inside = np.arange(len(owner)) - np.repeat(ends[part] - counts[part] - done, counts[part])
        row = inside // sizes[owner, 0] + low[owner, 1]
        column = inside % sizes[owner, 0] + low[owner, 0]
        (x0, y0), (x1, y1), (x2, y2) = (corners[owner, k].T for k in range(3))
        a = ((x1 - column) * (y2 - row) - (x2 - column) * (y1 - row)) / area[owner]
        b = ((x2 - column) * (y0 - row) - (x0 - column) * (y2 - row)) / area[owner]
        c = ((x0 - column) * (y1 - row) - (x1 - column) * (y0 - row)) / area[owner]
        hit = np.flatnonzero((a >= 0) & (b >= 0) & (c >= 0))
        of = owner[hit]
        x, y, z = inverse[of].T
        here = 1.0 / (a[hit] * x + b[hit] * y + c[hit] * z)
        pixel = row[hit].astype(np.intp) * width + column[hit].astype(np.intp)
        # The last of equal pixels stays in an assignment: farther ones, then later ones, go first.
        order = np.lexsort((-of, -here))
        pixel, of, here = pixel[order], of[order], here[order]
        best = np.full(depth.size, np.inf)
        best_of = np.full(depth.size, -1, dtype=np.intp)
        best[pixel], best_of[pixel] = here, of
        nearer = best < depth.ravel()
        depth.reshape(-1)[nearer] = best[nearer]
        which.reshape(-1)[nearer] = best_of[nearer]
        first = last


def shade(image: DepthImage, vertices: Floats, faces: Indices, camera: Camera) -> Floats:
    """Brightness (height, width) in [0, 1] of a dull surface lit from the camera; NaN beside it."""
    seen = camera.to_camera(vertices)
    normals = sum_normals(seen, faces)
    hit = image.faces >= 0
    shares = find_shares(image, vertices, faces, camera)[hit]
    smooth = (shares[..., None] * normals[faces[image.faces[hit]]]).sum(axis=1)
    result = np.full(image.depth.shape, np.nan)
    result[hit] = np.abs(unit_vectors(smooth)[:, 2])
    return result


# ---- as cameras measure it


def add_kinect_noise(depth: Floats, camera: Camera, *, seed: int) -> Floats:
    """A depth image as structured light gives it: jittered edges, steps of disparity, holes.

    Parameters
    ----------
    depth : array, shape (height, width), metres, NaN where nothing is
    camera : the camera that saw it
    seed : of the noise
    """
    rng = np.random.default_rng(seed)
    height, width = depth.shape
    rows, columns = np.indices(depth.shape)
    jitter = rng.normal(0.0, _LATERAL_PX / 2, (2, height, width))
    rows = np.clip(np.rint(rows + jitter[0]), 0, height - 1).astype(np.intp)
    columns = np.clip(np.rint(columns + jitter[1]), 0, width - 1).astype(np.intp)
    moved = depth[rows, columns]
    moved = moved + rng.normal(size=moved.shape) * KINECT_SPREAD * moved**2
    moved[_is_grazing(depth, camera)[rows, columns]] = np.nan
    moved[_is_shadowed(depth, camera)[rows, columns]] = np.nan
    disparity = 1.0 / moved
    stepped: Floats = 1.0 / (np.rint(disparity / KINECT_STEP) * KINECT_STEP)
    return stepped


def add_time_of_flight_noise(depth: Floats, *, seed: int, mixed: bool = True) -> Floats:
    """A depth image as time of flight gives it: noise by range, and mixed pixels at edges.

    Parameters
    ----------
    depth : array, shape (height, width), metres, NaN where nothing is
    seed : of the noise
    mixed : whether pixels at edges between two surfaces lie between them
    """
    rng = np.random.default_rng(seed)
    result = depth.copy()
    if mixed:
        right = np.roll(depth, -1, axis=1)
        right[:, -1] = np.nan
        edge = np.abs(depth - right) > 0.1
        share = rng.uniform(size=depth.shape)
        result = np.where(edge, share * depth + (1 - share) * right, result)
    spread = TIME_OF_FLIGHT_SPREAD * result**2
    noisy: Floats = result + rng.normal(size=depth.shape) * spread
    return noisy


def _is_grazing(depth: Floats, camera: Camera) -> NDArray[np.bool_]:
    """Where the ray meets the surface at less than the grazing angle."""
    places = (camera.unproject(depth) - camera.position) @ camera.world_from_camera
    across = np.cross(np.gradient(places, axis=1), np.gradient(places, axis=0))
    sine = np.abs((across * places).sum(axis=-1))
    whole = np.linalg.norm(across, axis=-1) * np.linalg.norm(places, axis=-1)
    with np.errstate(invalid="ignore"):
        return np.asarray(sine < np.sin(_GRAZING) * whole)


def _is_shadowed(depth: Floats, camera: Camera) -> NDArray[np.bool_]:
    """Where the projector, to the right of the camera, cannot reach for something nearer."""
    disparity = np.nan_to_num(camera.focal[0] * _KINECT_BASELINE_M / depth, nan=0.0)
    # A pixel at column c is lit at column c - disparity of the projector; what lies to its
    # right and reaches as far left there, from nearer, keeps the light off.
    lit = np.arange(depth.shape[1]) - disparity
    lowest = np.minimum.accumulate(np.where(np.isnan(depth), np.inf, lit)[:, ::-1], axis=1)[:, ::-1]
    ahead = np.concatenate([lowest[:, 1:], np.full((len(depth), 1), np.inf)], axis=1)
    return np.asarray(ahead < lit - 0.5)


@dataclass(frozen=True, slots=True)
class DepthSettings:
    """A depth camera in front of the body.

    Attributes
    ----------
    noise : one of `NOISES`
    distance_m : from the camera to where the body mostly is
    images_hz : images a second
    """

    noise: str = "kinect"
    distance_m: float = 3.0
    images_hz: float = 30.0

    def __post_init__(self) -> None:
        if self.noise not in NOISES:
            raise InvalidInput(f"noise: choose one of {', '.join(NOISES)}, got {self.noise!r}")
        for name, value, least, most in (
            ("distance_m", self.distance_m, 0.7, 20.0),
            ("images_hz", self.images_hz, 0.01, 1000.0),
        ):
            if not least <= value <= most:
                raise InvalidInput(f"{name} needs to be from {least:g} to {most:g}, got {value:g}")


def record_depth(
    body: Body, motion: Motion, settings: DepthSettings, *, seed: int = 0
) -> tuple[Camera, Iterator[Floats]]:
    """A camera in front of the body, and what it sees of the motion, image by image; synthetic.

    Images (height, width) hold metres, NaN where nothing is; the same seed gives the same.

    Raises
    ------
    InvalidInput
        If the motion cannot drive the body.
    """
    pose = pose_from_motion(body, motion).pose
    target = np.median(pose.joints[:, 0], axis=0)
    forward = pose.rotations[:, 0, :, 2].mean(axis=0) * (1, 0, 1)
    length = float(np.linalg.norm(forward))
    # Whoever turns all round has no front.
    front = forward / length if length > 0.1 else np.array([0.0, 0.0, 1.0])
    place = target + settings.distance_m * front + np.array([0.0, 0.2, 0.0])
    camera = Camera().looking_at(place, target)
    at = np.arange(0, motion.n_frames, motion.rate_hz / settings.images_hz).astype(np.intp)

    def see(number: int, frame: int) -> Floats:
        moment = slice(frame, frame + 1)
        one = pose._replace(rotations=pose.rotations[moment], joints=pose.joints[moment])
        vertices = np.asarray(skin(body, one)[0], dtype=np.float64)
        clean = render_depth(vertices, body.faces, camera).depth
        if settings.noise == "kinect":
            return add_kinect_noise(clean, camera, seed=seed + number)
        if settings.noise == "tof":
            return add_time_of_flight_noise(clean, seed=seed + number)
        return clean

    return camera, (see(number, frame) for number, frame in enumerate(at.tolist()))
