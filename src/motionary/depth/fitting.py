"""The body's pose fitted to points that a camera sees.

Gauss-Newton on twists (Baak 2012, sections 6.2 and 8.4.1). Printed: fixed vertices go to the median
of their nearest points, so that the back is pulled to the front. Here only vertices that face
the camera and are not hidden take part, points pull vertices as well as vertices points, and a
prior over poses holds what is not seen.

Conventions: small turns are in the world's axes, about the joints; columns of the system are the
step of the root, then three of each joint of `ACTIVE`.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body, Camera
from motionary.body.fitting import vertex_normals
from motionary.depth import solving
from motionary.depth.poses import PoseDatabase, list_active
from motionary.depth.preparation import unpack_camera
from motionary.matching.distance import Engine, load_twin

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

_COMPILED = "motionary.depth._fitting_compiled"
# What is measured so much nearer than a vertex hides it.
_HIDING_M = 0.12


@dataclass(frozen=True, slots=True)
class SurfaceSettings:
    """How a pose is fitted.

    Attributes
    ----------
    points : of the cloud that pull, at most
    vertices : that pull in their turn, at most
    steps : of Gauss-Newton, at most
    converged : the fit ends where nothing changes by as much, in metres or radians
    scale_m : distances much beyond it count little
    along : how much a pull counts along the surface, beside 1 across it
    outward : how much the vertices' pulls count beside the points'
    prior : how much the prior counts beside a point
    damping : how much a turn or step from where the fit is counts
    """

    points: int = 600
    vertices: int = 300
    steps: int = 6
    converged: float = 0.01
    scale_m: float = 0.1
    along: float = 0.3
    outward: float = 0.5
    prior: float = 0.02
    damping: float = 0.1


class Surface(NamedTuple):
    """A body as the fit needs it.

    Attributes
    ----------
    body : Body
    normals : array, shape (vertices, 3), unit, at rest
    owners : array, shape (vertices,), the bone that weighs most
    pulling : vertices that pull, evenly spread
    active : joints that turn, by `ACTIVE`
    mean, precision : the prior over rotation vectors (45,) of all joints but the root
    """

    body: Body
    normals: Floats
    owners: Indices
    pulling: Indices
    active: Indices
    mean: Floats
    precision: Floats


class State(NamedTuple):
    """A pose: turns (joints, 3, 3) relative to the parents, place of the root (3,)."""

    turns: Floats
    root: Floats


class Support(NamedTuple):
    """What holds a fitted pose.

    Attributes
    ----------
    system : array, shape (columns, columns), of the last step, prior and damping included
    visible : array, shape (vertices,), whether the camera sees a vertex
    misses : array, shape (joints,), metres, of the points that pull vertices of each bone
    pulls : array, shape (joints,), how many points do
    """

    system: Floats
    visible: Mask
    misses: Floats
    pulls: Floats


def make_surface(body: Body, database: PoseDatabase, settings: SurfaceSettings) -> Surface:
    """A body ready for fits, with the prior of a database."""
    surface = body.surface
    owners = surface.bones[np.arange(len(surface.rest)), surface.weights.argmax(axis=1)]
    size = len(database.mean)
    return Surface(
        body,
        vertex_normals(surface.rest, body.faces),
        owners,
        spread(surface.rest, settings.vertices),
        list_active(body),
        database.mean,
        np.asarray(np.linalg.inv(database.covariance + 0.02 * np.eye(size)), dtype=np.float64),
    )


def reshape_surface(surface: Surface, body: Body) -> Surface:
    """The same for the body in another shape."""
    rest, faces = body.surface.rest, body.faces
    return surface._replace(body=body, normals=vertex_normals(rest, faces))


def spread(places: Floats, n: int) -> Indices:
    """Indices of n places that are far from each other, as even as they can be."""
    chosen = [int(places[:, 1].argmax())]
    nearest = np.full(len(places), np.inf)
    while len(chosen) < min(n, len(places)):
        nearest = np.minimum(nearest, ((places - places[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(nearest.argmax()))
    return np.sort(chosen)


def thin(points: Floats, n: int) -> Floats:
    """At most n of the points, evenly through their sequence."""
    if len(points) <= n:
        return points
    return np.ascontiguousarray(points[np.linspace(0, len(points) - 1, n).astype(np.intp)])


def fit_pose(
    surface: Surface,
    state: State,
    points: Floats,
    depth: Floats,
    camera: Camera,
    *,
    settings: SurfaceSettings,
    steps: int | None = None,
    engine: Engine = "auto",
) -> tuple[State, Support]:
    """The pose nearest to points, from near it, and what holds it.

    Parameters
    ----------
    surface : Surface
    state : where the fit starts
    points : array, shape (n, 3), metres, of the person
    depth : the cleaned image; tells what hides vertices
    camera : Camera
    settings : how it is fitted
    steps : of Gauss-Newton, if not as many as the settings say
    engine : which twin computes
    """
    kernels: Any = load_twin(_COMPILED, engine, pays=True) or solving
    body = surface.body
    parents, joints, (rest, bones, weights, _) = body.parents, body.joints, body.surface
    numbers = (
        settings.scale_m, settings.along, settings.outward, settings.prior, settings.damping,
        _HIDING_M, settings.converged,
    )  # fmt: skip
    turns, root = state.turns.copy(), state.root.copy()
    system, visible, misses, counts = kernels.fit(
        (parents, joints, rest, bones, weights),
        (surface.owners, surface.normals, surface.active, surface.pulling),
        (points, depth, unpack_camera(camera)),
        (surface.mean, surface.precision),
        numbers, settings.steps if steps is None else steps, turns, root,
    )  # fmt: skip
    n = len(parents)
    pulls_of = np.bincount(surface.owners, counts, n).astype(np.float64)
    misses_of = np.bincount(surface.owners, misses, n) / np.maximum(pulls_of, 1.0)
    return State(turns, root), Support(system, visible, misses_of, pulls_of)


#: Vertices that pull and nearest points whose median each goes to, as far as it is printed.
PUBLISHED_VERTICES, PUBLISHED_NEAREST = 150, 5


def fit_published(
    surface: Surface, state: State, points: Floats, *, steps: int = 6, damping: float = 0.1
) -> State:
    """The pose by the printed rule: fixed vertices, each to the median of its nearest points."""
    from scipy.spatial import cKDTree

    body = surface.body
    parents, joints, (rest, bones, weights, _) = body.parents, body.joints, body.surface
    turns, root = state.turns.copy(), state.root.copy()
    tree = cKDTree(points)
    chosen = spread(rest, PUBLISHED_VERTICES)
    for _ in range(steps):
        turned, placed = solving.place(parents, joints, turns, root)
        vertices = solving.skin(joints, rest, bones, weights, turned, placed)
        nearest = tree.query(vertices[chosen], min(PUBLISHED_NEAREST, len(points)))[1]
        ways = np.median(points[nearest.reshape(len(chosen), -1)], axis=1) - vertices[chosen]
        ones = np.ones(len(chosen))
        pulls = solving.sum_pulls(len(rest), chosen, ones, 1.0, surface.normals, ways)
        system, slope = solving.gather(
            parents, bones, weights, surface.active, placed, vertices, pulls
        )
        system[np.diag_indices(len(system))] += damping
        change = solving.solve(system, slope)
        solving.move(parents, surface.active, turned, change, turns, root)
    return State(turns, root)


def place_surface(
    surface: Surface, state: State, *, engine: Engine = "numpy"
) -> tuple[Floats, Floats]:
    """Global turns and places of the joints of a pose."""
    kernels: Any = load_twin(_COMPILED, engine, pays=True) or solving
    placed: tuple[Floats, Floats] = kernels.place(
        surface.body.parents, surface.body.joints, state.turns, state.root
    )
    return placed


def place_vertices(surface: Surface, state: State, *, engine: Engine = "numpy") -> Floats:
    """Places of the vertices of a pose."""
    kernels: Any = load_twin(_COMPILED, engine, pays=True) or solving
    body, (rest, bones, weights, _) = surface.body, surface.body.surface
    turned, placed = place_surface(surface, state, engine=engine)
    vertices: Floats = kernels.skin(body.joints, rest, bones, weights, turned, placed)
    return vertices
