"""A body tracked in views of several cameras: sides, points, chain, and passes over all frames.

The sequence: exchanged sides first, points from rays, a chain through them, then passes in which
exchanges are decided anew against the chain and all frames are solved together.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.io.cameras import CalibratedCamera
from motionary.io.keypoints import Views
from motionary.labels import LabelTrack, compare_labels
from motionary.models.library import ClassLibrary
from motionary.motion import Motion
from motionary.multiview.allocation import allocate, as_seen, bridge_gaps
from motionary.multiview.cameras import Sight, distances
from motionary.multiview.chain import (
    Chain,
    ChainPose,
    measure_chain,
    points_of,
    pose_points,
    to_skeleton,
)
from motionary.multiview.exchange import Exchange, exchange_sources, find_exchanges
from motionary.multiview.poses import PoseMemory
from motionary.multiview.priors import AllocatedPrior, PriorTable
from motionary.multiview.solving import Pull, SolverSettings, free_points, ray_weights, solve_chain
from motionary.multiview.steadiness import Steadiness, floor_of, measure_steadiness, stances
from motionary.multiview.triangulation import Triangulated, bridge, triangulate
from motionary.multiview.untangling import in_own_frames, label_exchanges
from motionary.multiview.views import open_views
from motionary.recording import Recording
from motionary.retrieval.annotation import annotate
from motionary.rotations import unit_vectors
from motionary.skeletons import named_mapping

Floats = NDArray[np.float64]

_FIRST_SCALES = (0.3, 0.15, 0.10)
_PASS_SCALES = (0.08, 0.06)
_FREE_SCALE = 0.06
_N_PASSES, _N_ITERATIONS = 3, 3
_LEAST_NOISE_M = 0.003
# The world's up is one of its axes if the body stands within so many degrees of it.
_AXIS_DEG = 25.0
_TABLE = "body25"


class TrackedPoints(NamedTuple):
    """A chain tracked in views.

    `points` (frames, points, 3) of `chain.points`; `by_pass` the same after each pass;
    `confidence` (frames, points) in [0, 1].
    """

    chain: Chain
    pose: ChainPose
    points: Floats
    confidence: Floats
    exchanges: tuple[Exchange, ...]
    triangulated: Triangulated
    by_pass: tuple[Floats, ...]
    settings: SolverSettings
    sight: Sight


def track_points(sight: Sight, *, rate_hz: float, n_passes: int = _N_PASSES) -> TrackedPoints:
    """The body's points in all frames, without priors."""
    exchanges = find_exchanges(sight)
    right = sight.exchanged(exchange_sources(sight, exchanges))
    found = triangulate(right)
    chain = measure_chain(sight.names, found.points)
    pose = pose_points(chain, sight.names, bridge(found.points))
    settings = SolverSettings(noise_m=estimate_noise(right, found))
    pose = solve_chain(
        chain, pose, of_chain(right, chain), scales_m=_FIRST_SCALES, rate_hz=rate_hz,
        settings=settings,
    )  # fmt: skip
    passes = [points_of(chain, pose)]
    for _ in range(n_passes):
        near = in_sequence_of(sight.names, chain.points, passes[-1])
        exchanges = find_exchanges(sight, near=near)
        right = sight.exchanged(exchange_sources(sight, exchanges))
        pose = solve_chain(
            chain, pose, of_chain(right, chain), scales_m=_PASS_SCALES, rate_hz=rate_hz,
            settings=settings,
        )  # fmt: skip
        passes.append(points_of(chain, pose))
    own = of_chain(right, chain)
    pull = bridge_gaps(chain.points, passes[-1], tell_confidence(own, passes[-1]), settings)
    if pull.matrices.any():
        pose = solve_chain(
            chain, pose, own, scales_m=_PASS_SCALES * 2, rate_hz=rate_hz, settings=settings,
            pull=pull,
        )  # fmt: skip
        passes[-1] = points_of(chain, pose)
    points = free_points(
        own, passes[-1], rate_hz=rate_hz, settings=settings, scale_m=_FREE_SCALE, pull=pull
    )
    return TrackedPoints(
        chain, pose, points, tell_confidence(own, points), exchanges, found, tuple(passes),
        settings, own,
    )  # fmt: skip


def tell_confidence(sight: Sight, points: Floats) -> Floats:
    """How well views tell points: 1 where two whole rays or more agree, (frames, points)."""
    told: Floats = ray_weights(sight, points, _FREE_SCALE).sum(axis=0) / 2
    return np.minimum(told, 1.0)


class Recognised(NamedTuple):
    """A track that recognised motion steadied.

    `found` the track; `priors` those that were tried, by time; `labels` after each iteration;
    `iterations` the points after each.
    """

    found: TrackedPoints
    priors: tuple[AllocatedPrior, ...]
    labels: tuple[LabelTrack, ...]
    iterations: tuple[Floats, ...]


def steady(
    found: TrackedPoints,
    library: ClassLibrary,
    recording: Recording,
    *,
    memory: PoseMemory | None = None,
    named: PriorTable | None = None,
    n_iterations: int = _N_ITERATIONS,
) -> Recognised:
    """The track again with priors of what it is recognised as, until labels stand still.

    Parameters
    ----------
    found : a track without priors, y up
    library : classes to recognise
    recording : of the labels
    memory : poses of examples; None lends those of the recording's own best matches
    named : priors of templates by name; None takes those that templates tell by themselves
    """
    names = found.chain.points
    floor = floor_of(names, found.points)
    labels: list[LabelTrack] = []
    priors: tuple[AllocatedPrior, ...] = ()
    iterations = [found.points]
    pose, points = found.pose, found.points
    for _ in range(n_iterations):
        motion = Motion(names, points, recording, mapping=named_mapping(_TABLE, names))
        labels.append(annotate(as_seen(motion, found.confidence), library))
        if len(labels) > 1 and all(c.kind == "kept" for c in compare_labels(*labels[-2:])):
            break
        told = allocate(
            motion, found.confidence, library, settings=found.settings, memory=memory,
            priors=named, floor=floor,
        )  # fmt: skip
        priors = told.priors
        # Always from the pose that views alone gave: priors must not feed on themselves.
        pose, points = _solve_with(found, told.pull, told.lent, recording.rate_hz)
        iterations.append(points)
    steadied = found._replace(pose=pose, points=points)
    return Recognised(steadied, priors, tuple(labels), tuple(iterations))


def _solve_with(
    found: TrackedPoints, pull: Pull, lent: NDArray[np.bool_], rate_hz: float
) -> tuple[ChainPose, Floats]:
    """Pose and points of a track with priors."""
    pose, sight = found.pose, found.sight
    # Where nothing tells a limb, single wrong rays hold it: what is lent goes first without them.
    first = sight._replace(weights=np.where(lent, 0.0, sight.weights))
    for rays in (first, sight):
        pose = solve_chain(
            found.chain, pose, rays, scales_m=_PASS_SCALES * 2, rate_hz=rate_hz,
            settings=found.settings, pull=pull,
        )  # fmt: skip
    points = free_points(
        sight, points_of(found.chain, pose), rate_hz=rate_hz, settings=found.settings,
        scale_m=_FREE_SCALE, pull=pull,
    )  # fmt: skip
    return pose, points


def of_chain(sight: Sight, chain: Chain) -> Sight:
    """Rays of the chain's points, in its sequence; without weight where none is detected."""
    n_cameras, n_frames = sight.weights.shape[:2]
    directions = np.zeros((n_cameras, n_frames, len(chain.points), 3))
    weights = np.zeros((n_cameras, n_frames, len(chain.points)))
    for k, name in enumerate(chain.points):
        if name in sight.names:
            directions[:, :, k] = sight.directions[:, :, sight.names.index(name)]
            weights[:, :, k] = sight.weights[:, :, sight.names.index(name)]
    return sight._replace(directions=directions, weights=weights, names=chain.points)


def estimate_noise(sight: Sight, found: Triangulated) -> float:
    """Standard deviation of rays at the person, by how far they miss triangulated points."""
    far = distances(sight, np.nan_to_num(found.points))[0]
    used = found.used & ~np.isnan(found.points[..., 0])
    if not used.any():
        return 0.02
    views = np.maximum(used.sum(axis=0), 2)
    # A point takes three of the two numbers that each ray gives.
    freedom = np.sqrt(2 * views / np.maximum(2 * views - 3, 1))
    missed = (far * freedom)[used]
    # Of a normal distribution in the plane, half lies within 1.18 standard deviations.
    return max(float(np.median(missed) / 1.18), _LEAST_NOISE_M)


# ---- from files to a motion


@dataclass(frozen=True, slots=True, eq=False)
class Tracking:
    """What was tracked.

    Attributes
    ----------
    motion : keypoints of all frames, y up, metres
    rig : the chain with its turns, for formats that hold rigs; bones of constant length
    confidence : array, shape (frames, points): 1 where two views or more agree, 0 where none tells
    exchanges : exchanged sides as labels
    cameras : in metres, in the axes of the motion
    offsets : by how many frames each camera's images are late
    before, after : steadiness of triangulated and of tracked points
    floor_m : height of the floor; None if no foot is seen
    labels : what was recognised, with a library; None without
    priors : what the recognised motion told, and whether it was taken
    notes : what was assumed and noticed, a sentence each
    """

    motion: Motion
    rig: Motion
    confidence: Floats
    exchanges: LabelTrack
    cameras: tuple[CalibratedCamera, ...]
    offsets: tuple[int, ...]
    before: Steadiness
    after: Steadiness
    floor_m: float | None
    labels: LabelTrack | None
    priors: tuple[AllocatedPrior, ...]
    notes: tuple[str, ...]


def track(
    keypoints: str | Path | Views,
    cameras: str | Path | Sequence[CalibratedCamera],
    *,
    rate_hz: float,
    library: ClassLibrary | None = None,
    memory: PoseMemory | None = None,
    named: PriorTable | None = None,
    unit: str | None = None,
    synchronise: bool = False,
) -> Tracking:
    """A person tracked by keypoints of several calibrated cameras.

    Parameters
    ----------
    keypoints : a folder with a folder for each camera, or what `read_keypoints` gives
    cameras : a calibration, or what `read_cameras` gives
    rate_hz : images a second
    library : classes of motion; what is recognised holds resting feet, and lends poses to limbs
        that no view tells
    memory : poses of people, from `remember_poses`; without it the recording's own are lent
    named : what templates mark by name, from `read_priors`; None takes what they mark themselves
    unit : of the calibration: m, dm, cm, mm; found by the length of the legs, if None
    synchronise : move images of cameras that are late or early, instead of refusing them

    Raises
    ------
    InvalidInput
        If cameras and images do not fit; says what would.
    """
    views, fitted, recording = open_views(
        keypoints, cameras, rate_hz=rate_hz, unit=unit, synchronise=synchronise
    )
    upright, said = find_upright(fitted.sight)
    sight = fitted.sight._replace(
        directions=fitted.sight.directions @ upright.T, origins=fitted.sight.origins @ upright.T
    )
    # Points that the layout has and the detector never gives would be made up in every frame.
    sight = sight.of_points(np.flatnonzero(sight.weights.any(axis=(0, 1))).tolist())
    found = track_points(sight, rate_hz=rate_hz)
    steadied = (
        None if library is None else steady(found, library, recording, memory=memory, named=named)
    )
    if steadied is not None:
        found = steadied.found
    names = found.chain.points
    floor = floor_of(names, found.points)
    exchanges = in_own_frames(found.exchanges, fitted.offsets)
    before, after = _compare(found, sight.names, rate_hz, floor)
    return Tracking(
        Motion(names, found.points, recording, mapping=named_mapping(_TABLE, names)),
        _rig(found, recording),
        found.confidence,
        label_exchanges(exchanges, views.cameras, recording),
        fitted.place_cameras(views.cameras, upright),
        tuple(fitted.offsets.tolist()),
        before,
        after,
        floor,
        None if steadied is None else steadied.labels[-1],
        () if steadied is None else steadied.priors,
        (*views.notes, *fitted.notes, said, *_describe(found)),
    )


def _compare(
    found: TrackedPoints, names: tuple[str, ...], rate_hz: float, floor: float | None
) -> tuple[Steadiness, Steadiness]:
    """Steadiness of the detected points as triangulated and as tracked."""
    tracked = in_sequence_of(names, found.chain.points, found.points)
    standing = stances(names, tracked, rate_hz)
    before, after = (
        measure_steadiness(names, points, rate_hz, standing=standing, floor=floor)
        for points in (found.triangulated.points, tracked)
    )
    return before, after


def in_sequence_of(wanted: tuple[str, ...], names: tuple[str, ...], points: Floats) -> Floats:
    """Points in another sequence of names; NaN for those that are not there."""
    result = np.full((len(points), len(wanted), 3), np.nan)
    for k, name in enumerate(wanted):
        if name in names:
            result[:, k] = points[:, names.index(name)]
    return result


def find_upright(sight: Sight) -> tuple[Floats, str]:
    """The turn that puts the world's up along y, and what was found.

    The axis of the world along which the body stands, or where the body stands along none, the
    mean direction of its trunk and legs.
    """
    points = triangulate(sight).points

    def middle(part: str) -> Floats:
        own = [k for k, name in enumerate(sight.names) if name in (f"L{part}", f"R{part}", part)]
        return points[:, own].mean(axis=1) if own else np.full((len(points), 3), np.nan)

    long = np.nan_to_num(unit_vectors(middle("Shoulder") - middle("Ankle")))
    if not long.any():
        long = np.nan_to_num(unit_vectors(middle("Shoulder") - middle("Hip")))
    up = unit_vectors(np.median(long[long.any(axis=1)], axis=0)) if long.any() else np.eye(3)[1]
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    nearest = int((axes @ up).argmax())
    angle = float(np.degrees(np.arccos(np.clip(axes[nearest] @ up, -1, 1))))
    if angle <= _AXIS_DEG:
        up = axes[nearest]
        said = f"up is {'-' if nearest > 2 else ''}{'xyz'[nearest % 3]} of the calibration"
    else:
        said = (
            f"up is along the body: it stands {angle:.0f} degrees away from any axis of the "
            "calibration"
        )
    # Axes keep their cycle: of a world with z up, y, z, x become x, y, z, as in Pose2Sim's files.
    side = np.eye(3)[(int(np.abs(up).argmax()) + 2) % 3]
    x = unit_vectors(side - (side @ up) * up)
    return np.stack([x, up, np.cross(x, up)]), said


def _rig(found: TrackedPoints, recording: Recording) -> Motion:
    skeleton, rotations, places = to_skeleton(found.chain, found.pose)
    return Motion(
        skeleton.names, places, recording, mapping=None, skeleton=skeleton, rotations=rotations
    )


def _describe(found: TrackedPoints) -> list[str]:
    """Notes on what the views are worth."""
    alone = float((found.confidence <= 0.05).mean())
    notes = [f"rays at the person are certain to {1000 * found.settings.noise_m:.0f} mm"]
    if alone > 0:
        notes.append(f"{100 * alone:.1f} % of points are told by no view, but by the chain alone")
    return notes
