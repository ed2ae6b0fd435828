"""What a search looks for: an example, a class, or keyframes, as its options say.

And which hits of it a person found right or wrong.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from motionary.cli.options import LibraryDefault, declare, flag, option, refuse, wrong
from motionary.cli.recordings import open_library, read_recording
from motionary.errors import InvalidInput
from motionary.files import NO_SUCH_FILE
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.features import FeatureSequence, FeatureSet
    from motionary.models.keyframes import KeyframeQuery
    from motionary.models.library import MotionClass
    from motionary.motion import Motion
    from motionary.recording import Recording
    from motionary.retrieval.search import Hit, RelevanceFeedback

# Nine frames of features: below, hardly one changes, and everything is like everything.
_SHORTEST_S = 0.3
# A duration is read off a table or a player, rounded.
_ROUNDING_S = 0.05
# No keyframe ends like these.
_QUERY_FILES = (".json", ".txt")


@dataclass(frozen=True)
class Moment:
    """A time in a recording: seconds, or the number that the file gives a frame."""

    value: float
    is_frame: bool = False

    def __str__(self) -> str:
        return f"{self.value:.10g}{'f' if self.is_frame else ''}"

    def seconds_in(self, recording: "Recording", *, is_end: bool = False) -> float:
        """Seconds from the start of a recording; as an end, that of the frame."""
        if not self.is_frame:
            return self.value
        return (self.value - recording.first_frame + is_end) / recording.rate_hz


def _seconds_of(
    recording: "Recording", start: Moment | None, stop: Moment | None
) -> tuple[float, float]:
    """Seconds from one time to another; the ends of the recording where they are left out."""
    start_s = 0.0 if start is None else start.seconds_in(recording)
    if stop is None:
        return start_s, recording.duration_s
    return start_s, stop.seconds_in(recording, is_end=True)


def check_part(
    recording: "Recording", start: Moment | None, stop: Moment | None
) -> tuple[float, float]:
    """Seconds at which the part of a recording begins and ends that is asked for."""
    start_s, stop_s = _seconds_of(recording, start, stop)
    length = recording.duration_s
    if not 0 <= start_s < min(stop_s, length):
        raise wrong(
            "--from, --to",
            f"{recording.name} lasts from 0 to {length:.2f} s, got {start_s:g} to {stop_s:g}",
        )
    return start_s, stop_s


def parse_moment(text: str) -> Moment:
    """The time that a person wrote: `1.5`, `0:01.5`, `1:02:03` or `45f`."""
    if re.fullmatch(r"\d+f", text):
        return Moment(int(text[:-1]), is_frame=True)
    seconds = 0.0
    *higher, last = text.split(":")
    try:
        if len(higher) > 2 or not all(re.fullmatch(r"\d+", part) for part in higher):
            raise ValueError
        for part in (*higher, last):
            seconds = 60 * seconds + float(part)
    except ValueError:
        raise typer.BadParameter(
            f"expected seconds (1.5), minutes and seconds (0:01.5) or a frame (45f), got {text!r}"
        ) from None
    return Moment(seconds)


#: Part of a recording that a command is about.
Start = Annotated[
    Moment | None,
    declare(
        "--from TIME", "Where to start: seconds, 0:01.5, or a frame as in 45f.", parser=parse_moment
    ),
]
Stop = Annotated[Moment | None, declare("--to TIME", "Where to end.", parser=parse_moment)]


@dataclass(frozen=True, kw_only=True)
class QueryOptions:
    """What is looked for."""

    like: str | None = option("--like FILE", "A recording with an example.")
    start: Moment | None = option(
        "--from TIME",
        "Where in FILE the example starts: seconds, minutes as in 0:01.5, or the number of a frame "
        "as in 45f.",
        parser=parse_moment,
    )
    stop: Moment | None = option(
        "--to TIME", "Where it ends; a frame is included.", parser=parse_moment
    )
    expand: int = option(
        "--expand N",
        "Learn from the example and its N nearest hits what may vary; 0: nothing may.",
        LibraryDefault("motionary.retrieval.search:QueryExpansion", "hits"),
        min=0,
    )
    published: bool = flag(
        "--published",
        "Compare an example as published, by the 40 features alone; otherwise, and but for --fast "
        "and --query, also by ranked quantities, which hold between people and styles.",
    )
    relevant: str | None = option(
        "--relevant RANKS",
        "Hits that are right, as ranked without this option, such as 1,2,5: learn from these and "
        "no others.",
    )
    irrelevant: str | None = option(
        "--irrelevant RANKS", "Hits that are wrong: what they show tells less."
    )
    class_name: str | None = option("--class NAME", "A class of the library.")
    library: str | None = option(
        "--library LIB",
        "With --class: a folder that `motionary learn` wrote; by default everyday, the library "
        "that ships.",
    )
    query: str | None = option(
        "--query TEXT",
        "Keyframes, or a file with some: 'right hand fast, then within 0.5 s right hand above "
        "neck'. With --like or --class: match only around them.",
    )
    query_name: str | None = option(
        "--query-name NAME", "Which query of a collection: --query FILE.json holds many."
    )

    def check(self) -> None:
        """Refuse options that contradict each other."""
        if self.like is not None and self.class_name is not None:
            raise wrong("--like, --class", "say what to search for by one of them")
        if (self.like, self.class_name, self.query) == (None, None, None):
            raise wrong("--like, --class, --query", "say what to search for by one of them")
        if self.class_name is not None and self.library == "none":
            raise wrong("--class", "needs the library that the class is from: --library LIB")
        if self.class_name is None:
            refuse({"--library": self.library}, "goes with --class NAME")
        is_meant_as_file = self.query is not None and self.query.lower().endswith(_QUERY_FILES)
        if is_meant_as_file and not self.is_query_file:
            raise wrong("--query", f"{self.query}: {NO_SUCH_FILE}")
        if not self.is_collection:
            what = "goes with --query FILE.json, a collection of queries"
            refuse({"--query-name": self.query_name}, what)
        if self.like is None:
            for_examples = {
                "--from": self.start, "--to": self.stop, "--published": self.published,
                "--relevant": self.relevant, "--irrelevant": self.irrelevant,
            }  # fmt: skip
            refuse(for_examples, "goes with --like FILE")

    @property
    def is_query_file(self) -> bool:
        """Whether keyframes are in a file."""
        try:
            return self.query is not None and Path(self.query).is_file()
        except OSError:
            # A text may be longer than any name.
            return False

    @property
    def is_collection(self) -> bool:
        """Whether keyframes are one query of many in a file."""
        return self.is_query_file and Path(self.query or "").suffix.lower() == ".json"


class Example(NamedTuple):
    """An example: its features, measured within the whole recording, and its motion."""

    features: "FeatureSequence"
    motion: "Motion"

    @property
    def title(self) -> str:
        """Recording and seconds."""
        part = self.features
        start_s = (part.recording.first_frame - self.motion.first_frame) / self.motion.rate_hz
        return f"{part.source} {start_s:.2f}–{start_s + part.duration_s:.2f} s"


@dataclass(frozen=True)
class Query:
    """What is looked for, and the feature set that it is over.

    Attributes
    ----------
    what : features of an example, a class, or keyframes of which any may hit
    feature_set : of the features
    name : what the hits are labelled
    example : with its motion, if there is one
    keyframes : around which to match, if they are given
    """

    what: "FeatureSequence | MotionClass | tuple[KeyframeQuery, ...]"
    feature_set: "FeatureSet"
    name: str
    example: Example | None = None
    keyframes: "tuple[KeyframeQuery, ...]" = ()


def read_query(options: QueryOptions, reading: ReadOptions, *, fast: bool = False) -> Query:
    """What is looked for, read from its files.

    Parameters
    ----------
    fast : whether it is matched around keyframes, as published

    Raises
    ------
    BadParameter
        If the library has no such class, or keyframes are not understood.
    """
    from motionary.features import FULL_BODY, load_everyday_set

    if options.class_name is not None:
        motion_class, feature_set = _motion_class(options)
        keyframes = _read_keyframes(options, feature_set)
        return Query(motion_class, feature_set, motion_class.name, keyframes=keyframes)
    keyframes = _read_keyframes(options, FULL_BODY)
    if options.like is None:
        name = Path(options.query or "").stem if options.is_query_file else "keyframes"
        return Query(keyframes, FULL_BODY, options.query_name or name)
    as_published = options.published or fast or bool(keyframes)
    feature_set = FULL_BODY if as_published else load_everyday_set()
    example = _read_example(options, reading, feature_set)
    name = f"like {Path(options.like).stem}"
    return Query(example.features, feature_set, name, example, keyframes)


def _read_example(
    options: QueryOptions, reading: ReadOptions, feature_set: "FeatureSet"
) -> Example:
    """A recording from one time to another; to its ends where left out."""
    from motionary.features import SEQUENCE_HZ, compute_features

    path = Path(options.like or "")
    motion = read_recording(path, reading).renamed(path.name)
    start_s, stop_s = _check_example(motion.recording, options.start, options.stop)
    whole = compute_features(motion, feature_set=feature_set)
    last = min(round(stop_s * SEQUENCE_HZ), len(whole))
    first = min(round(start_s * SEQUENCE_HZ), last - 1)
    return Example(whole.part(first, last), motion)


def _check_example(
    recording: "Recording", start: Moment | None, stop: Moment | None
) -> tuple[float, float]:
    """Seconds at which an example begins and ends, if it is long enough."""
    start_s, stop_s = _seconds_of(recording, start, stop)
    length = recording.duration_s
    inside = f"{recording.name} lasts from 0 to {length:.2f} s"
    if not 0 <= start_s < length:
        raise wrong("--from", f"{inside}, got {start_s:g}")
    if not start_s < stop_s:
        raise wrong("--to", f"must come after --from, got {start_s:g} to {stop_s:g}; {inside}")
    if stop_s > length + _ROUNDING_S:
        raise wrong("--to", f"{inside}, got {stop_s:g}")
    stop_s = min(stop_s, length)
    if stop_s - start_s < _SHORTEST_S:
        raise wrong(
            "--from, --to",
            f"an example needs at least {_SHORTEST_S:g} s to tell one motion from another, got "
            f"{stop_s - start_s:.2f} s; {inside}",
        )
    return start_s, stop_s


def _motion_class(options: QueryOptions) -> "tuple[MotionClass, FeatureSet]":
    from motionary.models.library import EVERYDAY

    library = open_library(options.library or EVERYDAY)
    try:
        return library[options.class_name or ""], library.feature_set
    except InvalidInput as error:
        raise wrong("--class", str(error)) from error


def _read_keyframes(
    options: QueryOptions, feature_set: "FeatureSet"
) -> "tuple[KeyframeQuery, ...]":
    """Keyframes of a collection, of a file, or of the text itself."""
    given = options.query
    if given is None:
        return ()
    from motionary.io import read_query_record, read_text
    from motionary.models.keyframes import from_patterns, parse_queries

    is_file = options.is_query_file
    try:
        if options.is_collection:
            record = read_query_record(given, options.query_name)
            query = from_patterns(
                record.keyframes, record.groups, distances=record.distances,
                stiffness=record.stiffness, positions=record.positions, feature_set=feature_set,
            )  # fmt: skip
            return (query,)
        return parse_queries(read_text(Path(given)) if is_file else given, vocabulary=feature_set)
    except InvalidInput as error:
        if error.key == "name":
            raise wrong("--query-name", str(error)) from error
        where = f"{Path(given).name}, " if is_file else ""
        raise wrong("--query", f"{where}{error}") from error


# -- what a person says of hits ---------------------------------------------------------


class Ranks(NamedTuple):
    """Which hits are relevant and which are not, by rank."""

    relevant: list[int]
    irrelevant: list[int]

    @property
    def most(self) -> int:
        """The last rank of both; 0 for none."""
        return max([0, *self.relevant, *self.irrelevant])

    def to_feedback(self, example: "FeatureSequence", hits: "Sequence[Hit]") -> "RelevanceFeedback":
        """An example with what is said of its hits.

        Raises
        ------
        BadParameter
            If there are not so many hits.
        """
        from motionary.retrieval.search import RelevanceFeedback

        if self.most > len(hits):
            what = f"there is no hit {self.most}: the search has {len(hits)}"
            raise wrong("--relevant, --irrelevant", what)
        relevant, irrelevant = (tuple(hits[rank - 1] for rank in some) for some in self)
        return RelevanceFeedback(example, relevant, irrelevant)


def read_ranks(options: QueryOptions) -> Ranks:
    """Which hits are right and which are wrong, by rank."""
    relevant = _ranks("--relevant", options.relevant)
    irrelevant = _ranks("--irrelevant", options.irrelevant)
    both = sorted(set(relevant) & set(irrelevant))
    if both:
        raise wrong("--relevant, --irrelevant", f"hit {both[0]} cannot be right and wrong")
    return Ranks(relevant, irrelevant)


def _ranks(option: str, given: str | None) -> list[int]:
    if given is None:
        return []
    parts = [part.strip() for part in given.split(",")]
    if not all(part.isascii() and part.isdigit() and int(part) > 0 for part in parts):
        raise wrong(option, f"needs ranks of hits, such as 1,2,5, got {given!r}")
    return sorted({int(part) for part in parts})
