"""Do other readers put the joints where ours does, and what can they not read?

Every BVH at hand by pybvh (joints; world positions in file units, compared in metres) and
every C3D by ezc3d. Tolerance 1e-4 m.

    MOTIONARY_DATA=... python evidence/other_readers.py

prints a line per kind of file and one per reason why some cannot be compared, and writes
`other_readers.json` beside this file.
"""

import json
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
import pybvh

from motionary.io import find_recordings, read
from motionary.io.motion.axes import turn_up
from motionary.motion import Motion

TOLERANCE_M = 1e-4


def main() -> None:
    data = Path(os.environ["MOTIONARY_DATA"])
    kinds: dict[str, Callable[[Path, Motion], float]] = {
        ".bvh": difference_from_pybvh,
        ".c3d": difference_from_ezc3d,
    }
    result = {suffix: compare(data, suffix, way) for suffix, way in kinds.items()}
    Path(__file__).with_suffix(".json").write_text(json.dumps(result, indent=1) + "\n", "utf-8")


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
            words = str(error).replace(str(path), "the file").splitlines()[0]
            unread[name] = f"{type(error).__name__}: {words[:160]}"
    apart = {name: d for name, d in differences.items() if d > TOLERANCE_M}
    largest = max((d for name, d in differences.items() if name not in apart), default=0.0)
    print(
        f"{suffix}: {len(differences) - len(apart)} files agree (largest difference "
        f"{largest:.1e} m), {len(apart)} do not, {len(unread)} are not read by the other"
    )
    for why in sorted(set(unread.values())):
        names = [name for name, reason in unread.items() if reason == why]
        print(f"  {len(names)} files such as {names[0]}: {why}")
    for name, d in apart.items():
        print(f"  {name}: {d:.3g} m apart")
    return {"agree": len(differences) - len(apart), "largest_m": largest, "apart_m": apart,
            "unread": unread}  # fmt: skip


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


if __name__ == "__main__":
    main()
