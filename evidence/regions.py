"""A body followed in rendered images by regions of colour, beside keypoints (thesis, 6.2.3)."""

import os
import time
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.coloured import (
    Rendered,
    cameras_around,
    displace,
    draw_contours,
    drive,
    render,
)
from evidence.common.recordings import CMU, VARIABLE, Recordings, Results
from evidence.common.views import DAMAGES, POINTS, RATE_HZ, film
from motionary.body import Body, Pose, load_body
from motionary.io import read
from motionary.multiview import (
    RegionSettings,
    find_contours,
    fit_regions,
    follow_regions,
    see,
    triangulate,
)
from motionary.multiview.tracking import in_sequence_of, track_points

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "A body followed by regions of colour"
SPLIT = "settings were chosen on the first frames of walks of CMU 02 and 35; the table's are others"
SEED = 0
SYNTHETIC = True
SEEDS = 5
MOTIONS = {
    "walk (86)": "cmu/86_01.amc",
    "walk (38)": "cmu_everyday/38_01.amc",
    "walk (32)": "cmu_everyday/32_01.amc",
}
DATA = (
    (
        f"three walks of {CMU}, driving a body in front of walls, rendered",
        (len(MOTIONS), round(len(MOTIONS) / 60, 2)),
    ),
)
SECONDS, IMAGES_HZ = 1.0, 30.0
START_DEG, START_M, NOISE = 8.0, 0.04, 0.03
_ARMS = tuple(k for k, name in enumerate(POINTS) if name[1:] in ("Elbow", "Wrist"))
#: Joints of the body at keypoints, from its surface where it has none.
_OF_BODY = {
    "Shoulder": "upperarm", "Elbow": "forearm", "Wrist": "hand", "Hip": "thigh", "Knee": "shank",
    "Ankle": "foot", "BigToe": "toes",
}  # fmt: skip

Floats = NDArray[np.float64]


class Case(NamedTuple):
    """What is rendered and how it is followed."""

    motion: str = "walk (86)"
    n_cameras: int = 4
    noise: float = NOISE
    build: str = "man"
    far: float = 1.0


CASES = {
    **{f"{name}, four cameras": Case(name) for name in MOTIONS},
    "walk (86), two cameras": Case(n_cameras=2),
    "walk (86), noise of 15 %": Case(noise=0.15),
    "walk (86), followed with the mesh of a woman": Case(build="woman"),
    "walk (86), started twice as far away": Case(far=2.0),
}
_BUILDS = {"man": {"gender": 1.0}, "woman": {"gender": -1.0}}


def measure(_: Recordings) -> Results:
    """Both tables."""
    folder = Path(os.environ[VARIABLE])
    return {
        "followed": {name: _follow(folder, case) for name, case in CASES.items()},
        "keypoints": {name: _keypoints(folder, name) for name in MOTIONS},
    }


@lru_cache(maxsize=4)
def _scene(folder: Path, motion: str, n_cameras: int, noise: float) -> Rendered:
    body = load_body().shaped(_BUILDS["man"])
    pose = drive(body, read(folder / MOTIONS[motion]), seconds=SECONDS, rate_hz=IMAGES_HZ)
    return render(body, pose, cameras_around(n_cameras), noise=noise, seed=SEED)


def keypoints_of(body: Body, pose: Pose) -> Floats:
    """Keypoints of a body in the sequence of `POINTS`; the nose is what juts out of the head."""
    at = {}
    for side in "LR":
        for name, joint in _OF_BODY.items():
            at[f"{side}{name}"] = pose.joints[:, body.index(f"{side.lower()}{joint}")]
    head = body.index("head")
    height, depth = body.vertices[:, 1], body.vertices[:, 2]
    nose = int(np.where(height > body.joints[head, 1] + 0.03, depth, -1).argmax())
    for name, place in (("Head", body.vertices[body.ends[0]]), ("Nose", body.vertices[nose])):
        turned = pose.rotations[:, head] @ (place - body.joints[head])
        at[name] = pose.joints[:, head] + turned
    at["Neck"] = pose.joints[:, head]
    at["Hip"] = (at["LHip"] + at["RHip"]) / 2
    points: Floats = np.stack([at[name] for name in POINTS], axis=1)
    return points


def _missed(scene: Rendered, body: Body, pose: Pose) -> Floats:
    """Distances of keypoints (frames, points) from the truth, mm."""
    truth = keypoints_of(scene.body, scene.pose)[: len(pose.joints)]
    missed: Floats = 1000 * np.linalg.norm(keypoints_of(body, pose) - truth, axis=-1)
    return missed


def _follow(folder: Path, case: Case) -> Results:
    scene = _scene(folder, case.motion, case.n_cameras, case.noise)
    body = load_body().shaped(_BUILDS[case.build])
    first = Pose(scene.pose.rotations[:1], scene.pose.joints[:1])
    starts = [
        displace(body, first, angle_deg=START_DEG * case.far, step_m=START_M * case.far, seed=seed)
        for seed in range(SEEDS)
    ]
    found = [fit_regions(body, one, scene.moment(0), scene.cameras) for one in starts]
    began = time.process_time()
    moments = (scene.moment(number) for number in range(len(scene.images)))
    followed = follow_regions(
        body, found[0], moments, scene.cameras, settings=replace(RegionSettings(), most_steps=6)
    )
    seconds = time.process_time() - began
    missed = _missed(scene, body, followed)
    return {
        "start_mm": np.mean([_missed(scene, body, one).mean() for one in starts]),
        "found_mm": np.mean([_missed(scene, body, one).mean() for one in found]),
        "found_worst_mm": max(_missed(scene, body, one).mean() for one in found),
        "mean_mm": missed.mean(),
        "median_mm": np.median(missed),
        "arms_mm": missed[:, _ARMS].mean(),
        "rest_mm": np.delete(missed, _ARMS, axis=1).mean(),
        "last_mm": missed[-1].mean(),
        "worst_frame_mm": missed.mean(axis=1).max(),
        "seconds": seconds / len(scene.images),
    }


def _keypoints(folder: Path, motion: str) -> Results:
    """The same body by keypoints, as on the page of synthetic views."""
    body = load_body().shaped(_BUILDS["man"])
    pose = drive(body, read(folder / MOTIONS[motion]), seconds=SECONDS, rate_hz=RATE_HZ)
    truth = keypoints_of(body, pose)
    result: Results = {}
    for damage in ("clean", "mild", "hard"):
        plain, tracked = [], []
        for seed in range(SEEDS):
            made = film(truth, DAMAGES[damage], seed=100 + seed)
            sight = see(made.views, made.cameras)
            found = track_points(sight, rate_hz=RATE_HZ)
            points = in_sequence_of(made.views.names, found.chain.points, found.points)
            tracked.append(np.linalg.norm(points - truth, axis=-1).mean())
            plain.append(np.nanmean(np.linalg.norm(triangulate(sight).points - truth, axis=-1)))
        result[damage] = {
            "triangulated_mm": 1000 * np.mean(plain), "tracked_mm": 1000 * np.mean(tracked)
        }  # fmt: skip
    return result


def draw_recordings(_: Recordings, results: Results) -> "dict[str, Figure]":
    """Contours before and after, and where colours want them."""
    scene = _scene(Path(os.environ[VARIABLE]), "walk (86)", 4, NOISE)
    first = Pose(scene.pose.rotations[:1], scene.pose.joints[:1])
    start = displace(scene.body, first, angle_deg=START_DEG, step_m=START_M, seed=0)
    images = scene.moment(0)
    found = fit_regions(scene.body, start, images, scene.cameras)
    contours = [find_contours(scene.body, pose, images, scene.cameras) for pose in (start, found)]
    return {"regions": draw_contours(images, contours)}
