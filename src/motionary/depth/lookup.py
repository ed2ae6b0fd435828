"""Poses of the database whose ends lie where a cloud's extrema are.

After Baak (2012), section 8.4.3: which extremum is which end is not known, so that several
assignments (8.4) are asked for, and the nearest in place and time (8.6) wins. Here candidates are
ranked by the image in the end, and the ends are chosen among twenty extrema.
"""

from itertools import permutations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body, Camera, skin
from motionary.depth.fitting import State, Surface, place_surface
from motionary.depth.poses import (
    FLIP,
    N_VIEWS,
    PoseDatabase,
    expand_pose,
    expand_turns,
    mirror_turns,
    turn_about_up,
)
from motionary.matching.distance import Engine
from motionary.rotations import quaternions_to_matrices, shortest_turn, unit_vectors

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

N_NEAREST = 10
#: An end moves no farther between two images (8.4).
FARTHEST_STEP_M = 0.5
#: An extremum that is farther from all of the last image's has jumped.
JUMP_M = 0.25
WEIGHT_OF_ENDS = 0.5
_ALL = np.array(list(permutations(range(5))), dtype=np.intp)


class Lookup(NamedTuple):
    """A database placed in a body.

    Attributes
    ----------
    body : Body
    turns : array, shape (poses, active, 3, 3)
    joints, ends : arrays, shape (poses, joints or ends, 3), from the root, facing +z
    centres : array, shape (poses, views, 3), from the root
    trees : of the ends seen from the centre, by view
    """

    body: Body
    turns: Floats
    joints: Floats
    ends: Floats
    centres: Floats
    trees: tuple[Any, ...]


class Candidates(NamedTuple):
    """Poses of the database placed into the scene.

    `poses` (n,) of the database, `heading` of all, `roots` (n, 3), `costs` (n,) by (8.6).
    """

    poses: Indices
    heading: float
    roots: Floats
    costs: Floats

    def first_states(self, lookup: Lookup, n: int) -> list[State]:
        """The first n candidates, or all if they are fewer, as starts of fits."""
        turns = expand_turns(lookup.body, lookup.turns[self.poses[:n]])
        turns[:, 0] = turn_about_up(self.heading) @ turns[:, 0]
        return [State(*one) for one in zip(turns, self.roots[:n].copy(), strict=True)]


def make_lookup(body: Body, database: PoseDatabase, *, scale: float = 1.0) -> Lookup:
    """A database in a body; `scale` is its size beside the body that centres were measured in."""
    from scipy.spatial import cKDTree

    turns = quaternions_to_matrices(database.turns)
    pose = expand_pose(body, turns, np.zeros((len(turns), 3)))
    ends = np.asarray(skin(body, pose, body.points(body.ends)), dtype=np.float64)
    centres = database.centres * scale
    trees = tuple(
        cKDTree((ends - centres[:, view, None]).reshape(len(ends), -1)) for view in range(N_VIEWS)
    )
    return Lookup(body, turns, pose.joints, ends, centres, trees)


def permit(ends: Floats, last: Floats | None, *, jumped: bool) -> Indices:
    """Assignments of five extrema to the ends, shape (n, 5): which extremum each end is.

    Those in reach of the last pose (8.4); where an extremum jumped, or nothing is in reach, also
    those that take the two lowest for the feet.
    """
    result = np.empty((0, 5), np.intp)
    if last is not None:
        near = np.linalg.norm(ends[:, None] - last[None], axis=2) < FARTHEST_STEP_M
        result = _ALL[near[_ALL, np.arange(5)].all(axis=1)]
    if jumped or not len(result):
        low = set(np.argsort(ends[:, 1])[:2].tolist())
        feet = np.array([{a, b} == low for _, _, _, a, b in _ALL.tolist()])
        result = np.unique(np.concatenate([result, _ALL[feet]]), axis=0)
    return result


def find_candidates(
    lookup: Lookup,
    ends: Floats,
    assignments: Indices,
    centre: Floats,
    heading: float,
    camera: Camera,
    *,
    last: Floats | None = None,
) -> Candidates:
    """Poses whose ends are near to the extrema under one of the assignments, best first (8.6).

    `ends` (5, 3) are extrema in the world and `assignments` (n, 5) from `permit`; `centre` is the
    middle of the cloud; from which side the camera sees the person tells which middle of a pose is
    meant. `last` (joints, 3) are joints of the last pose.
    """
    to_camera = camera.position - centre
    view = round((heading - np.arctan2(to_camera[0], to_camera[2])) / (2 * np.pi / N_VIEWS))
    view %= N_VIEWS
    turn = turn_about_up(heading)
    queries = ((ends - centre) @ turn)[assignments].reshape(len(assignments), -1)
    count = min(N_NEAREST, len(lookup.turns))
    distances, poses = lookup.trees[view].query(queries, count)
    poses, distances = poses.ravel(), distances.ravel()
    order = np.lexsort((distances, poses))
    first = np.concatenate([[True], np.diff(poses[order]) > 0])
    poses, distances = poses[order][first], distances[order][first]
    roots = centre - lookup.centres[poses, view] @ turn.T
    costs = distances / 5
    if last is not None:
        placed = lookup.joints[poses] @ turn.T + roots[:, None]
        moved = np.linalg.norm((placed - last).reshape(len(poses), -1), axis=1)
        costs = WEIGHT_OF_ENDS * costs + (1 - WEIGHT_OF_ENDS) * moved / len(last)
    order = np.argsort(costs, kind="stable")
    return Candidates(poses[order], heading, roots[order], costs[order])


def has_jumped(ends: Floats, last: Floats | None) -> bool:
    """Whether one of the extrema is far from all of the last image's."""
    if last is None:
        return True
    away = np.linalg.norm(ends[:, None] - last[None], axis=2).min(axis=1)
    return bool((away > JUMP_M).any())


def choose_ends(extrema: Floats, expected: Floats) -> Floats:
    """The ends among the extrema (n, 3), by where they are expected (5, 3), shape (5, 3).

    An extremum is one end at most; later extrema count a little less.
    """
    from scipy.optimize import linear_sum_assignment

    away = np.linalg.norm(expected[:, None] - extrema[None], axis=2)
    costs = np.minimum(away, FARTHEST_STEP_M) + 0.005 * np.arange(len(extrema))
    chosen: Floats = extrema[linear_sum_assignment(costs)[1]]
    return chosen


#: Limbs by their upper and lower joint and their end in `body.ENDS`.
LIMBS = (
    ("lupperarm", "lforearm", 1), ("rupperarm", "rforearm", 2), ("lthigh", "lshank", 3),
    ("rthigh", "rshank", 4),
)  # fmt: skip
#: An extremum farther from the surface of a pose is of a limb that the pose has elsewhere.
UNEXPLAINED_M = 0.12


def reach(
    surface: Surface, state: State, ends: Floats, target: Floats, *, engine: Engine = "numpy"
) -> list[State]:
    """The pose with one limb after the other stretched to a point, where it is long enough.

    `ends` (5, 3) are those of the pose.
    """
    turned, placed = place_surface(surface, state, engine=engine)
    body = surface.body
    found = []
    for upper, lower, end in LIMBS:
        a, b = body.index(upper), body.index(lower)
        first, second = np.linalg.norm(placed[b] - placed[a]), np.linalg.norm(ends[end] - placed[b])
        way = target - placed[a]
        far = np.linalg.norm(way)
        if far > 1.1 * (first + second):
            continue
        along = way / far
        far = np.clip(far, abs(first - second) + 0.01, first + second - 0.01)
        # The bend stays on its side; a straight limb bends downwards.
        side = placed[b] - placed[a] - np.array([0.0, 0.05, 0.0])
        side = unit_vectors(side - (side @ along) * along)
        cosine = (first**2 + far**2 - second**2) / (2 * first * far)
        middle = first * (cosine * along + np.sqrt(max(1 - cosine**2, 0.0)) * side)
        one = shortest_turn(unit_vectors(placed[b] - placed[a]), unit_vectors(middle))
        other = shortest_turn(
            unit_vectors(one @ (ends[end] - placed[b])),
            unit_vectors(placed[a] + far * along - placed[a] - middle),
        )
        turns = state.turns.copy()
        turns[a] = turned[body.parents[a]].T @ one @ turned[a]
        turns[b] = (one @ turned[a]).T @ other @ one @ turned[b]
        if np.isfinite(turns).all():
            found.append(State(turns, state.root.copy()))
    return found


def turn_round(surface: Surface, state: State, camera: Camera) -> State:
    """The pose that has the same outline and looks the other way: its reflection in depth."""
    away = (camera.position - state.root) * (1, 0, 1)
    away /= np.linalg.norm(away)
    turns = state.turns.copy()
    turns[surface.active] = mirror_turns(state.turns[None, surface.active])[0]
    # The root is reflected in the world, and in the body, which makes it a turn again.
    turns[0] = (np.eye(3) - 2 * np.outer(away, away)) @ state.turns[0] @ FLIP
    return State(turns, state.root.copy())
