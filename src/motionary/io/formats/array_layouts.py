"""Arrays of motions: layouts of data sets and of generators, and which joint is which.

Joint positions come as (frames, joints, 3), from generators as (joints, 3, frames), in batches
with one axis more in front. HumanML3D (Guo et al. 2022) writes 263 numbers a frame, of KIT's 21
joints 251: from them the positions are recovered. Motion-X (Lin et al. 2023) writes 322
parameters of a body.

Which joint is which is given, or guessed by their number and, where several orders have that
number, by whose bones keep their length; every guess is a note.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput, NotAMotion, UnreadableFile
from motionary.io.formats.content import (
    FARTHEST,
    POINT_UNITS,
    RATE_HINT,
    FileContent,
    choose_take,
    number_doubles,
)
from motionary.io.formats.npz import Array
from motionary.io.formats.smpl import MOTION_X, read_smpl_arrays
from motionary.io.normalise.units import FileMetadata
from motionary.io.options import ReadOptions
from motionary.motion import GENERIC_JOINTS, JointMapping, Motion
from motionary.recording import Recording
from motionary.rotations import Floats, rotate
from motionary.skeletons import SkeletonTable, known_mappings, named_mapping, named_table

#: Names under which programs keep names of joints, and the rate.
NAMES = ("names", "joint_names", "marker_names", "labels")
RATES = ("rate_hz", "fps", "mocap_framerate", "mocap_frame_rate", "frame_rate", "framerate")

_MOTION_X = 322
_MOTION_X_HZ = 30.0
_HUMANML3D_HZ = 20.0
_HUMANML3D = ("HumanML3D", _HUMANML3D_HZ, "humanml3d")
_KIT = ("KIT-ML", 12.5, "kit_ml")

# Numbers of a frame, by joints: turn, way and height of the root, places, turns, velocities of the
# joints, and whether heels and toes are on the floor.
_RECOVERED = {4 + 9 * (n - 1) + 3 * n + 4: n for n in (22, 21)}
# Bodies of fewer joints are none, and of more no order is known.
_JOINTS = range(5, 128)
# By how much bones may change: those of numbers that were normalised change without limit.
_STEADY = 0.25
_THIGHS = {22: ((1, 4), (2, 5)), 21: ((11, 12), (16, 17))}

# Ends of the bones that every order has.
_BONES = tuple(
    (side + a, side + b)
    for side in "lr"
    for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
)
_LOOKED_AT = 500
# A hand has 21 joints too: only numbers of HumanML3D's layout are those of KIT.
_BY_LAYOUT_ONLY = ("kit_ml",)


class Layout(NamedTuple):
    """Motions of an array, how they lay in it, and rate and skeleton where it has but one."""

    motions: list[Array]
    notes: tuple[str, ...] = ()
    rate_hz: float | None = None
    skeleton: str = ""


def split_array(array: Array) -> Layout:
    """Motions of an array, each (frames, joints, 3), or (frames, 322) of Motion-X."""
    if array.dtype.kind in "fiu" and array.size:
        if array.ndim in (2, 3) and array.shape[-1] in _RECOVERED:
            return _split_recovered(array)
        if array.ndim in (2, 3) and array.shape[-1] == _MOTION_X:
            return Layout(_in_front(array, 2), (), _MOTION_X_HZ)
        if array.ndim in (3, 4) and array.shape[-1] == 3:
            return Layout(_in_front(array, 3))
        if array.ndim in (3, 4) and array.shape[-2] == 3:
            return _split_transposed(array)
    raise NotAMotion(
        "holds no motion; expected joint positions (frames, joints, 3), (joints, 3, "
        f"frames), a batch of them, or 263, 251 or {_MOTION_X} numbers a frame (HumanML3D, "
        f"Motion-X), got an array of shape {array.shape} and type {array.dtype}"
    )


def _in_front(array: Array, n_axes: int) -> list[Array]:
    """The motions of a batch, whose axis is in front; the array alone if there is none."""
    return list(array) if array.ndim > n_axes else [array]


def _split_transposed(array: Array) -> Layout:
    """(joints, 3, frames), or (frames, 3, joints) where only that is a number of joints."""
    first, last = array.shape[-3], array.shape[-1]
    frames_first = last in _JOINTS and (first not in _JOINTS or last < first)
    moved = [
        np.moveaxis(motion, 1, 2) if frames_first else np.moveaxis(motion, 2, 0)
        for motion in _in_front(array, 3)
    ]
    layout = "(frames, 3, joints)" if frames_first else "(joints, 3, frames)"
    return Layout(moved, (f"read as {layout}: {moved[0].shape[1]} joints, {len(moved[0])} frames",))


def _split_recovered(array: Array) -> Layout:
    n_joints = _RECOVERED[array.shape[-1]]
    motions: list[Array] = [recover_positions(motion) for motion in _in_front(array, 2)]
    for motion in motions:
        _check_thighs(motion)
    name, rate, skeleton = _HUMANML3D if n_joints == 22 else _KIT
    notes = (
        f"positions recovered of {name}'s {array.shape[-1]} numbers a frame",
        f"rate assumed {rate:g} Hz, as {name} has",
    )
    return Layout(motions, notes, rate, skeleton)


def recover_positions(numbers: Array) -> Floats:
    """Joint positions of the numbers of HumanML3D, shape (frames, joints, 3), y up.

    The first number is half the turn of the body to the next frame, the next two its way in its
    own direction, the fourth its height; then come places of the joints beside the root.
    """
    numbers = numbers.astype(np.float64)
    n_joints = _RECOVERED[numbers.shape[1]]
    half = np.zeros(len(numbers))
    half[1:] = np.cumsum(numbers[:-1, 0])
    # The turn back, from the body's direction to the world.
    turns = np.zeros((len(numbers), 4))
    turns[:, 0], turns[:, 2] = np.cos(half), -np.sin(half)
    way = np.zeros((len(numbers), 3))
    way[1:, 0], way[1:, 2] = numbers[:-1, 1], numbers[:-1, 2]
    root = np.cumsum(rotate(turns, way), axis=0)
    positions = np.empty((len(numbers), n_joints, 3))
    own = numbers[:, 4 : 4 + 3 * (n_joints - 1)].reshape(len(numbers), -1, 3)
    positions[:, 1:] = rotate(turns[:, None], own) + root[:, None]
    positions[:, 0] = root
    positions[:, 0, 1] = numbers[:, 3]
    return positions


def _check_thighs(positions: Floats) -> None:
    ends = np.array(_THIGHS[positions.shape[1]])
    lengths = np.linalg.norm(positions[:, ends[:, 0]] - positions[:, ends[:, 1]], axis=2)
    mean = np.nanmean(lengths)
    if not mean > 0 or np.nanstd(lengths, axis=0).max() > _STEADY * mean:
        raise NotAMotion(
            "holds no motion; "
            "its bones change their length, as where numbers of HumanML3D "
            "were normalised: multiply by Std.npy and add Mean.npy first"
        )


class Joints(NamedTuple):
    """Names of an array's joints, what they mean, and what was guessed."""

    names: list[str]
    mapping: JointMapping | None
    notes: tuple[str, ...]

    def with_notes(self, *notes: str) -> "Joints":
        """The same with more notes."""
        return self._replace(notes=(*self.notes, *notes))


def read_layout(
    layout: Layout,
    source: str,
    options: ReadOptions,
    *,
    names: list[str] | None = None,
    rate_hz: float | None = None,
    is_bare: bool = False,
) -> FileContent:
    """Content of the one motion that is meant.

    Parameters
    ----------
    layout : the motions of a file
    options : what the caller gives
    names, rate_hz : what the file says beside its numbers
    is_bare : whether it can say nothing beside them
    """
    motion = layout.motions[choose_take(len(layout.motions), options.take, source)]
    if motion.ndim == 2:
        return _read_motion_x(motion, options)
    positions = check_positions(motion)
    table = options.skeleton_table()
    if table is None and layout.skeleton:
        table = named_table(layout.skeleton)
    joints = name_joints(positions, table, names=names)
    given = options.rate_hz if options.rate_hz is not None else rate_hz
    rate = given if given is not None else layout.rate_hz
    notes = layout.notes if given is None else layout.notes[:1]
    order = joints.mapping.name if joints.mapping is not None else ""
    if is_bare and rate is None and order == "humanml3d":
        rate = _HUMANML3D_HZ
        joints = joints.with_notes(f"rate assumed {_HUMANML3D_HZ:g} Hz, as HumanML3D has")
    return array_content(positions, joints.with_notes(*notes), rate)


def _read_motion_x(numbers: Array, options: ReadOptions) -> FileContent:
    if options.skeleton is not None:
        raise InvalidInput("has an SMPL body; leave out skeleton=")
    arrays = {"global_orient": numbers[:, :3], "body_pose": numbers[:, 3:66]}
    arrays["transl"] = numbers[:, 309:312]
    rate = _MOTION_X_HZ if options.rate_hz is None else options.rate_hz
    content = read_smpl_arrays(arrays, MOTION_X, rate_hz=rate, options=options)
    return replace(content, notes=(*content.notes, "322 parameters a frame, as Motion-X has"))


def array_content(positions: Floats, joints: Joints, rate_hz: float | None) -> FileContent:
    """Content of an array; metres and y up are assumed where the body does not tell."""
    if rate_hz is None:
        raise InvalidInput(f"an array holds no frame rate; {RATE_HINT}")
    return FileContent(
        names=joints.names,
        positions=positions,
        rate_hz=rate_hz,
        metadata=FileMetadata(likely=POINT_UNITS),
        mapping=joints.mapping,
        notes=joints.notes,
    )


def check_positions(array: Array) -> Floats:
    """The array as floats of its own, (frames, joints, 3); one person around it is taken off."""
    if array.ndim == 4 and array.shape[0] == 1:
        array = array[0]
    if array.ndim != 3 or array.shape[2] != 3 or array.dtype.kind not in "fiu":
        raise NotAMotion(
            "holds no motion; "
            "expected joint positions (frames, joints, 3), got an array of "
            f"shape {array.shape} and type {array.dtype}"
        )
    positions = array.astype(np.float64)
    positions[~np.isfinite(positions).all(axis=2)] = np.nan
    if (np.abs(positions) > FARTHEST).any():
        raise UnreadableFile("has impossibly large numbers")
    return positions


def find_rate(arrays: Mapping[str, Array]) -> float | None:
    """Frames per second, under one of the usual names; None if there is none."""
    for key in RATES:
        if key in arrays and arrays[key].size == 1 and arrays[key].dtype.kind in "fiu":
            rate = float(arrays[key].reshape(()))
            if 0 < rate < 1e6:
                return rate
    return None


def name_joints(
    positions: Floats, skeleton: SkeletonTable | None, *, names: list[str] | None = None
) -> Joints:
    """Which joint is which.

    Parameters
    ----------
    positions : array, shape (frames, joints, 3)
    skeleton : what the caller gives
    names : what the file says
    """
    n_joints = positions.shape[1]
    if names is not None:
        if len(names) != n_joints:
            raise InvalidInput(f"has {len(names)} names for {n_joints} joints")
        return Joints(number_doubles(names), None, ())
    if skeleton is not None:
        mapping = skeleton.resolve(())
        if len(mapping.order) != n_joints:
            raise InvalidInput(
                f"has {n_joints} joints; "
                + (f"{skeleton.name} has {len(mapping.order)}" if mapping.order else "")
                + ("" if mapping.order else f"those of {skeleton.name} have no usual order")
            )
        return Joints(list(mapping.order), mapping, ())
    return _guess_order(positions)


def _guess_order(positions: Floats) -> Joints:
    known = [named_mapping(name) for name in known_mappings() if name not in _BY_LAYOUT_ONLY]
    fitting = [m for m in known if len(m.order) == positions.shape[1]]
    if not fitting:
        counts = ", ".join(f"{len(m.order)} ({m.name})" for m in known if m.order)
        raise InvalidInput(
            f"an array of {positions.shape[1]} joints without names; known orders have "
            f"{counts}; save names beside the positions in a .npz file"
        )
    best, found_by = fitting[0], "by their number"
    if len(fitting) > 1:
        some = positions[:: 1 + len(positions) // _LOOKED_AT]
        best = min(fitting, key=lambda mapping: _unsteadiness(some, mapping))
        found_by = "by bones that keep their length"
    return Joints(list(best.order), best, (f"order of joints guessed: {best.name}, {found_by}",))


def _unsteadiness(positions: Floats, mapping: JointMapping) -> float:
    """How much bones change their length, and differ between the sides, under an order."""
    body = Motion(mapping.order, positions, Recording(rate_hz=1.0), mapping).generic_positions()
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
