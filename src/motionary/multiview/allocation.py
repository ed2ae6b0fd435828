"""Priors of recognised motion, given to the frames of a track where they prove themselves.

After Baak (2012), sections 6.4.1 to 6.4.3, whose open problem is a wrong label. Here each match
must prove what it tells on what views see: what it says of feet, hands and elbows must hold
there, and its poses must bridge segments that were seen better than a straight way does.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import compute_features
from motionary.models.library import ClassLibrary
from motionary.motion import Motion
from motionary.multiview.poses import (
    LENT,
    SEEN,
    BodyFrame,
    Candidates,
    PoseMemory,
    Track,
    blend,
    columns_of,
    find_candidates,
    find_matches,
    keep_essential,
    own_axes,
    prototypes,
    remember_best,
)
from motionary.multiview.priors import (
    AllocatedPrior,
    PriorTable,
    check_priors,
    derive_priors,
    find_claims,
    mark,
)
from motionary.multiview.solving import Pull, SolverSettings
from motionary.recording import find_runs
from motionary.retrieval.explanation import Evidence

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_LIMBS = {"legs": ("Knee", "Ankle", "BigToe"), "arms": ("Elbow", "Wrist")}
# A point of which views tell less is not recognised.
_TOLD = 0.15
# Shorter holes between seen frames count as seen: smoothing bridges them.
_HOLES_S = 0.1
# How far a limb is off a straight way over a gap, about.
_STRAIGHT_M = 0.1
# Priors are tried on seen segments of so long, left out; a prior must be better by so much.
_TRIED_S, _EDGE = 0.5, 4
_BETTER, _LEAST_TRIES, _LEAST_TOLD = 0.9, 2, 0.5
# Errors of lent poses last: neighbouring frames are no further evidence.
_LASTING_FRAMES = 5.0


class Allocated(NamedTuple):
    """What recognised motion tells a track.

    `pull` where it wants points; `priors` that were tried, by time; `lent` (frames, points),
    which points took poses that proved themselves.
    """

    pull: Pull
    priors: tuple[AllocatedPrior, ...]
    lent: Bools


def allocate(
    motion: Motion,
    confidence: Floats,
    library: ClassLibrary,
    *,
    settings: SolverSettings,
    memory: PoseMemory | None = None,
    priors: PriorTable | None = None,
    floor: float | None = None,
) -> Allocated:
    """Where recognised motion wants the points of a track, and which priors that were.

    `motion` is mapped to generic joints, `confidence` is (frames, points). Without `memory` poses
    of the recording's own best match are lent, without `priors` those count that the library's
    templates tell by themselves, and without `floor`, a height, feet rest without it.
    """
    track = Track(motion.names, motion.positions, confidence, motion.rate_hz)
    if priors is None:
        priors = derive_priors(library)
    check_priors(priors, library)
    sequence = compute_features(as_seen(motion, confidence), feature_set=library.feature_set)
    matches = find_matches(sequence, library)
    pull = bridge_gaps(track.names, track.points, confidence, settings)
    loan = _loan(track, matches, memory, library)
    told: list[AllocatedPrior] = []
    lent = np.zeros(confidence.shape, dtype=bool)
    for limb in _LIMBS:
        more, taken = _lend_limb(loan, limb, pull, settings)
        told, lent = told + more, lent | taken
    keys = prototypes(library)
    for match in keep_essential(matches, len(sequence)):
        named = priors.get(keys[id(match.pattern)], ())
        claims = find_claims(match, named, sequence, track)
        told += mark(claims, track, pull, loan.frame, floor)
    return Allocated(pull, tuple(sorted(told, key=lambda one: (one.first, one.name))), lent)


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
    track = Track(names, points, confidence, 0.0)
    members = [k for k, name in enumerate(LENT) if name in names]
    weight = (settings.noise_m / _STRAIGHT_M) ** 2 / _LASTING_FRAMES
    where = [names.index(list(LENT)[k]) for k in members]
    _pull_limb(track, where, own[:, members], np.zeros_like(own[:, members]), frame, pull, weight)
    return pull


# ---- poses


class _Loan(NamedTuple):
    """Matches with their poses, held against a track: its points in body axes, and those axes."""

    track: Track
    matches: Sequence[Evidence]
    offers: Sequence[Candidates]
    own: Floats
    frame: BodyFrame


def _loan(
    track: Track, matches: Sequence[Evidence], memory: PoseMemory | None, library: ClassLibrary
) -> _Loan:
    keys = prototypes(library)
    own, frame = own_axes({name: track.points[:, k] for k, name in enumerate(track.names)})
    if memory is None:
        memory = remember_best(library, matches, own, track.rate_hz)
    seen = np.zeros(own.shape[:2], dtype=bool)
    for k, name in enumerate(LENT):
        if name in track.names:
            seen[:, k] = track.confidence[:, track.names.index(name)] > SEEN
    lenders, offers = [], []
    for match in matches:
        if keys[id(match.pattern)] not in memory.poses:
            continue
        poses = memory.poses[keys[id(match.pattern)]]
        if poses.shape[1] != len(match.template.values):
            raise InvalidInput(
                f"the memory of poses is of other templates of {match.name!r} than the library's; "
                "make it anew with remember_poses"
            )
        columns = columns_of(match, track)
        if (columns >= 0).any():
            lenders.append(match)
            offers.append(find_candidates(poses, columns, own, seen, track.rate_hz))
    return _Loan(track, lenders, offers, own, frame)


def _lend_limb(
    loan: _Loan, limb: str, pull: Pull, settings: SolverSettings
) -> tuple[list[AllocatedPrior], Bools]:
    """Lend a limb's poses to points that views do not tell, of matches that prove themselves.

    Returns also which points of the track took them.
    """
    track, names = loan.track, list(LENT)
    sides = {
        side: [names.index(side + one) for one in _LIMBS[limb] if side + one in track.names]
        for side in "LR"
    }
    told = []
    taken = np.zeros(track.confidence.shape, dtype=bool)
    for side, members in sides.items():
        points = [track.names.index(names[k]) for k in members]
        hidden = np.asarray((track.confidence[:, points] < SEEN).any(axis=1))
        good = []
        for match, offer in zip(loan.matches, loan.offers, strict=True):
            if not hidden[offer.frames].any():
                continue
            tried = _try(offer, sides, loan.own, track, loan.frame)
            name = f"{'left' if side == 'L' else 'right'} {limb[:-1]} moves as in {match.name}"
            reason = (
                f"off by {100 * tried.error_m:.0f} cm where it is seen"
                if np.isfinite(tried.error_m) else "too little of it is seen"
            )  # fmt: skip
            first, stop = int(offer.frames[0]), int(offer.frames[-1]) + 1
            cost = match.alignment.cost
            told.append(AllocatedPrior(name, match.name, first, stop, cost, tried.better, reason))
            if tried.better:
                good.append((offer, tried.error_m))
        if good:
            error_m = float(np.sqrt(np.mean([error**2 for _, error in good])))
            lending = blend([offer for offer, _ in good], members, len(loan.own))
            weight = (settings.noise_m / error_m) ** 2 / _LASTING_FRAMES
            taken |= _pull_limb(
                track, points, loan.own[:, members], lending, loan.frame, pull, weight
            )
    return told, taken


class _Tried(NamedTuple):
    """Whether lent poses bridge seen segments better than a straight way; their error."""

    better: bool
    error_m: float


def _try(
    offer: Candidates, sides: Mapping[str, list[int]], own: Floats, track: Track, frame: BodyFrame
) -> _Tried:
    """A match held against what is seen of both sides of a limb.

    The other side counts, for in a gap it is the only one seen. The error is infinite without two
    segments.
    """
    length = round(_TRIED_S * track.rate_hz)
    tries: list[Floats] = []
    for members in sides.values():
        if not members:
            continue
        points = [track.names.index(list(LENT)[k]) for k in members]
        told = _close(track.confidence[:, points] > SEEN, round(_HOLES_S * track.rate_hz))
        part = np.where(told[..., None], own[:, members], np.nan)
        lending = blend([offer], members, len(own))
        first, last = int(offer.frames[0]) + _EDGE, int(offer.frames[-1]) + 1 - _EDGE
        for start in range(first, last - length + 1, max(1, length // 4)):
            end = start + length
            off = np.stack(
                [
                    lending[start:end] + _bridge(part - lending, start, end) - part[start:end],
                    _bridge(part, start, end) - part[start:end],
                ]
            )
            if np.isfinite(off).mean() > _LEAST_TOLD:
                tries.append(np.nanmean((off**2).sum(axis=-1), axis=(1, 2)))
    if len(tries) < _LEAST_TRIES:
        return _Tried(False, np.inf)
    lent, straight = frame.leg * np.sqrt(np.mean(tries, axis=0))
    return _Tried(bool(lent < _BETTER * straight), max(float(lent), 0.01))


def _bridge(values: Floats, start: int, end: int) -> Floats:
    """Values between two frames on a straight way from those before to those after."""
    with warnings.catch_warnings():
        # Of edges that no view tells: then there is no straight way.
        warnings.simplefilter("ignore", RuntimeWarning)
        one = np.nanmean(values[start - _EDGE : start], axis=0)
        other = np.nanmean(values[end : end + _EDGE], axis=0)
    u = ((np.arange(start, end) - start + 1) / (end - start + 1))[:, None, None]
    straight: Floats = one + u * (other - one)
    return straight


def _pull_limb(
    track: Track,
    points: list[int],
    own: Floats,
    lending: Floats,
    frame: BodyFrame,
    pull: Pull,
    weight: float,
) -> Bools:
    """Pull points that views do not tell to what is lent, joined to what is seen around.

    Returns which points of the track are pulled.
    """
    frames = np.arange(len(own))
    taken = np.zeros(track.confidence.shape, dtype=bool)
    for k, point in enumerate(points):
        confidence = track.confidence[:, point]
        known = (confidence > SEEN) & ~np.isnan(lending[:, k, 0]) & ~np.isnan(own[:, k, 0])
        wanted = (confidence < SEEN) & ~np.isnan(lending[:, k, 0])
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
        taken[good, point] = True
    return taken
