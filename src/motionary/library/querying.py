"""How do the classes of a library get keyframe queries?

Bred from the examples that the classes were learned from: those of a subclass against all
of the other classes. The template is then matched around the hits only.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence, FeatureSet
from motionary.keyframes import mirror_query
from motionary.library.classes import ClassLibrary, Subclass
from motionary.library.examples import Examples
from motionary.query_learning import (
    RUNS,
    Breeding,
    LearnedQueries,
    breed_runs,
    default_votes,
    state_problem,
)


class QueriedLibrary(NamedTuple):
    """A library with queries, and why some classes have none.

    Attributes
    ----------
    library : its classes with queries where they could be learned
    without : reason by the name of the subclass
    """

    library: ClassLibrary
    without: dict[str, str]


def learn_queries(
    library: ClassLibrary,
    examples: Examples,
    *,
    breeding: Breeding | None = None,
    seed: int = 0,
    runs: int = RUNS,
    jobs: int = 1,
    on_done: Callable[[], None] | None = None,
) -> QueriedLibrary:
    """The library with queries for every subclass that `examples` holds.

    A subclass that is the mirror image of another gets that one's queries, mirrored.

    Parameters
    ----------
    library : learned from the examples
    examples : class -> subclass -> words
    breeding, seed, runs, jobs : as in `learn_query`
    on_done : called after each class
    """
    classes, without = [], {}
    breed = partial(_breed, breeding=breeding, seed=seed, runs=runs, jobs=jobs)
    for motion_class in library:
        negatives = _of_others(examples, motion_class.name)
        learned: dict[str, Subclass] = {}
        for subclass in motion_class.subclasses:
            name = subclass.name
            positives = examples.get(motion_class.name, {}).get(name, ())
            original = learned.get(name.removesuffix("Mirrored"))
            try:
                if not positives and original is not None:
                    learned[name] = _mirror(subclass, original, library.feature_set)
                else:
                    learned[name] = breed(subclass, positives, negatives)
            except InvalidInput as error:
                learned[name], without[name] = subclass, str(error)
        classes.append(replace(motion_class, subclasses=tuple(learned.values())))
        if on_done:
            on_done()
    return QueriedLibrary(replace(library, classes=tuple(classes)), without)


def _breed(
    subclass: Subclass,
    positives: Sequence[FeatureSequence],
    negatives: Sequence[FeatureSequence],
    *,
    breeding: Breeding | None,
    seed: int,
    runs: int,
    jobs: int,
) -> Subclass:
    """The subclass with queries that tell its examples from others."""
    problem = state_problem(
        positives, negatives, breeding=breeding, seed=seed, template=subclass.template
    )
    done = tuple(breed_runs(problem, range(runs), jobs=jobs))
    learned = LearnedQueries(problem, done, votes=default_votes(runs))
    return replace(subclass, queries=learned.queries, votes=learned.votes)


def _mirror(subclass: Subclass, original: Subclass, feature_set: FeatureSet) -> Subclass:
    queries = tuple(mirror_query(query, feature_set) for query in original.queries)
    return replace(subclass, queries=queries, votes=original.votes)


def _of_others(examples: Examples, name: str) -> list[FeatureSequence]:
    return [
        clip
        for other, subclasses in examples.items()
        if other != name
        for clips in subclasses.values()
        for clip in clips
    ]
