"""A person's length, girth and build from the first images.

A search by coordinates: after each change of the body the poses are fitted anew, and what the
rendered bodies are off from the images decides.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body, Camera, load_body
from motionary.depth.fitting import (
    State,
    SurfaceSettings,
    fit_pose,
    make_surface,
    place_vertices,
    reshape_surface,
)
from motionary.depth.lookup import compare_images, shrink
from motionary.depth.poses import PoseDatabase, scale_body
from motionary.matching.distance import Engine

Floats = NDArray[np.float64]

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
    """The body that explains the images best, and its poses in them.

    Parameters
    ----------
    views : of different moments
    camera : Camera
    database : whose prior over poses holds what is not seen
    settings : how poses are fitted
    scale : where the search of the size starts
    engine : which twin computes
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
