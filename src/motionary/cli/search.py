"""`motionary search`: where in these recordings is a motion like this one?"""

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli import STOPPED_BY_KEYBOARD, screen
from motionary.cli.cutting import cut_labels
from motionary.cli.indexed import IndexOptions, open_recordings
from motionary.cli.inputs import check_excel, check_picture, check_target
from motionary.cli.options import AsJson, Excel, Jobs, LibraryDefault, ReadingOptions
from motionary.cli.pictures import draw_sheet, draw_template
from motionary.cli.sought import (
    QueryOptions,
    Wanted,
    check_query,
    judge,
    read_ranks,
    read_wanted,
    wrong,
)

if TYPE_CHECKING:
    from motionary.labels import LabelTrack
    from motionary.retrieval.index import Collection
    from motionary.retrieval.search import QueryExpansion, SearchResult

_KEYS = ("start_s", "end_s", "start_frame", "end_frame", "cost", "known")
_COLUMNS = (">rank", "recording", ">start_s", ">end_s", ">frames", ">cost", ">known")


@dataclass(frozen=True, kw_only=True)
class HitOptions:
    """Which hits count."""

    threshold: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="COST",
            help="Largest cost of a hit; by default the class's own, none for an example.",
        ),
    ] = None
    limit: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            default_factory=LibraryDefault("motionary.retrieval.search:search", "limit"),
            help="Most hits; 0: all.",
        ),
    ]
    fast: Annotated[
        bool | None,
        typer.Option(
            "--fast/--thorough",
            help="Match only around keyframes, derived where there are none: faster, and misses "
            "some; or everywhere. By default around the keyframes of a class that has some.",
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class ResultOptions:
    """What becomes of the hits, and of what they were found with."""

    output: Annotated[
        str | None, typer.Option("--output", "-o", metavar="CSV", help="Write a table of hits.")
    ] = None
    excel: Excel = False
    cut: Annotated[
        str | None, typer.Option(metavar="FOLDER", help="Write each hit as a clip (BVH, AMC).")
    ] = None
    sheet: Annotated[
        str | None,
        typer.Option(metavar="PNG", help="Draw the hits as stick figures below the example."),
    ] = None
    template: Annotated[
        str | None, typer.Option(metavar="PNG", help="Draw the template that was grown.")
    ] = None
    save_query: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Write the keyframes, to be changed and used again."),
    ] = None
    save_class: Annotated[
        str | None,
        typer.Option(metavar="LIB", help="Add the grown template to a library, as a class."),
    ] = None


def search(
    folder: Annotated[
        list[str], typer.Argument(metavar="FOLDER", help="Folders, files or patterns to search.")
    ],
    query: QueryOptions,
    which: HitOptions,
    results: ResultOptions,
    index: IndexOptions,
    as_json: AsJson = False,
    *,
    jobs: Jobs,
    reading: ReadingOptions,
) -> int:
    """Find more motions like an example, all of a class, or wherever keyframes are shown.

    An example needs no training: a template grows from it and its nearest hits. What the
    template fixes and what it leaves open stands above the hits. A cost of 0 agrees with
    it everywhere. What was read of a folder is kept for the next search.

    motionary search recordings/ --like take.bvh --from 1.2 --to 3.4 --sheet hits.png
    motionary search recordings/ --like take.bvh --from 1.2 --to 3.4 --good 1,2,5 --bad 3
    motionary search recordings/ --class squat --library my-classes
    motionary search recordings/ --query "right hand fast, then within 0.5 s right hand low"
    """
    from motionary.retrieval.search import QueryExpansion
    from motionary.retrieval.search import search as search_for

    _check_use(query, results)
    ranks = read_ranks(query)
    told = reading.reading()
    wanted = read_wanted(query, told)
    opened = open_recordings(folder, index, reading=told, feature_set=wanted.feature_set, jobs=jobs)
    expansion = QueryExpansion(hits=query.grow)
    find = partial(
        search_for,
        recordings=opened.collection,
        threshold=which.threshold,
        expansion=expansion,
        preselect=wanted.queries or which.fast,
    )
    what = wanted.what
    if wanted.example and any(ranks):
        hits = find(what, limit=max(*ranks[0], *ranks[1], 1))
        what = judge(wanted.example.packed, hits, ranks)
    result = find(what, limit=which.limit or None)
    if results.sheet:
        draw_sheet(results.sheet, result, example=wanted.example, files=opened.files, reading=told)
    if results.template:
        draw_template(results.template, result.templates[0], expansion.tolerance)
    _save(result, results, wanted, opened.collection, expansion)
    if as_json:
        _say_json(result)
    else:
        expanded = expansion if wanted.example else None
        _say(result, opened.collection, expanded, has_feedback=any(ranks))
    is_cut = not results.cut or cut_labels(
        _to_tracks(result, wanted.name), opened.files, results.cut, reading=told, jobs=jobs
    )
    if opened.is_stopped:
        return STOPPED_BY_KEYBOARD
    return 0 if opened.is_complete and is_cut and result.hits else 1


def _check_use(query: QueryOptions, results: ResultOptions) -> None:
    check_query(query)
    for option, value in {
        "--template": results.template,
        "--save-class": results.save_class,
    }.items():
        if query.like is None and value is not None:
            raise wrong(option, "goes with --like FILE")
    check_picture("--sheet", results.sheet)
    check_picture("--template", results.template)
    check_excel(results.excel, results.output)
    for path in (results.output, results.save_query):
        check_target(path)
    for path in (results.cut, results.save_class):
        check_target(path, is_folder=True)


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
    wanted: Wanted,
    collection: "Collection",
    expansion: "QueryExpansion",
) -> None:
    """Write the hits and what they were found with."""
    if results.output:
        from motionary.io import write_labels

        write_labels(_to_tracks(result, wanted.name), results.output, excel=results.excel)
    if results.save_query:
        from motionary.cli.saving import derive, save_queries

        queries = result.queries or derive(result.templates, collection)
        save_queries(queries, results.save_query, feature_set=collection.feature_set)
    if results.save_class:
        from motionary.cli.saving import save_class

        save_class(result, results.save_class, collection, name=wanted.name, expansion=expansion)


def _say_json(result: "SearchResult") -> None:
    for hit in result:
        screen.print_json(
            {"recording": hit.recording.name} | {key: getattr(hit, key) for key in _KEYS}
        )
    if not result:
        screen.warn(result.nearest)


def _say(
    result: "SearchResult",
    collection: "Collection",
    expansion: "QueryExpansion | None",
    *,
    has_feedback: bool,
) -> None:
    if expansion:
        from motionary.cli.wording import describe_template

        lines = describe_template(
            result.templates[0], tolerance=expansion.tolerance, feature_set=collection.feature_set
        )
        if expansion.hits and result.templates[0].n_examples == 1 and not has_feedback:
            lines.append("  nothing was near enough to learn from what may vary")
        screen.say(*lines, *_keyframe_lines(result, collection), "")
    rows = [
        (
            str(rank),
            hit.recording.name,
            f"{hit.start_s:.2f}",
            f"{hit.end_s:.2f}",
            f"{hit.start_frame}–{hit.end_frame}",
            f"{hit.cost:.3f}",
            f"{100 * hit.known:.0f} %",
        )
        for rank, hit in enumerate(result, start=1)
    ]
    if rows:
        screen.print_table(_COLUMNS, rows)
    else:
        screen.say(result.nearest)


def _keyframe_lines(result: "SearchResult", collection: "Collection") -> list[str]:
    """Keyframes around which was matched, in the words that a person writes them with."""
    if not result.queries:
        return []
    from motionary.models.keyframes import format_queries

    text = format_queries(result.queries, vocabulary=collection.feature_set)
    told = [line for line in text.splitlines() if not line.startswith("features: ")]
    fraction = 100 * result.fraction_matched
    return [
        f"  matched in {fraction:.0f} % of the frames, around keyframes:",
        *(f"    {x}" for x in told),
    ]
