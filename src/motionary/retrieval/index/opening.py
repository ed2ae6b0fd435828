"""Recordings of folders, files and lists opened for a search: by their indexes, or read anew."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from motionary.batch import Workers
from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.features import FeatureSet
from motionary.io import ReadOptions, name_recordings
from motionary.retrieval.index.changes import Changes
from motionary.retrieval.index.collection import Collection, join_collections, read_collection
from motionary.retrieval.index.folder import Index
from motionary.retrieval.index.sources import Source, is_list, is_url

__all__ = ["Follower", "Opened", "Opener"]


class Follower(Protocol):
    """Follows the reading: a screen, a log."""

    def warn(self, text: str) -> None:
        """Take a warning."""
        ...

    def progress(self, what: str, total: int) -> AbstractContextManager[Callable[..., None]]:
        """Context of so many steps; what it yields is called after each."""
        ...


@dataclass(frozen=True)
class Opened:
    """Recordings that are ready to be searched.

    Attributes
    ----------
    collection : their features, and what could not be read
    files : by name
    missing : why paths lead to no recording
    is_stopped : whether reading was stopped from the keyboard
    """

    collection: Collection
    files: Mapping[str, Path]
    missing: Sequence[UnreadableFile] = ()
    is_stopped: bool = False


@dataclass(frozen=True, kw_only=True)
class Opener:
    """How recordings are opened: what files do not say, what is measured, and by whom."""

    reading: ReadOptions
    feature_set: FeatureSet
    jobs: Workers
    follower: Follower

    def open(self, paths: Sequence[str], *, at: str | None = None, kept: bool = True) -> Opened:
        """Features of folders, files and patterns; one wrong path does not stop the others.

        Parameters
        ----------
        paths : folders, files, patterns, URLs, and lists of them
        at : folder of their index; by default each folder has one in the cache
        kept : whether indexes are used, and what is read is kept there
        """
        folders = [path for path in paths if Path(path).is_dir()]
        needs_index = needs_one_index(paths, at)
        if not kept or not (folders or needs_index):
            return self._read(paths)
        if len(paths) > 1 and not needs_index:
            return self._open_several(paths, folders)
        index, is_stopped = self._update(paths, at)
        if index is None:
            return self._read(paths)
        collection = self._features_in(index)
        return Opened(collection, _FilesOf(index, collection), self.missing_of(index), is_stopped)

    def _update(self, paths: Sequence[str], at: str | None) -> tuple[Index | None, bool]:
        """The index of recordings, up to date; None where the cache cannot be written."""
        index = self.open_index(paths, at)
        try:
            changes = index.changes()
            _check_sources(index, changes)
            return index, self.update_index(index, changes)
        except UnwritableFile as error:
            if at is not None:
                raise
            self.follower.warn(f"nothing is kept for the next time: {error}")
            return None, False

    def _features_in(self, index: Index) -> Collection:
        """What an index holds, over the set that is asked for if it leads the index's own."""
        collection = index.collection()
        published = collection.published
        return published if published.feature_set == self.feature_set else collection

    def _read(self, paths: Sequence[str]) -> Opened:
        files, missing = self._find(paths)
        with self.follower.progress("reading", len(files)) as done:
            collection = self._collect(files, on_done=done)
        return Opened(collection, files, list(missing.values()))

    def _find(self, paths: Iterable[str]) -> tuple[dict[str, Path], dict[str, UnreadableFile]]:
        missing: dict[str, UnreadableFile] = {}
        files = name_recordings(
            list(paths), on_skip=self.follower.warn, split=self.reading.take is None,
            on_missing=lambda path, error: missing.update({str(path): error}),
        )  # fmt: skip
        return files, missing

    def _collect(self, files: Mapping[str, Path], **on_done: Any) -> Collection:
        return read_collection(
            files.items(), reading=self.reading, feature_set=self.feature_set, jobs=self.jobs,
            **on_done,
        )  # fmt: skip

    def _open_several(self, paths: Sequence[str], folders: Sequence[str]) -> Opened:
        """Folders, each by its index, and single files, under names that tell them apart."""
        files, missing = self._find(paths)
        names = {path.absolute(): name for name, path in files.items()}
        collections, renamed, is_stopped = [], [], False
        for folder in folders:
            if folder in missing or is_stopped:
                continue
            index, is_stopped = self._update([folder], None)
            if index is None:
                return self._read(paths)
            collection = self._features_in(index)
            inside = ((name, (index.folder / name).absolute()) for name in _names(collection))
            collections.append(collection)
            # Of a recording that lies in two of the folders only the first counts.
            renamed.append({name: names.pop(path) for name, path in inside if path in names})
        rest = {name: files[name] for name in names.values()}
        if rest and not is_stopped:
            collections.append(self._collect(rest))
            renamed.append({name: name for name in rest})
        if not collections:
            return self._read(paths)
        joined = join_collections(collections, renamed)
        return Opened(joined, files, list(missing.values()), is_stopped)

    def open_index(self, paths: Sequence[str], at: str | None) -> Index:
        """The index that answers over the features; warns of one that holds too few."""
        chosen = Index.choose_set(paths, self.feature_set, at=at, reading=self.reading)
        if len(chosen) < len(self.feature_set):
            self.follower.warn(
                f"{at}: an index of the {len(chosen)} published features, so examples are "
                "compared as published; to compare them between people and styles, remove it or "
                "name another place: it is then made anew"
            )
        return Index.open(paths, at=at, reading=self.reading, feature_set=chosen)

    def missing_of(self, index: Index) -> list[UnreadableFile]:
        """Why sources have no recordings, if they have none."""
        if len(index) or index.failures:
            return []
        if len(index.sources) > 1 or index.sources[0].is_remote:
            return [UnreadableFile("no recordings there", file=s.folder) for s in index.sources]
        return list(self._find([str(index.folder)])[1].values())

    def update_index(self, index: Index, changes: Changes) -> bool:
        """Read what changed; whether that was stopped from the keyboard.

        Raises
        ------
        UnreadableFile
            If nothing that the index holds is in the folder, and it was named or the folder is
            empty.
        """
        if changes.leaves_nothing and (index.is_named or not changes.states):
            raise UnreadableFile(
                f"none of the {len(changes.gone)} recordings of the index in {index.place} is "
                "there under its name (of several sources names begin with the source); give all "
                "sources that it was made of, or another place by --index; to have it made anew, "
                "remove it",
                file=index.folder,
            )
        for reason in (*index.damage, *changes.skipped):
            self.follower.warn(reason)
        try:
            with self.follower.progress("reading", len(changes.to_read)) as done:
                index.update(changes, jobs=self.jobs, on_done=done)
        except KeyboardInterrupt:
            if not len(index):
                raise
            self.follower.warn(
                f"stopped: {len(index)} of {len(changes.states)} recordings are ready; the same "
                "command reads the others"
            )
            return True
        return False


def _check_sources(index: Index, changes: Changes) -> None:
    """Refuse to forget what an index holds of recordings that are there, but not given.

    Raises
    ------
    InvalidInput
    """
    others = [name for name in changes.gone if _is_left_out(name, index.sources)]
    if others:
        raise InvalidInput(
            f"the index in {index.place} holds {len(others)} recordings that are not given, such "
            f"as {others[0]}; give all that it was made of, or name another place by --index; "
            "`motionary index` with these sources alone forgets the others"
        )


def _is_left_out(name: str, sources: Iterable[Source]) -> bool:
    """Whether a recording is of another source, or of one of which other files are chosen."""
    source = next((source for source in sources if name.startswith(source.prefix)), None)
    if source is None:
        return True
    inside = name.removeprefix(source.prefix)
    is_chosen = source.chosen is None or inside in source.chosen
    return not is_chosen and Path(source.address(inside)).exists()


def needs_one_index(paths: Iterable[str], at: str | None) -> bool:
    """Whether recordings have one index: it is named, or they are not all here."""
    return at is not None or any(is_url(path) or is_list(path) for path in paths)


class _FilesOf(Mapping[str, Path]):
    """Files of the recordings of an index, without making thousands of paths."""

    def __init__(self, index: Index, collection: Collection) -> None:
        self._index = index
        self._collection = collection

    def __getitem__(self, name: str) -> Path:
        return Path(self._index.address(name))

    def __iter__(self) -> Iterator[str]:
        return (sequence.source for sequence in self._collection.sequences)

    def __len__(self) -> int:
        return len(self._collection)


def _names(collection: Collection) -> list[str]:
    read = [name for part in collection.parts for name in part.shard.names] if collection else []
    return read + [failure.item[0] for failure in collection.failures]
