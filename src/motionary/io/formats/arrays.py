"""Joint positions in arrays (frames, joints, 3) of .npy and .npz files.

HumanML3D (22 joints, 20 Hz), outputs of networks that lift poses to space, and whatever
people save from NumPy. Which joint is which is given, or guessed by their number and, where
several orders have that number, by whose bones keep their length; every guess is a note.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, NotAMotion, UnreadableFile
from motionary.io.formats.array_layouts import (
    HUMANML3D_HZ,
    MOTION_X_HZ,
    Layout,
    split_array,
)
from motionary.io.formats.content import (
    FARTHEST,
    POINT_UNITS,
    RATE_HINT,
    FileContent,
    number_doubles,
)
from motionary.io.formats.npz import (
    Array,
    is_own,
    read_npy,
    read_npy_dict,
    read_npz,
    read_own,
    to_arrays,
)
from motionary.io.formats.smpl import is_smpl, read_smpl_arrays
from motionary.io.formats.takes import choose_take, recall
from motionary.io.normalise.units import FileMetadata
from motionary.io.options import ReadOptions
from motionary.motion import GENERIC_JOINTS, JointMapping, Motion
from motionary.recording import Recording
from motionary.skeletons import SkeletonTable, known_mappings, named_mapping, named_table

Floats = NDArray[np.float64]

#: Names under which programs keep joint positions, names of joints, and the rate.
POSITIONS = ("positions", "joints", "keypoints3d", "joints3d", "jtr", "xyz")
NAMES = ("names", "joint_names", "marker_names", "labels")
RATES = ("rate_hz", "fps", "mocap_framerate", "mocap_frame_rate", "frame_rate", "framerate")

# Ends of the bones that every order has.
_BONES = tuple(
    (side + a, side + b)
    for side in "lr"
    for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
)
_LOOKED_AT = 500
# A hand has 21 joints too: only numbers of HumanML3D's layout are those of KIT.
_BY_LAYOUT_ONLY = ("kit_ml",)


class Joints(NamedTuple):
    """Names of an array's joints, what they mean, and what was guessed."""

    names: list[str]
    mapping: JointMapping | None
    notes: tuple[str, ...]

    def with_note(self, note: str) -> "Joints":
        """The same with one more note."""
        return self._replace(notes=(*self.notes, note))


def read_array(path: Path, options: ReadOptions) -> FileContent:
    """Content of a .npy file: an array, or the dict of results that a generator of motion saves.

    A .npy file holds no rate: that of HumanML3D and Motion-X is assumed for their layouts only.

    Raises
    ------
    UnreadableFile
        If the file is missing, damaged, or holds no such array.
    InvalidInput
        If the rate or the order of the joints is neither known nor given, or the file holds
        several recordings.
    """
    layout = recall(path, lambda: _load_layout(path), count=lambda layout: len(layout.motions))
    return read_layout(layout, path.name, options, is_bare=True)


def _load_layout(path: Path) -> Layout:
    results = read_npy_dict(path)
    if results:
        return _split_results(results, path.name)
    return split_array(read_npy(path), path.name)


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
    source : name of the file
    options : what the caller gives
    names, rate_hz : what the file says beside its numbers
    is_bare : whether it can say nothing beside them
    """
    motion = layout.motions[choose_take(len(layout.motions), options.take, source)]
    if motion.ndim == 2:
        return _read_motion_x(motion, source, options)
    positions = check_positions(motion, source)
    table = options.skeleton_table()
    if table is None and layout.skeleton:
        table = named_table(layout.skeleton)
    joints = name_joints(positions, source, table, names=names)
    given = options.rate_hz if options.rate_hz is not None else rate_hz
    rate = given if given is not None else layout.rate_hz
    notes = layout.notes if given is None else layout.notes[:1]
    order = joints.mapping.name if joints.mapping is not None else ""
    if is_bare and rate is None and order == "humanml3d":
        rate = HUMANML3D_HZ
        joints = joints.with_note(f"rate assumed {HUMANML3D_HZ:g} Hz, as HumanML3D has")
    joints = joints._replace(notes=(*joints.notes, *notes))
    return array_content(positions, joints, source, rate_hz=rate)


def _read_motion_x(numbers: Array, source: str, options: ReadOptions) -> FileContent:
    if options.skeleton is not None:
        raise InvalidInput("has an SMPL body; leave out skeleton=", file=source)
    arrays = {"global_orient": numbers[:, :3], "body_pose": numbers[:, 3:66]}
    arrays["transl"] = numbers[:, 309:312]
    rate = MOTION_X_HZ if options.rate_hz is None else options.rate_hz
    content = read_smpl_arrays(arrays, source, rate_hz=rate, options=options)
    return replace(content, notes=(*content.notes, "322 parameters a frame, as Motion-X has"))


def _split_results(results: dict[str, Any], source: str) -> Layout:
    """Motions of `results.npy`: motion (motions, joints, 3, frames), lengths, text."""
    motion = results.get("motion")
    if not isinstance(motion, np.ndarray):
        raise NotAMotion(
            "holds no motion; "
            "expected a dict with motion (motions, joints, 3, frames), got "
            f"{', '.join(sorted(results))[:80]}",
            file=source,
        )
    layout = split_array(motion, source)
    lengths = np.asarray(results.get("lengths", ()))
    if lengths.shape == (len(layout.motions),) and lengths.dtype.kind in "iu":
        # What is behind the end of a motion fills the batch up.
        cut = [m[: max(1, int(n))] for m, n in zip(layout.motions, lengths, strict=True)]
        layout = layout._replace(motions=cut)
    return layout


def read_npz_motion(path: Path, options: ReadOptions) -> FileContent:
    """Content of a .npz file: one of ours, of AMASS, or positions under one of the usual names.

    Raises
    ------
    UnreadableFile
        If the file is missing, damaged, or holds no motion.
    InvalidInput
        If rate or names are neither known nor given.
    """
    arrays = read_npz(path)
    if options.take is not None and (is_own(arrays) or not any(key in arrays for key in POSITIONS)):
        choose_take(1, options.take, path.name)
    if is_own(arrays):
        return read_own(arrays, path.name, options)
    rate = options.rate_hz if options.rate_hz is not None else find_rate(arrays)
    # Some programs keep their arrays in one object.
    results = to_arrays(arrays.read_dict("results"))
    if is_smpl(results):
        return read_smpl_arrays(results, path.name, rate_hz=rate, options=options)
    if is_smpl(arrays):
        return read_smpl_arrays(arrays, path.name, rate_hz=rate, options=options)
    key = next((key for key in POSITIONS if key in arrays), None)
    if key is None:
        raise NotAMotion(
            "holds no motion; expected poses and trans (AMASS) or positions "
            f"(frames, joints, 3), got {', '.join(sorted(arrays)) or 'no arrays'}",
            file=path.name,
        )
    layout = recall(
        path, lambda: split_array(arrays[key], path.name), count=lambda layout: len(layout.motions)
    )
    return read_layout(layout, path.name, options, names=_find_names(arrays), rate_hz=rate)


def array_content(
    positions: Floats, joints: Joints, source: str, *, rate_hz: float | None
) -> FileContent:
    """Content of an array; metres and y up are assumed where the body does not tell.

    Raises
    ------
    InvalidInput
        If there is no rate.
    """
    if rate_hz is None:
        raise InvalidInput(f"an array holds no frame rate; {RATE_HINT}", file=source)
    return FileContent(
        names=joints.names,
        positions=positions,
        rate_hz=rate_hz,
        source=source,
        metadata=FileMetadata(likely=POINT_UNITS),
        mapping=joints.mapping,
        notes=joints.notes,
    )


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
        raise NotAMotion(
            "holds no motion; "
            "expected joint positions (frames, joints, 3), got an array of "
            f"shape {array.shape} and type {array.dtype}",
            file=source,
        )
    positions = array.astype(np.float64)
    positions[~np.isfinite(positions).all(axis=2)] = np.nan
    if (np.abs(positions) > FARTHEST).any():
        raise UnreadableFile("has impossibly large numbers", file=source)
    return positions


def find_rate(arrays: Mapping[str, Array]) -> float | None:
    """Frames per second, under one of the usual names; None if there is none."""
    for key in RATES:
        if key in arrays and arrays[key].size == 1 and arrays[key].dtype.kind in "fiu":
            rate = float(arrays[key].reshape(()))
            if 0 < rate < 1e6:
                return rate
    return None


def _find_names(arrays: Mapping[str, Array]) -> list[str] | None:
    key = next((key for key in NAMES if key in arrays), None)
    if key is None or arrays[key].dtype.kind not in "US" or arrays[key].ndim != 1:
        return None
    return [n.decode("latin-1") if isinstance(n, bytes) else n for n in arrays[key].tolist()]


def name_joints(
    positions: Floats,
    source: str,
    skeleton: SkeletonTable | None,
    *,
    names: list[str] | None = None,
) -> Joints:
    """Which joint is which.

    Parameters
    ----------
    positions : array, shape (frames, joints, 3)
    source : name of the file
    skeleton : what the caller gives
    names : what the file says

    Raises
    ------
    InvalidInput
        If names are of another number, or nothing tells and no known order has this number.
    """
    n_joints = positions.shape[1]
    if names is not None:
        if len(names) != n_joints:
            raise InvalidInput(f"has {len(names)} names for {n_joints} joints", file=source)
        return Joints(number_doubles(names), None, ())
    if skeleton is not None:
        mapping = skeleton.resolve(())
        if len(mapping.order) != n_joints:
            raise InvalidInput(
                f"has {n_joints} joints; "
                + (f"{skeleton.name} has {len(mapping.order)}" if mapping.order else "")
                + ("" if mapping.order else f"those of {skeleton.name} have no usual order"),
                file=source,
            )
        return Joints(list(mapping.order), mapping, ())
    return _guess_order(positions, source)


def _guess_order(positions: Floats, source: str) -> Joints:
    known = [named_mapping(name) for name in known_mappings() if name not in _BY_LAYOUT_ONLY]
    fitting = [m for m in known if len(m.order) == positions.shape[1]]
    if not fitting:
        counts = ", ".join(f"{len(m.order)} ({m.name})" for m in known if m.order)
        raise InvalidInput(
            f"an array of {positions.shape[1]} joints without names; known orders have "
            f"{counts}; save names beside the positions in a .npz file",
            file=source,
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
