"""Where do keyframes follow each other as a query says?

For motions that are known by a query alone. Every hit shows all keyframes; those come first
that keep the distances between them best. A hit's cost is its misfit (see
`keyframes.fitting`): 0 where the gaps are those that the query is made for.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSet
from motionary.matching import Alignment
from motionary.models.keyframes import (
    KeyframeQuery,
    columns_of_query,
    fit_hits,
    search_query,
    template_of_query,
)
from motionary.models.templates import pattern_of
from motionary.packing import unpack
from motionary.retrieval.explanation import Evidence
from motionary.retrieval.index import Collection, Part
from motionary.retrieval.search.results import Hit, hit_of

Integers = NDArray[np.int64]

NAME = "keyframes"


class _Piece(NamedTuple):
    """Hits of one query in one part of a collection.

    Attributes
    ----------
    query : number of the query
    frames : array, shape (hits, K), frames of the documents; of one keyframe the first and the
        last that show it
    misfits, numbers : arrays, shape (hits,); documents are numbered as in the collection
    """

    query: int
    frames: Integers
    gap_costs: NDArray[np.float64]
    numbers: Integers


def rank_queries(
    queries: Sequence[KeyframeQuery],
    collection: Collection,
    *,
    threshold: float,
    limit: int | None,
) -> list[Hit]:
    """Hits of any query of which none overlap, best first; of equal ones the earlier first.

    Raises
    ------
    InvalidInput
        If a query is over other features, fixes nothing or contradicts itself.
    """
    if not all(query.fixed.any() for query in queries):
        raise InvalidInput("the query fixes no relation, so that it would find everything")
    templates = [template_of_query(query) for query in queries]
    patterns = [pattern_of(template) for template in templates]
    pieces = [
        piece
        for number, query in enumerate(queries)
        for part in collection.parts
        if (piece := _find(query, number, part)) is not None
    ]
    hits = []
    for piece, row in _apart(pieces, threshold, limit):
        query, frames = piece.query, piece.frames[row]
        columns = columns_of_query(queries[query])
        if len(columns) == 1:
            frames = np.arange(frames[0], frames[-1] + 1)
        path = np.column_stack([np.broadcast_to(columns, frames.shape), frames])
        gap_cost = float(piece.gap_costs[row])
        alignment = Alignment(int(frames[0]), int(frames[-1]), gap_cost, path)
        sequence = collection.sequences[int(piece.numbers[row])]
        hits.append(hit_of(Evidence(NAME, templates[query], patterns[query], sequence, alignment)))
    return hits


def explain_absence(queries: Sequence[KeyframeQuery], collection: Collection) -> str:
    """Why queries find nothing, in a sentence; the first stands for all."""
    query = queries[0]
    counts = []
    for value, fixed in zip(query.values, query.fixed, strict=True):
        alone = KeyframeQuery(
            value[np.newaxis], fixed[np.newaxis], (), query.feature_set, query.feature_ids
        )
        found = [search_query(alone, part.shard.word_index) for part in collection.parts]
        counts.append(sum(ranges.n_frames for ranges in found))
    if 0 in counts:
        k = counts.index(0)
        features = _phrase(query, k, collection.feature_set)
        return f"no frame shows keyframe {k + 1} of {len(query)} ({features})"
    seen = ", ".join(f"{k} in {n} frames" for k, n in enumerate(counts, start=1))
    return f"each keyframe is shown ({seen}), but never one after the other as asked for"


def _find(query: KeyframeQuery, number: int, part: Part) -> _Piece | None:
    """The best hit for each frame at which one ends; of one keyframe the runs that show it."""
    ranges = search_query(query, part.shard.word_index)
    if len(ranges) == 0:
        return None
    if len(query) == 1:
        runs = np.column_stack([ranges.starts, ranges.stops - 1])
        return _Piece(number, runs, np.zeros(len(runs)), part.numbers[ranges.sequences])
    windows = part.shard.cut(ranges)
    fitted = fit_hits(query, windows)
    at = np.searchsorted(windows.starts, fitted.frames[:, 0], side="right") - 1
    frames = fitted.frames + (ranges.starts - windows.starts)[at, np.newaxis]
    return _Piece(number, frames, fitted.gap_costs, part.numbers[ranges.sequences[at]])


def _apart(
    pieces: Sequence[_Piece], threshold: float, limit: int | None
) -> Iterator[tuple[_Piece, int]]:
    """Hits of which none overlaps a better one, best first; each by its piece and row."""
    if not pieces:
        return
    piece = np.concatenate([np.full(len(p.gap_costs), i) for i, p in enumerate(pieces)])
    row = np.concatenate([np.arange(len(p.gap_costs)) for p in pieces])
    gap_costs, numbers = (np.concatenate(x) for x in zip(*(p[2:] for p in pieces), strict=True))
    first, last = (np.concatenate([p.frames[:, end] for p in pieces]) for end in (0, -1))
    taken: dict[int, list[tuple[int, int]]] = {}
    n_kept = 0
    for i in np.lexsort((piece, last, first, numbers, gap_costs)):
        if gap_costs[i] > threshold or n_kept == limit:
            return
        spans = taken.setdefault(int(numbers[i]), [])
        if all(last[i] < start or stop < first[i] for start, stop in spans):
            spans.append((int(first[i]), int(last[i])))
            n_kept += 1
            yield pieces[piece[i]], int(row[i])


def _phrase(query: KeyframeQuery, keyframe: int, feature_set: FeatureSet) -> str:
    values = unpack(query.values, len(feature_set))[keyframe]
    fixed = unpack(query.fixed, len(feature_set))[keyframe]
    features = feature_set.features
    return ", ".join(features[i].phrase(bool(values[i])) for i in np.flatnonzero(fixed))
