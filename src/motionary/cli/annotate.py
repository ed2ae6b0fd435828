"""`motionary annotate` and `count`: labels by a library, and how many."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.index import IndexOptions, open_recordings
from motionary.cli.options import (
    AsJson,
    LabelFile,
    TableFile,
    TableOptions,
    check_target,
    picture_path,
    wrong,
)
from motionary.cli.recordings import WorkOptions, find_files, measure_files, warn_of_all
from motionary.cli.tracks import say_json, say_tracks, show_counts
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.features import FeatureSequence
    from motionary.labels import LabelTrack
    from motionary.models.library import ClassLibrary


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
    index: Annotated[
        str | None,
        typer.Option(
            metavar="PATH",
            help="Index of the files, as `motionary index` makes it: what it has of them is not "
            "read again, and --jobs and --scheduler label, too.",
        ),
    ] = None
    explain: Annotated[
        bool, typer.Option("--explain", help="Say of each label which features held and failed.")
    ] = False

    @property
    def holds_labels(self) -> bool:
        """Whether the results are labels; counts are a table."""
        return not self.count

    def check(self, *, as_json: bool) -> None:
        """Refuse options that do not go together, and tables that cannot be written."""
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

    def assigning(self, library: "ClassLibrary") -> dict[str, Any]:
        """How labels are assigned, as the library takes it."""
        return {
            "assignment": "scores" if self.assigns_by_scores(library) else "published",
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
    motionary annotate /archive --index /archive-index -o labels.csv --jobs 4
    """
    from motionary.io import write_labels

    options.check(as_json=as_json)
    library = _library(options)
    tracks: list[LabelTrack] = []

    def keep(track: "LabelTrack") -> None:
        tracks.append(track)
        if as_json and not options.count:
            say_json(track, explained=options.explain)

    label = _label_files if options.index is None else _label_index
    code = label(files, library, options, keep, work=work, reading=reading)
    if options.count:
        show_counts(tracks, output=options.output, excel=options.excel, as_json=as_json)
    elif options.output:
        write_labels(tracks, options.output, excel=options.excel)
    if not (as_json or options.count or options.takes_stdout):
        say_tracks(tracks, explained=options.explain)
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
    return 1 if warn_of_all(found.missing.values(), failures, given=files) else 0


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
                collection, library, **options.assigning(library),
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

    track, found, _ = annotate_fully(sequence, library, **options.assigning(library))
    if options.plot:
        from motionary.plots import plot_annotation, save

        note = ""
        if options.assigns_by_scores(library):
            least = format_thresholds(library, options.at_most_false, given=options.threshold)
            note = f"least score {least}"
        distances = {name: distance.modified for name, distance in found.items()}
        # Scores have no distances, and a library may have many classes that do not occur.
        classes = library.names if distances else None
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
