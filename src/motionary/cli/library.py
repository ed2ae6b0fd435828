"""`motionary library`: classes of a library listed, shown, edited, merged, given more examples."""

import sys
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli import screen
from motionary.cli.learn import show_library
from motionary.cli.multiview import priors, read_marks
from motionary.cli.options import (
    AsJson,
    FeatureSetName,
    Force,
    check_library,
    check_page,
    check_picture,
    check_target,
    find_feature_set,
    flag,
    option,
    wrong,
)
from motionary.cli.recordings import (
    ScreenMonitor,
    find_files,
    read_motions,
    split_failures,
    warn_of_all,
)
from motionary.cli.relearn import (
    ClassName,
    LibraryFolder,
    PlotTemplate,
    TemplateName,
    add,
    draw_template,
    say_changed,
)
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.models.library import ClassEdit, ClassLibrary, MotionClass
    from motionary.models.templates import MotionTemplate

PlotLibrary = Annotated[
    str | None, typer.Option(metavar="PICTURE", help="Draw the classes: png, svg or pdf.")
]


class Clashing(StrEnum):
    """What becomes of a class whose name an earlier library has, too."""

    REFUSE = "refuse"
    FIRST = "first"
    BOTH = "both"


def library() -> None:
    """List, show, edit and merge libraries of classes, and add examples to a class.

    motionary library list my-classes
    motionary library show my-classes squat --plot squat.png > squat.txt
    motionary library edit my-classes squat --text squat.txt
    motionary library merge my-classes yours -o ours
    motionary library add my-classes squat new/*.bvh
    """


# -- list and show ----------------------------------------------------------------------


def list_classes(folder: LibraryFolder, plot: PlotLibrary = None, as_json: AsJson = False) -> None:
    """List the templates of a library, with thresholds and what to expect of them.

    "precision" is the estimated fraction of the labels that are right, "recall" that of the
    motions that are labelled, as measured by cross-validation when the threshold was calibrated.

    motionary library list my-classes --plot my-classes.png
    """
    from motionary.models.library import open_library

    check_picture("--plot", plot)
    loaded = open_library(folder)
    if not as_json:
        screen.say(_describe(loaded, folder), *_scores_of(loaded))
    show_library(loaded, as_json=as_json)
    if plot and len(loaded):
        _draw_library(plot, loaded, folder)


def show(
    folder: LibraryFolder,
    name: Annotated[
        str | None, typer.Argument(metavar="CLASS", help="One of its classes; a page has all.")
    ] = None,
    template: TemplateName = None,
    plot: PlotTemplate = None,
    page: Annotated[
        str | None,
        typer.Option(
            "--report",
            metavar="HTML",
            help="Write a page: what a class asks for, its examples in step, what is near to it.",
        ),
    ] = None,
    recordings: Annotated[
        list[str] | None,
        typer.Option(metavar="PATH", help="With --report: where examples are shown from."),
    ] = None,
    *,
    reading: ReadOptions,
) -> int:
    """Write a template as text that a person reads and edits.

    Before it stand the class's origin and licence, if they are known, as comments. The text
    says which features must hold and which must not, and when; what it does not
    mention is free. `motionary library edit --text` takes it back.

    motionary library show my-classes squat > squat.txt
    motionary library show my-classes --report classes.html --recordings examples/
    """
    from motionary.models.library import open_library
    from motionary.models.templates import template_to_text

    check_picture("--plot", plot)
    check_page("--report", page)
    if name is None and page is None:
        raise wrong("CLASS", "name one of the library's classes; --report shows all of them")
    if recordings and page is None:
        raise wrong("--recordings", "goes with --report HTML")
    loaded = open_library(folder)
    failed = False
    if page is not None:
        failed = _write_page(page, loaded, name, recordings, reading)
    if name is None:
        return int(failed)
    motion_class = loaded[name]
    found = _find(motion_class, template)
    if page is None:
        text = template_to_text(
            found, tolerance=motion_class.tolerance, feature_set=loaded.feature_set
        )
        screen.say(*_origin(loaded, motion_class), *text.splitlines())
    if plot:
        draw_template(plot, loaded, name, template, marks=read_marks(folder, loaded))
    return int(failed)


def _write_page(
    path: str,
    library: "ClassLibrary",
    name: str | None,
    recordings: list[str] | None,
    reading: ReadOptions,
) -> bool:
    """The page of one class or of all; whether a recording could not be read."""
    from motionary.reporting import report_library

    motions, failed = None, False
    if recordings:
        found = find_files(recordings, reading)
        motions, failures = split_failures(read_motions(found.files, reading))
        failed = warn_of_all(found.missing.values(), failures, given=recordings)
    names = None if name is None else [name]
    report_library(library, path, names=names, recordings=motions, title=name or "classes")
    screen.say_size(path)
    return failed


def _origin(library: "ClassLibrary", motion_class: "MotionClass") -> list[str]:
    """Comments on where a class comes from and how it may be used."""
    provenance = motion_class.provenance or library.provenance
    licence = motion_class.licence or library.licence
    lines = [f"# from: {provenance}"] if provenance else []
    return [*lines, f"# licence: {licence}"] if licence else lines


def _describe(library: "ClassLibrary", folder: str) -> str:
    classes = "1 class" if len(library) == 1 else f"{len(library)} classes"
    parts = [f"{folder}: {classes} over {library.feature_set.name}"]
    parts += [f"from: {library.provenance}"] if library.provenance else []
    parts += [f"licence: {library.licence}"] if library.licence else []
    return "; ".join(parts)


def _scores_of(library: "ClassLibrary") -> list[str]:
    """What the thresholds are for where labels are assigned by scores."""
    from motionary.models.library import format_thresholds
    from motionary.retrieval.annotation import default_assignment

    if library.scoring is None or default_assignment(library) != "scores":
        return []
    return [
        f"least score of a label: {format_thresholds(library)}; threshold: the largest cost of"
        " a hit (search --class), or of a label by costs (annotate --assignment published)"
    ]


def _draw_library(plot: str, library: "ClassLibrary", folder: str) -> None:
    from motionary.plots import plot_library, save

    save(plot_library(library, title=Path(folder).name), plot)


def _find(motion_class: "MotionClass", name: str | None) -> "MotionTemplate":
    from motionary.models.library import find_prototype

    return find_prototype(motion_class, name).template


# -- merge ------------------------------------------------------------------------------


def merge(
    folders: Annotated[
        list[str], typer.Argument(metavar="LIB", help="Libraries, in the order of their classes.")
    ],
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="LIB", help="Folder to write to.")
    ],
    on_clash: Annotated[
        Clashing,
        typer.Option(
            help="Where several have a class: refuse, take the first, or give the first the "
            "templates of the others, too."
        ),
    ] = Clashing.REFUSE,
    force: Force = False,
    plot: PlotLibrary = None,
) -> None:
    """Put the classes of several libraries into one.

    motionary library merge my-classes yours -o ours --on-clash first
    """
    from motionary.models.library import find_clashes, merge_libraries, open_library

    check_picture("--plot", plot)
    check_library(output, replace=force)
    libraries = [open_library(folder) for folder in folders]
    clashing = find_clashes(libraries)
    if clashing and on_clash is Clashing.REFUSE:
        raise InvalidInput(
            f"several of the libraries have {', '.join(map(repr, clashing))}; nothing was "
            "written: rename them, or say --on-clash first or both"
        )
    merged = merge_libraries(libraries, clash=on_clash.value)
    merged.save(output)
    kept = "the first is kept" if on_clash is Clashing.FIRST else "the templates of all are kept"
    for clash in clashing:
        screen.warn(f"class {clash!r} is in several libraries: {kept}")
    screen.say(_describe(merged, output))
    if plot and len(merged):
        _draw_library(plot, merged, output)


# -- edit -------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Changes:
    """What becomes of a class."""

    text: str | None = option("--text FILE", "Take the template from a text; - reads stdin.")
    new: bool = flag("--new", "Make the class, and the library, from the text.")
    template: TemplateName = None
    restrict: list[str] | None = option(
        "--restrict FEATURE", "Ask for this feature only; may come repeatedly."
    )
    threshold: float | None = option(
        "--threshold COST", "Largest cost of a match.", min=0.0, max=1.0
    )
    join: str | None = option("--join CLASS", "Make one class of this and another.")
    rename: str | None = option("--rename NAME", "Call it so.")
    remove: bool = flag("--remove", "Take it out of the library.")

    def check(self) -> None:
        """Refuse no change, and changes that do not go together.

        Raises
        ------
        BadParameter
        """
        rest = (self.text, self.threshold, self.join, self.rename)
        if not (any(x is not None for x in rest) or self.remove or self.restrict):
            raise wrong("CLASS", "nothing to change; see --help")
        if self.new and (self.text is None or self.remove or self.join):
            raise wrong("--new", "needs --text, and nothing to remove or join")

    def for_library(self) -> "ClassEdit":
        """The same for the library, the text read."""
        from motionary.models.library import ClassEdit

        return ClassEdit(
            remove=self.remove,
            join=self.join,
            text=None if self.text is None else _read_text(self.text),
            new=self.new,
            restrict=self.restrict or (),
            threshold=self.threshold,
            rename=self.rename,
            template=self.template,
        )


def edit(
    folder: LibraryFolder,
    name: ClassName,
    changes: Changes,
    plot: PlotTemplate = None,
    features: FeatureSetName = None,
) -> None:
    """Change a class by hand: its template, threshold or name; join, remove or make one.

    A text from `motionary library show`, edited, keeps what was learned from the examples
    wherever its meaning did not change.

    motionary library edit my-classes squat --text squat.txt --plot squat.png
    motionary library edit my-classes squat --threshold 0.05 --rename "deep squat"
    motionary library edit my-classes wave_left --join wave_right --rename wave
    motionary library edit my-classes sweeping --new --text sweeping.txt
    """
    check_picture("--plot", plot)
    changes.check()
    check_target(folder, is_folder=True)
    from motionary.models.library import edit_class

    library = _load(folder, features, new=changes.new)
    try:
        edited = edit_class(library, name, changes.for_library(), monitor=ScreenMonitor())
    except InvalidInput as error:
        if changes.text is None:
            raise
        where = "stdin" if changes.text == "-" else changes.text
        raise InvalidInput(str(error), file=where) from error
    edited.library.save(folder)
    if edited.name not in edited.library.names:
        screen.say(f"{name}: removed")
        return
    say_changed(edited.library, edited.name, lost_queries=edited.lost_queries)
    if plot:
        draw_template(plot, edited.library, edited.name, changes.template)


def _load(folder: str, features: str | None, *, new: bool) -> "ClassLibrary":
    from motionary.models.library import ClassLibrary, open_library

    if new and not (Path(folder) / "library.toml").exists():
        return ClassLibrary((), find_feature_set(features))
    return open_library(folder)


def _read_text(path: str) -> str:
    if path == "-":
        return sys.stdin.read()
    from motionary.io import read_text

    return read_text(Path(path))


#: Commands of the group, in the sequence of its help.
SUBCOMMANDS = {
    "list": list_classes, "show": show, "edit": edit, "merge": merge, "add": add, "priors": priors,
}  # fmt: skip
