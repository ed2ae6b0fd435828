"""How the points of a posed body move when its joints turn, it moves, or its shape changes.

Conventions: a joint's turn R becomes R exp([t]) with small t in its own axes. Columns: three
for each joint, three of the root's place, one for each direction of the shape.
"""

import numpy as np
from numpy.typing import NDArray

from motionary.body.chain import Pose
from motionary.body.model import Body, Points
from motionary.errors import InvalidInput
from motionary.matching.distance import Engine, load_twin

Floats = NDArray[np.float64]

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
