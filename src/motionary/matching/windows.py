"""Distance of a short window of features to all that stands in a corpus.

Subsequence DTW at a third of the frames, with steps (1, 1), (1, 2), (1, 3), (2, 1) and (3, 1):
what is played up to three times as fast or as slow still fits. The cell after a step that
leaves out columns counts for each of them. The cost of a cell is the weighed fraction of the
features known in both that differ; where they are less than half of the window's, it is 1.

Conventions: the distance is the mean cost of a column on the best path that ends at a frame;
frames are those of the thinned corpus, every third one; features that are "heavy" weigh
1 + `extra`.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.matching.corpus import Corpus
from motionary.packing import PackedFeatures, count

Single = NDArray[np.float32]
Indices = NDArray[np.intp]

#: Every so many frames count.
THINNING = 3
#: Longest step along the sequence, and along the window.
LONGEST_STEP = 3

# Frames at a time: their costs stay in a processor's cache.
_TILE = 1 << 14
_INF = np.float32(np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class ThinCorpus:
    """Every third frame of sequences, with room between.

    Attributes
    ----------
    packed, known : arrays, shape (n_integers, frames); known may be None: all
    starts, lengths : arrays, shape (sequences,)
    blocked : array, shape (frames,), bool: between sequences
    """

    packed: PackedFeatures
    known: PackedFeatures | None
    starts: Indices
    lengths: Indices
    blocked: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class FeatureWindow:
    """A short example as it is looked for, already thinned.

    Attributes
    ----------
    packed, known : arrays, shape (columns, n_integers)
    heavy : array, shape (n_integers,): mask of the features that weigh more
    extra : by how much
    """

    packed: PackedFeatures
    known: PackedFeatures
    heavy: PackedFeatures
    extra: float = 0.0

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
        if self._known is None:
            heavy = int(count((mask & window.heavy)[np.newaxis])[0])
            total = int(count(mask[np.newaxis])[0]) + window.extra * heavy
            wrong /= np.float32(max(total, 1.0))
            return wrong
        key = mask.tobytes()
        if key not in self._seen:
            self._seen[key] = self._seen_by(mask)
        seen, too_few = self._seen[key]
        wrong /= seen
        wrong[too_few] = 1.0
        return wrong

    def _seen_by(self, mask: PackedFeatures) -> tuple[Single, NDArray[np.bool_]]:
        """Weight of what is known of a mask at each frame, and where that is too little."""
        seen = self._weigh(mask, mask, is_difference=False)
        heavy = int(count((mask & self._window.heavy)[np.newaxis])[0])
        total = int(count(mask[np.newaxis])[0]) + self._window.extra * heavy
        return np.maximum(seen, np.float32(1e-6)), seen < 0.5 * total

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
