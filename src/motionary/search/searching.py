"""Where in a collection is a motion like this one?

By class or template: ranked hits below a threshold (Müller and Röder 2006, section 5.4);
where a class has keyframes, only around them. By example: see `growing`. By keyframes alone:
see `by_query`.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from motionary.errors import InvalidInput
from motionary.explanation import tell_nearest
from motionary.features import WORD_HZ, FeatureSequence, Reading, compute_features
from motionary.index import Collection, Index, collect
from motionary.keyframes import KeyframeQuery
from motionary.library import MotionClass
from motionary.motion import Motion
from motionary.search.by_query import explain_absence, rank_query
from motionary.search.growing import Growing, grow
from motionary.search.ranking import Sought, rank, share_matched
from motionary.search.results import SearchResult
from motionary.templates import MotionTemplate, pattern_of, quantise

#: What can be sought.
Wanted = Motion | FeatureSequence | MotionTemplate | MotionClass | KeyframeQuery
#: What can be searched.
Recordings = Collection | Index | str | Path | Sequence[str | Path | Motion | FeatureSequence]


def search(
    query: Wanted,
    recordings: Recordings,
    *,
    threshold: float | None = None,
    limit: int | None = 20,
    growing: Growing | None = None,
    preselect: bool | KeyframeQuery = True,
    reading: Reading | None = None,
    jobs: int = 1,
) -> SearchResult:
    """Ranked hits of an example, a template, a class or keyframes.

    Parameters
    ----------
    query : an example (a motion or its words, cut to what is sought), a template, a class,
        or keyframes alone
    recordings : a folder or files, motions, words, an index, or a collection of them
    threshold : largest cost; by default the class's own, otherwise none
    limit : most hits; None for all
    growing : how an example becomes a template
    preselect : whether templates of a class are matched only around their keyframes, where
        the class has some; or keyframes around which to match whatever is sought
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
    if isinstance(query, KeyframeQuery):
        most = np.inf if threshold is None else threshold
        hits = rank_query(query, collection, threshold=most, limit=limit)
        why = "" if hits else explain_absence(query, collection)
        return SearchResult(tuple(hits), (), collection.failures, why, (query,))
    settings = growing or Growing()
    keyframes = preselect if isinstance(preselect, KeyframeQuery) else None
    if isinstance(query, MotionClass):
        threshold = query.threshold if threshold is None else threshold
        sought = _of_class(query, preselect=preselect is True)
        templates = [subclass.template for subclass in query.subclasses]
    elif isinstance(query, MotionTemplate):
        quantised = quantise(query, tolerance=settings.tolerance)
        sought = [Sought(query.provenance or "template", quantised, pattern_of(quantised))]
        templates = [query]
    else:
        if isinstance(query, Motion):
            query = compute_features(query, feature_set=collection.feature_set)
        template, grown = grow(query, collection, settings)
        sought, templates = [grown], [template]
    if keyframes is not None:
        sought = [Sought(s.name, s.template, s.pattern, keyframes) for s in sought]
    return _result(sought, templates, collection, threshold, limit)


def _collection(recordings: Recordings, reading: Reading | None, jobs: int) -> Collection:
    if isinstance(recordings, Index):
        return recordings.collection()
    if isinstance(recordings, Collection):
        return recordings
    return collect(recordings, reading=reading, jobs=jobs)


def _of_class(motion_class: MotionClass, *, preselect: bool) -> list[Sought]:
    """Templates of a class, with their keyframes where they are wanted."""
    return [
        Sought(motion_class.name, template, pattern, subclass.query if preselect else None)
        for subclass, (template, pattern) in zip(
            motion_class.subclasses, motion_class.sought(), strict=True
        )
    ]


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
    queries = tuple(dict.fromkeys(s.query for s in sought if s.query is not None))
    return SearchResult(
        hits,
        tuple(templates),
        collection.failures,
        "" if hits else _nearest(sought, collection, most),
        queries,
        share_matched(sought, collection) if queries else 1.0,
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
        return tell_nearest(best[0].evidence, what=best[0].recording, threshold=threshold)
    queries = [s.query for s in sought if s.query is not None]
    if queries:
        return f"nothing to match: {explain_absence(queries[0], collection)}"
    # Two columns go through one frame, but for the first.
    least_s = min(s.template.n_columns // 2 + 1 for s in sought) / WORD_HZ
    return (
        f"no recording is long enough for what is sought (at least {least_s:.1f} s), "
        "or too little of it was seen"
    )
