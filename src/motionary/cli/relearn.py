"""Classes that learn further: `motionary library add`, `motionary learn --corrections`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.options import Jobs, check_library, check_picture, check_target, wrong
from motionary.cli.recordings import (
    ScreenMonitor,
    find_files,
    measure_files,
    split_failures,
    warn_of_all,
)
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions
from motionary.tables import enumerate_names

if TYPE_CHECKING:
    from motionary.evaluation import Rates
    from motionary.features import FeatureSequence
    from motionary.models.library import ClassLibrary, MotionClass
    from motionary.multiview.priors import PriorTable
    from motionary.retrieval.corrections import Corrections

_CHANGES = ("kept", "moved", "renamed", "added", "removed")

LibraryFolder = Annotated[
    str, typer.Argument(metavar="LIB", help="A folder that `motionary learn` wrote.")
]
ClassName = Annotated[str, typer.Argument(metavar="CLASS", help="One of its classes.")]
TemplateName = Annotated[
    str | None, typer.Option(metavar="NAME", help="Which template, of a class of several.")
]
PlotTemplate = Annotated[
    str | None, typer.Option(metavar="PICTURE", help="Draw the template: png, svg or pdf.")
]


def add(
    folder: LibraryFolder,
    name: ClassName,
    files: Annotated[
        list[str], typer.Argument(metavar="FILE", help="Files, folders or patterns: examples.")
    ],
    recordings: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH",
            help="The recordings of labels: each FILE is then a file of labels, and those called "
            "CLASS are the examples.",
        ),
    ] = None,
    template: TemplateName = None,
    plot: PlotTemplate = None,
    *,
    jobs: Jobs,
    reading: ReadOptions,
) -> int:
    """Let a class learn from more examples.

    A library that was learned with --keep-examples becomes what it would be had they been
    there from the start, thresholds included. Otherwise the class's template stands for
    its examples, and its threshold stays.

    motionary library add my-classes squat new/*.bvh
    motionary library add my-classes squat times.csv --recordings takes/
    """
    from motionary.models.library import add_examples, open_library

    check_picture("--plot", plot)
    check_target(folder, is_folder=True)
    library = open_library(folder)
    _ = library[name]
    if recordings is None:
        sequences, failed = _read_whole(files, library, jobs=jobs, reading=reading)
    else:
        sequences, failed = _read_parts(
            files, recordings, name, library, jobs=jobs, reading=reading
        )
    expanded = add_examples(
        library, name, sequences, prototype=template, jobs=jobs, monitor=ScreenMonitor()
    )
    if expanded is library:
        screen.warn("no example is new; nothing was changed")
    expanded.save(folder)
    had_queries = any(one.queries for one in library[name].prototypes)
    has_queries = any(one.queries for one in expanded[name].prototypes)
    say_changed(expanded, name, lost_queries=had_queries and not has_queries)
    if plot:
        draw_template(plot, expanded, name, template)
    return 1 if failed else 0


def _read_whole(
    files: Sequence[str], library: "ClassLibrary", *, jobs: int, reading: ReadOptions
) -> "tuple[list[FeatureSequence], bool]":
    """Features of whole recordings, and whether one could not be read."""
    found = find_files(files, reading)
    sequences, failures = split_failures(
        measure_files(
            found.files, "reading", reading=reading, feature_set=library.feature_set,
            jobs=jobs,
        )
    )  # fmt: skip
    warn_of_all(found.missing.values(), failures)
    return sequences, bool(found.missing or failures)


def _read_parts(
    files: Sequence[str],
    recordings: Sequence[str],
    name: str,
    library: "ClassLibrary",
    *,
    jobs: int,
    reading: ReadOptions,
) -> "tuple[list[FeatureSequence], bool]":
    """Features of what labels of one name cover, and whether something could not be used."""
    from motionary.models.library import list_tracks, read_labelled

    tracks = [track for file in files for track in list_tracks(file, reading)]
    names = sorted({label.name for track in tracks for label in track})
    if name not in names:
        raise InvalidInput(f"no label is called {name!r}; there are {enumerate_names(names)}")
    own = [replace(t, labels=tuple(x for x in t if x.name == name)) for t in tracks]
    with screen.progress("reading", sum(len(track) > 0 for track in own)) as done:
        read = read_labelled(
            own, recordings, reading=reading, feature_set=library.feature_set, jobs=jobs,
            on_done=done,
        )  # fmt: skip
    warn_of_all((), read.failures)
    for error in read.unusable:
        screen.warn(str(error))
    return read.classes.get(name, {}).get(name, []), bool(read.failures or read.unusable)


def learn_corrected(
    table: str,
    folder: str,
    output: str | None,
    *,
    recordings: Sequence[str] | None,
    as_json: bool,
    jobs: int,
    reading: ReadOptions,
) -> int:
    """Let a library learn from its labels as a person left them, and say what that did."""
    from motionary.models.library import EVERYDAY, find_sequences, list_tracks, open_library
    from motionary.retrieval.corrections import learn_corrections

    target = folder if output is None else output
    if output is None and folder == EVERYDAY:
        raise wrong("--output", "the library that ships stays as it is; name a folder for yours")
    check_library(target, replace=True)
    library = open_library(folder)
    tracks = list_tracks(table, reading)
    with screen.progress("reading", len(tracks)) as done:
        found = find_sequences(
            tracks, recordings or Path(table).parent, reading=reading,
            feature_set=library.feature_set, jobs=jobs, on_done=done,
        )  # fmt: skip
    warn_of_all((), found.failures)
    for error in found.unusable:
        screen.warn(str(error))
    if not found.pairs:
        raise InvalidInput("none of its recordings could be read; nothing was changed", file=table)
    corrections = learn_corrections(library, found.pairs)
    if corrections.n_changed:
        corrections.library.save(target)
    else:
        screen.warn("the labels are as the library gives them; nothing was changed")
    _show_corrections(corrections, as_json=as_json)
    return 1 if found.failures or found.unusable else 0


def _show_corrections(corrections: "Corrections", *, as_json: bool) -> None:
    """A row a class: what was changed, and precision and recall before and after."""
    rows = [
        {
            "class": one.name,
            **{kind: getattr(one, kind) for kind in _CHANGES},
            **_describe_rates(one.before, one.after),
        }
        for one in corrections.classes
    ]
    if as_json:
        for row in rows:
            screen.print_json(row)
        return
    columns = ("class", *(f">{name}" for name in _CHANGES), ">precision", ">recall")
    cells = [
        (*map(str, list(row.values())[:6]), _format_change(row, "precision"),
         _format_change(row, "recall"))
        for row in rows
    ]  # fmt: skip
    screen.print_table(columns, cells)
    row = _describe_rates(corrections.before, corrections.after)
    screen.say(
        f"all: precision {_format_change(row, 'precision')}, recall {_format_change(row, 'recall')}"
    )


def _describe_rates(before: "Rates", after: "Rates | None") -> "dict[str, float | None]":
    return {
        "precision_before": before.precision,
        "recall_before": before.recall,
        "precision_after": None if after is None else after.precision,
        "recall_after": None if after is None else after.recall,
    }


def _format_change(row: Mapping[str, Any], name: str) -> str:
    before, after = (row[f"{name}_{when}"] for when in ("before", "after"))
    return f"{screen.percent(before)} to {'?' if after is None else screen.percent(after)}"


def say_changed(library: "ClassLibrary", name: str, *, lost_queries: bool) -> None:
    """What has become of a class."""
    if lost_queries:
        screen.warn(
            f"class {name!r}: its keyframe queries were of the template before, and are gone"
        )
    screen.say(_describe_class(library[name]))


def _describe_class(motion_class: "MotionClass") -> str:
    """A class in a line."""
    from motionary.models.library import fractions_fixed

    parts = [
        f"{prototype.name} {prototype.template.duration_s:.2f} s, {100 * fraction:.0f} % fixed, "
        f"{prototype.template.provenance}"
        for prototype, fraction in zip(
            motion_class.prototypes, fractions_fixed(motion_class), strict=True
        )
    ]
    threshold = f"threshold {motion_class.threshold:.3g}"
    return f"{motion_class.name}: {threshold}; {'; '.join(parts)}"


def draw_template(
    plot: str,
    library: "ClassLibrary",
    name: str,
    template: str | None,
    *,
    marks: "PriorTable | None" = None,
) -> None:
    """Draw a template of a class, its fixed cells beside it, and what it tells tracks."""
    from motionary.models.library import find_prototype
    from motionary.plots import plot_template, save

    prototype = find_prototype(library[name], template)
    rows = None
    if marks:
        from motionary.multiview import find_rows

        rows = find_rows(marks.get((name, prototype.name), ()), library.feature_set.names)
    figure = plot_template(
        prototype.template,
        tolerance=library[name].tolerance,
        feature_set=library.feature_set,
        marks=rows,
    )
    save(figure, plot)
