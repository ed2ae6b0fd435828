"""Recordings that a command works on: found by path, read, or opened by the index of a folder."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import typer

from motionary.cli import screen
from motionary.cli.options import flag, option
from motionary.errors import NotAFile, NotAMotion, NotHuman, UnreadableFile, UnwritableFile
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.batch import Failure, Workers
    from motionary.features import FeatureSequence, FeatureSet, NamedFile
    from motionary.motion import Motion
    from motionary.retrieval.index import Changes, Index
    from motionary.retrieval.index import Collection as Features

Result = TypeVar("Result")


# -- files ------------------------------------------------------------------------------


class Found(NamedTuple):
    """Recordings by name, what was given, and for each path that means none the reason."""

    files: dict[str, Path]
    missing: dict[str, UnreadableFile]
    given: tuple[str, ...]

    def warn(self, failures: "Iterable[Failure[NamedFile]]" = ()) -> int:
        """Say what is missing and what could not be read; the code that a command ends with."""
        return int(warn_of_all(self.missing.values(), failures, given=self.given))


def find_files(paths: Iterable[str], reading: ReadOptions | None = None) -> Found:
    """Recordings of files, folders and patterns; one wrong path does not stop the others.

    Of files with several recordings each is one, unless `reading` names a take.
    """
    from motionary.io import name_recordings

    missing: dict[str, UnreadableFile] = {}
    given = tuple(paths)
    files = name_recordings(
        given,
        on_skip=screen.warn,
        on_missing=lambda path, error: missing.update({str(path): error}),
        split=reading is None or reading.take is None,
    )
    return Found(files, missing, given)


def read_recording(path: Path, reading: ReadOptions) -> "Motion":
    """A motion, read as its features were: options that other formats take are left out."""
    from motionary.io import read

    return read(path, reading.for_file(path))


def read_motions(
    files: Mapping[str, Path], reading: ReadOptions
) -> "Iterator[Motion | Failure[NamedFile]]":
    """Motions under the names of their files, with a bar."""
    return map_files(partial(_read_named, reading=reading), files, "reading", jobs=1)


def _read_named(file: "NamedFile", *, reading: ReadOptions) -> "Motion":
    return read_recording(file[1], reading).renamed(file[0])


def map_files(
    work: "Callable[[NamedFile], Result]", files: Mapping[str, Path], what: str, *, jobs: int
) -> "Iterator[Result | Failure[NamedFile]]":
    """Results of a function for each file, with a bar that says `what` is done."""
    from motionary.batch import map_ordered

    with screen.progress(what, len(files)) as done:
        yield from map_ordered(work, files.items(), jobs=jobs, on_done=done)


def measure_files(
    files: Mapping[str, Path],
    what: str,
    *,
    reading: ReadOptions,
    feature_set: "FeatureSet",
    jobs: "Workers",
) -> "Iterator[FeatureSequence | Failure[NamedFile]]":
    """Features of each file, with a bar that says `what` is done."""
    from motionary.features import read_features

    with screen.progress(what, len(files)) as done:
        yield from read_features(
            files.items(), options=reading, feature_set=feature_set, jobs=jobs, on_done=done
        )


def measure_all(
    found: Found, what: str, *, reading: ReadOptions, feature_set: "FeatureSet", jobs: "Workers"
) -> "tuple[list[FeatureSequence], list[Failure[NamedFile]]]":
    """Features of all files that can be read, and those that cannot."""
    return split_failures(
        measure_files(found.files, what, reading=reading, feature_set=feature_set, jobs=jobs)
    )


def split_failures(
    items: "Iterable[Result | Failure[NamedFile]]",
) -> "tuple[list[Result], list[Failure[NamedFile]]]":
    """What was done, and what could not be."""
    from motionary.batch import Failure

    done: list[Result] = []
    failures: list[Failure[NamedFile]] = []
    for item in items:
        if isinstance(item, Failure):
            failures.append(item)
        else:
            done.append(item)
    return done, failures


def warn_of_all(
    missing: Iterable[UnreadableFile],
    failures: "Iterable[Failure[NamedFile]]",
    *,
    given: Iterable[str] = (),
) -> bool:
    """Say on stderr which paths mean nothing and which recordings could not be read.

    Parameters
    ----------
    given : what the person named; the rest was found in folders and by patterns

    Returns
    -------
    whether an input failed; what was found in a folder and is no motion of a person (arrays of
    something else, an animal) is reported and passed over
    """
    failed = False
    named = set(given)
    for error in missing:
        screen.warn(str(error))
        failed = True
    for failure in failures:
        passed = is_passed_over(failure, named)
        screen.warn(describe_failure(failure) + ("; passed over" if passed else ""))
        failed = failed or not passed
    return failed


def is_passed_over(failure: "Failure[NamedFile]", given: Collection[str]) -> bool:
    """Whether a file is no motion of a person, and was not named but found."""
    is_other = isinstance(failure.error, (NotAFile, NotAMotion, NotHuman))
    named = {Path(path).absolute() for path in given}
    return is_other and not {path.absolute() for path in _paths_of(failure)} & named


def describe_failure(failure: "Failure[NamedFile]") -> str:
    """Why a recording could not be read, under its name whatever the error calls its file."""
    return failure.item[0] + failure.error.text_after(*_paths_of(failure))


def _paths_of(failure: "Failure[NamedFile]") -> tuple[Path, Path]:
    """The path of a recording, and that of its file, which may hold several."""
    from motionary.io import file_of

    path = failure.item[1]
    return path, file_of(path)


# -- folders and their indexes ----------------------------------------------------------


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
