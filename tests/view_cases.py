"""Cameras around a synthetic walk, and what they see of it, written as other programs write it."""

import json
from pathlib import Path

import numpy as np

from motionary.io.cameras import CalibratedCamera
from motionary.io.keypoints import LAYOUTS

NAMES = LAYOUTS["HALPE_26"][1]
WIDTH, HEIGHT, FOCAL = 1920, 1080, 1200.0


def rodrigues(turn):
    """Rotation vector of a matrix, by its logarithm."""
    angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return (axis / (2 * np.sin(angle)) * angle).tolist()


def ring(n=4, radius=6.0, height=1.6):
    """Cameras in a ring around the origin, z up: rotation (3, 3), translation, by definition."""
    cameras = []
    for k in range(n):
        # Of different heights and distances, so that no two could take each other's place.
        angle, far = 2 * np.pi * (k + 0.2 * (k % 2)) / n + 0.3, radius - 0.5 * (k % 3)
        place = np.array([far * np.cos(angle), far * np.sin(angle), height + 0.3 * (k % 4)])
        forward = np.array([0, 0, 0.9]) - place
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        turn = np.stack([right, np.cross(forward, right), forward])
        cameras.append((turn, -turn @ place))
    return cameras


def as_calibrated(cameras):
    """The cameras as a calibration gives them, without a file."""
    matrix = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1.0]])
    return [
        CalibratedCamera(f"cam_{k + 1:02d}", matrix, turn, move, np.zeros(5), (WIDTH, HEIGHT))
        for k, (turn, move) in enumerate(cameras)
    ]


def pinhole(camera, points):
    """Pixels of points, without a lens."""
    turn, move = camera
    seen = points @ turn.T + move
    return seen[..., :2] / seen[..., 2:] * FOCAL + [WIDTH / 2, HEIGHT / 2]


def walker(n_frames=60, rate_hz=60.0):
    """Points of a figure that walks through the origin, z up, (frames, 26, 3)."""
    t = np.arange(n_frames) / rate_hz
    points = np.zeros((n_frames, len(NAMES), 3))
    at = {name: k for k, name in enumerate(NAMES)}
    forward = (1.2 * (t - t.mean()))[:, None] * [1.0, 0, 0]

    def put(name, x, y, z):
        points[:, at[name]] = forward + np.stack(np.broadcast_arrays(x, y, z), axis=-1)

    for name, x, z in (("Hip", 0, 0.95), ("Neck", 0, 1.45), ("Head", 0, 1.75), ("Nose", 0.1, 1.62)):
        put(name, x + 0 * t, 0, z)
    for side, y, phase in (("L", 1.0, 0.0), ("R", -1.0, np.pi)):
        swing = 0.5 * np.sin(2 * np.pi * t + phase)
        bend = 0.5 * np.maximum(np.cos(2 * np.pi * t + phase), 0) + 0.1
        put(f"{side}Eye", 0.08, 0.03 * y, 1.66)
        put(f"{side}Ear", 0.0, 0.08 * y, 1.65)
        put(f"{side}Shoulder", 0, 0.18 * y, 1.42)
        put(f"{side}Hip", 0, 0.1 * y, 0.93)
        x, z = 0.43 * np.sin(swing), 0.93 - 0.43 * np.cos(swing)
        put(f"{side}Knee", x, 0.1 * y, z)
        x, z = x + 0.42 * np.sin(swing - bend), z - 0.42 * np.cos(swing - bend)
        put(f"{side}Ankle", x, 0.1 * y, z)
        put(f"{side}Heel", x - 0.05, 0.1 * y, z - 0.06)
        put(f"{side}BigToe", x + 0.17, 0.09 * y, z - 0.07)
        put(f"{side}SmallToe", x + 0.14, 0.14 * y, z - 0.07)
        x, z = -0.3 * np.sin(swing), 1.42 - 0.3 * np.cos(swing)
        put(f"{side}Elbow", x, 0.22 * y, z)
        put(
            f"{side}Wrist", x - 0.26 * np.sin(swing - 0.4), 0.22 * y, z - 0.26 * np.cos(swing - 0.4)
        )
    return points


def detect(points, cameras, *, noise_px=1.5, seed=0):
    """Pixels (cameras, frames, points, 2) and scores with noise."""
    rng = np.random.default_rng(seed)
    pixels = np.stack([pinhole(camera, points) for camera in cameras])
    return pixels + rng.normal(0, noise_px, pixels.shape), rng.uniform(0.6, 1.0, pixels.shape[:3])


def exchange(values, camera, frames, parts):
    """Values of both sides of parts exchanged in place."""
    for part in parts:
        left, right = NAMES.index(f"L{part}"), NAMES.index(f"R{part}")
        values[camera, frames, left], values[camera, frames, right] = (
            values[camera, frames, right].copy(), values[camera, frames, left].copy(),
        )  # fmt: skip


def write_openpose(folder, pixels, scores):
    """A folder for each camera, a file for each image, in OpenPose's layout."""
    for camera, (places, certain) in enumerate(zip(pixels, scores, strict=True)):
        inner = Path(folder) / f"cam{camera + 1}_json"
        inner.mkdir(parents=True)
        for frame in range(len(places)):
            flat = np.concatenate([places[frame], certain[frame][:, None]], axis=1).ravel()
            person = {"person_id": [-1], "pose_keypoints_2d": flat.round(3).tolist()}
            text = json.dumps({"version": 1.3, "people": [person]})
            (inner / f"cam{camera + 1}_{frame:06d}.json").write_text(text)


def write_toml(path, cameras, *, unit=1.0, names="cam_{:02d}"):
    """A calibration as Pose2Sim and anipose write it."""
    lines = []
    for k, (turn, move) in enumerate(cameras):
        lines += [
            f"[cam_{k + 1:02d}]",
            f'name = "{names.format(k + 1)}"',
            f"size = [ {WIDTH}.0, {HEIGHT}.0,]",
            f"matrix = [ [ {FOCAL}, 0.0, {WIDTH / 2},], [ 0.0, {FOCAL}, {HEIGHT / 2},], "
            "[ 0.0, 0.0, 1.0,],]",
            "distortions = [ 0.0, 0.0, 0.0, 0.0,]",
            f"rotation = {rodrigues(turn)}",
            f"translation = {(move * unit).tolist()}",
            "fisheye = false",
            "",
        ]
    Path(path).write_text("\n".join([*lines, "[metadata]", "adjusted = false", "error = 0.0"]))
