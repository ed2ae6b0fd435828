"""Keyframe queries: where they come from, and what they keep of what a template finds.

The authors' queries by hand, the rule of thumb of 2006, `choose_query`, and learned ones.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.ranking import TOLERANCE_2006, corpus_of, template_of
from evidence.common.recordings import ACTORS, Clip, Recordings
from motionary.evaluation import compute_rates_at
from motionary.features import FeatureSequence
from motionary.io import QueryRecord, read_query_collections
from motionary.matching import corpus_distance
from motionary.models.keyframes import (
    ChoiceSettings,
    KeyframeQuery,
    PostingIndex,
    choose_keyframes,
    choose_query,
    from_patterns,
    from_template,
    index_packed,
    mirror_query,
    search_query,
    select_in_index,
)
from motionary.models.library import MotionClass
from motionary.models.query_learning import (
    RUNS,
    GeneticSettings,
    LearnedQueries,
    Problem,
    default_votes,
    learn_runs,
    state_problem,
    weighted_f,
)
from motionary.models.templates import MotionTemplate, pattern_of, quantise

Floats = NDArray[np.float64]
Measures = dict[str, float]

#: Collections of the authors: Table 2 of 2008, and their annotation of 2009.
RETRIEVAL_2008, ANNOTATION_2009 = "retrieval_2008", "annotation_2009"
#: Thresholds at which recall that is lost, and precision, are reported.
LOW, HIGH = 0.06, 0.1


class Committee(NamedTuple):
    """Queries of a class, and how many of them must agree."""

    queries: tuple[KeyframeQuery, ...]
    votes: int = 1


class Heuristic(NamedTuple):
    """Settings of the rule of thumb."""

    n_keyframes: int
    stiffness: float


class Lesson(NamedTuple):
    """A class with what it is learned from.

    Attributes
    ----------
    template : of the examples
    examples, counterexamples : features of the class, and of all other classes
    """

    template: MotionTemplate
    examples: tuple[FeatureSequence, ...]
    counterexamples: tuple[FeatureSequence, ...]


def lesson_of(clips: Sequence[Clip], name: str, actors: Iterable[str] = ACTORS) -> Lesson:
    """A class of some actors' clips against all others of theirs."""
    wanted = set(actors)
    mine = [clip for clip in clips if clip.actor in wanted]
    examples = tuple(clip.packed for clip in mine if clip.motion_class == name)
    others = tuple(clip.packed for clip in mine if clip.motion_class != name)
    return Lesson(template_of(examples), examples, others)


def lessons_of(clips: Sequence[Clip]) -> dict[str, Lesson]:
    """Each class of some clips against all others."""
    return {n: lesson_of(clips, n) for n in sorted({clip.motion_class for clip in clips})}


def manual_records(recordings: Recordings, collection: str) -> dict[str, QueryRecord]:
    """The authors' queries of a collection as they are written, by the class in print."""
    return read_query_collections(recordings.golden_path("manual_keyframes.json"))[collection]


def manual(recordings: Recordings, collection: str) -> dict[str, KeyframeQuery]:
    """The authors' queries of a collection, by the name of the class in print."""
    records = manual_records(recordings, collection)
    return {name: query_of(record) for name, record in records.items()}


def query_of(record: QueryRecord, *, stiffness: float | None = None) -> KeyframeQuery:
    """Query of a record, with the stiffness of all gaps replaced if one is given."""
    given = record.stiffness if stiffness is None else (stiffness,) * len(record.stiffness)
    return from_patterns(
        record.keyframes, record.groups, distances=record.distances,
        stiffness=given, positions=record.positions,
    )  # fmt: skip


def by_heuristic(lesson: Lesson, settings: Heuristic) -> Committee:
    """Keyframes by the rule of thumb of 2006, each with its group's features."""
    template = quantise(lesson.template, tolerance=TOLERANCE_2006)
    chosen = choose_keyframes(template, count=settings.n_keyframes)
    query = from_template(
        template, [choice.position for choice in chosen],
        stiffness=settings.stiffness, groups=[choice.group for choice in chosen],
    )  # fmt: skip
    return Committee((query,))


def by_choosing(lesson: Lesson, settings: ChoiceSettings | None = None) -> Committee:
    """Keyframes by examples and counter-examples."""
    settings = settings or ChoiceSettings()
    return Committee((choose_query(*lesson, settings=settings).query,))


def by_learning(lesson: Lesson, *, seed: int) -> Committee:
    """Learned queries that vote, with the settings of `learn_queries`."""
    learned = learn_from(lesson, GeneticSettings(), RUNS, seed=seed)
    return Committee(learned.queries, default_votes(RUNS))


def problem_of(lesson: Lesson, settings: GeneticSettings, *, seed: int) -> Problem:
    """What queries are learned from."""
    return state_problem(
        lesson.examples, lesson.counterexamples, settings=settings, seed=seed,
        template=lesson.template,
    )  # fmt: skip


def learn_from(
    lesson: Lesson, settings: GeneticSettings, runs: int, *, seed: int
) -> LearnedQueries:
    """Queries of so many runs."""
    problem = problem_of(lesson, settings, seed=seed)
    return LearnedQueries(problem, tuple(learn_runs(problem, range(runs))), votes=1)


def with_queries(
    classes: Sequence[MotionClass], committees: Mapping[str, Committee]
) -> tuple[MotionClass, ...]:
    """Classes with keyframes; mirror images get mirrored ones."""
    result = []
    for one in classes:
        queries, votes = committees[one.name]
        mirrored = tuple(mirror_query(query) for query in queries)
        prototypes = [
            replace(prototype, queries=mirrored if i else queries, votes=votes)
            for i, prototype in enumerate(one.prototypes)
        ]
        result.append(replace(one, prototypes=tuple(prototypes)))
    return tuple(result)


def index_of(sequences: Sequence[FeatureSequence]) -> PostingIndex:
    """Index of recordings."""
    first = sequences[0].feature_set
    return index_packed(
        [s.packed for s in sequences], [s.known for s in sequences],
        feature_set=first.name, feature_ids=first.ids,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Tested:
    """Clips in which classes are searched for."""

    sequences: tuple[FeatureSequence, ...]
    names: tuple[str, ...]
    index: PostingIndex

    @classmethod
    def of(cls, clips: Sequence[Clip]) -> "Tested":
        """Each of its class."""
        sequences = tuple(clip.packed for clip in clips)
        return cls(sequences, tuple(clip.motion_class for clip in clips), index_of(sequences))

    def relevant(self, name: str) -> NDArray[np.bool_]:
        """Which of them are of a class."""
        return np.array([other == name for other in self.names])


class Preselected(NamedTuple):
    """What a template finds around keyframes alone.

    Attributes
    ----------
    costs : array, shape (clips,), smallest cost within the windows, infinite without
    frames : fraction of all frames in the windows
    """

    costs: Floats
    frames: float


def least_costs(template: MotionTemplate, sequences: Sequence[FeatureSequence]) -> Floats:
    """Smallest cost of a template in each sequence."""
    if not sequences:
        return np.empty(0)
    corpus = corpus_of(sequences)
    pattern = pattern_of(quantise(template, tolerance=TOLERANCE_2006))
    parts = corpus.split(corpus_distance(pattern, corpus))
    return np.array([float(part.min(initial=np.inf)) for part in parts])


def preselect(template: MotionTemplate, committee: Committee, tested: Tested) -> Preselected:
    """Smallest cost of the template around the keyframes in each clip."""
    queries, votes = committee
    windows = select_in_index(queries, template.n_columns, tested.index, votes=votes)
    costs = np.full(len(tested.sequences), np.inf)
    parts = [tested.sequences[i].part(start, stop) for i, start, stop in windows]
    np.minimum.at(costs, windows.sequences, least_costs(template, parts))
    return Preselected(costs, windows.n_frames / tested.index.n_frames)


class Trial:
    """A class in clips that it was not learned from: its queries, and its template around them.

    Parameters
    ----------
    name, template : of the class
    tested : the clips
    """

    def __init__(self, name: str, template: MotionTemplate, tested: Tested) -> None:
        self._template, self._tested = template, tested
        self._relevant = tested.relevant(name)
        self._everywhere = least_costs(template, tested.sequences)

    def measure(self, committee: Committee) -> Measures:
        """Clips that enough queries find, and the template around their hits."""
        hits = np.zeros(len(self._relevant), dtype=np.intp)
        for query in committee.queries:
            hits[search_query(query, self._tested.index).hit_sequences] += 1
        precision, recall = self._rates(hits >= committee.votes)
        return {
            "f2": weighted_f(precision, recall, beta=2.0),
            "f1": weighted_f(precision, recall, beta=1.0),
            "precision": precision,
            "recall": recall,
        } | self._preselection(committee)

    def kept(self, committee: Committee, thresholds: Sequence[float]) -> Measures:
        """What keyframes leave, and what of the template's hits they keep, by threshold."""
        found = preselect(self._template, committee, self._tested)
        row: Measures = {"frames": found.frames}
        for threshold in thresholds:
            for key, costs in (("all", self._everywhere), ("kept", found.costs)):
                rates = compute_rates_at(costs, self._relevant, threshold=threshold)
                row[f"recall {key} {threshold}"] = rates.recall
                row[f"precision {key} {threshold}"] = rates.precision
                row[f"f {key} {threshold}"] = rates.f
        return row

    def _preselection(self, committee: Committee) -> Measures:
        """Frames left, recall lost at a low threshold, precision at a high one."""
        left = preselect(self._template, committee, self._tested)
        recall = self._rates(self._everywhere <= LOW)[1]
        return {
            "frames left": left.frames,
            "recall of the template": recall,
            "recall lost": recall - self._rates(left.costs <= LOW)[1],
            "precision of the template": self._rates(self._everywhere <= HIGH)[0],
            "precision left": self._rates(left.costs <= HIGH)[0],
        }

    def _rates(self, found: NDArray[np.bool_]) -> tuple[float, float]:
        """Precision and recall of what was found."""
        right = int(np.count_nonzero(found & self._relevant))
        return right / max(int(found.sum()), 1), right / int(self._relevant.sum())
