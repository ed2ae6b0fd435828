"""Pose parameters of SMPL models (AMASS, AIST++).

Parameters are turns of joints, not places: without the model's file they move a skeleton
of our own, with the average proportions of Drillis and Contini (1966) as fractions of the
stature. Features scale with the body, so they hardly change; with `body_model=` the
person's own joints are used. AMASS has z up and metres.

Files write a turn as a rotation vector (radians, by mistake degrees), as a matrix of nine
numbers, as six of them (two columns, or two rows), or as a unit quaternion with w first or last.
Numbers of matrices are orthonormal, quaternions have length one; what is neither are vectors.
Whether six numbers in sequence are rows or columns no value tells: a knee bends but one way.

Conventions: in the rest pose the body stands in a T, y up, looking along z, its left at +x.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.formats.content import RATE_HINT, FileContent, place_joints
from motionary.io.formats.npz import ArchivedArrays, Array
from motionary.io.normalise.units import FileMetadata, metres_per_unit
from motionary.io.options import ReadOptions
from motionary.motion import Skeleton
from motionary.rotations import Floats, matrices_to_quaternions, rotation_vectors_to_quaternions
from motionary.skeletons import named_mapping

N_BODY = 22
STATURE_M = 1.70

#: Joints of the body, and three ends that move with them.
NAMES = (*named_mapping("smpl").order[:N_BODY], "left_hand", "right_hand", "head_top")
PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21, 15)

# Fractions of the stature: aside (left), up, forward, from the parent.
_PROPORTIONS = {
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

# The body is in metres; a unit concerns the places of its root only.
_AMASS = FileMetadata(
    "m", usual_up="z", by_definition=True, origin="AMASS", noted=("up",), takes_unit=False
)


# Farther away from the origin, at their median, walks none who is recorded in metres.
_FAR_M = 50.0

_TOLERANCE = 2e-2
_LOOKED_AT = 200
# A joint turns by less than half a turn; vectors that were never wrapped may go on a while.
_LARGEST_RAD = 2 * np.pi
_MANY = 0.05
_LEFT_KNEE, _RIGHT_KNEE = 4, 5


class Pose(NamedTuple):
    """Parameters of a motion, and notes on how they are written.

    Turns are unit quaternions wxyz, (frames, 22, 4); the root has shape (frames, 3).
    """

    turns: Floats
    root: Floats
    notes: tuple[str, ...] = ()


class Source(NamedTuple):
    """Names under which programs keep turns (in sequence) and places, and how they stand."""

    turns: tuple[str, ...]
    root: tuple[str, ...]
    metadata: FileMetadata
    note: str = ""


# Video tools see a person from the camera: y points down, and so does the body.
_CAMERA = FileMetadata(
    "m", usual_up="-y", by_definition=True, origin="the camera", noted=("up",), takes_unit=False
)
_VIDEO = FileMetadata("m", usual_up="y", origin="the tool", noted=("up",), takes_unit=False)
_SEEN = "places are as the camera sees them; it may move"
#: How 322 parameters a frame of Motion-X hold it.
MOTION_X = Source(("global_orient", "body_pose"), ("transl",), _VIDEO)
_SOURCES = (
    Source(("poses",), ("trans",), _AMASS),
    Source(("root_orient", "pose_body"), ("trans",), _AMASS),
    Source(("pose_aa",), ("trans", "root_trans_offset", "root_trans"), _AMASS),
    Source(("smpl_thetas",), ("cam_trans",), _CAMERA, _SEEN),
    Source(("global_orient", "body_pose"), ("pred_cam_t", "cam_trans"), _CAMERA, _SEEN),
    Source(("global_orient", "body_pose"), ("transl", "trans"), _VIDEO),
    Source(("global_orient", "body_pose"), (), _CAMERA, "holds no places: the pelvis rests"),
)


def find_source(arrays: Mapping[str, Array]) -> Source | None:
    """How arrays hold a motion of an SMPL body; None if they hold none."""
    for source in _SOURCES:
        root = next((name for name in source.root if name in arrays), None)
        if all(name in arrays for name in source.turns) and (root or not source.root):
            return source._replace(root=(root,) if root else ())
    return None


def read_smpl_arrays(
    arrays: Mapping[str, Array], source: Source, *, rate_hz: float | None, options: ReadOptions
) -> FileContent:
    """Content of arrays of an SMPL body; a unit that is given is that of the root's places."""
    if rate_hz is None:
        raise InvalidInput(f"holds no frame rate; {RATE_HINT}")
    turns = [arrays[name] for name in source.turns]
    root = arrays[source.root[0]] if source.root else np.zeros((len(turns[0]), 3))
    pose = check_pose(turns, root)
    metres = 1.0 if options.unit is None else metres_per_unit(options.unit)
    pose = pose._replace(root=pose.root * metres)
    skeleton = None
    if options.body_model is not None:
        betas = arrays.get("betas", np.zeros(0)).astype(np.float64).ravel()
        skeleton = read_body_model(options.body_model, betas)
    pose = pose._replace(notes=(*[source.note][: bool(source.note)], *pose.notes))
    return pose_content(pose, rate_hz=rate_hz, metadata=source.metadata, skeleton=skeleton)


def check_pose(parts: Sequence[Array], trans: Array) -> Pose:
    """The pose of turns of the root and of further joints, in their sequence, and of its places."""
    shapes = f"{', '.join(str(part.shape) for part in parts)} and {trans.shape}"
    trans = trans.reshape(-1, 3) if trans.shape[1:] == (1, 3) else trans
    n_frames = len(trans) if trans.ndim == 2 and trans.shape[1] == 3 else 0
    fits = all(part.ndim in (2, 3, 4) and len(part) == n_frames for part in parts)
    if not fits or not n_frames:
        raise UnreadableFile(
            f"expected poses (frames, {3 * N_BODY} or more) and trans (frames, 3) of the "
            f"same frames, got {shapes}"
        )
    if any(array.dtype.kind not in "fiu" for array in (*parts, trans)):
        raise UnreadableFile("poses and trans must be numbers")
    sizes = {_numbers_per_joint(part) for part in parts}
    numbers = np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1)
    numbers, root = numbers.astype(np.float64), trans.astype(np.float64)
    if numbers.shape[1] < 3 * N_BODY:
        raise UnreadableFile(f"expected poses (frames, {3 * N_BODY} or more), got {shapes}")
    # NaN compares as False.
    if not ((np.abs(numbers) < _MOST).all() and (np.abs(root) < _MOST).all()):
        raise UnreadableFile("poses and trans must be finite, and of possible size")
    turns = _read_turns(numbers, sizes.pop() if len(sizes) == 1 else None)
    return Pose(turns.quaternions, root, turns.notes)


def _numbers_per_joint(part: Array) -> int | None:
    """As the shape says, such as (frames, joints, 3, 3); None if numbers of all joints follow."""
    if part.ndim == 4 and part.shape[2:] == (3, 3):
        return 9
    known = part.ndim == 3 and part.shape[2] in (3, 4, 6, 9) and part.shape[1] != 1
    return int(part.shape[2]) if known else None


def pose_content(
    pose: Pose, *, rate_hz: float, metadata: FileMetadata, skeleton: Skeleton | None = None
) -> FileContent:
    """Forward kinematics of a pose in metres, in the file's axes; by default of average bones."""
    notes = pose.notes
    far = float(np.abs(np.median(pose.root, axis=0)).max())
    if far > _FAR_M:
        unit = "are the places in mm or cm? --unit mm (unit='mm') reads them"
        notes = (*notes, f"pelvis at {far:.0f} m: {unit}")
    if skeleton is None:
        skeleton = average_skeleton()
        notes = (*notes, f"proportions of an average body of {STATURE_M:.2f} m")
    rotations = np.zeros((len(pose.turns), len(NAMES), 4))
    rotations[..., 0] = 1.0
    rotations[:, :N_BODY] = pose.turns
    return FileContent(
        names=NAMES,
        positions=place_joints(skeleton, rotations, pose.root),
        rate_hz=rate_hz,
        metadata=metadata,
        skeleton=skeleton,
        rotations=rotations,
        mapping=named_mapping("smpl"),
        notes=notes,
    )


def average_skeleton() -> Skeleton:
    """The skeleton that moves where no model is given."""
    offsets = np.zeros((len(NAMES), 3))
    offsets[0] = _PELVIS
    for joint, name in enumerate(NAMES[1:], start=1):
        own = name if name in _PROPORTIONS else name.replace("right", "left")
        offsets[joint] = np.multiply(_PROPORTIONS[own], 1.0 if own == name else _MIRROR)
    return Skeleton(NAMES, np.array(PARENTS, dtype=np.intp), offsets * STATURE_M)


def read_body_model(path: str | Path, betas: Floats) -> Skeleton:
    """The skeleton of a person, of a model's .npz file and shape parameters.

    Parameters
    ----------
    path : file with v_template, shapedirs and J_regressor (SMPL+H as .npz)
    betas : shape parameters; as many are used as both have
    """
    path = Path(path)
    model = ArchivedArrays(path)
    try:
        n = min(len(betas), model["shapedirs"].shape[2])
        vertices = model["v_template"] + model["shapedirs"][:, :, :n] @ betas[:n]
        joints = (model["J_regressor"] @ vertices)[:N_BODY].astype(np.float64)
    except (KeyError, ValueError, IndexError) as error:
        raise UnreadableFile(
            "is no body model; expected v_template, shapedirs and J_regressor", file=path.name
        ) from error
    if joints.shape != (N_BODY, 3) or not np.isfinite(joints).all():
        raise UnreadableFile(f"the body model gives no {N_BODY} joints", file=path.name)
    skeleton = average_skeleton()
    offsets = skeleton.offsets.copy()
    for joint in range(N_BODY):
        parent = PARENTS[joint]
        offsets[joint] = joints[joint] - (joints[parent] if parent >= 0 else 0)
    return Skeleton(skeleton.names, skeleton.parents, offsets)


# ---- turns, whichever way they are written: told by shape and value


class _Turns(NamedTuple):
    """Unit quaternions wxyz, (frames, joints, 4), and notes on how they were written."""

    quaternions: Floats
    notes: tuple[str, ...]


def _read_turns(numbers: Floats, per_joint: int | None) -> _Turns:
    """Turns of the body's joints.

    Parameters
    ----------
    numbers : array, shape (frames, numbers of all joints)
    per_joint : numbers of a joint, where the shape of the array in the file says it
    """
    some = numbers[:: 1 + len(numbers) // _LOOKED_AT]
    for size, read in _KINDS:
        if per_joint not in (None, size) or numbers.shape[1] % size:
            continue
        if numbers.shape[1] < N_BODY * size:
            continue
        wanted = numbers[:, : N_BODY * size].reshape(len(numbers), N_BODY, -1)
        turns = read(some.reshape(len(some), -1, size), wanted)
        if turns is not None:
            return turns
    shape = numbers.shape if per_joint is None else (len(numbers), "joints", per_joint)
    raise UnreadableFile(
        f"turns of shape {shape} of {N_BODY} joints or more are neither rotation "
        f"vectors (3 numbers a joint), nor matrices (9), two of their columns (6) or unit "
        "quaternions (4)"
    )


def _are_unit(vectors: Floats) -> bool:
    return bool((np.abs(np.linalg.norm(vectors, axis=-1) - 1) < _TOLERANCE).all())


def _are_square(a: Floats, b: Floats) -> bool:
    """Whether vectors are of length one and at right angles."""
    return _are_unit(a) and _are_unit(b) and bool((np.abs((a * b).sum(-1)) < _TOLERANCE).all())


# Each way to write turns: what `numbers` say if `some` of them, of all joints, fit it, else None.


def _matrices(some: Floats, numbers: Floats) -> _Turns | None:
    a, b, c = np.moveaxis(some.reshape(*some.shape[:-1], 3, 3), -2, 0)
    if not (_are_square(a, b) and (np.abs(np.cross(a, b) - c) < _TOLERANCE).all()):
        return None
    matrices = numbers.reshape(*numbers.shape[:-1], 3, 3)
    return _Turns(matrices_to_quaternions(matrices), ("turns are rotation matrices",))


def _columns_in_turn(some: Floats, numbers: Floats) -> _Turns | None:
    if not _are_square(some[..., ::2], some[..., 1::2]):
        return None
    turns = _complete(numbers[..., ::2], numbers[..., 1::2])
    return _Turns(turns, ("turns are two columns of a matrix (6 numbers), row by row",))


def _two_vectors(some: Floats, numbers: Floats) -> _Turns | None:
    if not _are_square(some[..., :3], some[..., 3:]):
        return None
    by_columns = _complete(numbers[..., :3], numbers[..., 3:])
    # About x a knee bends forward: backwards by the wrong reading, which is the inverse.
    knees = by_columns[:, [_LEFT_KNEE, _RIGHT_KNEE]]
    are_rows = bool((knees[..., 1] * np.sign(knees[..., 0])).mean() < 0)
    if are_rows:
        by_columns = by_columns * (1.0, -1.0, -1.0, -1.0)
    what = "rows" if are_rows else "columns"
    return _Turns(by_columns, (f"turns are two {what} of a matrix (6 numbers), by the knees",))


def _complete(a: Floats, b: Floats) -> Floats:
    """Quaternions of matrices by their first two columns."""
    a = a / np.linalg.norm(a, axis=-1, keepdims=True)
    b = b - (a * b).sum(-1, keepdims=True) * a
    b = b / np.linalg.norm(b, axis=-1, keepdims=True)
    return matrices_to_quaternions(np.stack((a, b, np.cross(a, b)), axis=-1))


def _quaternions(some: Floats, numbers: Floats) -> _Turns | None:
    if not _are_unit(some):
        return None
    # Most joints turn little: the largest component is the cosine.
    first, last = np.abs(numbers[..., 0]).mean(), np.abs(numbers[..., 3]).mean()
    w_is_last = bool(last > first)
    quaternions = np.roll(numbers, 1, axis=-1) if w_is_last else numbers
    quaternions = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    quaternions = np.where(quaternions[..., :1] < 0, -quaternions, quaternions)
    return _Turns(quaternions, (f"turns are quaternions, w {'last' if w_is_last else 'first'}",))


def _vectors(some: Floats, numbers: Floats) -> _Turns | None:
    lengths = np.linalg.norm(numbers[:, 1:], axis=-1)
    notes: tuple[str, ...] = ()
    if lengths.size and (lengths > _LARGEST_RAD).mean() > _MANY:
        numbers = np.radians(numbers)
        notes = (f"turns are in degrees, by their size (up to {lengths.max():.0f})",)
    return _Turns(rotation_vectors_to_quaternions(numbers), notes)


# By the numbers of a joint.
_KINDS = (
    (9, _matrices),
    (6, _columns_in_turn),
    (6, _two_vectors),
    (4, _quaternions),
    (3, _vectors),
)
