"""How is a library changed by hand?

Classes are renamed, removed, given other templates or thresholds, and libraries merged.
Libraries and classes come back new, never changed.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Literal

from motionary.errors import InvalidInput
from motionary.models.library.classes import ClassLibrary, MotionClass, Prototype
from motionary.models.library.training import MIRRORED, mirror_prototype
from motionary.models.templates import MotionTemplate

#: What becomes of a class whose name another library has, too.
Clash = Literal["refuse", "first", "both"]


def replace_class(library: ClassLibrary, name: str, changed: MotionClass) -> ClassLibrary:
    """Library in which another class stands in the place of one.

    Raises
    ------
    InvalidInput
        If there is no class of that name, or the new one has the name of a third or other
        features.
    """
    old = library[name]
    classes = tuple(changed if one is old else one for one in library)
    return replace(library, classes=classes)


def remove_class(library: ClassLibrary, name: str) -> ClassLibrary:
    """Library without a class.

    Raises
    ------
    InvalidInput
        If there is no class of that name.
    """
    old = library[name]
    return replace(library, classes=tuple(one for one in library if one is not old))


def rename_class(library: ClassLibrary, name: str, new_name: str) -> ClassLibrary:
    """Library in which a class, and the templates that are called like it, have another name.

    Raises
    ------
    InvalidInput
        If there is no class of that name, or another one has the new name.
    """
    if new_name != name and new_name in library.names:
        raise InvalidInput(f"the library has a class {new_name!r} already; choose another name")
    old = library[name]
    names = {name: new_name, name + MIRRORED: new_name + MIRRORED}
    prototypes = tuple(replace(s, name=names.get(s.name, s.name)) for s in old.prototypes)
    return replace_class(library, name, replace(old, name=new_name, prototypes=prototypes))


def find_prototype(motion_class: MotionClass, name: str | None = None) -> Prototype:
    """The subclass of a name; without one, the only one, or the one that is called as the class.

    Raises
    ------
    InvalidInput
        If there is none of that name, or none is given and several may be meant.
    """
    wanted = motion_class.name if name is None else name
    for one in motion_class.prototypes:
        if one.name == wanted or (name is None and len(motion_class.prototypes) == 1):
            return one
    names = ", ".join(repr(one.name) for one in motion_class.prototypes)
    problem = "has several templates, say which" if name is None else f"has no template {name!r}"
    raise InvalidInput(f"class {motion_class.name!r} {problem}: {names}")


def replace_template(
    library: ClassLibrary, name: str, template: MotionTemplate, *, prototype: str | None = None
) -> ClassLibrary:
    """Library in which a class has another template, and its mirror image with it.

    Queries, kept examples and what was promised were of the template before, and go.

    Raises
    ------
    InvalidInput
        If there is no such class or subclass, or the template is over other features or
        fixes nothing.
    """
    old = find_prototype(library[name], prototype)
    if template is old.template:
        return library
    return replace_prototype(library, name, Prototype(old.name, template))


def replace_prototype(library: ClassLibrary, name: str, changed: Prototype) -> ClassLibrary:
    """Library in which a class has another subclass of the same name, and its mirror image.

    Raises
    ------
    InvalidInput
        If there is no such class, or the template is over other features or fixes nothing.
    """
    motion_class = library[name]
    if changed.template.feature_names != library.feature_set.ids:
        raise InvalidInput(
            f"template {changed.name!r} is over {changed.template.feature_set!r}, the library over "
            f"{library.feature_set.name!r}; both need one feature set"
        )
    new = {changed.name: changed}
    if any(one.name == changed.name + MIRRORED for one in motion_class.prototypes):
        new[changed.name + MIRRORED] = mirror_prototype(changed, library.feature_set)
    replaced = replace(
        motion_class,
        prototypes=tuple(new.get(one.name, one) for one in motion_class.prototypes),
        estimated_precision=None,
        estimated_recall=None,
    )
    replaced.quantised()
    return replace_class(library, name, replaced)


def merge_libraries(libraries: Sequence[ClassLibrary], *, clash: Clash = "refuse") -> ClassLibrary:
    """One library of the classes of several.

    Parameters
    ----------
    libraries : in the order of their classes
    clash : of classes of one name, "refuse" takes none and raises, "first" takes the first
        alone, "both" takes the first with the templates of the others beside its own

    Raises
    ------
    InvalidInput
        If there is no library, they are over different features, or names clash.
    """
    if not libraries:
        raise InvalidInput("merging needs at least one library, got none")
    first = libraries[0]
    for other in libraries[1:]:
        if other.feature_set.ids != first.feature_set.ids:
            raise InvalidInput(
                f"libraries need one feature set to be merged, got {first.feature_set.name!r} and "
                f"{other.feature_set.name!r}; learn one of them again with the other's"
            )
    clashing = find_clashes(libraries)
    if clashing and clash == "refuse":
        raise InvalidInput(
            f"several of the libraries have {', '.join(map(repr, clashing))}; rename them, or "
            "take the first, or the templates of both"
        )
    classes: dict[str, MotionClass] = {}
    for library in libraries:
        for one in library:
            if one.name not in classes:
                classes[one.name] = one
            elif clash == "both":
                classes[one.name] = _side_by_side(classes[one.name], one)
    return ClassLibrary(
        tuple(classes.values()),
        first.feature_set,
        _unite(library.provenance for library in libraries),
        _unite(library.licence for library in libraries),
    )


def find_clashes(libraries: Sequence[ClassLibrary]) -> list[str]:
    """Names of classes that several libraries have."""
    names = [name for library in libraries for name in library.names]
    return sorted({name for name in names if names.count(name) > 1})


def _side_by_side(first: MotionClass, second: MotionClass) -> MotionClass:
    """The first class with the templates of the second beside its own."""
    taken = {one.name for one in first.prototypes}
    added = []
    for one in second.prototypes:
        name, number = one.name, 2
        while name in taken:
            name, number = f"{one.name}-{number}", number + 1
        taken.add(name)
        added.append(replace(one, name=name))
    return replace(
        first,
        prototypes=(*first.prototypes, *added),
        estimated_precision=None,
        estimated_recall=None,
    )


def _unite(texts: Iterable[str]) -> str:
    return "; ".join(dict.fromkeys(text for text in texts if text))
