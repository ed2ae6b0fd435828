"""`motionary library`: what is in a library of classes, and how is it changed by hand?"""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.inputs import check_picture, check_target
from motionary.cli.library_changes import add, edit
from motionary.cli.options import AsJson
from motionary.cli.pictures import draw_library, draw_template
from motionary.errors import InvalidInput

if TYPE_CHECKING:
    from motionary.models.library import ClassLibrary, MotionClass, Prototype

_COLUMNS = (
    "class", "template", ">examples", ">columns", ">fixed", ">threshold", ">right", ">found",
)  # fmt: skip

LibraryFolder = Annotated[
    str, typer.Argument(metavar="LIB", help="A folder that `motionary learn` wrote.")
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


def list_classes(
    folder: LibraryFolder,
    plot: Annotated[
        str | None, typer.Option(metavar="PICTURE", help="Draw the classes: png, svg or pdf.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List the templates of a library, with thresholds and what they promise.

    "right" is the share of the labels that are right, "found" that of the motions that are
    labelled, as measured on examples that were held out when the threshold was suggested.

    motionary library list my-classes --plot my-classes.png
    """
    from motionary.models.library import load_library

    check_picture("--plot", plot)
    loaded = load_library(folder)
    rows = [_row(loaded, one, sub) for one in loaded for sub in one.prototypes]
    if as_json:
        for row in rows:
            screen.print_json(row)
    else:
        screen.say(_describe(loaded, folder))
        screen.print_table(_COLUMNS, [_cells(row) for row in rows])
    if plot and rows:
        draw_library(plot, loaded, title=Path(folder).name)


def show(
    folder: LibraryFolder,
    name: Annotated[str, typer.Argument(metavar="CLASS", help="One of its classes.")],
    template: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which template, of a class of several.")
    ] = None,
    plot: Annotated[
        str | None, typer.Option(metavar="PICTURE", help="Draw the template: png, svg or pdf.")
    ] = None,
) -> None:
    """Write a template as text that a person reads and edits.

    The text tells which relations must hold and which must not, and when; what it does not
    mention is free. `motionary library edit --text` takes it back.

    motionary library show my-classes squat > squat.txt
    """
    from motionary.models.library import find_prototype, load_library
    from motionary.models.templates import template_to_text

    check_picture("--plot", plot)
    loaded = load_library(folder)
    motion_class = loaded[name]
    found = find_prototype(motion_class, template).template
    text = template_to_text(found, tolerance=motion_class.tolerance, feature_set=loaded.feature_set)
    screen.say(*text.splitlines())
    if plot:
        draw_template(plot, found, motion_class.tolerance, feature_set=loaded.feature_set)


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
    plot: Annotated[
        str | None, typer.Option(metavar="PICTURE", help="Draw the classes: png, svg or pdf.")
    ] = None,
) -> None:
    """Put the classes of several libraries into one.

    motionary library merge my-classes yours -o ours --on-clash first
    """
    from motionary.models.library import find_clashes, load_library, merge_libraries

    check_picture("--plot", plot)
    check_target(output, is_folder=True)
    libraries = [load_library(folder) for folder in folders]
    clashing = find_clashes(libraries)
    if clashing and on_clash is Clashing.REFUSE:
        raise InvalidInput(
            f"several of the libraries have {', '.join(map(repr, clashing))}; nothing was "
            "written: rename them, or say --on-clash first or both"
        )
    merged = merge_libraries(libraries, clash=on_clash.value)
    merged.save(output)
    for clash in clashing:
        kept = (
            "the first is kept" if on_clash is Clashing.FIRST else "the templates of all are kept"
        )
        screen.warn(f"class {clash!r} is in several libraries: {kept}")
    screen.say(_describe(merged, output))
    if plot and len(merged):
        draw_library(plot, merged, title=Path(output).name)


#: Commands of the group, in the sequence of its help.
SUBCOMMANDS = {"list": list_classes, "show": show, "edit": edit, "merge": merge, "add": add}


def _describe(library: "ClassLibrary", folder: str) -> str:
    classes = "1 class" if len(library) == 1 else f"{len(library)} classes"
    parts = [f"{folder}: {classes} over {library.feature_set.name}"]
    parts += [f"from: {library.provenance}"] if library.provenance else []
    parts += [f"licence: {library.licence}"] if library.licence else []
    return "; ".join(parts)


def _row(
    library: "ClassLibrary", motion_class: "MotionClass", prototype: "Prototype"
) -> dict[str, Any]:
    from motionary.models.templates import quantise

    template = prototype.template
    quantised = quantise(template, tolerance=motion_class.tolerance)
    return {
        "class": motion_class.name,
        "template": prototype.name,
        "examples": template.n_examples,
        "columns": template.n_columns,
        "seconds": template.duration_s,
        "fixed": quantised.n_fixed / quantised.fixed.size,
        "threshold": motion_class.threshold,
        "promised_precision": motion_class.estimated_precision,
        "promised_recall": motion_class.estimated_recall,
        "queries": len(prototype.queries),
        "kept_examples": len(prototype.examples),
        "made": template.provenance,
        "feature_set": library.feature_set.name,
        "provenance": library.provenance,
        "licence": library.licence,
    }


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    fractions = [
        "" if fraction is None else f"{100 * fraction:.0f} %"
        for fraction in (row["promised_precision"], row["promised_recall"])
    ]
    counts = (str(row["examples"]), str(row["columns"]), f"{100 * row['fixed']:.0f} %")
    return (row["class"], row["template"], *counts, f"{row['threshold']:.3g}", *fractions)
