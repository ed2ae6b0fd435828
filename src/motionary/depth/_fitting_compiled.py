"""Compiled steps of a pose's fit, behind the extra `fast`: twins of `solving`."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from motionary.depth._compiled import pair, see

__all__ = ["fit", "place", "skin"]

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


@njit(cache=True, error_model="numpy")
def place(parents: Indices, joints: Floats, turns: Floats, root: Floats) -> tuple[Floats, Floats]:
    """Global turns and places of the joints of one pose."""
    turned, placed = np.empty_like(turns), np.empty_like(joints)
    for joint in range(len(parents)):
        parent = parents[joint]
        if parent < 0:
            for i in range(3):
                placed[joint, i] = root[i]
                for k in range(3):
                    turned[joint, i, k] = turns[joint, i, k]
            continue
        for i in range(3):
            placed[joint, i] = placed[parent, i]
            for k in range(3):
                placed[joint, i] += turned[parent, i, k] * (joints[joint, k] - joints[parent, k])
                total = 0.0
                for m in range(3):
                    total += turned[parent, i, m] * turns[joint, m, k]
                turned[joint, i, k] = total
    return turned, placed


@njit(cache=True, error_model="numpy")
def skin(
    joints: Floats, rest: Floats, bones: Indices, weights: Floats, turned: Floats, placed: Floats
) -> Floats:
    """Places of all vertices of one pose."""
    steps = placed.copy()
    for joint in range(len(joints)):
        for i in range(3):
            for k in range(3):
                steps[joint, i] -= turned[joint, i, k] * joints[joint, k]
    result = np.zeros_like(rest)
    for v in range(len(rest)):
        for influence in range(bones.shape[1]):
            weight = weights[v, influence]
            if weight == 0.0:
                continue
            bone = bones[v, influence]
            for i in range(3):
                result[v, i] += weight * (
                    turned[bone, i, 0] * rest[v, 0]
                    + turned[bone, i, 1] * rest[v, 1]
                    + turned[bone, i, 2] * rest[v, 2]
                    + steps[bone, i]
                )
    return result


@njit(cache=True, error_model="numpy")
def fit(
    body: tuple[Indices, Floats, Floats, Indices, Floats],
    cover: tuple[Indices, Floats, Indices, Indices],
    scene: tuple[Floats, Floats, tuple[Floats, Floats, Floats]],
    prior: tuple[Floats, Floats],
    numbers: tuple[float, float, float, float, float, float, float],
    steps: int,
    turns: Floats,
    root: Floats,
) -> NDArray[np.bool_]:
    """All steps of a fit, turns and root in place; see `solving.fit`."""
    parents, joints, rest, bones, weights = body
    owners, normals, active, pulling = cover
    points, depth, eye = scene
    scale, along, outward, weight, damping, hiding, least = numbers
    # Points do not move: they are sorted once.
    ranked = points[np.argsort(points[:, 1])]
    for _ in range(steps):
        turned, placed = place(parents, joints, turns, root)
        vertices = skin(joints, rest, bones, weights, turned, placed)
        facing, visible = see(vertices, turned, owners, normals, eye, depth, hiding)
        pulls = pair(vertices, facing, visible, pulling, ranked, (scale, along, outward))
        system, slope = gather(parents, bones, weights, active, placed, vertices, pulls)
        hold(parents, active, turns, turned, prior, weight, system, slope)
        for i in range(len(slope)):
            system[i, i] += damping
        change = solve(system, slope)
        move(parents, active, turned, change, turns, root)
        if np.abs(change).max() < least:
            break
    return visible


@njit(cache=True, error_model="numpy")
def gather(
    parents: Indices,
    bones: Indices,
    weights: Floats,
    active: Indices,
    placed: Floats,
    vertices: Floats,
    pulls: Floats,
) -> tuple[Floats, Floats]:
    """The normal equations of pulls; see `solving.gather`.

    Pulls are summed by pairs of bones as 6 x 6 matrices on their twists, then over subtrees.
    """
    n = len(parents)
    sums, sides = np.zeros((n, n, 6, 6)), np.zeros((n, 6))
    own, side, full, a = np.empty((6, 6)), np.empty(6), np.empty((3, 3)), np.empty(3)
    for v in range(len(vertices)):
        if pulls[v, 0] == 0.0 and pulls[v, 3] == 0.0:
            continue
        for i in range(3):
            a[i] = vertices[v, i] - placed[0, i]
        full[0, 0], full[0, 1], full[0, 2] = pulls[v, 0], pulls[v, 1], pulls[v, 2]
        full[1, 0], full[1, 1], full[1, 2] = pulls[v, 1], pulls[v, 3], pulls[v, 4]
        full[2, 0], full[2, 1], full[2, 2] = pulls[v, 2], pulls[v, 4], pulls[v, 5]
        for i in range(3):
            for k in range(3):
                own[i, k] = full[i, k]
            # What a turn moves the point by is turn x a: times -[a].
            own[i, 3] = full[i, 2] * a[1] - full[i, 1] * a[2]
            own[i, 4] = full[i, 0] * a[2] - full[i, 2] * a[0]
            own[i, 5] = full[i, 1] * a[0] - full[i, 0] * a[1]
            side[i] = pulls[v, 6 + i]
        for k in range(6):
            own[3, k] = a[1] * own[2, k] - a[2] * own[1, k]
            own[4, k] = a[2] * own[0, k] - a[0] * own[2, k]
            own[5, k] = a[0] * own[1, k] - a[1] * own[0, k]
        side[3] = a[1] * side[2] - a[2] * side[1]
        side[4] = a[2] * side[0] - a[0] * side[2]
        side[5] = a[0] * side[1] - a[1] * side[0]
        for one in range(bones.shape[1]):
            of_one = weights[v, one]
            if of_one == 0.0:
                continue
            for i in range(6):
                sides[bones[v, one], i] += of_one * side[i]
            for other in range(bones.shape[1]):
                weight = of_one * weights[v, other]
                if weight != 0.0:
                    block = sums[bones[v, one], bones[v, other]]
                    for i in range(6):
                        for k in range(6):
                            block[i, k] += weight * own[i, k]
    _sum_subtrees(parents, sums, sides)
    return _to_columns(sums, sides, active, placed)


@njit(cache=True, error_model="numpy")
def _sum_subtrees(parents: Indices, sums: Floats, sides: Floats) -> None:
    """Sums of bones as sums of the subtrees below them, in place."""
    n = len(parents)
    for joint in range(n - 1, 0, -1):
        for i in range(6):
            sides[parents[joint], i] += sides[joint, i]
            for other in range(n):
                for k in range(6):
                    sums[parents[joint], other, i, k] += sums[joint, other, i, k]
    for joint in range(n - 1, 0, -1):
        for other in range(n):
            for i in range(6):
                for k in range(6):
                    sums[other, parents[joint], i, k] += sums[other, joint, i, k]


@njit(cache=True, error_model="numpy")
def _to_columns(
    sums: Floats, sides: Floats, active: Indices, placed: Floats
) -> tuple[Floats, Floats]:
    """Blocks on twists of subtrees as the system of the root's step and the joints' turns."""
    m = len(active)
    size = 3 + 3 * m
    system, slope = np.zeros((size, size)), np.zeros(size)
    twists = np.zeros((m + 1, 6, 3))
    which = np.zeros(m + 1, np.intp)
    for i in range(3):
        twists[0, i, i] = 1.0
    for k in range(m):
        which[k + 1] = active[k]
        x = placed[active[k], 0] - placed[0, 0]
        y = placed[active[k], 1] - placed[0, 1]
        z = placed[active[k], 2] - placed[0, 2]
        block = twists[k + 1]
        block[0, 1], block[0, 2], block[1, 2] = -z, y, -x
        block[1, 0], block[2, 0], block[2, 1] = z, -y, x
        block[3, 0] = block[4, 1] = block[5, 2] = 1.0
    half = np.empty((6, 3))
    for one in range(m + 1):
        for i in range(3):
            for r in range(6):
                slope[3 * one + i] += twists[one, r, i] * sides[which[one], r]
        for other in range(one, m + 1):
            block = sums[which[one], which[other]]
            for r in range(6):
                for k in range(3):
                    half[r, k] = 0.0
                    for c in range(6):
                        half[r, k] += block[r, c] * twists[other, c, k]
            for i in range(3):
                for k in range(3):
                    total = 0.0
                    for r in range(6):
                        total += twists[one, r, i] * half[r, k]
                    system[3 * one + i, 3 * other + k] = total
                    system[3 * other + k, 3 * one + i] = total
    return system, slope


@njit(cache=True, error_model="numpy")
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
    """Add the prior over rotation vectors to the system; see `solving.hold`."""
    mean, precision = prior
    m = len(active) - 1
    away, ways = np.empty(3 * m), np.zeros((m, 3, 3))
    own = np.empty((3, 3))
    for k in range(m):
        joint = active[k + 1]
        before = turned[parents[joint]]
        logarithm(turns[joint], away, 3 * k)
        _left(away[3 * k], away[3 * k + 1], away[3 * k + 2], own)
        for i in range(3):
            for c in range(3):
                for r in range(3):
                    ways[k, i, c] += own[i, r] * before[c, r]
    for i in range(3 * m):
        away[i] -= mean[i]
    half = np.empty((3, 3))
    for one in range(m):
        for other in range(m):
            for i in range(3):
                for c in range(3):
                    half[i, c] = 0.0
                    for r in range(3):
                        half[i, c] += precision[3 * one + i, 3 * other + r] * ways[other, r, c]
            for i in range(3):
                ahead = 0.0
                for r in range(3):
                    ahead += precision[3 * one + i, 3 * other + r] * away[3 * other + r]
                for c in range(3):
                    slope[6 + 3 * one + c] -= weight * ways[one, i, c] * ahead
                    for r in range(3):
                        system[6 + 3 * one + c, 6 + 3 * other + r] += (
                            weight * ways[one, i, c] * half[i, r]
                        )


@njit(cache=True, error_model="numpy")
def logarithm(turn: Floats, out: Floats, at: int) -> None:
    """Rotation vector of a matrix."""
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    sine = 0.5 * np.sqrt(x * x + y * y + z * z)
    angle = np.arctan2(sine, 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0))
    factor = 0.5 if sine < 1e-6 else 0.5 * angle / sine
    out[at], out[at + 1], out[at + 2] = factor * x, factor * y, factor * z


@njit(cache=True, error_model="numpy")
def _left(x: float, y: float, z: float, out: Floats) -> None:
    """How a rotation vector changes by a small turn before it: the inverse left Jacobian."""
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    factor = 1.0 / 12
    if angle >= 1e-4:
        factor = 1.0 / square - (1.0 + np.cos(angle)) / (2.0 * angle * np.sin(angle))
    _series(x, y, z, -0.5, factor, out)


@njit(cache=True, error_model="numpy")
def _series(x: float, y: float, z: float, first: float, second: float, out: Floats) -> None:
    """1 + first [r] + second [r]^2."""
    out[0, 0] = 1.0 - second * (y * y + z * z)
    out[1, 1] = 1.0 - second * (x * x + z * z)
    out[2, 2] = 1.0 - second * (x * x + y * y)
    out[0, 1], out[1, 0] = second * x * y - first * z, second * x * y + first * z
    out[0, 2], out[2, 0] = second * x * z + first * y, second * x * z - first * y
    out[1, 2], out[2, 1] = second * y * z - first * x, second * y * z + first * x


@njit(cache=True, error_model="numpy")
def move(
    parents: Indices,
    active: Indices,
    turned: Floats,
    change: Floats,
    turns: Floats,
    root: Floats,
) -> None:
    """Turn and move a pose by a solution of the system; see `solving.move`."""
    for i in range(3):
        root[i] += change[i]
    turn, before, half = np.empty((3, 3)), np.zeros((3, 3)), np.empty((3, 3))
    for k in range(len(active)):
        joint = active[k]
        x, y, z = change[3 + 3 * k], change[4 + 3 * k], change[5 + 3 * k]
        square = x * x + y * y + z * z
        angle = np.sqrt(square)
        if angle < 1e-6:
            _series(x, y, z, 1.0, 0.5, turn)
        else:
            _series(x, y, z, np.sin(angle) / angle, (1.0 - np.cos(angle)) / square, turn)
        parent = parents[joint]
        for i in range(3):
            for c in range(3):
                before[i, c] = turned[parent, i, c] if parent >= 0 else 1.0 * (i == c)
        # before^T turn before, then the joint's own turn.
        _product(before, turn, before, half)
        for i in range(3):
            for c in range(3):
                turn[i, c] = 0.0
                for r in range(3):
                    turn[i, c] += half[i, r] * turns[joint, r, c]
        for i in range(3):
            for c in range(3):
                turns[joint, i, c] = turn[i, c]


@njit(cache=True, error_model="numpy")
def _product(a: Floats, b: Floats, c: Floats, out: Floats) -> None:
    """A transposed, times b, times c."""
    for i in range(3):
        for k in range(3):
            out[i, k] = 0.0
            for r in range(3):
                for s in range(3):
                    out[i, k] += a[r, i] * b[r, s] * c[s, k]


@njit(cache=True, error_model="numpy")
def solve(system: Floats, slope: Floats) -> Floats:
    """Solution of a positive definite system, by Cholesky's factors."""
    n = len(slope)
    lower, result = np.zeros((n, n)), slope.copy()
    for i in range(n):
        for k in range(i + 1):
            total = system[i, k]
            for r in range(k):
                total -= lower[i, r] * lower[k, r]
            lower[i, k] = np.sqrt(max(total, 1e-12)) if i == k else total / lower[k, k]
        for r in range(i):
            result[i] -= lower[i, r] * result[r]
        result[i] /= lower[i, i]
    for i in range(n - 1, -1, -1):
        for r in range(i + 1, n):
            result[i] -= lower[r, i] * result[r]
        result[i] /= lower[i, i]
    return result
