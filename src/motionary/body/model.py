"""A body: a skinned mesh of a person, its shapes, poses, skinned points, and their derivatives.

Points are blended linearly: each is the weighted mean of where its bones carry it, for all points
and poses one product of matrices.

Conventions: metres, y up, facing +z, its left side at +x. At rest the arms hang at 45 degrees.
Joints lie where their bone starts; parents come before children. Turns are relative to rest, so
that all of them are identity there. Derivatives are of a joint's turn R that becomes R exp([t])
with small t in its own axes. Their columns: three for each joint, three of the root's place, one
for each direction of the shape.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.assets import read_body
from motionary.matching.distance import Engine, load_twin

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Ends of the body that have no joint, in the sequence of `Body.ends`.
ENDS = ("headtop", "lfingers", "rfingers", "ltoes", "rtoes")
#: Beyond these a shape is no person's: the directions are linear and add up.
MOST_SHAPE = {"gender": 1.0, "muscle": 1.0, "weight": 1.0, "height": 0.6, "age": 1.0}
_COMPILED = "motionary.body._compiled"
# From so many points on the compiled twin is worth the half second that loading it takes.
_PAYS = 4000


class Points(NamedTuple):
    """Points that move with bones: what skinning and its derivatives need of each.

    `rest` (points, 3) in metres, `bones` and `weights` (points, influences), `shapes`
    (directions, points, 3).
    """

    rest: Floats
    bones: Indices
    weights: Floats
    shapes: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A skinned mesh at rest; equal to itself only, as arrays have no one equality.

    Attributes
    ----------
    names, parents : of the joints; the parent's index, -1 for the root
    joints : array, shape (joints, 3), metres
    surface : the vertices
    faces : array, shape (triangles, 3), counter-clockwise seen from outside
    shape_names : of the directions in which the shape may vary
    joint_shapes : array, shape (directions, joints, 3), what one of each does to the joints
    ends : vertices of `ENDS`
    """

    names: tuple[str, ...]
    parents: Indices
    joints: Floats
    surface: Points
    faces: Indices
    shape_names: tuple[str, ...]
    joint_shapes: Floats
    ends: Indices

    def __post_init__(self) -> None:
        n, n_vertices = len(self.names), len(self.surface.rest)
        if self.parents[0] != -1 or not np.all(
            (self.parents[1:] >= 0) & (self.parents[1:] < np.arange(1, n))
        ):
            raise InvalidInput(
                "joints of a body need one root, first, and parents before children, got parents "
                f"{self.parents.tolist()}; a cycle or a second root is none"
            )
        if self.joints.shape != (n, 3) or not np.isfinite(self.joints).all():
            raise InvalidInput(
                f"{n} joints need finite places ({n}, 3), got {self.joints.shape}"
                + (" with NaN" if np.isnan(self.joints).any() else "")
            )
        sums = self.surface.weights.sum(axis=1)
        if not np.all(np.abs(sums - 1) <= 1e-6):
            worst = int(np.argmax(np.abs(sums - 1)))
            raise InvalidInput(
                f"weights of each vertex must sum to 1, those of vertex {worst} sum to "
                f"{sums[worst]:.6g}; divide them by their sum"
            )
        for what, index, most in (
            ("bones", self.surface.bones, n),
            ("faces", self.faces, n_vertices),
        ):
            if index.size and not 0 <= index.min() <= index.max() < most:
                raise InvalidInput(
                    f"{what} must be between 0 and {most - 1}, got {index.min()} to {index.max()}"
                )

    def __repr__(self) -> str:
        return f"Body({len(self.surface.rest)} vertices, {len(self.names)} joints)"

    @property
    def vertices(self) -> Floats:
        """Places of the vertices at rest, shape (vertices, 3)."""
        return self.surface.rest

    def index(self, joint: str) -> int:
        """Index of a joint by its name."""
        if joint not in self.names:
            raise InvalidInput(f"the body has no joint {joint!r}; it has {', '.join(self.names)}")
        return self.names.index(joint)

    def shaped(self, shape: Mapping[str, float]) -> "Body":
        """The body with another shape, told from the mean adult, such as {"height": 0.3}."""
        for name, amount in shape.items():
            if name not in self.shape_names:
                raise InvalidInput(
                    f"the body has no shape {name!r}; it has {', '.join(self.shape_names)}"
                )
            if not abs(amount) <= MOST_SHAPE.get(name, 1.0):
                raise InvalidInput(
                    f"{name} must be within ±{MOST_SHAPE.get(name, 1.0):g}, got {amount:g}: beyond "
                    "that nobody is built like it"
                )
        amounts = np.array([shape.get(name, 0.0) for name in self.shape_names])
        return replace(
            self,
            joints=self.joints + np.tensordot(amounts, self.joint_shapes, 1),
            surface=self.surface._replace(
                rest=self.surface.rest + np.tensordot(amounts, self.surface.shapes, 1)
            ),
        )

    def points(self, vertices: Indices | None = None) -> Points:
        """Some vertices, or all of them, as points."""
        if vertices is None:
            return self.surface
        rest, bones, weights, shapes = self.surface
        return Points(rest[vertices], bones[vertices], weights[vertices], shapes[:, vertices])

    def joint_points(self) -> Points:
        """The joints as points: each moves with the bone of its parent."""
        bones = np.maximum(self.parents, 0)[:, None]
        return Points(self.joints, bones, np.ones((len(bones), 1)), self.joint_shapes)


def load_body(*, fine: bool = False) -> Body:
    """The body that ships, a mean adult of 1.66 m; some 6000 vertices if `fine`, else 1200."""
    arrays = read_body(fine=fine)
    return Body(
        names=tuple(map(str, arrays["names"])),
        parents=arrays["parents"].astype(np.intp),
        joints=arrays["joints"],
        surface=Points(
            arrays["vertices"].astype(np.float64),
            arrays["bones"].astype(np.intp),
            arrays["weights"],
            arrays["shapes"].astype(np.float64),
        ),
        faces=arrays["faces"].astype(np.intp),
        shape_names=tuple(map(str, arrays["shape_names"])),
        joint_shapes=arrays["joint_shapes"],
        ends=arrays["ends"].astype(np.intp),
    )


def sum_normals(vertices: Floats, faces: Indices) -> Floats:
    """Normals of the triangles around each vertex, as long as twice their areas, summed."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    result = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(result, faces[:, corner], across)
    return result


# ---- poses


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


# ---- skinning


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


# ---- derivatives


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
