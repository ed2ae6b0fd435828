"""Sequences searched as one, how much features tell among them, and windows of features there.

Sequences stand one behind the other with two empty frames between them: no step of the
matcher is longer than two frames, so no path crosses a border.

What is rare in the searched sequences tells more: an entry weighs its self-information,
minus the logarithm of the fraction of frames that show its value.

The distance of a short window of features to all that stands in a corpus is that of subsequence
DTW at a third of the frames, with steps (1, 1), (1, 2), (1, 3), (2, 1) and (3, 1): what is played
up to three times as fast or as slow still fits. The cell after a step that leaves out columns
counts for each of them. The cost of a cell is the weighed fraction of the features known in both
that differ; where they are less than half of the window's, it is 1. The distance is the mean cost
of a column on the best path that ends at a frame; frames are those of the thinned corpus, every
third one; features that are "heavy" weigh 1 + `extra`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.packing import PackedFeatures, count, unpack

Floats = NDArray[np.float64]
Single = NDArray[np.float32]
Indices = NDArray[np.intp]

PADDING = 2

#: Every so many frames count.
THINNING = 3
#: Longest step along the sequence, and along the window.
LONGEST_STEP = 3

# Frames at a time: their costs stay in a processor's cache.
_TILE = 1 << 14
_INF = np.float32(np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class Corpus:
    """Packed features of sequences, padded.

    Attributes
    ----------
    packed, known : arrays, shape (frames with padding, n_integers), uint64
    starts, lengths : arrays, shape (sequences,)
        Where each sequence begins, and its number of frames.
    blocked : array of the padding frames
    """

    packed: PackedFeatures
    known: PackedFeatures
    starts: NDArray[np.intp]
    lengths: NDArray[np.intp]
    blocked: NDArray[np.intp]

    def sequence(self, index: int) -> tuple[PackedFeatures, PackedFeatures]:
        """Features and mask of one sequence."""
        part = slice(self.starts[index], self.starts[index] + self.lengths[index])
        return self.packed[part], self.known[part]

    def split(self, per_frame: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """Parts of an array (padded frames,), one per sequence."""
        pairs = zip(self.starts, self.lengths, strict=True)
        return [per_frame[start : start + length] for start, length in pairs]


def concatenate(
    packed: Sequence[PackedFeatures], known: Sequence[PackedFeatures], *, full: PackedFeatures
) -> Corpus:
    """Corpus of sequences.

    Parameters
    ----------
    packed, known : one array (frames, n_integers) per sequence
    full : array, shape (n_integers,), the mask in which every feature is known

    Raises
    ------
    InvalidInput
        If there is no sequence, or features and masks are not of one form.
    """
    if not packed or len(packed) != len(known):
        raise InvalidInput(
            "a corpus needs at least one sequence, and a mask for each, got "
            f"{len(packed)} and {len(known)}"
        )
    for i, (a, b) in enumerate(zip(packed, known, strict=True)):
        if a.shape != b.shape or a.ndim != 2 or a.shape[1] != len(full):
            raise InvalidInput(
                f"sequence {i}: packed and known need shape (frames, {len(full)}), "
                f"got {a.shape} and {b.shape}"
            )
    lengths = np.array([len(a) for a in packed], dtype=np.intp)
    starts = np.concatenate([[0], np.cumsum(lengths[:-1] + PADDING)]).astype(np.intp)
    total = int(starts[-1] + lengths[-1])
    all_packed = np.zeros((total, len(full)), dtype=np.uint64)
    all_known = np.tile(full, (total, 1))
    inside = np.zeros(total, dtype=np.bool_)
    for a, b, start in zip(packed, known, starts, strict=True):
        part = slice(start, start + len(a))
        all_packed[part], all_known[part], inside[part] = a, b, True
    return Corpus(all_packed, all_known, starts, lengths, np.flatnonzero(~inside))


def feature_prior(corpus: Corpus, n_features: int) -> Floats:
    """Fraction of known frames in which each feature holds, shape (n_features,).

    One frame of either value is added (Laplace), so that what never happens is rare and
    not impossible.
    """
    inside = np.ones(len(corpus.packed), dtype=np.bool_)
    inside[corpus.blocked] = False
    packed, known = corpus.packed[inside], corpus.known[inside]
    ones = unpack(packed & known, n_features).sum(axis=0, dtype=np.int64)
    seen = unpack(known, n_features).sum(axis=0, dtype=np.int64)
    return prior_of_counts(ones, seen)


def prior_of_counts(ones: ArrayLike, seen: ArrayLike) -> Floats:
    """The same from counts that are known already.

    Parameters
    ----------
    ones, seen : shape (n_features,): frames in which a feature holds, and is known
    """
    return np.asarray((np.asarray(ones) + 1) / (np.asarray(seen) + 2), dtype=np.float64)


def self_information(values: NDArray[np.bool_], ones: Floats) -> Floats:
    """Self-information of entries: -log of the fraction that shows their value, >= 0.

    Parameters
    ----------
    values : array, shape (columns, features)
    ones : array, shape (features,), from `feature_prior`
    """
    return np.where(values, -np.log(ones), -np.log1p(-ones))


# -- windows --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class ThinCorpus:
    """Every third frame of sequences, with room between."""

    packed: PackedFeatures  # (n_integers, frames)
    known: PackedFeatures | None  # of the same shape; all without it
    starts: Indices  # (sequences,)
    lengths: Indices
    blocked: NDArray[np.bool_]  # (frames,): between sequences


@dataclass(frozen=True, slots=True, eq=False)
class FeatureWindow:
    """A short example as it is looked for, already thinned."""

    packed: PackedFeatures  # (columns, n_integers), as known
    known: PackedFeatures
    heavy: PackedFeatures  # (n_integers,): mask of the features that weigh more
    extra: float = 0.0  # by how much

    def __len__(self) -> int:
        return len(self.packed)


def thin(corpus: Corpus, *, full: PackedFeatures, has_gaps: bool = False) -> ThinCorpus:
    """Every third frame of a corpus.

    Parameters
    ----------
    full : array, shape (n_integers,): mask in which every feature is known
    has_gaps : whether it is part of a corpus in which features are unknown, so that its costs
        are computed as there, to the bit
    """
    lengths = -(-corpus.lengths // THINNING)
    starts = np.cumsum(lengths + LONGEST_STEP) - lengths - LONGEST_STEP
    n_frames = int(starts[-1] + lengths[-1]) if len(starts) else 0
    before = np.cumsum(lengths) - lengths
    order = np.arange(int(lengths.sum()))
    inside = np.repeat(starts - before, lengths) + order
    source = np.repeat(corpus.starts - THINNING * before, lengths) + THINNING * order
    packed = np.zeros((len(full), n_frames), dtype=np.uint64)
    packed[:, inside] = corpus.packed[source].T
    seen = corpus.known[source]
    known = None
    if has_gaps or (~seen & full).any():
        known = np.zeros_like(packed)
        known[:, inside] = seen.T
    blocked = np.ones(n_frames, dtype=np.bool_)
    blocked[inside] = False
    return ThinCorpus(packed, known, starts, lengths, blocked)


def window_distance(window: FeatureWindow, corpus: ThinCorpus) -> Single:
    """Distance of a window by the frame at which it ends, shape (frames,); inf where none."""
    result = np.full(corpus.packed.shape[1], _INF)
    for start, stop in _tiles(corpus):
        cells = _Cells(window, corpus, start, stop)
        rows = np.full((LONGEST_STEP + 1, LONGEST_STEP + stop - start), _INF)
        for k in range(len(window)):
            _advance(rows, k, cells.cost(k), cells.blocked)
        result[start:stop] = rows[(len(window) - 1) % len(rows), LONGEST_STEP:]
    result /= np.float32(len(window))
    return result


def window_path(window: FeatureWindow, corpus: ThinCorpus, start: int, end: int) -> Indices:
    """Best path that ends at a frame and does not begin before another.

    Returns
    -------
    array, shape (columns,): the frame that each column meets, that of the next where it is
    left out
    """
    cells = _Cells(window, corpus, start, end + 1)
    rows = np.full((LONGEST_STEP + 1, LONGEST_STEP + end + 1 - start), _INF)
    steps = [
        _advance(rows, k, cells.cost(k), cells.blocked, keeps_steps=True)
        for k in range(len(window))
    ]
    path = np.empty(len(window), dtype=np.intp)
    k, at = len(window) - 1, end - start
    path[k] = end
    while k > 0:
        step = int(steps[k][at])
        back, left_out = (step + 1, 0) if step < LONGEST_STEP else (1, step - LONGEST_STEP + 1)
        path[k - left_out : k] = start + at
        k, at = k - 1 - left_out, at - back
        path[k] = start + at
    return path


def _tiles(corpus: ThinCorpus) -> Iterator[tuple[int, int]]:
    """Whole sequences, about so many frames at a time."""
    n_frames = corpus.packed.shape[1]
    start = 0
    for begin in [*corpus.starts.tolist(), n_frames]:
        if begin - start >= _TILE or begin == n_frames:
            if begin > start:
                yield start, begin
            start = begin


class _Cells:
    """Costs of the columns of a window at some frames."""

    def __init__(self, window: FeatureWindow, corpus: ThinCorpus, start: int, stop: int) -> None:
        self._window = window
        self._packed = np.ascontiguousarray(corpus.packed[:, start:stop])
        self._known = None if corpus.known is None else corpus.known[:, start:stop]
        self.blocked = corpus.blocked[start:stop]
        self._bits = np.empty(stop - start, dtype=np.uint64)
        self._seen: dict[bytes, tuple[Single, NDArray[np.bool_]]] = {}

    def cost(self, column: int) -> Single:
        """Costs of one column, shape (frames,)."""
        window = self._window
        mask = window.known[column]
        wrong = self._weigh(window.packed[column], mask, is_difference=True)
        total = int(count(mask)) + window.extra * int(count(mask & window.heavy))
        if self._known is None:
            wrong /= np.float32(max(total, 1.0))
            return wrong
        key = mask.tobytes()
        if key not in self._seen:
            # Weight of what is known of the mask at each frame, and where that is too little.
            seen = self._weigh(mask, mask, is_difference=False)
            self._seen[key] = np.maximum(seen, np.float32(1e-6)), seen < 0.5 * total
        seen, too_few = self._seen[key]
        wrong /= seen
        wrong[too_few] = 1.0
        return wrong

    def _weigh(
        self, values: PackedFeatures, mask: PackedFeatures, *, is_difference: bool
    ) -> Single:
        """Weight of the masked features that differ from some values, or that are known."""
        plain = np.zeros(len(self._bits), dtype=np.uint16)
        heavy = np.zeros(len(self._bits), dtype=np.uint16)
        bits = self._bits
        for i, row in enumerate(self._packed):
            if not mask[i]:
                continue
            if is_difference:
                np.bitwise_xor(row, values[i], out=bits)
                bits &= mask[i]
            else:
                bits[:] = mask[i]
            if self._known is not None:
                bits &= self._known[i]
            plain += np.bitwise_count(bits)
            if self._window.extra and mask[i] & self._window.heavy[i]:
                bits &= self._window.heavy[i]
                heavy += np.bitwise_count(bits)
        weight = plain.astype(np.float32)
        if self._window.extra:
            weight += np.float32(self._window.extra) * heavy
        return weight


def _advance(
    rows: Single,
    k: int,
    cost: Single,
    blocked: NDArray[np.bool_],
    *,
    keeps_steps: bool = False,
) -> NDArray[np.uint8]:
    """Accumulate one column; the steps into its cells come back if they are kept.

    Steps 0, 1, 2 go on by so many frames and one; 3, 4 leave out one and two columns.
    """
    n, reach = len(rows), LONGEST_STEP
    here = rows[k % n]
    into = here[reach:]
    steps = np.zeros(len(cost), dtype=np.uint8)
    if k == 0:
        into[:] = cost
    else:
        before = rows[(k - 1) % n]
        best = before[reach - 1 : -1].copy()
        ways = [(1, before[reach - 2 : -2]), (2, before[reach - 3 : -3])]
        for left_out in range(1, min(k, reach)):
            earlier = rows[(k - 1 - left_out) % n][reach - 1 : -1]
            ways.append((reach - 1 + left_out, earlier + np.float32(left_out) * cost))
        for step, way in ways:
            if keeps_steps:
                steps[way < best] = step
            np.minimum(best, way, out=best)
        np.add(best, cost, out=into)
    into[blocked] = _INF
    return steps
