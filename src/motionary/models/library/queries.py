"""Keyframe queries of the classes of a library, and classes of a keyframe query.

Queries come from the examples that the classes were learned from: those of a prototype against
all of the other classes. Several are learned by the genetic algorithm and vote
(`learn_queries`), or the keyframes of a single one are chosen (`choose_queries`). The template
is then matched around their hits only.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.models.keyframes import (
    ChoiceSettings,
    KeyframeQuery,
    choose_query,
    columns_of_query,
    mirror_query,
    template_of_query,
)
from motionary.models.library.classes import THRESHOLD, MotionClass, Prototype
from motionary.models.library.storage import ClassLibrary
from motionary.models.library.training import Examples
from motionary.models.query_learning import (
    RUNS,
    GeneticSettings,
    LearnedQueries,
    default_votes,
    learn_runs,
    state_problem,
)
from motionary.models.templates import MotionTemplate

_FREE = 0.5
#: What a single example shows by chance, a keyframe would ask of everybody.
_LEAST_EXAMPLES = 2
#: Keeps most of what templates find of those settings that leave at most 15 % of the frames:
#: docs/evidence/keyframe_choice.md, "Which settings".
_CHOOSING = ChoiceSettings(frames_left=0.05)
#: A prototype with queries: of itself, its examples, and counter-examples.
_Query = Callable[[Prototype, Sequence[FeatureSequence], Sequence[FeatureSequence]], Prototype]


class QueriedLibrary(NamedTuple):
    """A library with queries, and why some classes have none.

    Attributes
    ----------
    library : its classes with queries where they could be learned
    without : reason by the name of the prototype
    """

    library: ClassLibrary
    without: dict[str, str]


def learn_queries(
    library: ClassLibrary,
    examples: Examples,
    *,
    settings: GeneticSettings | None = None,
    seed: int = 0,
    runs: int = RUNS,
    jobs: int = 1,
    on_done: Callable[[], None] | None = None,
) -> QueriedLibrary:
    """The library with queries for every prototype that `examples` holds.

    A prototype that is the mirror image of another gets that one's queries, mirrored.

    Parameters
    ----------
    library : learned from the examples
    examples : class -> prototype -> packed features
    settings, seed, runs, jobs : as in `learn_query`
    on_done : called after each class
    """
    query = partial(_learn, settings=settings, seed=seed, runs=runs, jobs=jobs)
    return _query_all(library, examples, query, on_done)


def choose_queries(
    library: ClassLibrary,
    examples: Examples,
    *,
    settings: ChoiceSettings = _CHOOSING,
    on_done: Callable[[], None] | None = None,
) -> QueriedLibrary:
    """The library with a query of chosen keyframes for every prototype in `examples`.

    A prototype that is the mirror image of another gets that one's query, mirrored. What
    chosen keyframes keep and leave: docs/evidence/keyframe_choice.md.

    Parameters
    ----------
    library : learned from the examples
    examples : class -> prototype -> packed features
    settings : as in `choose_query`; by default 5 % of the counter-examples may be left
    on_done : called after each class
    """
    return _query_all(library, examples, partial(_choose, settings=settings), on_done)


def _query_all(
    library: ClassLibrary,
    examples: Examples,
    query: _Query,
    on_done: Callable[[], None] | None,
) -> QueriedLibrary:
    classes, without = [], {}
    for motion_class in library:
        negatives = _of_others(examples, motion_class.name)
        queried: dict[str, Prototype] = {}
        for prototype in motion_class.prototypes:
            name = prototype.name
            positives = examples.get(motion_class.name, {}).get(name, ())
            try:
                if prototype.mirror_of in queried:
                    original = queried[prototype.mirror_of]
                    mirrored = tuple(mirror_query(q, library.feature_set) for q in original.queries)
                    queried[name] = replace(prototype, queries=mirrored, votes=original.votes)
                else:
                    queried[name] = query(prototype, positives, negatives)
            except InvalidInput as error:
                queried[name], without[name] = prototype, str(error)
        classes.append(replace(motion_class, prototypes=tuple(queried.values())))
        if on_done:
            on_done()
    return QueriedLibrary(replace(library, classes=tuple(classes)), without)


def _learn(
    prototype: Prototype,
    positives: Sequence[FeatureSequence],
    negatives: Sequence[FeatureSequence],
    *,
    settings: GeneticSettings | None,
    seed: int,
    runs: int,
    jobs: int,
) -> Prototype:
    """The prototype with queries that tell its examples from others."""
    problem = state_problem(
        positives, negatives, settings=settings, seed=seed, template=prototype.template
    )
    done = tuple(learn_runs(problem, range(runs), jobs=jobs))
    learned = LearnedQueries(problem, done, votes=default_votes(runs))
    return replace(prototype, queries=learned.queries, votes=learned.votes)


def _choose(
    prototype: Prototype,
    positives: Sequence[FeatureSequence],
    negatives: Sequence[FeatureSequence],
    *,
    settings: ChoiceSettings,
) -> Prototype:
    """The prototype with the query that finds its examples and leaves little of others."""
    if len(positives) < _LEAST_EXAMPLES:
        raise InvalidInput(
            f"choosing keyframes needs at least {_LEAST_EXAMPLES} examples, got {len(positives)}; "
            "give more, of different people if possible"
        )
    chosen = choose_query(prototype.template, positives, negatives, settings=settings)
    return replace(prototype, queries=(chosen.query,), votes=1)


def _of_others(examples: Examples, name: str) -> list[FeatureSequence]:
    return [
        clip
        for other, prototypes in examples.items()
        if other != name
        for clips in prototypes.values()
        for clip in clips
    ]


def class_of_query(name: str, query: KeyframeQuery, *, threshold: float = THRESHOLD) -> MotionClass:
    """Class that is shown wherever a query has a hit.

    Its template has the keyframes as columns and is free in between, so that within the
    windows around their hits it costs nothing where they keep their distances, up to half
    and twice the tempo.

    Parameters
    ----------
    name : of the class
    query : its keyframes
    threshold : largest cost of a match

    Raises
    ------
    InvalidInput
        If keyframes of one frame contradict each other, or the name is empty.
    """
    quantised = template_of_query(query)
    template = MotionTemplate(
        np.where(quantised.fixed, quantised.values, _FREE),
        quantised.weights,
        quantised.feature_names,
        quantised.feature_set,
        provenance="keyframes",
    )
    placed = KeyframeQuery(
        query.values, query.fixed, query.gaps, query.feature_set, query.feature_ids,
        tuple(columns_of_query(query)),
    )  # fmt: skip
    return MotionClass(name, (Prototype(name, template, (placed,)),), threshold)
