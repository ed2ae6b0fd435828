"""`motionary learn`: classes of motion from examples, or from labels of recordings."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from motionary.cli import screen
from motionary.cli.options import (
    AsJson,
    FeatureSetName,
    Force,
    Jobs,
    LibraryDefault,
    argument,
    check_library,
    check_target,
    find_feature_set,
    flag,
    option,
    picture_path,
    wrong,
)
from motionary.cli.recordings import (
    describe_failure,
    find_files,
    measure_all,
    open_library,
    warn_of_all,
)
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.evaluation import Rates
    from motionary.models.library import (
        ClassLibrary,
        LabelledSequences,
        MotionClass,
        Notice,
        Prototype,
        ReadExamples,
        TrainingOptions,
    )
    from motionary.retrieval.corrections import Corrections

_CHANGES = ("kept", "moved", "renamed", "added", "removed")
_ESTIMATES = {"promised_precision": ">precision", "promised_recall": ">recall"}
_COLUMNS = {
    "class": "class", "template": "template", "examples": ">examples", "columns": ">columns",
    "seconds": ">seconds", "fixed": ">fixed", "threshold": ">threshold", **_ESTIMATES,
}  # fmt: skip
_TRAINING = "motionary.models.library:TrainingOptions"


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
    queries: Literal["none", "learned", "chosen"] = option(
        "--queries",
        "Keyframe queries from the examples, so that a class is looked for around their hits only: "
        "several that vote are learned by a genetic algorithm (learned), or one of two to five "
        "keyframes is chosen (chosen).",
        "none",
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
    output: str | None = option("--output -o LIB", "Folder to write the library to.")
    force: Force = False

    def check(self) -> None:
        """Refuse options that do not go together."""
        if self.calibrate and self.threshold is not None:
            raise wrong("--threshold, --calibrate", "thresholds are given or chosen, not both")
        if self.negatives and not self.calibrate:
            raise wrong("--negatives", "goes with --calibrate")
        if self.groups and not (self.calibrate or self.per_group):
            raise wrong("--groups", "goes with --calibrate or --per-group")
        if self.per_group and not self.groups:
            raise wrong("--per-group", "needs --groups")
        if self.per_group and (self.keep_examples or self.queries != "none"):
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
            queries=self.queries,
            query_runs=self.query_runs,
            per_group=self.per_group,
        )
        return training if self.threshold is None else replace(training, threshold=self.threshold)


def learn(
    options: TrainingFlags,
    examples: Annotated[
        str | None,
        argument(
            "EXAMPLES",
            "A folder with one folder per class; or labels of recordings, in any format of labels "
            "(.csv, .xlsx, .eaf, .TextGrid, .c3d ...).",
        ),
    ] = None,
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
    options.check()
    if options.corrections is None:
        return _learn_examples(options, examples, as_json, jobs=jobs, reading=reading)
    if examples is not None or options.library is None:
        raise wrong("--corrections", "needs --library, and no EXAMPLES")
    return _learn_corrected(options, options.library, as_json, jobs=jobs, reading=reading)


def _learn_examples(
    options: TrainingFlags, examples: str | None, as_json: bool, *, jobs: int, reading: ReadOptions
) -> int:
    """Learn a new library from examples."""
    from motionary.models.library import learn as learn_library

    if examples is None or options.output is None or options.library is not None:
        raise wrong("EXAMPLES", "needs examples and --output; --library goes with --corrections")
    check_library(options.output, replace=options.force)
    check_target(options.plot, is_folder=True)
    feature_set = find_feature_set(options.features)
    found, monitor = find_files(options.negatives or (), reading), ScreenMonitor()
    negatives, failures = measure_all(
        found, "reading others", reading=reading, feature_set=feature_set, jobs=jobs
    )
    for problem in (*map(str, found.missing.values()), *map(describe_failure, failures)):
        screen.warn(problem)
    library = learn_library(
        examples, options.training(), recordings=options.recordings, negatives=negatives,
        reading=reading, feature_set=feature_set, jobs=jobs, monitor=monitor,
    )  # fmt: skip
    if not library:
        raise InvalidInput("no class could be learned; nothing was written", file=examples)
    library.save(options.output)
    for motion_class in library if options.plot else ():
        for prototype in motion_class.prototypes:
            parts = dict.fromkeys((motion_class.name, prototype.name))
            picture = picture_path(options.plot or "", "-".join(parts))
            draw_prototype(picture, library, motion_class, prototype)
    show_library(library, as_json=as_json)
    return 1 if found.missing or failures or monitor.has_failed else 0


@dataclass
class ScreenMonitor:
    """Training on the screen: bars, and what a person should know of.

    Attributes
    ----------
    has_failed : whether something that was given could not be used
    """

    has_failed: bool = field(default=False, init=False)

    def stage(self, name: str, total: int) -> AbstractContextManager[Callable[..., None]]:
        """A bar."""
        return screen.progress(name, total)

    def notify(self, notice: "Notice") -> None:
        """Say it on stderr."""
        from motionary.batch import Failure

        self.has_failed = self.has_failed or notice.is_failure
        if notice.file is not None and notice.error is not None:
            warn_of_all((), [Failure(notice.file, notice.error)])
        else:
            screen.warn(notice.text)


def draw_prototype(
    path: "str | Path",
    library: "ClassLibrary",
    motion_class: "MotionClass",
    prototype: "Prototype",
    *,
    marks: Any = None,
) -> None:
    """Draw a template and its fixed cells beside it; `marks` are what it tells tracks."""
    from motionary.plots import plot_template, save

    figure = plot_template(
        prototype.template, tolerance=motion_class.tolerance, feature_set=library.feature_set,
        marks=marks,
    )  # fmt: skip
    save(figure, path)


def show_library(library: "ClassLibrary", *, as_json: bool) -> None:
    """The templates of a library, as a table or JSON."""
    columns, rows = library.list_rows()
    described = [dict(zip(columns, row, strict=True)) for row in rows]
    if as_json:
        screen.print_json(*described)
        return
    empty = {key for key in _ESTIMATES if all(row[key] is None for row in described)}
    shown = {key: title for key, title in _COLUMNS.items() if key not in empty}
    cells = [[_cell(key, row[key]) for key in shown] for row in described]
    screen.print_table(tuple(shown.values()), cells)


def _cell(key: str, value: Any) -> str:
    if key in ("fixed", *_ESTIMATES):
        return screen.percent(value)
    return str(value) if not isinstance(value, float) else f"{value:.3g}"


# -- corrections ------------------------------------------------------------------------


def _learn_corrected(
    options: TrainingFlags, folder: str, as_json: bool, *, jobs: int, reading: ReadOptions
) -> int:
    """Let a library learn from its labels as a person left them, and say what that did."""
    from motionary.models.library import find_sequences, list_tracks
    from motionary.retrieval.corrections import learn_corrections

    table = options.corrections or ""
    target = folder if options.output is None else options.output
    check_library(target, replace=True)
    library = open_library(folder)
    tracks = list_tracks(table, reading)
    with screen.progress("reading", len(tracks)) as done:
        found = find_sequences(
            tracks, options.recordings or Path(table).parent, reading=reading,
            feature_set=library.feature_set, jobs=jobs, on_done=done,
        )  # fmt: skip
    code = warn_of_unused(found)
    if not found.pairs:
        raise InvalidInput("none of its recordings could be read; nothing was changed", file=table)
    corrections = learn_corrections(library, found.pairs)
    if corrections.n_changed:
        corrections.library.save(target)
    else:
        screen.warn("the labels are as the library gives them; nothing was changed")
    _show_corrections(corrections, as_json=as_json)
    return code


def warn_of_unused(read: "ReadExamples | LabelledSequences") -> int:
    """Say what of labelled recordings gives no example; the code that a command ends with."""
    warn_of_all((), read.failures)
    for error in read.unusable:
        screen.warn(str(error))
    return 1 if read.failures or read.unusable else 0


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
        screen.print_json(*rows)
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
