"""What is learned from whom, and how well do queries do on an actor not learned from?

A committee is so many of the first queries of a class, of which so many must agree.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from evidence.common.ranking import TOLERANCE_2006, corpus_of, template_of
from evidence.common.recordings import Clip, Recordings
from motionary.batch import Failure, map_ordered
from motionary.features import FULL_BODY, FeatureSequence
from motionary.io import read_query_collections
from motionary.matching import Pattern, corpus_distance
from motionary.models.keyframes import (
    HitRanges,
    KeyframeQuery,
    PostingIndex,
    from_patterns,
    index_packed,
    search_query,
    select_in_index,
)
from motionary.models.query_learning import (
    GeneticSettings,
    LearnedQueries,
    Problem,
    learn_runs,
    state_problem,
    weighted_f,
)
from motionary.models.templates import MotionTemplate, pattern_of, quantise

#: Thresholds at which recall that is lost, and precision, are told.
LOW, HIGH = 0.06, 0.1

Measures = dict[str, float]
Rows = list[dict[str, Any]]
Actors = tuple[str, ...]
Item = TypeVar("Item")
Result = TypeVar("Result")


class Committee(NamedTuple):
    """So many queries, of which so many must agree."""

    queries: int
    votes: int

    def __str__(self) -> str:
        return f"{self.votes} of {self.queries}"


class Split(NamedTuple):
    """Clips of the class, and of all others."""

    positives: list[FeatureSequence]
    negatives: list[FeatureSequence]


def split(clips: Sequence[Clip], name: str, actors: Iterable[str]) -> Split:
    """Positives and negatives of some actors."""
    wanted = set(actors)
    mine = [clip for clip in clips if clip.actor in wanted]
    return Split(
        [clip.packed for clip in mine if clip.motion_class == name],
        [clip.packed for clip in mine if clip.motion_class != name],
    )


def problem_of(examples: Split, settings: GeneticSettings, *, seed: int) -> Problem:
    """What queries are learned from."""
    return state_problem(
        examples.positives, examples.negatives, settings=settings, seed=seed,
        template=template_of(examples.positives),
    )  # fmt: skip


def learn_from(
    examples: Split, settings: GeneticSettings, runs: int, *, seed: int
) -> LearnedQueries:
    """Queries of so many runs."""
    problem = problem_of(examples, settings, seed=seed)
    return LearnedQueries(problem, tuple(learn_runs(problem, range(runs))), votes=1)


def manual_queries(recordings: Recordings) -> dict[str, KeyframeQuery]:
    """Queries that the authors made by hand, of the classes at hand."""
    path = recordings.folder.resolve().parent / "reference" / "golden" / "manual_keyframes.json"
    records = read_query_collections(path)["retrieval_2008"]
    queries = {}
    for name in recordings.classes:
        record = records[name]
        queries[name] = from_patterns(
            record.keyframes, record.groups, distances=record.distances,
            stiffness=record.stiffness, positions=record.positions,
        )  # fmt: skip
    return queries


class Trial:
    """Clips of an actor who was not learned from, and what a template finds in them.

    Parameters
    ----------
    template : of the class
    unseen : clips of the other actor
    """

    def __init__(self, template: MotionTemplate, unseen: Split) -> None:
        self._documents = [*unseen.positives, *unseen.negatives]
        self._n_positives = len(unseen.positives)
        self._n_columns = template.n_columns
        self._pattern = pattern_of(quantise(template, tolerance=TOLERANCE_2006))
        self._everywhere = _least(self._pattern, self._documents)
        self.index = index_of(self._documents)

    def measure(self, queries: Sequence[KeyframeQuery], *, votes: int) -> Measures:
        """Documents that enough queries find, and the template around their hits."""
        ranges = select_in_index(queries, self._n_columns, self.index, votes=votes)
        hits = np.zeros(len(self._documents), dtype=np.intp)
        for query in queries:
            hits[search_query(query, self.index).hit_sequences] += 1
        return self._retrieval(np.flatnonzero(hits >= votes)) | self._preselection(ranges)

    def ask(self, queries: Sequence[KeyframeQuery], committee: Committee) -> Measures:
        """What a committee of the first of these queries does."""
        return self.measure(queries[: committee.queries], votes=committee.votes)

    def _retrieval(self, documents: NDArray[np.intp]) -> Measures:
        right = int(np.count_nonzero(documents < self._n_positives))
        precision, recall = right / max(len(documents), 1), right / self._n_positives
        return {
            "f2": weighted_f(precision, recall, beta=2.0),
            "f1": weighted_f(precision, recall, beta=1.0),
            "precision": precision,
            "recall": recall,
        }

    def _preselection(self, ranges: HitRanges) -> Measures:
        """Frames left, recall lost at a low threshold, precision at a high one."""
        left = np.full(len(self._documents), np.inf)
        parts = [self._documents[d].part(start, stop) for d, start, stop in ranges]
        np.minimum.at(left, ranges.sequences, _least(self._pattern, parts))
        before, after = self._everywhere, left
        positives = slice(0, self._n_positives)
        recall = float(np.mean(before[positives] <= LOW))
        return {
            "frames left": ranges.n_frames / self.index.n_frames,
            "recall of the template": recall,
            "recall lost": recall - float(np.mean(after[positives] <= LOW)),
            "precision of the template": _precision(before <= HIGH, self._n_positives),
            "precision left": _precision(after <= HIGH, self._n_positives),
        }


def index_of(clips: Sequence[FeatureSequence]) -> PostingIndex:
    """Index of clips, each a document."""
    return index_packed(
        [clip.packed for clip in clips],
        [clip.known for clip in clips],
        feature_set=FULL_BODY.name,
        feature_ids=FULL_BODY.ids,
    )


def compute_all(
    function: Callable[[Item], Result], items: Iterable[Item], *, jobs: int
) -> list[Result]:
    """Results in their order; the first failure is raised."""
    results = []
    for result in map_ordered(function, items, jobs=jobs):
        if isinstance(result, Failure):
            raise result.error
        results.append(result)
    return results


def head(key: str) -> str:
    """Name of a measure as the head of a column."""
    return key.upper() if key in ("f1", "f2") else key


def mean_of(rows: Sequence[Measures]) -> Measures:
    """Means of measures."""
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}


def _least(pattern: Pattern, clips: Sequence[FeatureSequence]) -> NDArray[np.float64]:
    """Least cost of the pattern in each clip."""
    if not clips:
        return np.empty(0)
    corpus = corpus_of(clips)
    parts = corpus.split(corpus_distance(pattern, corpus))
    return np.array([part.min(initial=np.inf) for part in parts], dtype=np.float64)


def _precision(found: NDArray[np.bool_], n_positives: int) -> float:
    n_found = int(np.count_nonzero(found))
    return int(np.count_nonzero(found[:n_positives])) / max(n_found, 1)
