"""Where do keyframes follow each other as a query says?

For motions that are known by a query alone. Every hit shows all keyframes; what ranks hits
is the template of the keyframe columns, free in between (`template_of_query`): it costs
nothing where the keyframes keep the distances that the query is made for, up to half and
twice the tempo, and more where they do not.
"""

from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput
from motionary.explanation import Evidence
from motionary.features import FeatureSequence, FeatureSet
from motionary.index import Collection
from motionary.keyframes import (
    KeyframeQuery,
    columns_of_query,
    search_query,
    shortest_hits,
    template_of_query,
)
from motionary.matching import Alignment, Pattern, distance_function
from motionary.search.ranking import Sought, match_windows
from motionary.search.results import Hit, hit_of
from motionary.templates import QuantisedTemplate, pattern_of
from motionary.words import Words, unpack

#: Cost of a hit whose tempo the matcher does not follow.
OUT_OF_TEMPO = 1.0

NAME = "keyframes"


class _Query(NamedTuple):
    """A query with the template that ranks its hits."""

    query: KeyframeQuery
    template: QuantisedTemplate
    pattern: Pattern
    columns: list[int]


def rank_query(
    query: KeyframeQuery, collection: Collection, *, threshold: float, limit: int | None
) -> list[Hit]:
    """Hits of a query that do not overlap, best first; of equal ones the earlier first.

    Raises
    ------
    InvalidInput
        If the query is over other features, fixes nothing or contradicts itself.
    """
    if not query.fixed.any():
        raise InvalidInput("the query fixes no relation, so that it would find everything")
    template = template_of_query(query)
    sought = _Query(query, template, pattern_of(template), columns_of_query(query))
    windows: list[tuple[float, int, int, int]] = []
    for part in collection.parts:
        ranges = search_query(query, part.shard.word_index)
        if len(ranges) == 0:
            continue
        found = match_windows(Sought(NAME, template, sought.pattern), part, ranges)
        costs = np.minimum(found.least(), OUT_OF_TEMPO).tolist()
        numbers = part.numbers[ranges.documents].tolist()
        windows += zip(costs, numbers, ranges.starts.tolist(), ranges.stops.tolist(), strict=True)
    hits: list[tuple[float, int, int, Hit]] = []
    for cost, number, start, stop in sorted(windows):
        worst = sorted(h[0] for h in hits)[:limit][-1:] if limit is not None else []
        if cost > threshold or (limit is not None and len(hits) >= limit and cost >= worst[0]):
            break
        sequence = collection.sequences[number]
        for hit in _hits_in(sequence, start, stop, sought):
            if hit.cost <= threshold:
                hits.append((hit.cost, number, hit.evidence.alignment.start, hit))
    hits.sort(key=lambda h: h[:3])
    return [hit for *_, hit in hits[:limit]]


def explain_absence(query: KeyframeQuery, collection: Collection) -> str:
    """Why a query finds nothing, in a sentence."""
    counts = []
    for k in range(len(query)):
        alone = KeyframeQuery(
            query.values[k : k + 1], query.fixed[k : k + 1], (), query.feature_set,
            query.feature_ids,
        )  # fmt: skip
        found = [search_query(alone, part.shard.word_index) for part in collection.parts]
        counts.append(sum(ranges.n_frames for ranges in found))
    if 0 in counts:
        k = counts.index(0)
        relations = _phrase(query, k, collection.feature_set)
        return f"no frame shows keyframe {k + 1} of {len(query)} ({relations})"
    seen = ", ".join(f"{k} in {n} frames" for k, n in enumerate(counts, start=1))
    return f"each keyframe is shown (keyframe {seen}), but never one after the other as asked for"


def _hits_in(sequence: FeatureSequence, start: int, stop: int, sought: _Query) -> list[Hit]:
    words, known = sequence.words[start:stop], sequence.known[start:stop]
    hits = []
    for frames in shortest_hits(sought.query, words, known):
        first, last = int(frames[0]), int(frames[-1])
        cost = _cost(sought.pattern, words[first : last + 1], known[first : last + 1])
        path = np.column_stack([np.array(sought.columns), frames + start])
        alignment = Alignment(first + start, last + start, cost, path)
        evidence = Evidence(NAME, sought.template, sought.pattern, sequence, alignment)
        hits.append(hit_of(evidence))
    return hits


def _cost(pattern: Pattern, words: Words, known: Words) -> float:
    """Cost of the best path that ends with the hit and does not begin before it."""
    return min(float(distance_function(pattern, words, known)[-1]), OUT_OF_TEMPO)


def _phrase(query: KeyframeQuery, keyframe: int, feature_set: FeatureSet) -> str:
    values = unpack(query.values, len(feature_set))[keyframe]
    fixed = unpack(query.fixed, len(feature_set))[keyframe]
    names = feature_set.names
    return ", ".join(names[i] if values[i] else f"not {names[i]}" for i in np.flatnonzero(fixed))
