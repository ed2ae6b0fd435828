"""What does a search look for: an example, a class, keyframes?"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli.example import Example, read_example
from motionary.cli.options import LibraryDefault
from motionary.errors import InvalidInput

if TYPE_CHECKING:
    from motionary.features import FeatureSequence, FeatureSet
    from motionary.io import ReadOptions
    from motionary.models.keyframes import KeyframeQuery
    from motionary.models.library import MotionClass
    from motionary.retrieval.search import Hit, RelevanceFeedback

#: So many names are told of a collection.
_MOST_NAMES = 5
#: No keyframe ends like these.
_QUERY_FILES = (".json", ".txt")


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
            default_factory=LibraryDefault("motionary.retrieval.search:QueryExpansion", "hits"),
            help="Learn from the example and its N nearest hits what may vary; 0: nothing may.",
        ),
    ]
    good: Annotated[
        str | None,
        typer.Option(
            metavar="RANKS",
            help="Hits that are right, as ranked without this option, such as 1,2,5: learn from "
            "these and no others.",
        ),
    ] = None
    bad: Annotated[
        str | None,
        typer.Option(metavar="RANKS", help="Hits that are wrong: what they show tells less."),
    ] = None
    class_name: Annotated[
        str | None, typer.Option("--class", metavar="NAME", help="A class of the library.")
    ] = None
    library: Annotated[
        str | None, typer.Option(metavar="LIB", help="A folder that `motionary learn` wrote.")
    ] = None
    query: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT",
            help="Keyframes, or a file with some: 'right hand fast, then within 0.5 s right hand "
            "above neck'. With --like or --class: match only around them.",
        ),
    ] = None
    query_name: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Which query of a collection: --query FILE.json holds many."
        ),
    ] = None


@dataclass(frozen=True)
class Wanted:
    """What is sought, and the relations that it is told in.

    Attributes
    ----------
    what : words of an example, a class, or keyframes of which any may hit
    feature_set : of the words
    name : what the hits are labelled
    example : with its motion, if there is one
    queries : keyframes around which to match, if they are told
    """

    what: "FeatureSequence | RelevanceFeedback | MotionClass | tuple[KeyframeQuery, ...]"
    feature_set: "FeatureSet"
    name: str
    example: Example | None = None
    queries: "tuple[KeyframeQuery, ...]" = ()


def check_query(options: QueryOptions) -> None:
    """Refuse options that contradict each other.

    Raises
    ------
    BadParameter
    """
    if options.like is not None and options.class_name is not None:
        raise wrong("--like, --class", "say what is sought by one of them")
    if (options.like, options.class_name, options.query) == (None, None, None):
        raise wrong("--like, --class, --query", "say what is sought by one of them")
    if options.class_name is not None and options.library is None:
        raise wrong("--class", "needs the library that the class is from: --library LIB")
    if options.class_name is None and options.library is not None:
        raise wrong("--library", "goes with --class NAME")
    if _is_meant_as_file(options.query) and not _is_file(options.query):
        raise wrong("--query", f"{options.query}: no such file")
    if options.query_name is not None and not _is_collection(options.query):
        raise wrong("--query-name", "goes with --query FILE.json, a collection of queries")
    for_examples = {
        "--from": options.from_s, "--to": options.to_s,
        "--good": options.good, "--bad": options.bad,
    }  # fmt: skip
    for option, value in for_examples.items():
        if options.like is None and value is not None:
            raise wrong(option, "goes with --like FILE")


def read_wanted(options: QueryOptions, reading: "ReadOptions") -> Wanted:
    """What is sought, read from its files.

    Raises
    ------
    BadParameter
        If the library has no such class, or keyframes are not understood.
    """
    from motionary.features import FULL_BODY

    if options.class_name is not None:
        motion_class, feature_set = _motion_class(options)
        queries = _read_queries(options, feature_set)
        return Wanted(motion_class, feature_set, motion_class.name, queries=queries)
    queries = _read_queries(options, FULL_BODY)
    if options.like is None:
        name = Path(options.query or "").stem if _is_file(options.query) else "keyframes"
        return Wanted(queries, FULL_BODY, options.query_name or name)
    path = Path(options.like)
    example = read_example(path, from_s=options.from_s, to_s=options.to_s, reading=reading)
    return Wanted(example.packed, FULL_BODY, f"like {path.stem}", example, queries)


def read_ranks(options: QueryOptions) -> tuple[list[int], list[int]]:
    """Which hits are right and which are wrong, by rank.

    Raises
    ------
    BadParameter
    """
    good, bad = _ranks("--good", options.good), _ranks("--bad", options.bad)
    both = sorted(set(good) & set(bad))
    if both:
        raise wrong("--good, --bad", f"hit {both[0]} cannot be right and wrong")
    return good, bad


def judge(
    words: "FeatureSequence", hits: "Sequence[Hit]", ranks: tuple[list[int], list[int]]
) -> "RelevanceFeedback":
    """An example with what is said of its hits.

    Raises
    ------
    BadParameter
        If there are not so many hits.
    """
    from motionary.retrieval.search import RelevanceFeedback

    most = max([*ranks[0], *ranks[1]])
    if most > len(hits):
        raise wrong("--good, --bad", f"there is no hit {most}: the search has {len(hits)}")
    good, bad = (tuple(hits[rank - 1] for rank in some) for some in ranks)
    return RelevanceFeedback(words, good, bad)


def _ranks(option: str, told: str | None) -> list[int]:
    if told is None:
        return []
    parts = [part.strip() for part in told.split(",")]
    if not all(part.isascii() and part.isdigit() and int(part) > 0 for part in parts):
        raise wrong(option, f"needs ranks of hits, such as 1,2,5, got {told!r}")
    return sorted({int(part) for part in parts})


def wrong(option: str, problem: str) -> typer.BadParameter:
    """Wrong use of an option."""
    return typer.BadParameter(problem, param_hint=option)


def _motion_class(options: QueryOptions) -> "tuple[MotionClass, FeatureSet]":
    from motionary.models.library import load_library

    library = load_library(options.library or "")
    name = options.class_name or ""
    if name not in library.names:
        known = ", ".join(library.names) or "none"
        raise wrong("--class", f"the library has no class {name!r}; its classes are: {known}")
    return library[name], library.feature_set


def _read_queries(options: QueryOptions, feature_set: "FeatureSet") -> "tuple[KeyframeQuery, ...]":
    """Keyframes of a collection, of a file, or of the text itself."""
    told = options.query
    if told is None:
        return ()
    from motionary.io.text import read_text
    from motionary.models.keyframes import parse_queries

    is_file = _is_file(told)
    try:
        if _is_collection(told):
            return (_query_of(Path(told), options.query_name, feature_set),)
        text = read_text(Path(told)) if is_file else told
        return parse_queries(text, vocabulary=feature_set)
    except InvalidInput as error:
        where = f"{Path(told).name}, " if is_file else ""
        raise wrong("--query", f"{where}{error}") from error


def _query_of(path: Path, name: str | None, feature_set: "FeatureSet") -> "KeyframeQuery":
    """One query of a collection, by its name or as COLLECTION/NAME."""
    from motionary.io import read_query_collections
    from motionary.models.keyframes import from_patterns

    records = {
        f"{collection}/{query}": record
        for collection, queries in read_query_collections(path).items()
        for query, record in queries.items()
    }
    found = [full for full in records if name in (None, full, full.split("/", 1)[1])]
    if len(found) != 1:
        near = found or [full for full in records if name and name.lower() in full.lower()]
        names = near or list(records)
        some = ", ".join(names[:_MOST_NAMES]) + (", ..." if len(names) > _MOST_NAMES else "")
        what = f"{len(found)} queries" + (f" called {name!r}" if name else "")
        what = what if found else f"no query {name!r}"
        raise wrong("--query-name", f"{path.name} has {what}; choose one by its name: {some}")
    record = records[found[0]]
    return from_patterns(
        record.keyframes, record.groups, distances=record.distances,
        stiffness=record.stiffness, positions=record.positions, feature_set=feature_set,
    )  # fmt: skip


def _is_collection(told: str | None) -> bool:
    return _is_file(told) and Path(told or "").suffix.lower() == ".json"


def _is_meant_as_file(told: str | None) -> bool:
    return told is not None and told.lower().endswith(_QUERY_FILES)


def _is_file(told: str | None) -> bool:
    try:
        return told is not None and Path(told).is_file()
    except OSError:
        # A text may be longer than any name.
        return False
