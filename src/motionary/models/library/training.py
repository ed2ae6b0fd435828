"""Classes learned from the packed features of their examples.

Each prototype becomes a template of its own, after Müller and Röder (2006); classes share
the background of frames that tells which features rarely hold.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet
from motionary.matching import concatenate, feature_prior
from motionary.models.keyframes import mirror_query
from motionary.models.library.classes import MotionClass, Prototype, TrainingOptions
from motionary.models.library.storage import ClassLibrary
from motionary.models.templates import Learning, learn_template
from motionary.models.templates import mirror as mirror_template
from motionary.packing import full_mask

#: Packed features of examples: class -> prototype -> examples.
Examples = Mapping[str, Mapping[str, Sequence[FeatureSequence]]]

# Follows the name of a template in that of its mirror image; nothing reads it.
_MIRRORED = "Mirrored"


def learn_classes(
    examples: Examples,
    *,
    training: TrainingOptions,
    on_done: Callable[[], None] | None = None,
    on_refused: Callable[[str, InvalidInput], None] | None = None,
) -> ClassLibrary:
    """Library of templates learned from examples, with the thresholds of the options.

    Parameters
    ----------
    examples : class -> prototype -> packed features
    training : `learn` also calibrates thresholds and makes queries
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
    for name, prototypes in examples.items():
        try:
            learned = learn_class(name, prototypes, background=background, training=training)
        except InvalidInput as error:
            if on_refused is None:
                raise
            on_refused(name, error)
        else:
            classes.append(learned)
        if on_done:
            on_done()
    feature_set = find_feature_set(examples)
    return ClassLibrary(
        tuple(classes), feature_set, training.provenance, training.licence, training
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
    learned = [
        learn_prototype(key, items, learning=learning, keep_examples=keep)
        for key, items in examples.items()
    ]
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
    sequences = [s for prototypes in examples.values() for i in prototypes.values() for s in i]
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


def mirror_prototype(
    original: Prototype, feature_set: FeatureSet, *, name: str | None = None
) -> Prototype:
    """The mirror image of a prototype, under a name of its own."""
    template = mirror_template(original.template, feature_set.mirror_order)
    queries = tuple(mirror_query(query, feature_set) for query in original.queries)
    called = original.name + _MIRRORED if name is None else name
    return Prototype(called, template, queries, original.votes, mirror_of=original.name)


def rename_prototype(prototypes: Sequence[Prototype], old: str, new: str) -> tuple[Prototype, ...]:
    """Prototypes of a class of which one, and its mirror image, have another name."""
    renamed = []
    for one in prototypes:
        if one.name == old:
            one = replace(one, name=new)
        elif one.mirror_of == old:
            called = new + _MIRRORED if one.name == old + _MIRRORED else one.name
            one = replace(one, name=called, mirror_of=new)
        renamed.append(one)
    return tuple(renamed)


def find_feature_set(examples: Examples) -> FeatureSet:
    """The one feature set that all examples have.

    Raises
    ------
    InvalidInput
        If they have several.
    """
    sets = {
        item.feature_set.name: item.feature_set
        for prototypes in examples.values()
        for items in prototypes.values()
        for item in items
    }
    if len(sets) > 1:
        raise InvalidInput(f"examples must share one feature set, got {', '.join(sorted(sets))}")
    return next(iter(sets.values()), FULL_BODY)
