"""A person tracked image by image in several cameras, for use while it goes on.

The first second is tracked as a recording is, which gives the bones, the noise and the way up.
After that each image of all cameras is solved together with the last few: exchanged sides, and the
chain from where it goes, or from the points of this image alone where those fit plainly better.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.io.cameras import CalibratedCamera
from motionary.io.keypoints import Views
from motionary.multiview.cameras import Sight, see, triangulate
from motionary.multiview.chain import Chain, ChainPose, place, points_of, pose_points
from motionary.multiview.exchange import right_sides
from motionary.multiview.solving import Pull, SolverSettings, ray_weights, solve_chain
from motionary.multiview.tracking import (
    find_upright,
    in_sequence_of,
    of_chain,
    tell_confidence,
    track_points,
)
from motionary.multiview.views import fit_views

Floats = NDArray[np.float64]

Status = Literal["starting", "tracked", "unsure", "none"]

# Images that are solved together; older ones stay as they are.
_WINDOW = 10
_SCALES: tuple[float, ...] = (0.08, 0.06)
_START_SCALES: tuple[float, ...] = (0.3, 0.15, 0.1)
# Frames at the window's start are held by so much.
_HELD = 10.0
# A pose through the points of one image replaces the tracked one if its rays fit so much better.
_BETTER = 0.8
_JUDGED_M = 0.1
# A pose is not made of an image in which more of the points are not known.
_UNKNOWN = 0.5
# Points that two cameras see: to begin, to go on, and of a person whom they lost.
_LEAST_POINTS, _LEAST_SEEN = 8, 4
_LOST_S = 0.25
_UNSURE = 0.4


class ViewPose(NamedTuple):
    """The person at one time.

    `points` (points, 3) in metres, y up, of the tracker's `names`, NaN while it starts or nobody is
    seen; `confidence` (points,); `status`, and `reason` in a few words.
    """

    points: Floats
    confidence: Floats
    status: Status
    reason: str


class _Known(NamedTuple):
    """What the first second told: points that are seen, the chain, noise, unit, turn to y up."""

    seen: list[int]
    chain: Chain
    settings: SolverSettings
    unit_m: float
    upright: Floats


class ViewTracker:
    """Tracks a person through the images of several calibrated cameras, one after the other.

    Parameters
    ----------
    cameras : as calibrated; their images are of the same times
    names : of the keypoints, as `LAYOUTS` has them
    rate_hz : images a second
    start_s : how long the person is looked at before tracking begins
    """

    def __init__(
        self,
        cameras: Sequence[CalibratedCamera],
        names: Sequence[str],
        *,
        rate_hz: float,
        start_s: float = 1.0,
    ) -> None:
        if len(cameras) < 2:
            raise InvalidInput(f"two cameras or more are needed, got {len(cameras)}")
        if not 0 < rate_hz < np.inf or not 0 < start_s < np.inf:
            raise InvalidInput(
                f"rate_hz and start_s must be positive, got {rate_hz:g} and {start_s:g}"
            )
        self.cameras, self.rate_hz = tuple(cameras), float(rate_hz)
        self.detected = tuple(names)
        #: Names of the points; those of the chain once tracking has begun.
        self.names = self.detected
        self._n_start = max(_WINDOW, round(start_s * rate_hz))
        self._known: _Known | None = None
        self.forget()

    def forget(self) -> None:
        """Start anew, as after a gap; bones, unit and the way up stay."""
        self._pixels: list[Floats] = []
        self._scores: list[Floats] = []
        self._pose: ChainPose | None = None
        self._unseen = 0

    def track(self, pixels: ArrayLike, scores: ArrayLike) -> ViewPose:
        """The pose at the next time.

        Parameters
        ----------
        pixels : array, shape (cameras, points, 2), NaN where nothing is detected
        scores : array, shape (cameras, points), in [0, 1]

        Raises
        ------
        InvalidInput
            If shapes are others, or what was seen at first does not fit the cameras, or lacks a
            hip; tracking then starts anew.
        """
        places, certain = self._check(pixels, scores)
        enough = int(((certain > 0).sum(axis=0) >= 2).sum())
        if enough < (_LEAST_SEEN if self._pose is not None else _LEAST_POINTS):
            self._unseen += 1
            if self._pose is None or self._unseen > _LOST_S * self.rate_hz:
                self.forget()
                return self._nothing("none", f"two cameras see {enough} points")
        else:
            self._unseen = 0
        self._pixels.append(places)
        self._scores.append(certain)
        if self._known is None:
            if len(self._pixels) < self._n_start:
                return self._nothing("starting", f"{len(self._pixels)} of {self._n_start} images")
            try:
                return self._begin()
            except InvalidInput:
                # What does not fit would be looked at again with each image, and grow.
                self.forget()
                raise
        self._pixels, self._scores = self._pixels[-_WINDOW:], self._scores[-_WINDOW:]
        return self._follow(self._known)

    def _check(self, pixels: ArrayLike, scores: ArrayLike) -> tuple[Floats, Floats]:
        places, certain = np.array(pixels, dtype=np.float64), np.array(scores, dtype=np.float64)
        shape = (len(self.cameras), len(self.detected))
        if places.shape != (*shape, 2) or certain.shape != shape:
            raise InvalidInput(
                f"needs pixels {(*shape, 2)} and scores {shape} (cameras, points), got "
                f"{places.shape} and {certain.shape}"
            )
        lost = ~np.isfinite(places).all(axis=2) | ~(certain > 0)
        places[lost], certain[lost] = np.nan, 0.0
        return places, certain

    def _nothing(self, status: Status, reason: str) -> ViewPose:
        n = len(self.names)
        return ViewPose(np.full((n, 3), np.nan), np.zeros(n), status, reason)

    def _views(self) -> Views:
        names = tuple(camera.name for camera in self.cameras)
        return Views(
            names, self.detected, np.stack(self._pixels, axis=1), np.stack(self._scores, axis=1)
        )

    def _begin(self) -> ViewPose:
        """Track what was gathered as a recording; told in words where cameras do not fit it."""
        fitted = fit_views(self._views(), self.cameras)
        upright, _ = find_upright(fitted.sight)
        seen = np.flatnonzero(fitted.sight.weights.any(axis=(0, 1))).tolist()
        sight = fitted.sight.turned(upright).of_points(seen)
        found = track_points(sight, rate_hz=self.rate_hz)
        self._known = _Known(seen, found.chain, found.settings, fitted.unit_m, upright)
        self.names = found.chain.points
        self._pixels, self._scores = self._pixels[-_WINDOW:], self._scores[-_WINDOW:]
        self._pose = ChainPose(found.pose.turns[-_WINDOW:], found.pose.centres[-_WINDOW:])
        return _tell(found.points[-1], found.confidence[-1])

    def _follow(self, known: _Known) -> ViewPose:
        """Solve the window with the new image."""
        chain = known.chain
        sight = see(self._views(), self.cameras, unit_m=known.unit_m).of_points(known.seen)
        sight = sight.turned(known.upright)
        before = self._pose
        if before is None:
            found = triangulate(sight).points
            if np.isnan(found[..., 0]).mean() > _UNKNOWN:
                self.forget()
                return self._nothing("none", "cameras agree on too few points")
            start = pose_points(chain, sight.names, _with_hips(sight.names, found))
            held = 0
        else:
            last = len(sight.weights[0]) - 1
            guess = _predict(chain, before)
            pairs = zip(before, guess, strict=True)
            start = ChainPose(*(np.concatenate([old[-last:], new]) for old, new in pairs))
            held = min(2, last)
        near = in_sequence_of(sight.names, chain.points, points_of(chain, start))
        right, _ = right_sides(sight, near=near)
        rays = of_chain(right, chain)
        anew = before is None or self._restart(chain, right, rays, start)
        scales = _START_SCALES if anew else _SCALES
        # The first frames stay where they are: they were told already.
        places = points_of(chain, start)
        pull = Pull(np.zeros((*places.shape, 3)), places)
        pull.matrices[:held] = _HELD * np.eye(3)
        pose = solve_chain(
            chain, start, rays, scales_m=scales, rate_hz=self.rate_hz, settings=known.settings,
            pull=pull,
        )  # fmt: skip
        self._pose = pose
        points = points_of(chain, pose)
        return _tell(points[-1], tell_confidence(rays, points)[-1])

    def _restart(self, chain: Chain, right: Sight, rays: Sight, start: ChainPose) -> bool:
        """Replace the last pose of a start by one through this image's points, if that fits better.

        Returns whether it was replaced.
        """
        found = triangulate(right.of_frames(slice(-1, None))).points
        if np.isnan(found[..., 0]).mean() > _UNKNOWN:
            return False
        through = pose_points(chain, right.names, _with_hips(right.names, found))
        own = rays.of_frames(slice(-1, None))
        one, other = (
            ray_weights(own, points_of(chain, pose), _JUDGED_M).sum()
            for pose in (ChainPose(start.turns[-1:], start.centres[-1:]), through)
        )
        if one >= _BETTER * other:
            return False
        start.turns[-1], start.centres[-1] = through.turns[0], through.centres[0]
        return True


def _predict(chain: Chain, pose: ChainPose) -> ChainPose:
    """The pose one image later, if the root goes on as it did.

    Turns that went on would carry the noise of two images into the next one.
    """
    roots = pose.centres[:, 0]
    root = 2 * roots[-1] - roots[-2 if len(roots) > 1 else -1]
    return place(chain, pose.turns[-1:], root[None])


def _with_hips(names: tuple[str, ...], points: Floats) -> Floats:
    """Points, with hips in the middle of the others where they are not known: the root is there."""
    own = [k for k, name in enumerate(names) if name.endswith("Hip")]
    middle = np.nanmean(points, axis=1, keepdims=True)
    result = points.copy()
    result[:, own] = np.where(np.isnan(points[:, own]), middle, points[:, own])
    return result


def _tell(points: Floats, confidence: Floats) -> ViewPose:
    mean = float(confidence.mean())
    if mean < _UNSURE:
        return ViewPose(points, confidence, "unsure", f"views tell {100 * mean:.0f} % of it")
    return ViewPose(points, confidence, "tracked", "")
