"""Hits of `motionary search`: printed, and found right or wrong by a person."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from motionary.cli import screen
from motionary.cli.options import wrong
from motionary.cli.query import QueryOptions

if TYPE_CHECKING:
    from motionary.features import FeatureSequence, FeatureSet
    from motionary.retrieval.index import Collection
    from motionary.retrieval.search import Hit, QueryExpansion, RelevanceFeedback, SearchResult

_KEYS = ("start_s", "end_s", "start_frame", "end_frame", "cost", "known")
_MOST_COMPARED = 3
_COLUMNS = (">rank", "recording", ">start_s", ">end_s", ">frames", ">cost", ">known")


def say_json(result: "SearchResult") -> None:
    """Print a JSON object a hit."""
    for hit in result:
        screen.print_json(
            {"recording": hit.recording.name} | {key: getattr(hit, key) for key in _KEYS}
        )
    if not result:
        screen.warn(result.nearest)


def say_hits(
    result: "SearchResult",
    collection: "Collection",
    expansion: "QueryExpansion | None",
    *,
    has_feedback: bool,
) -> None:
    """Print what is looked for, the hits, and in what the first ones are alike."""
    feature_set = collection.published.feature_set
    if expansion:
        from motionary.models.templates import describe_template

        lines = describe_template(
            result.templates[0], tolerance=expansion.tolerance, feature_set=feature_set
        )
        if expansion.hits and result.templates[0].n_examples == 1 and not has_feedback:
            lines.append("  nothing was near enough to learn from what may vary")
        screen.say(*lines, *_keyframe_lines(result, feature_set), "")
    rows = [
        (
            str(rank),
            hit.recording.name,
            f"{hit.start_s:.2f}",
            f"{hit.end_s:.2f}",
            f"{hit.start_frame}–{hit.end_frame}",
            f"{hit.cost:.3f}",
            screen.percent(hit.known),
        )
        for rank, hit in enumerate(result, start=1)
    ]
    if rows:
        screen.print_table(_COLUMNS, rows)
        screen.say(*_comparison_lines(result))
    else:
        screen.say(result.nearest)


def _comparison_lines(result: "SearchResult") -> list[str]:
    """In which quantities the first hits that are not the example are like it."""
    from motionary.retrieval.explanation import describe_comparison

    compared = [
        (rank, describe_comparison(hit.comparison))
        for rank, hit in enumerate(result, start=1)
        if hit.comparison and hit.cost > 0
    ]
    lines = [
        f"{rank if i == 0 else '':>4}  {line}"
        for rank, lines in compared[:_MOST_COMPARED]
        for i, line in enumerate(lines)
    ]
    return ["", *lines] if lines else []


def _keyframe_lines(result: "SearchResult", feature_set: "FeatureSet") -> list[str]:
    """Keyframes around which was matched, in the words that a person writes them with."""
    if not result.queries:
        return []
    from motionary.models.keyframes import format_queries

    text = format_queries(result.queries, vocabulary=feature_set)
    lines = [line for line in text.splitlines() if not line.startswith("features: ")]
    fraction = 100 * result.fraction_matched
    return [
        f"  matched in {fraction:.0f} % of the frames, around keyframes:",
        *(f"    {x}" for x in lines),
    ]


class Ranks(NamedTuple):
    """Which hits are relevant and which are not, by rank."""

    relevant: list[int]
    irrelevant: list[int]

    @property
    def most(self) -> int:
        """The last rank of both; 0 for none."""
        return max([0, *self.relevant, *self.irrelevant])


def read_ranks(options: QueryOptions) -> Ranks:
    """Which hits are right and which are wrong, by rank.

    Raises
    ------
    BadParameter
    """
    ranks = Ranks(
        _ranks("--relevant", options.relevant), _ranks("--irrelevant", options.irrelevant)
    )
    both = sorted(set(ranks.relevant) & set(ranks.irrelevant))
    if both:
        raise wrong("--relevant, --irrelevant", f"hit {both[0]} cannot be right and wrong")
    return ranks


def feedback_of(
    example: "FeatureSequence", hits: "Sequence[Hit]", ranks: Ranks
) -> "RelevanceFeedback":
    """An example with what is said of its hits.

    Raises
    ------
    BadParameter
        If there are not so many hits.
    """
    from motionary.retrieval.search import RelevanceFeedback

    if ranks.most > len(hits):
        raise wrong(
            "--relevant, --irrelevant",
            f"there is no hit {ranks.most}: the search has {len(hits)}",
        )
    relevant, irrelevant = (tuple(hits[rank - 1] for rank in some) for some in ranks)
    return RelevanceFeedback(example, relevant, irrelevant)


def _ranks(option: str, given: str | None) -> list[int]:
    if given is None:
        return []
    parts = [part.strip() for part in given.split(",")]
    if not all(part.isascii() and part.isdigit() and int(part) > 0 for part in parts):
        raise wrong(option, f"needs ranks of hits, such as 1,2,5, got {given!r}")
    return sorted({int(part) for part in parts})
