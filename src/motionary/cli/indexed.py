"""What is searched: folders by their index, single files as they are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motionary.cli import screen
from motionary.cli.inputs import find_files, warn_of_all
from motionary.errors import UnreadableFile, UnwritableFile

if TYPE_CHECKING:
    from motionary.features import FeatureSet
    from motionary.io import ReadOptions
    from motionary.retrieval.index import Changes, Collection, Index


@dataclass(frozen=True, kw_only=True)
class IndexOptions:
    """Where the words of a folder are kept."""

    index: Annotated[
        str | None,
        typer.Option(
            metavar="PATH",
            help="Folder that keeps what was read of the recordings; by default in the cache.",
        ),
    ] = None
    no_index: Annotated[
        bool, typer.Option("--no-index", help="Read all recordings anew, and keep nothing.")
    ] = False


@dataclass(frozen=True)
class Opened:
    """Recordings that are ready to be searched.

    Attributes
    ----------
    collection : their words
    files : by name
    is_complete : whether all that was asked for could be read
    is_stopped : whether reading was stopped from the keyboard
    """

    collection: "Collection"
    files: Mapping[str, Path]
    is_complete: bool
    is_stopped: bool = False


def open_recordings(
    paths: Sequence[str],
    options: IndexOptions,
    *,
    reading: "ReadOptions",
    feature_set: "FeatureSet",
    jobs: int,
) -> Opened:
    """Words of folders, files and patterns; tells what could not be read.

    Raises
    ------
    BadParameter
        If one index is named for several folders.
    """
    folders = [path for path in paths if Path(path).is_dir()]
    if options.index is not None and (len(paths) != 1 or not folders or options.no_index):
        raise typer.BadParameter("keeps the words of one folder", param_hint="--index")
    if options.no_index or not folders:
        return _read(paths, reading=reading, feature_set=feature_set, jobs=jobs)
    if len(paths) > 1:
        return _open_several(paths, folders, reading=reading, feature_set=feature_set, jobs=jobs)
    index, stopped = _update(folders[0], options.index, reading, feature_set, jobs)
    if index is None:
        return _read(paths, reading=reading, feature_set=feature_set, jobs=jobs)
    collection = index.collection()
    missing = list_missing(index)
    failed = warn_of_all(missing, collection.failures)
    files = _FilesOf(index.folder, collection)
    return Opened(collection, files, not (failed or stopped), stopped)


def update_index(index: "Index", changes: "Changes", *, jobs: int) -> bool:
    """Read what changed; whether that was stopped from the keyboard."""
    try:
        with screen.progress("reading", len(changes.to_read)) as done:
            index.update(changes, jobs=jobs, on_done=done)
    except KeyboardInterrupt:
        if not len(index):
            raise
        n_there = len(changes.states)
        screen.warn(
            f"stopped: {len(index)} of {n_there} recordings are ready; the same command reads "
            "the others"
        )
        return True
    return False


class _FilesOf(Mapping[str, Path]):
    """Files of the recordings of a folder, without making thousands of paths."""

    def __init__(self, folder: Path, collection: "Collection") -> None:
        self._folder = folder
        self._collection = collection

    def __getitem__(self, name: str) -> Path:
        return self._folder / name

    def __iter__(self):  # type: ignore[no-untyped-def]
        return (sequence.source for sequence in self._collection.sequences)

    def __len__(self) -> int:
        return len(self._collection)


def _update(
    folder: str, at: str | None, reading: "ReadOptions", feature_set: "FeatureSet", jobs: int
) -> "tuple[Index | None, bool]":
    """The index of a folder, up to date; None where the cache cannot be written."""
    from motionary.retrieval.index import Index

    index = Index.open(folder, at=at, reading=reading, feature_set=feature_set)
    try:
        return index, update_index(index, index.changes(), jobs=jobs)
    except UnwritableFile as error:
        if at is not None:
            raise
        screen.warn(f"nothing is kept for the next time: {error}")
        return None, False


def _read(
    paths: Sequence[str], *, reading: "ReadOptions", feature_set: "FeatureSet", jobs: int
) -> Opened:
    from motionary.retrieval.index import read_collection

    found = find_files(paths)
    with screen.progress("reading", len(found.files)) as done:
        collection = read_collection(
            found.files.items(), reading=reading, feature_set=feature_set, jobs=jobs, on_done=done
        )
    failed = warn_of_all(found.missing.values(), collection.failures, given=paths)
    return Opened(collection, found.files, not failed)


def _open_several(
    paths: Sequence[str],
    folders: Sequence[str],
    *,
    reading: "ReadOptions",
    feature_set: "FeatureSet",
    jobs: int,
) -> Opened:
    """Several folders, each by its index, and single files, under names that tell them apart."""
    from motionary.retrieval.index import join_collections, read_collection

    found = find_files(paths)
    names = {path.absolute(): name for name, path in found.files.items()}
    collections, renamed, stopped = [], [], False
    for folder in folders:
        if folder in found.missing or stopped:
            continue
        index, stopped = _update(folder, None, reading, feature_set, jobs)
        if index is None:
            return _read(paths, reading=reading, feature_set=feature_set, jobs=jobs)
        collection = index.collection()
        inside = {name: (index.folder / name).absolute() for name in _names(collection)}
        collections.append(collection)
        # Of a recording that lies in two of the folders only the first counts.
        renamed.append({name: names.pop(path) for name, path in inside.items() if path in names})
    rest = {name: found.files[name] for name in names.values()}
    if rest and not stopped:
        single = read_collection(rest.items(), reading=reading, feature_set=feature_set, jobs=jobs)
        collections.append(single)
        renamed.append({name: name for name in rest})
    if not collections:
        return _read(paths, reading=reading, feature_set=feature_set, jobs=jobs)
    collection = join_collections(collections, renamed)
    failed = warn_of_all(found.missing.values(), collection.failures, given=paths)
    return Opened(collection, found.files, not (failed or stopped), stopped)


def _names(collection: "Collection") -> list[str]:
    failed = [failure.item[0] for failure in collection.failures]
    read = [name for part in collection.parts for name in part.shard.names] if collection else []
    return read + failed


def list_missing(index: "Index") -> list[UnreadableFile]:
    """Why a folder has no recordings, if it has none."""
    if len(index) or index.failures:
        return []
    return list(find_files([str(index.folder)]).missing.values())
