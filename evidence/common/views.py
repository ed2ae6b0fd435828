"""Keypoints as cameras around a recorded motion would have given them: synthetic, truth exact."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.io.cameras import CalibratedCamera
from motionary.io.keypoints import Views
from motionary.motion import GENERIC_JOINTS, Motion, resample
from motionary.multiview import LIMBS, project
from motionary.multiview.exchange import Exchange, find_pairs

Floats = NDArray[np.float64]

#: Keypoints and the joints that they are put in.
POINTS = {
    "Hip": "root", "Neck": "neck", "Head": "headtop", "Nose": "head",
    **{
        f"{side}{name}": f"{side.lower()}{joint}"
        for side in "LR"
        for name, joint in (
            ("Shoulder", "shoulder"), ("Elbow", "elbow"), ("Wrist", "wrist"), ("Hip", "hip"),
            ("Knee", "knee"), ("Ankle", "ankle"), ("BigToe", "toes"),
        )
    },
}  # fmt: skip
RATE_HZ = 60.0
FOCAL, SIZE, RADIUS_M = 1200.0, (1920.0, 1080.0), 6.0


@dataclass(frozen=True)
class Damage:
    """What detectors get wrong: noise, bursts of lost points, exchanged sides, outliers."""

    noise_px: float = 4.0
    dropped: float = 0.0
    legs: float = 0.0
    arms: float = 0.0
    outliers: float = 0.0


DAMAGES = {
    "clean": Damage(),
    "mild": Damage(4.0, 0.1, 0.1, 0.05, 0.02),
    "hard": Damage(6.0, 0.3, 0.3, 0.2, 0.03),
    "extreme": Damage(8.0, 0.45, 0.4, 0.3, 0.05),
}
_OUTLIER_PX, _BURST = 80.0, 10.0


class Synthetic(NamedTuple):
    """Views of a motion, and the truth: points (frames, points, 3), exchanged sides by limb."""

    views: Views
    cameras: tuple[CalibratedCamera, ...]
    truth: Floats
    exchanged: dict[str, NDArray[np.bool_]]


def true_points(motion: Motion, first_s: float = 0.0, seconds: float = 5.0) -> Floats:
    """Keypoints of a motion at 60 Hz, its middle above the origin, y up."""
    whole = resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=RATE_HZ)
    part = whole[round(first_s * RATE_HZ) :][: round(seconds * RATE_HZ)]
    points = part[:, [GENERIC_JOINTS.index(joint) for joint in POINTS.values()]]
    # Detectors put the middle of the hips between them, not where Acclaim has its root.
    hips = [list(POINTS).index(name) for name in ("LHip", "RHip")]
    points[:, 0] = points[:, hips].mean(axis=1)
    middle = np.median(points[:, 0], axis=0)
    return np.asarray(points - [middle[0], 0.0, middle[2]])


def ring(n_cameras: int) -> tuple[CalibratedCamera, ...]:
    """Cameras around the origin, alternately higher and lower."""
    cameras = []
    spread = np.pi / 2 if n_cameras == 2 else 2 * np.pi / n_cameras
    for k in range(n_cameras):
        angle = 0.4 + spread * k
        place = np.array([RADIUS_M * np.cos(angle), 1.6 + 0.5 * (k % 2), RADIUS_M * np.sin(angle)])
        forward = np.array([0.0, 0.9, 0.0]) - place
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 1.0, 0.0])
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        matrix = np.array([[FOCAL, 0, SIZE[0] / 2], [0, FOCAL, SIZE[1] / 2], [0, 0, 1.0]])
        cameras.append(
            CalibratedCamera(f"cam{k + 1}", matrix, rotation, -rotation @ place, np.zeros(5), SIZE)
        )
    return tuple(cameras)


def bursts(rng: np.random.Generator, n_frames: int, fraction: float) -> NDArray[np.bool_]:
    """About so large a part of the frames, in bursts."""
    mask = np.zeros(n_frames, dtype=bool)
    while mask.mean() < fraction:
        first = int(rng.integers(-5, n_frames))
        mask[max(0, first) : first + 1 + int(rng.poisson(_BURST))] = True
    return mask


def plant_exchanges(
    views: Views, rng: np.random.Generator, fractions: dict[str, tuple[float, float]]
) -> tuple[Views, dict[str, NDArray[np.bool_]]]:
    """Views with sides of limbs exchanged in bursts, each camera for itself."""
    sources = np.broadcast_to(np.arange(len(views.names)), views.scores.shape).copy()
    planted = {}
    for limb, (low, high) in fractions.items():
        mask = np.stack(
            [bursts(rng, views.n_frames, rng.uniform(low, high)) for _ in views.cameras]
        )
        for left, right in find_pairs(views.names, LIMBS[limb]):
            sources[..., left][mask], sources[..., right][mask] = right, left
        planted[limb] = mask
    pixels = np.take_along_axis(views.pixels, sources[..., None], axis=2)
    scores = np.take_along_axis(views.scores, sources, axis=2)
    return Views(views.cameras, views.names, pixels, scores, views.layout), planted


def film(
    truth: Floats, damage: Damage, *, seed: int, n_cameras: int = 4,
    unseen: tuple[tuple[str, ...], slice] | None = None,
) -> Synthetic:  # fmt: skip
    """What cameras see of points.

    `unseen` are points that no camera sees, and when.
    """
    rng = np.random.default_rng(seed)
    cameras = ring(n_cameras)
    pixels = np.stack([project(camera, truth) for camera in cameras])
    pixels += rng.normal(0, damage.noise_px, pixels.shape)
    scores = rng.uniform(0.5, 1.0, pixels.shape[:3])
    wild = rng.uniform(size=scores.shape) < damage.outliers
    pixels[wild] += rng.normal(0, _OUTLIER_PX, (int(wild.sum()), 2))
    for camera in range(n_cameras):
        for point in range(truth.shape[1]):
            lost = bursts(rng, len(truth), damage.dropped) if damage.dropped else slice(0, 0)
            scores[camera, lost, point] = 0.0
    names = tuple(POINTS)
    if unseen is not None:
        own = [names.index(name) for name in unseen[0]]
        scores[:, unseen[1], own] = 0.0
    outside = ((pixels < 0) | (pixels > SIZE)).any(axis=-1)
    scores[outside] = 0.0
    pixels[scores == 0] = np.nan
    views = Views(tuple(c.name for c in cameras), names, pixels, scores)
    fractions = {"legs": (damage.legs,) * 2, "arms": (damage.arms,) * 2}
    views, planted = plant_exchanges(views, rng, fractions)
    return Synthetic(views, cameras, truth, planted)


def far_mm(points: Floats, others: Floats) -> float:
    """Mean distance between points that both have, millimetres."""
    return float(1000 * np.nanmean(np.linalg.norm(points - others, axis=-1)))


def score_exchanges(
    found: Sequence[Exchange], planted: Mapping[str, NDArray[np.bool_]]
) -> dict[str, float | int | None]:
    """Fractions of planted exchanges found, and of others that were exchanged."""
    hits = wrong = total = rest = unsure = 0
    for one in found:
        truth = planted.get(one.limb, np.zeros_like(one.exchanged))
        seen = np.isfinite(one.margin)
        hits += int((one.exchanged & truth & seen).sum())
        wrong += int((one.exchanged & ~truth & seen).sum())
        unsure += int(((one.exchanged != truth) & one.unsure & seen).sum())
        total, rest = total + int((truth & seen).sum()), rest + int((~truth & seen).sum())
    return {
        "planted": total, "found": hits / total if total else None, "false": wrong / rest,
        "wrong_but_unsure": unsure,
    }  # fmt: skip
