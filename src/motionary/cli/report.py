"""`motionary report` and `render`: recordings over their labels, as a page or a moving picture."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from motionary.cli import screen
from motionary.cli.labels import RecordingsOf
from motionary.cli.options import (
    REQUIRED,
    Force,
    InFrames,
    LibraryDefault,
    argument,
    check_page,
    check_target,
    flag,
    option,
    wrong,
)
from motionary.cli.query import Start, Stop, check_part
from motionary.cli.recordings import Found, find_files, open_library, read_motions, read_recording
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions
from motionary.tables import enumerate_names

if TYPE_CHECKING:
    from motionary.batch import Failure
    from motionary.features import NamedFile
    from motionary.labels import LabelTrack
    from motionary.motion import Motion


@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """What a page shows beside the motions, and where it goes."""

    output: str = option("--output -o HTML", "The page to write.", REQUIRED)
    labels: list[str] | None = option(
        "--labels CSV",
        "Labels to show; each table is a lane under its file's name. May be repeated.",
    )
    truth: str | None = option("--truth CSV", "True labels, beside the others.")
    library: str | None = option(
        "--library LIB",
        "Label with the classes of a library, too: labels then say why, over curves.",
    )
    keep_hz: float = option(
        "--keep HZ",
        "Most frames a second that the page keeps.",
        LibraryDefault("motionary.reporting:report", "rate_hz"),
    )
    frames: InFrames = False
    compare: bool = flag(
        "--compare", "Play two recordings in step, and say where the second differs from the first."
    )
    force: Force = False


def report(
    files: Annotated[list[str], argument("RECORDING", "Files, folders or patterns to show.")],
    options: PageOptions,
    *,
    reading: ReadOptions,
) -> int:
    """Write a page that plays recordings over their labels, features and reasons.

    One file that opens in any browser without a network. It holds positions, labels and the
    recordings' names, no folders.

    motionary report take.bvh --labels labels.csv --truth truth.csv -o take.html
    motionary report takes/*.amc --library my-classes -o takes.html
    motionary report right.c3d wrong.c3d --compare -o compared.html
    """
    check_page("--output", options.output, replace=options.force)
    found = find_files(files, reading)
    make = _compare if options.compare else _report
    return make(found, options, reading)


def _compare(found: Found, options: PageOptions, reading: ReadOptions) -> int:
    """The page of two recordings, in the order in which they were given."""
    from motionary.reporting import report_comparison

    if options.labels or options.truth or options.library:
        raise wrong("--compare", "goes without --labels, --truth and --library")
    for error in found.missing.values():
        raise error
    places = [Path(file).absolute() for file in found.given]
    named = {path.absolute(): name for name, path in found.files.items()}
    if len(places) != 2 or set(named) != set(places):
        raise wrong("--compare", f"takes two files, got {len(found.files)}")
    reference, other = (read_recording(place, reading).renamed(named[place]) for place in places)
    report_comparison(reference, other, options.output, rate_hz=options.keep_hz)
    screen.say_size(options.output)
    return 0


def _report(found: Found, options: PageOptions, reading: ReadOptions) -> int:
    """The page of recordings over their labels."""
    from motionary.io import read_labels
    from motionary.reporting import report as write_report

    read = partial(
        read_labels, rate_hz=reading.rate_hz, in_frames=options.frames,
        recordings=RecordingsOf(found.files, reading),
    )  # fmt: skip
    tables = {name: read(path) for name, path in _name_tables(options.labels or []).items()}
    truth = read(options.truth) if options.truth is not None else None
    classes = open_library(options.library) if options.library is not None else None
    failures: list[Failure[NamedFile]] = []
    motions = _keep_failures(read_motions(found.files, reading), failures)
    first = next(motions, None)
    if first is not None:
        write_report(
            chain([first], motions), options.output,
            truth=truth, lanes=tables, library=classes, rate_hz=options.keep_hz,
        )  # fmt: skip
        screen.say_size(options.output)
    return found.warn(failures)


def _name_tables(paths: Sequence[str]) -> dict[str, str]:
    """Tables by the names of their lanes; equal names are numbered."""
    tables: dict[str, str] = {}
    for path in paths:
        stem = Path(path).stem
        names = chain((stem,), (f"{stem} {number}" for number in count(2)))
        tables[next(name for name in names if name not in tables)] = path
    return tables


def _keep_failures(
    items: "Iterable[Motion | Failure[NamedFile]]", failures: "list[Failure[NamedFile]]"
) -> "Iterator[Motion]":
    """Motions one after the other; files that cannot be read are kept as failures."""
    from motionary.batch import Failure

    for item in items:
        if isinstance(item, Failure):
            failures.append(item)
        else:
            yield item


# -- render -----------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """What of a recording is drawn, and where it goes."""

    output: str = option("--output -o FILE", "A .gif, or .mp4 by ffmpeg.", REQUIRED)
    labels: str | None = option("--labels LABELS", "Labels to show below, in any format.")
    start: Start = None
    stop: Stop = None
    pictures: float = option("--pictures HZ", "Pictures a second.", 12.5, min=1.0, max=120.0)
    dpi: int = option("--dpi", "Pixels an inch: 100 is about 480 wide.", 100, min=20, max=400)
    force: Force = False


def render(
    file: Annotated[str, argument("RECORDING", "The recording to draw.")],
    options: RenderOptions,
    *,
    reading: ReadOptions,
) -> None:
    """Draw a recording as a moving picture for a mail or a slide, over its labels.

    motionary render take.bvh -o take.gif
    motionary render take.bvh --labels labels.csv --from 1.5 --to 0:08 -o take.gif
    """
    from motionary.plots import check_moving
    from motionary.plots import render as render_motion

    try:
        check_moving(options.output)
    except InvalidInput as error:
        raise wrong("--output", str(error)) from error
    check_target(options.output, replace=options.force)
    path = Path(file)
    motion = read_recording(path, reading).renamed(path.name)
    track = None if options.labels is None else _read_track(options.labels, motion)
    start_s, stop_s = check_part(motion.recording, options.start, options.stop)
    render_motion(
        motion, options.output, track,
        start_s=start_s, stop_s=stop_s, pictures_per_s=options.pictures, dpi=options.dpi,
    )  # fmt: skip
    screen.say_size(options.output)


def _read_track(path: str, motion: "Motion") -> "LabelTrack":
    from motionary.io import match_recording, read_labels
    from motionary.labels import of_recording

    name = motion.recording.name
    tracks = read_labels(path, recordings={name: motion.recording})
    found = [key for key in tracks if match_recording(key, [name])]
    if len(found) != 1:
        problem = "several may be meant" if found else f"has no labels of {name}"
        there = enumerate_names(sorted(found or tracks))
        raise InvalidInput(f"{problem}; has labels of {there}", file=path)
    return of_recording(tracks[found[0]], motion.recording)
