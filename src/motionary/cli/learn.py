"""`motionary learn`: classes of motion from examples, one folder per class."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.options import (
    AsJson,
    FeatureSetName,
    Jobs,
    LibraryDefault,
    check_target,
    find_feature_set,
    picture_path,
    wrong,
)
from motionary.cli.recordings import (
    describe_failure,
    find_files,
    measure_files,
    split_failures,
    warn_of_all,
)
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.features import FeatureSequence
    from motionary.models.library import ClassLibrary, Examples, MotionClass, TrainingOptions
    from motionary.models.library.examples import ReadExamples

_COLUMNS = ("class", "template", ">examples", ">columns", ">seconds", ">fixed", ">threshold")
_KEYS = (
    "class", "template", "examples", "columns", "seconds", "fixed", "threshold",
    "promised_precision", "promised_recall",
)  # fmt: skip
_ESTIMATES = {"promised_precision": ">precision", "promised_recall": ">recall"}
_TRAINING = "motionary.models.library:TrainingOptions"


class Queries(StrEnum):
    """Where the keyframe queries of a class come from."""

    NONE = "none"
    LEARNED = "learned"
    CHOSEN = "chosen"


@dataclass(frozen=True, kw_only=True)
class TrainingFlags:
    """How classes are learned."""

    mirror: Annotated[
        bool,
        typer.Option("--mirror", help="Learn the mirror image of each class, too."),
    ] = False
    features: FeatureSetName = None
    keep_examples: Annotated[
        bool,
        typer.Option(
            "--keep-examples",
            help="Keep the examples' features in the library, so that `library add` learns from "
            "more as if from all at once.",
        ),
    ] = False
    tolerance: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=0.5,
            metavar="FRACTION",
            default_factory=LibraryDefault(_TRAINING, "tolerance"),
            help="A feature may differ in this fraction of the examples and still be asked for.",
        ),
    ]
    queries: Annotated[
        Queries,
        typer.Option(
            help="Keyframe queries from the examples, so that a class is looked for around their "
            "hits only: several that vote are learned by a genetic algorithm (learned), or one "
            "of two to five keyframes is chosen (chosen).",
        ),
    ] = Queries.NONE
    query_runs: Annotated[
        int,
        typer.Option(
            min=1,
            default_factory=LibraryDefault("motionary.models.query_learning:learn_query", "runs"),
            help="With --queries learned: so many are learned for each class; most of them must "
            "agree on a hit.",
        ),
    ]

    def training(self, threshold: float | None) -> "TrainingOptions":
        """The same for the library."""
        from motionary.models.library import TrainingOptions

        trained = TrainingOptions(
            tolerance=self.tolerance, mirror=self.mirror, keep_examples=self.keep_examples
        )
        return trained if threshold is None else replace(trained, threshold=threshold)


@dataclass(frozen=True, kw_only=True)
class ThresholdOptions:
    """Below which cost a match of a class is believed."""

    threshold: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1.0,
            metavar="COST",
            help="Largest cost of a match of these classes.",
        ),
    ] = None
    calibrate: Annotated[
        bool,
        typer.Option(
            "--calibrate",
            help="Choose thresholds by cross-validation on the examples, and estimate precision "
            "and recall for motion that is done as the examples are.",
        ),
    ] = False
    groups: Annotated[
        str | None,
        typer.Option(
            metavar="REGEX",
            help="With --calibrate: examples whose names match the same share a fold, such as "
            "'HDM_(..)_' for actors: the estimates then hold for actors never seen.",
        ),
    ] = None
    negatives: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH",
            help="With --calibrate: other recordings, without any of these classes, to choose "
            "thresholds against.",
        ),
    ] = None

    def check(self) -> None:
        """Refuse options that do not go together.

        Raises
        ------
        BadParameter
        """
        if self.calibrate and self.threshold is not None:
            raise wrong("--threshold, --calibrate", "thresholds are given or chosen, not both")
        for option, value in {"--groups": self.groups, "--negatives": self.negatives}.items():
            if value and not self.calibrate:
                raise wrong(option, "goes with --calibrate")


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
    reading: ReadOptions,
) -> int:
    """Learn classes of motion from examples, one folder per class.

    The files in a folder are the examples of its class. Folders in it are ways of doing the
    same, each with a template of its own.

    With --calibrate each class's threshold is chosen by cross-validation. "precision" is the
    estimated fraction of labels that are right, "recall" that of motions that are labelled, to
    be expected of recordings never seen.

    motionary learn examples/ -o my-classes --mirror
    with examples/squat/one.bvh, examples/squat/two.bvh, examples/kick/one.bvh, ...
    """
    thresholds.check()
    for path in (output, plot):
        check_target(path, is_folder=True)
    folder = Path(examples)
    read, lost = _read_examples(folder, options.features, reading, jobs=jobs)
    warn_of_all((), read.failures)
    others, problems = _read_others(thresholds, options.features, reading, jobs=jobs)
    _advise(read.classes, tolerance=options.tolerance)
    library, refused = _learn(read.classes, others, options, thresholds, jobs=jobs)
    problems += [*refused, *lost, *_outside_of_classes(folder)]
    for problem in problems:
        screen.warn(problem)
    if not library:
        raise InvalidInput(f"{examples}: no class could be learned; nothing was written")
    library.save(output)
    for motion_class in library if plot else ():
        _draw_class(plot or "", motion_class, library)
    _say(library, as_json=as_json)
    return 1 if problems or read.failures else 0


def _read_examples(
    folder: Path, features: str | None, reading: ReadOptions, *, jobs: int
) -> "tuple[ReadExamples, list[str]]":
    """Features of the examples, and which classes have none."""
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
    thresholds: ThresholdOptions, features: str | None, reading: ReadOptions, *, jobs: int
) -> "tuple[list[FeatureSequence], list[str]]":
    """Features of recordings without the classes, and which of them could not be read."""
    if not thresholds.negatives:
        return [], []
    found = find_files(thresholds.negatives)
    sequences, failures = split_failures(
        measure_files(
            found.files,
            "reading others",
            reading=reading,
            feature_set=find_feature_set(features),
            jobs=jobs,
        )
    )
    problems = [str(error) for error in found.missing.values()]
    return sequences, problems + [describe_failure(failure) for failure in failures]


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
    """The library with thresholds that were chosen by cross-validation."""
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


def _draw_class(folder: str, motion_class: "MotionClass", library: "ClassLibrary") -> None:
    """Templates of a class and their fixed cells, a picture a template, into a folder."""
    from motionary.plots import plot_template, save

    for prototype in motion_class.prototypes:
        figure = plot_template(
            prototype.template, tolerance=motion_class.tolerance, feature_set=library.feature_set
        )
        name = motion_class.name
        if prototype.name != name:
            name = f"{name}-{prototype.name.removeprefix(name)}"
        save(figure, picture_path(folder, name))


def _say(library: "ClassLibrary", *, as_json: bool) -> None:
    rows = describe_prototypes(library)
    if as_json:
        for row in rows:
            screen.print_json({key: row[key] for key in _KEYS})
    else:
        is_estimated = any(row[key] is not None for row in rows for key in _ESTIMATES)
        columns = (*_COLUMNS, *(_ESTIMATES.values() if is_estimated else ()))
        keys = _KEYS[: len(columns)]
        screen.print_table(columns, [prototype_cells(row, keys) for row in rows])


def describe_prototypes(library: "ClassLibrary") -> list[dict[str, Any]]:
    """Each prototype of a library, for JSON."""
    rows = []
    for motion_class in library:
        for prototype, fraction in zip(
            motion_class.prototypes, fractions_fixed(motion_class), strict=True
        ):
            template = prototype.template
            row = {
                "class": motion_class.name,
                "template": prototype.name,
                "examples": template.n_examples,
                "columns": template.n_columns,
                "seconds": template.duration_s,
                "fixed": fraction,
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
            rows.append(row)
    return rows


def prototype_cells(row: dict[str, Any], keys: Sequence[str]) -> list[str]:
    """Some of what `describe_prototypes` says, as cells of a table."""
    shown = row | {
        "seconds": f"{row['seconds']:.2f}",
        "threshold": f"{row['threshold']:.3g}",
        **{
            key: screen.percent(row[key])
            for key in ("fixed", "promised_precision", "promised_recall")
        },
    }
    return [str(shown[key]) for key in keys]


def fractions_fixed(motion_class: "MotionClass") -> list[float]:
    """Fraction of the cells that are fixed, of each prototype."""
    from motionary.models.templates import quantise

    quantised = [
        quantise(one.template, tolerance=motion_class.tolerance) for one in motion_class.prototypes
    ]
    return [one.n_fixed / one.fixed.size for one in quantised]
