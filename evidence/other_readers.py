"""Joints of other readers beside ours, and files that they cannot read.

Every BVH at hand by pybvh (joints; world positions in file units, compared in metres) and
every C3D by ezc3d. Tolerance 1e-4 m.
"""

import itertools
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from evidence.common.recordings import Recordings, Results
from motionary.io import find_recordings, read
from motionary.motion import Motion

TITLE = "Beside other readers"
SPLIT = "nothing is learned or chosen"
SEED = 0
DATA = (
    # Conversions of a recording are counted on the page only.
    "bandai",
    "cmu",
    ("{clips}", "hdm05_takes"),
)

#: Folders whose files are read.
FOLDERS = ("bandai", "cmu", "hdm05_takes", "sensors")
TOLERANCE_M = 1e-4


def measure(recordings: Recordings) -> Results:
    """Both kinds of files."""
    kinds: dict[str, Callable[[Path, Motion], float]] = {
        "BVH by pybvh": difference_from_pybvh,
        "C3D by ezc3d": difference_from_ezc3d,
    }
    return {
        kind: compare(recordings.folder, f".{kind[:3].lower()}", way) for kind, way in kinds.items()
    }


def compare(data: Path, suffix: str, difference: Callable[[Path, Motion], float]) -> dict[str, Any]:
    """Largest difference in metres per file, or why there is none."""
    differences: dict[str, float] = {}
    unread: dict[str, str] = {}
    found = (find_recordings(data / folder, suffixes={suffix}) for folder in FOLDERS)
    for path in itertools.chain.from_iterable(found):
        name = path.relative_to(data).as_posix()
        motion = read(path)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                differences[name] = difference(path, motion)
        except Exception as error:
            message = str(error).replace(str(path), "the file").splitlines()[0]
            unread[name] = f"{type(error).__name__}: {message[:160]}"
    apart = {name: d for name, d in differences.items() if d > TOLERANCE_M}
    largest = max((d for name, d in differences.items() if name not in apart), default=0.0)
    reasons = Counter(unread.values())
    return {
        "files": len(differences) + len(unread),
        "agree": len(differences) - len(apart),
        "largest_um": 1e6 * largest,
        "apart_m": apart,
        "unread": [
            {"reason": why, "files": sorted(name for name in unread if unread[name] == why)}
            for why, _ in reasons.most_common()
        ],
    }


def difference_from_pybvh(path: Path, motion: Motion) -> float:
    import pybvh

    other = pybvh.read_bvh_file(str(path))
    names = [name for name in other.joint_names if name in motion.names]
    places = other.joint_positions()[:, [other.joint_names.index(name) for name in names]]
    ours = motion.positions[:, [motion.names.index(name) for name in names]]
    if len(places) != len(ours):
        raise ValueError(f"{len(places)} frames instead of {len(ours)}")
    # Its positions are in file units; the unit is the one that brings both sizes together.
    metres = float(np.linalg.norm(ours - ours[:, :1]) / np.linalg.norm(places - places[:, :1]))
    return float(np.abs(places * metres - ours).max())


def difference_from_ezc3d(path: Path, motion: Motion) -> float:
    import ezc3d

    other = ezc3d.c3d(str(path))
    labels = other["parameters"]["POINT"]["LABELS"]["value"]
    places = other["data"]["points"][:3, [labels.index(name) for name in motion.names]]
    ours = motion.positions
    # Frames, joints, and y up instead of z.
    theirs = np.moveaxis(places, 0, -1).swapaxes(0, 1)[..., [0, 2, 1]] * (0.001, 0.001, -0.001)
    return float(np.nanmax(np.abs(theirs - ours)))
