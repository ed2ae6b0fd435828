"""Motions in .pkl files of AIST++ and of video tools.

A pickle is a program, so it is not run: `npz` takes arrays out of it. Keypoints
(`keypoints3d`, 17 of COCO, centimetres) and pose parameters (`smpl_poses`, `smpl_trans`,
`smpl_scaling`) are read; both have y up and 60 Hz. So are parameters of SMPL bodies of other
programs, and dicts of several such motions by name.
"""

from pathlib import Path
from typing import Any

from motionary.errors import InvalidInput, NotAMotion, UnreadableFile
from motionary.files import read_bytes
from motionary.io.formats.arrays import (
    array_content,
    check_positions,
    find_rate,
    name_joints,
)
from motionary.io.formats.content import FileContent
from motionary.io.formats.npz import Array, plain_dict, read_pickled, to_arrays
from motionary.io.formats.pickle_machine import PickleRefusedError
from motionary.io.formats.smpl import check_pose, find_source, pose_content, read_smpl_arrays
from motionary.io.formats.takes import choose_take, recall
from motionary.io.normalise.units import FileMetadata, metres_per_unit
from motionary.io.options import ReadOptions

RATE_HZ = 60.0
_AIST = FileMetadata("m", by_definition=True, origin="AIST++", noted=("up",), takes_unit=False)
# GVHMR keeps the same motion in the world and as the camera sees it.
_GLOBAL = "smpl_params_global"
_KEYPOINTS = ("keypoints3d_optim", "keypoints3d")


def read_pickle(path: Path, options: ReadOptions) -> FileContent:
    """Content of a .pkl file of AIST++ (without a rate that is given at 60 Hz), or of SMPL bodies.

    Raises
    ------
    UnreadableFile
        If the file is missing, damaged, holds anything but arrays, or no motion.
    InvalidInput
        If a skeleton is given and the file has an SMPL body, or it holds several recordings.
    """
    motions = recall(path, lambda: _find_recordings(_load(path)), count=len)
    names = list(motions)
    content = motions[names[choose_take(names, options.take, path.name)]]
    is_aist = {"smpl_poses", "smpl_trans"} <= set(content)
    key = next((key for key in _KEYPOINTS if key in content), None)
    if key is None and not is_aist and find_source(content) is None:
        raise NotAMotion(
            "holds no motion; "
            "expected keypoints3d or smpl_poses and smpl_trans (AIST++) "
            f"or turns and places of a body, got {', '.join(sorted(content))[:80] or 'no arrays'}",
            file=path.name,
        )
    if key is None and options.skeleton is not None:
        raise InvalidInput("has an SMPL body; leave out skeleton=", file=path.name)
    if key is None and not is_aist:
        rate = find_rate(content) if options.rate_hz is None else options.rate_hz
        return read_smpl_arrays(content, path.name, rate_hz=rate, options=options)
    notes: tuple[str, ...] = ()
    rate = options.rate_hz
    if rate is None:
        rate, notes = RATE_HZ, (f"rate assumed {RATE_HZ:g} Hz, as AIST++ has",)
    if key is not None:
        positions = check_positions(content[key], path.name)
        joints = name_joints(positions, path.name, options.skeleton_table())
        joints = joints._replace(notes=(*joints.notes, *notes))
        return array_content(positions, joints, path.name, rate_hz=rate)
    pose = check_pose([content["smpl_poses"]], content["smpl_trans"], path.name)
    metres = _metres(content) if options.unit is None else metres_per_unit(options.unit)
    pose = pose._replace(root=pose.root * metres)
    return pose_content(pose, path.name, rate_hz=rate, metadata=_AIST, notes=notes)


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
            f"pickle is damaged, or holds more than arrays of NumPy, which is not loaded: {error}",
            file=path.name,
        ) from error
    if not isinstance(loaded, dict):
        raise NotAMotion("holds no motion; expected a dict of arrays", file=path.name)
    return plain_dict(loaded)
