"""Which hits of a query keep the distances between keyframes best?

All hits show all keyframes; they differ in tempo. The misfit of a gap is 1 - a / b, with a
and b the shorter and the longer of its length and the distance that it is made for: the
columns of `template_of_query`. The misfit of a hit is the mean over its gaps, in [0, 1).

A frame of the last keyframe has one best hit that ends there. Of a gap without an upper
bound only the latest frame before counts: there, shorter fits better.
"""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.matching import Corpus
from motionary.models.keyframes.query import Gap, KeyframeQuery
from motionary.models.keyframes.ranking import columns_of_query
from motionary.models.keyframes.search import check_packed, frames_of_keyframe

Integers = NDArray[np.int64]
Floats = NDArray[np.float64]

# Pairs of frames that are compared at a time.
_MOST_PAIRS = 2_000_000


class FittedHits(NamedTuple):
    """The best hit for each frame at which one ends, in the order of time.

    Attributes
    ----------
    frames : array, shape (hits, K): the frame of each keyframe
    misfits : array, shape (hits,)
    """

    frames: Integers
    gap_costs: Floats


def fit_hits(query: KeyframeQuery, corpus: Corpus) -> FittedHits:
    """Hits in the documents of a corpus; frames are those of the corpus.

    Raises
    ------
    InvalidInput
        If the words do not have the shape of the query's.
    """
    packed, known = corpus.packed, corpus.known
    check_packed(query, packed, known)
    columns = columns_of_query(query)
    hits, gap_costs = np.empty((0, 1), dtype=np.int64), np.empty(0)
    for k, keyframe in enumerate(zip(query.values, query.fixed, strict=True)):
        shown = frames_of_keyframe(*keyframe, packed, known)
        shown[corpus.blocked] = False
        frames = np.flatnonzero(shown)
        if k == 0:
            hits, gap_costs = frames[:, np.newaxis], np.zeros(len(frames))
            continue
        first, stop = _reachable(hits[:, -1], frames, query.gaps[k - 1], corpus.starts)
        made_for = columns[k] - columns[k - 1]
        best, added = _choose(frames, hits[:, -1], gap_costs, first, stop, made_for)
        reached = first < stop
        hits = np.column_stack([hits[best], frames[reached]])
        gap_costs = gap_costs[best] + added
    return FittedHits(hits, gap_costs / max(len(query.gaps), 1))


def _reachable(
    before: Integers, frames: Integers, gap: Gap, starts: NDArray[np.intp]
) -> tuple[Integers, Integers]:
    """Which of the frames `before` lie within the gap before each frame, half-open."""
    least, most = gap
    begin = starts[np.searchsorted(starts, frames, side="right") - 1]
    stop = np.searchsorted(before, frames - least, side="right")
    earliest = begin if most is None else np.maximum(begin, frames - most)
    first = np.searchsorted(before, earliest, side="left")
    if most is None:
        first = np.maximum(first, stop - 1)
    return first, stop


def _choose(
    frames: Integers,
    before: Integers,
    gap_costs: Floats,
    first: Integers,
    stop: Integers,
    made_for: int,
) -> tuple[Integers, Floats]:
    """For each frame with one, the best frame before it, and the misfit of that gap."""
    best, added = [np.empty(0, dtype=np.int64)], [np.empty(0)]
    for begin, end in _portions(np.maximum(stop - first, 0)):
        n = np.maximum(stop[begin:end] - first[begin:end], 0)
        reached = np.flatnonzero(n)
        n = n[reached]
        begins = np.cumsum(n) - n
        pairs = np.arange(n.sum()) + np.repeat(first[begin:end][reached] - begins, n)
        gaps = np.repeat(frames[begin:end][reached], n) - before[pairs]
        gap_costs_of = _gap_cost(gaps, made_for)
        total = gap_costs[pairs] + gap_costs_of
        if len(reached):
            least = np.repeat(np.minimum.reduceat(total, begins), n)
            at = np.flatnonzero(total == least)
            # Of equally good frames the latest: the shorter hit.
            owner = np.repeat(np.arange(len(n)), n)[at]
            chosen = at[np.searchsorted(owner, np.arange(len(n)), side="right") - 1]
            best.append(pairs[chosen])
            added.append(gap_costs_of[chosen])
    return np.concatenate(best), np.concatenate(added)


def _portions(n_pairs: Integers) -> Iterator[tuple[int, int]]:
    """Stretches of frames of which each has a bounded number of pairs."""
    number = np.cumsum(n_pairs) // _MOST_PAIRS
    borders = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(n_pairs)]
    return itertools.pairwise(borders)


def _gap_cost(gaps: Integers, made_for: int) -> Floats:
    longer = np.maximum(np.maximum(gaps, made_for), 1)
    shorter = np.where(longer == 1, longer, np.minimum(gaps, made_for))
    return np.asarray(1.0 - shorter / longer)
