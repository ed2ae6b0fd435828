"""Which keyframes does a grown template suggest, to look for it in large collections?

A few short queries, of which any may hit. Each takes the stretches of the template that are
rarest in the collection and that no earlier query has taken: a relation that holds, or
fails, for a while. It is complete as soon as it leaves few enough frames. What all
performances show and what only some do, cannot be told from one example: several loose
queries keep more of them than one strict one.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.matching import self_information
from motionary.models.keyframes import KeyframeQuery, gap_of, select_in_index
from motionary.models.templates import MotionTemplate, QuantisedTemplate, quantise
from motionary.packing import pack
from motionary.retrieval.index import Collection


@dataclass(frozen=True, slots=True)
class Deriving:
    """How queries are derived from a template.

    Attributes
    ----------
    queries : at most so many
    frames_left : share of the frames around the hits of one query at which it is complete
    keyframes, relations : most keyframes of a query, most relations of a keyframe
    stiffness : of its gaps
    apart : fewest columns between two keyframes
    shortest : fewest columns that a relation must keep its value to count
    tolerance : a relation counts if at most this share of the template's examples differs;
        a keyframe forgives nothing, so less than where the template is matched
    """

    queries: int = 4
    frames_left: float = 0.12
    keyframes: int = 2
    features: int = 4
    stiffness: float = 0.5
    apart: int = 6
    shortest: int = 3
    tolerance: float = 0.1


class _Stretch(NamedTuple):
    """Columns, half-open, in which a template fixes a relation to one value."""

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
    """A query that is being made: the relations of each keyframe by its column."""

    keyframes: dict[int, dict[int, bool]] = field(default_factory=dict)

    def add(self, segment: _Stretch, deriving: Deriving) -> bool:
        """Whether a stretch found a place, in a keyframe within it or in a new one."""
        inside = [c for c in self.keyframes if segment.start <= c < segment.stop]
        if inside:
            nearest = min(inside, key=lambda column: abs(column - segment.middle))
            features = self.keyframes[nearest]
            if len(features) == deriving.features or segment.feature in features:
                return False
            features[segment.feature] = segment.value
            return True
        near = any(abs(c - segment.middle) < deriving.apart for c in self.keyframes)
        if near or len(self.keyframes) == deriving.keyframes:
            return False
        self.keyframes[segment.middle] = {segment.feature: segment.value}
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


#: Stretches that nearly every recording shows tell nothing.
_LEAST_WORTH = 0.05
#: From so many columns on, a longer stretch is worth no more.
_FULL_WORTH_AT = 5
#: A query that no stretch completes is of use if it leaves at most so many times as much.
_STILL_OF_USE = 2.0


def derive_queries(
    template: MotionTemplate, collection: Collection, deriving: Deriving
) -> tuple[KeyframeQuery, ...]:
    """Queries around whose hits a template may be found; none if it has nothing rare.

    Parameters
    ----------
    template : what is sought
    collection : says what is rare, and how much a query leaves
    deriving : settings
    """
    quantised = quantise(template, tolerance=deriving.tolerance)
    left = _segments(quantised, collection.feature_prior, deriving.shortest)
    queries: list[KeyframeQuery] = []
    while left and len(queries) < deriving.queries:
        draft, used, query, fraction = _Draft(), set(), None, 1.0
        for segment in left:
            if not draft.add(segment, deriving):
                continue
            used.add(segment)
            query = draft.query(quantised, deriving.stiffness)
            fraction = _fraction_left(query, template.n_columns, collection)
            if fraction <= deriving.frames_left:
                break
        if query is None or fraction > _STILL_OF_USE * deriving.frames_left:
            break
        queries.append(query)
        left = [segment for segment in left if segment not in used]
    return tuple(queries)


def _segments(
    template: QuantisedTemplate, ones: NDArray[np.float64], shortest: int
) -> list[_Stretch]:
    """Stretches of a template, the most telling first."""
    worth = self_information(template.values, ones)
    found = []
    for feature in range(template.n_features):
        for value in (True, False):
            shown = template.fixed[:, feature] & (template.values[:, feature] == value)
            edges = np.flatnonzero(np.diff(np.concatenate([[False], shown, [False]])))
            for start, stop in edges.reshape(-1, 2).tolist():
                fraction = min(1.0, (stop - start) / _FULL_WORTH_AT)
                total = float(worth[start, feature]) * fraction
                if stop - start >= shortest and total >= _LEAST_WORTH:
                    found.append(_Stretch(total, feature, value, start, stop))
    return sorted(found, reverse=True)


def _fraction_left(query: KeyframeQuery, n_columns: int, collection: Collection) -> float:
    indexes = [part.shard.word_index for part in collection.parts]
    left = sum(select_in_index([query], n_columns, index).n_frames for index in indexes)
    return left / max(sum(index.n_frames for index in indexes), 1)
