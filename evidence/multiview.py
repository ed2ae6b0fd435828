"""Views of several cameras: exchanged sides, tracking, feet, speed (thesis, chapter 6)."""

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt

from evidence.common.recordings import CMU, Recordings, Results
from evidence.common.views import (
    DAMAGES,
    POINTS,
    RATE_HZ,
    Damage,
    Synthetic,
    film,
    score_exchanges,
    true_points,
)
from motionary.io import read
from motionary.multiview import see, triangulate
from motionary.multiview.cameras import bridge
from motionary.multiview.exchange import find_exchanges
from motionary.multiview.tracking import (
    TrackedPoints,
    floor_of,
    in_sequence_of,
    measure_steadiness,
    stances,
    track_points,
)

TITLE = "Tracking in views of several cameras"
SPLIT = (
    "settings were chosen on CMU 02, 05 and 35, the costs of exchanges in a grid, two seeds; the "
    "table's people are others, but earlier runs of theirs were seen before these were changed"
)
SEED = 0
#: What is filmed, and from which second.
MOTIONS = {
    "walk (86)": ("cmu/86_01.amc", 0.0),
    "kicks (86)": ("cmu/86_01.amc", 9.6),
    "jumps (01)": ("cmu/01_01.amc", 1.0),
    "walk (38)": ("cmu_everyday/38_01.amc", 0.0),
    "walk (32)": ("cmu_everyday/32_01.amc", 0.0),
}
DATA = (
    (
        f"five pieces of {CMU}, filmed by synthetic cameras",
        lambda recordings: (len({path for path, _ in MOTIONS.values()}), 0.25),
    ),
)
SECONDS, SEEDS = 3.0, 5
TWO_CAMERAS = Damage(6.0, 0.2)
UNSEEN = (("LKnee", "LAnkle", "LBigToe"), slice(70, 110))
_LEGS = tuple(k for k, name in enumerate(POINTS) if name[1:] in ("Knee", "Ankle", "BigToe"))

Floats = NDArray[np.float64]


def measure(recordings: Recordings) -> Results:
    """All tables of the page."""
    truth = {
        name: true_points(read(recordings.folder / path), first_s, SECONDS)
        for name, (path, first_s) in MOTIONS.items()
    }
    walk, three = truth["walk (86)"], replace(DAMAGES["hard"], dropped=0.2)
    return {
        "synthetic": {
            name: {
                **{damage: _case(points, DAMAGES[damage]) for damage in ("clean", "mild", "hard")},
                "two cameras": _case(points, TWO_CAMERAS, n_cameras=2),
            }
            for name, points in truth.items()
        },
        "few": {
            "three cameras, 20 % lost": _case(walk, three, n_cameras=3),
            "the same, and no camera sees the left leg for 2/3 s": _case(
                walk, three, n_cameras=3, unseen=UNSEEN
            ),
            "four cameras, extreme": _case(walk, DAMAGES["extreme"]),
        },
        "speed": _speed(walk),
    }


# ---- synthetic views


def _case(
    truth: Floats,
    damage: Damage,
    *,
    n_cameras: int = 4,
    unseen: tuple[tuple[str, ...], slice] | None = None,
) -> Results:
    """Means over the seeds of one recording and damage."""
    rows = [
        _one(film(truth, damage, seed=100 + seed, n_cameras=n_cameras, unseen=unseen))
        for seed in range(SEEDS)
    ]
    return {
        key: np.mean([row[key] for row in rows], axis=0) if rows[0][key] is not None else None
        for key in rows[0]
    }


def _one(made: Synthetic) -> Results:
    sight = see(made.views, made.cameras)
    plain = triangulate(sight).points
    b, a = butter(2, 6 / (RATE_HZ / 2))
    filtered = filtfilt(b, a, bridge(plain), axis=0)
    found = track_points(sight, rate_hz=RATE_HZ)
    names = made.views.names
    tracked = in_sequence_of(names, found.chain.points, found.points)
    scores = score_exchanges(found.exchanges, made.exchanged)
    far = 1000 * np.linalg.norm(tracked - made.truth, axis=-1)
    return {
        "triangulated_mm": 1000 * np.linalg.norm(filtered - made.truth, axis=-1).mean(),
        "exchanged_mm": 1000
        * np.linalg.norm(bridge(found.triangulated.points) - made.truth, axis=-1).mean(),
        "tracked_mm": far.mean(),
        "worst_frame_mm": far.mean(axis=1).max(),
        "legs_mm": far[:, _LEGS].mean(),
        "passes_mm": _passes(found, made),
        "found": scores["found"],
        "false": scores["false"],
        **_feet(made, filtered, tracked),
    }


def _passes(found: TrackedPoints, made: Synthetic) -> list[float]:
    """Mean error after each pass of the chain, before points are freed from it."""
    names = made.views.names
    return [
        1000
        * float(
            np.linalg.norm(
                in_sequence_of(names, found.chain.points, points) - made.truth, axis=-1
            ).mean()
        )
        for points in found.by_pass
    ]


def _feet(made: Synthetic, plain: Floats, tracked: Floats) -> Results:
    """Sliding where the truth stands, cm/s, and frames below the floor."""
    names = made.views.names
    standing = stances(names, made.truth, RATE_HZ)
    floor = floor_of(names, made.truth)
    result: Results = {}
    for key, points in (("truth", made.truth), ("plain", plain), ("tracked", tracked)):
        one = measure_steadiness(names, points, RATE_HZ, standing=standing, floor=floor)
        result[f"sliding_{key}"] = 100 * one.sliding
        result[f"below_{key}"] = one.below
    return result


def _speed(truth: Floats) -> Results:
    """Frames a second of processor time, all passes, four cameras."""
    made = film(truth, DAMAGES["hard"], seed=7)
    sight = see(made.views, made.cameras)
    began = time.process_time()
    find_exchanges(sight)
    between = time.process_time()
    track_points(sight, rate_hz=RATE_HZ)
    return {
        "exchange": len(truth) / (between - began),
        "all": len(truth) / (time.process_time() - between),
    }
