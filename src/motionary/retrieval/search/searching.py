"""Search in a collection by example, class, template or keyframes.

By class or template: ranked hits below a threshold (Müller and Röder 2006, section 5.4);
where a class has keyframes, only around them. By keyframes alone: see `keyframes`.

By example: between people and styles by windows of ranked quantities, see `similar`; as
published, by the template of query expansion, see `expansion`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from numbers import Integral, Real
from typing import Any

import numpy as np

from motionary.batch import Workers
from motionary.errors import InvalidInput, check_kind
from motionary.features import (
    FULL_BODY,
    SEQUENCE_HZ,
    FeatureSequence,
    FeatureSet,
    compute_features,
    load_everyday_set,
)
from motionary.io import ReadOptions
from motionary.models.keyframes import KeyframeQuery
from motionary.models.library import MotionClass, Prototype
from motionary.models.templates import MotionTemplate, pattern_of, quantise
from motionary.motion import Motion
from motionary.retrieval.explanation import describe_nearest
from motionary.retrieval.index import Collection, Index, Sources, collect
from motionary.retrieval.search.examples import search_by_windows
from motionary.retrieval.search.expansion import QueryExpansion, RelevanceFeedback, expand
from motionary.retrieval.search.keyframes import (
    Preselection,
    explain_absence,
    preselect_by,
    queries_of,
    rank_queries,
)
from motionary.retrieval.search.parts import rank_patterns
from motionary.retrieval.search.ranking import Hit, SearchPattern, SearchResult

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
    jobs: Workers = 1,
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
    expansion : how an example is compared: between people and styles by windows over the set of
        `load_everyday_set`, which files and motions are measured over; as published where this
        says so, where `preselect` is given, and where features or an index are over other sets
    preselect : where to match: by default around the keyframes of a class that has some,
        otherwise everywhere; False: everywhere; True: around keyframes, derived from the
        template where none are given, which is faster and misses some hits; or around hits
        of the given queries
    reading, jobs : how files are read, and by whom; shards of an index are searched by them, too

    Raises
    ------
    InvalidInput
        If there is nothing to search, a template is free everywhere or over other features,
        or the limit is below 1.
    """
    parts = query if isinstance(query, Sequence) and not isinstance(query, str) else (query,)
    for part in parts or (query,):
        check_kind(
            part, _QUERY_KINDS, name="query", role="an example, a class or keyframes",
            remedy="read files first: search(read(path), …)",
        )  # fmt: skip
    for name, number, kinds in (("threshold", threshold, Real), ("limit", limit, Integral)):
        if number is not None:
            check_kind(number, (kinds,), name=name, remedy="give a number")
    if limit is not None and limit < 1:
        raise InvalidInput(f"limit must be at least 1, or None for all hits, got {limit}")
    if isinstance(query, MotionClass) and threshold is None:
        threshold = query.threshold
    expansion = expansion or QueryExpansion()
    as_published = bool(expansion.published or preselect)
    feature_set = FULL_BODY if as_published else _set_of(query, recordings)
    collection = _open(recordings, feature_set, reading, jobs)
    found = _find(
        query, collection, expansion, preselect,
        most=np.inf if threshold is None else threshold, limit=limit, jobs=jobs,
    )  # fmt: skip
    return replace(found, query=query, searched=recordings)


def _find(
    query: Query,
    collection: Collection,
    expansion: QueryExpansion,
    preselect: Preselection,
    *,
    most: float,
    limit: int | None,
    jobs: Workers,
) -> SearchResult:
    as_published = bool(expansion.published or preselect)
    if not as_published and _is_everyday_example(query, collection):
        example = _as_feedback(query, load_everyday_set())
        return search_by_windows(
            example, collection, expansion, threshold=most, limit=limit, jobs=jobs
        )
    collection, asked = collection.published, _as_published(query)
    queries = queries_of(asked)
    if queries:
        hits = rank_queries(queries, collection, threshold=most, limit=limit, jobs=jobs)
        why = "" if hits else explain_absence(queries, collection)
        return SearchResult(tuple(hits), (), collection.failures, why, queries)
    patterns, templates = _patterns_of(asked, collection, expansion, preselect)
    for pattern in patterns:
        _check_pattern(pattern, collection)
    search = partial(rank_patterns, patterns, collection, jobs=jobs)
    hits, fraction = search(threshold=most, limit=limit)
    keyframes = tuple(dict.fromkeys(q for pattern in patterns for q in pattern.queries))
    why = ""
    if not hits:
        nearest = search(threshold=np.inf, limit=1).hits
        why = _nearest(nearest, patterns, keyframes, collection, threshold=most)
    return SearchResult(
        tuple(hits),
        tuple(templates),
        collection.failures,
        why,
        keyframes,
        fraction if keyframes else 1.0,
    )


def _open(
    recordings: Recordings, feature_set: FeatureSet, reading: ReadOptions | None, jobs: Workers
) -> Collection:
    if isinstance(recordings, Index):
        return recordings.collection()
    if isinstance(recordings, Collection):
        return recordings
    return collect(recordings, reading=reading, feature_set=feature_set, jobs=jobs)


def _set_of(query: Query, recordings: Recordings) -> FeatureSet:
    """Features to measure in recordings that are searched for a query, unless as published."""
    given: Iterable[Any] = ()
    if isinstance(recordings, Mapping):
        given = recordings.values()
    elif isinstance(recordings, Sequence) and not isinstance(recordings, str):
        given = recordings
    measured = [one for one in (_example_of(query), *given) if isinstance(one, FeatureSequence)]
    is_example = isinstance(_example_of(query), Motion | FeatureSequence)
    everyday = load_everyday_set()
    return (
        everyday if is_example and all(o.feature_set == everyday for o in measured) else FULL_BODY
    )


def _example_of(query: Any) -> Any:
    return query.example if isinstance(query, RelevanceFeedback) else query


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
    collection = collection.published
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
        query = _as_feedback(query, collection.feature_set)
        template, expanded = expand(query, collection, expansion, preselect=preselect)
        patterns, templates = [expanded], [template]
    pairs = zip(patterns, templates, strict=True)
    return [preselect_by(preselect, p, template, collection) for p, template in pairs], templates


def _as_feedback(query: Any, feature_set: FeatureSet) -> RelevanceFeedback:
    if isinstance(query, RelevanceFeedback):
        return query
    if isinstance(query, Motion):
        query = compute_features(query, feature_set=feature_set)
    return RelevanceFeedback(query)


def _is_everyday_example(query: Any, collection: Collection) -> bool:
    """Whether an example, and what is searched, are over the everyday set."""
    if collection.feature_set != load_everyday_set():
        return False
    example = _example_of(query)
    if isinstance(example, FeatureSequence):
        return example.feature_set == load_everyday_set()
    return isinstance(example, Motion)


def _as_published(query: Any) -> Any:
    """A query over the everyday set as one over the published features."""
    if isinstance(query, RelevanceFeedback):
        return RelevanceFeedback(
            _as_published(query.example),
            tuple(_as_published(hit) for hit in query.relevant),
            tuple(_as_published(hit) for hit in query.irrelevant),
        )
    if isinstance(query, FeatureSequence) and query.feature_set == load_everyday_set():
        return query.leading(FULL_BODY)
    return query


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


def _nearest(
    best: Sequence[Hit],
    patterns: Sequence[SearchPattern],
    queries: Sequence[KeyframeQuery],
    collection: Collection,
    *,
    threshold: float,
) -> str:
    """What came closest, for a search without hits."""
    if best:
        return describe_nearest(best[0].evidence, what=best[0].recording.name, threshold=threshold)
    if queries:
        return f"nothing to match: {explain_absence(queries, collection)}"
    # Two columns go through one frame, but for the first.
    least_s = min(p.template.n_columns // 2 + 1 for p in patterns) / SEQUENCE_HZ
    return (
        f"no recording is long enough for the query (at least {least_s:.1f} s), "
        "or too little of it was seen"
    )
