"""Motions in arrays: .npy and .npz files, .npz of our own, and pickles (.pkl).

HumanML3D (22 joints, 20 Hz), outputs of networks that lift poses to space, AMASS, and whatever
people save from NumPy.

A pickle is a program, so it is not run: `npz` takes arrays out of it. Keypoints of AIST++
(`keypoints3d`, 17 of COCO, centimetres) and pose parameters (`smpl_poses`, `smpl_trans`,
`smpl_scaling`) are read; both have y up and 60 Hz. So are parameters of SMPL bodies of other
programs, and dicts of several such motions by name.

A clip of .npz has the file's arrays, those with a row per frame cut: parameters of bodies stay
parameters, and what else a program keeps beside them stays too.
"""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InvalidInput, NotAMotion, UnreadableFile
from motionary.files import read_bytes
from motionary.io.formats.array_layouts import (
    NAMES,
    Layout,
    array_content,
    check_positions,
    find_rate,
    name_joints,
    read_layout,
    split_array,
)
from motionary.io.formats.content import FileContent, choose_take, names_file, recall
from motionary.io.formats.npz import (
    ArchivedArrays,
    Array,
    is_own,
    plain_dict,
    read_npy,
    read_own,
    read_pickled,
    to_arrays,
)
from motionary.io.formats.numbers import check_frames
from motionary.io.formats.pickle_machine import PickleRefusedError
from motionary.io.formats.smpl import check_pose, find_source, pose_content, read_smpl_arrays
from motionary.io.normalise.units import FileMetadata, metres_per_unit
from motionary.io.options import ReadOptions

# Names under which programs keep joint positions.
_POSITIONS = ("positions", "joints", "keypoints3d", "joints3d", "jtr", "xyz")
# Arrays whose rows are no frames, however many they are; of files of our own, those that are.
_NOT_BY_FRAME = (*NAMES, "betas", "gender")
_OWN_BY_FRAME = ("positions", "rotations")

_AIST_HZ = 60.0
_AIST = FileMetadata("m", by_definition=True, origin="AIST++", noted=("up",), takes_unit=False)
# GVHMR keeps the same motion in the world and as the camera sees it.
_GLOBAL = "smpl_params_global"
_KEYPOINTS = ("keypoints3d_optim", "keypoints3d")


@names_file
def read_array(path: Path, options: ReadOptions) -> FileContent:
    """Content of a .npy file: an array, or the dict of results that a generator of motion saves.

    A .npy file holds no rate: that of HumanML3D and Motion-X is assumed for their layouts only.
    """
    layout = recall(path, lambda: _load_layout(path), count=lambda layout: len(layout.motions))
    return read_layout(layout, path.name, options, is_bare=True)


def _load_layout(path: Path) -> Layout:
    content = read_npy(path)
    return _split_results(content) if isinstance(content, dict) else split_array(content)


def _split_results(results: dict[str, Any]) -> Layout:
    """Motions of `results.npy`: motion (motions, joints, 3, frames), lengths, text."""
    motion = results.get("motion")
    if not isinstance(motion, np.ndarray):
        raise NotAMotion(
            "holds no motion; "
            "expected a dict with motion (motions, joints, 3, frames), got "
            f"{', '.join(sorted(results))[:80]}"
        )
    layout = split_array(motion)
    lengths = np.asarray(results.get("lengths", ()))
    if lengths.shape == (len(layout.motions),) and lengths.dtype.kind in "iu":
        # What is behind the end of a motion fills the batch up.
        cut = [m[: max(1, int(n))] for m, n in zip(layout.motions, lengths, strict=True)]
        layout = layout._replace(motions=cut)
    return layout


@names_file
def read_npz_motion(path: Path, options: ReadOptions) -> FileContent:
    """Content of a .npz file: one of ours, of AMASS, or positions under one of the usual names."""
    arrays = ArchivedArrays(path)
    if options.take is not None and (
        is_own(arrays) or not any(key in arrays for key in _POSITIONS)
    ):
        choose_take(1, options.take, path.name)
    if is_own(arrays):
        return read_own(arrays, options)
    rate = options.rate_hz if options.rate_hz is not None else find_rate(arrays)
    # Some programs keep their arrays in one object.
    for found in (to_arrays(arrays.read_dict("results")), arrays):
        if source := find_source(found):
            return read_smpl_arrays(found, source, rate_hz=rate, options=options)
    key = next((key for key in _POSITIONS if key in arrays), None)
    if key is None:
        raise NotAMotion(
            "holds no motion; expected poses and trans (AMASS) or positions "
            f"(frames, joints, 3), got {', '.join(sorted(arrays)) or 'no arrays'}"
        )
    layout = recall(
        path, lambda: split_array(arrays[key]), count=lambda layout: len(layout.motions)
    )
    return read_layout(layout, path.name, options, names=_find_names(arrays), rate_hz=rate)


def _find_names(arrays: Mapping[str, Array]) -> list[str] | None:
    key = next((key for key in NAMES if key in arrays), None)
    if key is None or arrays[key].dtype.kind not in "US" or arrays[key].ndim != 1:
        return None
    return [n.decode("latin-1") if isinstance(n, bytes) else n for n in arrays[key].tolist()]


@names_file
def cut_npz(path: Path, first: int, last: int, take: str | int | None = None) -> bytes:
    """A clip of a .npz file; frames as the file counts them, both included.

    Files of others count from 0. Of a batch the clip holds the recording that is named.
    """
    arrays = dict(ArchivedArrays(path))
    own = is_own(arrays)
    key = next((key for key in _POSITIONS if key in arrays), None)
    if key is not None and not own:
        layout = split_array(arrays[key])
        arrays[key] = layout.motions[choose_take(len(layout.motions), take, path.name)]
    elif key is None:
        source = find_source(arrays)
        key = source.turns[0] if source else None
    if key is None or not arrays[key].ndim:
        raise UnreadableFile(
            "no clips can be cut out of it; convert it to a .npz of motionary first"
        )
    n_frames = len(arrays[key])
    number = int(arrays["first_frame"]) if own else 0
    check_frames(first, last, first_number=number, n_frames=n_frames)
    for name, array in arrays.items():
        by_frame = name in _OWN_BY_FRAME if own else name not in _NOT_BY_FRAME
        if by_frame and array.ndim and len(array) == n_frames:
            arrays[name] = array[first - number : last - number + 1]
    if own:
        arrays |= _cut_events(arrays, first - number, last - number + 1)
        arrays["first_frame"] = np.array(first)
    written = io.BytesIO()
    np.savez_compressed(written, **arrays)  # type: ignore[arg-type]
    return written.getvalue()


def _cut_events(arrays: dict[str, Array], start: int, stop: int) -> dict[str, Array]:
    """Events within frames, their times from the first of these."""
    if "event_times_s" not in arrays:
        return {}
    rate, times = float(arrays["rate_hz"]), arrays["event_times_s"]
    inside = (start <= times * rate) & (times * rate < stop)
    kept = {name: arrays[name][inside] for name in ("event_names", "event_sides")}
    return {**kept, "event_times_s": times[inside] - start / rate}


# ---- pickles


@names_file
def read_pickle(path: Path, options: ReadOptions) -> FileContent:
    """Content of a .pkl file: AIST++, at 60 Hz where no rate is given, or SMPL bodies."""
    motions = recall(path, lambda: _find_recordings(_load(path)), count=len)
    names = list(motions)
    content = motions[names[choose_take(names, options.take, path.name)]]
    is_aist = {"smpl_poses", "smpl_trans"} <= set(content)
    key = next((key for key in _KEYPOINTS if key in content), None)
    source = find_source(content)
    if key is None and not is_aist and source is None:
        raise NotAMotion(
            "holds no motion; "
            "expected keypoints3d or smpl_poses and smpl_trans (AIST++) "
            f"or turns and places of a body, got {', '.join(sorted(content))[:80] or 'no arrays'}"
        )
    if key is None and options.skeleton is not None:
        raise InvalidInput("has an SMPL body; leave out skeleton=")
    if key is None and not is_aist and source is not None:
        rate = find_rate(content) if options.rate_hz is None else options.rate_hz
        return read_smpl_arrays(content, source, rate_hz=rate, options=options)
    rate, notes = options.rate_hz, []
    if rate is None:
        rate, notes = _AIST_HZ, [f"rate assumed {_AIST_HZ:g} Hz, as AIST++ has"]
    if key is not None:
        positions = check_positions(content[key])
        joints = name_joints(positions, options.skeleton_table())
        return array_content(positions, joints.with_notes(*notes), rate)
    pose = check_pose([content["smpl_poses"]], content["smpl_trans"])
    metres = _metres(content) if options.unit is None else metres_per_unit(options.unit)
    pose = pose._replace(root=pose.root * metres, notes=(*notes, *pose.notes))
    return pose_content(pose, rate_hz=rate, metadata=_AIST)


def _find_recordings(content: dict[str, Any]) -> dict[str, dict[str, Array]]:
    """The arrays of the dicts in a dict, by their names, or of the dict itself."""
    inner = {key: plain_dict(value) for key, value in content.items() if isinstance(value, dict)}
    if _GLOBAL in inner:
        return {"1": to_arrays(inner[_GLOBAL])}
    motions = {
        key: arrays for key, value in inner.items() if _is_motion(arrays := to_arrays(value))
    }
    return motions or {"1": to_arrays(content)}


def _is_motion(arrays: dict[str, Array]) -> bool:
    return any(key in arrays for key in _KEYPOINTS) or find_source(arrays) is not None


def _metres(content: dict[str, Array]) -> float:
    """AIST++ scales the body up; places are in units of the scaled one."""
    scaling = content.get("smpl_scaling")
    if scaling is None or scaling.size != 1 or not float(scaling.reshape(())) > 0:
        return 1.0
    return 1.0 / float(scaling.reshape(()))


def _load(path: Path) -> dict[str, Any]:
    """A pickled dict."""
    try:
        loaded = read_pickled(read_bytes(path))
    except PickleRefusedError as error:
        raise UnreadableFile(
            f"pickle is damaged, or holds more than arrays of NumPy, which is not loaded: {error}"
        ) from error
    if not isinstance(loaded, dict):
        raise NotAMotion("holds no motion; expected a dict of arrays")
    return plain_dict(loaded)
