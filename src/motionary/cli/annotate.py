"""`motionary annotate` and `count`: labels by a library, and how many."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.options import (
    AsJson,
    LabelFile,
    TableFile,
    TableOptions,
    check_target,
    picture_path,
    wrong,
)
from motionary.cli.recordings import find_files, measure_files, warn_of_all
from motionary.cli.workers import WorkOptions
from motionary.files import is_stdout
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.features import FeatureSequence
    from motionary.labels import Label, LabelTrack
    from motionary.models.library import ClassLibrary
    from motionary.retrieval.counting import ClassCount

_COLUMNS = ("recording", "label", ">start_s", ">end_s", ">cost", ">known")
_SCORE_COLUMNS = (">score", ">false/min", ">right")


class AssignmentName(StrEnum):
    """How labels are assigned."""

    SCORES = "scores"
    PUBLISHED = "published"


@dataclass(frozen=True, kw_only=True)
class LabelOptions(TableOptions):
    """What counts as a label, and what is shown of it."""

    output: LabelFile = None
    library: Annotated[
        str,
        typer.Option(
            metavar="LIB",
            help="A folder that `motionary learn` wrote; everyday is the library that ships, "
            "none is none.",
        ),
    ] = "everyday"
    threshold: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="NUMBER",
            help="Largest cost of a match (published), by default each class's own; with "
            "--assignment scores the least score, by default the library's.",
        ),
    ] = None
    assignment: Annotated[
        AssignmentName | None,
        typer.Option(
            help="Labels by what their frames tell for a class against motion in general "
            "(scores), or by the cost of the match (published, 2009). By default scores, unless "
            "the library has none, its thresholds of costs were chosen, or --threshold is given.",
        ),
    ] = None
    at_most_false: Annotated[
        float | None,
        typer.Option(
            metavar="PER_MINUTE",
            help="By scores, with the threshold at which so many false labels are expected in a "
            "minute of motion without right ones; for the library that ships, and those that "
            "were learned with --calibrate --negatives.",
        ),
    ] = None
    plot: Annotated[
        str | None,
        typer.Option(
            metavar="FOLDER",
            help="Draw each recording's labels, with the distances that assigned them.",
        ),
    ] = None
    thorough: Annotated[
        bool,
        typer.Option("--thorough", help="Match everywhere, also where a class has keyframes."),
    ] = False
    count: Annotated[
        bool,
        typer.Option("--count", help="Count labels by recording, class and side instead."),
    ] = False
    explain: Annotated[
        bool, typer.Option("--explain", help="Say of each label which features held and failed.")
    ] = False

    @property
    def holds_labels(self) -> bool:
        """Whether the results are labels; counts are a table."""
        return not self.count

    def check(self, *, as_json: bool) -> None:
        """Refuse options that do not go together, and tables that cannot be written.

        Raises
        ------
        BadParameter, UnwritableFile
        """
        super().check(as_json=as_json)
        if self.at_most_false is None:
            return
        if self.threshold is not None:
            raise wrong("--threshold, --at-most-false", "give one, not both")
        if self.assignment is AssignmentName.PUBLISHED:
            raise wrong("--at-most-false", "goes with --assignment scores")
        if self.at_most_false <= 0:
            raise wrong("--at-most-false", f"must be above 0, got {self.at_most_false:g}")

    def assigns_by_scores(self, library: "ClassLibrary") -> bool:
        """Whether labels of this library are assigned by scores."""
        from motionary.retrieval.annotation import default_assignment

        if self.at_most_false is not None or self.assignment is not None:
            return self.assignment is not AssignmentName.PUBLISHED
        given = self.threshold is not None or self.thorough
        return not given and default_assignment(library) == "scores"


def annotate(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE", help="Files, folders or patterns to label.")
    ],
    options: LabelOptions,
    as_json: AsJson = False,
    *,
    work: WorkOptions,
    reading: ReadOptions,
) -> int:
    """Label recordings with the classes of a library, by default that of everyday motion.

    A recording without a label says which class came nearest, and what failed.

    motionary annotate long.bvh
    motionary annotate takes/*.amc --library my-classes -o labels.csv --explain
    motionary annotate takes/*.amc --library my-classes --assignment scores --count
    """
    from motionary.batch import Failure
    from motionary.io import write_labels
    from motionary.io.labels import check_label_file

    options.check(as_json=as_json)
    library = _library(options)
    found = find_files(files, reading)
    if options.output and not options.count:
        check_label_file(options.output, several=len(found.files) > 1)
    failures, tracks = [], []
    with work.open() as workers:
        for sequence in measure_files(
            work.find(found.files), "labelling", reading=reading,
            feature_set=library.feature_set, jobs=workers,
        ):  # fmt: skip
            if isinstance(sequence, Failure):
                failures.append(sequence)
                continue
            tracks.append(_label(sequence, library, options))
            if as_json and not options.count:
                screen.print_json(_to_json(tracks[-1], explained=options.explain))
    if options.count:
        _show_counts(tracks, output=options.output, excel=options.excel, as_json=as_json)
    elif options.output:
        write_labels(tracks, options.output, excel=options.excel)
    if not (as_json or options.count or options.takes_stdout):
        _say(tracks, explained=options.explain)
    failed = warn_of_all(found.missing.values(), failures, given=files)
    return 1 if failed else 0


def _library(options: LabelOptions) -> "ClassLibrary":
    """The library, before anything is read: what is wrong with the use shows at once."""
    from motionary.models.library import NO_LIBRARY, open_library

    if options.library == NO_LIBRARY:
        raise wrong(
            "--library",
            "needs a library of motion classes to look for; learn one from examples with "
            "`motionary learn EXAMPLES -o LIB`, then pass --library LIB; everyday ships",
        )
    if Path(options.plot or "").suffix.lower() in (".png", ".svg", ".pdf"):
        raise wrong("--plot", f"needs a folder, for a picture a recording, got {options.plot}")
    check_target(options.plot, is_folder=True)
    return open_library(options.library)


def _label(
    sequence: "FeatureSequence", library: "ClassLibrary", options: LabelOptions
) -> "LabelTrack":
    """Labels of a recording; drawn, below the distances that assigned them, if asked for."""
    from motionary.models.library import format_thresholds
    from motionary.retrieval.annotation import annotate_fully

    by_scores, given = options.assigns_by_scores(library), options.threshold
    track, found, _ = annotate_fully(
        sequence,
        library,
        assignment="scores" if by_scores else "published",
        threshold=given,
        at_most_false_per_min=options.at_most_false,
        preselect=not options.thorough,
    )
    if options.plot:
        from motionary.plots import plot_annotation, save

        note = ""
        if by_scores:
            least = format_thresholds(library, options.at_most_false, given=given)
            note = f"least score {least}"
        distances = {name: distance.modified for name, distance in found.items()}
        # Scores have no distances, and a library may have many classes that do not occur.
        classes = library.names if distances else None
        figure = plot_annotation(track, distances=distances, classes=classes, note=note)
        save(figure, picture_path(options.plot, track.recording.name))
    return track


def _to_json(track: "LabelTrack", *, explained: bool) -> dict[str, Any]:
    from motionary.retrieval.explanation import explain

    keys = (
        "start_s", "end_s", "start_frame", "end_frame", "cost", "known", "score", "probability",
        "false_per_min", "side",
    )  # fmt: skip
    labels = []
    for label in track:
        shown: dict[str, Any] = {"label": label.name}
        shown |= {key: getattr(label, key) for key in keys}
        if explained:
            shown["explanation"] = str(explain(label))
        labels.append(shown)
    return {
        "recording": track.recording.name,
        "rate_hz": track.rate_hz,
        "labels": labels,
        "unassessed": [{"start_s": start, "end_s": end} for start, end in track.unassessed],
        "nearest": track.nearest or None,
    }


def _say(tracks: "Sequence[LabelTrack]", *, explained: bool) -> None:
    from motionary.retrieval.explanation import explain

    labels = [label for track in tracks for label in track]
    columns: tuple[str, ...] = _COLUMNS
    if any(label.score is not None for label in labels):
        has_rates = any(label.false_per_min is not None for label in labels)
        is_known = any(label.probability is not None for label in labels)
        shown = 3 if is_known else 2 if has_rates else 1
        columns = (*_COLUMNS, *_SCORE_COLUMNS[:shown])
    rows: list[tuple[str, ...]] = []
    below: dict[int, str] = {}
    for track in tracks:
        for label in track:
            if explained:
                below[len(rows)] = str(explain(label))
            rows.append((track.recording.name, *_cells(label))[: len(columns)])
        for start_s, end_s in track.unassessed:
            times = (f"{start_s:.2f}", f"{end_s:.2f}")
            rows.append(_fill((track.recording.name, "(too little seen)", *times), columns))
        if not len(track):
            below[len(rows)] = track.nearest
            rows.append(_fill((track.recording.name, "(none)"), columns))
    if rows:
        screen.print_table(columns, rows, below=below)


def _fill(cells: tuple[str, ...], columns: Sequence[str]) -> tuple[str, ...]:
    """A row with empty cells at its end."""
    return (*cells, *[""] * (len(columns) - len(cells)))


def _cells(label: "Label") -> tuple[str, ...]:
    cost = "" if label.cost is None else f"{label.cost:.3f}"
    times = f"{label.start_s:.2f}", f"{label.end_s:.2f}"
    score = "" if label.score is None else f"{label.score:.1f}"
    rate = "" if label.false_per_min is None else f"{label.false_per_min:.2g}"
    right = "" if label.probability is None else screen.percent(label.probability)
    return (label.name, *times, cost, screen.percent(label.known), score, rate, right)


# -- motionary count ----------------------------------------------------------------------


_COUNT_COLUMNS = (
    "recording", "label", "side", ">number", ">mean_s", ">total_s", ">per_min", ">unassessed_s",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class CountOptions(LabelOptions):
    """Options of labels whose counts are wanted."""

    output: TableFile = None
    count: Annotated[bool, typer.Option("--count", hidden=True)] = True


def count(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE", help="Files, folders or patterns to count in.")
    ],
    options: CountOptions,
    as_json: AsJson = False,
    *,
    work: WorkOptions,
    reading: ReadOptions,
) -> int:
    """Count repetitions by recording, class and side; options are those of annotate.

    "per_min" is the number of repetitions a minute by the usual time from one start to the
    next, "unassessed_s" the seconds of which too little was seen to judge.

    motionary count training.c3d --library exercises -o counts.csv
    """
    return annotate(files, options, as_json, work=work, reading=reading)


def _show_counts(
    tracks: "Sequence[LabelTrack]", *, output: str | None, excel: bool, as_json: bool
) -> None:
    """Counts as a table or JSON, and as a file if one is named."""
    from motionary.io.text import write_table
    from motionary.retrieval.counting import count as count_labels

    counts = count_labels(tracks)
    rows = [_to_row(one) for one in counts]
    if output:
        columns = [name.lstrip(">") for name in _COUNT_COLUMNS]
        table = [[row[name] for name in columns] for row in rows]
        write_table([columns, *table], Path(output), excel=excel)
    if output and is_stdout(output):
        return
    if as_json:
        for one, row in zip(counts, rows, strict=True):
            times = {"starts_s": list(one.starts_s), "durations_s": list(one.durations_s)}
            screen.print_json(row | times)
        return
    shown = [tuple(_format(cell) for cell in row.values()) for row in rows]
    counted = {one.recording for one in counts}
    for track in tracks:
        if track.recording.name not in counted:
            shown.append(_fill((track.recording.name, "(none)"), _COUNT_COLUMNS))
    if shown:
        screen.print_table(_COUNT_COLUMNS, shown)


def _to_row(one: "ClassCount") -> dict[str, Any]:
    return {
        "recording": one.recording,
        "label": one.name,
        "side": one.side,
        "number": one.number,
        "mean_s": one.mean_s,
        "total_s": one.total_s,
        "per_min": one.per_min,
        "unassessed_s": one.unassessed_s,
    }


def _format(cell: Any) -> str:
    if cell is None:
        return ""
    return f"{cell:.2f}" if isinstance(cell, float) else str(cell)
