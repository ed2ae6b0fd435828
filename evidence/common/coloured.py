"""A clothed body in front of walls, rendered for several cameras; synthetic, truth exact."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import (
    Body,
    Camera,
    Pose,
    local_rotations,
    pose_body,
    pose_from_motion,
    render_depth,
    shade,
    skin,
)
from motionary.motion import Motion
from motionary.multiview import Contour
from motionary.rotations import (
    quaternions_to_matrices,
    rotation_vectors_to_quaternions,
    unit_vectors,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

#: Clothes by bone, red, green and blue.
_SKIN, _SHIRT, _TROUSERS, _SHOES = (
    (0.80, 0.60, 0.50), (0.55, 0.25, 0.25), (0.25, 0.28, 0.40), (0.15, 0.14, 0.13),
)  # fmt: skip
_CLOTHES = {
    "belly": _SHIRT, "chest": _SHIRT, "clavicle": _SHIRT, "upperarm": _SHIRT,
    "root": _TROUSERS, "thigh": _TROUSERS, "shank": _TROUSERS, "foot": _SHOES, "toes": _SHOES,
}  # fmt: skip
WIDTH, HEIGHT, FOCAL = 640, 480, 500.0


class Rendered(NamedTuple):
    """Images of a motion (moments, cameras, height, width, 3) in bytes, and the true pose."""

    body: Body
    pose: Pose
    cameras: tuple[Camera, ...]
    images: NDArray[np.uint8]

    def moment(self, number: int) -> list[Floats]:
        """Images of all cameras, in [0, 1]."""
        return [image / 255.0 for image in self.images[number]]


def cameras_around(n_cameras: int, *, far_m: float = 4.5) -> tuple[Camera, ...]:
    """Cameras in a ring around the origin, alternately higher and lower."""
    camera = Camera(WIDTH, HEIGHT, (FOCAL, FOCAL), (WIDTH / 2, HEIGHT / 2))
    spread = np.pi / 2 if n_cameras == 2 else 2 * np.pi / n_cameras
    places = [
        (far_m * np.cos(0.4 + spread * k), 1.6 + 0.5 * (k % 2), far_m * np.sin(0.4 + spread * k))
        for k in range(n_cameras)
    ]
    return tuple(camera.looking_at(np.array(one), np.array([0.0, 0.9, 0.0])) for one in places)


def drive(body: Body, motion: Motion, *, seconds: float, rate_hz: float) -> Pose:
    """Poses of the beginning of a motion, its middle above the origin, its feet near 0."""
    part = motion.cut(0, min(round(seconds * motion.rate_hz), motion.n_frames))
    pose = pose_from_motion(body, part, lengths="kept").pose
    step = max(round(motion.rate_hz / rate_hz), 1)
    turned, joints = pose.rotations[::step], pose.joints[::step]
    middle = np.median(joints[:, 0], axis=0)
    middle[1] = joints[..., 1].min() - 0.05
    return Pose(turned, joints - middle)


def displace(body: Body, pose: Pose, *, angle_deg: float, step_m: float, seed: int) -> Pose:
    """A pose with each joint turned by so much about any axis, and the body moved."""
    rng = np.random.default_rng(seed)
    turns = local_rotations(body, pose)[0]
    axes = unit_vectors(rng.normal(size=(len(turns), 3)))
    # Those that hardly show stay.
    kept = [k for k, name in enumerate(body.names) if name[1:] in ("toes", "hand", "clavicle")]
    axes[kept] = 0.0
    vectors = np.radians(angle_deg) * axes
    step = step_m * unit_vectors(rng.normal(size=3))
    changes = quaternions_to_matrices(rotation_vectors_to_quaternions(vectors))
    return pose_body(body, (turns @ changes)[None], pose.joints[:, 0] - body.joints[0] + step)


def render(
    body: Body, pose: Pose, cameras: tuple[Camera, ...], *, noise: float, seed: int
) -> Rendered:
    """Images of all poses; `noise` is the standard deviation of a pixel's channels."""
    rng = np.random.default_rng(seed)
    heaviest = body.surface.weights.argmax(axis=1)
    most = body.surface.bones[np.arange(len(heaviest)), heaviest]
    names = [body.names[k].lstrip("lr") if body.names[k] != "root" else "root" for k in most]
    colours = np.array([_CLOTHES.get(name, _SKIN) for name in names])
    walls = [paint_wall(rng) for _ in cameras]
    images = np.empty((len(pose.joints), len(cameras), HEIGHT, WIDTH, 3), dtype=np.uint8)
    for moment in range(len(pose.joints)):
        one = Pose(pose.rotations[moment : moment + 1], pose.joints[moment : moment + 1])
        vertices = np.asarray(skin(body, one)[0], dtype=np.float64)
        for k, camera in enumerate(cameras):
            near, (column, row) = camera.crop_around(vertices, margin_px=2)
            seen = render_depth(vertices, body.faces, near)
            hit = seen.faces >= 0
            image = walls[k].copy()
            part = image[row : row + near.height, column : column + near.width]
            light = 0.5 + 0.5 * shade(seen, vertices, body.faces, near)[hit]
            part[hit] = colours[body.faces[seen.faces[hit], 0]] * light[:, None]
            image += rng.normal(0, noise, image.shape)
            images[moment, k] = np.rint(255 * np.clip(image, 0, 1))
    return Rendered(body, pose, cameras, images)


def paint_wall(rng: np.random.Generator) -> Floats:
    """A wall with large and small spots, some of them in colours of the clothes."""
    from scipy.ndimage import gaussian_filter

    wall = np.full((HEIGHT, WIDTH, 3), 0.55)
    for size, strength in ((40, 0.12), (8, 0.05)):
        spots = rng.normal(size=wall.shape)
        spots = gaussian_filter(spots, (size, size, 0))
        wall += strength * spots / spots.std()
    # Things that look like trousers and skin stand about.
    for colour in (_TROUSERS, _SKIN, _SHIRT):
        row, column = rng.integers(0, HEIGHT), rng.integers(0, WIDTH)
        wall[row : row + 90, column : column + 60] = colour
    return wall


def draw_contours(
    images: Sequence[Floats], rows: Sequence[Sequence[Contour]], *, margin_px: int = 22
) -> "Figure":
    """Images with outlines of a body, and where colours want them; a row for each step."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 2.7 * len(rows)), layout="constrained")
    axes = figure.subplots(len(rows), len(images))
    for row, contours in zip(axes, rows, strict=True):
        for one, image, contour in zip(row, images, contours, strict=True):
            moved = contour.shifts * (contour.contrast > 0)
            goals = contour.pixels + moved[:, None] * contour.normals
            one.imshow(image)
            one.plot(*contour.pixels.T, ".", color="cyan", markersize=1.5)
            one.plot(*np.stack([contour.pixels, goals]).transpose(2, 0, 1), color="lime", lw=0.6)
            low = contour.pixels.min(axis=0) - margin_px
            high = contour.pixels.max(axis=0) + margin_px
            one.set(xlim=(low[0], high[0]), ylim=(high[1], low[1]))
            one.set_axis_off()
    return figure
