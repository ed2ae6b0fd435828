"""A person's pose from image to image of one depth camera.

After Baak (2012), chapter 8: two hypotheses, the last pose fitted to the image and a pose of the
database that the extrema lead to, of which the image chooses one.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body, Camera, load_body
from motionary.depth import fitting, lookup, poses
from motionary.depth.clouds import N_EXTREMA, Cloud, build_graph, find_extrema, prepare
from motionary.depth.fitting import State
from motionary.depth.judging import (
    LEAST_POINTS,
    UNSURE_M,
    Ends,
    Found,
    Hypothesis,
    Seen,
    TrackedPose,
    TrackerSettings,
    judge_cloud,
    judge_pose,
    nothing_found,
)
from motionary.errors import InvalidInput
from motionary.matching.distance import Engine

Floats = NDArray[np.float64]
MEAN_STATURE_M = 1.659
# A rival whose images are off by so much more is beaten.
_CLEAR = 1.06
_POINTS_OF_CENTRE = 500
# A candidate so many times as far from the image as the local pose never won on HDM05's bd and dg.
_HOPELESS = 2.2
# The lookup is asked at once where the local pose is so many times worse than usual.
_WORSE, _FADING = 1.15, 0.1


class DepthTracker:
    """Tracks a person through the images of a depth camera, one after the other.

    Parameters
    ----------
    camera : Camera
    database : of poses; the one that ships if None
    body : to begin with; the mean adult, scaled to `stature_m`, if None
    stature_m : of the person
    settings : how it is tracked
    background : depth of the empty scene
    engine : which twins compute
    """

    def __init__(
        self,
        camera: Camera,
        database: poses.PoseDatabase | None = None,
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
        self.database = database or poses.load_database()
        scale = stature_m / MEAN_STATURE_M
        #: The person's shape, once it is known.
        self.person: fitting.PersonShape | None = None
        self._views: list[fitting.View] = []
        self._images = 0
        self._wear(body or poses.scale_body(load_body(), scale), scale)
        self.forget()

    def forget(self) -> None:
        """Start anew, as after a gap; the body stays."""
        self._state: State | None = None
        self._last: Floats | None = None
        self._extrema: Floats | None = None
        self._heading = 0.0
        self._rival: State | None = None
        self._duel = np.zeros(3)
        # Images since the lookup was asked, what the pose is usually off, what spoke against it.
        self._since, self._usual, self._against = 0, 0.0, ""
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
            self.forget()
            reason = f"no person is seen: {len(cloud.points)} points are left"
            return nothing_found(self.body, reason, self._seconds)
        seen = self._look(cloud)
        found: list[Found] = []
        if self._state is not None and self.settings.hypotheses != "lookup":
            found.append(self._follow("local", self._state, seen))
            if found[0].cost > _WORSE * self._usual and seen.ends is None:
                seen = seen._replace(ends=self._search(cloud))
        if seen.ends is not None and (self._state is None or self.settings.hypotheses != "local"):
            starts = self._look_up(seen, seen.ends, found[0] if found else None)
            found += [self._follow("lookup", start, seen) for start in starts]
        best = self._vote(found, seen)
        self._usual += (best.cost - self._usual) * (_FADING if self._state is not None else 1.0)
        self._state = best.state
        result = self._finish(seen, best)
        self._remember(seen, result)
        return result

    @contextmanager
    def _timed(self, part: str) -> Iterator[None]:
        began = time.thread_time()
        yield
        self._seconds[part] = self._seconds.get(part, 0.0) + time.thread_time() - began

    def _look(self, cloud: Cloud) -> Seen:
        """What is seen, and every few images what the lookup needs."""
        with self._timed("lookup"):
            small, eye = fitting.shrink(cloud.depth, self.camera, self.settings.pixels)
        self._since += 1
        due = self._state is None or self._since >= self.settings.every
        points = fitting.thin(cloud.points, self.settings.surface.points)
        return Seen(cloud, points, small, eye, self._search(cloud) if due else None)

    def _search(self, cloud: Cloud) -> Ends:
        self._since = 0
        with self._timed("extrema"):
            graph = build_graph(cloud, self.camera.focal[0], engine=self.engine)
            extrema = find_extrema(graph, N_EXTREMA, engine=self.engine).points
        with self._timed("lookup"):
            # A tenth of the points has the same middle to some millimetres.
            step = max(len(graph.points) // _POINTS_OF_CENTRE, 1)
            centre = poses.find_centre(graph.points[::step], graph.torso[::step])
            chosen = extrema[:5]
            if self._state is not None and not self.settings.published:
                chosen = lookup.choose_ends(extrema, self._vertices(self._state)[self.body.ends])
        return Ends(graph, extrema, chosen, centre)

    def _look_up(self, seen: Seen, ends: Ends, local: Found | None) -> list[State]:
        """Poses of the database that the extrema lead to."""
        with self._timed("lookup"):
            last, joints = None, None
            if self._state is not None:
                last = self._vertices(self._state)[self.body.ends]
                joints = self._joints(self._state)
            jumped = lookup.has_jumped(ends.extrema[:5], self._extrema)
            self._extrema = ends.extrema[:5]
            assignments = lookup.permit(ends.chosen, last, jumped=jumped)
            sets = [
                lookup.find_candidates(
                    self.lookup, ends.chosen, assignments, ends.centre, heading, self.camera,
                    last=joints,
                )
                for heading in self._headings(ends)
            ]  # fmt: skip
        return self._rank(sets, seen, self._reach(ends, local), local)

    def _headings(self, ends: Ends) -> list[float]:
        """Viewing directions that candidates are turned to."""
        away = self.camera.position - ends.centre
        if self._state is not None and not self.settings.published:
            return [self._heading_of(self._state)]
        measured = poses.find_heading(ends.graph.points, ends.centre, away)
        if self._state is None:
            self._heading = measured.angle if measured.trust > 0 else np.arctan2(away[0], away[2])
        else:
            turn = (measured.angle - self._heading + np.pi) % (2 * np.pi) - np.pi
            self._heading += 0.5 * measured.trust * turn
        if self.settings.published:
            return [float(self._heading)]
        return [float(self._heading), float(self._heading + np.pi)]

    def _reach(self, seen: Ends, local: Found | None) -> list[State]:
        """The local pose with limbs at extrema that it does not explain."""
        if local is None or self.settings.published:
            return []
        with self._timed("lookup"):
            vertices = self._vertices(local.state)
            extrema = seen.extrema[:10]
            away = ((extrema[:, None] - vertices[None]) ** 2).sum(axis=2).min(axis=1)
            far = extrema[away > lookup.UNEXPLAINED_M**2][:2]
            ends = vertices[self.body.ends]
            return [
                state
                for one in far
                for state in lookup.reach(self.surface, local.state, ends, one, engine=self.engine)
            ]

    def _rank(
        self, sets: list[lookup.Candidates], seen: Seen, more: list[State], local: Found | None
    ) -> list[State]:
        """The best candidates: by (8.6), or by the image, if the local pose is not far better."""
        if self.settings.published:
            return sets[0].first_states(self.lookup, 1)
        with self._timed("lookup"):
            first = self._state is None
            ranked = self.settings.ranked * (5 if first else 1)
            groups = [one.first_states(self.lookup, ranked) for one in sets]
            groups[0] += more
            vertices = [self._vertices(state) for group in groups for state in group]
            costs = fitting.compare_images(
                np.stack(vertices), self.body.faces, seen.small, seen.eye, engine=self.engine
            ).costs
            # The best of each viewing direction: at the start both are followed.
            best: list[State] = []
            at = 0
            for group in groups:
                order = np.argsort(costs[at : at + len(group)], kind="stable")
                if first or local is None or costs[at + order[0]] < _HOPELESS * local.cost:
                    best += [group[k] for k in order[: 3 if first else 1]]
                at += len(group)
            return best

    def _follow(self, name: Hypothesis, start: State, seen: Seen) -> Found:
        """A hypothesis: the pose fitted from a start, and how far it is from the image."""
        settings = self.settings.surface
        visible = None
        with self._timed("local"):
            if self.settings.published:
                assert seen.ends is not None
                points = seen.ends.graph.points
                state = fitting.fit_published(self.surface, start, points, steps=settings.steps)
            else:
                state, visible = fitting.fit_pose(
                    self.surface, start, seen.points, seen.cloud.depth, self.camera,
                    settings=settings, engine=self.engine,
                )  # fmt: skip
        with self._timed("voting"):
            return Found(name, state, visible, self._compare(state, seen))

    def _compare(self, state: State, seen: Seen) -> fitting.Comparison:
        """How far a pose is from the image: by rendering it, or by (8.7) and (8.8)."""
        vertices = self._vertices(state)
        if not self.settings.published:
            return fitting.compare_images(
                vertices[None], self.body.faces, seen.small, seen.eye, engine=self.engine
            )
        from scipy.spatial import cKDTree

        assert seen.ends is not None
        to_points = cKDTree(seen.ends.graph.points).query(vertices[self._fixed])[0].mean()
        to_model = cKDTree(vertices).query(seen.ends.extrema)[0].mean()
        return fitting.Comparison(
            np.array([to_points + to_model]), np.full_like(seen.small, np.nan)
        )

    def _vote(self, found: list[Found], seen: Seen) -> Found:
        """The hypothesis nearest to the image (8.9); the lookup must be nearer by some."""
        costs = np.array([one.cost for one in found])
        if self.settings.published:
            return found[int(costs.argmin())]
        if self._state is None and len(found) > 1:
            round_ = lookup.turn_round(self.surface, found[int(costs.argmin())].state, self.camera)
            found = [*found, self._follow("lookup", round_, seen)]
            return self._open_duel(found)
        leads = np.array([self.settings.lead * (one.name == "lookup") for one in found])
        best = found[int((costs * (1 + leads)).argmin())]
        return self._fight(best, seen) if self._rival is not None else best

    def _open_duel(self, found: list[Found]) -> Found:
        """The best start; the best that looks another way is followed beside for a while."""
        order = np.array([one.cost for one in found]).argsort()
        best = found[int(order[0])]
        own = self._heading_of(best.state)
        for k in order[1:]:
            turn = self._heading_of(found[int(k)].state) - own
            if self.settings.duel and np.cos(turn) < 0:
                self._rival, self._duel = found[int(k)].state, np.zeros(3)
                break
        return best

    def _fight(self, best: Found, seen: Seen) -> Found:
        """The better of the pose and the one that looks the other way, by all images so far."""
        assert self._rival is not None
        rival = self._follow("local", self._rival, seen)
        self._duel += best.cost, rival.cost, 1
        self._rival = rival.state
        if self._duel[1] < self._duel[0]:
            self._rival, best = best.state, rival
            self._duel[:2] = self._duel[1::-1]
        # A duel that is not decided goes on.
        if (self._duel[2] >= self.settings.duel and self._is_clear()) or (
            np.cos(self._heading_of(self._rival) - self._heading_of(best.state)) > 0
        ):
            self._rival = None
        return best

    def _is_clear(self) -> bool:
        """Whether all images so far speak against the pose that looks the other way."""
        return bool(self._duel[1] >= _CLEAR * self._duel[0])

    def _heading_of(self, state: State) -> float:
        turned = fitting.place_surface(self.surface, state, engine=self.engine)[0]
        return float(poses.heading_of(turned[None], self.body)[0])

    def _remember(self, seen: Seen, result: TrackedPose) -> None:
        """Keep images of the first second, and fit the person's shape to them at its end."""
        after = self.settings.shape_after
        if self.settings.published or not after or self.person is not None:
            return
        self._images += 1
        if result.status == "none" or self._state is None:
            return
        if self._images % max(after // fitting.N_IMAGES, 1) == 0:
            self._views.append(fitting.View(seen.points, seen.cloud.depth, self._state))
        if self._images >= after and len(self._views) >= fitting.N_IMAGES // 2:
            with self._timed("shape"):
                self.person, states = fitting.fit_person(
                    self._views[-fitting.N_IMAGES:], self.camera, self.database, scale=self._scale,
                    settings=self.settings.surface, engine=self.engine,
                )  # fmt: skip
                self._wear(self.person.body, self.person.scale)
                self._state = states[-1]
            self._views = []

    def _wear(self, body: Body, scale: float) -> None:
        """Take a body, and place the database in it."""
        self.body, self._scale = body, scale
        self.surface: fitting.Surface = fitting.make_surface(
            body, self.database, self.settings.surface
        )
        self.lookup: lookup.Lookup = lookup.make_lookup(body, self.database, scale=scale)
        self._fixed = fitting.spread(body.vertices, fitting.PUBLISHED_VERTICES)

    def _vertices(self, state: State) -> Floats:
        return fitting.place_vertices(self.surface, state, engine=self.engine)

    def _joints(self, state: State) -> Floats:
        return fitting.place_surface(self.surface, state, engine=self.engine)[1]

    def _finish(self, seen: Seen, best: Found) -> TrackedPose:
        vertices, joints = self._vertices(best.state), self._joints(best.state)
        last = joints if self._last is None else self._last
        self._last, moved = joints, np.linalg.norm(joints - last, axis=1)
        confidence, reason = np.ones(len(joints)), ""
        if not self.settings.published:
            with self._timed("voting"):
                confidence = judge_pose(
                    self.surface, joints, best.visible, best.comparison, seen.eye, moved=moved
                )
                if seen.ends is not None:
                    self._against = judge_cloud(seen.cloud, seen.ends.graph, self.camera)
                reason = self._against
            if not reason and best.cost > UNSURE_M:
                reason = f"the pose is off from what is seen: by {100 * best.cost:.0f} cm"
            if (
                not reason
                and self._rival is not None
                and (not self._is_clear() or self._duel[2] < 5)
            ):
                reason = "it is not clear yet which way the person looks"
        extrema, chosen = np.full((N_EXTREMA, 3), np.nan), np.full((5, 3), np.nan)
        if seen.ends is not None:
            extrema, chosen = seen.ends.extrema, seen.ends.chosen
        return TrackedPose(
            joints, best.state.turns, vertices[self.body.ends], confidence, best.name,
            "unsure" if reason else "tracked", reason, best.cost, extrema, chosen, self._seconds,
        )  # fmt: skip
