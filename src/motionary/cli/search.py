"""`motionary search`: where recordings hold a motion like an example, a class or keyframes."""

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli import STOPPED_BY_KEYBOARD, screen
from motionary.cli.convert import cut_labels
from motionary.cli.hits import Ranks, feedback_of, read_ranks, say_hits, say_json
from motionary.cli.options import (
    AsJson,
    LabelFile,
    LibraryDefault,
    TableOptions,
    check_library,
    check_page,
    check_picture,
    check_target,
    given_options,
    option,
    wrong,
)
from motionary.cli.query import (
    Query,
    QueryOptions,
    check_query,
    read_query,
)
from motionary.cli.recordings import IndexOptions, Opened, Opener, read_recording
from motionary.cli.workers import WorkOptions
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.features import FeatureSet
    from motionary.labels import LabelTrack
    from motionary.models.library import MotionClass
    from motionary.motion import Floats, Motion
    from motionary.retrieval.search import Hit, QueryExpansion, SearchResult

#: Longer examples hold several motions, as a rule.
_LONG_S = 6.0


@dataclass(frozen=True, kw_only=True)
class HitOptions:
    """Which hits count."""

    threshold: float | None = option(
        "--threshold COST",
        "Largest cost of a hit; by default the class's own, none for an example.",
        min=0.0,
    )
    limit: int = option(
        "--limit N",
        "Most hits; 0: all.",
        LibraryDefault("motionary.retrieval.search:search", "limit"),
        min=0,
    )
    fast: bool | None = option(
        "--fast/--thorough",
        "Match only around keyframes, derived where there are none: faster, and misses some; or "
        "everywhere. By default around the keyframes of a class that has some.",
    )


@dataclass(frozen=True, kw_only=True)
class ResultOptions(TableOptions):
    """What becomes of the hits, and of what they were found with."""

    output: LabelFile = None
    cut: str | None = option("--cut FOLDER", "Write each hit as a clip.")
    sheet: str | None = option("--sheet PNG", "Draw the hits as stick figures below the example.")
    report: str | None = option(
        "--report HTML",
        "Write a page that plays the hits side by side, in step, and takes yes and no.",
    )
    template: str | None = option("--template PNG", "Draw the template that was learned.")
    save_query: str | None = option(
        "--save-query FILE", "Write the keyframes, to be changed and used again."
    )
    save_class: str | None = option(
        "--save-class LIB", "Add the learned template to a library, as a class."
    )

    @property
    def holds_labels(self) -> bool:
        """Hits become labels."""
        return True


def search(
    folder: Annotated[
        list[str], typer.Argument(metavar="FOLDER", help="Folders, files or patterns to search.")
    ],
    options: QueryOptions,
    which: HitOptions,
    results: ResultOptions,
    index: IndexOptions,
    as_json: AsJson = False,
    *,
    work: WorkOptions,
    reading: ReadOptions,
) -> int:
    """Find more motions like an example, all of a class, or wherever keyframes are shown.

    An example needs no training: it is compared window by window, by quantities ranked in
    everyday motion, so that other people and styles are found; and by a template that is learned
    from it and its nearest hits. What the template fixes and leaves open stands above the hits,
    below them in which quantities the first ones are alike. A cost of 0 agrees everywhere. What
    was read of a folder is kept for the next search.

    motionary search recordings/ --like take.bvh --from 1.2 --to 3.4 --sheet hits.png
    motionary search recordings/ --like take.bvh --report hits.html
    motionary search recordings/ --like take.bvh --relevant 1,2,5 --irrelevant 3
    motionary search recordings/ --class squat --library my-classes
    motionary search recordings/ --query "right hand fast, then within 0.5 s right hand low"
    """
    from motionary.io import write_labels
    from motionary.retrieval.search import QueryExpansion
    from motionary.retrieval.search import search as search_for

    _check_use(options, results)
    results.check(as_json=as_json)
    ranks = read_ranks(options)
    query = _read_example(options, reading, fast=bool(which.fast))
    expansion = QueryExpansion(hits=options.expand, published=options.published)
    with work.open() as workers:
        opener = Opener(reading=reading, feature_set=query.feature_set, jobs=workers)
        opened = opener.open(folder, index)
        find = partial(
            search_for, recordings=opened.collection, threshold=which.threshold,
            expansion=expansion, preselect=query.keyframes or which.fast,
            jobs=work.searching(workers),
        )  # fmt: skip
        first, result = _find(find, query, ranks, limit=which.limit or None)
    tracks = _to_tracks(result, query.name)
    if results.output:
        write_labels(tracks, results.output, excel=results.excel)
    _save(result, results, query, opened, expansion, reading=reading)
    if results.report:
        given = given_options(options, which, index, reading, without=("relevant", "irrelevant"))
        judged = _command_of(folder, given), first, ranks
        _write_page(results.report, result, query, opened.files, judged, reading=reading)
    if as_json:
        say_json(result)
    elif not results.takes_stdout:
        expanded = expansion if query.example else None
        say_hits(result, opened.collection, expanded, has_feedback=ranks.most > 0)
    is_cut = not results.cut or cut_labels(
        tracks, opened.files, results.cut, reading=reading, jobs=work.jobs, replace=results.force
    )
    if opened.is_stopped:
        return STOPPED_BY_KEYBOARD
    return 0 if opened.is_complete and is_cut and result.hits else 1


def _read_example(options: QueryOptions, reading: ReadOptions, *, fast: bool) -> Query:
    """What is looked for; says where a whole file may be more than was meant."""
    query = read_query(options, reading, fast=fast)
    is_whole = options.start is None and options.stop is None
    duration_s = query.example.features.duration_s if query.example else 0.0
    if is_whole and duration_s > _LONG_S:
        screen.warn(
            f"the whole file is the example, {duration_s:.0f} s in parts of 2 s: recordings are "
            "found that hold most of them; choose one motion by --from and --to"
        )
    return query


def _command_of(folder: Sequence[str], options: Sequence[str]) -> str:
    """The command that searches so again, as it is typed in a shell."""
    names = (Path(path).name or path for path in folder)
    return shlex.join(["motionary", "search", *names, *options])


def _find(
    find: "Callable[..., SearchResult]", query: Query, ranks: Ranks, *, limit: int | None
) -> "tuple[SearchResult, SearchResult]":
    """Hits before and after those that a person judged; the same where there are none."""
    if not (query.example and ranks.most):
        result = find(query.what, limit=limit)
        return result, result
    features = query.example.features
    first = find(features, limit=None if limit is None else max(ranks.most, limit))
    judged = feedback_of(features, first, ranks)
    return first, find(judged, limit=limit)


def _check_use(options: QueryOptions, results: ResultOptions) -> None:
    check_query(options)
    for name, value in {
        "--template": results.template,
        "--save-class": results.save_class,
    }.items():
        if options.like is None and value is not None:
            raise wrong(name, "goes with --like FILE")
    check_page("--report", results.report)
    check_picture("--sheet", results.sheet)
    check_picture("--template", results.template)
    check_target(results.save_query, replace=results.force)
    check_target(results.cut, is_folder=True)
    if results.save_class is not None:
        check_library(results.save_class, replace=True)


def _to_tracks(result: "SearchResult", name: str) -> "list[LabelTrack]":
    """A track a hit: rows of a table in the sequence of the ranks."""
    from motionary.labels import Label, LabelTrack

    return [
        LabelTrack(
            hit.recording,
            (
                Label(
                    name, hit.start_s, hit.end_s, cost=hit.cost, known=hit.known,
                    start_frame=hit.start_frame, end_frame=hit.end_frame,
                ),
            ),
        )
        for hit in result
    ]  # fmt: skip


def _save(
    result: "SearchResult",
    results: ResultOptions,
    query: Query,
    opened: Opened,
    expansion: "QueryExpansion",
    *,
    reading: ReadOptions,
) -> None:
    """Write and draw the hits and what they were found with."""
    collection = opened.collection.published
    if results.sheet:
        _draw_sheet(results.sheet, result, query, opened.files, reading)
    if results.template:
        from motionary.plots import plot_template, save

        figure = plot_template(result.templates[0], tolerance=expansion.tolerance)
        save(figure, results.template)
    if results.save_query:
        from motionary.io import write_text
        from motionary.models.keyframes import format_queries
        from motionary.retrieval.search import suggest_queries

        queries = result.queries or suggest_queries(result.templates, collection)
        write_text(results.save_query, format_queries(queries, vocabulary=collection.feature_set))
    if results.save_class:
        from motionary.retrieval.search import class_of_result

        learned = class_of_result(result, query.name, collection, expansion)
        _save_class(results.save_class, learned, collection.feature_set)


def _save_class(folder: str, motion_class: "MotionClass", feature_set: "FeatureSet") -> None:
    """Add a class to a library, in place of one of its name; a new library if there is none."""
    from motionary.models.library import ClassLibrary, load_library

    library = ClassLibrary((), feature_set)
    if (Path(folder) / "library.toml").exists():
        library = load_library(folder)
    others = tuple(one for one in library if one.name != motion_class.name)
    replace(library, classes=(*others, motion_class)).save(folder)


def _draw_sheet(
    path: str,
    hits: "Sequence[Hit]",
    query: Query,
    files: Mapping[str, Path],
    reading: ReadOptions,
) -> None:
    """Stick figures of an example and its hits; without an example the best hit leads."""
    from motionary.plots import plot_sheets, save_pages

    motions: dict[str, Motion] = {}
    rows = []
    if query.example is not None:
        part = query.example.features.recording
        last = part.first_frame + part.n_frames - 1
        title = f"example: {query.example.title}"
        rows.append((title, *cut_frames(query.example.motion, part.first_frame, last)))
    for rank, hit in enumerate(hits, start=1):
        name = hit.recording.name
        if name not in motions:
            motions[name] = read_recording(files[name], reading)
        title = f"{rank}: {name} {hit.start_s:.2f}–{hit.end_s:.2f} s, cost {hit.cost:.3f}"
        rows.append((title, *cut_frames(motions[name], hit.start_frame, hit.end_frame)))
    if rows:
        screen.warn_of_pages(path, save_pages(plot_sheets(rows[0], rows[1:]), path))


def cut_frames(motion: "Motion", first: int, last: int) -> "tuple[Floats, Floats]":
    """Generic joints of frames as the file numbers them, both ends included, and their times."""
    import numpy as np

    start = max(first - motion.first_frame, 0)
    stop = min(max(last + 1 - motion.first_frame, start + 1), motion.n_frames)
    return motion.cut(start, stop).generic_positions(), np.arange(start, stop) / motion.rate_hz


def _write_page(
    path: str,
    result: "SearchResult",
    query: Query,
    files: Mapping[str, Path],
    judged: "tuple[str, SearchResult, Ranks]",
    *,
    reading: ReadOptions,
) -> None:
    """A page of the hits beside the example; `judged`: command, first hits, ranks given."""
    from motionary.reporting import Judging, MotionFiles, rank_among, report_hits

    example = judging = None
    if query.example is not None:
        part, motion = query.example.features.recording, query.example.motion
        start = part.first_frame - motion.first_frame
        example = motion.cut(start, start + part.n_frames)
        command, first, ranks = judged
        judging = Judging(command, rank_among(result, first), *ranks)
    report_hits(
        result, MotionFiles(files, reading), path, query=example, judging=judging, title=query.name
    )
    screen.say_size(path)
