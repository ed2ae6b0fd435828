"""How shards are made: portions of files, each read, featured and written by one worker.

A worker writes the shard of its portion and tells its name; what counts is decided by the one
process that writes the manifest. Small shards are joined in the same way. Portions depend on
the files alone, so that an index is the same to the byte whoever makes it.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from motionary.batch import Failure, Workers, map_ordered
from motionary.errors import MotionaryError, UnwritableFile
from motionary.features import FeatureSequence, FeatureSet, NamedFile, read_features
from motionary.io import FileState, ReadOptions, file_of
from motionary.retrieval.index.shard import ROW, StoredShard, join_shards, make_shard
from motionary.retrieval.index.shard_files import write_shard
from motionary.retrieval.index.sources import fetch

# Most files of a portion, and from so many bytes on it is full.
_FILES = 64
_BYTES = 1 << 23

#: Shards are joined until they have so many frames; so many smaller ones may stay.
LARGE = 1 << 22
SMALL_ONES = 8


class ToRead(NamedTuple):
    """A file to be read, and the state that tells it from its later self.

    Attributes
    ----------
    url : where it is fetched from, before it is read; empty for a file that is here
    """

    name: str
    path: Path
    state: FileState
    sidecar: int
    url: str = ""

    @property
    def file(self) -> NamedFile:
        """Name and path."""
        return self.name, self.path


class Built(NamedTuple):
    """What became of a portion.

    Attributes
    ----------
    shard : name of the shard that was written; empty if nothing could be read
    failures : of files that could not be read
    is_stopped : whether it was interrupted from the keyboard; then what is ready is written,
        and `n_done` files are
    """

    shard: str
    failures: tuple[Failure[ToRead], ...]
    n_done: int
    is_stopped: bool = False


class Building(NamedTuple):
    """How the files of an index are read and where shards go."""

    place: Path
    feature_set: FeatureSet
    reading: ReadOptions

    def read(self, files: Sequence[ToRead], *, jobs: Workers, on_done: "OnDone") -> Iterator[Built]:
        """Shards of files in portions, in the order of the files.

        A portion during which a worker ended is read again file by file, so that only the file
        that ends workers is a failure.

        Raises
        ------
        UnwritableFile
            If a shard cannot be written.
        Unreachable
            If a cluster is gone.
        """
        portions = list(_divide(files))
        here = on_done if jobs == 1 else None
        build = partial(_build, building=self, on_done=here)
        n_done = 0
        for result in map_ordered(build, portions, jobs=jobs):
            for built in self._take(result, jobs):
                yield built
                done = files[n_done : n_done + built.n_done]
                n_done += built.n_done
                if on_done is not None and here is None:
                    for file in done:
                        on_done(file.file)

    def _take(self, built: Built | Failure[list[ToRead]], jobs: Workers) -> Iterator[Built]:
        if isinstance(built, Built):
            yield built
        elif isinstance(built.error, UnwritableFile):
            raise built.error
        elif len(built.item) == 1:
            yield Built("", (Failure(built.item[0], built.error),), 1)
        else:
            alone = [[file] for file in built.item]
            for one in map_ordered(partial(_build, building=self), alone, jobs=jobs):
                yield from self._take(one, jobs)

    def join(self, groups: Sequence[Sequence[str]], *, jobs: Workers) -> Iterator[str]:
        """Names of the shards that groups of shards become.

        Raises
        ------
        UnwritableFile, Unreachable
        """
        for name in map_ordered(partial(_join, building=self), groups, jobs=jobs):
            if isinstance(name, Failure):
                raise name.error
            yield name


#: Called after each file.
OnDone = Callable[[NamedFile], None] | None


def _divide(files: Sequence[ToRead]) -> Iterator[list[ToRead]]:
    """Portions of files; a file of several recordings counts once where they stand together."""
    portion: list[ToRead] = []
    n_bytes = 0
    for file in files:
        if not portion or file_of(portion[-1].path) != file_of(file.path):
            n_bytes += max(file.state.size, 0)
        portion.append(file)
        if len(portion) == _FILES or n_bytes >= _BYTES:
            yield portion
            portion, n_bytes = [], 0
    if portion:
        yield portion


def _build(portion: list[ToRead], *, building: Building, on_done: OnDone = None) -> Built:
    """Read a portion, fetched first where it lies elsewhere, and write its shard."""
    if not any(file.url for file in portion):
        return _build_here(portion, building=building, on_done=on_done)
    here: list[ToRead] = []
    failures = []
    numbers: dict[str, int] = {}
    with TemporaryDirectory(prefix="motionary-") as folder:
        for file in portion:
            try:
                # Files of one folder lie in one, each once.
                number = numbers.setdefault(file.url.rpartition("/")[0], len(numbers))
                place = Path(folder, str(number))
                here.append(file._replace(path=fetch(file.url, place)) if file.url else file)
            except MotionaryError as error:
                failures.append(Failure(file, error))
                if on_done is not None:
                    on_done(file.file)
        built = _build_here(here, building=building, on_done=on_done)
    n_done = built.n_done + len(failures)
    return built._replace(failures=(*failures, *built.failures), n_done=n_done)


def _build_here(portion: list[ToRead], *, building: Building, on_done: OnDone) -> Built:
    """Read a portion and write its shard."""
    read: list[FeatureSequence] = []
    rows, failures = [], []
    is_stopped = False
    items = read_features(
        [file.file for file in portion],
        options=building.reading,
        feature_set=building.feature_set,
        on_done=on_done,
    )
    try:
        for file, item in zip(portion, items, strict=True):
            if isinstance(item, Failure):
                failures.append(Failure(file, item.error))
                continue
            read.append(item)
            state = file.state
            rows.append((0, 0, 0, 0.0, state.mtime_ns, state.size, file.sidecar))
    except KeyboardInterrupt:
        is_stopped = True
    name = ""
    if read:
        shard = make_shard(read, building.feature_set, states=np.array(rows, dtype=ROW))
        try:
            name = write_shard(shard, building.place)
        except KeyboardInterrupt:
            # What is written twice is there once.
            name, is_stopped = write_shard(shard, building.place), True
    return Built(name, tuple(failures), len(read) + len(failures), is_stopped)


def _join(names: Sequence[str], *, building: Building) -> str:
    feature_set = building.feature_set
    shards = [StoredShard(building.place, name, feature_set, feature_set).open() for name in names]
    return write_shard(join_shards(shards), building.place)
