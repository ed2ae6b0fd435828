"""`motionary index` and `duplicates`: folders by their indexes, as other commands open them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated

from motionary.cli import STOPPED_BY_KEYBOARD, screen
from motionary.cli.options import (
    AsJson,
    LibraryDefault,
    argument,
    declare,
    find_feature_set,
    flag,
    option,
    wrong,
)
from motionary.cli.recordings import WorkOptions, read_recording, warn_of_all
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.batch import Workers
    from motionary.features import FeatureSet
    from motionary.retrieval.duplicates import DuplicateResult, Occurrence
    from motionary.retrieval.index import Changes, Index
    from motionary.retrieval.index.opening import Opened

_COLUMNS = (
    ">bits", ">agreement", "recording", ">start_s", ">end_s", "other", ">start_s", ">end_s", "",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class IndexOptions:
    """Where the features of a folder are kept."""

    index: str | None = option(
        "--index PATH",
        "Folder that keeps what was read of the recordings; by default in the cache.",
    )
    no_index: bool = flag("--no-index", "Read all recordings anew, and keep nothing.")


def open_recordings(
    paths: Sequence[str],
    options: IndexOptions,
    *,
    reading: ReadOptions,
    feature_set: "FeatureSet",
    jobs: "Workers",
) -> "tuple[Opened, int]":
    """Features of folders, files and patterns, and the code that a command then ends with.

    Reports what could not be read.

    Raises
    ------
    BadParameter
        If an index is named and refused.
    """
    from motionary.retrieval.index.opening import Opener, needs_one_index

    if options.no_index and needs_one_index(paths, options.index):
        raise wrong("--no-index", "goes without --index, URLs and lists")
    opener = Opener(reading=reading, feature_set=feature_set, jobs=jobs, follower=screen)
    found = opener.open(paths, at=options.index, kept=not options.no_index)
    failed = warn_of_all(found.missing, found.collection.failures, given=paths)
    return found, STOPPED_BY_KEYBOARD if found.is_stopped else int(failed)


# -- commands ---------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class KeptOptions:
    """What is kept of recordings, and where."""

    place: str | None = option(
        "--index PATH", "Folder to keep what was read in; by default in the cache."
    )
    features: str | None = option(
        "--features SET",
        "Features to keep: everyday-448 (the usual, for all searches), full-body-40 (the published "
        "alone, in a quarter of the room: for keyframes, classes, labels and --fast), or what a "
        "library is over, such as legs-14.",
    )


def index(
    sources: Annotated[
        list[str],
        argument(
            "SOURCE",
            "Folders, searched to the bottom, files, patterns, URLs, and @LIST: a text file with "
            "one of them a line.",
        ),
    ],
    options: KeptOptions,
    as_json: AsJson = False,
    *,
    work: WorkOptions,
    reading: ReadOptions,
) -> int:
    """Read what is new or changed in folders, and say what could not be read.

    `motionary search` does the same by itself. An interrupted run is taken up where it
    ended. What could not be read is tried again when it has changed.

    motionary index recordings/ --jobs 4
    motionary index //server/recordings --index recordings-index
    motionary index /archive @more.txt s3://bucket/takes --index /archive-index
    motionary index /archive --index /archive-index --features full-body-40
    motionary index /archive --index /archive-index --scheduler tcp://host:8786
    """
    from motionary.features import load_everyday_set
    from motionary.retrieval.index import Index
    from motionary.retrieval.index.opening import Opener

    chosen = load_everyday_set() if options.features is None else find_feature_set(options.features)
    with work.open() as workers:
        opener = Opener(reading=reading, feature_set=chosen, jobs=workers, follower=screen)
        if options.features is None:
            opened = opener.open_index(sources, options.place)
        else:
            opened = Index.open(sources, at=options.place, reading=reading, feature_set=chosen)
        changes = opened.changes()
        is_stopped = opener.update_index(opened, changes)
    failed = warn_of_all(opener.missing_of(opened), opened.failures)
    _say_kept(opened, changes, as_json=as_json)
    return STOPPED_BY_KEYBOARD if is_stopped else int(failed)


def _say_kept(index: "Index", changes: "Changes", *, as_json: bool) -> None:
    """Say what an index holds, and what has become of it."""
    from motionary.features import SEQUENCE_HZ

    n, gone, failed = len(index), len(changes.gone), len(index.failures)
    read, seconds = index.count_ready(changes.to_read), index.n_frames / SEQUENCE_HZ
    if as_json:
        counts = {"recordings": n, "words": index.n_frames, "read": read, "gone": gone}
        screen.print_json({**counts, "failed": failed, "place": str(index.place)})
        return
    units = (("hours", 3600), ("minutes", 60), ("seconds", 1))
    unit, size = next((one for one in units if seconds >= one[1]), units[-1])
    shown = f"{seconds / size:.2f} {unit}"
    screen.say(
        f"{screen.count(n, 'recording')}, {shown}; read {read}, {gone} gone, {failed} could not be "
        "read",
        f"kept in {index.place}",
    )


LeastBits = Annotated[
    float,
    declare(
        "--bits BITS",
        "Least self-information of what two recordings have in common.",
        min=0.0,
        default_factory=LibraryDefault("motionary.retrieval.duplicates:Comparing", "least_bits"),
    ),
]


def duplicates(
    folder: Annotated[str, argument("A", "Folder or file of recordings.")],
    other: Annotated[
        str | None, argument("B", "Recordings to compare with; those of A if left out.")
    ] = None,
    as_json: AsJson = False,
    *,
    least_bits: LeastBits,
    index: IndexOptions,
    work: WorkOptions,
    reading: ReadOptions,
) -> int:
    """Find the same motion in different files: on other rigs, at other rates, cut, mirrored.

    Bits say how improbable it is that the features of both change together by chance; where
    hardly anything changes there are none. Agreement, at most 1, is that of the
    accelerations: it tells a copy from a motion that somebody did twice.

    motionary duplicates recordings/
    motionary duplicates new-delivery/ archive/
    """
    from motionary.features import FULL_BODY
    from motionary.retrieval.duplicates import Comparing, find_duplicates

    with work.open() as workers:
        sides = [
            open_recordings([side], index, reading=reading, feature_set=FULL_BODY, jobs=workers)
            for side in (folder, other)
            if side is not None
        ]
        (left, _), (right, _) = sides[0], sides[-1]
        result = find_duplicates(
            left.collection, right.collection if other else None,
            # Workers of a cluster run in other folders.
            read=partial(read_recording, reading=reading.absolute()),
            comparing=Comparing(least_bits=least_bits),
            locate=lambda name: left.files[name].absolute(),
            locate_right=(lambda name: right.files[name].absolute()) if other else None,
            jobs=workers,
        )  # fmt: skip
    if as_json:
        _say_json(result)
    else:
        _say(result)
    for failure in result.failures:
        screen.warn(f"{failure.item}: {failure.error}")
    is_done = result.duplicates and not result.failures
    return max(code for _, code in sides) or (0 if is_done else 1)


def _say_json(result: "DuplicateResult") -> None:
    for found in result.duplicates:
        screen.print_json(
            {
                **_to_json(found.left, ""),
                **_to_json(found.right, "other_"),
                "mirrored": found.is_mirrored,
                "bits": round(found.bits, 1),
                "agreement": round(found.agreement, 4),
            }
        )


def _to_json(found: "Occurrence", prefix: str) -> dict[str, object]:
    return {
        f"{prefix}recording": found.recording.name,
        f"{prefix}start_s": found.segment.start_s,
        f"{prefix}end_s": found.segment.end_s,
    }


def _say(result: "DuplicateResult") -> None:
    rows = []
    for found in result.duplicates:
        places = [
            text
            for recording, (start_s, end_s) in (found.left, found.right)
            for text in (recording.name, f"{start_s:.2f}", f"{end_s:.2f}")
        ]
        side = "mirrored" if found.is_mirrored else ""
        rows.append((f"{found.bits:.0f}", f"{found.agreement:.2f}", *places, side))
    if rows:
        screen.print_table(_COLUMNS, rows)
    else:
        screen.say("no motion is in two of these recordings")
    if result.n_alike:
        screen.say(f"{result.n_alike} further pairs change alike, each performed on its own")
    if result.still:
        n = len(result.still)
        changing = screen.count(n, "recording changes", "recordings change")
        screen.say(f"{changing} too little to be told apart")
