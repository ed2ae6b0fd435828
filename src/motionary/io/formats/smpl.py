"""What did a body do, according to the pose parameters of an SMPL model (AMASS, AIST++)?

Parameters are turns of joints, not places: without the model's file they move a skeleton
of our own, with the average proportions of Drillis and Contini (1966) as shares of the
stature. Relations scale with the body, so they hardly notice; with `body_model=` the
person's own joints are used. AMASS has z up and metres.

Conventions: in the rest pose the body stands in a T, y up, looking along z, its left at +x.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.formats.numpy_files import Array, read_npz
from motionary.io.formats.pose import place_joints
from motionary.io.normalise.axes import turn_up
from motionary.io.normalise.body_frame import FileMetadata, settle_claims
from motionary.io.normalise.units import metres_per_unit
from motionary.motion import Motion, Skeleton
from motionary.rotations import (
    matrices_to_quaternions,
    multiply_quaternions,
    rotation_vectors_to_quaternions,
)
from motionary.skeletons import named_mapping

Floats = NDArray[np.float64]

N_BODY = 22
STATURE_M = 1.70

#: Joints of the body, and three ends that move with them.
NAMES = (*named_mapping("smpl").order[:N_BODY], "left_hand", "right_hand", "head_top")
PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21, 15)

# Shares of the stature: aside (left), up, forward, from the parent.
_SHARES = {
    "left_hip": (0.055, -0.03, 0.0),
    "spine1": (0.0, 0.065, 0.0),
    "left_knee": (0.0, -0.245, 0.0),
    "spine2": (0.0, 0.075, 0.0),
    "left_ankle": (0.0, -0.246, 0.0),
    "spine3": (0.0, 0.035, 0.0),
    "left_foot": (0.0, -0.03, 0.075),
    "neck": (0.0, 0.11, 0.0),
    "left_collar": (0.045, 0.07, 0.0),
    "head": (0.0, 0.05, 0.0),
    "left_shoulder": (0.084, 0.013, 0.0),
    "left_elbow": (0.186, 0.0, 0.0),
    "left_wrist": (0.146, 0.0, 0.0),
    "left_hand": (0.05, 0.0, 0.0),
    "head_top": (0.0, 0.105, 0.0),
}
_MIRROR = np.array([-1.0, 1.0, 1.0])
_MOST = 1e6
# Where the pelvis of the model rests, below its origin.
_PELVIS = (0.0, -0.13, 0.0)


# Frames that suffice to see how a body stands.
_LOOKED_AT = 500


class Pose(NamedTuple):
    """Parameters of a motion: turns (frames, 22, 3) as rotation vectors, root (frames, 3)."""

    turns: Floats
    root: Floats


def is_smpl(arrays: dict[str, Array]) -> bool:
    """Whether arrays are a motion of an SMPL body."""
    return "trans" in arrays and ("poses" in arrays or {"root_orient", "pose_body"} <= set(arrays))


def read_smpl_arrays(
    arrays: dict[str, Array],
    source: str,
    *,
    rate_hz: float | None,
    unit: float | str | None,
    up: str | None,
    body_model: str | Path | None,
) -> Motion:
    """The motion of a file of AMASS.

    Raises
    ------
    UnreadableFile
        If arrays have other shapes, or the model's file is none.
    InvalidInput
        If there is no rate.
    """
    if rate_hz is None:
        raise InvalidInput(f"{source}: holds no frame rate; pass it with --rate (rate_hz=...)")
    if "poses" in arrays:
        poses = arrays["poses"]
    else:
        poses = np.concatenate((arrays["root_orient"], arrays["pose_body"]), axis=-1)
    pose = check_pose(poses, arrays["trans"], source)
    pose = pose._replace(root=pose.root * (1.0 if unit is None else metres_per_unit(unit)))
    axis, note = find_up(pose, source, up=up, usual="z", whose="AMASS")
    if body_model is None:
        return pose_to_motion(pose, source, rate_hz=rate_hz, up=axis, notes=(note,))
    betas = arrays.get("betas", np.zeros(0)).astype(np.float64).ravel()
    skeleton = read_body_model(body_model, betas)
    return pose_to_motion(pose, source, rate_hz=rate_hz, up=axis, notes=(note,), skeleton=skeleton)


def check_pose(poses: Array, trans: Array, source: str) -> Pose:
    """The turns of the body's joints and the places of its root.

    Raises
    ------
    UnreadableFile
        If the shapes are others.
    """
    poses = poses.reshape(len(poses), -1) if poses.ndim == 3 else poses
    fits = poses.ndim == 2 and poses.shape[1] >= 3 * N_BODY and poses.shape[1] % 3 == 0
    if not fits or trans.shape != (len(poses), 3) or not len(poses):
        raise UnreadableFile(
            f"{source}: expected poses (frames, {3 * N_BODY} or more) and trans (frames, 3), got "
            f"{poses.shape} and {trans.shape}"
        )
    if poses.dtype.kind not in "fiu" or trans.dtype.kind not in "fiu":
        raise UnreadableFile(f"{source}: poses and trans must be numbers")
    turns = poses[:, : 3 * N_BODY].astype(np.float64).reshape(-1, N_BODY, 3)
    root = trans.astype(np.float64)
    # NaN compares as False.
    if not ((np.abs(turns) < _MOST).all() and (np.abs(root) < _MOST).all()):
        raise UnreadableFile(f"{source}: poses and trans must be finite, and of possible size")
    return Pose(turns, root)


def find_up(pose: Pose, source: str, *, up: str | None, usual: str, whose: str) -> tuple[str, str]:
    """The axis that points up in a file, and a note on it.

    Parameters
    ----------
    pose : as in the file
    up : what the caller says, as in `read`
    usual : axis that files of `whose` have

    Raises
    ------
    InvalidInput
        If the caller contradicts the body.
    """
    some = slice(None, None, 1 + len(pose.turns) // _LOOKED_AT)
    sample = Pose(pose.turns[some], pose.root[some])
    body = pose_to_motion(sample, source, rate_hz=1.0, up="y", notes=())
    metadata = FileMetadata(unit="m", usual_up=usual, by_definition=True)
    normalised = settle_claims(body, metadata, unit=None, up=up)
    if up is None and normalised.up == usual:
        return usual, f"{usual} up, as {whose} has"
    return normalised.up, normalised.notes[1]


def pose_to_motion(
    pose: Pose,
    source: str,
    *,
    rate_hz: float,
    up: str,
    notes: tuple[str, ...],
    skeleton: Skeleton | None = None,
) -> Motion:
    """Forward kinematics of a pose, turned so that y is up.

    Parameters
    ----------
    pose : turns, and places in metres with `up` up
    skeleton : by default the one of average proportions
    """
    if skeleton is None:
        skeleton = average_skeleton()
        notes = (*notes, f"proportions of an average body of {STATURE_M:.2f} m")
    rotations = np.zeros((len(pose.turns), len(NAMES), 4))
    rotations[..., 0] = 1.0
    rotations[:, :N_BODY] = rotation_vectors_to_quaternions(pose.turns)
    world = matrices_to_quaternions(turn_up(np.eye(3), up).T)
    rotations[:, 0] = multiply_quaternions(world, rotations[:, 0])
    # The pelvis rests at its offset whichever way is up; what the file gives is added there.
    pelvis = skeleton.offsets[0]
    root = turn_up(pose.root + pelvis, up) - pelvis
    return Motion(
        names=NAMES,
        positions=place_joints(skeleton, rotations, root, translations={}, source=source),
        rate_hz=rate_hz,
        mapping=named_mapping("smpl"),
        skeleton=skeleton,
        rotations=rotations,
        source=source,
        notes=notes,
    )


def average_skeleton() -> Skeleton:
    """The skeleton that moves where no model is given."""
    offsets = np.zeros((len(NAMES), 3))
    offsets[0] = _PELVIS
    for joint, name in enumerate(NAMES[1:], start=1):
        own = name if name in _SHARES else name.replace("right", "left")
        mirrored = np.multiply(_SHARES[own], 1.0 if own == name else _MIRROR)
        offsets[joint] = mirrored
    return Skeleton(NAMES, np.array(PARENTS, dtype=np.intp), offsets * STATURE_M)


def read_body_model(path: str | Path, betas: Floats) -> Skeleton:
    """The skeleton of a person, of a model's .npz file and shape parameters.

    Parameters
    ----------
    path : file with v_template, shapedirs and J_regressor (SMPL+H as .npz)
    betas : shape parameters; as many are used as both have

    Raises
    ------
    UnreadableFile
        If the file is missing or holds no such model.
    """
    path = Path(path)
    model = read_npz(path)
    try:
        n = min(len(betas), model["shapedirs"].shape[2])
        vertices = model["v_template"] + model["shapedirs"][:, :, :n] @ betas[:n]
        joints = (model["J_regressor"] @ vertices)[:N_BODY].astype(np.float64)
    except (KeyError, ValueError, IndexError) as error:
        raise UnreadableFile(
            f"{path.name}: is no body model; expected v_template, shapedirs and J_regressor"
        ) from error
    if joints.shape != (N_BODY, 3) or not np.isfinite(joints).all():
        raise UnreadableFile(f"{path.name}: the body model gives no {N_BODY} joints")
    skeleton = average_skeleton()
    offsets = skeleton.offsets.copy()
    for joint in range(N_BODY):
        parent = PARENTS[joint]
        offsets[joint] = joints[joint] - (joints[parent] if parent >= 0 else 0)
    return Skeleton(skeleton.names, skeleton.parents, offsets)
