"""Search for keyframe queries: hit ranges, windows for a template, single and best hits.

The result of Algorithm 1 of Baak, Müller and Seidel (2008) without a step per segment:
keyframes are ANDs of bitmaps, whole blocks of frames are ruled out first, the remaining runs
are joined as intervals. `search_packed` reads the features of one recording instead, for
those that no index has.

A feature that is unknown does not hold and does not fail: a keyframe that fixes it is not
seen there. No hit crosses the border of a sequence.
"""

import itertools
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.matching import Corpus, Engine, load_twin
from motionary.models.keyframes.index import HitRanges, PostingIndex, agree, extend, margins
from motionary.models.keyframes.posting_lists import (
    FAR,
    Intervals,
    Layout,
    Plan,
    count_runs,
    join,
    plan_query,
    read_posting_lists,
    reading_order,
)
from motionary.models.keyframes.query import (
    Gap,
    KeyframeQuery,
    check_features,
    columns_of_query,
)
from motionary.packing import PackedFeatures, from_numbers
from motionary.recording import find_runs

Integers = NDArray[np.int64]
Floats = NDArray[np.float64]
COMPILED = "motionary.models.keyframes._compiled"

#: Runs of the rarest keyframe, for 64 frames, from which on steps per run are slower than
#: steps per frames.
_MANY_RUNS = 0.3
#: Pairs of frames that are compared at a time.
_MOST_PAIRS = 2_000_000


def search_query(
    query: KeyframeQuery, index: PostingIndex, *, engine: Engine = "auto"
) -> HitRanges:
    """Hit ranges of a query in the sequences of an index.

    Parameters
    ----------
    query : KeyframeQuery
    index : PostingIndex over the same features
    engine : which twin computes, with the same result; a single query ends before a
        compiler is loaded, so "auto" takes the compiled one only where numba is at work
        already, and not where the rarest keyframe comes and goes often

    Returns
    -------
    HitRanges, the union of all frames from first to last keyframe of a hit

    Raises
    ------
    InvalidInput
        If query and index are over different features.
    """
    check_features(query, index.feature_set, index.feature_ids)
    # A search takes less time than loading a compiler.
    kernels = load_twin(COMPILED, engine, pays="numba" in sys.modules)
    plan = plan_query(query)
    if plan is None:
        return HitRanges.none()
    rows = [index.rows(*keyframe) for keyframe in zip(plan.values, plan.fixed, strict=True)]
    n_frames = [index.counts[row[0]] for row in rows]
    order = reading_order(n_frames)
    if kernels is not None and (
        engine == "compiled" or count_runs(index.planes, rows[order[0]]) <= _MANY_RUNS
    ):
        return _search_compiled(kernels.search_planes, index, rows, n_frames, order, plan.gaps)
    lists = read_posting_lists(index.planes, rows, order, plan.gaps)
    return HitRanges.none() if lists is None else _join(lists, plan, index.layout)


def search_packed(
    query: KeyframeQuery, packed: PackedFeatures, known: PackedFeatures | None = None
) -> HitRanges:
    """Hit ranges of a query in the features of one recording.

    Parameters
    ----------
    query : KeyframeQuery
    packed : array, shape (frames, n_integers), uint64, over the features of the query
    known : mask of the same shape: which features are known; all if left out

    Returns
    -------
    HitRanges, of sequence 0
    """
    _check_packed(query, packed, known)
    plan = plan_query(query)
    if plan is None:
        return HitRanges.none()
    n_integers = packed.shape[1]
    values, fixed = from_numbers(plan.values, n_integers), from_numbers(plan.fixed, n_integers)
    lists = []
    for keyframe in zip(values, fixed, strict=True):
        shown = _frames_of_keyframe(*keyframe, packed, known)
        lists.append(Intervals(*find_runs(shown).T))
    return _join(lists, plan, Layout.of_lengths(np.array([len(packed)], dtype=np.int64)))


def select_in_index(
    queries: Sequence[KeyframeQuery], n_columns: int, index: PostingIndex, *, votes: int = 1
) -> HitRanges:
    """Windows of the sequences of an index in which a template may lie.

    Each hit is extended by twice what the template has before its first and after its last
    keyframe, the slowest tempo at which the matcher still follows (Müller, Baak and Seidel
    2009, section 5).

    Parameters
    ----------
    queries : at least one
    n_columns : columns of the template
    index : PostingIndex over the features of the queries
    votes : windows of so many queries must agree

    Raises
    ------
    InvalidInput
        If queries and index are over different features, or so many votes are impossible.
    """
    found = [_windows(search_query(q, index), q, n_columns, index.lengths) for q in queries]
    return agree(found, votes=votes)


def select_in_sequence(
    queries: Sequence[KeyframeQuery],
    n_columns: int,
    packed: PackedFeatures,
    known: PackedFeatures | None = None,
    *,
    votes: int = 1,
) -> HitRanges:
    """Windows of one recording in which a template may lie; see `select_in_index`."""
    found = [
        _windows(search_packed(q, packed, known), q, n_columns, [len(packed)]) for q in queries
    ]
    return agree(found, votes=votes)


def single_hits(
    query: KeyframeQuery,
    packed: PackedFeatures,
    known: PackedFeatures | None = None,
    *,
    limit: int = 1000,
) -> Integers:
    """Hits in one recording, one frame for every keyframe, in lexicographic order.

    Their number may explode, so that one asks for a few of them; hit ranges hold them all.

    Parameters
    ----------
    query : KeyframeQuery
    packed, known : arrays, shape (frames, n_integers), uint64; known may be left out
    limit : at most so many

    Returns
    -------
    array, shape (hits, K): the frame of each keyframe, from 0

    Raises
    ------
    InvalidInput
        If the packed features do not have the shape of the query's, or the limit is below 1.
    """
    _check_packed(query, packed, known)
    if limit < 1:
        raise InvalidInput(f"limit must be at least 1, got {limit}")
    frames = [
        np.flatnonzero(_frames_of_keyframe(value, fixed, packed, known))
        for value, fixed in zip(query.values, query.fixed, strict=True)
    ]
    for k in reversed(range(len(query) - 1)):
        first, last = _successors(query.gaps[k], frames[k], frames[k + 1])
        frames[k] = frames[k][first < last]
    hits: list[tuple[int, ...]] = []
    # Every frame that is left has a successor: no path of the search is in vain.
    stack: list[tuple[int, ...]] = [(int(n),) for n in frames[0][:limit][::-1]]
    while stack and len(hits) < limit:
        path = stack.pop()
        if len(path) == len(query):
            hits.append(path)
            continue
        k = len(path) - 1
        first, last = _successors(query.gaps[k], np.array(path[-1:]), frames[k + 1])
        following = frames[k + 1][first[0] : last[0]][:limit]
        stack += [(*path, int(n)) for n in following[::-1]]
    return np.array(hits, dtype=np.int64).reshape(-1, len(query))


class FittedHits(NamedTuple):
    """The best hit for each frame at which one ends, in the order of time.

    Attributes
    ----------
    frames : array, shape (hits, K): the frame of each keyframe
    gap_costs : array, shape (hits,)
    """

    frames: Integers
    gap_costs: Floats


def fit_hits(query: KeyframeQuery, corpus: Corpus) -> FittedHits:
    """Hits of the least gap cost in the sequences of a corpus; frames are those of the corpus.

    All hits show all keyframes; they differ in tempo. The cost of a gap is 1 - a / b, with a
    and b the shorter and the longer of its length and the distance that it is made for: the
    columns of `template_of_query`. The gap cost of a hit is the mean over its gaps, in
    [0, 1). A frame of the last keyframe has one best hit that ends there. Of a gap without
    an upper bound only the latest frame before counts: there, shorter fits better.
    """
    packed, known = corpus.packed, corpus.known
    _check_packed(query, packed, known)
    columns = columns_of_query(query)
    hits, gap_costs = np.empty((0, 1), dtype=np.int64), np.empty(0)
    for k, keyframe in enumerate(zip(query.values, query.fixed, strict=True)):
        shown = _frames_of_keyframe(*keyframe, packed, known)
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


def _check_packed(
    query: KeyframeQuery, packed: PackedFeatures, known: PackedFeatures | None
) -> None:
    """Refuse packed features that cannot be of the query's set."""
    if packed.ndim != 2 or packed.shape[1] != query.values.shape[1]:
        raise InvalidInput(
            f"the query has {query.values.shape[1]} integers a frame, the recording has shape "
            f"{packed.shape}; both must come from one feature set"
        )
    if known is not None and known.shape != packed.shape:
        raise InvalidInput(
            f"known needs the shape of the packed features {packed.shape}, got {known.shape}"
        )


def _frames_of_keyframe(
    value: PackedFeatures,
    fixed: PackedFeatures,
    packed: PackedFeatures,
    known: PackedFeatures | None,
) -> NDArray[np.bool_]:
    """Which frames show a keyframe: all of its fixed features are known and have its values."""
    # Few arrays between: a search reads the features once per keyframe and does little else.
    shown = (packed & fixed) == (value & fixed)
    if known is not None:
        shown &= (known & fixed) == fixed
    return np.asarray(shown.all(axis=1))


def _join(lists: Sequence[Intervals], plan: Plan, layout: Layout) -> HitRanges:
    found, number = join(lists, plan.gaps, layout)
    return _in_sequences(*found, number, layout)


def _in_sequences(
    starts: Integers, stops: Integers, number: NDArray[np.int32], layout: Layout
) -> HitRanges:
    begin = layout.starts[number]
    return HitRanges(number.astype(np.int64), starts - begin, stops - begin)


def _search_compiled(
    kernel: Callable[..., Any],
    index: PostingIndex,
    rows: list[list[int]],
    n_frames: list[int],
    order: list[int],
    gaps: list[Gap],
) -> HitRanges:
    bounds = [(least, FAR if most is None else most) for least, most in gaps]
    layout = index.layout
    found = kernel(
        index.planes,
        np.array([row for keyframe in rows for row in keyframe]),
        np.cumsum([len(keyframe) for keyframe in rows]),
        np.array(n_frames),
        np.array(order),
        np.array(bounds, dtype=np.int64).reshape(-1, 2),
        (layout.starts, layout.stops, layout.of_byte),
    )
    return _in_sequences(found[:, 0], found[:, 1], layout.number(found[:, 0]), layout)


def _windows(
    ranges: HitRanges, query: KeyframeQuery, n_columns: int, lengths: ArrayLike
) -> HitRanges:
    if query.positions is None or query.positions[-1] >= n_columns:
        # Written by hand, or for another template: the whole template may lie on either side.
        return extend(ranges, n_columns, n_columns, lengths)
    return extend(ranges, *margins(query, n_columns), lengths)


def _successors(
    gap: Gap, frames: Integers, following: Integers
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Which of the frames that show the next keyframe lie within the gap after each frame."""
    first = np.searchsorted(following, frames + gap.least, side="left")
    if gap.most is None:
        return first, np.full_like(first, len(following))
    return first, np.searchsorted(following, frames + gap.most, side="right")


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
    """For each frame with one, the best frame before it, and the cost of that gap."""
    best, added = [np.empty(0, dtype=np.int64)], [np.empty(0)]
    for begin, end in _portions(np.maximum(stop - first, 0)):
        n = np.maximum(stop[begin:end] - first[begin:end], 0)
        reached = np.flatnonzero(n)
        n = n[reached]
        begins = np.cumsum(n) - n
        pairs = np.arange(n.sum()) + np.repeat(first[begin:end][reached] - begins, n)
        gaps = np.repeat(frames[begin:end][reached], n) - before[pairs]
        costs = _gap_cost(gaps, made_for)
        total = gap_costs[pairs] + costs
        if len(reached):
            least = np.repeat(np.minimum.reduceat(total, begins), n)
            at = np.flatnonzero(total == least)
            # Of equally good frames the latest: the shorter hit.
            owner = np.repeat(np.arange(len(n)), n)[at]
            chosen = at[np.searchsorted(owner, np.arange(len(n)), side="right") - 1]
            best.append(pairs[chosen])
            added.append(costs[chosen])
    return np.concatenate(best), np.concatenate(added)


def _portions(n_pairs: Integers) -> Iterator[tuple[int, int]]:
    """Ranges of frames of which each has a bounded number of pairs."""
    number = np.cumsum(n_pairs) // _MOST_PAIRS
    borders = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(n_pairs)]
    return itertools.pairwise(borders)


def _gap_cost(gaps: Integers, made_for: int) -> Floats:
    longer = np.maximum(np.maximum(gaps, made_for), 1)
    shorter = np.where(longer == 1, longer, np.minimum(gaps, made_for))
    return np.asarray(1.0 - shorter / longer)
