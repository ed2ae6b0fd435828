"""Libraries changed by hand; merged, as the one that ships is of its two folders.

Libraries and classes come back new, never changed.

The library of everyday motion lies in two folders: what was learned from CMU and UI-PRMD or
designed by hand, and what was learned from HDM05, under CC BY-SA 3.0. Beside the latter lies
what its labels were calibrated by, for the classes of both. `recipes/everyday.py` makes all.
"""

import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

from motionary.errors import InvalidInput
from motionary.features import FeatureSet
from motionary.models.keyframes import mirror_query
from motionary.models.library.class_files import number_names
from motionary.models.library.classes import MotionClass, Prototype
from motionary.models.library.scoring import Scoring
from motionary.models.library.storage import INDEX, ClassLibrary, load_library
from motionary.models.templates import MotionTemplate, mirror

#: What becomes of a class whose name another library has, too.
Clash = Literal["refuse", "first", "both"]

#: The library that ships, where a library is asked for; and none.
EVERYDAY = "everyday"
NO_LIBRARY = "none"
#: File of what both folders together were calibrated by.
CALIBRATION = "calibration.toml"

_FOLDERS = ("everyday", "everyday_hdm05")
# Follows the name of a template in that of its mirror image; nothing reads it.
_MIRRORED = "Mirrored"


def replace_class(library: ClassLibrary, name: str, changed: MotionClass) -> ClassLibrary:
    """Library in which another class stands in the place of one.

    Raises InvalidInput if there is no class of that name, or the new one has the name of a
    third, or other features.
    """
    old = library[name]
    return replace(library, classes=tuple(changed if one is old else one for one in library))


def remove_class(library: ClassLibrary, name: str) -> ClassLibrary:
    """Library without a class; InvalidInput if there is none of that name."""
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
    renamed: list[Prototype] = []
    for one in library[name].prototypes:
        if one.name == name:
            one = replace(one, name=new_name)
        elif one.mirror_of == name:
            called = new_name + _MIRRORED if one.name == name + _MIRRORED else one.name
            one = replace(one, name=called, mirror_of=new_name)
        renamed.append(one)
    changed = replace(library[name], name=new_name, prototypes=tuple(renamed))
    return replace_class(library, name, changed)


def find_prototype(motion_class: MotionClass, name: str | None = None) -> Prototype:
    """The prototype of a name; by default the only one, or that called like the class.

    Raises InvalidInput if there is none of that name, or none is given and several may be meant.
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

    Queries, kept examples and estimates were of the template before, and go.

    Raises
    ------
    InvalidInput
        If there is no such class or prototype, or the template is over other features or
        fixes nothing.
    """
    old = find_prototype(library[name], prototype)
    if template is old.template:
        return library
    return replace_prototype(library, name, Prototype(old.name, template))


def replace_prototype(library: ClassLibrary, name: str, changed: Prototype) -> ClassLibrary:
    """Library in which a class has another prototype of the same name, and its mirror image."""
    if changed.template.feature_names != library.feature_set.ids:
        raise InvalidInput(
            f"template {changed.name!r} is over {changed.template.feature_set!r}, the library over "
            f"{library.feature_set.name!r}; both need one feature set"
        )
    prototypes = []
    for one in library[name].prototypes:
        if one.name == changed.name:
            one = changed
        elif one.mirror_of == changed.name:
            one = mirror_prototype(changed, library.feature_set, name=one.name)
        prototypes.append(one)
    replaced = without_estimates(library[name], prototypes=tuple(prototypes))
    # A template that would match everything is refused.
    _ = replaced.quantised
    return replace_class(library, name, replaced)


def without_estimates(motion_class: MotionClass, **changes: Any) -> MotionClass:
    """A changed class, of which nothing is known from cross-validation."""
    return replace(
        motion_class,
        estimated_precision=None,
        estimated_recall=None,
        false_level=None,
        **changes,
    )


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
            provenance = one.provenance or library.provenance
            licence = one.licence or library.licence
            if (provenance, licence) != (one.provenance, one.licence):
                one = replace(one, provenance=provenance, licence=licence)
            if one.name not in classes:
                classes[one.name] = one
            elif clash == "both":
                classes[one.name] = _side_by_side(classes[one.name], one)
    origin: dict[str, Any] = {
        "provenance": _unite(library.provenance for library in libraries),
        "licence": _unite(library.licence for library in libraries),
    }
    trained = {one.training and replace(one.training, **origin) for one in libraries}
    return ClassLibrary(
        tuple(classes.values()),
        first.feature_set,
        **origin,
        # Of such as were trained alike only.
        training=trained.pop() if len(trained) == 1 else None,
        scoring=_common_scoring(libraries),
    )


def find_clashes(libraries: Sequence[ClassLibrary]) -> list[str]:
    """Names of classes that several libraries have."""
    names = [name for library in libraries for name in library.names]
    return sorted({name for name in names if names.count(name) > 1})


def _side_by_side(first: MotionClass, second: MotionClass) -> MotionClass:
    """The first class with the templates of the second beside its own."""
    taken = {one.name for one in first.prototypes}
    names: dict[str, str] = {}
    for one in second.prototypes:
        names[one.name] = next(name for name in number_names(one.name) if name not in taken)
        taken.add(names[one.name])
    added = [
        replace(one, name=names[one.name], mirror_of=names.get(one.mirror_of, ""))
        for one in second.prototypes
    ]
    return without_estimates(
        first,
        prototypes=(*first.prototypes, *added),
        provenance=_unite((first.provenance, second.provenance)),
        licence=_unite((first.licence, second.licence)),
    )


def _common_scoring(libraries: Sequence[ClassLibrary]) -> Scoring | None:
    """That of the first library, if all have one; rates of false labels do not add up."""
    found = [one.scoring for one in libraries]
    if any(one is None for one in found) or found[0] is None:
        return None
    if len(set(found)) == 1:
        return found[0]
    return replace(found[0], false_slope=None, probability=None)


def _unite(texts: Iterable[str]) -> str:
    return "; ".join(dict.fromkeys(text for text in texts if text))


def mirror_prototype(
    original: Prototype, feature_set: FeatureSet, *, name: str | None = None
) -> Prototype:
    """The mirror image of a prototype, under a name of its own."""
    template = mirror(original.template, feature_set.mirror_order)
    queries = tuple(mirror_query(query, feature_set) for query in original.queries)
    called = original.name + _MIRRORED if name is None else name
    return Prototype(called, template, queries, original.votes, mirror_of=original.name)


# -- the library that ships --------------------------------------------------------------


@cache
def load_everyday() -> ClassLibrary:
    """The library of everyday motion; each class says where it comes from."""
    return load_parts(Path(__file__).parents[2] / "libraries")


def load_parts(home: Path) -> ClassLibrary:
    """One calibrated library of both folders, wherever they lie."""
    whole = merge_libraries([load_library(home / one) for one in _FOLDERS], clash="both")
    content = tomllib.loads((home / _FOLDERS[1] / CALIBRATION).read_text("utf-8"))
    levels = content["false_levels"]
    classes = tuple(replace(one, false_level=levels[one.name]) for one in whole)
    scoring = whole.scoring and replace(
        whole.scoring, false_slope=content["false_slope"], probability=content["probability"]
    )
    return replace(whole, classes=classes, scoring=scoring)


def write_calibration(whole: ClassLibrary, path: Path) -> None:
    """Write what `load_parts` reads beside the two folders."""
    scoring = whole.scoring
    if scoring is None or scoring.probability is None:
        raise InvalidInput("the library is not calibrated")
    lines = [
        "# False labels a minute, and how probably a label is right, of both folders together.",
        f"false_slope = {scoring.false_slope}",
        f"probability = {list(scoring.probability)}",
    ]
    lines += ["", "[false_levels]", *(f'"{one.name}" = {one.false_level}' for one in whole)]
    path.write_text("\n".join(lines) + "\n", "utf-8")


def open_library(folder: str | Path) -> ClassLibrary:
    """A library by its folder as of `load_library`, or the one that ships by its name.

    A folder of that name that is a library comes first.
    """
    if str(folder) == EVERYDAY and not (Path(folder) / INDEX).exists():
        return load_everyday()
    return load_library(folder)
