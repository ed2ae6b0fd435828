"""How does a class learn from more examples, or two classes become one?

A class that keeps its examples is learned again from all of them, and becomes what it
would be had they been there from the start. Of one that does not, the template stands for
its examples, with their number as its weight.
"""

from collections.abc import Sequence
from dataclasses import replace

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.models.library.classes import ClassLibrary, MotionClass, Prototype
from motionary.models.library.editing import (
    find_prototype,
    remove_class,
    replace_class,
    replace_prototype,
)
from motionary.models.library.examples import Examples
from motionary.models.library.training import (
    MIRRORED,
    learn_prototype,
    measure_background,
    mirror_prototype,
)
from motionary.models.templates import join


def keeps_examples(prototype: Prototype) -> bool:
    """Whether a subclass keeps every example that it was learned from."""
    return len(prototype.examples) == prototype.template.n_examples


def kept_examples(library: ClassLibrary) -> Examples | None:
    """Words of everything that a library was learned from; None unless it keeps them all."""
    examples: dict[str, dict[str, Sequence[FeatureSequence]]] = {}
    for motion_class in library:
        for prototype in motion_class.prototypes:
            if _is_mirror(prototype, motion_class):
                continue
            if not keeps_examples(prototype):
                return None
            examples.setdefault(motion_class.name, {})[prototype.name] = prototype.examples
    return examples


def add_examples(
    library: ClassLibrary,
    name: str,
    examples: Sequence[FeatureSequence],
    *,
    prototype: str | None = None,
) -> ClassLibrary:
    """Library in which a class has learned from more examples.

    Equal to learning from all examples at once if all classes keep theirs. Otherwise a
    template without its examples is averaged with that of the new ones, and what weighs as
    rare stays as it was.

    The threshold stays; queries and promises were of the template before, and go. An example
    that the class keeps already is not counted again.

    Parameters
    ----------
    library : classes
    name : of the class that learns
    examples : words of the library's feature set
    subclass : which of the class's templates learns; needed if it is not clear

    Raises
    ------
    InvalidInput
        If there is no such class or subclass, or an example is over other features.
    """
    old = find_prototype(library[name], prototype)
    for example in examples:
        if example.feature_set.ids != library.feature_set.ids:
            raise InvalidInput(
                f"{example.source or 'an example'} is over {example.feature_set.name!r}, the "
                f"library over {library.feature_set.name!r}; compute it with the library's"
            )
    kept = {(e.packed.tobytes(), e.known.tobytes()) for e in old.examples}
    new = [e for e in examples if (e.packed.tobytes(), e.known.tobytes()) not in kept]
    if not new:
        return library
    return _weigh_again(replace_prototype(library, name, _learn_more(old, new)))


def join_classes(
    library: ClassLibrary, first: str, second: str, *, name: str | None = None
) -> ClassLibrary:
    """Library in which one class stands for two: what separates them becomes free.

    After Müller and Röder (2006), figure 5 (c). Learned from the examples of both if both
    keep theirs, else from the two templates. The threshold is the mean of both, by their
    examples.

    Parameters
    ----------
    library : classes
    first, second : names of classes with one template each, mirror images aside
    name : of the class that takes the place of the first; the first's by default

    Raises
    ------
    InvalidInput
        If there are no such classes, they are one, or one has several templates.
    """
    if first == second:
        raise InvalidInput(f"joining needs two classes, got {first!r} twice")
    classes = (library[first], library[second])
    one, other = (_only_prototype(c) for c in classes)
    called = first if name is None else name
    if keeps_examples(one) and keeps_examples(other):
        joined = _learn_and_keep(called, (*one.examples, *other.examples))
    else:
        joined = Prototype(called, join(one.template, other.template))
    numbers = [s.template.n_examples for s in (one, other)]
    threshold = sum(n * c.threshold for n, c in zip(numbers, classes, strict=True)) / sum(numbers)
    mirrored = [mirror_prototype(joined, library.feature_set)]
    changed = replace(
        classes[0],
        name=called,
        prototypes=(joined, *(mirrored if all(len(c.prototypes) > 1 for c in classes) else ())),
        threshold=round(threshold, 4),
        estimated_precision=None,
        estimated_recall=None,
    )
    changed.quantised()
    return replace_class(remove_class(library, second), first, changed)


def _learn_and_keep(name: str, examples: Sequence[FeatureSequence]) -> Prototype:
    return replace(learn_prototype(name, examples), examples=tuple(examples))


def _learn_more(old: Prototype, new: Sequence[FeatureSequence]) -> Prototype:
    if keeps_examples(old):
        return _learn_and_keep(old.name, (*old.examples, *new))
    joined = join(old.template, learn_prototype(old.name, new).template)
    origin = old.template.provenance or "a template"
    how = f"{origin}, then averaged with {len(new)} more"
    return Prototype(old.name, replace(joined, provenance=how))


def _weigh_again(library: ClassLibrary) -> ClassLibrary:
    """Library with the background of all examples, if all are kept and classes weigh by it."""
    examples = kept_examples(library)
    if examples is None or not all(c.background for c in library):
        return library
    mirrored = any(_is_mirror(s, c) for c in library for s in c.prototypes)
    background = measure_background(examples, library.feature_set, mirror=mirrored)
    return replace(library, classes=tuple(replace(c, background=background) for c in library))


def _is_mirror(prototype: Prototype, motion_class: MotionClass) -> bool:
    original = prototype.name.removesuffix(MIRRORED)
    return original != prototype.name and any(s.name == original for s in motion_class.prototypes)


def _only_prototype(motion_class: MotionClass) -> Prototype:
    originals = [s for s in motion_class.prototypes if not _is_mirror(s, motion_class)]
    if len(originals) > 1:
        names = ", ".join(repr(s.name) for s in originals)
        raise InvalidInput(
            f"class {motion_class.name!r} has several templates ({names}); join classes of one"
        )
    return originals[0]
