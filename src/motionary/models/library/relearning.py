"""Classes that learn further, and changes by hand that need what a class was learned from.

A class that keeps its examples is learned again from all of them, and becomes what it would
be had they been there from the start. Of one that does not, the template stands for its
examples, with their number as its weight.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import NamedTuple

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.models.library.classes import MotionClass, Prototype, TrainingOptions
from motionary.models.library.editing import (
    find_prototype,
    mirror_prototype,
    remove_class,
    rename_class,
    replace_class,
    replace_prototype,
    replace_template,
    without_estimates,
)
from motionary.models.library.examples import fold_sides
from motionary.models.library.learning import Monitor, Notice, StrictMonitor, calibrate
from motionary.models.library.scoring import mix_prior
from motionary.models.library.storage import ClassLibrary
from motionary.models.library.training import (
    Examples,
    learn_class,
    learn_prototype,
    list_sequences,
    measure_background,
)
from motionary.models.templates import join, restrict, revise_template, template_from_text


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassEdit:
    """What becomes of a class; done in the order of the attributes.

    Attributes
    ----------
    remove : take it out of the library; nothing else is done then
    join : name of another class; one class stands for both
    text : what the template asks for, as `template_to_text` writes it
    new : make the class from the text
    restrict : features that the template asks for; all others become free
    threshold : largest cost of a match
    rename : another name
    template : name of the prototype that is meant, of a class of several
    """

    remove: bool = False
    join: str | None = None
    text: str | None = None
    new: bool = False
    restrict: Sequence[str] = ()
    threshold: float | None = None
    rename: str | None = None
    template: str | None = None


class EditedLibrary(NamedTuple):
    """A library with a changed class.

    Attributes
    ----------
    library : new
    name : of the class, which may be gone
    lost_queries : whether the class had keyframe queries, and has none any more
    """

    library: ClassLibrary
    name: str
    lost_queries: bool = False


def edit_class(
    library: ClassLibrary,
    name: str,
    edit: ClassEdit,
    *,
    jobs: int = 1,
    monitor: Monitor | None = None,
) -> EditedLibrary:
    """Library with one class changed by hand.

    A joined class whose threshold was calibrated is calibrated again, if all examples are
    kept and no threshold is given.

    Raises
    ------
    InvalidInput
        If there is no such class or template, or what is asked for cannot be done.
    """
    if edit.remove:
        return EditedLibrary(remove_class(library, name), name)
    changed = library if edit.join is None else join_classes(library, name, edit.join)
    if edit.text is not None:
        changed = _take_text(changed, name, edit)
    if edit.restrict:
        template = find_prototype(changed[name], edit.template).template
        template = restrict(template, edit.restrict, feature_set=library.feature_set)
        changed = replace_template(changed, name, template, prototype=edit.template)
    if edit.threshold is not None:
        # The estimates were of another threshold.
        of_class = without_estimates(changed[name], threshold=edit.threshold)
        changed = replace_class(changed, name, of_class)
    called = name
    if edit.rename is not None:
        called, changed = edit.rename, rename_class(changed, name, edit.rename)
    if edit.join is not None and edit.threshold is None and _is_calibrated(library[name]):
        changed = _calibrate_again(changed, [called], jobs=jobs, monitor=monitor)
    had = name in library.names and library[name].has_queries
    return EditedLibrary(changed, called, had and not changed[called].has_queries)


def add_examples(
    library: ClassLibrary,
    name: str,
    examples: Sequence[FeatureSequence],
    *,
    prototype: str | None = None,
    jobs: int = 1,
    monitor: Monitor | None = None,
) -> ClassLibrary:
    """Library in which a class has learned from more examples.

    Equal to learning from all examples at once if all classes keep theirs; thresholds that
    were calibrated are calibrated again then. Otherwise a template without its examples is
    averaged with that of the new ones, and thresholds and weights of features stay.

    Queries and estimates were of the template before, and go. An example that the class
    keeps already is not counted again; without a new one the library itself comes back.

    Parameters
    ----------
    examples : packed features of the library's feature set
    prototype : which of the class's templates learns; needed if it is not clear
    jobs, monitor : processes; told what happens

    Raises
    ------
    InvalidInput
        If there is no such class or prototype, or an example is over other features.
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
    folds = library.training is not None and library.training.fold_sides
    learned = _learn_more(old, new, fold=folds)
    expanded = _weigh_again(replace_prototype(library, name, learned))
    if kept_examples(expanded) is None:
        if monitor is not None:
            monitor.notify(Notice(
                "the examples that the class was learned from were not kept (learn "
                "--keep-examples): its template stands for them, and its threshold stays"
            ))  # fmt: skip
        return expanded
    calibrated = [one.name for one in library if _is_calibrated(one)]
    return _calibrate_again(expanded, calibrated, jobs=jobs, monitor=monitor)


def learn_beside(
    library: ClassLibrary,
    examples: Examples,
    *,
    jobs: int = 1,
    monitor: Monitor | None = None,
) -> ClassLibrary:
    """Library in which classes have learned from examples of others, and remember how they do it.

    A prototype learns from its examples as in `add_examples`; two or more of them also make a
    prototype beside it, since people do the same in ways of their own. Names that are not in the
    library become classes.

    Parameters
    ----------
    examples : class -> prototype that learns -> packed features, on the prototype's side
    jobs, monitor : as in `add_examples`

    Raises
    ------
    InvalidInput
        If there is no such prototype, or examples of a new class have nothing in common.
    """
    training = training_of(library) or TrainingOptions()
    calibrated = [one.name for one in library if _is_calibrated(one)]
    for name, prototypes in examples.items():
        if name not in library.names:
            background = library.classes[0].background if len(library) else ()
            made = learn_class(name, prototypes, background=background, training=training)
            prior = library.classes[0].prior if len(library) else ()
            library = replace(library, classes=(*library.classes, replace(made, prior=prior)))
            continue
        for prototype, items in prototypes.items():
            old = find_prototype(library[name], prototype)
            library = replace_prototype(library, name, _learn_more(old, items, fold=False))
            if len(items) > 1:
                library = _add_prototype(library, name, prototype, items)
    return _calibrate_again(_weigh_again(library), calibrated, jobs=jobs, monitor=monitor)


def _add_prototype(
    library: ClassLibrary, name: str, beside: str, items: Sequence[FeatureSequence]
) -> ClassLibrary:
    """Library in which a class has a further prototype, and its mirror image as the others do."""
    motion_class = library[name]
    taken = {one.name for one in motion_class.prototypes}
    called = next(f"{beside} {n}" for n in count(2) if f"{beside} {n}" not in taken)
    added = [learn_prototype(called, items)]
    if any(one.mirror_of == beside for one in motion_class.prototypes):
        added.append(mirror_prototype(added[0], library.feature_set))
    prototypes = (*motion_class.prototypes, *added)
    return replace_class(library, name, without_estimates(motion_class, prototypes=prototypes))


def join_classes(
    library: ClassLibrary, first: str, second: str, *, name: str | None = None
) -> ClassLibrary:
    """Library in which one class stands for two: what separates them becomes free.

    After Müller and Röder (2006), figure 5 (c). Learned from the examples of both if both
    keep theirs, else from the two templates. The threshold is the mean of both, by their
    examples. The class takes the place of the first, and its name unless one is given.

    Raises
    ------
    InvalidInput
        If there are no such classes, they are one, or one has several templates, mirror
        images aside.
    """
    if first == second:
        raise InvalidInput(f"joining needs two classes, got {first!r} twice")
    classes = (library[first], library[second])
    one, other = map(_only_prototype, classes)
    called = first if name is None else name
    if one.keeps_examples and other.keeps_examples:
        joined = learn_prototype(called, (*one.examples, *other.examples), keep_examples=True)
    else:
        joined = Prototype(called, join(one.template, other.template))
    numbers = [s.template.n_examples for s in (one, other)]
    threshold = sum(n * c.threshold for n, c in zip(numbers, classes, strict=True)) / sum(numbers)
    both_mirrored = all(len(c.originals) < len(c.prototypes) for c in classes)
    images = [mirror_prototype(joined, library.feature_set)] if both_mirrored else []
    changed = without_estimates(
        classes[0], name=called, prototypes=(joined, *images), threshold=round(threshold, 4)
    )
    _ = changed.quantised
    return replace_class(remove_class(library, second), first, changed)


def kept_examples(library: ClassLibrary) -> Examples | None:
    """Packed features of everything a library was learned from; None unless it keeps all."""
    if not all(one.keeps_examples for c in library for one in c.originals):
        return None
    return {c.name: {one.name: one.examples for one in c.originals} for c in library}


def training_of(library: ClassLibrary) -> TrainingOptions | None:
    """Options that a library was trained with, as it remembers them.

    Of a library from before they were remembered, what all of its classes show; None if
    they do not agree.
    """
    if library.training is not None or not len(library):
        return library.training
    tolerances = {one.tolerance for one in library}
    weighted = {bool(one.background) for one in library}
    mirrored = {len(one.originals) < len(one.prototypes) for one in library}
    if len(tolerances) > 1 or len(weighted) > 1 or len(mirrored) > 1:
        return None
    return TrainingOptions(
        tolerance=tolerances.pop(),
        mirror=mirrored.pop(),
        by_self_information=weighted.pop(),
        keep_examples=kept_examples(library) is not None,
        calibrate=any(_is_calibrated(one) for one in library),
        provenance=library.provenance,
        licence=library.licence,
    )


def _take_text(library: ClassLibrary, name: str, edit: ClassEdit) -> ClassLibrary:
    text, feature_set = str(edit.text), library.feature_set
    if edit.new:
        if name in library.names:
            raise InvalidInput(f"the library has a class {name!r} already; leave out --new")
        template = template_from_text(text, feature_set=feature_set, name=name)
        prior = next((one.prior for one in library if one.prior), ())
        added = MotionClass(name, (Prototype(name, template),), prior=prior)
        _ = added.quantised
        return replace(library, classes=(*library.classes, added))
    if name not in library.names:
        known = ", ".join(library.names) or "none"
        raise InvalidInput(f"no class {name!r} there ({known}); --new makes it from the text")
    revised = revise_template(
        find_prototype(library[name], edit.template).template,
        text,
        tolerance=library[name].tolerance,
        feature_set=feature_set,
    )
    return replace_template(library, name, revised, prototype=edit.template)


def _learn_more(old: Prototype, new: Sequence[FeatureSequence], *, fold: bool) -> Prototype:
    if old.keeps_examples:
        every = (*old.examples, *new)
        return learn_prototype(old.name, fold_sides(every) if fold else every, keep_examples=True)
    joined = join(old.template, learn_prototype(old.name, new).template)
    origin = old.template.provenance or "a template"
    how = f"{origin}, then averaged with {len(new)} more"
    return Prototype(old.name, replace(joined, provenance=how))


def _weigh_again(library: ClassLibrary) -> ClassLibrary:
    """Library with the background and prior of all examples, if all are kept."""
    examples, training = kept_examples(library), training_of(library)
    if examples is None or training is None:
        return library
    background = measure_background(examples, training=training)
    prior = mix_prior(list_sequences(examples), library.scoring, mirror=training.mirror)
    classes = tuple(replace(one, background=background, prior=prior) for one in library)
    return replace(library, classes=classes)


def _is_calibrated(motion_class: MotionClass) -> bool:
    return motion_class.estimated_recall is not None


def _calibrate_again(
    library: ClassLibrary, names: Sequence[str], *, jobs: int, monitor: Monitor | None
) -> ClassLibrary:
    """Library with thresholds of some classes calibrated again, if all examples are kept."""
    examples, training = kept_examples(library), training_of(library)
    if examples is None or training is None or not training.calibrate or not names:
        return library
    watch = monitor or StrictMonitor()
    remembered = replace(library, training=training)
    calibrated = calibrate(remembered, examples, names=names, jobs=jobs, monitor=watch)
    return replace(calibrated, training=library.training)


def _only_prototype(motion_class: MotionClass) -> Prototype:
    first, *others = motion_class.originals
    if others:
        names = ", ".join(repr(one.name) for one in motion_class.originals)
        raise InvalidInput(
            f"class {motion_class.name!r} has several templates ({names}); join classes of one"
        )
    return first
