"""Features of one trial through files of different formats and rigs.

Three trials, each in two files: CMU 01_01 (AMC, and its conversion to BVH), HDM_dg_06-03_03
(AMC, and the C3D of the markers that it was solved from), CMU 07_01 (AMC, and retargeted to
a Character Creator rig at 60 Hz). Agreement is the share of frames, at 30 Hz, in which a
feature has the same value, where both know it.

The cause of a disagreement is found by exchange: groups of joints of the second file are
put where the first file has them (on the second one's root, in its heading, scaled to its
legs), and the smallest set of groups whose exchange brings the feature to 97 % is the cause.
"more" means that four groups are not enough.
"""

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.recordings import Recordings, Results
from motionary.features import FULL_BODY, FeatureSequence, compute_features
from motionary.io import read
from motionary.motion import GENERIC_JOINTS, Motion, resample
from motionary.recording import Recording
from motionary.skeletons import named_mapping

TITLE = "The same trial through different files"
SPLIT = "nothing is learned or chosen"
SEED = 0

Floats = NDArray[np.float64]

ENOUGH = 0.97
COMMON_HZ = 120.0
SIZES = (1, 2, 3, 4)
GROUPS = {
    "trunk": ("belly", "chest", "neck", "lclavicle", "rclavicle"),
    "head": ("head", "headtop"),
    "shoulders": ("lshoulder", "rshoulder"),
    "elbows": ("lelbow", "relbow"),
    "hands": ("lwrist", "rwrist", "lfingers", "rfingers"),
    "pelvis": ("root", "lhip", "rhip"),
    "knees": ("lknee", "rknee"),
    "feet": ("lankle", "rankle", "ltoes", "rtoes"),
}

#: How the root moves through the room: it carries all joints.
PATH = "path"


class Pair(NamedTuple):
    """Two files of a trial, and frames at the start of each that the other lacks."""

    name: str
    first: str
    second: str
    first_skip: int = 0
    second_skip: int = 0
    asf: str | None = None


PAIRS = (
    Pair("01_01, AMC and BVH", "cmu/01_01.amc", "cmu/01_01.bvh", second_skip=1),
    Pair("06-03_03, AMC and C3D", "hdm05_takes/HDM_dg_06-03_03_120.amc",
         "hdm05_takes/HDM_dg_06-03_03_120.c3d", asf="hdm05/HDM_dg.asf"),
    # The retargeted clip begins with a T-pose, and then 3 frames later than the trial.
    Pair("07_01, AMC and Character Creator", "cmu/07_01.amc", "cmu/iclone_07_01.bvh", 3, 1),
)  # fmt: skip
DATA = (
    ("{clips} (and its C3D)", lambda r: [r.others[p.first] for p in PAIRS if "hdm05" in p.first]),
    ("{cmu} (and BVH)", lambda r: [r.others[p.first] for p in PAIRS if "cmu" in p.first]),
)


def measure(recordings: Recordings) -> Results:
    """Every pair of files."""
    return {pair.name: compare(pair, recordings.folder) for pair in PAIRS}


def compare(pair: Pair, data: Path) -> dict[str, Any]:
    """Agreement per feature, and the cause of each that is below 97 %."""
    asf = None if pair.asf is None else data / pair.asf
    first = read(data / pair.first, asf=asf)
    second = read(data / pair.second)
    first = first.cut(pair.first_skip, first.n_frames)
    second = second.cut(pair.second_skip, second.n_frames)
    one, two = (_at_common_rate(motion) for motion in (first, second))
    n = min(len(one), len(two))
    one, two = one[:n], two[:n]
    plain = agreement(one, two)
    aligned, steps = align(one, two)
    exchanged = {
        groups: agreement(one, exchange(two, aligned, steps, groups))
        for size in SIZES
        for groups in itertools.combinations((*GROUPS, PATH), size)
    }
    # Once both bodies lie on each other.
    away = np.linalg.norm(aligned - two, axis=2)
    below = [
        {
            "relation": FULL_BODY.names[i],
            "agreement": round(float(plain[i]), 3),
            "cause": cause(i, exchanged),
        }
        for i in np.flatnonzero(plain < ENOUGH).tolist()
    ]
    return {
        "frames": n // 4,
        "agreement": round(float(np.nanmean(plain)), 4),
        "relations": {
            name: round(float(a), 3) for name, a in zip(FULL_BODY.names, plain, strict=True)
        },
        "distance_cm": {
            group: round(100 * float(np.nanmedian(away[:, _joints(joints)])), 1)
            for group, joints in GROUPS.items()
        },
        "below": below,
    }


def _at_common_rate(motion: Motion) -> Floats:
    return resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=COMMON_HZ)


def agreement(one: Floats, two: Floats) -> Floats:
    """Fraction of frames in which each feature is the same; NaN where never known in both."""
    a, b = (_features(positions) for positions in (one, two))
    both = (a.known_features & b.known_features).astype(bool)
    same = (a.features == b.features) & both
    with np.errstate(invalid="ignore"):
        return np.asarray(same.sum(axis=0) / both.sum(axis=0))


def _features(positions: Floats) -> FeatureSequence:
    mapping = named_mapping("generic")
    return compute_features(
        Motion(GENERIC_JOINTS, positions, Recording(rate_hz=COMMON_HZ), mapping)
    )


def align(one: Floats, two: Floats) -> tuple[Floats, Floats]:
    """The first file's joints on the second one's root, in its heading and with its legs.

    And the steps (frames, 1, 3) from the second root's path to the first one's.
    """
    joint = {name: i for i, name in enumerate(GENERIC_JOINTS)}
    headings, legs = [], []
    for body in (one, two):
        across = body[:, joint["rhip"]] - body[:, joint["lhip"]]
        headings.append(np.arctan2(across[:, 2], across[:, 0]))
        bones = (("hip", "knee"), ("knee", "ankle"))
        ends = [(joint[side + a], joint[side + b]) for side in "lr" for a, b in bones]
        legs.append(
            sum(np.median(np.linalg.norm(body[:, a] - body[:, b], axis=1)) for a, b in ends)
        )
    turn = headings[1] - headings[0]
    # One turn for the whole trial: the files differ by the room, not by the motion.
    angle = float(np.arctan2(np.median(np.sin(turn)), np.median(np.cos(turn))))
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = np.moveaxis(one * (legs[1] / legs[0]), -1, 0)
    placed = np.stack((c * x - s * z, y, s * x + c * z), axis=-1)
    path = placed[:, :1] + (two[:, :1] - placed[:, :1]).mean(axis=0)
    return placed + two[:, :1] - placed[:, :1], path - two[:, :1]


def exchange(two: Floats, aligned: Floats, steps: Floats, groups: tuple[str, ...]) -> Floats:
    """The second file with some joints where the first one has them."""
    result = two + steps if PATH in groups else two.copy()
    for group in set(groups) - {PATH}:
        places = _joints(GROUPS[group])
        result[:, places] = aligned[:, places] + (steps if PATH in groups else 0.0)
    return result


def cause(feature: int, exchanged: dict[tuple[str, ...], Floats]) -> list[str]:
    """The smallest set of groups that explains a feature; of equal ones, the best."""
    for size in SIZES:
        sets = [groups for groups in exchanged if len(groups) == size]
        best = max(sets, key=lambda groups: exchanged[groups][feature])
        if exchanged[best][feature] >= ENOUGH:
            return list(best)
    return ["more"]


def _joints(names: Sequence[str]) -> list[int]:
    return [GENERIC_JOINTS.index(name) for name in names]
