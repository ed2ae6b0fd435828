"""`motionary learn`: what do the examples of each class have in common?"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.inputs import check_target, find_files, read_words, warn_of_all
from motionary.cli.learn_options import Queries, ThresholdOptions, TrainingFlags
from motionary.cli.options import (
    AsJson,
    Jobs,
    ReadingOptions,
    find_feature_set,
)
from motionary.cli.pictures import draw_class
from motionary.errors import InvalidInput

if TYPE_CHECKING:
    from motionary.features import FeatureSequence
    from motionary.io import ReadOptions
    from motionary.models.library import ClassLibrary, Examples, ReadExamples, TrainingOptions

_COLUMNS = ("class", "template", ">examples", ">columns", ">seconds", ">fixed", ">threshold")
_ESTIMATES = {"promised_precision": ">right", "promised_recall": ">found"}


def learn(
    examples: Annotated[
        str,
        typer.Argument(metavar="EXAMPLES", help="A folder with one folder per class."),
    ],
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="LIB", help="Folder to write the library to.")
    ],
    options: TrainingFlags,
    thresholds: ThresholdOptions,
    plot: Annotated[str | None, typer.Option(metavar="FOLDER", help="Draw the templates.")] = None,
    as_json: AsJson = False,
    *,
    jobs: Jobs,
    reading: ReadingOptions,
) -> int:
    """Learn classes of motion from examples, one folder per class.

    The files in a folder are the examples of its class. Folders in it are ways of doing the
    same, each with a template of its own.

    With --suggest some examples of each class are held out in turn to choose its threshold.
    "right" is the share of labels that are right, "found" that of motions that are labelled,
    to be expected of recordings never seen.

    motionary learn examples/ -o my-classes --mirror
    with examples/squat/one.bvh, examples/squat/two.bvh, examples/kick/one.bvh, ...
    """
    thresholds.check()
    for path in (output, plot):
        check_target(path, is_folder=True)
    folder, told = Path(examples), reading.reading()
    read, lost = _read_examples(folder, options.features, told, jobs=jobs)
    warn_of_all((), read.failures)
    others, problems = _read_others(thresholds, options.features, told, jobs=jobs)
    _advise(read.classes, tolerance=options.tolerance)
    library, refused = _learn(read.classes, others, options, thresholds, jobs=jobs)
    problems += [*refused, *lost, *_outside_of_classes(folder)]
    for problem in problems:
        screen.warn(problem)
    if not library:
        raise InvalidInput(f"{examples}: no class could be learned; nothing was written")
    library.save(output)
    for motion_class in library if plot else ():
        draw_class(plot or "", motion_class, library=library)
    _say(library, as_json=as_json)
    return 1 if problems or read.failures else 0


def _read_examples(
    folder: Path, features: str | None, reading: "ReadOptions", *, jobs: int
) -> "tuple[ReadExamples, list[str]]":
    """Words of the examples, and which classes have none."""
    from motionary.models.library import list_examples, read_examples

    listed = list_examples(folder)
    with screen.progress("reading", len(listed)) as done:
        read = read_examples(
            folder,
            reading=reading,
            feature_set=find_feature_set(features),
            jobs=jobs,
            on_done=done,
        )
    lost = sorted({name for name, _, _ in listed} - set(read.classes))
    return read, [f"class {name!r}: none of its examples could be read; left out" for name in lost]


def _read_others(
    thresholds: ThresholdOptions, features: str | None, reading: "ReadOptions", *, jobs: int
) -> "tuple[list[FeatureSequence], list[str]]":
    """Words of recordings without the classes, and which of them could not be read."""
    if not thresholds.negatives:
        return [], []
    found = find_files(thresholds.negatives)
    words, failures = read_words(
        found.files,
        "reading others",
        reading=reading,
        feature_set=find_feature_set(features),
        jobs=jobs,
    )
    problems = [str(error) for error in found.missing.values()]
    return words, problems + [screen.name_error(*item.item, item.error) for item in failures]


def _learn(
    examples: "Examples",
    others: "Sequence[FeatureSequence]",
    options: TrainingFlags,
    thresholds: ThresholdOptions,
    *,
    jobs: int,
) -> "tuple[ClassLibrary, list[str]]":
    """The library, and which classes are left out and why."""
    from motionary.models.library import learn_classes

    refused: list[str] = []
    training = options.training(thresholds.threshold)
    with screen.progress("learning", len(examples)) as done:
        library = learn_classes(
            examples,
            training=training,
            on_done=done,
            on_refused=lambda name, why: refused.append(f"class {name!r} is left out: {why}"),
        )
    if thresholds.calibrate and library:
        library = _with_thresholds(
            library, examples, others, groups=thresholds.groups, training=training, jobs=jobs
        )
    if options.queries is not Queries.NONE:
        library = _with_queries(library, examples, options, jobs=jobs)
    return library, refused


def _advise(examples: "Examples", *, tolerance: float) -> None:
    """Say what looks wrong with the examples; they are learned all the same."""
    from motionary.models.library import advise

    for advice in advise(examples, tolerance=tolerance):
        screen.warn(str(advice))


def _with_thresholds(
    library: "ClassLibrary",
    examples: "Examples",
    others: "Sequence[FeatureSequence]",
    *,
    groups: str | None,
    training: "TrainingOptions",
    jobs: int,
) -> "ClassLibrary":
    """The library with thresholds that were chosen on examples held out."""
    from motionary.models.library import N_FOLDS, apply_calibrations, calibrate_thresholds

    learned = {name: examples[name] for name in library.names}
    with screen.progress("choosing thresholds", N_FOLDS) as done:
        calibrations = calibrate_thresholds(
            learned, groups=groups, negatives=others, training=training, jobs=jobs, on_done=done
        )
    for name in library.names:
        if name not in calibrations:
            screen.warn(
                f"class {name!r}: too little to choose its threshold by; it stays "
                f"{library[name].threshold:g}"
            )
    return apply_calibrations(library, calibrations)


def _with_queries(
    library: "ClassLibrary", examples: "Examples", options: TrainingFlags, *, jobs: int
) -> "ClassLibrary":
    """The library with queries, and on the screen which classes have none."""
    from motionary.models.library import choose_queries, learn_queries

    with screen.progress("keyframes", len(library)) as done:
        if options.queries is Queries.CHOSEN:
            queried = choose_queries(library, examples, on_done=done)
        else:
            queried = learn_queries(
                library, examples, runs=options.query_runs, jobs=jobs, on_done=done
            )
    for name, reason in queried.without.items():
        screen.warn(f"class {name!r} has no queries: {reason}")
    return queried.library


def _outside_of_classes(folder: Path) -> list[str]:
    from motionary.io import MOTION_SUFFIXES, format_suffix

    stray = sorted(path.name for path in folder.iterdir() if format_suffix(path) in MOTION_SUFFIXES)
    if not stray:
        return []
    more = f" and {len(stray) - 1} more" if len(stray) > 1 else ""
    return [f"{stray[0]}{more}: in no class; put examples into a folder named after their class"]


def _say(library: "ClassLibrary", *, as_json: bool) -> None:
    from motionary.models.templates import quantise

    rows = []
    for motion_class in library:
        for prototype in motion_class.prototypes:
            template = prototype.template
            quantised = quantise(template, tolerance=motion_class.tolerance)
            row = {
                "class": motion_class.name,
                "template": prototype.name,
                "examples": template.n_examples,
                "columns": template.n_columns,
                "seconds": template.duration_s,
                "fixed": quantised.n_fixed / quantised.fixed.size,
                "threshold": motion_class.threshold,
                "promised_precision": motion_class.estimated_precision,
                "promised_recall": motion_class.estimated_recall,
            }
            rows.append(row)
    if as_json:
        for row in rows:
            screen.print_json(row)
    else:
        promises = (
            _ESTIMATES if any(row[key] is not None for row in rows for key in _ESTIMATES) else {}
        )
        columns = (*_COLUMNS, *promises.values())
        screen.print_table(columns, [_cells(row)[: len(columns)] for row in rows])


def _cells(row: dict[str, Any]) -> list[str]:
    shown = row | {
        "seconds": f"{row['seconds']:.2f}",
        "fixed": f"{100 * row['fixed']:.0f} %",
        "threshold": f"{row['threshold']:.3g}",
    }
    for key in _ESTIMATES:
        shown[key] = "" if row[key] is None else f"{100 * row[key]:.0f} %"
    return [str(value) for value in shown.values()]
