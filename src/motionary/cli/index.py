"""`motionary index` and `duplicates`: folders by their indexes, as other commands open them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import STOPPED_BY_KEYBOARD, screen
from motionary.cli.options import AsJson, LibraryDefault, flag, option
from motionary.cli.recordings import WorkOptions, find_files, read_recording, warn_of_all
from motionary.errors import UnreadableFile, UnwritableFile
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.batch import Workers
    from motionary.features import FeatureSet
    from motionary.retrieval.duplicates import DuplicateResult, Occurrence
    from motionary.retrieval.index import Changes, Index
    from motionary.retrieval.index import Collection as Features

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


@dataclass(frozen=True)
class Opened:
    """Recordings that are ready to be searched.

    Attributes
    ----------
    collection : their features
    files : by name
    is_complete : whether all that was asked for could be read
    is_stopped : whether reading was stopped from the keyboard
    """

    collection: "Features"
    files: Mapping[str, Path]
    is_complete: bool
    is_stopped: bool = False


@dataclass(frozen=True, kw_only=True)
class Opener:
    """How recordings are opened: what files do not say, and what is measured."""

    reading: ReadOptions
    feature_set: "FeatureSet"
    jobs: "Workers"

    def open(self, paths: Sequence[str], options: IndexOptions) -> Opened:
        """Features of folders, files and patterns; reports what could not be read.

        Raises
        ------
        BadParameter
            If an index is named and refused.
        """
        from motionary.retrieval.index.sources import is_list, is_url

        folders = [path for path in paths if Path(path).is_dir()]
        needs_index = options.index is not None or any(is_url(p) or is_list(p) for p in paths)
        if needs_index and options.no_index:
            raise typer.BadParameter(
                "goes without --index, URLs and lists", param_hint="--no-index"
            )
        if options.no_index or not (folders or needs_index):
            return self._read(paths)
        if len(paths) > 1 and not needs_index:
            return self._open_several(paths, folders)
        index, is_stopped = self._update(paths, options.index)
        if index is None:
            return self._read(paths)
        collection = self._features_in(index)
        failed = warn_of_all(list_missing(index), collection.failures, given=paths)
        is_complete = not (failed or is_stopped)
        return Opened(collection, _FilesOf(index, collection), is_complete, is_stopped)

    def _update(self, paths: Sequence[str], at: str | None) -> "tuple[Index | None, bool]":
        """The index of recordings, up to date; None where the cache cannot be written."""
        index = open_index(paths, self.feature_set, at=at, reading=self.reading)
        try:
            return index, update_index(index, index.changes(), jobs=self.jobs)
        except UnwritableFile as error:
            if at is not None:
                raise
            screen.warn(f"nothing is kept for the next time: {error}")
            return None, False

    def _features_in(self, index: "Index") -> "Features":
        """What an index holds, over the set that is asked for if it leads the index's own."""
        collection = index.collection()
        published = collection.published
        return published if published.feature_set == self.feature_set else collection

    def _read(self, paths: Sequence[str]) -> Opened:
        found = find_files(paths, self.reading)
        with screen.progress("reading", len(found.files)) as done:
            collection = self._collect(found.files, on_done=done)
        return Opened(collection, found.files, not found.warn(collection.failures))

    def _collect(self, files: Mapping[str, Path], **on_done: Any) -> "Features":
        from motionary.retrieval.index import read_collection

        return read_collection(
            files.items(), reading=self.reading, feature_set=self.feature_set, jobs=self.jobs,
            **on_done,
        )  # fmt: skip

    def _open_several(self, paths: Sequence[str], folders: Sequence[str]) -> Opened:
        """Folders, each by its index, and single files, under names that tell them apart."""
        from motionary.retrieval.index import join_collections

        found = find_files(paths, self.reading)
        names = {path.absolute(): name for name, path in found.files.items()}
        collections, renamed, is_stopped = [], [], False
        for folder in folders:
            if folder in found.missing or is_stopped:
                continue
            index, is_stopped = self._update([folder], None)
            if index is None:
                return self._read(paths)
            collection = self._features_in(index)
            inside = ((name, (index.folder / name).absolute()) for name in _names(collection))
            collections.append(collection)
            # Of a recording that lies in two of the folders only the first counts.
            renamed.append({name: names.pop(path) for name, path in inside if path in names})
        rest = {name: found.files[name] for name in names.values()}
        if rest and not is_stopped:
            collections.append(self._collect(rest))
            renamed.append({name: name for name in rest})
        if not collections:
            return self._read(paths)
        joined = join_collections(collections, renamed)
        failed = found.warn(joined.failures)
        return Opened(joined, found.files, not (failed or is_stopped), is_stopped)


class _FilesOf(Mapping[str, Path]):
    """Files of the recordings of an index, without making thousands of paths."""

    def __init__(self, index: "Index", collection: "Features") -> None:
        self._index = index
        self._collection = collection

    def __getitem__(self, name: str) -> Path:
        return Path(self._index.address(name))

    def __iter__(self) -> Iterator[str]:
        return (sequence.source for sequence in self._collection.sequences)

    def __len__(self) -> int:
        return len(self._collection)


def _names(collection: "Features") -> list[str]:
    read = [name for part in collection.parts for name in part.shard.names] if collection else []
    return read + [failure.item[0] for failure in collection.failures]


def open_index(
    paths: Sequence[str], feature_set: "FeatureSet", *, at: str | None, reading: ReadOptions
) -> "Index":
    """The index that answers over a feature set; warns of one that holds too few features."""
    from motionary.retrieval.index import Index

    chosen = Index.choose_set(paths, feature_set, at=at, reading=reading)
    if len(chosen) < len(feature_set):
        screen.warn(
            f"{at}: an index of the {len(chosen)} published features, so examples are compared "
            "as published; to compare them between people and styles, remove it or name another "
            "place: it is then made anew"
        )
    return Index.open(paths, at=at, reading=reading, feature_set=chosen)


def list_missing(index: "Index") -> list[UnreadableFile]:
    """Why sources have no recordings, if they have none."""
    if len(index) or index.failures:
        return []
    if len(index.sources) > 1 or index.sources[0].is_remote:
        return [UnreadableFile("no recordings there", file=s.folder) for s in index.sources]
    return list(find_files([str(index.folder)]).missing.values())


def update_index(index: "Index", changes: "Changes", *, jobs: "Workers") -> bool:
    """Read what changed; whether that was stopped from the keyboard.

    Raises
    ------
    UnreadableFile
        If nothing that the index holds is in the folder, and it was named, or the folder is empty.
    """
    if changes.leaves_nothing and (index.is_named or not changes.states):
        raise UnreadableFile(
            f"none of the {len(changes.gone)} recordings of the index in {index.place} is there; "
            "name the folder that it was made of, or another place by --index; to have it made "
            "anew, remove it",
            file=index.folder,
        )
    for reason in (*index.damage, *changes.skipped):
        screen.warn(reason)
    try:
        with screen.progress("reading", len(changes.to_read)) as done:
            index.update(changes, jobs=jobs, on_done=done)
    except KeyboardInterrupt:
        if not len(index):
            raise
        screen.warn(
            f"stopped: {len(index)} of {len(changes.states)} recordings are ready; the same "
            "command reads the others"
        )
        return True
    return False


# -- commands ---------------------------------------------------------------------------


def index(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="SOURCE",
            help="Folders, searched to the bottom, files, URLs, and @LIST: a text file with one of "
            "them a line.",
        ),
    ],
    place: Annotated[
        str | None,
        typer.Option(
            "--index",
            metavar="PATH",
            help="Folder to keep what was read in; by default in the cache.",
        ),
    ] = None,
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
    motionary index /archive --index /archive-index --scheduler tcp://host:8786
    """
    from motionary.features import SEQUENCE_HZ, load_everyday_set

    opened = open_index(sources, load_everyday_set(), at=place, reading=reading)
    changes = opened.changes()
    with work.open() as workers:
        is_stopped = update_index(opened, changes, jobs=workers)
    failed = warn_of_all(list_missing(opened), opened.failures)
    counts = {
        "recordings": len(opened),
        "words": opened.n_frames,
        "read": opened.count_ready(changes.to_read),
        "gone": len(changes.gone),
        "failed": len(opened.failures),
    }
    if as_json:
        screen.print_json({**counts, "place": str(opened.place)})
    else:
        hours = opened.n_frames / SEQUENCE_HZ / 3600
        screen.say(
            f"{len(opened)} recordings, {hours:.2f} hours; read {counts['read']}, "
            f"{len(changes.gone)} gone, {len(opened.failures)} could not be read",
            f"kept in {opened.place}",
        )
    if is_stopped:
        return STOPPED_BY_KEYBOARD
    return 1 if failed else 0


def duplicates(
    folder: Annotated[str, typer.Argument(metavar="A", help="Folder or file of recordings.")],
    other: Annotated[
        str | None,
        typer.Argument(metavar="B", help="Recordings to compare with; those of A if left out."),
    ] = None,
    as_json: AsJson = False,
    *,
    least_bits: Annotated[
        float,
        typer.Option(
            "--bits",
            min=0.0,
            metavar="BITS",
            default_factory=LibraryDefault(
                "motionary.retrieval.duplicates:Comparing", "least_bits"
            ),
            help="Least self-information of what two recordings have in common.",
        ),
    ],
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
        opener = Opener(reading=reading, feature_set=FULL_BODY, jobs=workers)
        sides = [opener.open([side], index) for side in (folder, other) if side is not None]
    left, right = sides[0], sides[-1]
    result = find_duplicates(
        left.collection,
        right.collection if other else None,
        read=lambda name: read_recording(left.files[name], reading),
        read_right=lambda name: read_recording(right.files[name], reading),
        comparing=Comparing(least_bits=least_bits),
    )
    if as_json:
        _say_json(result)
    else:
        _say(result)
    for failure in result.failures:
        screen.warn(f"{failure.item}: {failure.error}")
    if any(side.is_stopped for side in sides):
        return STOPPED_BY_KEYBOARD
    is_complete = all(side.is_complete for side in sides) and not result.failures
    return 0 if is_complete and result.duplicates else 1


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
        screen.say(f"{len(result.still)} recordings change too little to be told apart")
