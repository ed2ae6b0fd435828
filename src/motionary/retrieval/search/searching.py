"""Search in a collection by example, class, template or keyframes.

By class or template: ranked hits below a threshold (Müller and Röder 2006, section 5.4);
where a class has keyframes, only around them. By keyframes alone: see `keyframes`.

By example with query expansion: the example's features are the first template; one learned
from the example and its nearest hits shows what may vary. It is learned in steps, from one
hit, then two, four, ..., each time found anew: what a few sure hits free, brings the next ones
nearer. With relevance feedback the template is learned from the relevant hits; what the
irrelevant ones show at the same moments has little weight.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, check_kind
from motionary.features import SEQUENCE_HZ, FeatureSequence, compute_features
from motionary.io import ReadOptions
from motionary.matching import Pattern, align, distance_function
from motionary.models.keyframes import KeyframeQuery
from motionary.models.library import MotionClass, Prototype
from motionary.models.templates import MotionTemplate, learn_template, pattern_of, quantise
from motionary.motion import Motion
from motionary.packing import unpack
from motionary.retrieval.explanation import describe_nearest
from motionary.retrieval.index import Collection, Index, Sources, collect
from motionary.retrieval.search.keyframes import (
    Preselection,
    explain_absence,
    preselect_by,
    queries_of,
    rank_queries,
)
from motionary.retrieval.search.ranking import Hit, Matches, SearchPattern, SearchResult, match

Floats = NDArray[np.float64]

#: A hit of this cost is near, however near the nearest was.
_NEAR = 0.02


@dataclass(frozen=True, slots=True)
class QueryExpansion:
    """How an example becomes a template; defaults: docs/evidence/growing_choice.md.

    Attributes
    ----------
    hits : nearest hits that the template is learned from in the end, beside the example; 0
        searches the example's features as they are
    most_cost : if the nearest hit costs more, nothing is near enough to learn from
    reach : from the second step on, a hit may cost so many times what the nearest one did at
        first
    tolerance : a cell is fixed if at most this fraction of example and hits differs
    by_self_information : whether what is rare in the collection weighs more
    prior : how many frames of the collection at large stand beside those of irrelevant hits
        when it is counted what they show
    """

    hits: int = 3
    most_cost: float = 0.35
    reach: float = 0.6
    tolerance: float = 0.1
    by_self_information: bool = True
    prior: float = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class RelevanceFeedback:
    """An example, and which of its hits a person found relevant.

    Attributes
    ----------
    example : its features
    relevant, irrelevant : hits, or their features
    """

    example: FeatureSequence
    relevant: tuple[Hit | FeatureSequence, ...] = ()
    irrelevant: tuple[Hit | FeatureSequence, ...] = ()


#: What a person searches for.
Query = (
    Motion
    | FeatureSequence
    | RelevanceFeedback
    | MotionTemplate
    | MotionClass
    | KeyframeQuery
    | Sequence[KeyframeQuery]
)
_QUERY_KINDS = (
    Motion, FeatureSequence, RelevanceFeedback, MotionTemplate, MotionClass, KeyframeQuery,
)  # fmt: skip
#: What can be searched.
Recordings = Collection | Index | Sources


def search(
    query: Query,
    recordings: Recordings,
    *,
    threshold: float | None = None,
    limit: int | None = 20,
    expansion: QueryExpansion | None = None,
    preselect: Preselection = None,
    reading: ReadOptions | None = None,
    jobs: int = 1,
) -> SearchResult:
    """Ranked hits of an example, a template, a class or keyframes.

    Parameters
    ----------
    query : an example (a motion or its features, cut to the motion itself), one with relevance
        feedback, a template, a class, or keyframes alone, of which any may be found
    recordings : a folder or files, motions, features (as a dict: by the names that their hits
        get), an index, or a collection of them
    threshold : largest cost; by default the class's own, otherwise none
    limit : most hits; None for all
    expansion : how an example becomes a template
    preselect : where to match: by default around the keyframes of a class that has some,
        otherwise everywhere; False: everywhere; True: around keyframes, derived from the
        template where none are given, which is faster and misses some hits; or around hits
        of the given queries
    reading, jobs : how files are read

    Raises
    ------
    InvalidInput
        If there is nothing to search, a template is free everywhere or over other features,
        or the limit is below 1.
    """
    parts = query if isinstance(query, Sequence) and not isinstance(query, str) else (query,)
    for part in parts:
        check_kind(
            part, _QUERY_KINDS, name="query", role="an example, a class or keyframes",
            remedy="read files first: search(read(path), …)",
        )  # fmt: skip
    for name, number, kinds in (("threshold", threshold, Real), ("limit", limit, Integral)):
        if number is not None:
            check_kind(number, (kinds,), name=name, remedy="give a number")
    if limit is not None and limit < 1:
        raise InvalidInput(f"limit must be at least 1, or None for all hits, got {limit}")
    if isinstance(recordings, Index):
        collection = recordings.collection()
    elif isinstance(recordings, Collection):
        collection = recordings
    else:
        collection = collect(recordings, reading=reading, jobs=jobs)
    if isinstance(query, MotionClass) and threshold is None:
        threshold = query.threshold
    most = np.inf if threshold is None else threshold
    queries = queries_of(query)
    if queries:
        hits = rank_queries(queries, collection, threshold=most, limit=limit)
        why = "" if hits else explain_absence(queries, collection)
        found = SearchResult(tuple(hits), (), collection.failures, why, queries)
        return replace(found, query=query, searched=recordings)
    patterns, templates = _patterns_of(query, collection, expansion or QueryExpansion(), preselect)
    for pattern in patterns:
        _check_pattern(pattern, collection)
    found = _result(match(patterns, collection), templates, threshold=most, limit=limit)
    return replace(found, query=query, searched=recordings)


def expand(
    feedback: RelevanceFeedback,
    collection: Collection,
    expansion: QueryExpansion,
    *,
    preselect: Preselection = None,
) -> tuple[MotionTemplate, SearchPattern]:
    """Template of an example and its nearest or its relevant hits, and its pattern.

    Parameters
    ----------
    feedback : the example, and the hits found relevant or not
    collection : where the nearest hits are found
    expansion : settings
    preselect : where to look for them

    Raises
    ------
    InvalidInput
        If the example is over other features, or nothing of it is fixed.
    """
    example = feedback.example
    _check_features(feedback, collection)
    ones = collection.feature_prior if expansion.by_self_information else None
    if feedback.relevant or feedback.irrelevant:
        relevant = [_features_of(hit) for hit in feedback.relevant if not _is_example(hit, example)]
        template = _learn(example, relevant)
        pattern = _to_pattern(example, template, expansion, ones)
        irrelevant = [_features_of(hit) for hit in feedback.irrelevant]
        return template, _weigh_against(irrelevant, pattern, ones, expansion.prior)
    template, most, is_first = _learn(example, []), expansion.most_cost, True
    for n_hits in _steps(expansion.hits):
        pattern = _to_pattern(example, template, expansion, ones)
        pattern = preselect_by(preselect, pattern, template, collection)
        nearest = match([pattern], collection).rank(threshold=most, limit=n_hits + 1)
        others = [hit for hit in nearest if not _is_example(hit, example)][:n_hits]
        if not others:
            break
        if is_first:
            most, is_first = max(expansion.reach * others[0].cost, _NEAR), False
        template = _learn(example, [_features_of(hit) for hit in others])
    return template, _to_pattern(example, template, expansion, ones)


def class_of_result(
    result: SearchResult, name: str, collection: Collection, expansion: QueryExpansion
) -> MotionClass:
    """Class that finds what an example found: at the same costs, around the same keyframes.

    Parameters
    ----------
    result : of a search by example
    name : of the class
    collection, expansion : as in the search
    """
    background = collection.feature_prior.tolist() if expansion.by_self_information else ()
    return MotionClass(
        name,
        (Prototype(name, result.templates[0], result.queries),),
        tolerance=expansion.tolerance,
        background=tuple(background),
    )


def _patterns_of(
    query: Any, collection: Collection, expansion: QueryExpansion, preselect: Preselection
) -> tuple[list[SearchPattern], list[MotionTemplate]]:
    """Patterns of a query with the queries that preselect, and its templates."""
    if isinstance(query, MotionClass):
        templates = [prototype.template for prototype in query.prototypes]
        patterns = [
            SearchPattern(query.name, template, pattern, prototype.queries, prototype.votes)
            for prototype, (template, pattern) in zip(query.prototypes, query.patterns, strict=True)
        ]
    elif isinstance(query, MotionTemplate):
        quantised = quantise(query, tolerance=expansion.tolerance)
        patterns = [SearchPattern(query.provenance or "template", quantised, pattern_of(quantised))]
        templates = [query]
    else:
        if isinstance(query, Motion):
            query = compute_features(query, feature_set=collection.feature_set)
        if isinstance(query, FeatureSequence):
            query = RelevanceFeedback(query)
        template, expanded = expand(query, collection, expansion, preselect=preselect)
        patterns, templates = [expanded], [template]
    pairs = zip(patterns, templates, strict=True)
    return [preselect_by(preselect, p, template, collection) for p, template in pairs], templates


def _check_pattern(item: SearchPattern, collection: Collection) -> None:
    template, feature_set = item.template, collection.feature_set
    if template.feature_names != feature_set.ids:
        raise InvalidInput(
            f"{item.name}: a template over {template.feature_set!r}, but the collection is over "
            f"{feature_set.name!r}; compute its features with the template's set"
        )
    if template.n_fixed == 0:
        raise InvalidInput(
            f"{item.name}: the template has no fixed cell, so it would match everything"
        )


def _result(
    matches: Matches, templates: Sequence[MotionTemplate], *, threshold: float, limit: int | None
) -> SearchResult:
    hits = tuple(matches.rank(threshold=threshold, limit=limit))
    queries = tuple(dict.fromkeys(q for pattern in matches.patterns for q in pattern.queries))
    return SearchResult(
        hits,
        tuple(templates),
        matches.collection.failures,
        "" if hits else _nearest(matches, queries, threshold),
        queries,
        matches.fraction if queries else 1.0,
    )


def _nearest(matches: Matches, queries: Sequence[KeyframeQuery], threshold: float) -> str:
    """What came closest, for a search without hits."""
    best = matches.rank(threshold=np.inf, limit=1)
    if best:
        return describe_nearest(best[0].evidence, what=best[0].recording.name, threshold=threshold)
    if queries:
        return f"nothing to match: {explain_absence(queries, matches.collection)}"
    # Two columns go through one frame, but for the first.
    least_s = min(p.template.n_columns // 2 + 1 for p in matches.patterns) / SEQUENCE_HZ
    return (
        f"no recording is long enough for the query (at least {least_s:.1f} s), "
        "or too little of it was seen"
    )


def _steps(hits: int) -> Iterator[int]:
    """1, 2, 4, ... and at last all."""
    n = 1
    while n < hits:
        yield n
        n *= 2
    if hits:
        yield hits


def _check_features(feedback: RelevanceFeedback, collection: Collection) -> None:
    hits = (*feedback.relevant, *feedback.irrelevant)
    for sequence in (feedback.example, *map(_features_of, hits)):
        if sequence.feature_set.name != collection.feature_set.name:
            raise InvalidInput(
                f"the example has features of {sequence.feature_set.name!r}, the collection of "
                f"{collection.feature_set.name!r}"
            )


def _to_pattern(
    example: FeatureSequence,
    template: MotionTemplate,
    expansion: QueryExpansion,
    ones: Floats | None,
) -> SearchPattern:
    quantised = quantise(template, tolerance=expansion.tolerance)
    if quantised.n_fixed == 0:
        raise InvalidInput(
            f"{example.source}: nothing of the example is known and common to its hits; "
            "give a longer segment or an example in which more joints are seen"
        )
    name = f"like {example.source}" if example.source else "like the example"
    return SearchPattern(name, quantised, pattern_of(quantised, ones=ones))


def _weigh_against(
    irrelevant: Sequence[FeatureSequence], pattern: SearchPattern, ones: Floats | None, prior: float
) -> SearchPattern:
    """Pattern whose entries weigh by their self-information among the irrelevant hits."""
    if not irrelevant:
        return pattern
    template = pattern.template
    at_large = np.full(template.n_features, 0.5) if ones is None else ones
    shown, seen = _count_shown(pattern.pattern, irrelevant, template.n_features)
    fractions = (shown + prior * at_large) / (seen + prior)
    return SearchPattern(pattern.name, template, pattern_of(template, ones=fractions))


def _count_shown(
    pattern: Pattern, hits: Sequence[FeatureSequence], n_features: int
) -> tuple[Floats, Floats]:
    """How often each feature holds, and is known, where a column meets hits."""
    shown, seen = np.zeros((len(pattern), n_features)), np.zeros((len(pattern), n_features))
    for sequence in hits:
        distance = distance_function(pattern, sequence.packed, sequence.known)
        end = int(np.argmin(distance))
        if not np.isfinite(distance[end]):
            continue
        columns, frames = align(pattern, sequence.packed, sequence.known, [end])[0].path.T
        np.add.at(shown, columns, unpack(sequence.packed & sequence.known, n_features)[frames])
        np.add.at(seen, columns, unpack(sequence.known, n_features)[frames])
    return shown, seen


def _learn(example: FeatureSequence, hits: Sequence[FeatureSequence]) -> MotionTemplate:
    parts = [example, *hits]
    n_hits = "1 hit" if len(hits) == 1 else f"{len(hits)} hits"
    every = all(bool(p.known_features.all()) for p in parts)
    return learn_template(
        [p.features for p in parts],
        known=None if every else [p.known_features.astype(np.bool_) for p in parts],
        feature_names=example.feature_set.ids,
        feature_set=example.feature_set.name,
        provenance=f"expanded from {example.source or 'an example'} and {n_hits}",
    )


def _features_of(hit: Hit | FeatureSequence) -> FeatureSequence:
    if isinstance(hit, FeatureSequence):
        return hit
    found = hit.evidence
    return found.sequence.part(found.alignment.start, found.alignment.end + 1)


def _is_example(hit: Hit | FeatureSequence, example: FeatureSequence) -> bool:
    """Whether a hit is the example itself, found in the collection: nothing to learn from."""
    if isinstance(hit, FeatureSequence):
        return hit is example
    packed, n = hit.evidence.sequence.packed, len(example)
    start, stop = hit.evidence.alignment.start, hit.evidence.alignment.end + 1
    # Where a body stands still, a hit may begin or end beside the example.
    for first in range(max(0, start - n), min(stop, len(packed) - n + 1)):
        shared = min(first + n, stop) - max(first, start)
        if 2 * shared > n and bool((packed[first : first + n] == example.packed).all()):
            return True
    return False
