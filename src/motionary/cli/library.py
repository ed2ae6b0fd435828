"""`motionary library`: classes listed and shown; what changes them is in `editing`."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from motionary.cli import screen
from motionary.cli.editing import (
    LibraryFolder,
    PlotLibrary,
    PlotTemplate,
    TemplateName,
    add,
    describe_library,
    draw_library,
    draw_template,
    edit,
    merge,
)
from motionary.cli.learn import show_library
from motionary.cli.multiview import priors
from motionary.cli.options import AsJson, argument, check_page, check_picture, option, wrong
from motionary.cli.recordings import find_files, open_library, read_motions, split_failures
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.models.library import ClassLibrary, MotionClass


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
    check_picture("--plot", plot)
    loaded = open_library(folder)
    if not as_json:
        screen.say(describe_library(loaded, folder), *_scores_of(loaded))
    show_library(loaded, as_json=as_json)
    if plot and len(loaded):
        draw_library(plot, loaded, folder)


@dataclass(frozen=True, kw_only=True)
class ShowOptions:
    """What is shown of a class, and where."""

    template: TemplateName = None
    plot: PlotTemplate = None
    report: str | None = option(
        "--report HTML",
        "Write a page: what a class asks for, its examples in step, what is near to it.",
    )
    recordings: list[str] | None = option(
        "--recordings PATH", "With --report: where examples are shown from."
    )


def show(
    folder: LibraryFolder,
    options: ShowOptions,
    name: Annotated[str | None, argument("CLASS", "One of its classes; a page has all.")] = None,
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
    from motionary.models.library import find_prototype
    from motionary.models.templates import template_to_text

    check_picture("--plot", options.plot)
    check_page("--report", options.report)
    if name is None and options.report is None:
        raise wrong(
            "CLASS",
            f"name one of those that `motionary library list {folder}` shows; --report has all",
        )
    if options.recordings and options.report is None:
        raise wrong("--recordings", "goes with --report HTML")
    loaded = open_library(folder)
    code = 0 if options.report is None else _write_page(options, loaded, name, reading)
    if name is None:
        return code
    motion_class = loaded[name]
    found = find_prototype(motion_class, options.template).template
    if options.report is None:
        text = template_to_text(
            found, tolerance=motion_class.tolerance, feature_set=loaded.feature_set
        )
        screen.say(*_origin(loaded, motion_class), *text.splitlines())
    if options.plot:
        draw_template(options.plot, loaded, name, options.template, folder=folder)
    return code


def _write_page(
    options: ShowOptions, library: "ClassLibrary", name: str | None, reading: ReadOptions
) -> int:
    """The page of one class or of all; 1 if a recording could not be read."""
    from motionary.reporting import report_library

    motions, code = None, 0
    if options.recordings:
        found = find_files(options.recordings, reading)
        motions, failures = split_failures(read_motions(found.files, reading))
        code = found.warn(failures)
    path, names = options.report or "", None if name is None else [name]
    report_library(library, path, names=names, recordings=motions, title=name or "classes")
    screen.say_size(path)
    return code


def _origin(library: "ClassLibrary", motion_class: "MotionClass") -> list[str]:
    """Comments on where a class comes from and how it may be used."""
    provenance = motion_class.provenance or library.provenance
    licence = motion_class.licence or library.licence
    lines = [f"# from: {provenance}"] if provenance else []
    return [*lines, f"# licence: {licence}"] if licence else lines


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


#: Commands of the group, in the sequence of its help.
SUBCOMMANDS = {
    "library": {
        "list": list_classes, "show": show, "edit": edit, "merge": merge, "add": add,
        "priors": priors,
    },
}  # fmt: skip
