"""Do other readers put the joints where ours does, and what can they not read?

Every BVH at hand by pybvh (joints; world positions in file units, compared in metres) and
every C3D by ezc3d. Tolerance 1e-4 m.
"""

import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ezc3d
import numpy as np
import pybvh

from evidence.common.pages import table
from evidence.common.recordings import BANDAI, CMU, HDM05, Recordings, data_entry
from evidence.common.running import Evidence, Results, main
from motionary.io import find_recordings, read
from motionary.io.normalise.axes import turn_up
from motionary.motion import Motion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    for path in find_recordings(data, suffixes={suffix}):
        name = path.relative_to(data).as_posix()
        motion = read(path)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                differences[name] = difference(path, motion)
        except Exception as error:
            packed = str(error).replace(str(path), "the file").splitlines()[0]
            unread[name] = f"{type(error).__name__}: {packed[:160]}"
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
    other = ezc3d.c3d(str(path))
    labels = other["parameters"]["POINT"]["LABELS"]["value"]
    places = other["data"]["points"][:3, [labels.index(name) for name in motion.names]]
    ours = motion.positions
    theirs = turn_up(np.moveaxis(places, 0, -1) / 1000, "z").swapaxes(0, 1)
    return float(np.nanmax(np.abs(theirs - ours)))


def write(results: Results) -> str:
    """Body of the page."""
    rows = [
        (kind, one["files"], one["agree"], f"{one['largest_um']:.3f}", len(one["apart_m"]),
         sum(len(entry["files"]) for entry in one["unread"]))
        for kind, one in results.items()
    ]  # fmt: skip
    head = (
        "files",
        "at hand",
        "agree",
        "largest difference (µm)",
        "apart",
        "not read by the other",
    )
    reasons = [
        (kind, len(entry["files"]), entry["files"][0], entry["reason"])
        for kind, one in results.items()
        for entry in one["unread"]
    ]
    return (
        "Joints where another reader puts them, and where ours does: *agree* within 1e-4 m. Of "
        "pybvh's positions, which are in units of the file, the unit is that which brings both "
        "to one size. Our reader reads all of these files; the record names those that the other "
        f"one does not.\n\n{table(head, rows)}\n## Why the other reader cannot\n\n"
        f"{table(('files', 'number', 'such as', 'what it says'), reasons)}"
    )


def draw(_: Results) -> "dict[str, Figure]":
    """No picture."""
    return {}


def describe_data(recordings: Recordings) -> list[dict[str, Any]]:
    """Entries of the record; conversions of a recording are counted on the page only."""
    folders = {"bandai": BANDAI, "cmu": CMU, "hdm05_takes": HDM05}
    return [
        data_entry(what, [w for name, w in recordings.others.items() if name.startswith(folder)])
        for folder, what in folders.items()
    ]


EVIDENCE = Evidence(
    name="other_readers",
    title="Beside other readers",
    split="nothing is learned or chosen",
    seed=0,
    describe_data=describe_data,
    measure=measure,
    write=write,
    draw=draw,
)

if __name__ == "__main__":
    main(EVIDENCE)
