"""`motionary search`: where in these recordings is a motion like this one?"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli import screen
from motionary.cli.example import Example, read_example
from motionary.cli.inputs import Found, check_picture, complain_of_all, find_files
from motionary.cli.options import AsJson, Jobs, LibraryDefault, ReadingOptions
from motionary.cli.pictures import draw_sheet, draw_template

if TYPE_CHECKING:
    from motionary.features import FeatureSet, Reading
    from motionary.index import Collection
    from motionary.library import MotionClass
    from motionary.search import Growing, SearchResult

_KEYS = ("recording", "start_s", "end_s", "start_frame", "end_frame", "cost")
_COLUMNS = (">rank", "recording", ">start_s", ">end_s", ">frames", ">cost", ">known")


@dataclass(frozen=True, kw_only=True)
class QueryOptions:
    """What is sought."""

    like: Annotated[
        str | None, typer.Option(metavar="FILE", help="A recording with an example.")
    ] = None
    from_s: Annotated[
        float | None,
        typer.Option("--from", metavar="SECONDS", help="Where in FILE the example starts."),
    ] = None
    to_s: Annotated[
        float | None, typer.Option("--to", metavar="SECONDS", help="Where it ends.")
    ] = None
    grow: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            default_factory=LibraryDefault("motionary.search:Growing", "hits"),
            help="Learn from the example and its N nearest hits what may vary; 0: nothing may.",
        ),
    ]
    class_name: Annotated[
        str | None, typer.Option("--class", metavar="NAME", help="A class of the library.")
    ] = None
    library: Annotated[
        str | None, typer.Option(metavar="LIB", help="A folder that `motionary learn` wrote.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class HitOptions:
    """Which hits count, and what is drawn."""

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
            default_factory=LibraryDefault("motionary.search:search", "limit"),
            help="Most hits; 0: all.",
        ),
    ]
    sheet: Annotated[
        str | None,
        typer.Option(metavar="PNG", help="Draw the hits as stick figures below the example."),
    ] = None
    template: Annotated[
        str | None, typer.Option(metavar="PNG", help="Draw the template that was grown.")
    ] = None


def search(
    folder: Annotated[
        list[str], typer.Argument(metavar="FOLDER", help="Folders, files or patterns to search.")
    ],
    query: QueryOptions,
    which: HitOptions,
    as_json: AsJson = False,
    *,
    jobs: Jobs,
    reading: ReadingOptions,
) -> int:
    """Find more motions like an example, or all of a class.

    An example needs no training: a template grows from it and its nearest hits. What the
    template fixes and what it leaves open stands above the hits. A cost of 0 agrees with
    it everywhere.

    motionary search recordings/ --like take.bvh --from 1.2 --to 3.4 --sheet hits.png
    motionary search recordings/ --class squat --library my-classes
    """
    from motionary.search import Growing
    from motionary.search import search as search_for

    _check_use(query, which)
    told = reading.reading()
    example = _example(query, told)
    sought, feature_set = (example.words, None) if example else _motion_class(query)
    found = find_files(folder)
    collection = _read(found, told, feature_set, jobs)
    growing = Growing(hits=query.grow)
    result = search_for(
        sought, collection, threshold=which.threshold, limit=which.limit or None, growing=growing
    )
    if which.sheet:
        draw_sheet(which.sheet, result, example=example, files=found.files, reading=told)
    if which.template:
        draw_template(which.template, result.templates[0], growing.tolerance)
    if as_json:
        _say_json(result)
    else:
        _say(result, collection, growing if example else None)
    return 1 if found.missing or result.failures or not result.hits else 0


def _check_use(query: QueryOptions, which: HitOptions) -> None:
    if (query.like is None) == (query.class_name is None):
        raise _wrong("--like, --class", "say what is sought by one of them")
    if query.class_name is not None and query.library is None:
        raise _wrong("--class", "needs the library that the class is from: --library LIB")
    if query.like is not None and query.library is not None:
        raise _wrong("--library", "goes with --class NAME")
    of_example = {"--from": query.from_s, "--to": query.to_s, "--template": which.template}
    for option, value in of_example.items():
        if query.like is None and value is not None:
            raise _wrong(option, "goes with --like FILE")
    check_picture("--sheet", which.sheet)
    check_picture("--template", which.template)


def _wrong(option: str, problem: str) -> typer.BadParameter:
    return typer.BadParameter(problem, param_hint=option)


def _example(query: QueryOptions, reading: "Reading") -> Example | None:
    if query.like is None:
        return None
    return read_example(Path(query.like), from_s=query.from_s, to_s=query.to_s, reading=reading)


def _motion_class(query: QueryOptions) -> "tuple[MotionClass, FeatureSet]":
    from motionary.library import load_library

    library = load_library(query.library or "")
    if query.class_name not in library.names:
        known = ", ".join(library.names) or "none"
        raise typer.BadParameter(
            f"the library has no class {query.class_name!r}; its classes are: {known}",
            param_hint="--class",
        )
    return library[query.class_name], library.feature_set


def _read(
    found: Found, reading: "Reading", feature_set: "FeatureSet | None", jobs: int
) -> "Collection":
    """Words of the files; what cannot be read is told."""
    from motionary.features import FULL_BODY
    from motionary.index import read_collection

    with screen.progress("reading", len(found.files)) as done:
        collection = read_collection(
            found.files.items(),
            reading=reading,
            feature_set=feature_set or FULL_BODY,
            jobs=jobs,
            on_done=done,
        )
    complain_of_all(found.missing.values(), collection.failures)
    return collection


def _say_json(result: "SearchResult") -> None:
    for hit in result:
        screen.say_json({key: getattr(hit, key) for key in _KEYS})
    if not result:
        screen.complain(result.nearest)


def _say(result: "SearchResult", collection: "Collection", growing: "Growing | None") -> None:
    if growing:
        from motionary.cli.wording import describe_template

        lines = describe_template(
            result.templates[0], tolerance=growing.tolerance, feature_set=collection.feature_set
        )
        if growing.hits and result.templates[0].n_examples == 1:
            lines.append("  nothing was near enough to learn from what may vary")
        screen.say(*lines, "")
    rows = [
        (
            str(rank),
            hit.recording,
            f"{hit.start_s:.2f}",
            f"{hit.end_s:.2f}",
            f"{hit.start_frame}–{hit.end_frame}",
            f"{hit.cost:.3f}",
            f"{100 * hit.known:.0f} %",
        )
        for rank, hit in enumerate(result, start=1)
    ]
    if rows:
        screen.say_table(_COLUMNS, rows)
    else:
        screen.say(result.nearest)
