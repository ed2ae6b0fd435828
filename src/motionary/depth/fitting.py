"""The body's pose fitted to points that a camera sees, and its shape to the first images.

Gauss-Newton on twists (Baak 2012, sections 6.2 and 8.4.1). Printed: fixed vertices go to the median
of their nearest points, so that the back is pulled to the front. Here only vertices that face
the camera and are not hidden take part, points pull vertices as well as vertices points, and a
prior over poses holds what is not seen.

Length, girth and build are found by coordinates: after each change of the body the poses are fitted
anew, and what the rendered bodies are off from the images decides.

Conventions: small turns are in the world's axes, about the joints; columns of the system are the
step of the root, then three of each joint of `ACTIVE`.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body, Camera, load_body, render_depth
from motionary.body.fitting import vertex_normals
from motionary.depth import solving
from motionary.depth.clouds import COMPILED, unpack_camera
from motionary.depth.poses import PoseDatabase, list_active, scale_body
from motionary.matching.distance import Engine, load_twin

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

_STEPS_COMPILED = "motionary.depth._fitting_compiled"
# What is measured so much nearer than a vertex hides it.
_HIDING_M = 0.12
# How far two depths of a pixel can be apart at most: beyond, they are of different things.
_CAP_M = 0.15
#: Images that the shape is fitted to, of those of the first second.
N_IMAGES = 8
# First steps: of the size, as a fraction, and of two directions of the body's shape.
_STEPS = np.array([0.05, 0.5, 0.5])
_MOST = np.array([0.25, 1.0, 1.0])
_ROUNDS = 3
_FIT_STEPS = 3
_PIXELS = 1200
# What a full step costs, in metres: a shape is not moved by less.
_PRIOR_M = 0.0005


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
) -> tuple[State, Mask]:
    """The pose nearest to points (n, 3), from near it, and which vertices the camera then sees.

    `depth` is the cleaned image, which tells what hides vertices; `steps`, if given, replaces those
    of the settings.
    """
    kernels: Any = load_twin(_STEPS_COMPILED, engine, pays=True) or solving
    body, (rest, bones, weights, _) = surface.body, surface.body.surface
    turns, root = state.turns.copy(), state.root.copy()
    visible: Mask = kernels.fit(
        (body.parents, body.joints, rest, bones, weights),
        (surface.owners, surface.normals, surface.active, surface.pulling),
        (points, depth, unpack_camera(camera)),
        (surface.mean, surface.precision),
        (
            settings.scale_m, settings.along, settings.outward, settings.prior, settings.damping,
            _HIDING_M, settings.converged,
        ),
        settings.steps if steps is None else steps, turns, root,
    )  # fmt: skip
    return State(turns, root), visible


#: Vertices that pull and nearest points whose median each goes to, as far as it is printed.
PUBLISHED_VERTICES, PUBLISHED_NEAREST = 150, 5


def fit_published(surface: Surface, state: State, points: Floats, *, steps: int = 6) -> State:
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
        system[np.diag_indices(len(system))] += 0.1
        change = solving.solve(system, slope)
        solving.move(parents, surface.active, turned, change, turns, root)
    return State(turns, root)


def place_surface(
    surface: Surface, state: State, *, engine: Engine = "numpy"
) -> tuple[Floats, Floats]:
    """Global turns and places of the joints of a pose."""
    kernels: Any = load_twin(_STEPS_COMPILED, engine, pays=True) or solving
    placed: tuple[Floats, Floats] = kernels.place(
        surface.body.parents, surface.body.joints, state.turns, state.root
    )
    return placed


def place_vertices(surface: Surface, state: State, *, engine: Engine = "numpy") -> Floats:
    """Places of the vertices of a pose."""
    kernels: Any = load_twin(_STEPS_COMPILED, engine, pays=True) or solving
    body, (rest, bones, weights, _) = surface.body, surface.body.surface
    turned, placed = place_surface(surface, state, engine=engine)
    vertices: Floats = kernels.skin(body.joints, rest, bones, weights, turned, placed)
    return vertices


# ---- how far a pose is from an image


def shrink(depth: Floats, camera: Camera, n: int) -> tuple[Floats, Camera]:
    """An image with about n pixels of the person, and its camera."""
    step = max(1, round(np.sqrt(np.count_nonzero(~np.isnan(depth)) / n)))
    small = np.ascontiguousarray(depth[::step, ::step])
    (fx, fy), (x, y) = camera.focal, camera.centre
    height, width = small.shape
    focal, centre = (fx / step, fy / step), (x / step, y / step)
    return small, replace(camera, width=width, height=height, focal=focal, centre=centre)


class Comparison(NamedTuple):
    """How far rendered poses are from an image, in metres.

    `costs` (poses,): the mean over all pixels that either of them has, of the difference of the
    depths; at most 15 cm, which is also what a pixel counts that only one of them has. `apart`
    (height, width) is this difference of the last pose; NaN where neither has a pixel.
    """

    costs: Floats
    apart: Floats


def compare_images(
    vertices: Floats, faces: Indices, depth: Floats, camera: Camera, *, engine: Engine = "auto"
) -> Comparison:
    """How far bodies are from an image, for poses (n, vertices, 3)."""
    kernels = load_twin(COMPILED, engine, pays=True)
    if kernels is not None:
        apart = np.empty_like(depth)
        costs = kernels.compare_images(
            vertices, faces, *unpack_camera(camera), depth, _CAP_M, apart
        )
        return Comparison(costs, apart)
    result, apart = np.full(len(vertices), _CAP_M), np.full_like(depth, np.nan)
    for number, own in enumerate(vertices):
        a, b, c = (camera.project(own)[faces[:, k]] for k in range(3))
        # Images have y down: triangles that are seen from outside have areas below 0.
        area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
        rendered = render_depth(own, faces[area < 0], camera, engine=engine).depth
        either = ~(np.isnan(rendered) & np.isnan(depth))
        apart = np.fmin(np.abs(rendered - depth), _CAP_M)
        apart[~either] = np.nan
        if either.any():
            result[number] = apart[either].mean()
    return Comparison(result, apart)


# ---- shape of a person


class View(NamedTuple):
    """One image and the pose found in it: points that pull, cleaned depth, pose."""

    points: Floats
    depth: Floats
    state: State


class PersonShape(NamedTuple):
    """A body and how it was made of the mean adult: size, and directions of shape."""

    body: Body
    scale: float
    shape: dict[str, float]


def make_person(numbers: Floats) -> PersonShape:
    """The body of a size, as the logarithm of the mean adult's, of a weight and a sex."""
    shape = {"weight": float(numbers[1]), "gender": float(numbers[2])}
    scale = float(np.exp(numbers[0]))
    return PersonShape(scale_body(load_body().shaped(shape), scale), scale, shape)


def fit_person(
    views: list[View],
    camera: Camera,
    database: PoseDatabase,
    *,
    settings: SurfaceSettings,
    scale: float = 1.0,
    engine: Engine = "auto",
) -> tuple[PersonShape, list[State]]:
    """The body that explains images of different moments best, and its poses in them.

    The database's prior holds what is not seen; `scale` is where the search of the size starts.
    """
    numbers = np.array([np.log(scale), 0.0, 0.0])
    start = numbers.copy()
    first = make_surface(make_person(numbers).body, database, settings)
    small = [shrink(view.depth, camera, _PIXELS) for view in views]

    def judge(tried: Floats, states: list[State]) -> tuple[float, list[State]]:
        person = make_person(tried)
        surface = reshape_surface(first, person.body)
        total, found = 0.0, []
        for view, state, (depth, eye) in zip(views, states, small, strict=True):
            fitted, _ = fit_pose(
                surface, state, view.points, view.depth, camera, engine=engine,
                settings=settings, steps=_FIT_STEPS,
            )  # fmt: skip
            vertices = place_vertices(surface, fitted, engine=engine)
            apart = compare_images(vertices[None], person.body.faces, depth, eye, engine=engine)
            total += float(apart.costs[0])
            found.append(fitted)
        prior = _PRIOR_M * float((((tried - start) / _STEPS) ** 2).sum())
        return total / len(views) + prior, found

    best, states = judge(numbers, [view.state for view in views])
    steps = _STEPS.copy()
    for _ in range(_ROUNDS):
        for axis in range(len(numbers)):
            for way in (1, -1):
                tried = numbers.copy()
                tried[axis] += way * steps[axis]
                if abs(tried[axis] - start[axis]) > _MOST[axis]:
                    continue
                cost, found = judge(tried, states)
                if cost < best:
                    best, numbers, states = cost, tried, found
                    break
        steps /= 2
    return make_person(numbers), states
