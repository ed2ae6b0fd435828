"""Depth images of a motion as cameras measure them: structured light and time of flight.

Synthetic: moments follow published figures of such cameras, no camera was measured.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.body.chain import skin
from motionary.body.driving import pose_from_motion
from motionary.body.model import Body
from motionary.body.rendering import Camera, render_depth
from motionary.errors import InvalidInput
from motionary.motion import Motion

Floats = NDArray[np.float64]
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


def add_time_of_flight_noise(
    depth: Floats, *, seed: int, reflectance: float = 1.0, mixed: bool = True
) -> Floats:
    """A depth image as time of flight gives it: noise by range, and mixed pixels at edges.

    Parameters
    ----------
    depth : array, shape (height, width), metres, NaN where nothing is
    seed : of the noise
    reflectance : of the surface, at most 1; the darker, the noisier
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
    spread = TIME_OF_FLIGHT_SPREAD * result**2 / reflectance
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
