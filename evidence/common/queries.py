"""Where do keyframes come from, and what do they keep of what a template finds?

The authors' queries by hand, the rule of thumb of 2006, `choose_query`, and learned ones.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.ranking import TOLERANCE_2006, corpus_of, templates_of
from evidence.common.recordings import Clip, Recordings
from motionary.features import FeatureSequence
from motionary.io import QueryRecord, read_query_collections
from motionary.matching import Pattern, corpus_distance
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
    select_in_index,
)
from motionary.models.library import MotionClass
from motionary.models.query_learning import (
    RUNS,
    LearnedQueries,
    default_votes,
    learn_runs,
    state_problem,
)
from motionary.models.templates import MotionTemplate, pattern_of, quantise

Floats = NDArray[np.float64]

#: Collections of the authors: Table 2 of 2008, and their annotation of 2009.
RETRIEVAL_2008, ANNOTATION_2009 = "retrieval_2008", "annotation_2009"


class Committee(NamedTuple):
    """Queries of a class, and how many of them must agree."""

    queries: tuple[KeyframeQuery, ...]
    votes: int = 1


@dataclass(frozen=True, slots=True)
class Heuristic:
    """Settings of the rule of thumb."""

    count: int
    stiffness: float


class Lesson(NamedTuple):
    """A class with what it is learned from.

    Attributes
    ----------
    template : of the examples
    examples, counterexamples : words of the class, and of all other classes
    """

    template: MotionTemplate
    examples: tuple[FeatureSequence, ...]
    counterexamples: tuple[FeatureSequence, ...]


def lessons_of(clips: Sequence[Clip]) -> dict[str, Lesson]:
    """Each class of some clips against all others."""
    return {
        name: Lesson(
            template,
            tuple(clip.packed for clip in clips if clip.motion_class == name),
            tuple(clip.packed for clip in clips if clip.motion_class != name),
        )
        for name, template in templates_of(clips).items()
    }


def manual_records(recordings: Recordings, collection: str) -> dict[str, QueryRecord]:
    """The authors' queries of a collection as they are written, by the class in print."""
    path = recordings.folder.resolve().parent / "reference" / "golden" / "manual_keyframes.json"
    return read_query_collections(path)[collection]


def manual(recordings: Recordings, collection: str) -> dict[str, KeyframeQuery]:
    """The authors' queries of a collection, by the name of the class in print."""
    return {
        name: query_of(record) for name, record in manual_records(recordings, collection).items()
    }


def query_of(record: QueryRecord, *, stiffness: float | None = None) -> KeyframeQuery:
    """Query of a record, with the stiffness of all gaps replaced if one is given."""
    told = record.stiffness if stiffness is None else (stiffness,) * len(record.stiffness)
    return from_patterns(
        record.keyframes, record.groups, distances=record.distances,
        stiffness=told, positions=record.positions,
    )  # fmt: skip


def by_heuristic(lesson: Lesson, settings: Heuristic) -> Committee:
    """Keyframes by the rule of thumb of 2006, each with its group's relations."""
    template = quantise(lesson.template, tolerance=TOLERANCE_2006)
    chosen = choose_keyframes(template, count=settings.count)
    query = from_template(
        template, [choice.position for choice in chosen],
        stiffness=settings.stiffness, groups=[choice.group for choice in chosen],
    )  # fmt: skip
    return Committee((query,))


def by_choosing(lesson: Lesson, settings: ChoiceSettings) -> Committee:
    """Keyframes by examples and counter-examples."""
    return Committee((choose_query(*lesson, settings=settings).query,))


def by_learning(lesson: Lesson, *, seed: int) -> Committee:
    """Bred queries that vote, with the settings of `learn_queries`."""
    problem = state_problem(
        lesson.examples, lesson.counterexamples, seed=seed, template=lesson.template
    )
    runs = tuple(learn_runs(problem, range(RUNS)))
    return Committee(LearnedQueries(problem, runs, votes=1).queries, default_votes(RUNS))


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
    """Index of recordings, a document each."""
    first = sequences[0].feature_set
    return index_packed(
        [s.packed for s in sequences], [s.known for s in sequences],
        feature_set=first.name, feature_ids=first.ids,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Tested:
    """Documents in which classes are sought."""

    sequences: tuple[FeatureSequence, ...]
    names: tuple[str, ...]
    index: PostingIndex

    @classmethod
    def of(cls, clips: Sequence[Clip]) -> "Tested":
        """Clips, each a document of its class."""
        sequences = tuple(clip.packed for clip in clips)
        return cls(sequences, tuple(clip.motion_class for clip in clips), index_of(sequences))


class Preselected(NamedTuple):
    """What a template finds around keyframes alone.

    Attributes
    ----------
    costs : array, shape (documents,), smallest cost within the windows, infinite without
    frames : share of all frames in the windows
    """

    costs: Floats
    frames: float


def plain_costs(lesson: Lesson, tested: Tested) -> Floats:
    """Smallest cost of the template in each document."""
    corpus = corpus_of(tested.sequences)
    distance = corpus_distance(_pattern(lesson), corpus)
    return np.array([float(part.min(initial=np.inf)) for part in corpus.split(distance)])


def preselect(lesson: Lesson, committee: Committee, tested: Tested) -> Preselected:
    """Smallest cost of the template around the keyframes in each document."""
    windows = select_in_index(
        committee.queries, lesson.template.n_columns, tested.index, votes=committee.votes
    )
    costs = np.full(len(tested.sequences), np.inf)
    if len(windows):
        corpus = corpus_of([tested.sequences[d].part(a, b) for d, a, b in windows])
        parts = corpus.split(corpus_distance(_pattern(lesson), corpus))
        least = np.array([float(part.min(initial=np.inf)) for part in parts])
        np.minimum.at(costs, windows.sequences, least)
    return Preselected(costs, windows.n_frames / tested.index.n_frames)


def _pattern(lesson: Lesson) -> Pattern:
    return pattern_of(quantise(lesson.template, tolerance=TOLERANCE_2006))
