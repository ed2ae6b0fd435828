"""Evidence that two recordings show one performance.

Three measures, from cheap to costly. Landmarks propose pairs and offsets: rigs and rates
leave alone when features change; two changes that follow each other and the time between them
are a landmark, and recordings that share a motion share many at one offset (after Wang 2003,
who recognises recordings of music). Bits say how much a shared sequence of changes means: the
sum of log-likelihood ratios, copy against chance; two bodies that stand still share none.
Curves tell a copy from a repetition: a person repeats a motion so well that features change
alike, but how the acceleration of the joints changes, 0.1 s at a time, is never the same
twice. They are angles that hardly depend on the rig.

Conventions: a change belongs to the frame before it; its symbol is 2 * feature, one more
where the feature begins to hold. Kernels: arrays and numbers, nothing is checked.
"""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.motion import GENERIC_JOINTS, Motion, resample
from motionary.packing import PackedFeatures, unpack

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Signs = NDArray[np.int8]

#: A change is paired with so many that follow, within so many frames.
_FOLLOWING = 4
_WITHIN = 45
#: A landmark votes for at most so many others of its kind: common ones tell little.
_MOST_PARTNERS = 16
#: Sequences whose landmarks are compared at a time.
_PORTION = 256
_OFFSETS = 1 << 24

#: Fraction of the changes that a copy on another rig shows within a frame, by measurement.
_SHARED = 0.65
_BESIDE = 1

#: Rate of the curves.
CURVE_HZ = 120.0
#: Curves of the mirrored motion: left and right exchanged.
MIRROR_ORDER = np.array([4, 5, 6, 7, 0, 1, 2, 3, 8, 9, 10])
_SMOOTHED = 11
_DIFFERENCES = 3
_SHORTEST = 48
_JOINT = {name: i for i, name in enumerate(GENERIC_JOINTS)}
_BONES = (
    ("arm", "shoulder", "elbow"),
    ("forearm", "elbow", "wrist"),
    ("thigh", "hip", "knee"),
    ("shin", "knee", "ankle"),
)


class Changes(NamedTuple):
    """Changes of features in sequences, by sequence and time; arrays, shape (changes,)."""

    sequences: Integers
    frames: Integers
    symbols: Integers


class Candidates(NamedTuple):
    """Pairs of sequences with the offset that most landmarks vote for.

    Attributes
    ----------
    left, right : arrays, shape (pairs,), sequences
    offsets : frame of the left sequence at which the right one begins
    votes : landmarks that agree
    """

    left: Integers
    right: Integers
    offsets: Integers
    votes: Integers


def changes_of(
    packed: Sequence[PackedFeatures], known: Sequence[PackedFeatures], n_features: int
) -> Changes:
    """Changes of known features in sequences."""
    sequences, frames, symbols = [], [], []
    for number, (holding, mask) in enumerate(zip(packed, known, strict=True)):
        changed = (holding[1:] ^ holding[:-1]) & mask[1:] & mask[:-1]
        at = np.flatnonzero(changed.any(axis=1))
        frame, feature = np.nonzero(unpack(changed[at], n_features))
        holds = unpack(holding[at + 1], n_features)[frame, feature]
        sequences.append(np.full(len(frame), number))
        frames.append(at[frame])
        symbols.append(2 * feature + holds)
    return Changes(*(np.concatenate(column) for column in (sequences, frames, symbols)))


def mirrored(changes: Changes, mirror_order: NDArray[np.intp]) -> Changes:
    """Changes of the mirrored motions."""
    feature, begins = changes.symbols // 2, changes.symbols % 2
    symbols = 2 * mirror_order[feature] + begins
    order = np.lexsort((symbols, changes.frames, changes.sequences))
    return Changes(changes.sequences[order], changes.frames[order], symbols[order])


def find_candidates(
    left: Changes, right: Changes, *, n_features: int, n_right: int, least_votes: int
) -> Candidates:
    """Pairs of sequences that share so many landmarks, of `n_right` on the right side."""
    kinds, places, owners = _landmarks(left, n_features)
    order = np.argsort(kinds, kind="stable")
    kinds, places, owners = kinds[order], places[order], owners[order]
    their_kinds, their_places, their_owners = _landmarks(right, n_features)
    by_owner = np.argsort(their_owners, kind="stable")
    borders = np.searchsorted(their_owners[by_owner], np.arange(0, n_right + _PORTION, _PORTION))
    found = [np.empty((0, 4), dtype=np.int64)]
    for first, stop in zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True):
        chosen = by_owner[first:stop]
        mine, theirs = _partners(kinds, their_kinds[chosen])
        theirs = chosen[theirs]
        offsets = places[mine] - their_places[theirs]
        found.append(_count(owners[mine], their_owners[theirs], offsets, n_right, least_votes))
    return Candidates(*np.concatenate(found).T)


def _landmarks(changes: Changes, n_features: int) -> tuple[Integers, Integers, Integers]:
    """Kind, frame and sequence of each landmark."""
    sequences, frames, symbols = changes
    kinds, at = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for step in range(1, _FOLLOWING + 1):
        gap = frames[step:] - frames[:-step]
        near = np.flatnonzero((sequences[step:] == sequences[:-step]) & (gap <= _WITHIN))
        pair = symbols[near] * (2 * n_features) + symbols[near + step]
        kinds.append(pair * (_WITHIN + 1) + gap[near])
        at.append(near)
    places = np.concatenate(at)
    return np.concatenate(kinds), frames[places], sequences[places]


def _partners(kinds: Integers, theirs: Integers) -> tuple[Integers, Integers]:
    """Pairs of landmarks of one kind; of common kinds only some."""
    first = np.searchsorted(kinds, theirs, side="left")
    n = np.searchsorted(kinds, theirs, side="right") - first
    # Each starts at another of its partners, so that all of them get votes.
    start = np.arange(len(theirs)) % np.maximum(n, 1)
    mine, indexes = [], []
    for step in range(_MOST_PARTNERS):
        left = np.flatnonzero(step < n)
        mine.append(first[left] + (start[left] + step) % n[left])
        indexes.append(left)
    return np.concatenate(mine), np.concatenate(indexes)


def _count(
    left: Integers, right: Integers, offsets: Integers, n_right: int, least_votes: int
) -> Integers:
    """Rows (left, right, offset, votes): the best offset of each pair with enough votes."""
    keys = (left * n_right + right) * _OFFSETS + (offsets + _OFFSETS // 2)
    keys, counts = np.unique(keys, return_counts=True)
    votes = counts.copy()
    for step in (-1, 1):
        # Changes lie between frames: half of the votes may go to the next offset.
        at = np.minimum(np.searchsorted(keys, keys + step), max(len(keys) - 1, 0))
        votes += np.where(keys[at] == keys + step, counts[at], 0)
    keys, counts, votes = (x[votes >= least_votes] for x in (keys, counts, votes))
    pairs = keys // _OFFSETS
    order = np.lexsort((counts, votes, pairs))
    last = order[np.flatnonzero(np.diff(pairs[order], append=-1))]
    columns = (pairs // n_right, pairs % n_right, keys % _OFFSETS - _OFFSETS // 2, votes)
    return np.stack([column[last] for column in columns], axis=1)


class Evidence(NamedTuple):
    """Bits for a copy at one offset.

    Attributes
    ----------
    bits : of the segment with the most
    start, stop : that segment in frames of the left recording, half-open
    shared : fraction of the changes in it that both show
    """

    bits: float
    start: int
    stop: int
    shared: float


def rates_of(n_changes: NDArray[np.int64], n_frames: int) -> Floats:
    """Changes per frame of each symbol; none is impossible (Laplace)."""
    return np.asarray((n_changes + 1) / (n_frames + 2), dtype=np.float64)


def weigh(left: Signs, right: Signs, offset: int, rates: Floats) -> Evidence:
    """Evidence that two recordings are copies at an offset.

    Parameters
    ----------
    left, right : arrays, shape (frames, features): 1 where a feature begins to hold, -1
        where it ends, 0 where it does not change or is not known to
    offset : frame of the left recording at which the right one begins
    rates : array, shape (2 * features,), changes per frame of each symbol
    """
    first, last = max(0, offset), min(len(left), len(right) + offset)
    a, b = left[first:last], right[first - offset : last - offset]
    met_a, met_b = _met(a, b), _met(b, a)
    gain = (_gain(a, met_a, rates) + _gain(b, met_b, rates)) / 2
    total = np.concatenate([[0.0], np.cumsum(gain)])
    lowest = np.minimum.accumulate(total)
    stop = int(np.argmax(total - lowest))
    # The last of equal ones: what is still before the first shared change counts nothing.
    start = stop - int(np.argmin(total[stop::-1]))
    inside = slice(start, stop)
    n_changes = int(np.count_nonzero(a[inside]) + np.count_nonzero(b[inside]))
    n_met = int(np.count_nonzero(met_a[inside]) + np.count_nonzero(met_b[inside]))
    bits = float(total[stop] - total[start])
    return Evidence(bits, first + start, first + stop, n_met / max(n_changes, 1))


def _met(a: Signs, b: Signs) -> NDArray[np.bool_]:
    """Which changes of `a` have their like in `b`."""
    padded = np.pad(b, ((_BESIDE, _BESIDE), (0, 0)))
    met = np.zeros(a.shape, dtype=np.bool_)
    for step in range(2 * _BESIDE + 1):
        met |= padded[step : step + len(a)] == a
    return np.asarray(met & (a != 0))


def _gain(a: Signs, met: NDArray[np.bool_], rates: Floats) -> Floats:
    """Bits of every frame."""
    by_chance = np.minimum((2 * _BESIDE + 1) * rates, 0.5)
    if_met = np.log2(_SHARED / by_chance)
    if_not = np.log2((1 - _SHARED) / (1 - by_chance))
    bits = np.zeros(a.shape)
    for sign, symbols in ((-1, slice(0, None, 2)), (1, slice(1, None, 2))):
        here = a == sign
        bits += np.where(here, np.where(met, if_met[symbols], if_not[symbols]), 0.0)
    return np.asarray(bits.sum(axis=1))


def curves_of(motion: Motion) -> Floats:
    """Angles in radians at 120 Hz, shape (frames, 11); NaN where a joint is not seen."""
    positions = resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=CURVE_HZ)

    def direction(a: str, b: str) -> Floats:
        vector = positions[:, _JOINT[b]] - positions[:, _JOINT[a]]
        length = np.linalg.norm(vector, axis=1, keepdims=True)
        return np.asarray(vector / np.where(length > 0, length, np.nan))

    trunk = direction("root", "neck")
    bones = {
        (side, name): direction(side + a, side + b) for side, (name, a, b) in product("lr", _BONES)
    }
    curves = []
    for side in "lr":
        arm, forearm, thigh, shin = (bones[side, name] for name, _, _ in _BONES)
        curves += [_angle(arm, forearm), _angle(thigh, shin)]
        curves += [_angle(trunk, arm), _angle(trunk, thigh)]
    up = np.broadcast_to([0.0, 1.0, 0.0], trunk.shape)
    curves.append(_angle(trunk, up))
    curves += [_angle(bones["l", name], bones["r", name]) for name in ("thigh", "arm")]
    return np.stack(curves, axis=1)


def agreement(left: Floats, right: Floats, offset: int, *, within: int) -> tuple[float, int]:
    """How well the changes of acceleration agree, and at which offset near the given one.

    Parameters
    ----------
    left, right : curves
    offset : frame of the left curves at which the right ones begin
    within : frames around it that are tried

    Returns
    -------
    agreement : mean over the curves of the correlation of their third differences, at
        most 1; 0 where too little is seen of both
    offset : where it is best
    """
    best = (0.0, offset)
    for at in range(offset - within, offset + within + 1):
        first, last = max(0, at), min(len(left), len(right) + at)
        if last - first >= _SHORTEST:
            value = _correlate(left[first:last], right[first - at : last - at])
            best = max(best, (value, at))
    return best


def _correlate(left: Floats, right: Floats) -> float:
    a, b = _jerks(left), _jerks(right)
    seen = np.isfinite(a) & np.isfinite(b)
    enough = seen.sum(axis=0) >= _SHORTEST // 2
    if enough.sum() * 2 < len(enough):
        return 0.0
    a, b = np.where(seen, a, 0.0)[:, enough], np.where(seen, b, 0.0)[:, enough]
    power = np.sqrt((a**2).sum(axis=0) * (b**2).sum(axis=0))
    return float(np.mean((a * b).sum(axis=0) / np.where(power > 0, power, 1.0)))


def _jerks(curves: Floats) -> Floats:
    window = np.hanning(_SMOOTHED + 2)[1:-1]
    window /= window.sum()
    smooth = np.stack([np.convolve(curve, window, "valid") for curve in curves.T], axis=1)
    return np.asarray(np.diff(smooth, n=_DIFFERENCES, axis=0))


def _angle(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.arccos(np.clip((a * b).sum(axis=1), -1.0, 1.0)))
