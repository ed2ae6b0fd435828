"""`motionary library edit` and `add`: how does a class become another?"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli import screen
from motionary.cli.inputs import (
    check_picture,
    check_target,
    find_files,
    read_words,
    warn_of_all,
)
from motionary.cli.options import FeatureSetName, Jobs, ReadingOptions, find_feature_set
from motionary.cli.pictures import draw_template
from motionary.errors import InvalidInput

if TYPE_CHECKING:
    from motionary.models.library import ClassLibrary, MotionClass
    from motionary.models.templates import MotionTemplate


@dataclass(frozen=True, kw_only=True)
class Changes:
    """What becomes of a class."""

    text: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Take the template from a text; - reads stdin."),
    ] = None
    new: Annotated[
        bool, typer.Option("--new", help="Make the class, and the library, from the text.")
    ] = False
    template: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which template, of a class of several.")
    ] = None
    restrict: Annotated[
        list[str] | None,
        typer.Option(metavar="RELATION", help="Ask for this relation only; may come repeatedly."),
    ] = None
    threshold: Annotated[
        float | None,
        typer.Option(min=0.0, max=1.0, metavar="COST", help="Largest cost of a match."),
    ] = None
    join: Annotated[
        str | None,
        typer.Option(metavar="CLASS", help="Make one class of this and another."),
    ] = None
    rename: Annotated[str | None, typer.Option(metavar="NAME", help="Call it so.")] = None
    remove: Annotated[bool, typer.Option("--remove", help="Take it out of the library.")] = False

    @property
    def asked(self) -> bool:
        """Whether anything is to be done."""
        rest = (self.text, self.threshold, self.join, self.rename)
        return any(x is not None for x in rest) or self.remove or bool(self.restrict)


def edit(
    folder: Annotated[
        str, typer.Argument(metavar="LIB", help="A folder that `motionary learn` wrote.")
    ],
    name: Annotated[str, typer.Argument(metavar="CLASS", help="One of its classes.")],
    changes: Changes,
    plot: Annotated[
        str | None, typer.Option(metavar="PICTURE", help="Draw the template: png, svg or pdf.")
    ] = None,
    features: FeatureSetName = None,
) -> None:
    """Change a class by hand: its template, threshold or name; join, remove or make one.

    A text from `motionary library show`, edited, keeps what the examples taught wherever
    its meaning did not change.

    motionary library edit my-classes squat --text squat.txt --plot squat.png
    motionary library edit my-classes squat --threshold 0.05 --rename "deep squat"
    motionary library edit my-classes wave_left --join wave_right --rename wave
    motionary library edit my-classes sweeping --new --text sweeping.txt
    """
    check_picture("--plot", plot)
    if not changes.asked:
        raise typer.BadParameter("nothing to change; see --help", param_hint="CLASS")
    if changes.new and (changes.text is None or changes.remove or changes.join):
        raise typer.BadParameter("needs --text, and nothing to remove or join", param_hint="--new")
    check_target(folder, is_folder=True)
    library = _load(folder, features, new=changes.new)
    changed, called = _change(library, name, changes)
    if changes.join is not None and changes.threshold is None:
        changed = _calibrate(changed, {called} if _is_calibrated(library, name) else set())
    changed.save(folder)
    if called not in changed.names:
        screen.say(f"{name}: removed")
        return
    _complain_of_lost(library, name, changed[called])
    screen.say(_tell(changed[called]))
    if plot:
        _draw(plot, changed, called, changes.template)


def add(
    folder: Annotated[
        str, typer.Argument(metavar="LIB", help="A folder that `motionary learn` wrote.")
    ],
    name: Annotated[str, typer.Argument(metavar="CLASS", help="One of its classes.")],
    files: Annotated[
        list[str], typer.Argument(metavar="FILE", help="Files, folders or patterns: examples.")
    ],
    template: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which template, of a class of several.")
    ] = None,
    plot: Annotated[
        str | None, typer.Option(metavar="PICTURE", help="Draw the template: png, svg or pdf.")
    ] = None,
    *,
    jobs: Jobs,
    reading: ReadingOptions,
) -> int:
    """Let a class learn from more examples.

    A library that was learned with --keep-examples becomes what it would be had they been
    there from the start, thresholds included. Otherwise the class's template stands for
    its examples, and its threshold stays.

    motionary library add my-classes squat new/*.bvh
    """
    from motionary.models.library import add_examples, load_library

    check_picture("--plot", plot)
    check_target(folder, is_folder=True)
    library = load_library(folder)
    found = find_files(files)
    words, failures = read_words(
        found.files, "reading", reading=reading.reading(), feature_set=library.feature_set,
        jobs=jobs,
    )  # fmt: skip
    warn_of_all(found.missing.values(), failures)
    expanded = add_examples(library, name, words, prototype=template)
    if expanded is library:
        screen.warn("no example is new; nothing was changed")
    else:
        expanded = _with_thresholds_anew(expanded, library, jobs=jobs)
    expanded.save(folder)
    _complain_of_lost(library, name, expanded[name])
    screen.say(_tell(expanded[name]))
    if plot:
        _draw(plot, expanded, name, template)
    return 1 if found.missing or failures else 0


def _draw(plot: str, library: "ClassLibrary", name: str, template: str | None) -> None:
    shown = _find(library[name], template)
    draw_template(plot, shown, library[name].tolerance, feature_set=library.feature_set)


def _with_thresholds_anew(
    expanded: "ClassLibrary", before: "ClassLibrary", *, jobs: int
) -> "ClassLibrary":
    """Thresholds that were suggested are suggested anew, where there are examples to do so."""
    from motionary.models.library import kept_examples

    if kept_examples(expanded) is not None:
        calibrated = {name for name in before.names if _is_calibrated(before, name)}
        return _calibrate(expanded, calibrated, jobs=jobs)
    screen.warn(
        "the examples that the class was learned from were not kept (learn --keep-examples): "
        "its template stands for them, and its threshold stays"
    )
    return expanded


def _load(folder: str, features: str | None, *, new: bool) -> "ClassLibrary":
    from motionary.models.library import ClassLibrary, load_library

    if new and not (Path(folder) / "library.toml").exists():
        return ClassLibrary((), find_feature_set(features))
    return load_library(folder)


def _change(library: "ClassLibrary", name: str, changes: Changes) -> "tuple[ClassLibrary, str]":
    """The library with a changed class, and what the class is called then."""
    from motionary.models.library import (
        join_classes,
        remove_class,
        rename_class,
        replace_class,
        replace_template,
    )
    from motionary.models.templates import restrict

    if changes.remove:
        return remove_class(library, name), name
    if changes.join is not None:
        library = join_classes(library, name, changes.join)
    if changes.text is not None:
        library = _take_text(library, name, changes)
    if changes.restrict:
        old = _find(library[name], changes.template)
        restricted = restrict(old, changes.restrict, feature_set=library.feature_set)
        library = replace_template(library, name, restricted, prototype=changes.template)
    if changes.threshold is not None:
        # What was promised was promised of another threshold.
        changed = replace(
            library[name],
            threshold=changes.threshold,
            estimated_precision=None,
            estimated_recall=None,
        )
        library = replace_class(library, name, changed)
    if changes.rename is not None:
        return rename_class(library, name, changes.rename), changes.rename
    return library, name


def _take_text(library: "ClassLibrary", name: str, changes: Changes) -> "ClassLibrary":
    from motionary.models.library import MotionClass, Prototype, replace_template
    from motionary.models.templates import revise_template, template_from_text

    text = _read_text(str(changes.text))
    feature_set = library.feature_set
    try:
        if changes.new:
            if name in library.names:
                raise InvalidInput(f"the library has a class {name!r} already; leave out --new")
            template = template_from_text(text, feature_set=feature_set, name=name)
            added = MotionClass(name, (Prototype(name, template),))
            _ = added.quantised
            return replace(library, classes=(*library.classes, added))
        if name not in library.names:
            known = ", ".join(library.names) or "none"
            raise InvalidInput(f"no class {name!r} there ({known}); --new makes it from the text")
        motion_class = library[name]
        revised = revise_template(
            _find(motion_class, changes.template),
            text,
            tolerance=motion_class.tolerance,
            feature_set=feature_set,
        )
        return replace_template(library, name, revised, prototype=changes.template)
    except InvalidInput as error:
        where = "stdin" if changes.text == "-" else changes.text
        raise InvalidInput(f"{where}: {error}") from error


def _read_text(path: str) -> str:
    if path == "-":
        return sys.stdin.read()
    from motionary.io.text import read_text

    return read_text(Path(path))


def _is_calibrated(library: "ClassLibrary", name: str) -> bool:
    return library[name].estimated_recall is not None


def _calibrate(library: "ClassLibrary", names: set[str], *, jobs: int = 1) -> "ClassLibrary":
    """The library with thresholds of some classes chosen anew, if all examples are kept."""
    from motionary.models.library import (
        N_FOLDS,
        apply_calibrations,
        calibrate_thresholds,
        kept_examples,
        training_of,
    )

    examples = kept_examples(library)
    if examples is None or not names:
        return library
    training = training_of(library)
    with screen.progress("choosing thresholds", N_FOLDS) as done:
        calibrations = calibrate_thresholds(examples, training=training, jobs=jobs, on_done=done)
    return apply_calibrations(library, {n: s for n, s in calibrations.items() if n in names})


def _complain_of_lost(before: "ClassLibrary", name: str, after: "MotionClass") -> None:
    """Say that the queries of a template that changed are gone."""
    had = name in before.names and any(s.queries for s in before[name].prototypes)
    if had and not any(s.queries for s in after.prototypes):
        screen.warn(
            f"class {after.name!r}: its keyframe queries were of the template before, and are gone"
        )


def _find(motion_class: "MotionClass", name: str | None) -> "MotionTemplate":
    from motionary.models.library import find_prototype

    return find_prototype(motion_class, name).template


def _tell(motion_class: "MotionClass") -> str:
    """A class in a line."""
    from motionary.models.templates import quantise

    parts = []
    for prototype in motion_class.prototypes:
        quantised = quantise(prototype.template, tolerance=motion_class.tolerance)
        fraction = 100 * quantised.n_fixed / quantised.fixed.size
        parts.append(
            f"{prototype.name} {prototype.template.duration_s:.2f} s, {fraction:.0f} % fixed, "
            f"{prototype.template.provenance}"
        )
    threshold = f"threshold {motion_class.threshold:.3g}"
    return f"{motion_class.name}: {threshold}; {'; '.join(parts)}"
