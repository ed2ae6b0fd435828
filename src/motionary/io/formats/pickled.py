"""Motions in .pkl files of AIST++.

A pickle is a program, so it is not run: `unpickling` takes arrays out of it. Keypoints
(`keypoints3d`, 17 of COCO, centimetres) and pose parameters (`smpl_poses`, `smpl_trans`,
`smpl_scaling`) are read; both have y up and 60 Hz.
"""

from pathlib import Path

import numpy as np

from motionary.errors import NO_MOTION, InvalidInput, NotAMotion, UnreadableFile
from motionary.io.formats.arrays import array_content, check_positions, name_joints
from motionary.io.formats.content import FileContent
from motionary.io.formats.npz import Array
from motionary.io.formats.smpl import check_pose, pose_content
from motionary.io.formats.unpickling import PickleRefusedError, plain_dict, read_pickled
from motionary.io.normalise.units_axes import FileMetadata, metres_per_unit
from motionary.io.options import ReadOptions

RATE_HZ = 60.0
_AIST = FileMetadata("m", by_definition=True, origin="AIST++", noted=("up",), takes_unit=False)
_KEYPOINTS = ("keypoints3d_optim", "keypoints3d")


def read_pickle(path: Path, options: ReadOptions) -> FileContent:
    """Content of a .pkl file of AIST++; without a rate that is given at 60 Hz.

    Raises
    ------
    UnreadableFile
        If the file is missing, damaged, holds anything but arrays, or no motion.
    InvalidInput
        If a skeleton is given and the file has an SMPL body.
    """
    content = _load(path)
    notes: tuple[str, ...] = ()
    rate = options.rate_hz
    if rate is None:
        rate, notes = RATE_HZ, (f"rate assumed {RATE_HZ:g} Hz, as AIST++ has",)
    for key in _KEYPOINTS:
        if key in content:
            positions = check_positions(content[key], path.name)
            joints = name_joints(positions, path.name, options.skeleton_table())
            joints = joints._replace(notes=(*joints.notes, *notes))
            return array_content(positions, joints, path.name, rate_hz=rate)
    if not {"smpl_poses", "smpl_trans"} <= set(content):
        raise NotAMotion(
            f"{path.name}: {NO_MOTION}; expected keypoints3d or smpl_poses and smpl_trans, "
            f"got {', '.join(sorted(content))[:80] or 'no arrays'}"
        )
    if options.skeleton is not None:
        raise InvalidInput(f"{path.name}: has an SMPL body; leave out skeleton=")
    pose = check_pose(content["smpl_poses"], content["smpl_trans"], path.name)
    metres = _metres(content) if options.unit is None else metres_per_unit(options.unit)
    pose = pose._replace(root=pose.root * metres)
    return pose_content(pose, path.name, rate_hz=rate, metadata=_AIST, notes=notes)


def _metres(content: dict[str, Array]) -> float:
    """AIST++ scales the body up; places are in units of the scaled one."""
    scaling = content.get("smpl_scaling")
    if scaling is None or scaling.size != 1 or not float(scaling.reshape(())) > 0:
        return 1.0
    return 1.0 / float(scaling.reshape(()))


def _load(path: Path) -> dict[str, Array]:
    """The arrays of a pickled dict."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read: {error.strerror or error}") from error
    try:
        loaded = read_pickled(content)
    except PickleRefusedError as error:
        raise UnreadableFile(
            f"{path.name}: pickle is damaged, or holds more than arrays of NumPy, which is not "
            f"loaded: {error}"
        ) from error
    if not isinstance(loaded, dict):
        raise NotAMotion(f"{path.name}: {NO_MOTION}; expected a dict of arrays")
    return {
        key: np.asarray(value)
        for key, value in plain_dict(loaded).items()
        if isinstance(value, np.ndarray | np.number | float)
    }
