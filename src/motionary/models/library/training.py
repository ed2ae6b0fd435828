"""How are classes learned from the words of their examples?

Each subclass becomes a template of its own, after Müller and Röder (2006); classes share
the background of frames that tells which relations are rare.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence, FeatureSet
from motionary.matching import concatenate, feature_prior
from motionary.models.keyframes import mirror_query
from motionary.models.library.classes import (
    THRESHOLD,
    TOLERANCE,
    ClassLibrary,
    MotionClass,
    Prototype,
)
from motionary.models.library.examples import Examples, find_feature_set
from motionary.models.templates import Learning, learn_template
from motionary.models.templates import mirror as mirror_template
from motionary.packing import full_mask

#: Ends the name of a subclass that is the mirror image of another.
MIRRORED = "Mirrored"


@dataclass(frozen=True, slots=True)
class TrainingOptions:
    """Settings of learned classes.

    Attributes
    ----------
    threshold, tolerance : of the classes; defaults of the publications of 2006 and 2009
    mirror : also learn the mirror image of every template, as a subclass
    by_surprise : whether relations that are rare among the examples weigh more; False
        weighs all alike, as published
    keep_examples : keep the examples' words in the library, so that its classes can learn
        from more later as if from all at once
    provenance, licence : written into the library
    """

    threshold: float = THRESHOLD
    tolerance: float = TOLERANCE
    mirror: bool = False
    by_self_information: bool = True
    keep_examples: bool = False
    provenance: str = ""
    licence: str = ""


def learn_classes(
    examples: Examples,
    *,
    training: TrainingOptions,
    on_done: Callable[[], None] | None = None,
    on_refused: Callable[[str, InvalidInput], None] | None = None,
) -> ClassLibrary:
    """Library learned from words: class -> subclass -> examples.

    Parameters
    ----------
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
    feature_set = find_feature_set(examples)
    background: tuple[float, ...] = ()
    if training.by_self_information:
        background = measure_background(examples, feature_set, mirror=training.mirror)
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
    return ClassLibrary(tuple(classes), feature_set, training.provenance, training.licence)


def learn_class(
    name: str,
    examples: Mapping[str, Sequence[FeatureSequence]],
    *,
    background: tuple[float, ...],
    training: TrainingOptions,
    learning: Learning | None = None,
) -> MotionClass:
    """One class from the words of its examples, by subclass.

    Raises
    ------
    InvalidInput
        If a subclass has no example, or its examples have nothing in common.
    """
    learned = []
    for key, items in examples.items():
        prototype = learn_prototype(key, items, learning=learning)
        learned.append(
            replace(prototype, examples=tuple(items)) if training.keep_examples else prototype
        )
    if training.mirror:
        first = next(iter(examples.values()))[0]
        learned += [mirror_prototype(prototype, first.feature_set) for prototype in learned]
    motion_class = MotionClass(
        name, tuple(learned), training.threshold, training.tolerance, background
    )
    # A template that would match everything is refused before it spoils a library.
    motion_class.quantised()
    return motion_class


def measure_background(
    examples: Examples, feature_set: FeatureSet, *, mirror: bool
) -> tuple[float, ...]:
    """Share of the examples' frames in which each relation holds; of mirror images, too."""
    sequences = [s for prototypes in examples.values() for i in prototypes.values() for s in i]
    if not sequences:
        return ()
    packed, known = [s.packed for s in sequences], [s.known for s in sequences]
    corpus = concatenate(packed, known, full=full_mask(1, len(feature_set))[0])
    ones = feature_prior(corpus, len(feature_set))
    if mirror:
        ones = (ones + ones[feature_set.mirror_order]) / 2
    return tuple(round(float(fraction), 6) for fraction in np.clip(ones, 1e-6, 1 - 1e-6))


def learn_prototype(
    name: str, examples: Sequence[FeatureSequence], *, learning: Learning | None = None
) -> Prototype:
    """One template of a class, from the words of its examples.

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
    return Prototype(name, template)


def mirror_prototype(prototype: Prototype, feature_set: FeatureSet) -> Prototype:
    """The mirror image of a subclass, under its name with "Mirrored"."""
    template = mirror_template(prototype.template, feature_set.mirror_order)
    queries = tuple(mirror_query(query, feature_set) for query in prototype.queries)
    return Prototype(prototype.name + MIRRORED, template, queries, prototype.votes)
