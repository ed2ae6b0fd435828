"""Where were joints, according to an array (frames, joints, 3) without a word about it?

HumanML3D (22 joints, 20 Hz), outputs of networks that lift poses to space, and whatever
people save from NumPy. Which joint is which is told, or guessed by their number and, where
several orders have that number, by whose bones keep their length; every guess is a note.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import NO_MOTION, InvalidInput, UnreadableFile
from motionary.io.formats.numpy_files import Array, read_npy
from motionary.io.formats.points import FARTHEST, Points, number_doubles, to_motion
from motionary.motion import GENERIC_JOINTS, JointMapping, Motion
from motionary.skeletons import SkeletonTable, find_mapping, known_mappings, named_mapping

Floats = NDArray[np.float64]

HUMANML3D_HZ = 20.0

# Ends of the bones that every order has.
_BONES = tuple(
    (side + a, side + b)
    for side in "lr"
    for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
)
_LOOKED_AT = 500


class Joints(NamedTuple):
    """Names of an array's joints, what they mean, and what was guessed."""

    names: list[str]
    mapping: JointMapping | None
    notes: tuple[str, ...]


def read_array(
    path: str | Path,
    *,
    rate_hz: float | None = None,
    skeleton: SkeletonTable | None = None,
    unit: float | str | None = None,
    up: str | None = None,
) -> Motion:
    """Read a .npy file of joint positions.

    Parameters
    ----------
    path : the file
    rate_hz : frames per second; a .npy file does not hold it, and 20 is assumed for the 22
        joints of HumanML3D only
    skeleton : a known skeleton, or one told, with a usual order of joints
    unit, up : as in `read`

    Raises
    ------
    UnreadableFile
        If the file is missing, damaged, or holds no such array.
    InvalidInput
        If the rate or the order of the joints is neither known nor told.
    """
    path = Path(path)
    positions = check_positions(read_npy(path), path.name)
    joints = name_joints(positions, path.name, skeleton=skeleton)
    rate, notes = rate_hz, joints.notes
    if rate is None and joints.mapping is not None and joints.mapping.name == "humanml3d":
        rate, notes = HUMANML3D_HZ, (*notes, f"rate assumed {HUMANML3D_HZ:g} Hz, as HumanML3D has")
    return array_to_motion(
        positions, joints._replace(notes=notes), path.name, rate_hz=rate, unit=unit, up=up
    )


def array_to_motion(
    positions: Floats,
    joints: Joints,
    source: str,
    *,
    rate_hz: float | None,
    unit: float | str | None,
    up: str | None,
) -> Motion:
    """The motion of an array; metres and y up are assumed where the body does not tell.

    Raises
    ------
    InvalidInput
        If there is no rate.
    """
    if rate_hz is None:
        raise InvalidInput(
            f"{source}: an array holds no frame rate; pass it with --rate (rate_hz=...)"
        )
    points = Points(
        names=joints.names,
        positions=positions,
        rate_hz=rate_hz,
        source=source,
        usual_unit="m",
        usual_up="y",
        notes=joints.notes,
        mapping=joints.mapping,
    )
    return to_motion(points, unit=unit, up=up)


def check_positions(array: Array, source: str) -> Floats:
    """The array as floats of its own, (frames, joints, 3); one person around it is taken off.

    Raises
    ------
    UnreadableFile
        If it has another shape or no numbers.
    """
    if array.ndim == 4 and array.shape[0] == 1:
        array = array[0]
    if array.ndim != 3 or array.shape[2] != 3 or array.dtype.kind not in "fiu":
        raise UnreadableFile(
            f"{source}: {NO_MOTION}; expected joint positions (frames, joints, 3), got an array of "
            f"shape {array.shape} and type {array.dtype}"
        )
    positions = array.astype(np.float64)
    positions[~np.isfinite(positions).all(axis=2)] = np.nan
    if (np.abs(positions) > FARTHEST).any():
        raise UnreadableFile(f"{source}: has impossibly large numbers")
    return positions


def name_joints(
    positions: Floats,
    source: str,
    *,
    skeleton: SkeletonTable | None,
    names: list[str] | None = None,
) -> Joints:
    """Which joint is which.

    Parameters
    ----------
    positions : array, shape (frames, joints, 3)
    source : name of the file
    skeleton : what the caller says
    names : what the file says

    Raises
    ------
    InvalidInput
        If names are of another number, or nothing tells and no known order has this number.
    """
    n_joints = positions.shape[1]
    if names is not None:
        if len(names) != n_joints:
            raise InvalidInput(f"{source}: has {len(names)} names for {n_joints} joints")
        unique = number_doubles(names)
        return Joints(unique, find_mapping(unique, None, positions, told=skeleton), ())
    if skeleton is not None:
        mapping = skeleton.resolve(())
        if len(mapping.order) != n_joints:
            raise InvalidInput(
                f"{source}: has {n_joints} joints; "
                + (f"{skeleton.name} has {len(mapping.order)}" if mapping.order else "")
                + ("" if mapping.order else f"those of {skeleton.name} have no usual order")
            )
        return Joints(list(mapping.order), mapping, ())
    return _guess_order(positions, source)


def _guess_order(positions: Floats, source: str) -> Joints:
    known = [named_mapping(name) for name in known_mappings()]
    fitting = [m for m in known if len(m.order) == positions.shape[1]]
    if not fitting:
        counts = ", ".join(f"{len(m.order)} ({m.name})" for m in known if m.order)
        raise InvalidInput(
            f"{source}: an array of {positions.shape[1]} joints without names; known orders have "
            f"{counts}; save names beside the positions in a .npz file"
        )
    some = positions[:: 1 + len(positions) // _LOOKED_AT]
    best = min(fitting, key=lambda mapping: _unsteadiness(some, mapping))
    told_by = "by their number" if len(fitting) == 1 else "by bones that keep their length"
    return Joints(list(best.order), best, (f"order of joints guessed: {best.name}, {told_by}",))


def _unsteadiness(positions: Floats, mapping: JointMapping) -> float:
    """How much bones change their length, and differ between the sides, under an order."""
    body = Motion(mapping.order, positions, 1.0, mapping).generic_positions()
    index = {joint: i for i, joint in enumerate(GENERIC_JOINTS)}
    ends = np.array([[index[a], index[b]] for a, b in _BONES])
    lengths = np.linalg.norm(body[:, ends[:, 0]] - body[:, ends[:, 1]], axis=2)
    lengths = lengths[~np.isnan(lengths).any(axis=1)]
    if not len(lengths):
        return np.inf
    means = lengths.mean(axis=0)
    half = len(_BONES) // 2
    sides = np.abs(means[:half] - means[half:]).sum()
    total = float(means.sum())
    return float(lengths.std(axis=0).sum() + sides) / total if total > 0 else np.inf
