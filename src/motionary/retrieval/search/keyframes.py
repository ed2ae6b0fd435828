"""Keyframe queries in a search: alone, or to choose where a template is matched.

Alone, for motions that are known by a query only: every hit shows all keyframes; those come
first that keep the distances between them best. A hit's cost is its gap cost (see
`keyframes.fitting`): 0 where the gaps are those that the query is made for.

Derived from an expanded template, to search large collections fast: a few short queries, of
which any may hit. Each takes the segments of the template that are rarest in the collection
and that no earlier query has taken: a feature that holds, or does not, for a while. It is
complete as soon as it leaves few enough frames. What all performances show and what only some
do cannot be read from one example: several loose queries keep more of them than a strict one.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.batch import Workers
from motionary.errors import InvalidInput
from motionary.features import FeatureSet
from motionary.matching import Alignment, self_information
from motionary.models.keyframes import (
    KeyframeQuery,
    columns_of_query,
    fit_hits,
    gap_of,
    search_query,
    select_in_index,
    template_of_query,
)
from motionary.models.templates import MotionTemplate, QuantisedTemplate, pattern_of, quantise
from motionary.packing import pack, unpack
from motionary.recording import find_runs
from motionary.retrieval.explanation import Evidence
from motionary.retrieval.index import LARGE_COLLECTION, Collection, Part
from motionary.retrieval.search.parts import PartRows, PartTask, Row, merge_parts
from motionary.retrieval.search.ranking import Hit, SearchPattern, hit_of

Integers = NDArray[np.int64]

#: Where to match: by default, everywhere or not, or around the hits of queries.
Preselection = bool | KeyframeQuery | Sequence[KeyframeQuery] | None

#: What hits of keyframes alone are called.
NAME = "keyframes"

#: Segments that nearly every recording shows are worth nothing.
_LEAST_WORTH = 0.05
#: From so many columns on, a longer segment is worth no more.
_FULL_WORTH_AT = 5
#: Of a large collection a query is to leave so many frames, which are matched in a second.
_LARGE_LEFT = 1 << 18
#: A query that no segment completes is of use if it leaves at most so many times as much.
_STILL_OF_USE = 2.0
# Fractions of the frames that keyframes may leave: in a small collection of a few classes,
# a class is not rare.
_MAY_BE_LEFT = (0.12, 0.25, 0.5, 1.0)


@dataclass(frozen=True, slots=True)
class Deriving:
    """How queries are derived from a template.

    Attributes
    ----------
    queries : at most so many
    frames_left : fraction of the frames around the hits of one query at which it is complete
    keyframes, features : most keyframes of a query, most features of a keyframe
    stiffness : of its gaps
    apart : fewest columns between two keyframes
    shortest : fewest columns that a feature must keep its value to count
    tolerance : a feature counts if at most this fraction of the template's examples differs;
        a keyframe has no tolerance of its own, so less than where the template is matched
    """

    queries: int = 4
    frames_left: float = 0.12
    keyframes: int = 2
    features: int = 4
    stiffness: float = 0.5
    apart: int = 6
    shortest: int = 3
    tolerance: float = 0.1

    @classmethod
    def of(cls, n_frames: int) -> "Deriving":
        """Settings for a collection: in a large one queries fix more, and leave less."""
        if n_frames <= LARGE_COLLECTION:
            return cls()
        return cls(frames_left=_LARGE_LEFT / n_frames, keyframes=4, features=8)


def queries_of(given: object) -> tuple[KeyframeQuery, ...]:
    """Keyframe queries, one or several; none if something else is given."""
    if isinstance(given, KeyframeQuery):
        return (given,)
    if isinstance(given, Sequence) and not isinstance(given, str):
        queries = tuple(item for item in given if isinstance(item, KeyframeQuery))
        return queries if len(queries) == len(given) else ()
    return ()


def preselect_by(
    preselect: Preselection,
    pattern: SearchPattern,
    template: MotionTemplate,
    collection: Collection,
) -> SearchPattern:
    """A pattern with the queries that choose where it is matched."""
    if preselect is None or (preselect is True and pattern.queries):
        return pattern
    if preselect is True:
        queries = derive_queries(template, collection, Deriving.of(collection.n_frames))
    else:
        queries = queries_of(preselect)
    return replace(pattern, queries=queries, votes=1)


def rank_queries(
    queries: Sequence[KeyframeQuery],
    collection: Collection,
    *,
    threshold: float,
    limit: int | None,
    jobs: Workers = 1,
) -> list[Hit]:
    """Hits of any query of which none overlap, best first; of equal ones the earlier first.

    Raises
    ------
    InvalidInput
        If a query is over other features, fixes nothing or contradicts itself.
    """
    if not all(query.fixed.any() for query in queries):
        raise InvalidInput("the query fixes no feature, so that it would find everything")
    templates = [template_of_query(query) for query in queries]
    patterns = [pattern_of(template) for template in templates]
    merged = merge_parts(
        partial(_rank_part, queries=tuple(queries), limit=limit),
        collection,
        threshold=threshold,
        limit=limit,
        jobs=jobs,
    )
    hits = []
    for cost, number, _, (query, frames) in merged.rows:
        columns = columns_of_query(queries[query])
        if len(columns) == 1:
            frames = np.arange(frames[0], frames[-1] + 1)
        path = np.column_stack([np.broadcast_to(columns, frames.shape), frames])
        alignment = Alignment(int(frames[0]), int(frames[-1]), cost, path)
        sequence = collection.sequences[number]
        hits.append(hit_of(Evidence(NAME, templates[query], patterns[query], sequence, alignment)))
    return hits


def _rank_part(
    task: PartTask, *, queries: Sequence[KeyframeQuery], limit: int | None
) -> PartRows[tuple[int, Integers]]:
    """Hits in one part: by the number of the query, and the frames of its keyframes."""
    (part,) = task.open().parts
    pieces = [
        piece
        for number, query in enumerate(queries)
        if (piece := _find(query, number, part)) is not None
    ]
    return PartRows(
        [
            Row(
                float(piece.gap_costs[row]),
                int(piece.numbers[row]),
                int(piece.frames[row, 0]),
                (piece.query, piece.frames[row]),
            )
            for piece, row in _apart(pieces, task.most, limit)
        ]
    )


def explain_absence(queries: Sequence[KeyframeQuery], collection: Collection) -> str:
    """Why queries find nothing, in a sentence; the first stands for all."""
    query = queries[0]
    counts = []
    for value, fixed in zip(query.values, query.fixed, strict=True):
        alone = KeyframeQuery(
            value[np.newaxis], fixed[np.newaxis], (), query.feature_set, query.feature_ids
        )
        found = [search_query(alone, part.shard.posting_index) for part in collection.parts]
        counts.append(sum(ranges.n_frames for ranges in found))
    if 0 in counts:
        k = counts.index(0)
        features = _phrase(query, k, collection.feature_set)
        return f"no frame shows keyframe {k + 1} of {len(query)} ({features})"
    seen = ", ".join(f"{k} in {n} frames" for k, n in enumerate(counts, start=1))
    return f"each keyframe is shown ({seen}), but never one after the other as asked for"


def derive_queries(
    template: MotionTemplate, collection: Collection, deriving: Deriving
) -> tuple[KeyframeQuery, ...]:
    """Queries around whose hits a template may be found; none if it has nothing rare.

    Parameters
    ----------
    template : of the motion
    collection : decides what is rare, and how much a query leaves
    deriving : settings
    """
    quantised = quantise(template, tolerance=deriving.tolerance)
    left = _runs_of(quantised, collection.feature_prior, deriving.shortest)
    queries: list[KeyframeQuery] = []
    while left and len(queries) < deriving.queries:
        draft, used, query, fraction = _Draft(), set(), None, 1.0
        for run in left:
            if not draft.add(run, deriving):
                continue
            used.add(run)
            query = draft.query(quantised, deriving.stiffness)
            fraction = _fraction_left(query, template.n_columns, collection.sample)
            if fraction <= deriving.frames_left:
                break
        # To match a large collection everywhere takes minutes: one query there is in any case.
        is_needed = not queries and collection.n_frames > LARGE_COLLECTION
        is_of_use = is_needed or fraction <= _STILL_OF_USE * deriving.frames_left
        if query is None or not is_of_use:
            break
        queries.append(query)
        left = [run for run in left if run not in used]
    return tuple(queries)


def suggest_queries(
    templates: Sequence[MotionTemplate], collection: Collection
) -> tuple[KeyframeQuery, ...]:
    """Queries derived from templates, as selective as they can be.

    Raises
    ------
    InvalidInput
        If nothing in the templates is rare.
    """
    for fraction in _MAY_BE_LEFT:
        deriving = Deriving(frames_left=fraction)
        derived = [derive_queries(template, collection, deriving) for template in templates]
        if any(derived):
            return tuple(query for queries in derived for query in queries)
    raise InvalidInput("nothing in the template is rare enough to be a keyframe")


class _Piece(NamedTuple):
    """Hits of one query in one part of a collection.

    Attributes
    ----------
    query : number of the query
    frames : array, shape (hits, K), frames of the sequences; of one keyframe the first and the
        last that show it
    gap_costs, numbers : arrays, shape (hits,); sequences are numbered as in the collection
    """

    query: int
    frames: Integers
    gap_costs: NDArray[np.float64]
    numbers: Integers


def _find(query: KeyframeQuery, number: int, part: Part) -> _Piece | None:
    """The best hit for each frame at which one ends; of one keyframe the runs that show it."""
    ranges = search_query(query, part.shard.posting_index)
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


class _Run(NamedTuple):
    """Columns, half-open, in which a template fixes a feature to one value."""

    worth: float
    feature: int
    value: bool
    start: int
    stop: int

    @property
    def middle(self) -> int:
        return (self.start + self.stop - 1) // 2


@dataclass(slots=True)
class _Draft:
    """A query that is being made: the features of each keyframe by its column."""

    keyframes: dict[int, dict[int, bool]] = field(default_factory=dict)

    def add(self, run: _Run, deriving: Deriving) -> bool:
        """Whether a run found a place, in a keyframe within it or in a new one."""
        inside = [c for c in self.keyframes if run.start <= c < run.stop]
        if inside:
            nearest = min(inside, key=lambda column: abs(column - run.middle))
            features = self.keyframes[nearest]
            if len(features) == deriving.features or run.feature in features:
                return False
            features[run.feature] = run.value
            return True
        near = any(abs(c - run.middle) < deriving.apart for c in self.keyframes)
        if near or len(self.keyframes) == deriving.keyframes:
            return False
        self.keyframes[run.middle] = {run.feature: run.value}
        return True

    def query(self, template: QuantisedTemplate, stiffness: float) -> KeyframeQuery:
        """The query, with the columns as positions."""
        columns = sorted(self.keyframes)
        shape = (len(columns), template.n_features)
        values, fixed = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
        for k, column in enumerate(columns):
            for feature, value in self.keyframes[column].items():
                values[k, feature], fixed[k, feature] = value, True
        gaps = tuple(gap_of(int(d), stiffness) for d in np.diff(columns))
        return KeyframeQuery(
            pack(values), pack(fixed), gaps, template.feature_set, template.feature_names,
            tuple(columns),
        )  # fmt: skip


def _runs_of(template: QuantisedTemplate, ones: NDArray[np.float64], shortest: int) -> list[_Run]:
    """Runs of fixed cells of a template, those worth most first."""
    worth = self_information(template.values, ones)
    found = []
    for feature in range(template.n_features):
        for value in (True, False):
            shown = template.fixed[:, feature] & (template.values[:, feature] == value)
            for start, stop in find_runs(shown).tolist():
                fraction = min(1.0, (stop - start) / _FULL_WORTH_AT)
                total = float(worth[start, feature]) * fraction
                if stop - start >= shortest and total >= _LEAST_WORTH:
                    found.append(_Run(total, feature, value, start, stop))
    return sorted(found, reverse=True)


def _fraction_left(query: KeyframeQuery, n_columns: int, collection: Collection) -> float:
    indexes = [part.shard.posting_index for part in collection.parts]
    left = sum(select_in_index([query], n_columns, index).n_frames for index in indexes)
    return left / max(sum(index.n_frames for index in indexes), 1)
