"""Where in a collection is a motion like this one?

By class or template: ranked hits below a threshold (Müller and Röder 2006, section 5.4);
where a class has keyframes, only around them. By example: see `growing`. By keyframes alone:
see `by_query`.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import SEQUENCE_HZ, FeatureSequence, compute_features
from motionary.io import ReadOptions
from motionary.models.keyframes import KeyframeQuery
from motionary.models.library import MotionClass
from motionary.models.templates import MotionTemplate, pattern_of, quantise
from motionary.motion import Motion
from motionary.retrieval.explanation import describe_nearest
from motionary.retrieval.index import Collection, Index, collect
from motionary.retrieval.search.by_query import explain_absence, rank_queries
from motionary.retrieval.search.deriving import Deriving, derive_queries
from motionary.retrieval.search.expansion import Narrower, QueryExpansion, RelevanceFeedback, grow
from motionary.retrieval.search.ranking import Sought, fraction_matched, rank
from motionary.retrieval.search.results import SearchResult

#: What can be sought.
Wanted = (
    Motion
    | FeatureSequence
    | RelevanceFeedback
    | MotionTemplate
    | MotionClass
    | KeyframeQuery
    | Sequence[KeyframeQuery]
)
#: What can be searched.
Recordings = Collection | Index | str | Path | Sequence[str | Path | Motion | FeatureSequence]

#: Where to match: by default, everywhere or not, or around the hits of queries.
Preselection = bool | KeyframeQuery | Sequence[KeyframeQuery] | None


def search(
    query: Wanted,
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
    query : an example (a motion or its words, cut to what is sought), one whose hits a
        person has judged, a template, a class, or keyframes alone, of which any may be found
    recordings : a folder or files, motions, words, an index, or a collection of them
    threshold : largest cost; by default the class's own, otherwise none
    limit : most hits; None for all
    growing : how an example becomes a template
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
    if limit is not None and limit < 1:
        raise InvalidInput(f"limit must be at least 1, or None for all hits, got {limit}")
    collection = _collection(recordings, reading, jobs)
    queries = _as_queries(query)
    if queries:
        return _by_query(queries, collection, threshold, limit)
    if isinstance(query, MotionClass) and threshold is None:
        threshold = query.threshold
    sought, templates = _seek(query, collection, expansion or QueryExpansion(), preselect)
    return _result(sought, templates, collection, threshold, limit)


def _collection(recordings: Recordings, reading: ReadOptions | None, jobs: int) -> Collection:
    if isinstance(recordings, Index):
        return recordings.collection()
    if isinstance(recordings, Collection):
        return recordings
    return collect(recordings, reading=reading, jobs=jobs)


def _as_queries(given: object) -> tuple[KeyframeQuery, ...]:
    """Keyframe queries, one or several; none if something else is given."""
    if isinstance(given, KeyframeQuery):
        return (given,)
    if isinstance(given, Sequence) and not isinstance(given, str):
        queries = tuple(item for item in given if isinstance(item, KeyframeQuery))
        return queries if len(queries) == len(given) else ()
    return ()


def _by_query(
    queries: tuple[KeyframeQuery, ...],
    collection: Collection,
    threshold: float | None,
    limit: int | None,
) -> SearchResult:
    most = np.inf if threshold is None else threshold
    hits = rank_queries(queries, collection, threshold=most, limit=limit)
    why = "" if hits else explain_absence(queries, collection)
    return SearchResult(tuple(hits), (), collection.failures, why, queries)


def _seek(
    query: object, collection: Collection, expansion: QueryExpansion, preselect: Preselection
) -> tuple[list[Sought], list[MotionTemplate]]:
    """What is sought and where, and its templates."""
    if isinstance(query, MotionClass):
        templates = [prototype.template for prototype in query.prototypes]
        sought = [
            Sought(query.name, template, pattern, prototype.queries, prototype.votes)
            for prototype, (template, pattern) in zip(query.prototypes, query.sought(), strict=True)
        ]
    elif isinstance(query, MotionTemplate):
        quantised = quantise(query, tolerance=expansion.tolerance)
        sought = [Sought(query.provenance or "template", quantised, pattern_of(quantised))]
        templates = [query]
    elif isinstance(query, Motion | FeatureSequence | RelevanceFeedback):
        if isinstance(query, Motion):
            query = compute_features(query, feature_set=collection.feature_set)
        if isinstance(query, FeatureSequence):
            query = RelevanceFeedback(query)
        template, expanded = grow(query, collection, expansion, narrow=_narrower(preselect))
        sought, templates = [expanded], [template]
    else:
        raise InvalidInput(
            "sought must be an example, a template, a class or keyframes, got "
            f"{type(query).__name__}"
        )
    narrow = _narrower(preselect)
    pairs = zip(sought, templates, strict=True)
    return [narrow(item, template, collection) for item, template in pairs], templates


def _narrower(preselect: Preselection) -> Narrower:
    """Says where something is matched."""

    def narrow(item: Sought, template: MotionTemplate, collection: Collection) -> Sought:
        if preselect is None:
            return item
        if preselect is True and item.queries:
            return item
        if preselect is True:
            queries = derive_queries(template, collection, Deriving())
        else:
            queries = _as_queries(preselect)
        return replace(item, queries=queries, votes=1)

    return narrow


def _result(
    sought: Sequence[Sought],
    templates: Sequence[MotionTemplate],
    collection: Collection,
    threshold: float | None,
    limit: int | None,
) -> SearchResult:
    for item in sought:
        _check_sought(item, collection)
    most = np.inf if threshold is None else threshold
    hits = tuple(rank(sought, collection, threshold=most, limit=limit))
    queries = tuple(dict.fromkeys(query for item in sought for query in item.queries))
    return SearchResult(
        hits,
        tuple(templates),
        collection.failures,
        "" if hits else _nearest(sought, collection, most),
        queries,
        fraction_matched(sought, collection) if queries else 1.0,
    )


def _check_sought(item: Sought, collection: Collection) -> None:
    template, feature_set = item.template, collection.feature_set
    if template.feature_names != feature_set.ids:
        raise InvalidInput(
            f"{item.name}: a template over {template.feature_set!r}, but the collection is over "
            f"{feature_set.name!r}; compute its words with the template's set"
        )
    if template.n_fixed == 0:
        raise InvalidInput(
            f"{item.name}: the template has no fixed cell, so it would match everything"
        )


def _nearest(sought: Sequence[Sought], collection: Collection, threshold: float) -> str:
    """What came closest, for a search without hits."""
    best = rank(sought, collection, threshold=np.inf, limit=1)
    if best:
        return describe_nearest(best[0].evidence, what=best[0].recording, threshold=threshold)
    queries = tuple(query for item in sought for query in item.queries)
    if queries:
        return f"nothing to match: {explain_absence(queries, collection)}"
    # Two columns go through one frame, but for the first.
    least_s = min(s.template.n_columns // 2 + 1 for s in sought) / SEQUENCE_HZ
    return (
        f"no recording is long enough for what is sought (at least {least_s:.1f} s), "
        "or too little of it was seen"
    )
