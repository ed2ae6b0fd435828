"""Rendered scenes for a depth camera: real motions, bodies of several builds, truth; synthetic."""

from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import (
    Camera,
    add_kinect_noise,
    add_time_of_flight_noise,
    load_body,
    pose_from_motion,
    render_depth,
    skin,
)
from motionary.body.model import Pose, local_rotations
from motionary.depth.poses import heading_of, turn_about_up
from motionary.io import read

Floats = NDArray[np.float64]

SEED = 0
HZ = 30
#: What is tracked: recording, first second and seconds.
LONG = (("cmu/86_01.amc", 2.0, 7.0), ("cmu/exercises/13_29.amc", 4.0, 6.0))
SHORT = (
    ("cmu/86_01.amc", 16.0, 1.5), ("cmu/exercises/13_30.amc", 6.0, 1.5),
    ("hdm05/throwBasketball", 0.0, 1.5), ("hdm05/kickLFront1Reps", 0.0, 1.5),
)  # fmt: skip
BUILDS = {
    "man": {"gender": 1.0},
    "heavy": {"gender": 0.5, "weight": 0.8},
    "woman": {"gender": -1.0},
    "tall and thin": {"gender": 1.0, "height": 0.45, "weight": -0.7},
}
CAMERAS = {"kinect": (Camera(), 2.8), "tof": (Camera(176, 144, (220.0, 220.0), (88.0, 72.0)), 3.4)}
_WALL_M, _CUT_M = 4.5, 4.25
_FOLD = np.radians(28)
#: An end is seen if a pixel near it has its depth.
_SEEN_M = 0.1


class Scene(NamedTuple):
    """What is rendered: a recording's part, who does it, before which camera, from which side."""

    path: str
    start_s: float
    seconds: float
    build: str = "man"
    camera: str = "kinect"
    turn_deg_s: float = 0.0
    side_deg: float = 0.0


class Rendered(NamedTuple):
    """Images and their truth: joints, ends, which ends are seen, turns, stature."""

    camera: Camera
    images: NDArray[np.uint16]
    joints: Floats
    ends: Floats
    seen: NDArray[np.bool_]
    turns: Floats
    stature_m: float


def _read(folder: Path, scene: Scene) -> Any:
    place = folder / scene.path
    path = place if place.suffix else sorted(place.glob("*_tr_*.amc"))[0]
    motion = read(path, asf=folder / "cmu" / "86.asf") if "13_" in path.name else read(path)
    first = round(scene.start_s * motion.rate_hz)
    stop = min(first + round(scene.seconds * motion.rate_hz), motion.n_frames)
    return motion.cut(min(first, stop - 1), stop)


@lru_cache(maxsize=4)
def render(folder: Path, scene: Scene) -> Rendered:
    """Depth images of a scene, in millimetres, and their truth; synthetic."""
    from scipy.ndimage import uniform_filter1d

    body = load_body().shaped(BUILDS[scene.build])
    camera, far = CAMERAS[scene.camera]
    camera = camera.looking_at(np.array([0.0, 1.0, far]), np.array([0.0, 0.9, 0.0]))
    motion = _read(folder, scene)
    step = round(motion.rate_hz / HZ)
    pose = pose_from_motion(body, motion, lengths="kept").pose
    turned, joints = pose.rotations[::step], pose.joints[::step]
    headings = heading_of(turned, body)
    # Folded to what the printed method allows, then turned as the scene wants it.
    wanted = _FOLD * np.arcsin(np.sin(np.unwrap(headings))) / (np.pi / 2)
    wanted += (
        np.radians(scene.side_deg) + np.radians(scene.turn_deg_s) * np.arange(len(turned)) / HZ
    )
    drift = uniform_filter1d(joints[:, 0], 61, axis=0, mode="nearest")
    low = joints[..., 1].min() - 0.05
    images, truth = [], []
    for number, heading in enumerate(wanted):
        turn = turn_about_up(heading - headings[number])
        middle = joints[number, 0] * (1, 0, 1)
        placed = (
            joints[number] - middle + (joints[number, 0] - drift[number]) * (1, 0, 1)
        ) @ turn.T
        placed[:, 1] -= low
        one = Pose((turn @ turned[number])[None], placed[None])
        vertices = np.asarray(skin(body, one), dtype=np.float64)[0]
        clean = render_depth(vertices, body.faces, camera).depth
        images.append(_measure_depth(clean, camera, scene, SEED + number))
        ends = vertices[body.ends]
        truth.append((placed, ends, _are_seen(ends, clean, camera), local_rotations(body, one)[0]))
    places, ends, seen, turns = (np.array(part) for part in zip(*truth, strict=True))
    stature = float(np.ptp(body.vertices[:, 1]))
    return Rendered(camera, np.array(images), places, ends, seen, turns, stature)


def _measure_depth(clean: Floats, camera: Camera, scene: Scene, seed: int) -> NDArray[np.uint16]:
    if scene.camera == "kinect":
        depth = add_kinect_noise(clean, camera, seed=seed)
    else:
        depth = add_time_of_flight_noise(np.where(np.isnan(clean), _WALL_M, clean), seed=seed)
        depth[depth > _CUT_M] = np.nan
    return np.asarray(np.nan_to_num(depth * 1000), dtype=np.uint16)


def _are_seen(ends: Floats, clean: Floats, camera: Camera) -> list[bool]:
    depths = camera.to_camera(ends)[:, 2]
    flat = np.rint(camera.project(ends)).astype(int)
    windows = (clean[max(r - 2, 0) : r + 3, max(c - 2, 0) : c + 3] for c, r in flat)
    return [
        bool(window.size and (np.abs(window - z) < _SEEN_M).any())
        for window, z in zip(windows, depths, strict=True)
    ]
