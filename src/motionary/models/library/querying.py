"""How do the classes of a library get keyframe queries?

From the examples that the classes were learned from: those of a subclass against all of the
other classes. Several queries are bred that vote (`learn_queries`), or the keyframes of a single
one are chosen (`choose_queries`). The template is then matched around the hits only.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence, FeatureSet
from motionary.models.keyframes import ChoiceSettings, choose_query, mirror_query
from motionary.models.library.classes import ClassLibrary, Prototype
from motionary.models.library.examples import Examples
from motionary.models.query_learning import (
    RUNS,
    GeneticSettings,
    LearnedQueries,
    default_votes,
    learn_runs,
    state_problem,
)

#: What a single example shows by chance, a keyframe would ask of everybody.
_LEAST_EXAMPLES = 2
#: Keeps most of what templates find of those settings that leave at most 15 % of the frames:
#: docs/evidence/keyframe_choice.md, "Which settings".
_CHOOSING = ChoiceSettings(frames_left=0.05)
#: A subclass with queries: of itself, its examples, and counter-examples.
_Query = Callable[[Prototype, Sequence[FeatureSequence], Sequence[FeatureSequence]], Prototype]


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
    settings: GeneticSettings | None = None,
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
    settings, seed, runs, jobs : as in `learn_query`
    on_done : called after each class
    """
    query = partial(_breed, settings=settings, seed=seed, runs=runs, jobs=jobs)
    return _query_all(library, examples, query, on_done)


def choose_queries(
    library: ClassLibrary,
    examples: Examples,
    *,
    settings: ChoiceSettings = _CHOOSING,
    on_done: Callable[[], None] | None = None,
) -> QueriedLibrary:
    """The library with a query of chosen keyframes for every subclass in `examples`.

    A subclass that is the mirror image of another gets that one's query, mirrored. What
    chosen keyframes keep and leave: docs/evidence/keyframe_choice.md.

    Parameters
    ----------
    library : learned from the examples
    examples : class -> subclass -> words
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
            original = queried.get(name.removesuffix("Mirrored"))
            try:
                if not positives and original is not None:
                    queried[name] = _mirror(prototype, original, library.feature_set)
                else:
                    queried[name] = query(prototype, positives, negatives)
            except InvalidInput as error:
                queried[name], without[name] = prototype, str(error)
        classes.append(replace(motion_class, prototypes=tuple(queried.values())))
        if on_done:
            on_done()
    return QueriedLibrary(replace(library, classes=tuple(classes)), without)


def _breed(
    prototype: Prototype,
    positives: Sequence[FeatureSequence],
    negatives: Sequence[FeatureSequence],
    *,
    settings: GeneticSettings | None,
    seed: int,
    runs: int,
    jobs: int,
) -> Prototype:
    """The subclass with queries that tell its examples from others."""
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
    """The subclass with the query that finds its examples and leaves little of others."""
    if len(positives) < _LEAST_EXAMPLES:
        raise InvalidInput(
            f"choosing keyframes needs at least {_LEAST_EXAMPLES} examples, got {len(positives)}; "
            "give more, of different people if possible"
        )
    chosen = choose_query(prototype.template, positives, negatives, settings=settings)
    return replace(prototype, queries=(chosen.query,), votes=1)


def _mirror(prototype: Prototype, original: Prototype, feature_set: FeatureSet) -> Prototype:
    queries = tuple(mirror_query(query, feature_set) for query in original.queries)
    return replace(prototype, queries=queries, votes=original.votes)


def _of_others(examples: Examples, name: str) -> list[FeatureSequence]:
    return [
        clip
        for other, prototypes in examples.items()
        if other != name
        for clips in prototypes.values()
        for clip in clips
    ]
