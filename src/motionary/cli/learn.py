"""`motionary learn`: classes of motion from examples, or from labels of recordings."""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.options import (
    AsJson,
    FeatureSetName,
    Force,
    Jobs,
    LibraryDefault,
    check_library,
    check_target,
    find_feature_set,
    flag,
    option,
    picture_path,
    wrong,
)
from motionary.cli.recordings import (
    ScreenMonitor,
    describe_failure,
    find_files,
    measure_files,
    split_failures,
)
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.features import FeatureSequence, FeatureSet
    from motionary.models.library import ClassLibrary, MotionClass, TrainingOptions

_ESTIMATES = {"promised_precision": ">precision", "promised_recall": ">recall"}
_COLUMNS = {
    "class": "class", "template": "template", "examples": ">examples", "columns": ">columns",
    "seconds": ">seconds", "fixed": ">fixed", "threshold": ">threshold", **_ESTIMATES,
}  # fmt: skip
_TRAINING = "motionary.models.library:TrainingOptions"


class Queries(StrEnum):
    """Where the keyframe queries of a class come from."""

    NONE = "none"
    LEARNED = "learned"
    CHOSEN = "chosen"


@dataclass(frozen=True, kw_only=True)
class TrainingFlags:
    """How classes are learned, and below which cost a match is believed."""

    recordings: list[str] | None = option(
        "--recordings PATH",
        "The recordings that labels are of; by default the folder of the table.",
    )
    corrections: str | None = option(
        "--corrections LABELS",
        "Learn from labels that --library gave and a person corrected, such as those that the page "
        "of `motionary report` saves.",
    )
    library: str | None = option(
        "--library LIB", "With --corrections: the library that learns further."
    )
    mirror: bool = flag("--mirror", "Learn the mirror image of each class, too.")
    fold_sides: bool = flag(
        "--fold-sides",
        "Take each example as it is or mirrored, as it fits the others of its class: for motions "
        "that people do on either side.",
    )
    features: FeatureSetName = None
    keep_examples: bool = flag(
        "--keep-examples",
        "Keep the examples' features in the library, so that `library add` learns from more as if "
        "from all at once.",
    )
    tolerance: float = option(
        "--tolerance FRACTION",
        "A feature may differ in this fraction of the examples and still be asked for.",
        LibraryDefault(_TRAINING, "tolerance"),
        min=0.0,
        max=0.5,
    )
    queries: Queries = option(
        "--queries",
        "Keyframe queries from the examples, so that a class is looked for around their hits only: "
        "several that vote are learned by a genetic algorithm (learned), or one of two to five "
        "keyframes is chosen (chosen).",
        Queries.NONE,
    )
    query_runs: int = option(
        "--query-runs",
        "With --queries learned: so many are learned for each class; most of them must agree on a "
        "hit.",
        LibraryDefault(_TRAINING, "query_runs"),
        min=1,
    )
    threshold: float | None = option(
        "--threshold COST", "Largest cost of a match of these classes.", min=0.0, max=1.0
    )
    calibrate: bool = flag(
        "--calibrate",
        "Choose thresholds by cross-validation on the examples, and estimate precision and recall "
        "for motion that is done as the examples are.",
    )
    groups: str | None = option(
        "--groups REGEX",
        "With --calibrate: examples whose names match the same share a fold, such as 'HDM_(..)_' "
        "for actors: the estimates then hold for actors never seen. With --per-group: they have a "
        "template of their own.",
    )
    per_group: bool = flag(
        "--per-group",
        "Beside the template of all examples of a class learn one of each of the --groups: "
        "strangers do as one of several people did, rarely as their mean.",
    )
    negatives: list[str] | None = option(
        "--negatives PATH",
        "With --calibrate: other recordings, without any of these classes, to choose thresholds "
        "against.",
    )

    plot: str | None = option("--plot FOLDER", "Draw the templates.")

    def check(self) -> None:
        """Refuse options that do not go together.

        Raises
        ------
        BadParameter
        """
        if self.calibrate and self.threshold is not None:
            raise wrong("--threshold, --calibrate", "thresholds are given or chosen, not both")
        if self.negatives and not self.calibrate:
            raise wrong("--negatives", "goes with --calibrate")
        if self.groups and not (self.calibrate or self.per_group):
            raise wrong("--groups", "goes with --calibrate or --per-group")
        if self.per_group and not self.groups:
            raise wrong("--per-group", "needs --groups")
        if self.per_group and (self.keep_examples or self.queries is not Queries.NONE):
            raise wrong("--per-group", "goes neither with --keep-examples nor with --queries")

    def training(self) -> "TrainingOptions":
        """The same for the library."""
        from motionary.models.library import TrainingOptions

        training = TrainingOptions(
            tolerance=self.tolerance,
            mirror=self.mirror,
            fold_sides=self.fold_sides,
            keep_examples=self.keep_examples,
            calibrate=self.calibrate,
            groups=self.groups,
            queries=self.queries.value,
            query_runs=self.query_runs,
            per_group=self.per_group,
        )
        return training if self.threshold is None else replace(training, threshold=self.threshold)


def learn(
    options: TrainingFlags,
    examples: Annotated[
        str | None,
        typer.Argument(
            metavar="EXAMPLES",
            help="A folder with one folder per class; or labels of recordings, in any format of "
            "labels (.csv, .xlsx, .eaf, .TextGrid, .c3d ...).",
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="LIB", help="Folder to write the library to."),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    *,
    jobs: Jobs,
    reading: ReadOptions,
) -> int:
    """Learn classes of motion from examples: a folder per class, or a table of times.

    The files in a folder are the examples of its class. Folders in it are ways of doing the
    same, each with a template of its own. A table of times has the columns
    recording,label,start_s,end_s and, if people are known, person.

    With --calibrate each class's threshold is chosen by cross-validation. "precision" is the
    estimated fraction of labels that are right, "recall" that of motions that are labelled, to
    be expected of recordings never seen.

    motionary learn examples/ -o my-classes --mirror
    with examples/squat/one.bvh, examples/squat/two.bvh, examples/kick/one.bvh, ...

    motionary learn times.csv --recordings takes/ -o my-classes

    With --corrections a library learns from what a person changed in its labels, and says what that
    did to precision and recall.

    motionary learn --corrections labels.csv --library my-classes --recordings takes/
    """
    from motionary.models.library import learn as learn_library

    options.check()
    if options.corrections is not None:
        return _learn_corrected(options, examples, output, as_json, jobs=jobs, reading=reading)
    if examples is None or output is None or options.library is not None:
        raise wrong("EXAMPLES", "needs examples and --output; --library goes with --corrections")
    check_library(output, replace=force)
    check_target(options.plot, is_folder=True)
    feature_set = find_feature_set(options.features)
    negatives, has_failed = _read_negatives(options, feature_set, reading, jobs=jobs)
    monitor = ScreenMonitor()
    library = learn_library(
        examples,
        options.training(),
        recordings=options.recordings,
        negatives=negatives,
        reading=reading,
        feature_set=feature_set,
        jobs=jobs,
        monitor=monitor,
    )
    if not library:
        raise InvalidInput("no class could be learned; nothing was written", file=examples)
    library.save(output)
    for motion_class in library if options.plot else ():
        _draw_class(options.plot or "", motion_class, library)
    show_library(library, as_json=as_json)
    return 1 if has_failed or monitor.has_failed else 0


def _learn_corrected(
    options: TrainingFlags,
    examples: str | None,
    output: str | None,
    as_json: bool,
    *,
    jobs: int,
    reading: ReadOptions,
) -> int:
    """Learn from what a person changed in a library's labels."""
    from motionary.cli.relearn import learn_corrected

    if examples is not None or options.library is None:
        raise wrong("--corrections", "needs --library, and no EXAMPLES")
    return learn_corrected(
        options.corrections or "", options.library, output,
        recordings=options.recordings, as_json=as_json, jobs=jobs, reading=reading,
    )  # fmt: skip


def _read_negatives(
    options: TrainingFlags, feature_set: "FeatureSet", reading: ReadOptions, *, jobs: int
) -> "tuple[list[FeatureSequence], bool]":
    """Features of recordings without the classes, and whether one could not be read."""
    found = find_files(options.negatives or (), reading)
    sequences, failures = split_failures(
        measure_files(
            found.files, "reading others", reading=reading, feature_set=feature_set, jobs=jobs
        )
    )
    problems = [*map(str, found.missing.values()), *map(describe_failure, failures)]
    for problem in problems:
        screen.warn(problem)
    return sequences, bool(problems)


def _draw_class(folder: str, motion_class: "MotionClass", library: "ClassLibrary") -> None:
    """Templates of a class and their fixed cells, a picture a template, into a folder."""
    from motionary.plots import plot_template, save

    for prototype in motion_class.prototypes:
        figure = plot_template(
            prototype.template, tolerance=motion_class.tolerance, feature_set=library.feature_set
        )
        name = motion_class.name
        if prototype.name != name:
            name = f"{name}-{prototype.name}"
        save(figure, picture_path(folder, name))


def show_library(library: "ClassLibrary", *, as_json: bool) -> None:
    """The templates of a library, as a table or JSON."""
    columns, rows = library.list_rows()
    described = [dict(zip(columns, row, strict=True)) for row in rows]
    if as_json:
        for row in described:
            screen.print_json(row)
        return
    empty = {key for key in _ESTIMATES if all(row[key] is None for row in described)}
    shown = {key: title for key, title in _COLUMNS.items() if key not in empty}
    cells = [[_cell(key, row[key]) for key in shown] for row in described]
    screen.print_table(tuple(shown.values()), cells)


def _cell(key: str, value: Any) -> str:
    if key in ("fixed", *_ESTIMATES):
        return screen.percent(value)
    return str(value) if not isinstance(value, float) else f"{value:.3g}"
