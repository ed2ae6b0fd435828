"""Poses of a body, its skinned points, and their derivatives.

Turns along the tree, or products of twists, after Baak (2012), section 6.2: eqs. (6.1) and (6.2).
Points are blended linearly: each is the
weighted mean of where its bones carry it, for all points and poses one product of matrices.

Conventions: turns are relative to rest, so that all of them are identity there. Derivatives are of
a joint's turn R that becomes R exp([t]) with small t in its own axes. Their columns: three for each
joint, three of the root's place, one for each direction of the shape.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body.model import Body, Points
from motionary.errors import InvalidInput
from motionary.matching.distance import Engine, load_twin
from motionary.rotations import quaternions_to_matrices, rotation_vectors_to_quaternions

Floats = NDArray[np.float64]


class Pose(NamedTuple):
    """Poses of a body.

    Attributes
    ----------
    rotations : array, shape (frames, joints, 3, 3), global turns relative to rest
    joints : array, shape (frames, joints, 3), metres
    stretches : array, shape (joints, 3, 3), by which each bone is stretched at rest; None
        if the body keeps its lengths
    """

    rotations: Floats
    joints: Floats
    stretches: Floats | None = None

    @property
    def bones(self) -> Floats:
        """Turn and stretch of each bone, shape (frames, joints, 3, 3)."""
        return self.rotations if self.stretches is None else self.rotations @ self.stretches


def pose_body(body: Body, rotations: Floats, translations: Floats | None = None) -> Pose:
    """Poses of turns that are relative to each joint's parent.

    Parameters
    ----------
    body : Body
    rotations : array, shape (frames, joints, 3, 3)
    translations : array, shape (frames, 3), metres, of the root from where it is at rest
    """
    n = len(body.names)
    if rotations.ndim != 4 or rotations.shape[1:] != (n, 3, 3):
        raise InvalidInput(
            f"a pose of {n} joints needs turns (frames, {n}, 3, 3), got {rotations.shape}"
        )
    turned = accumulate(body.parents, rotations)
    moved = 0.0 if translations is None else translations
    return place_joints(body, turned, body.joints[0] + moved * np.ones((len(rotations), 1)))


def accumulate(parents: NDArray[np.intp], rotations: Floats) -> Floats:
    """Global turns (frames, joints, 3, 3) of turns that are relative to the parents."""
    turned = np.empty(rotations.shape)
    for joint, parent in enumerate(parents):
        own = rotations[:, joint]
        turned[:, joint] = own if parent < 0 else turned[:, parent] @ own
    return turned


def place_joints(
    body: Body, turned: Floats, roots: Floats, stretches: Floats | None = None
) -> Pose:
    """The pose of global turns (frames, joints, 3, 3) and places of the root (frames, 3)."""
    joints = np.empty((*turned.shape[:2], 3))
    for joint, parent in enumerate(body.parents):
        if parent < 0:
            joints[:, joint] = roots
            continue
        step = body.joints[joint] - body.joints[parent]
        if stretches is not None:
            step = stretches[parent] @ step
        joints[:, joint] = joints[:, parent] + turned[:, parent] @ step
    return Pose(turned, joints, stretches)


def local_rotations(body: Body, pose: Pose) -> Floats:
    """Turns of a pose relative to each joint's parent, shape (frames, joints, 3, 3)."""
    parents = np.maximum(body.parents, 0)
    result: Floats = np.swapaxes(pose.rotations[:, parents], -1, -2) @ pose.rotations
    result[:, 0] = pose.rotations[:, 0]
    return result


def revolute_twists(axes: Floats, points: Floats) -> Floats:
    """Twists (..., 6) of turns about axes through points: (-axis x point, axis), as (6.1)."""
    axes = np.asarray(axes, dtype=np.float64)
    return np.concatenate([-np.cross(axes, points), axes], axis=-1)


def exponentials(twists: Floats) -> Floats:
    """Rigid motions of twists (..., 6), as matrices (..., 4, 4).

    Turns by the last three components' length; with none of them, a translation.
    """
    given = np.asarray(twists, dtype=np.float64)
    v, w = given[..., :3], given[..., 3:]
    angle = np.linalg.norm(w, axis=-1)[..., None]
    result = np.zeros((*given.shape[:-1], 4, 4))
    result[..., :3, :3] = quaternions_to_matrices(rotation_vectors_to_quaternions(w))
    # V v with V = I + (1 - cos) / a² [w] + (a - sin) / a³ [w]²; series where a is small.
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    second = np.where(small, 1 / 6 - angle**2 / 120, (safe - np.sin(safe)) / safe**3)
    once = np.cross(w, v)
    result[..., :3, 3] = v + first * once + second * np.cross(w, once)
    result[..., 3, 3] = 1.0
    return result


def pose_by_twists(body: Body, vectors: Floats, twist_of_root: Floats) -> Floats:
    """Rigid motions of all bones of one pose as products of exponentials (6.2).

    Parameters
    ----------
    body : Body
    vectors : array, shape (joints, 3), axis times angle of each joint's turn, at rest
    twist_of_root : array, shape (6,), applied to the whole body last

    Returns
    -------
    array, shape (joints, 4, 4), from rest to the pose
    """
    own = exponentials(revolute_twists(vectors, body.joints))
    result = np.empty_like(own)
    root = exponentials(twist_of_root)
    for joint, parent in enumerate(body.parents):
        result[joint] = (root if parent < 0 else result[parent]) @ own[joint]
    return result


# -- skinning -----------------------------------------------------------------------------


def blend_matrix(body: Body, points: Points | None = None) -> Floats:
    """What bones make of points: shape (points, 4 * joints).

    Four columns per joint hold the weighted place seen from the joint, and the weight.
    """
    points = points or body.surface
    n_points, n_joints = len(points.rest), len(body.names)
    result = np.zeros((n_points, n_joints, 4))
    rows = np.arange(n_points)
    for bones, weights in zip(points.bones.T, points.weights.T, strict=True):
        seen = points.rest - body.joints[bones]
        result[rows, bones, :3] += weights[:, None] * seen
        result[rows, bones, 3] += weights
    return result.reshape(n_points, 4 * n_joints)


def skin(
    body: Body,
    pose: Pose,
    points: Points | None = None,
    *,
    blend: NDArray[np.floating] | None = None,
) -> NDArray[np.floating]:
    """Places of points in each pose, shape (frames, points, 3), metres.

    Parameters
    ----------
    body : Body
    pose : Pose
    points : points of the body; its vertices if None
    blend : `blend_matrix` of these points, if it is at hand; in its precision is computed
    """
    n = len(body.names)
    if pose.rotations.shape[1:] != (n, 3, 3) or pose.joints.shape != pose.rotations.shape[:3]:
        raise InvalidInput(
            f"a pose of {n} joints needs turns (frames, {n}, 3, 3) and joints (frames, {n}, 3), "
            f"got {pose.rotations.shape} and {pose.joints.shape}"
        )
    matrix: NDArray[np.floating] = blend_matrix(body, points) if blend is None else blend
    n_frames = len(pose.joints)
    steps = np.empty((n, 4, n_frames, 3), dtype=matrix.dtype)
    steps[:, :3] = pose.bones.transpose(1, 3, 0, 2)
    steps[:, 3] = pose.joints.transpose(1, 0, 2)
    carried = matrix @ steps.reshape(4 * n, 3 * n_frames)
    return carried.reshape(len(matrix), n_frames, 3).transpose(1, 0, 2)


# -- derivatives --------------------------------------------------------------------------


_COMPILED = "motionary.body._compiled"
# From so many points on the compiled twin is worth the half second that loading it takes.
_PAYS = 4000


def jacobian(
    body: Body,
    pose: Pose,
    points: Points | None = None,
    *,
    shape: bool = False,
    engine: Engine = "auto",
) -> Floats:
    """Derivatives of points in one pose, shape (points, 3, columns).

    Parameters
    ----------
    body : Body
    pose : a single pose
    points : points of the body; its vertices if None
    shape : whether the directions of the shape have columns, too
    engine : which twin computes; "auto" takes the compiled one where it pays

    Raises
    ------
    InvalidInput
        If there are several poses.
    """
    if len(pose.joints) != 1:
        raise InvalidInput(f"derivatives need one pose, got {len(pose.joints)}; pass one at a time")
    points = points or body.surface
    turned, joints = pose.rotations[0], pose.joints[0]
    n_shapes = len(body.shape_names) if shape else 0
    out = np.zeros((len(points.rest), 3, 3 * len(joints) + 3 + n_shapes))
    kernels = load_twin(_COMPILED, engine, pays=len(points.rest) >= _PAYS)
    kernel = _turn_columns if kernels is None else kernels.turn_columns
    kernel(
        body.parents, turned, pose.bones[0], joints,
        points.rest[:, None] - body.joints[points.bones], points.bones, points.weights, out,
    )  # fmt: skip
    of_root = 3 * len(joints)
    out[:, [0, 1, 2], [of_root, of_root + 1, of_root + 2]] = 1.0
    if shape:
        out[:, :, of_root + 3 :] = _shape_columns(body, pose, points).transpose(1, 2, 0)
    return out


def _turn_columns(
    parents: NDArray[np.intp],
    turned: Floats,
    carried: Floats,
    joints: Floats,
    seen: Floats,
    bones: NDArray[np.intp],
    weights: Floats,
    out: Floats,
) -> None:
    """Columns of the joints' turns, written to `out`.

    `carried` are turns with stretches, `seen` (points, influences, 3) what the points are from
    the joints of their bones.
    """
    n_points, n_joints = len(seen), len(joints)
    # Weights and weighted places by bone, then summed over each joint's subtree.
    sums = np.zeros((n_joints, n_points, 4))
    rows = np.arange(n_points)
    for bone, weight, rest in zip(bones.T, weights.T, seen.swapaxes(0, 1), strict=True):
        place = np.einsum("nij,nj->ni", carried[bone], rest) + joints[bone]
        sums[bone, rows, :3] += weight[:, None] * place
        sums[bone, rows, 3] += weight
    for joint in range(n_joints - 1, 0, -1):
        sums[parents[joint]] += sums[joint]
    arms = sums[..., :3] - sums[..., 3:] * joints[:, None]
    for axis in range(3):
        columns = np.cross(turned[:, None, :, axis], arms)
        out[:, :, axis : 3 * n_joints : 3] = columns.transpose(1, 2, 0)


def _shape_columns(body: Body, pose: Pose, points: Points) -> Floats:
    """What one of each direction does to the points, shape (directions, points, 3)."""
    carried = pose.bones[0]
    of_joints = np.zeros_like(body.joint_shapes)
    for joint, parent in enumerate(body.parents):
        moved = body.joint_shapes[:, joint]
        if parent >= 0:
            step = (moved - body.joint_shapes[:, parent]) @ carried[parent].T
            moved = of_joints[:, parent] + step
        of_joints[:, joint] = moved
    result = np.zeros_like(points.shapes)
    for bone, weight in zip(points.bones.T, points.weights.T, strict=True):
        step = points.shapes - body.joint_shapes[:, bone]
        moved = np.einsum("nij,snj->sni", carried[bone], step) + of_joints[:, bone]
        result += weight[:, None] * moved
    return result
