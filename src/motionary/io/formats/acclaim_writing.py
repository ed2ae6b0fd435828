"""How is a motion written as an Acclaim motion (AMC), for a skeleton that is there?

An AMC file means nothing without its skeleton (ASF), and only holds the degrees of freedom
that the skeleton has. So the motion must be one of that skeleton, as cuts and corrections
of Acclaim motions are. The file holds no rate; 120 Hz is what its readers assume.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.formats.acclaim import find_asf
from motionary.io.formats.asf import AcclaimSkeleton, Bone, read_asf
from motionary.io.text import write_text
from motionary.motion import Motion
from motionary.rotations import (
    conjugate_quaternions,
    multiply_quaternions,
    quaternions_to_euler,
)

Floats = NDArray[np.float64]

# Bones agree with the skeleton up to this length, turns up to this angle.
_SAME_M = 1e-5
_SAME_RADIANS = 1e-3
_TOGETHER = 1024
_NUMBER = "%.7g"


def write_amc(motion: Motion, path: str | Path, *, asf: str | Path | None = None) -> None:
    """Write the motion of an Acclaim skeleton.

    Parameters
    ----------
    motion : with the skeleton of `asf` and rotations
    path : the file; packed where its name ends in .gz
    asf : the skeleton; by default it is looked for beside `path` by name, see `find_asf`

    Raises
    ------
    UnreadableFile
        If there is no skeleton.
    InvalidInput
        If the motion is not one of this skeleton.
    UnwritableFile
        If the file cannot be written.
    """
    skeleton = read_asf(asf if asf is not None else find_asf(Path(path)))
    rotations = _check(motion, skeleton)
    columns = {
        bone.name: _values(skeleton, bone, rotations[:, joint], motion)
        for joint, (bone, _) in enumerate(skeleton.in_order())
        if bone.dof
    }
    write_text(path, _format(motion, columns, skeleton))


def _check(motion: Motion, skeleton: AcclaimSkeleton) -> Floats:
    """The rotations of a motion that is one of this skeleton."""
    name = motion.source or "motion"
    if motion.skeleton is None or motion.rotations is None:
        raise InvalidInput(
            f"{name}: AMC holds the turns of an Acclaim skeleton, and this motion has places of "
            "points only; write .trc, .c3d or .npz"
        )
    expected = skeleton.to_skeleton()
    if not motion.skeleton.ends or motion.names != expected.names:
        raise InvalidInput(
            f"{name}: has not the bones of {skeleton.name}; name its own skeleton with --asf "
            "(asf=...), or write .bvh"
        )
    if np.abs(motion.skeleton.offsets - expected.offsets).max() > _SAME_M:
        raise InvalidInput(
            f"{name}: its bones are not as long as those of {skeleton.name}; name its own "
            "skeleton with --asf (asf=...)"
        )
    return motion.rotations


def _values(skeleton: AcclaimSkeleton, bone: Bone, turns: Floats, motion: Motion) -> Floats:
    """Values of a bone's degrees of freedom, (frames, dof), in their sequence."""
    axis = conjugate_quaternions(skeleton.axis_quaternion(bone))
    is_root = bone is skeleton.root
    inner = multiply_quaternions(axis, turns)
    if not is_root:
        inner = multiply_quaternions(inner, skeleton.axis_quaternion(bone))
    order = bone.order[::-1]
    missing = [i for i, letter in enumerate(order) if f"r{letter.lower()}" not in bone.dof]
    angles = _angles(inner, order, missing)
    if missing and np.abs(angles[:, missing]).max() > _SAME_RADIANS:
        raise InvalidInput(
            f"{motion.source or 'motion'}: {bone.name} turns about an axis that it has not in "
            f"{skeleton.name}"
        )
    values = {
        f"r{letter.lower()}": angles[:, i] / skeleton.radians for i, letter in enumerate(order)
    }
    if is_root:
        # Which way positions are offset at rest is in the skeleton.
        moved = motion.positions[:, 0] - np.multiply(skeleton.position, skeleton.metres)
        values |= {f"t{x}": moved[:, i] / skeleton.metres for i, x in enumerate("xyz")}
    return np.stack([values[dof] for dof in bone.dof], axis=1)


def _angles(quaternions: Floats, order: str, missing: list[int]) -> Floats:
    """Angles, of the two triples that mean the same the one that needs no missing axis."""
    angles = quaternions_to_euler(quaternions, order)
    if not missing:
        return angles
    other = np.stack((angles[:, 0] + np.pi, np.pi - angles[:, 1], angles[:, 2] + np.pi), axis=1)
    other = (other + np.pi) % (2 * np.pi) - np.pi
    better = np.abs(other[:, missing]).max(axis=1) < np.abs(angles[:, missing]).max(axis=1)
    return np.where(better[:, None], other, angles)


def _format(motion: Motion, columns: dict[str, Floats], skeleton: AcclaimSkeleton) -> Iterator[str]:
    unit = ":DEGREES" if skeleton.degrees else ":RADIANS"
    yield f"#!OML:ASF {skeleton.name}\n:FULLY-SPECIFIED\n{unit}\n"
    lines = ["%d\n"]
    lines += [f"{name} {' '.join([_NUMBER] * c.shape[1])}\n" for name, c in columns.items()]
    frame = "".join(lines)
    first = motion.first_frame
    for start in range(0, motion.n_frames, _TOGETHER):
        stop = min(start + _TOGETHER, motion.n_frames)
        numbers = np.arange(first + start, first + stop, dtype=np.float64)[:, None]
        block = np.concatenate((numbers, *(c[start:stop] for c in columns.values())), axis=1)
        yield "".join(frame % tuple(row) for row in block.tolist())
