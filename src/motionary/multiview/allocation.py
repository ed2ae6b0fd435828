"""Priors of recognised motion, given to the frames of a track where they prove themselves.

After Baak (2012), sections 6.4.1 to 6.4.3. A foot that a template says rests is held if it does
not plainly move; changes of poses are lent to points that no view tells if they bridge stretches
that were seen, held out, better than a straight way does. So a wrong label does no harm.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import compute_features
from motionary.models.library import ClassLibrary
from motionary.motion import Motion
from motionary.multiview.priors import (
    LENT,
    SEQUENCE_HZ,
    BodyFrame,
    PoseMemory,
    find_matches,
    named_priors,
    own_axes,
    prototypes,
    remember_best,
)
from motionary.multiview.solving import Pull, SolverSettings
from motionary.multiview.steadiness import sole_points
from motionary.recording import find_runs
from motionary.retrieval.explanation import Evidence

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_LIMBS = {"legs": ("Knee", "Ankle", "BigToe"), "arms": ("Elbow", "Wrist")}
# A point that views tell less of takes what is lent.
_SEEN, _UNSEEN, _TOLD = 0.5, 0.3, 0.15
# Shorter holes between seen frames count as seen: smoothing bridges them.
_HOLES_S = 0.1
# How far a limb is off a straight way over a gap, about.
_STRAIGHT_M = 0.1
# Priors are tried on seen stretches of so long, held out; a prior must be better by so much.
_TRIED_S, _EDGE = 0.5, 4
_BETTER = 0.75
# Errors of lent poses last: neighbouring frames are no further evidence.
_LASTING_FRAMES = 5.0
_RESTING_SPEED = 0.6
_HOLD_WEIGHT, _HOLD_SCALE_M, _FLOOR_SCALE_M = 2.0, 0.05, 0.15
_LEAST_REST_S = 0.1


class AllocatedPrior(NamedTuple):
    """A prior in the track.

    `name` such as "left foot rests" or "legs as in walk"; frames `first` up to `stop`; `cost` of
    its match; `kept` whether it proved itself; `reason` in a few words.
    """

    name: str
    motion_class: str
    first: int
    stop: int
    cost: float
    kept: bool
    reason: str


class _Track(NamedTuple):
    """What priors are held against: points (frames, points, 3), their confidence, the rate."""

    names: tuple[str, ...]
    points: Floats
    confidence: Floats
    rate_hz: float


def allocate(
    motion: Motion,
    confidence: Floats,
    library: ClassLibrary,
    *,
    settings: SolverSettings,
    memory: PoseMemory | None = None,
    floor: float | None = None,
) -> tuple[Pull, list[AllocatedPrior]]:
    """Where recognised motion wants the points of a track, and which priors that were.

    Parameters
    ----------
    motion : keypoints as tracked, mapped to generic joints
    confidence : array, shape (frames, points)
    library : classes to recognise
    settings : of the solver, for weights
    memory : poses of examples; None lends those of the recording's own best match
    floor : height of the floor; None holds resting feet without it
    """
    track = _Track(motion.names, motion.positions, confidence, motion.rate_hz)
    seen = as_seen(motion, confidence)
    sequence = compute_features(seen, feature_set=library.feature_set)
    matches = find_matches(sequence, library)
    pull = bridge_gaps(track.names, track.points, confidence, settings)
    told: list[AllocatedPrior] = []
    for match in matches:
        told += _hold_feet(track, match, pull, floor)
    own, frame = own_axes({name: track.points[:, k] for k, name in enumerate(track.names)})
    if memory is None:
        memory = remember_best(library, matches, own, track.rate_hz)
    keys = prototypes(library)
    by_class: dict[str, list[Evidence]] = {}
    for match in matches:
        if keys[id(match.pattern)] in memory.poses:
            by_class.setdefault(match.name, []).append(match)
    for same in by_class.values():
        lent = [memory.poses[keys[id(match.pattern)]] for match in same]
        if any(len(one) != len(m.template.values) for one, m in zip(lent, same, strict=True)):
            raise InvalidInput(
                f"the memory of poses is of other templates of {same[0].name!r} than the "
                "library's; make it anew with remember_poses"
            )
        told += _lend_poses(track, same, lent, own, frame, pull, settings)
    return pull, sorted(told, key=lambda one: (one.first, one.name))


def as_seen(motion: Motion, confidence: Floats) -> Motion:
    """The motion without points that no view tells: what is made up is not recognised."""
    told = _close(confidence > _TOLD, round(_HOLES_S * motion.rate_hz))
    return replace(motion, positions=np.where(told[..., None], motion.positions, np.nan))


def _close(mask: Bools, most: int) -> Bools:
    """The mask with holes along frames closed that are no longer than `most`."""
    result = mask.copy()
    for k in range(mask.shape[1]):
        for first, stop in find_runs(~mask[:, k]).tolist():
            if stop - first <= most and first > 0 and stop < len(mask):
                result[first:stop, k] = True
    return result


def bridge_gaps(
    names: tuple[str, ...], points: Floats, confidence: Floats, settings: SolverSettings
) -> Pull:
    """Pull points that views do not tell to a straight way, in body axes, over each gap.

    Smoothness alone would let them swing on with the speed they had.
    """
    own, frame = own_axes({name: points[:, k] for k, name in enumerate(names)})
    pull = Pull(np.zeros((*confidence.shape, 3, 3)), np.zeros((*confidence.shape, 3)))
    track = _Track(names, points, confidence, 0.0)
    members = [k for k, name in enumerate(LENT) if name in names]
    weight = (settings.noise_m / _STRAIGHT_M) ** 2 / _LASTING_FRAMES
    where = [names.index(list(LENT)[k]) for k in members]
    _pull_limb(track, where, own[:, members], np.zeros_like(own[:, members]), frame, pull, weight)
    return pull


def _frames_of(match: Evidence, track: _Track) -> NDArray[np.intp]:
    """The column of each frame of the track, -1 outside of the match."""
    path = match.alignment.path
    columns = np.full(len(track.points), -1, dtype=np.intp)
    at = np.round(path[:, 1] * track.rate_hz / SEQUENCE_HZ).astype(np.intp)
    inside = at < len(columns)
    at, rows = at[inside], path[inside, 0]
    if len(at) < 2:
        return columns
    span = np.arange(at[0], at[-1] + 1)
    columns[span] = np.round(np.interp(span, at, rows)).astype(np.intp)
    return columns


def _hold_feet(
    track: _Track, match: Evidence, pull: Pull, floor: float | None
) -> list[AllocatedPrior]:
    """Hold feet that rest where they mostly were, on the floor: eqs. (6.7) and (6.8)."""
    told = []
    columns = _frames_of(match, track)
    for prior in named_priors(match.template, match.sequence.feature_set.names):
        mask = (columns >= 0) & prior.columns[np.maximum(columns, 0)]
        feet = sole_points(track.names, prior.name[0].upper())
        for first, stop in find_runs(mask).tolist():
            if not feet or stop - first < _LEAST_REST_S * track.rate_hz:
                continue
            part = track.points[first:stop, feet]
            sure = track.confidence[first:stop, feet] > _SEEN
            speed = np.linalg.norm(np.gradient(part, axis=0), axis=-1).min(axis=1) * track.rate_hz
            seen = sure.any(axis=1)
            fast = float(np.median(speed[seen])) if seen.any() else 0.0
            kept = fast < _RESTING_SPEED
            reason = f"moves at {fast:.1f} m/s" if seen.any() else "not seen"
            told.append(
                AllocatedPrior(
                    prior.name, match.name, first, stop, match.alignment.cost, kept, reason
                )
            )
            if kept:
                _hold(pull, feet, first, stop, np.where(sure[..., None], part, np.nan), part, floor)
    return told


def _hold(
    pull: Pull,
    feet: list[int],
    first: int,
    stop: int,
    seen: Floats,
    part: Floats,
    floor: float | None,
) -> None:
    """Quadrics towards the median place of each point, robust, for the frames of a rest."""
    for k, point in enumerate(feet):
        known = ~np.isnan(seen[:, k, 0])
        target = np.median(part[known, k] if known.any() else part[:, k], axis=0)
        if floor is not None:
            # Points of a sole lie above the floor by what they do when the foot stands.
            target[1] = max(target[1], floor)
        off = part[:, k] - target
        flat = np.linalg.norm(off[:, (0, 2)], axis=1)
        weights = np.zeros((stop - first, 3))
        scale = _HOLD_SCALE_M**2
        weights[:, 0] = weights[:, 2] = _HOLD_WEIGHT * (scale / (scale + flat**2)) ** 2
        if floor is not None:
            scale = _FLOOR_SCALE_M**2
            weights[:, 1] = _HOLD_WEIGHT * (scale / (scale + off[:, 1] ** 2)) ** 2
        pull.matrices[first:stop, point][:, np.arange(3), np.arange(3)] = weights
        pull.places[first:stop, point] = target


def _lend_poses(
    track: _Track,
    matches: list[Evidence],
    lent: list[Floats],
    own: Floats,
    frame: BodyFrame,
    pull: Pull,
    settings: SolverSettings,
) -> list[AllocatedPrior]:
    """Lend changes of poses to points that views do not tell, where they prove themselves."""
    lending = np.full_like(own, np.nan)
    for match, poses in zip(matches, lent, strict=True):
        columns = _frames_of(match, track)
        inside = columns >= 0
        lending[inside] = poses[columns[inside]]
    names = list(LENT)
    told = []
    for limb, parts in _LIMBS.items():
        for side in "LR":
            members = [names.index(side + part) for part in parts if side + part in track.names]
            points = [track.names.index(names[k]) for k in members]
            if not members:
                continue
            sure = _close(track.confidence[:, points] > _SEEN, round(_HOLES_S * track.rate_hz))
            sure = np.asarray(sure.all(axis=1))
            better, error_m = _try(own[:, members], lending[:, members], sure, track, frame)
            gaps = [
                run
                for run in find_runs(
                    np.asarray(~np.isnan(lending[:, members, 0]).any(axis=1))
                ).tolist()
                if (track.confidence[slice(*run)][:, points] < _UNSEEN).any()
            ]
            side_name = "left" if side == "L" else "right"
            told += [
                AllocatedPrior(
                    f"{side_name} {limb[:-1]} moves as in {matches[0].name}", matches[0].name,
                    first, stop, min(one.alignment.cost for one in matches), better,
                    f"off by {100 * error_m:.0f} cm where it is seen",
                )
                for first, stop in gaps
            ]  # fmt: skip
            if better:
                _pull_limb(track, points, own[:, members], lending[:, members], frame, pull,
                           (settings.noise_m / error_m) ** 2 / _LASTING_FRAMES)  # fmt: skip
    return told


def _try(
    own: Floats, lending: Floats, sure: Bools, track: _Track, frame: BodyFrame
) -> tuple[bool, float]:
    """Whether lent changes bridge stretches that were seen better than a straight way does.

    Returns also the root mean square of their errors in metres; infinite without two stretches.
    """
    length = round(_TRIED_S * track.rate_hz)
    usable = np.asarray(
        sure & ~np.isnan(lending).any(axis=(1, 2)) & ~np.isnan(own).any(axis=(1, 2))
    )
    lent, straight = [], []
    for first, stop in find_runs(usable).tolist():
        for start in range(first + _EDGE, stop - length - _EDGE + 1, max(1, length // 4)):
            end = start + length
            lent.append(lending[start:end] + _bridge(own - lending, start, end) - own[start:end])
            straight.append(_bridge(own, start, end) - own[start:end])
    if len(lent) < 2:
        return False, np.inf
    errors = [
        frame.leg * float(np.sqrt((np.concatenate(one) ** 2).sum(axis=-1).mean()))
        for one in (lent, straight)
    ]
    return errors[0] < _BETTER * errors[1], max(errors[0], 0.01)


def _bridge(values: Floats, start: int, end: int) -> Floats:
    """Values between two frames on a straight way from those before to those after."""
    one = values[start - _EDGE : start].mean(axis=0)
    other = values[end : end + _EDGE].mean(axis=0)
    u = ((np.arange(start, end) - start + 1) / (end - start + 1))[:, None, None]
    straight: Floats = one + u * (other - one)
    return straight


def _pull_limb(
    track: _Track,
    points: list[int],
    own: Floats,
    lending: Floats,
    frame: BodyFrame,
    pull: Pull,
    weight: float,
) -> None:
    """Pull points that views do not tell to what is lent, joined to what is seen around."""
    frames = np.arange(len(own))
    for k, point in enumerate(points):
        confidence = track.confidence[:, point]
        known = (confidence > _SEEN) & ~np.isnan(lending[:, k, 0]) & ~np.isnan(own[:, k, 0])
        wanted = (confidence < _UNSEEN) & ~np.isnan(lending[:, k, 0])
        if not known.any() or not wanted.any():
            continue
        away = np.stack(
            [
                np.interp(frames, frames[known], (own - lending)[known, k, axis])
                for axis in range(3)
            ],
            axis=-1,
        )
        places = frame.to_world((lending[:, k] + away)[:, None])[:, 0]
        good = wanted & ~np.isnan(places).any(axis=1)
        pull.matrices[good, point] = weight * np.eye(3)
        pull.places[good, point] = places[good]
