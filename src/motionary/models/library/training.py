"""Classes and their keyframe queries, learned from the packed features of examples.

Each prototype becomes a template of its own, after Müller and Röder (2006); classes share
the background of frames that tells which features rarely hold. Queries come from the examples
of a prototype against those of all other classes: several are learned by the genetic
algorithm and vote, or the keyframes of a single one are chosen. The template is then matched
around their hits only.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet, match_names
from motionary.matching import concatenate, feature_prior
from motionary.models.keyframes import (
    ChoiceSettings,
    KeyframeQuery,
    choose_query,
    columns_of_query,
    mirror_query,
    template_of_query,
)
from motionary.models.library.classes import THRESHOLD, MotionClass, Prototype, TrainingOptions
from motionary.models.library.editing import mirror_prototype
from motionary.models.library.examples import fold_sides
from motionary.models.library.scoring import Scoring, mix_prior, scoring_for
from motionary.models.library.storage import ClassLibrary
from motionary.models.query_learning import (
    RUNS,
    GeneticSettings,
    LearnedQueries,
    default_votes,
    learn_runs,
    state_problem,
)
from motionary.models.templates import Learning, MotionTemplate, learn_template
from motionary.packing import full_mask

#: Packed features of examples: class -> prototype -> examples.
Examples = Mapping[str, Mapping[str, Sequence[FeatureSequence]]]

_FREE = 0.5
#: What a single example shows by chance, a keyframe would ask of everybody.
_LEAST_EXAMPLES = 2
#: Keeps most of what templates find of those settings that leave at most 15 % of the frames:
#: docs/evidence/keyframe_choice.md, "Which settings".
_CHOOSING = ChoiceSettings(frames_left=0.05)
#: A prototype with queries: of itself, its examples, and counter-examples.
_Query = Callable[[Prototype, Sequence[FeatureSequence], Sequence[FeatureSequence]], Prototype]


def learn_classes(
    examples: Examples,
    *,
    training: TrainingOptions,
    scoring: Scoring | None = None,
    on_done: Callable[[], None] | None = None,
    on_refused: Callable[[str, InvalidInput], None] | None = None,
) -> ClassLibrary:
    """Library of templates learned from examples, with the thresholds of the options.

    Parameters
    ----------
    examples : class -> prototype -> packed features
    training : `learn` also calibrates thresholds and makes queries
    scoring : with the corpus that examples are told from; by default the one that comes
        with the package, if it is over these features
    on_done : called after each class
    on_refused : called with a class that cannot be learned and why, and the class is left
        out; without it the error is raised

    Raises
    ------
    InvalidInput
        If a class has no example, its examples have nothing in common, or examples are over
        different features.
    """
    classes = []
    background = measure_background(examples, training=training)
    feature_set = find_feature_set(examples)
    scoring = scoring or scoring_for(feature_set)
    prior = mix_prior(list_sequences(examples), scoring, mirror=training.mirror)
    for name, prototypes in examples.items():
        try:
            learned = learn_class(name, prototypes, background=background, training=training)
            learned = replace(learned, prior=prior)
        except InvalidInput as error:
            if on_refused is None:
                raise
            on_refused(name, error)
        else:
            classes.append(learned)
        if on_done:
            on_done()
    return ClassLibrary(
        tuple(classes), feature_set, training.provenance, training.licence, training, scoring
    )


def learn_class(
    name: str,
    examples: Mapping[str, Sequence[FeatureSequence]],
    *,
    background: tuple[float, ...],
    training: TrainingOptions,
    learning: Learning | None = None,
) -> MotionClass:
    """One class from the packed features of its examples, by prototype.

    Raises
    ------
    InvalidInput
        If a prototype has no example, or its examples have nothing in common.
    """
    keep = training.keep_examples
    learned: list[Prototype] = []
    for key, given in examples.items():
        items = fold_sides(given) if training.fold_sides else given
        learned.append(learn_prototype(key, items, learning=learning, keep_examples=keep))
        if training.per_group and training.groups:
            learned += learn_groups(key, items, name_groups(items, training.groups))
    if training.mirror:
        feature_set = next(iter(examples.values()))[0].feature_set
        learned += [mirror_prototype(prototype, feature_set) for prototype in learned]
    motion_class = MotionClass(
        name, tuple(learned), training.threshold, training.tolerance, background
    )
    # A template that would match everything is refused before it spoils a library.
    _ = motion_class.quantised
    return motion_class


def measure_background(examples: Examples, *, training: TrainingOptions) -> tuple[float, ...]:
    """Fraction of the examples' frames in which each feature holds; of mirror images, too.

    Empty if the options weigh all features alike.
    """
    sequences = list_sequences(examples)
    if not sequences or not training.by_self_information:
        return ()
    feature_set = find_feature_set(examples)
    packed, known = [s.packed for s in sequences], [s.known for s in sequences]
    corpus = concatenate(packed, known, full=full_mask(1, len(feature_set))[0])
    ones = feature_prior(corpus, len(feature_set))
    if training.mirror:
        ones = (ones + ones[feature_set.mirror_order]) / 2
    return tuple(round(float(fraction), 6) for fraction in np.clip(ones, 1e-6, 1 - 1e-6))


def learn_prototype(
    name: str,
    examples: Sequence[FeatureSequence],
    *,
    learning: Learning | None = None,
    keep_examples: bool = False,
) -> Prototype:
    """One template of a class, from the packed features of its examples.

    Raises
    ------
    InvalidInput
        If there is no example.
    """
    if not examples:
        raise InvalidInput(f"class {name!r} needs at least one example, got none")
    feature_set = examples[0].feature_set
    every = all(bool(e.known_features.all()) for e in examples)
    template = learn_template(
        [e.features for e in examples],
        known=None if every else [e.known_features.astype(np.bool_) for e in examples],
        feature_names=feature_set.ids,
        feature_set=feature_set.name,
        provenance=f"learned from {len(examples)} recording{'s' if len(examples) > 1 else ''}",
        learning=learning,
    )
    return Prototype(name, template, examples=tuple(examples) if keep_examples else ())


def learn_groups(
    name: str, examples: Sequence[FeatureSequence], groups: Sequence[str]
) -> list[Prototype]:
    """A template of each group of examples; none if all are of one group."""
    by_group: dict[str, list[FeatureSequence]] = {}
    for group, example in zip(groups, examples, strict=True):
        by_group.setdefault(group, []).append(example)
    if len(by_group) < 2:
        return []
    return [learn_prototype(f"{name}, {group}", own) for group, own in by_group.items()]


def name_groups(examples: Sequence[FeatureSequence], groups: str) -> list[str]:
    """Group of each example, as a regular expression finds it in the example's name.

    Raises
    ------
    InvalidInput
        If the expression is none, or matches nothing in a name.
    """
    return match_names([item.source for item in examples], groups, each="example", has="group")


def list_sequences(examples: Examples) -> list[FeatureSequence]:
    """All examples, class by class."""
    return [item for of_class in examples.values() for items in of_class.values() for item in items]


def find_feature_set(examples: Examples) -> FeatureSet:
    """The one feature set that all examples have.

    Raises
    ------
    InvalidInput
        If they have several.
    """
    sets = {item.feature_set.name: item.feature_set for item in list_sequences(examples)}
    if len(sets) > 1:
        raise InvalidInput(f"examples must share one feature set, got {', '.join(sorted(sets))}")
    return next(iter(sets.values()), FULL_BODY)


# -- queries ------------------------------------------------------------------------------


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
        others = {
            name: of_class for name, of_class in examples.items() if name != motion_class.name
        }
        negatives = list_sequences(others)
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
