"""`motionary annotate` and `count`: labels by a library, and how many."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from motionary.cli import screen
from motionary.cli.index import IndexOptions, open_recordings
from motionary.cli.options import (
    PICTURES,
    AsJson,
    LabelFile,
    TableFile,
    TableOptions,
    argument,
    check_target,
    flag,
    option,
    picture_path,
    wrong,
)
from motionary.cli.recordings import WorkOptions, find_files, measure_files, open_library
from motionary.files import is_stdout
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.features import FeatureSequence
    from motionary.labels import Label, LabelTrack
    from motionary.models.library import ClassLibrary


_COLUMNS = ("recording", "label", ">start_s", ">end_s", ">cost", ">known")
_SCORE_COLUMNS = (">score", ">false/min", ">right")
_COUNT_COLUMNS = (
    "recording", "label", "side", ">number", ">mean_s", ">total_s", ">per_min", ">unassessed_s",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class LabelOptions(TableOptions):
    """What counts as a label, and what is shown of it."""

    output: LabelFile = None
    library: str = option(
        "--library LIB",
        "A folder that `motionary learn` wrote; everyday is the library that ships, none is none.",
        "everyday",
    )
    threshold: float | None = option(
        "--threshold NUMBER",
        "Largest cost of a match (published), by default each class's own; with --assignment "
        "scores the least score, by default the library's.",
        min=0.0,
    )
    assignment: Literal["scores", "published"] | None = option(
        "--assignment",
        "Labels by what their frames tell for a class against motion in general (scores), or by "
        "the cost of the match (published, 2009). By default scores, unless the library has none, "
        "its thresholds of costs were chosen, or --threshold is given.",
    )
    at_most_false: float | None = option(
        "--at-most-false PER_MINUTE",
        "By scores, with the threshold at which so many false labels are expected in a minute of "
        "motion without right ones; for the library that ships, and those that were learned with "
        "--calibrate --negatives.",
    )
    plot: str | None = option(
        "--plot FOLDER", "Draw each recording's labels, with the distances that assigned them."
    )
    thorough: bool = flag("--thorough", "Match everywhere, also where a class has keyframes.")
    count: bool = flag("--count", "Count labels by recording, class and side instead.")
    index: str | None = option(
        "--index PATH",
        "Index of the files, as `motionary index` makes it: what it has of them is not read again, "
        "and --jobs and --scheduler label, too.",
    )
    explain: bool = flag("--explain", "Say of each label which features held and failed.")

    @property
    def holds_labels(self) -> bool:
        """Whether the results are labels; counts are a table."""
        return not self.count

    def check(self, *, as_json: bool) -> None:
        """Refuse options that do not go together, and tables that cannot be written."""
        super().check(as_json=as_json)
        threshold = self.threshold
        if threshold is not None and threshold > 1 and self.assignment != "scores":
            raise wrong(
                "--threshold",
                f"costs are at most 1, so {threshold:g} leaves nothing out; for a least score add "
                "--assignment scores",
            )
        if self.at_most_false is None:
            return
        if self.threshold is not None:
            raise wrong("--threshold, --at-most-false", "give one, not both")
        if self.assignment == "published":
            raise wrong("--at-most-false", "goes with --assignment scores")
        if self.at_most_false <= 0:
            raise wrong("--at-most-false", f"must be above 0, got {self.at_most_false:g}")

    def assigning(self) -> dict[str, Any]:
        """How labels are assigned, as the library takes it."""
        assignment = self.assignment
        if self.thorough and assignment is None and self.at_most_false is None:
            # Everywhere or around keyframes: only costs know the difference.
            assignment = "published"
        return {
            "assignment": assignment,
            "threshold": self.threshold,
            "at_most_false_per_min": self.at_most_false,
            "preselect": not self.thorough,
        }

    def check_number(self, n_recordings: int) -> None:
        """Refuse a file that holds labels of one recording for those of several."""
        if self.output and not self.count:
            from motionary.io.labels import check_label_file

            check_label_file(self.output, several=n_recordings > 1)


def annotate(
    files: Annotated[list[str], argument("FILE", "Files, folders or patterns to label.")],
    options: LabelOptions,
    as_json: AsJson = False,
    *,
    work: WorkOptions,
    reading: ReadOptions,
) -> int:
    """Label recordings with the classes of a library, by default that of everyday motion.

    A recording without a label says which class came nearest, and what failed. By scores,
    "false/min" is the number of false labels to expect in a minute of motion from that score on,
    "right" the estimated probability that the label is right.

    motionary annotate long.bvh
    motionary annotate takes/*.amc --library my-classes -o labels.csv --explain
    motionary annotate takes/*.amc --library my-classes --assignment scores --count
    motionary annotate /archive --index /archive-index -o labels.csv --jobs 4
    """
    from motionary.io import write_labels

    options.check(as_json=as_json)
    library = _library(options)
    tracks: list[LabelTrack] = []

    def keep(track: "LabelTrack") -> None:
        tracks.append(track)
        if as_json and not options.count:
            _say_json(track, explained=options.explain)

    label = _label_files if options.index is None else _label_index
    code = label(files, library, options, keep, work=work, reading=reading)
    if options.count:
        _show_counts(tracks, output=options.output, excel=options.excel, as_json=as_json)
    elif options.output:
        write_labels(tracks, options.output, excel=options.excel)
    if not (as_json or options.count or options.takes_stdout):
        _say_tracks(tracks, explained=options.explain)
    return code


def _label_files(
    files: Sequence[str],
    library: "ClassLibrary",
    options: LabelOptions,
    keep: "Callable[[LabelTrack], None]",
    *,
    work: WorkOptions,
    reading: ReadOptions,
) -> int:
    """Label what files hold; the exit code."""
    from motionary.batch import Failure

    found = find_files(files, reading)
    options.check_number(len(found.files))
    failures = []
    with work.open() as workers:
        for sequence in measure_files(
            found.files, "labelling", reading=reading,
            feature_set=library.feature_set, jobs=workers,
        ):  # fmt: skip
            if isinstance(sequence, Failure):
                failures.append(sequence)
            else:
                keep(_label(sequence, library, options))
    return found.warn(failures)


def _label_index(
    files: Sequence[str],
    library: "ClassLibrary",
    options: LabelOptions,
    keep: "Callable[[LabelTrack], None]",
    *,
    work: WorkOptions,
    reading: ReadOptions,
) -> int:
    """Label what an index has of files, which are read where they are new; the exit code."""
    from motionary.retrieval.annotation import annotate_collection

    _check_set(files, library, options.index, reading)
    with work.open() as workers:
        opened, code = open_recordings(
            files, IndexOptions(index=options.index),
            reading=reading, feature_set=library.feature_set, jobs=workers,
        )  # fmt: skip
        collection = opened.collection
        options.check_number(len(collection))
        tracks: Iterable[LabelTrack]
        if options.plot:
            tracks = map(partial(_label, library=library, options=options), collection.sequences)
        else:
            tracks = annotate_collection(
                collection, library, **options.assigning(),
                explainable=options.explain, jobs=workers,
            )  # fmt: skip
        with screen.progress("labelling", len(collection)) as done:
            for track in tracks:
                keep(track)
                done(track)
    return code


def _check_set(
    files: Sequence[str], library: "ClassLibrary", place: str | None, reading: ReadOptions
) -> None:
    """Refuse an index of the published features alone for a library over more."""
    from motionary.retrieval.index import Index

    needed = library.feature_set
    held = Index.choose_set(files, needed, at=place, reading=reading)
    if len(held) < len(needed):
        raise wrong(
            "--index",
            f"{place} is an index of the {len(held)} published features, the library needs the "
            f"{len(needed)} of {needed.name}; name another place, where an index of these is made",
        )


def _library(options: LabelOptions) -> "ClassLibrary":
    """The library, before anything is read: what is wrong with the use shows at once."""
    from motionary.models.library import NO_LIBRARY

    if options.library == NO_LIBRARY:
        raise wrong(
            "--library",
            "needs a library of motion classes to look for; learn one from examples with "
            "`motionary learn EXAMPLES -o LIB`, then pass --library LIB; everyday ships",
        )
    if Path(options.plot or "").suffix.lower() in PICTURES:
        raise wrong("--plot", f"needs a folder, for a picture a recording, got {options.plot}")
    check_target(options.plot, is_folder=True)
    return open_library(options.library)


def _label(
    sequence: "FeatureSequence", library: "ClassLibrary", options: LabelOptions
) -> "LabelTrack":
    """Labels of a recording; drawn, below the distances that assigned them, if asked for."""
    from motionary.models.library import format_thresholds
    from motionary.retrieval.annotation import annotate_fully

    track, found, _ = annotate_fully(sequence, library, **options.assigning())
    if options.plot:
        from motionary.plots import plot_annotation, save

        distances = {name: distance.modified for name, distance in found.items()}
        # Scores have no distances, and a library may have many classes that do not occur.
        classes, note = (library.names, "") if distances else (None, "least score ")
        if not distances:
            note += format_thresholds(library, options.at_most_false, given=options.threshold)
        figure = plot_annotation(track, distances=distances, classes=classes, note=note)
        save(figure, picture_path(options.plot, track.recording.name))
    return track


# -- motionary count ----------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class CountOptions(LabelOptions):
    """Options of labels whose counts are wanted."""

    output: TableFile = None
    count: Annotated[bool, typer.Option("--count", hidden=True)] = True


def count(
    files: Annotated[list[str], argument("FILE", "Files, folders or patterns to count in.")],
    options: CountOptions,
    as_json: AsJson = False,
    *,
    work: WorkOptions,
    reading: ReadOptions,
) -> int:
    """Count repetitions by recording, class and side; options are those of annotate.

    "per_min" is the number of repetitions a minute by the usual time from one start to the
    next, "unassessed_s" the seconds of which too little was seen to judge. "side", of a class
    that knows its mirror image: "as learned" like its examples, or "mirrored".

    motionary count training.c3d --library exercises -o counts.csv
    """
    return annotate(files, options, as_json, work=work, reading=reading)


# -- labels and counts printed -----------------------------------------------------------


def _say_json(track: "LabelTrack", *, explained: bool) -> None:
    """Print the JSON object of a recording."""
    from motionary.retrieval.explanation import explain

    keys = (
        "start_s", "end_s", "start_frame", "end_frame", "cost", "known", "score", "probability",
        "false_per_min", "side",
    )  # fmt: skip
    labels = []
    for label in track:
        shown = {"label": label.name} | {key: getattr(label, key) for key in keys}
        labels.append(shown | {"explanation": str(explain(label))} if explained else shown)
    unassessed = [{"start_s": start, "end_s": end} for start, end in track.unassessed]
    screen.print_json(
        {
            "recording": track.recording.name, "rate_hz": track.rate_hz, "labels": labels,
            "unassessed": unassessed, "nearest": track.nearest or None,
        }
    )  # fmt: skip


def _say_tracks(tracks: "Sequence[LabelTrack]", *, explained: bool) -> None:
    """Print the labels of recordings, and what came nearest where there are none."""
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
            rows.append((track.recording.name, "(too little seen)", *times))
        if not len(track):
            below[len(rows)] = track.nearest
            rows.append((track.recording.name, "(none)"))
    if rows:
        screen.print_table(columns, rows, below=below)


def _cells(label: "Label") -> tuple[str, ...]:
    times = f"{label.start_s:.2f}", f"{label.end_s:.2f}"
    cost, score = screen.cell(label.cost, digits=3), screen.cell(label.score, digits=1)
    rate = "" if label.false_per_min is None else f"{label.false_per_min:.2g}"
    known, right = screen.percent(label.known), screen.percent(label.probability)
    return (label.name, *times, cost, known, score, rate, right)


def _show_counts(
    tracks: "Sequence[LabelTrack]", *, output: str | None, excel: bool, as_json: bool
) -> None:
    """Counts as a table or JSON, and as a file if one is named."""
    from motionary.io.text import write_table
    from motionary.labels import count as count_labels

    counts = count_labels(tracks)
    rows: list[Any] = list(counts.list_rows().rows)
    columns = [name.lstrip(">") for name in _COUNT_COLUMNS]
    if output:
        write_table([columns, *rows], Path(output), excel=excel)
    if output and is_stdout(output):
        return
    if as_json:
        for one, row in zip(counts, rows, strict=True):
            times = {"starts_s": list(one.starts_s), "durations_s": list(one.durations_s)}
            screen.print_json(dict(zip(columns, row, strict=True)) | times)
        return
    shown = [tuple(screen.cell(cell, digits=2) for cell in row) for row in rows]
    counted = {one.recording for one in counts}
    for track in tracks:
        if track.recording.name not in counted:
            shown.append((track.recording.name, "(none)"))
    if shown:
        screen.print_table(_COUNT_COLUMNS, shown)
