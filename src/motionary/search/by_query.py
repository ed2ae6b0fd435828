"""Where do keyframes follow each other as a query says?

For motions that are known by a query alone. Every hit shows all keyframes; those come first
that keep the distances between them best. A hit's cost is its misfit (see
`keyframes.fitting`): 0 where the gaps are those that the query is made for.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput
from motionary.explanation import Evidence
from motionary.features import FeatureSet
from motionary.index import Collection, Part
from motionary.keyframes import (
    KeyframeQuery,
    columns_of_query,
    fit_hits,
    search_query,
    template_of_query,
)
from motionary.matching import Alignment
from motionary.search.ranking import cut_windows
from motionary.search.results import Hit, hit_of
from motionary.templates import pattern_of
from motionary.words import unpack

NAME = "keyframes"


class _Found(NamedTuple):
    """A hit: documents are numbered as in the collection, frames are those of the document."""

    misfit: float
    number: int
    frames: tuple[int, ...]
    query: int


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
    hits = []
    for found in _apart(_find(queries, collection), threshold, limit):
        frames = np.array(found.frames)
        path = np.column_stack([columns_of_query(queries[found.query]), frames])
        alignment = Alignment(int(frames[0]), int(frames[-1]), found.misfit, path)
        template, pattern = templates[found.query], patterns[found.query]
        sequence = collection.sequences[found.number]
        hits.append(hit_of(Evidence(NAME, template, pattern, sequence, alignment)))
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
        relations = _phrase(query, k, collection.feature_set)
        return f"no frame shows keyframe {k + 1} of {len(query)} ({relations})"
    seen = ", ".join(f"{k} in {n} frames" for k, n in enumerate(counts, start=1))
    return f"each keyframe is shown ({seen}), but never one after the other as asked for"


def _find(queries: Sequence[KeyframeQuery], collection: Collection) -> list[_Found]:
    """The best hit for each frame at which one ends, best first."""
    found: list[_Found] = []
    for number, query in enumerate(queries):
        for part in collection.parts:
            found += _find_in_part(query, number, part)
    return sorted(found)


def _find_in_part(query: KeyframeQuery, query_number: int, part: Part) -> list[_Found]:
    ranges = search_query(query, part.shard.word_index)
    if len(ranges) == 0:
        return []
    windows = cut_windows(part, ranges)
    fitted = fit_hits(query, windows)
    at = np.searchsorted(windows.starts, fitted.frames[:, 0], side="right") - 1
    frames = fitted.frames + (ranges.starts - windows.starts)[at, np.newaxis]
    numbers = part.numbers[ranges.documents[at]]
    rows = zip(fitted.misfits.tolist(), numbers.tolist(), frames.tolist(), strict=True)
    return [_Found(misfit, number, tuple(row), query_number) for misfit, number, row in rows]


def _apart(found: list[_Found], threshold: float, limit: int | None) -> list[_Found]:
    """Hits of which none overlaps a better one."""
    taken: dict[int, list[tuple[int, int]]] = {}
    kept: list[_Found] = []
    for hit in found:
        if hit.misfit > threshold or (limit is not None and len(kept) >= limit):
            break
        first, last = hit.frames[0], hit.frames[-1]
        spans = taken.setdefault(hit.number, [])
        if all(last < start or stop < first for start, stop in spans):
            spans.append((first, last))
            kept.append(hit)
    return kept


def _phrase(query: KeyframeQuery, keyframe: int, feature_set: FeatureSet) -> str:
    names = feature_set.names
    values = unpack(query.values, len(names))[keyframe]
    fixed = unpack(query.fixed, len(names))[keyframe]
    return ", ".join(names[i] if values[i] else f"not {names[i]}" for i in np.flatnonzero(fixed))
