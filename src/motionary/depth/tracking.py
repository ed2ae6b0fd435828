"""A person's pose from image to image of one depth camera.

After Baak (2012), chapter 8: two hypotheses, the last pose fitted to the image and a pose of the
database that the extrema lead to, of which the image chooses one.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body, Camera, load_body
from motionary.depth.fitting import (
    PUBLISHED_VERTICES,
    State,
    Support,
    Surface,
    SurfaceSettings,
    fit_pose,
    fit_published,
    make_surface,
    place_surface,
    spread,
    thin,
)
from motionary.depth.graph import N_EXTREMA, Graph, build_graph, find_extrema
from motionary.depth.lookup import (
    UNEXPLAINED_M,
    Candidates,
    Lookup,
    choose_ends,
    compare_images,
    find_candidates,
    has_jumped,
    make_lookup,
    permit,
    reach,
    shrink,
)
from motionary.depth.poses import (
    PoseDatabase,
    find_centre,
    find_heading,
    heading_of,
    load_database,
)
from motionary.depth.preparation import Cloud, PreparationSettings, prepare
from motionary.errors import InvalidInput
from motionary.matching.distance import Engine

Floats = NDArray[np.float64]
Hypothesis = Literal["local", "lookup", "none"]

#: Fewer points are no person.
LEAST_POINTS = 300
MEAN_STATURE_M = 1.659


@dataclass(frozen=True, slots=True)
class TrackerSettings:
    """How a pose is tracked.

    Attributes
    ----------
    published : the printed method whole
    hypotheses : "both", or one of them alone
    ranked : candidates of the database that the image ranks
    pixels : of the person in images that rank
    lead : by how much better the lookup must be to win, as a fraction of the cost
    surface : how poses are fitted
    preparation : what of the image is the person
    """

    published: bool = False
    hypotheses: Literal["both", "local", "lookup"] = "both"
    ranked: int = 12
    pixels: int = 500
    lead: float = 0.03
    surface: SurfaceSettings = field(default_factory=SurfaceSettings)
    preparation: PreparationSettings = field(default_factory=PreparationSettings)


class TrackedPose(NamedTuple):
    """The pose in one image.

    Attributes
    ----------
    joints : array, shape (joints, 3), metres; NaN where no person is
    turns : array, shape (joints, 3, 3), relative to the parents
    ends : array, shape (5, 3), of `body.ENDS`
    confidence : array, shape (joints,), in [0, 1]
    hypothesis : which won
    cost : how far the pose is from the image, metres
    extrema : array, shape (20, 3), in the world
    chosen : array, shape (5, 3), the extrema taken for the ends
    seconds : processor time by part
    """

    joints: Floats
    turns: Floats
    ends: Floats
    confidence: Floats
    hypothesis: Hypothesis
    cost: float
    extrema: Floats
    chosen: Floats
    seconds: dict[str, float]


class _Seen(NamedTuple):
    """What is read off an image before any pose."""

    cloud: Cloud
    graph: Graph
    extrema: Floats
    centre: Floats
    points: Floats
    small: Floats
    eye: Camera


class DepthTracker:
    """Tracks a person through the images of a depth camera, one after the other.

    Parameters
    ----------
    camera : Camera
    database : of poses; the one that ships if None
    body : the person's; the mean adult, scaled to `stature_m`, if None
    stature_m : of the person
    settings : how it is tracked
    background : depth of the empty scene
    engine : which twins compute
    """

    def __init__(
        self,
        camera: Camera,
        database: PoseDatabase | None = None,
        *,
        body: Body | None = None,
        stature_m: float = MEAN_STATURE_M,
        settings: TrackerSettings | None = None,
        background: Floats | None = None,
        engine: Engine = "auto",
    ) -> None:
        if not 0.5 <= stature_m <= 2.5:
            raise InvalidInput(f"stature_m needs to be from 0.5 to 2.5 metres, got {stature_m:g}")
        self.camera, self.engine, self.background = camera, engine, background
        self.settings = settings or TrackerSettings()
        self.database = database or load_database()
        scale = stature_m / MEAN_STATURE_M
        self.body = body or scale_body(load_body(), scale)
        self.surface: Surface = make_surface(self.body, self.database, self.settings.surface)
        self.lookup: Lookup = make_lookup(self.body, self.database, scale=scale)
        self._fixed = spread(self.body.vertices, PUBLISHED_VERTICES)
        self.forget()

    def forget(self) -> None:
        """Start anew, as with another person."""
        self._state: State | None = None
        self._before: State | None = None
        self._extrema: Floats | None = None
        self._heading = 0.0
        self._seconds: dict[str, float] = {}

    def track(self, image: Floats) -> TrackedPose:
        """The pose in the next image, shape (height, width), in metres."""
        self._seconds = {}
        with self._timed("preparation"):
            cloud = prepare(
                image, self.camera, self.settings.preparation, background=self.background,
                engine=self.engine,
            )  # fmt: skip
        if len(cloud.points) < LEAST_POINTS:
            self._state = self._before = self._extrema = None
            return self._nothing()
        seen = self._look(cloud)
        chosen = self._choose_ends(seen)
        found: list[tuple[Hypothesis, State, Support | None]] = []
        if self._state is not None and self.settings.hypotheses != "lookup":
            with self._timed("local"):
                found.append(("local", *self._fit(self._predict(), seen)))
        if self._state is None or self.settings.hypotheses != "local":
            found += self._look_up(seen, chosen, found[0][1] if found else None)
        with self._timed("voting"):
            costs = [self._cost(state, seen) for _, state, _ in found]
            for k, (name, _, _) in enumerate(found):
                if name == "lookup" and len(found) > 1 and not self.settings.published:
                    costs[k] *= 1 + self.settings.lead
            best = int(np.argmin(costs))
        name, state, support = found[best]
        self._before, self._state, self._extrema = self._state, state, seen.extrema
        return self._finish(seen, chosen, name, state, support, costs[best])

    @contextmanager
    def _timed(self, part: str) -> Iterator[None]:
        began = time.thread_time()
        yield
        self._seconds[part] = self._seconds.get(part, 0.0) + time.thread_time() - began

    def _look(self, cloud: Cloud) -> _Seen:
        with self._timed("extrema"):
            graph = build_graph(cloud, self.camera.focal[0], engine=self.engine)
            extrema = find_extrema(graph, N_EXTREMA, engine=self.engine).points
        with self._timed("lookup"):
            centre = find_centre(graph.points, graph.torso)
            small, eye = shrink(cloud.depth, self.camera, self.settings.pixels)
        points = thin(graph.points, self.settings.surface.points)
        return _Seen(cloud, graph, extrema, centre, points, small, eye)

    def _choose_ends(self, seen: _Seen) -> Floats:
        if self.settings.published or self._state is None:
            return seen.extrema[:5]
        vertices = self._vertices(self._predict())
        return choose_ends(seen.extrema, vertices[self.body.ends])

    def _predict(self) -> State:
        """Where the last pose is expected now."""
        assert self._state is not None
        return self._state

    def _look_up(
        self, seen: _Seen, chosen: Floats, local: State | None
    ) -> list[tuple[Hypothesis, State, Support | None]]:
        """The pose of the database that the extrema lead to, fitted."""
        with self._timed("lookup"):
            last, joints = None, None
            if self._state is not None:
                last = self._vertices(self._state)[self.body.ends]
                joints = self._joints(self._state)
            jumped = has_jumped(seen.extrema[:5], self._last_extrema())
            ends = chosen
            headings = self._headings(seen)
            sets = [
                find_candidates(
                    self.lookup, ends, permit(ends, last, jumped=jumped), seen.centre, heading,
                    self.camera, last=joints,
                )
                for heading in headings
            ]  # fmt: skip
        starts = self._rank(sets, seen, self._reach(seen, local))
        with self._timed("local"):
            return [("lookup", *self._fit(start, seen)) for start in starts]

    def _last_extrema(self) -> Floats | None:
        return None if self._extrema is None else self._extrema[:5]

    def _headings(self, seen: _Seen) -> list[float]:
        """Viewing directions that candidates are turned to."""
        away = self.camera.position - seen.centre
        if self._state is not None and not self.settings.published:
            turned, _ = place_surface(self.surface, self._state)
            return [float(heading_of(turned[None], self.body)[0])]
        measured = find_heading(seen.graph.points, seen.centre, away)
        if self._state is None:
            self._heading = measured.angle if measured.trust > 0 else np.arctan2(away[0], away[2])
        else:
            turn = (measured.angle - self._heading + np.pi) % (2 * np.pi) - np.pi
            self._heading += 0.5 * measured.trust * turn
        if self.settings.published:
            return [float(self._heading)]
        return [float(self._heading), float(self._heading + np.pi)]

    def _reach(self, seen: _Seen, local: State | None) -> list[State]:
        """The local pose with limbs at extrema that it does not explain."""
        if local is None or self.settings.published:
            return []
        with self._timed("lookup"):
            vertices = self._vertices(local)
            extrema = seen.extrema[:10]
            away = ((extrema[:, None] - vertices[None]) ** 2).sum(axis=2).min(axis=1)
            far = extrema[away > UNEXPLAINED_M**2][:2]
            ends = vertices[self.body.ends]
            return [state for one in far for state in reach(self.surface, local, ends, one)]

    def _rank(self, sets: list[Candidates], seen: _Seen, more: list[State]) -> list[State]:
        """The best candidates: by (8.6), or by the image."""
        if self.settings.published:
            return [sets[0].state(self.lookup, 0)]
        with self._timed("lookup"):
            first = self._state is None
            ranked = self.settings.ranked * (5 if first else 1)
            states = [
                one.state(self.lookup, k)
                for one in sets
                for k in range(min(ranked, len(one.poses)))
            ] + more
            vertices = np.stack([self._vertices(state) for state in states])
            costs = compare_images(
                vertices, self.body.faces, seen.small, seen.eye, engine=self.engine
            )
            order = np.argsort(costs, kind="stable")[: 6 if first else 1]
            return [states[k] for k in order]

    def _fit(self, start: State, seen: _Seen) -> tuple[State, Support | None]:
        settings = self.settings.surface
        if self.settings.published:
            return fit_published(self.surface, start, seen.graph.points, steps=settings.steps), None
        return fit_pose(
            self.surface, start, seen.points, seen.cloud.depth, self.camera, settings=settings,
            engine=self.engine,
        )  # fmt: skip

    def _cost(self, state: State, seen: _Seen) -> float:
        """How far a pose is from the image: by rendering it, or by (8.7) and (8.8)."""
        vertices = self._vertices(state)
        if not self.settings.published:
            return float(
                compare_images(
                    vertices[None], self.body.faces, seen.small, seen.eye, engine=self.engine
                )[0]
            )
        from scipy.spatial import cKDTree

        to_points = cKDTree(seen.graph.points).query(vertices[self._fixed])[0].mean()
        to_model = cKDTree(vertices).query(seen.extrema)[0].mean()
        return float(to_points + to_model)

    def _vertices(self, state: State) -> Floats:
        return place_surface(self.surface, state, vertices=True)[1]

    def _joints(self, state: State) -> Floats:
        return place_surface(self.surface, state)[1]

    def _finish(
        self,
        seen: _Seen,
        chosen: Floats,
        name: Hypothesis,
        state: State,
        support: Support | None,
        cost: float,
    ) -> TrackedPose:
        vertices = self._vertices(state)
        return TrackedPose(
            self._joints(state), state.turns, vertices[self.body.ends],
            np.ones(len(self.body.names)), name, cost, seen.extrema, chosen, self._seconds,
        )  # fmt: skip

    def _nothing(self) -> TrackedPose:
        n = len(self.body.names)
        return TrackedPose(
            np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full((5, 3), np.nan),
            np.zeros(n), "none", np.inf, np.full((N_EXTREMA, 3), np.nan), np.full((5, 3), np.nan),
            self._seconds,
        )  # fmt: skip


def scale_body(body: Body, scale: float) -> Body:
    """A body of another size, of the same build."""
    return replace(
        body,
        joints=body.joints * scale,
        surface=body.surface._replace(
            rest=body.surface.rest * scale, shapes=body.surface.shapes * scale
        ),
        joint_shapes=body.joint_shapes * scale,
    )
