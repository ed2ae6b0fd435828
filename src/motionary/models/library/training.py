"""Classes, their keyframe queries, and folds, from the packed features of examples.

Each prototype becomes a template of its own, after Müller and Röder (2006); classes share
the background of frames that tells which features rarely hold. Queries come from the examples
of a prototype against those of all other classes: several are learned by the genetic
algorithm and vote, or the keyframes of a single one are chosen. The template is then matched
around their hits only.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet, match_names
from motionary.models.keyframes import ChoiceSettings, choose_query, mirror_query
from motionary.models.library.classes import MotionClass, Prototype, TrainingOptions
from motionary.models.library.editing import mirror_prototype
from motionary.models.library.examples import fold_sides
from motionary.models.library.scoring import (
    Scoring,
    as_prior,
    measure_fractions,
    mix_prior,
    scoring_for,
)
from motionary.models.library.storage import ClassLibrary
from motionary.models.query_learning import RUNS, GeneticSettings, learn_query
from motionary.models.templates import Learning, template_of

#: Packed features of examples: class -> prototype -> examples.
Examples = Mapping[str, Mapping[str, Sequence[FeatureSequence]]]

#: Groups, or examples without groups, are dealt into so many folds at most.
N_FOLDS = 5

#: What a single example shows by chance, a keyframe would ask of everybody.
_LEAST_EXAMPLES = 2
#: Keeps most of what templates find of those settings that leave at most 15 % of the frames:
#: docs/evidence/keyframe_choice.md, "Which settings".
_CHOOSING = ChoiceSettings(frames_left=0.05)
#: A prototype with queries, of itself, its examples, and counter-examples.
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
            classes.append(replace(learned, prior=prior))
        except InvalidInput as error:
            if on_refused is None:
                raise
            on_refused(name, error)
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

    Raises InvalidInput if a prototype has no example, or its examples have nothing in common.
    """
    keep = training.keep_examples
    learned: list[Prototype] = []
    for key, given in examples.items():
        items = fold_sides(given) if training.fold_sides else given
        learned.append(learn_prototype(key, items, learning=learning, keep_examples=keep))
        if training.per_group and training.groups:
            own: dict[str, list[FeatureSequence]] = {}
            for group, item in zip(name_groups(items, training.groups), items, strict=True):
                own.setdefault(group, []).append(item)
            if len(own) > 1:
                learned += [learn_prototype(f"{key}, {x}", of_x) for x, of_x in own.items()]
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
    fractions = measure_fractions(sequences, feature_set)
    return as_prior(fractions, feature_set, mirror=training.mirror)


def learn_prototype(
    name: str,
    examples: Sequence[FeatureSequence],
    *,
    learning: Learning | None = None,
    keep_examples: bool = False,
) -> Prototype:
    """One template of a class, from the packed features of its examples, at least one."""
    if not examples:
        raise InvalidInput(f"class {name!r} needs at least one example, got none")
    origin = f"learned from {len(examples)} recording{'s' if len(examples) > 1 else ''}"
    template = template_of(examples, provenance=origin, learning=learning)
    return Prototype(name, template, examples=tuple(examples) if keep_examples else ())


def list_sequences(examples: Examples) -> list[FeatureSequence]:
    """All examples, class by class."""
    return [item for of_class in examples.values() for items in of_class.values() for item in items]


def find_feature_set(examples: Examples) -> FeatureSet:
    """The one feature set that all examples have; several are refused."""
    sets = {item.feature_set.name: item.feature_set for item in list_sequences(examples)}
    if len(sets) > 1:
        raise InvalidInput(f"examples must share one feature set, got {', '.join(sorted(sets))}")
    return next(iter(sets.values()), FULL_BODY)


# -- folds ------------------------------------------------------------------------------


class Fold(NamedTuple):
    """Examples to learn from, and others, by class, to try what was learned."""

    learned: Examples
    held_out: Sequence[tuple[str, FeatureSequence]]


def make_folds(examples: Examples, *, groups: str | None, seed: int) -> list[Fold]:
    """Folds in which every example is held out once, but for lone ones of a prototype.

    Examples of one group are held out together; of one fold nothing can be learned, so there
    are at least two, or none.

    Raises
    ------
    InvalidInput
        If `groups` is no expression, matches some example nowhere, or puts all into one group.
    """
    items = [
        (name, prototype, item)
        for name, prototypes in examples.items()
        for prototype, of_prototype in prototypes.items()
        for item in of_prototype
    ]
    rng = np.random.default_rng(seed)
    keys = _find_groups([item for *_, item in items], groups)
    fold_of: list[int | None] = []
    if keys:
        names = sorted(set(keys))
        dealt = enumerate(rng.permutation(len(names)))
        parts = {names[k]: place % N_FOLDS for place, k in dealt}
        fold_of += [parts[key] for key in keys]
    else:
        fold_of = _deal(items, rng)
    folds = []
    for fold in range(N_FOLDS):
        learned: dict[str, dict[str, list[FeatureSequence]]] = {}
        held_out = []
        for (name, prototype, item), own in zip(items, fold_of, strict=True):
            if own == fold:
                held_out.append((name, item))
            else:
                learned.setdefault(name, {}).setdefault(prototype, []).append(item)
        # What was not learned is not to be found.
        folds.append(Fold(learned, [held for held in held_out if held[0] in learned]))
    return [one for one in folds if one.held_out]


def _find_groups(examples: Sequence[FeatureSequence], groups: str | None) -> list[str]:
    """Group of each example, by its name or its person; none where people are not known."""
    if not groups:
        people = [item.recording.person for item in examples]
        return people if all(people) and len(set(people)) > 1 else []
    keys = name_groups(examples, groups)
    if len(set(keys)) == 1:
        raise InvalidInput(
            f"groups {groups!r} puts all examples into one group, {keys[0]!r}, and none can be "
            "held out; write an expression that tells them apart, or leave it out"
        )
    return keys


def _deal(
    items: Sequence[tuple[str, str, FeatureSequence]], rng: np.random.Generator
) -> list[int | None]:
    """Folds of examples, those of each prototype spread evenly; a lone one is in none."""
    places: dict[tuple[str, str], list[int]] = {}
    for i, (name, prototype, _) in enumerate(items):
        places.setdefault((name, prototype), []).append(i)
    fold_of: list[int | None] = [None] * len(items)
    dealt = [i for own in places.values() if len(own) > 1 for i in rng.permutation(own)]
    for n, i in enumerate(dealt):
        fold_of[i] = n % N_FOLDS
    return fold_of


def name_groups(examples: Sequence[FeatureSequence], groups: str) -> list[str]:
    """Group of each example, as a regular expression finds it in the example's name."""
    return match_names([item.source for item in examples], groups, each="example", has="group")


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
    settings, seed, runs, jobs : as in `learn_query`
    on_done : called after each class
    """

    def learn(
        prototype: Prototype, own: Sequence[FeatureSequence], others: Sequence[FeatureSequence]
    ) -> Prototype:
        learned = learn_query(
            own, others, settings=settings, seed=seed, template=prototype.template,
            runs=runs, jobs=jobs,
        )  # fmt: skip
        return replace(prototype, queries=learned.queries, votes=learned.votes)

    return _query_all(library, examples, learn, on_done)


def choose_queries(
    library: ClassLibrary,
    examples: Examples,
    *,
    settings: ChoiceSettings = _CHOOSING,
    on_done: Callable[[], None] | None = None,
) -> QueriedLibrary:
    """The library with a query of chosen keyframes for every prototype in `examples`.

    Mirror images and `on_done` as in `learn_queries`; `settings` as in `choose_query`, by
    default 5 % of the counter-examples may be left. What chosen keyframes keep and leave:
    docs/evidence/keyframe_choice.md.
    """

    def choose(
        prototype: Prototype, own: Sequence[FeatureSequence], others: Sequence[FeatureSequence]
    ) -> Prototype:
        if len(own) < _LEAST_EXAMPLES:
            raise InvalidInput(
                f"choosing keyframes needs at least {_LEAST_EXAMPLES} examples, got {len(own)}; "
                "give more, of different people if possible"
            )
        chosen = choose_query(prototype.template, own, others, settings=settings)
        return replace(prototype, queries=(chosen.query,), votes=1)

    return _query_all(library, examples, choose, on_done)


def _query_all(
    library: ClassLibrary,
    examples: Examples,
    query: _Query,
    on_done: Callable[[], None] | None,
) -> QueriedLibrary:
    classes, without = [], {}
    for motion_class in library:
        negatives = list_sequences({n: x for n, x in examples.items() if n != motion_class.name})
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
