"""Linear blend skinning: where the points of a body are in its poses.

A point is the weighted mean of where its bones carry it; for all points and poses together
that is one product of matrices.
"""

import numpy as np
from numpy.typing import NDArray

from motionary.body.chain import Pose
from motionary.body.model import Body, Points
from motionary.errors import InvalidInput

Floats = NDArray[np.float64]


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
