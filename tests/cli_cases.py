"""Small folders of synthetic recordings, and the command run on them in this process."""

import re
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from motionary.cli import main
from motionary.samples import synthetic_motion, synthetic_stream

RATE_HZ = 30.0
_REFERENCE = Path(__file__).parents[1] / "docs" / "reference.md"
CLASSES = ("squat", "kick_left", "wave_right")
EXAMPLES = 3
STREAM = ("squat", "bow", "kick_left")


class Ran(NamedTuple):
    """How a command ended."""

    code: int
    out: str
    err: str


def run(capsys, monkeypatch, *arguments):
    """The command with these arguments."""
    monkeypatch.setattr(sys, "argv", ["motionary", *map(str, arguments)])
    capsys.readouterr()
    try:
        main()
        code = 0
    except SystemExit as end:
        code = end.code
    return Ran(code, *capsys.readouterr())


def write_bvh(motion, path: Path) -> None:
    """The motion's skeleton and rotations as a BVH file, in centimetres."""
    skeleton = motion.skeleton
    children = {
        i: np.flatnonzero(skeleton.parents == i).tolist() for i in range(-1, len(skeleton.names))
    }
    order: list[int] = []
    lines = ["HIERARCHY"]

    def joint(i, depth):
        order.append(i)
        tab = "  " * depth
        offset = " ".join(f"{100 * x:.5f}" for x in skeleton.offsets[i]) if depth else "0 0 0"
        position = "Xposition Yposition Zposition " if depth == 0 else ""
        lines.append(f"{tab}{'JOINT' if depth else 'ROOT'} {skeleton.names[i]}")
        lines.append(f"{tab}{{")
        lines.append(f"{tab}  OFFSET {offset}")
        n = 6 if depth == 0 else 3
        lines.append(f"{tab}  CHANNELS {n} {position}Zrotation Xrotation Yrotation")
        for child in children[i]:
            joint(child, depth + 1)
        lines.append(f"{tab}}}")

    joint(children[-1][0], 0)
    angles = Rotation.from_quat(motion.rotations[..., [1, 2, 3, 0]].reshape(-1, 4))
    angles = angles.as_euler("ZXY", degrees=True).reshape(motion.n_frames, -1, 3)[:, order]
    root = 100 * motion.positions[:, order[0]]
    lines += ["MOTION", f"Frames: {motion.n_frames}", f"Frame Time: {1 / motion.rate_hz:.7f}"]
    for place, row in zip(root, angles, strict=True):
        lines.append(" ".join(f"{x:.4f}" for x in (*place, *row.ravel())))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_examples(folder: Path) -> None:
    """A folder a class, three examples each."""
    for name in CLASSES:
        for seed in range(EXAMPLES):
            motion = synthetic_motion(name, seed=seed, rate_hz=RATE_HZ)
            write_bvh(motion, folder / name / f"{name} {seed}.bvh")


def write_stream(path: Path, *, seed: int = 11):
    """A recording of several motions; when each of them happens comes back."""
    motion, segments = synthetic_stream(STREAM, seed=seed, rate_hz=RATE_HZ)
    write_bvh(motion, path)
    return segments


def documented_keys(beginning):
    """Keys of JSON in the reference, in the rest of the paragraph that has these words."""
    said = _REFERENCE.read_text("utf-8").partition(beginning)[2].partition("\n\n")[0]
    return re.findall(r"`(\w+)`", said)


def documented_example(beginning):
    """Keys of the first line of JSON in the reference after these words."""
    said = _REFERENCE.read_text("utf-8").partition(beginning)[2]
    line = next(line for line in said.splitlines() if line.startswith("{"))
    return re.findall(r'"(\w+)": ', line)
