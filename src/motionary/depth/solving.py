"""Steps of Gauss-Newton on a body's twists, in NumPy: what `_fitting_compiled` has as machine code.

Pulls on a vertex are nine numbers: the six of a symmetric matrix W, and W times the way to go.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motionary.rotations import (
    matrices_to_rotation_vectors,
    rotation_vectors_to_matrices,
)

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]


def place(parents: Indices, joints: Floats, turns: Floats, root: Floats) -> tuple[Floats, Floats]:
    """Global turns and places of the joints of one pose."""
    turned, placed = np.empty_like(turns), np.empty_like(joints)
    for joint, parent in enumerate(parents):
        if parent < 0:
            turned[joint], placed[joint] = turns[joint], root
        else:
            turned[joint] = turned[parent] @ turns[joint]
            placed[joint] = placed[parent] + turned[parent] @ (joints[joint] - joints[parent])
    return turned, placed


def skin(
    joints: Floats, rest: Floats, bones: Indices, weights: Floats, turned: Floats, placed: Floats
) -> Floats:
    """Places of all vertices of one pose."""
    steps = placed - np.einsum("jik,jk->ji", turned, joints)
    result = np.zeros_like(rest)
    for bone, weight in zip(bones.T, weights.T, strict=True):
        result += weight[:, None] * (np.einsum("vij,vj->vi", turned[bone], rest) + steps[bone])
    return result


def fit(
    body: tuple[Indices, Floats, Floats, Indices, Floats],
    cover: tuple[Indices, Floats, Indices, Indices],
    scene: tuple[Floats, Floats, tuple[Floats, Floats, Floats]],
    prior: tuple[Floats, Floats],
    numbers: tuple[float, float, float, float, float, float, float],
    steps: int,
    turns: Floats,
    root: Floats,
) -> Mask:
    """All steps of a fit, turns and root in place; which vertices the camera sees.

    Parameters
    ----------
    body : parents, joints and surface at rest, bones and weights of its vertices
    cover : of the vertices: the bone that owns each, normals at rest; joints that turn; vertices
        that pull
    scene : points, cleaned image, camera as from `unpack_camera`
    prior : mean and precision
    numbers : scale, along, outward, prior and damping of `SurfaceSettings`; what is so much nearer
        hides; the fit ends where nothing changes by as much, in metres or radians
    steps : at most
    turns, root : the pose
    """
    parents, joints, rest, bones, weights = body
    owners, normals, active, pulling = cover
    points, depth, eye = scene
    scale, along, outward, weight, damping, hiding, least = numbers
    for _ in range(steps):
        turned, placed = place(parents, joints, turns, root)
        vertices = skin(joints, rest, bones, weights, turned, placed)
        facing, visible = see(vertices, turned, owners, normals, eye, depth, hiding)
        pulls = pair(vertices, facing, visible, pulling, points, (scale, along, outward))
        system, slope = gather(parents, bones, weights, active, placed, vertices, pulls)
        hold(parents, active, turns, turned, prior, weight, system, slope)
        system[np.diag_indices(len(system))] += damping
        change = solve(system, slope)
        move(parents, active, turned, change, turns, root)
        if np.abs(change).max() < least:
            break
    return visible


def see(
    vertices: Floats,
    turned: Floats,
    owners: Indices,
    normals: Floats,
    eye: tuple[Floats, Floats, Floats],
    depth: Floats,
    hiding: float,
) -> tuple[Floats, Mask]:
    """Normals of vertices in a pose, and which face the camera with nothing measured before them.

    `owners` are bones with which `normals` at rest turn, `eye` is from `unpack_camera`; what is
    measured by `hiding` nearer than a vertex hides it.
    """
    lens, turn, position = eye
    facing = np.einsum("vij,vj->vi", turned[owners], normals)
    away = vertices - position
    seen = away @ turn
    visible = ((facing * away).sum(axis=1) < 0) & (seen[:, 2] > 0)
    flat = np.rint(seen[:, :2] / np.where(visible, seen[:, 2], 1.0)[:, None] * lens[:2] + lens[2:])
    height, width = depth.shape
    inside = visible & (flat >= 0).all(axis=1) & (flat < (width, height)).all(axis=1)
    column, row = flat[inside].astype(np.intp).T
    with np.errstate(invalid="ignore"):
        visible[inside] &= ~(depth[row, column] < seen[inside, 2] - hiding)
    return facing, visible


def pair(
    vertices: Floats,
    facing: Floats,
    visible: Mask,
    pulling: Indices,
    points: Floats,
    weighing: Sequence[float],
) -> Floats:
    """Pulls of points on their nearest visible vertices, and of vertices on points, by vertex.

    Of each vertex the sum of weight * (along + (1 - along) normal normal^T), six numbers, and of
    this times the way to the point, three. `weighing` is scale, along and outward of
    `SurfaceSettings`.
    """
    from scipy.spatial import cKDTree

    scale, along, outward = weighing
    n, seen = len(vertices), np.flatnonzero(visible)
    if not len(seen):
        return np.zeros((n, 9))
    distances, nearest = cKDTree(vertices[seen]).query(points)
    v = seen[nearest]
    pulls = sum_pulls(n, v, 1 / (1 + (distances / scale) ** 2), along, facing, points - vertices[v])
    own = pulling[visible[pulling]]
    if len(own):
        far, which = cKDTree(points).query(vertices[own])
        weight = outward * len(points) / len(own) / (1 + (far / scale) ** 2)
        pulls += sum_pulls(n, own, weight, 1.0, facing, points[which] - vertices[own])
    return pulls


def sum_pulls(
    n: int, v: Indices, weight: Floats, along: float, facing: Floats, ways: Floats
) -> Floats:
    """Pulls of weight * (along + (1 - along) normal normal^T) by vertex, shape (n, 9)."""
    result = np.zeros((n, 9))
    normals = facing[v]
    across = weight * (1 - along)
    ahead = across * (normals * ways).sum(axis=1)
    for column, (i, k) in enumerate(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))):
        value = across * normals[:, i] * normals[:, k] + (weight * along if i == k else 0.0)
        result[:, column] = np.bincount(v, value, n)
    for i in range(3):
        result[:, 6 + i] = np.bincount(v, weight * along * ways[:, i] + ahead * normals[:, i], n)
    return result


def gather(
    parents: Indices,
    bones: Indices,
    weights: Floats,
    active: Indices,
    placed: Floats,
    vertices: Floats,
    pulls: Floats,
) -> tuple[Floats, Floats]:
    """The normal equations of pulls on vertices: system (columns, columns) and slope."""
    used = np.flatnonzero(pulls[:, 0] + pulls[:, 3] > 0)
    places, m, above = vertices[used], len(active), _list_above(parents, active)
    carried = np.zeros((len(used), m))
    for bone, weight in zip(bones[used].T, weights[used].T, strict=True):
        carried += weight[:, None] * above[bone]
    # Joint k turns vertex v by a_vk w x (x_v - p_k); a_vk sums the weights below it.
    arms = carried[..., None] * (places[:, None] - placed[active])
    rows = np.zeros((len(used), 3, m, 3))
    for i, k, j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        rows[:, i, :, k], rows[:, k, :, i] = arms[..., j], -arms[..., j]
    rows = np.concatenate(
        [np.tile(np.eye(3), (len(used), 1, 1)), rows.reshape(len(used), 3, 3 * m)], axis=2
    )
    full = pulls[used][:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    flat = rows.reshape(-1, rows.shape[2])
    system: Floats = flat.T @ (full @ rows).reshape(flat.shape)
    slope: Floats = flat.T @ pulls[used, 6:].ravel()
    return system, slope


def _list_above(parents: Indices, active: Indices) -> Mask:
    """Whether each active joint turns what is fixed to each bone, shape (joints, active)."""
    above = np.zeros((len(parents), len(active)), dtype=bool)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            above[joint] = above[parent]
        above[joint, active == joint] = True
    return above


def hold(
    parents: Indices,
    active: Indices,
    turns: Floats,
    turned: Floats,
    prior: tuple[Floats, Floats],
    weight: float,
    system: Floats,
    slope: Floats,
) -> None:
    """Add the prior over rotation vectors to the system."""
    mean, precision = prior
    vectors = matrices_to_rotation_vectors(turns[active[1:]])
    ways = np.zeros((len(mean), len(mean)))
    for k, (joint, r) in enumerate(zip(active[1:], vectors, strict=True)):
        part = slice(3 * k, 3 * k + 3)
        ways[part, part] = _left(r) @ turned[parents[joint]].T
    pulled = precision @ ways
    system[6:, 6:] += weight * (ways.T @ pulled)
    slope[6:] -= weight * (pulled.T @ (vectors.ravel() - mean))


def _left(r: Floats) -> Floats:
    """How a rotation vector changes by a small turn before it: the inverse left Jacobian."""
    angle = float(np.linalg.norm(r))
    factor = 1 / 12
    if angle >= 1e-4:
        factor = 1 / angle**2 - (1 + np.cos(angle)) / (2 * angle * np.sin(angle))
    cross = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
    result: Floats = np.eye(3) - 0.5 * cross + factor * (cross @ cross)
    return result


def move(
    parents: Indices, active: Indices, turned: Floats, change: Floats, turns: Floats, root: Floats
) -> None:
    """Turn and move a pose by a solution of the system."""
    root += change[:3]
    small = rotation_vectors_to_matrices(change[3:].reshape(-1, 3))
    for joint, turn in zip(active, small, strict=True):
        before = np.eye(3) if parents[joint] < 0 else turned[parents[joint]]
        turns[joint] = before.T @ turn @ before @ turns[joint]


def solve(system: Floats, slope: Floats) -> Floats:
    """Solution of a positive definite system."""
    return np.asarray(np.linalg.solve(system, slope), dtype=np.float64)
