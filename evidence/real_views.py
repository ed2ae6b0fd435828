"""Real cameras: a demonstration, projections of HumanEva, four videos (thesis, chapter 6)."""

import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.coloured import draw_contours
from evidence.common.pose2sim import demonstration, has_pose2sim, run_pose2sim
from evidence.common.recordings import VARIABLE, Recordings, Results
from evidence.common.views import far_mm, plant_exchanges, score_exchanges
from motionary.body import Body, Camera, Pose, load_body, pose_body, render_depth, skin
from motionary.io.cameras import CalibratedCamera, read_cameras
from motionary.io.keypoints import Views, read_keypoints, write_exchanged
from motionary.multiview import (
    Contour,
    RegionSettings,
    exchange_sources,
    find_contours,
    find_exchanges,
    fit_regions,
    fit_views,
    project,
    see,
    straighten,
    triangulate,
)
from motionary.multiview.cameras import LIMIT_PX, USUAL_FOCAL
from motionary.multiview.exchange import Exchange
from motionary.multiview.tracking import in_sequence_of, track_points
from motionary.rotations import quaternions_to_matrices, rotation_vectors_to_quaternions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "Real cameras"
SPLIT = (
    "nothing was chosen on what is here: costs of exchanges were chosen on synthetic views of CMU "
    "02, 05 and 35; an earlier choice was made on the demonstration and given up"
)
SEED = 0
SYNTHETIC = True
DATA = (
    ("demonstration of Pose2Sim 0.5.7 (BSD-3), four cameras, BODY_25B", (400, 0.03)),
    ("HumanEva-I as 15 joints, and projections to three cameras (for research)", (2, 1.5)),
    ("four videos of a person on a chair, calibrated, with masks (MIT)", (4, 0.01)),
)
SEEDS = (1, 2, 3, 4, 5)
FRACTIONS = {"legs": (0.3, 0.4), "arms": (0.21, 0.28)}
_JOINTS = (
    "Hip", "Neck", "LShoulder", "LElbow", "LWrist", "RShoulder", "RElbow", "RWrist", "LHip",
    "LKnee", "LAnkle", "RHip", "RKnee", "RAnkle", "Head",
)  # fmt: skip
_HEADINGS, _SCALES = 8, (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def measure(_: Recordings) -> Results:
    """All tables."""
    folder = Path(os.environ[VARIABLE]) / "sensors" / "multiview"
    videos = _videos(folder / "voxel4cam_person" / "data")
    return {
        "demo": _demo(),
        "humaneva": [_humaneva(folder / "humaneva15", subject) for subject in ("S1", "S2", "S3")],
        "videos": {"before": videos.before, "after": videos.after, "scale": videos.scale},
    }


# ---- Pose2Sim's demonstration


def _demo() -> Results:
    with demonstration() as demo:
        published = demo.session / "published"
        shutil.copytree(demo.pose, published)
        views = read_keypoints(published)
        fitted = fit_views(views, read_cameras(demo.calibration))
        # As Pose2Sim does it: 15 pixels of these images, whatever the focal length.
        limit_px = LIMIT_PX * USUAL_FOCAL / float(fitted.sight.focal.mean())
        clean = triangulate(fitted.sight, limit_px=limit_px).points
        theirs = run_pose2sim(demo, published, views.names) if has_pose2sim() else None
        row: Results = {"name": "as published", **score_exchanges(find_exchanges(fitted.sight), {})}
        if theirs is not None:
            row["ours_mm"] = far_mm(clean, theirs)
        rows = [row]
        for seed in SEEDS:
            damaged, planted = plant_exchanges(views, np.random.default_rng(seed), FRACTIONS)
            sight = see(damaged, fitted.cameras)
            found = find_exchanges(sight)
            sources = exchange_sources(sight, found)
            right = triangulate(sight.exchanged(sources), limit_px=limit_px).points
            row = {"name": f"seed {seed}", **score_exchanges(found, planted)}
            row["moved_mm"] = far_mm(triangulate(sight, limit_px=limit_px).points, clean)
            row["put_right_mm"] = far_mm(right, clean)
            if theirs is not None:
                everywhere = [
                    Exchange(limb, mask, np.full(mask.shape, np.inf))
                    for limb, mask in planted.items()
                ]
                wrong, mended = demo.session / f"damaged{seed}", demo.session / f"mended{seed}"
                write_exchanged(views, exchange_sources(sight, everywhere), wrong)
                write_exchanged(read_keypoints(wrong), sources, mended)
                row["theirs_mm"] = far_mm(run_pose2sim(demo, wrong, views.names), theirs)
                row["theirs_after_mm"] = far_mm(run_pose2sim(demo, mended, views.names), theirs)
                row["ours_mm"] = far_mm(right, theirs)
            rows.append(row)
    return {"rows": rows, "with_pose2sim": theirs is not None}


# ---- projections of HumanEva


def _humaneva(folder: Path, subject: str) -> Results:
    """Cameras found in recordings for training, and what they make of the others."""
    flat = np.load(folder / "data_2d_humaneva15_gt.npz", allow_pickle=True)["positions_2d"].item()
    deep = np.load(folder / "data_3d_humaneva15.npz", allow_pickle=True)["positions_3d"].item()

    def of(part: str, camera: int) -> tuple[Floats, Floats]:
        takes = deep[f"{part}/{subject}"]
        pixels = [np.asarray(flat[f"{part}/{subject}"][take][camera]) for take in takes]
        return (
            np.concatenate([np.asarray(take, dtype=np.float64) for take in takes.values()]),
            np.concatenate(pixels).astype(np.float64),
        )

    cameras = [_resect(f"C{k + 1}", *of("Train", k)) for k in range(3)]
    truth = of("Validate", 0)[0]
    pixels = np.stack([of("Validate", k)[1] for k in range(3)])
    missed = np.stack([project(c, truth) for c in cameras]) - pixels
    views = Views(tuple(c.name for c in cameras), _JOINTS, pixels, np.ones(pixels.shape[:3]))
    points = triangulate(see(views, cameras)).points
    longest = max(deep[f"Validate/{subject}"].items(), key=lambda item: len(item[1]))[0]
    return {
        "subject": subject,
        "frames": len(truth),
        "pixels": np.linalg.norm(missed, axis=-1).mean(),
        "triangulated_mm": far_mm(points, truth),
        "walk": _exchanged_take(flat, deep, subject, longest, cameras),
    }


def _exchanged_take(
    flat: Any, deep: Any, subject: str, take: str, cameras: list[CalibratedCamera]
) -> Results:
    """The longest recording in three views, sides exchanged as in the demonstration."""
    truth = np.asarray(deep[f"Validate/{subject}"][take], dtype=np.float64)
    pixels = np.stack(
        [np.asarray(one, dtype=np.float64) for one in flat[f"Validate/{subject}"][take]]
    )
    pixels += np.random.default_rng(SEED).normal(0, 1.5, pixels.shape)
    views = Views(tuple(c.name for c in cameras), _JOINTS, pixels, np.ones(pixels.shape[:3]))
    rows: list[tuple[Any, ...]] = []
    for seed in SEEDS:
        damaged, planted = plant_exchanges(views, np.random.default_rng(seed), FRACTIONS)
        sight = see(damaged, cameras)
        found = track_points(sight, rate_hz=60.0)
        points = in_sequence_of(_JOINTS, found.chain.points, found.points)
        scores = score_exchanges(found.exchanges, planted)
        rows.append((far_mm(triangulate(sight).points, truth), far_mm(points, truth),
                     scores["found"], scores["false"]))  # fmt: skip
    keys = ("damaged_mm", "tracked_mm", "found", "false")
    return {"take": take, **dict(zip(keys, np.mean(rows, axis=0), strict=True))}


def _resect(name: str, points: Floats, pixels: Floats) -> CalibratedCamera:
    """The camera of points and their pixels: linear first, then with its lens."""
    from scipy.linalg import rq
    from scipy.optimize import least_squares

    part = slice(None, None, max(len(points) // 150, 1))
    places, seen = points[part].reshape(-1, 3), pixels[part].reshape(-1, 2)
    whole = np.c_[places, np.ones(len(places))]
    none = np.zeros_like(whole)
    rows = np.r_[np.c_[whole, none, -seen[:, :1] * whole], np.c_[none, whole, -seen[:, 1:] * whole]]
    matrix = np.linalg.svd(rows, full_matrices=False)[2][-1].reshape(3, 4)
    matrix *= np.sign(np.linalg.det(matrix[:, :3]))
    inner, turn = rq(matrix[:, :3])
    signs = np.diag(np.sign(np.diag(inner)))
    inner, turn = inner @ signs, signs @ turn
    move = np.linalg.solve(inner, matrix[:, 3])
    inner = inner / inner[2, 2]

    def camera(x: Floats) -> CalibratedCamera:
        own = np.array([[x[0], 0, x[2]], [0, x[1], x[3]], [0, 0, 1]])
        step = quaternions_to_matrices(rotation_vectors_to_quaternions(x[4:7][None]))[0]
        return CalibratedCamera(name, own, step @ turn, x[7:10], np.array([*x[10:14], 0.0]))

    first = [inner[0, 0], inner[1, 1], inner[0, 2], inner[1, 2], 0, 0, 0, *move, 0, 0, 0, 0]
    found = least_squares(
        lambda x: (project(camera(x), places) - seen).ravel(), first, x_scale="jac"
    )
    return camera(found.x)


# ---- videos


class Videos(NamedTuple):
    """A person found in four videos: overlaps with the masks, and what is drawn."""

    body: Body
    start: Pose
    pose: Pose
    cameras: list[Camera]
    masks: list[Bools]
    contours: list[tuple[Contour, ...]]
    before: list[float]
    after: list[float]
    scale: float


def _videos(folder: Path) -> Videos:
    """A person who sits; where, how tall and how turned at first is told by the published masks."""
    import cv2

    # The calibration's z points down, in mm.
    upright = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    cameras, images, masks = [], [], []
    for k in range(4):
        own = folder / f"cam{k + 1}"
        calibrated = read_cameras(own / "config.xml")[0]
        image = _unit(cv2.VideoCapture(str(own / "video.avi")).read()[1])
        mask = _unit(cv2.imread(str(own / f"bgmask_opening_contouring_{k}.jpg")))
        straight, camera = straighten(image[..., ::-1], calibrated, unit_m=0.001)
        images.append(straight)
        masks.append(straighten(mask, calibrated)[0][..., 0] > 0.5)
        cameras.append(
            replace(
                camera,
                world_from_camera=upright @ camera.world_from_camera,
                position=upright @ camera.position,
            )
        )
    body = load_body().shaped({"gender": 1.0})
    tried = [_seat(body, scale, images, masks, cameras) for scale in _SCALES]
    return max(tried, key=lambda one: float(np.mean(one.after)))


def _seat(
    body: Body, scale: float, images: list[Floats], masks: list[Bools], cameras: list[Camera]
) -> Videos:
    """The pose from the best of eight headings, in a world of another size."""
    scaled = [replace(camera, position=scale * camera.position) for camera in cameras]
    starts = []
    for heading in range(_HEADINGS):
        start = _start(body, 2 * np.pi * heading / _HEADINGS, masks, scaled)
        before = _overlap(_silhouettes(body, start, scaled), masks)
        starts.append((float(np.mean(before)), start, before))
    _, start, before = max(starts, key=lambda one: one[0])
    pose = fit_regions(body, start, images, scaled, settings=RegionSettings(most_steps=20))
    after = _overlap(_silhouettes(body, pose, scaled), masks)
    contours = [find_contours(body, one, images, scaled) for one in (start, pose)]
    return Videos(body, start, pose, scaled, masks, contours, before, after, scale)


def _unit(image: Any) -> Floats:
    return np.asarray(image, dtype=np.float64) / 255.0


def _middle(masks: list[Bools], cameras: list[Camera]) -> Floats:
    """Where rays through the middles of the masks meet."""
    matrix, slope = np.zeros((3, 3)), np.zeros(3)
    for mask, camera in zip(masks, cameras, strict=True):
        centre = np.argwhere(mask).mean(axis=0)[::-1]
        ray = camera.world_from_camera @ [*((centre - camera.centre) / camera.focal), 1.0]
        off = np.eye(3) - np.outer(ray, ray) / (ray @ ray)
        matrix += off
        slope += off @ camera.position
    return np.asarray(np.linalg.solve(matrix, slope))


def _start(body: Body, heading: float, masks: list[Bools], cameras: list[Camera]) -> Pose:
    """A person who sits, hands on the thighs, where the middle of the masks is."""
    vectors = np.zeros((len(body.names), 3))
    vectors[0, 1] = heading
    for side, sign in (("l", -1.0), ("r", 1.0)):
        vectors[body.index(f"{side}thigh"), 0] = -np.pi / 2
        vectors[body.index(f"{side}shank"), 0] = np.pi / 2
        vectors[body.index(f"{side}upperarm"), 2] = sign * np.radians(35)
        vectors[body.index(f"{side}forearm"), 0] = -np.radians(60)
    turns = quaternions_to_matrices(rotation_vectors_to_quaternions(vectors))[None]
    middle = _middle(masks, cameras)
    step = middle - body.joints[0]
    for _ in range(3):
        pose = pose_body(body, turns, step[None])
        step = step + middle - _middle(_silhouettes(body, pose, cameras), cameras)
    return pose_body(body, turns, step[None])


def _silhouettes(body: Body, pose: Pose, cameras: list[Camera]) -> list[Bools]:
    vertices = np.asarray(skin(body, pose)[0], dtype=np.float64)
    return [render_depth(vertices, body.faces, camera).faces >= 0 for camera in cameras]


def _overlap(seen: list[Bools], masks: list[Bools]) -> list[float]:
    """Intersection over union of body and mask in each image."""
    return [float((a & b).sum() / (a | b).sum()) for a, b in zip(seen, masks, strict=True)]


def draw_recordings(_: Recordings, results: Results) -> "dict[str, Figure]":
    """Contours before and after, over the published masks: no images of people are shown."""
    folder = Path(os.environ[VARIABLE]) / "sensors" / "multiview"
    videos = _videos(folder / "voxel4cam_person" / "data")
    masks = [np.where(mask[..., None], 0.6, [1.0, 1.0, 1.0]) for mask in videos.masks]
    return {"real_views": draw_contours(masks, videos.contours)}
