"""A body tracked in views of several cameras: sides, points, chain, and passes over all frames.

The sequence: exchanged sides first, points from rays, a chain through them, then passes in which
exchanges are decided anew against the chain and all frames are solved together.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.labels import LabelTrack, compare_labels
from motionary.models.library import ClassLibrary
from motionary.motion import Motion
from motionary.multiview.allocation import allocate, as_seen, bridge_gaps
from motionary.multiview.cameras import Sight, Triangulated, bridge, distances, triangulate
from motionary.multiview.chain import Chain, ChainPose, measure_chain, points_of, pose_points
from motionary.multiview.exchange import Exchange, right_sides
from motionary.multiview.poses import PoseMemory
from motionary.multiview.priors import AllocatedPrior, PriorTable, sole_points
from motionary.multiview.solving import Pull, SolverSettings, free_points, ray_weights, solve_chain
from motionary.recording import Recording, find_runs
from motionary.retrieval.annotation import annotate
from motionary.rotations import unit_vectors
from motionary.skeletons import named_mapping

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_FIRST_SCALES = (0.3, 0.15, 0.10)
_PASS_SCALES = (0.08, 0.06)
_FREE_SCALE = 0.06
_N_PASSES, _N_ITERATIONS = 3, 3
_LEAST_NOISE_M = 0.003
# The world's up is one of its axes if the body stands within so many degrees of it.
_AXIS_DEG = 25.0
TABLE = "body25"
# A foot stands where its slowest point is slower, and not higher above its lowest height.
_STANDING_SPEED, _STANDING_HEIGHT_M = 0.45, 0.06
_LEAST_STANCE_S = 0.1
_BELOW_M = 0.02
_SMOOTHED_S = 0.1


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


def track_points(sight: Sight, *, rate_hz: float) -> TrackedPoints:
    """The body's points in all frames, without priors."""
    right, exchanges = right_sides(sight)
    found = triangulate(right)
    chain = measure_chain(sight.names, found.points)
    pose = pose_points(chain, sight.names, bridge(found.points))
    settings = SolverSettings(noise_m=estimate_noise(right, found))
    own = of_chain(right, chain)

    def solve(scales_m: tuple[float, ...], pull: Pull | None = None) -> ChainPose:
        return solve_chain(
            chain, pose, own, scales_m=scales_m, rate_hz=rate_hz, settings=settings, pull=pull
        )

    pose = solve(_FIRST_SCALES)
    passes = [points_of(chain, pose)]
    for _ in range(_N_PASSES):
        near = in_sequence_of(sight.names, chain.points, passes[-1])
        right, exchanges = right_sides(sight, near=near)
        own = of_chain(right, chain)
        pose = solve(_PASS_SCALES)
        passes.append(points_of(chain, pose))
    pull = bridge_gaps(chain.points, passes[-1], tell_confidence(own, passes[-1]), settings)
    if pull.matrices.any():
        pose = solve(_PASS_SCALES * 2, pull)
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
) -> Recognised:
    """The track again with priors of what it is recognised as, until labels stand still.

    `found` is y up and without priors. Without `memory` poses of the recording's own best matches
    are lent; without `named` priors those count that templates tell by themselves.
    """
    names = found.chain.points
    floor = floor_of(names, found.points)
    labels: list[LabelTrack] = []
    priors: tuple[AllocatedPrior, ...] = ()
    iterations = [found.points]
    pose, points = found.pose, found.points
    for _ in range(_N_ITERATIONS):
        motion = Motion(names, points, recording, mapping=named_mapping(TABLE, names))
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
    where = [sight.names.index(name) if name in sight.names else -1 for name in chain.points]
    result = sight.of_points(where)
    lost = np.array(where) < 0
    result.directions[:, :, lost] = result.weights[:, :, lost] = 0.0
    return result._replace(names=chain.points)


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


# ---- how steady points are


class Steadiness(NamedTuple):
    """Measures of a track; NaN where there is nothing to measure.

    `sliding` of planted feet in m/s, horizontally; `below` fraction of frames with a foot more than
    2 cm below the floor; `gaps` fraction of points not known; `jitter` mean change of
    acceleration in m/s².
    """

    sliding: float
    below: float
    gaps: float
    jitter: float


def floor_of(names: tuple[str, ...], points: Floats) -> float | None:
    """Height of the floor: where the lower foot mostly is; None without feet.

    Feet in the air, as of jumps, and single wrong frames do not move it.
    """
    own = [k for side in "LR" for k in sole_points(names, side)]
    if not own:
        return None
    heights = points[:, own, 1]
    known = ~np.isnan(heights).all(axis=1)
    if not known.any():
        return None
    return float(np.percentile(np.nanmin(heights[known], axis=1), 10))


def stances(names: tuple[str, ...], points: Floats, rate_hz: float) -> dict[str, Bools]:
    """Frames in which each foot stands, "L" and "R"."""
    result = {}
    # A longer kernel would make the result longer than the motion.
    width = max(1, min(round(_SMOOTHED_S * rate_hz), len(points)))
    for side in "LR":
        own = sole_points(names, side)
        if not own:
            continue
        feet = points[:, own]
        speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1) * rate_hz
        heights = feet[..., 1] - np.nanpercentile(feet[..., 1], 5, axis=0)
        kernel = np.ones(width) / width
        slow = np.convolve(np.nan_to_num(speed.min(axis=1), nan=9.0), kernel, "same")
        low = np.nan_to_num(heights.min(axis=1), nan=9.0)
        mask = (slow < _STANDING_SPEED) & (low < _STANDING_HEIGHT_M)
        result[side] = _without_short(mask, round(_LEAST_STANCE_S * rate_hz))
    return result


def _without_short(mask: Bools, least: int) -> Bools:
    result = mask.copy()
    for first, stop in find_runs(mask).tolist():
        if stop - first < least:
            result[first:stop] = False
    return result


def measure_steadiness(
    names: tuple[str, ...],
    points: Floats,
    rate_hz: float,
    *,
    standing: dict[str, Bools],
    floor: float | None,
) -> Steadiness:
    """Sliding, floor, gaps and jitter of points; NaN = not known.

    `standing` has the frames in which each foot stands, the same for all tracks that are compared;
    `floor` is its height.
    """
    speeds = []
    for side, mask in standing.items():
        feet = points[:, sole_points(names, side)]
        # A foot rolls: its slowest point is the one that stands.
        step = np.linalg.norm(np.diff(feet[..., (0, 2)], axis=0), axis=-1) * rate_hz
        inside = mask[1:] & mask[:-1] & ~np.isnan(step).all(axis=1)
        speeds.append(np.nanmin(step[inside], axis=1))
    slid = np.concatenate(speeds) if speeds else np.zeros(0)
    below = np.nan
    own = [k for side in "LR" for k in sole_points(names, side)]
    if floor is not None and own:
        lowest = points[:, own, 1]
        below = float((np.nan_to_num(lowest, nan=np.inf) < floor - _BELOW_M).any(axis=1).mean())
    jerk = np.linalg.norm(np.diff(points, n=3, axis=0), axis=-1) * rate_hz**2
    return Steadiness(
        float(slid.mean()) if len(slid) else np.nan,
        below,
        float(np.isnan(points[..., 0]).mean()),
        float(np.nanmean(jerk)) if np.isfinite(jerk).any() else np.nan,
    )
