"""A body's pose and shape from points seen: joints, markers or a cloud of surface points.

Robust Gauss-Newton on the Jacobian of the points, damped, with a prior that keeps what the points
do not tell where it was.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body.model import (
    MOST_SHAPE,
    Body,
    Points,
    Pose,
    jacobian,
    local_rotations,
    pose_body,
    skin,
    sum_normals,
)
from motionary.errors import InvalidInput
from motionary.rotations import (
    matrices_to_rotation_vectors,
    rotation_vectors_to_matrices,
)

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

# What one of a direction of the shape costs beside lengths, in metres.
_SHAPE_PRIOR_M = 0.3


@dataclass(frozen=True, slots=True)
class FitSettings:
    """How a fit weighs its points and what it knows beforehand.

    Attributes
    ----------
    scale_m : residuals much beyond it count little (Geman and McClure)
    turn_prior_m : a joint's turn of one radian from its start costs like so many metres
    shape_prior_m : so does one of a direction of the shape; None keeps the shape
    most_steps : after which the fit ends in any case
    """

    scale_m: float = 0.05
    turn_prior_m: float = 0.02
    shape_prior_m: float | None = None
    most_steps: int = 40


class Fit(NamedTuple):
    """A fitted body.

    `shape` tells the body that `pose` belongs to; `residuals` (points,) in metres; NaN where the
    target was not seen. `converged` is False if the last step still moved.
    """

    pose: Pose
    shape: dict[str, float]
    residuals: Floats
    converged: bool


def fit_points(
    body: Body,
    points: Points,
    targets: Floats,
    *,
    settings: FitSettings | None = None,
) -> Fit:
    """The pose in which points of the body are nearest to where they were seen.

    The search starts from the pose at rest, moved and turned onto the targets; the prior holds on
    to it.

    Parameters
    ----------
    body : Body
    points : of the body, as from `Body.points` or `Body.joint_points`
    targets : array, shape (points, 3), metres; NaN = not seen

    Raises
    ------
    InvalidInput
        If fewer than four points are seen.
    """
    settings = settings or FitSettings()
    seen = np.asarray(~np.isnan(targets).any(axis=1))
    if targets.shape != points.rest.shape or seen.sum() < 4:
        raise InvalidInput(
            f"a fit needs targets {points.rest.shape} with at least four of them seen, got "
            f"{targets.shape} with {int(seen.sum())}"
        )
    state = _State.at(body, _rigid_start(body, points, targets))
    state, converged = _descend(body, points, targets, seen, state, settings)
    residuals = np.linalg.norm(
        skin(state.body, state.pose(), state.moved(points))[0] - targets, axis=1
    )
    return Fit(state.pose(), state.shape_told(), residuals, converged)


def fit_surface(
    body: Body, cloud: Floats, *, start: Pose, settings: FitSettings | None = None, rounds: int = 12
) -> Fit:
    """The pose in which the surface is nearest to a cloud of points (n, 3), from near it.

    Each point of the cloud pulls the nearest vertex, found anew in each round.
    """
    from scipy.spatial import cKDTree

    settings = settings or FitSettings(most_steps=3)
    if cloud.ndim != 2 or cloud.shape[1] != 3 or not np.isfinite(cloud).all():
        raise InvalidInput(f"a cloud needs finite points (n, 3), got {cloud.shape}")
    state = _State.at(body, start)
    converged = False
    for _ in range(rounds):
        vertices = skin(state.body, state.pose())[0]
        nearest = cKDTree(vertices).query(cloud)[1]
        points = body.points(nearest)
        # Along the normal only: the cloud tells where the surface is, not where on it.
        normals = vertex_normals(vertices, body.faces)[nearest]
        state, converged = _descend(
            body, points, cloud, np.ones(len(cloud), dtype=bool), state, settings, normals
        )
    vertices = skin(state.body, state.pose())[0]
    distances = cKDTree(vertices).query(cloud)[0]
    return Fit(state.pose(), state.shape_told(), distances, converged)


def fit_shape(body: Body, lengths: Mapping[tuple[str, str], float]) -> dict[str, float]:
    """The shape whose distances between joints are nearest to those measured.

    Girth is not in lengths: muscle and weight stay 0.
    """
    from scipy.optimize import least_squares

    pairs = [(body.index(a), body.index(b)) for a, b in lengths]
    wanted = np.array(list(lengths.values()))
    if not len(wanted) or not np.isfinite(wanted).all() or (wanted <= 0).any():
        raise InvalidInput(
            "lengths between joints must be positive numbers of metres, at least one"
        )
    free = [k for k, name in enumerate(body.shape_names) if name not in ("muscle", "weight")]

    def residuals(amounts: Floats) -> Floats:
        joints = body.joints + np.tensordot(amounts, body.joint_shapes[free], 1)
        own = np.array([np.linalg.norm(joints[a] - joints[b]) for a, b in pairs])
        return np.concatenate([(own - wanted) / 0.02, 0.02 * amounts / _SHAPE_PRIOR_M])

    most = np.array([MOST_SHAPE[body.shape_names[k]] for k in free])
    found = least_squares(residuals, np.zeros(len(free)), bounds=(-most, most), loss="soft_l1").x
    return {body.shape_names[k]: float(amount) for k, amount in zip(free, found, strict=True)}


class _State(NamedTuple):
    """What is fitted: turns relative to the parents, the root's step, the shape."""

    mean: Body
    body: Body
    turns: Floats
    step: Floats
    shape: Floats

    @classmethod
    def at(cls, body: Body, pose: Pose) -> "_State":
        if len(pose.joints) != 1:
            raise InvalidInput(f"a fit starts from one pose, got {len(pose.joints)}")
        step = pose.joints[0, 0] - body.joints[0]
        return cls(
            body, body, local_rotations(body, pose)[0], step, np.zeros(len(body.shape_names))
        )

    def pose(self) -> Pose:
        return pose_body(self.body, self.turns[None], self.step[None])

    def moved(self, points: Points) -> Points:
        return points._replace(rest=points.rest + np.tensordot(self.shape, points.shapes, 1))

    def shape_told(self) -> dict[str, float]:
        return {n: float(v) for n, v in zip(self.mean.shape_names, self.shape, strict=True) if v}

    def stepped(self, change: Floats) -> "_State":
        n = len(self.mean.names)
        turns = rotation_vectors_to_matrices(change[: 3 * n].reshape(n, 3))
        shape = self.shape
        if len(change) > 3 * n + 3:
            most = np.array([MOST_SHAPE[name] for name in self.mean.shape_names])
            shape = np.clip(shape + change[3 * n + 3 :], -most, most)
        shaped = self.mean
        if np.any(shape):
            shaped = self.mean.shaped(dict(zip(self.mean.shape_names, shape, strict=True)))
        return _State(
            self.mean, shaped, self.turns @ turns, self.step + change[3 * n : 3 * n + 3], shape
        )


def _descend(
    body: Body,
    points: Points,
    targets: Floats,
    seen: NDArray[np.bool_],
    state: _State,
    settings: FitSettings,
    normals: Floats | None = None,
) -> tuple[_State, bool]:
    """Damped Gauss-Newton steps while they lower the cost; whether it came to rest."""
    start, damping = state, 1e-3
    cost, normal, slope = _linearise(points, targets, seen, state, start, settings, normals)
    for _ in range(settings.most_steps):
        change = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-9), slope)
        tried = state.stepped(np.asarray(change, dtype=np.float64))
        new_cost, new_normal, new_slope = _linearise(
            points, targets, seen, tried, start, settings, normals
        )
        if new_cost < cost:
            gained = cost - new_cost
            state, cost, normal, slope = tried, new_cost, new_normal, new_slope
            damping = max(damping / 5, 1e-9)
            if gained < 1e-9 * max(cost, 1e-12):
                return state, True
        elif damping > 1e6:
            return state, True
        else:
            damping *= 5
    return state, False


def _linearise(
    points: Points,
    targets: Floats,
    seen: NDArray[np.bool_],
    state: _State,
    start: _State,
    settings: FitSettings,
    normals: Floats | None,
) -> tuple[float, Floats, Floats]:
    """Cost, normal matrix and slope at a state; weights of points are those of their residuals."""
    pose, own = state.pose(), state.moved(points)
    with_shape = settings.shape_prior_m is not None
    rows = jacobian(state.body, pose, own, shape=with_shape)[seen]
    misses = (skin(state.body, pose, own)[0] - targets)[seen]
    if normals is not None:
        rows = np.einsum("nd,ndk->nk", normals[seen], rows)[:, None]
        misses = (normals[seen] * misses).sum(axis=1)[:, None]
    squares = (misses**2).sum(axis=1)
    limit = settings.scale_m**2
    weights = (limit / (squares + limit)) ** 2
    flat = rows.reshape(-1, rows.shape[-1])
    weighed = flat * np.repeat(weights, rows.shape[1])[:, None]
    matrix, slope = flat.T @ weighed, weighed.T @ misses.ravel()
    cost = float((limit * squares / (squares + limit)).sum())
    n = len(state.mean.names)
    # The root turns and moves freely; the rest is held where it started.
    away = matrices_to_rotation_vectors(np.swapaxes(start.turns, -1, -2) @ state.turns)
    held = np.repeat(settings.turn_prior_m**2, 3 * n)
    held[:3] = 0.0
    matrix[np.arange(3 * n), np.arange(3 * n)] += held
    slope[: 3 * n] += held * away.ravel()
    cost += float((held * away.ravel() ** 2).sum())
    if settings.shape_prior_m is not None:
        tail = np.arange(3 * n + 3, len(slope))
        matrix[tail, tail] += settings.shape_prior_m**2
        slope[tail] += settings.shape_prior_m**2 * state.shape
        cost += float(settings.shape_prior_m**2 * (state.shape**2).sum())
    return cost, matrix, slope


def _rigid_start(body: Body, points: Points, targets: Floats) -> Pose:
    """The body at rest, turned and moved onto the targets, from the medians outwards."""
    seen = ~np.isnan(targets).any(axis=1)
    here, there = points.rest[seen], targets[seen]
    middle, aim = np.median(here, axis=0), np.median(there, axis=0)
    near = np.linalg.norm(there - aim, axis=1) < 2 * np.ptp(points.rest, axis=0).max()
    left, _, right = np.linalg.svd((there[near] - aim).T @ (here[near] - middle))
    turn = left @ np.diag([1, 1, np.sign(np.linalg.det(left @ right))]) @ right
    turns = np.tile(np.eye(3), (1, len(body.names), 1, 1))
    turns[0, 0] = turn
    step = aim + turn @ (body.joints[0] - middle) - body.joints[0]
    return pose_body(body, turns, step[None])


def vertex_normals(vertices: Floats, faces: Indices) -> Floats:
    """Unit normals of vertices: of the triangles around them, by their areas."""
    sums = sum_normals(vertices, faces)
    normals: Floats = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)
    return normals
