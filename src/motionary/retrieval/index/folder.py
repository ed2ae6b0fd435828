"""Index of recordings, kept on disk: only what changed is read again.

An index lies in the user's cache, or where the caller says. Recordings are read in portions;
each is kept when it is complete, so that an interrupted run is taken up where it ended. Files
that could not be read are remembered with their reason until they change. A recording is told
from its earlier self by the time and the size of its file, and of its sidecar.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from motionary import __version__
from motionary.batch import Failure, Workers
from motionary.errors import (
    InvalidInput,
    MotionaryError,
    NotAFile,
    NotAMotion,
    NotHuman,
    UnreadableFile,
)
from motionary.features import FULL_BODY, FeatureSet, NamedFile, load_everyday_set
from motionary.files import LEFT_ALONE_S
from motionary.io import ReadOptions
from motionary.retrieval.index.building import LARGE, SMALL_ONES, Building, Built, ToRead
from motionary.retrieval.index.changes import Changes, Seen, find_changes
from motionary.retrieval.index.collection import Collection
from motionary.retrieval.index.shard import Shard, select
from motionary.retrieval.index.shard_files import (
    FILE,
    read_shard,
    remove_leftovers,
    remove_shard,
    size_of_shard,
    write_shard,
)
from motionary.retrieval.index.sources import Source, cache_key, find_address, find_sources, is_url
from motionary.retrieval.index.storage import (
    DamagedIndex,
    FailedFile,
    Manifest,
    Recipe,
    cache_place,
    check_recipe,
    read_manifest,
    write_manifest,
)

# What is ready counts after so many seconds, if an update takes longer.
_COMMIT_EVERY_S = 2.0
# So many bytes of shards are compared with their checksums when an index is opened; of the
# rest all but the largest arrays are.
_CHECKED_BYTES = 1 << 30

# Errors that callers tell from others; an index keeps their class by its name.
_KINDS: dict[str, type[MotionaryError]] = {
    kind.__name__: kind for kind in (NotAFile, NotAMotion, NotHuman)
}

_ATTEMPTS = 3


class Index:
    """Features of the recordings of sources, kept on disk: open, update, collection.

    Attributes
    ----------
    sources : folders, chosen files and URLs; `folder` is that of the first
    place : the folder of the index
    feature_set : what the bits of the features mean
    damage : what was not as it had been written, and is read again, a line each
    is_named : whether somebody named its place; else it lies in the user's cache
    """

    def __init__(
        self,
        sources: tuple[Source, ...],
        place: Path,
        *,
        feature_set: FeatureSet,
        reading: ReadOptions,
    ) -> None:
        self.sources = sources
        self.folder = Path(sources[0].folder)
        self._by_label = {source.label: source for source in sources}
        self.place = place
        self.feature_set = feature_set
        self.reading = reading
        self._manifest = Manifest(Recipe.of(feature_set, reading))
        self._shards: dict[str, Shard] = {}
        self.damage: tuple[str, ...] = ()
        self.is_named = False

    def __repr__(self) -> str:
        folders = ", ".join(repr(source.folder) for source in self.sources)
        return f"Index({folders}, {len(self)} recordings, kept in {str(self.place)!r})"

    def address(self, name: str) -> str:
        """Path or URL of a recording."""
        return find_address(name, self._by_label)

    @classmethod
    def open(
        cls,
        sources: str | Path | Sequence[str | Path],
        *,
        at: str | Path | None = None,
        reading: ReadOptions | None = None,
        feature_set: FeatureSet | None = None,
    ) -> Self:
        """The index of recordings as it is; nothing is read from them yet.

        Parameters
        ----------
        sources : folders, files, URLs, and lists of them (`@list.txt`, one a line); where there
            are several, recordings are called by the end of their source's address, too
        at : folder of the index; by default one in the user's cache for this folder,
            feature set and reading
        reading : what the files do not say themselves
        feature_set : features to measure; by default those of `load_everyday_set`, or of the
            index at `at` if it holds the published ones alone

        Raises
        ------
        UnreadableFile
            If what lies at `at` is damaged, newer, or no index; an index in the cache is
            made anew instead.
        InvalidInput
            If the index at `at` has another feature set, or its files were read otherwise.
        """
        reading = reading or ReadOptions()
        found = find_sources(sources)
        chosen = feature_set or cls.choose_set(sources, load_everyday_set(), at=at, reading=reading)
        recipe = Recipe.of(chosen, reading)
        place = cache_place(cache_key(found), recipe) if at is None else Path(at)
        index = cls(found, place, feature_set=chosen, reading=reading)
        index.is_named = at is not None
        try:
            index._load()
        except DamagedIndex as error:
            index.damage = (f"{error}; all recordings are read again",)
        except (UnreadableFile, InvalidInput):
            if at is not None:
                raise
        return index

    @staticmethod
    def choose_set(
        sources: str | Path | Sequence[str | Path],
        wanted: FeatureSet,
        *,
        at: str | Path | None = None,
        reading: ReadOptions | None = None,
    ) -> FeatureSet:
        """Features of the index that answers: the everyday set holds the published ones, too.

        An index of the published ones that is named answers by these; one in the cache stays
        until a search needs the others.

        Parameters
        ----------
        wanted : set that is asked for
        sources, at, reading : as of `open`
        """
        if wanted not in (FULL_BODY, load_everyday_set()):
            return wanted
        for feature_set in (load_everyday_set(), FULL_BODY)[: 1 if at is None else 2]:
            recipe = Recipe.of(feature_set, reading or ReadOptions())
            place = (
                cache_place(cache_key(find_sources(sources)), recipe) if at is None else Path(at)
            )
            try:
                manifest = read_manifest(place)
            except (UnreadableFile, InvalidInput):
                continue
            if manifest is not None and manifest.recipe.feature_set == feature_set.name:
                return feature_set
        return wanted

    def __len__(self) -> int:
        return sum(len(shard) for shard in self._shards.values())

    @property
    def n_frames(self) -> int:
        """Frames of all recordings, at 30 Hz."""
        return sum(shard.n_frames for shard in self._shards.values())

    @property
    def n_bytes(self) -> int:
        """Bytes on disk."""
        return sum(file.stat().st_size for file in self.place.rglob("*") if file.is_file())

    @property
    def failures(self) -> tuple[Failure[NamedFile], ...]:
        """Files that could not be read, and why."""
        return tuple(
            Failure((name, Path(self.address(name))), _error(Path(name).name, f))
            for name, f in sorted(self._manifest.failures.items())
        )

    def count_ready(self, names: Iterable[str]) -> int:
        """How many of some recordings have been read, or found to be unreadable."""
        read = (name for shard in self._shards.values() for name in shard.names)
        ready = {*self._manifest.failures, *read}
        return sum(name in ready for name in names)

    def collection(self) -> Collection:
        """What is ready to be searched."""
        return Collection.of_shards(tuple(self._shards.values()), self.feature_set, self.failures)

    def changes(self) -> Changes:
        """What is new, changed or gone in the sources; reads no recording.

        Raises
        ------
        InvalidInput
            If no package reads a URL.
        UnreadableFile
            If a source is missing, or may not be read.
        """
        seen = {
            name: Seen(f.state.mtime_ns, f.state.size, f.sidecar, f.state.ctime_ns)
            for name, f in self._manifest.failures.items()
        }
        # Indexes of before do not say what kind a failure is of: those files are tried again.
        again = (name for name, f in self._manifest.failures.items() if not f.kind)
        seen |= dict.fromkeys(again, Seen(-1, -1, 0))
        for shard in self._shards.values():
            columns = (shard.table[key].tolist() for key in ("mtime_ns", "size", "companion"))
            seen.update(zip(shard.names, map(Seen, *columns), strict=True))
        if self._manifest.written_by != __version__:
            # Another version may read files otherwise.
            seen = dict.fromkeys(seen, Seen(-1, -1, 0))
        return find_changes(self.sources, seen, self._manifest.dependency_digest, self.reading)

    def update(
        self,
        changes: Changes | None = None,
        *,
        jobs: Workers = 1,
        on_done: Callable[[NamedFile], None] | None = None,
    ) -> Changes:
        """Read what is new or changed, forget what is gone, and keep the rest.

        What was read before an interruption is kept.

        Parameters
        ----------
        changes : from `changes`; looked for if left out
        jobs : processes that read, or a cluster whose workers see the folder and the index
            under the same paths; the result does not depend on it
        on_done : called after each file

        Raises
        ------
        UnreadableFile
            If the folder is missing, or may not be read.
        UnwritableFile
            If the index cannot be written.
        Unreachable
            If a cluster is gone; what was read before counts.
        """
        changes = self.changes() if changes is None else changes
        self._forget(changes)
        states, sidecars = changes.states, changes.sidecars
        # Workers of a cluster run elsewhere.
        files = [
            ToRead(n, Path(at).absolute(), states[n], sidecars[n], at * is_url(at))
            for n, at in ((name, self.address(name)) for name in changes.to_read)
        ]
        building = Building(self.place.absolute(), self.feature_set, self.reading.absolute())
        ready = _Ready(dict(self._manifest.failures), dict(self._shards))
        committed_at = time.monotonic()
        try:
            for built in building.read(files, jobs=jobs, on_done=on_done):
                try:
                    self._add(built, ready)
                except KeyboardInterrupt:
                    self._add(built, ready)
                    raise
                # Of hundreds of thousands of files, not after each portion.
                if time.monotonic() - committed_at > _COMMIT_EVERY_S:
                    self._commit(replace(self._manifest, failures=ready.failures), ready.shards)
                    ready = _Ready(dict(self._manifest.failures), dict(self._shards))
                    committed_at = time.monotonic()
                if built.is_stopped:
                    raise KeyboardInterrupt
        finally:
            self._commit(replace(self._manifest, failures=ready.failures), ready.shards)
        self._join_small(building, jobs)
        remove_leftovers(self.place, self._manifest.shards, before=time.time() - LEFT_ALONE_S)
        return changes

    def _load(self) -> None:
        for attempt in range(1, _ATTEMPTS + 1):
            manifest = read_manifest(self.place)
            if manifest is None:
                return
            check_recipe(self._manifest.recipe, manifest.recipe, self.place)
            shards, damage, n_bytes = {}, [], 0
            for name in manifest.shards:
                n_bytes += size_of_shard(self.place, name)
                is_checked = n_bytes <= _CHECKED_BYTES
                try:
                    shards[name] = read_shard(
                        self.place, name, self.feature_set, is_checked=is_checked
                    )
                except UnreadableFile as error:
                    damage.append(f"{error}; its recordings are read again")
            # Another process may have joined these shards meanwhile.
            if damage and attempt < _ATTEMPTS and read_manifest(self.place) != manifest:
                continue
            self._manifest, self._shards, self.damage = manifest, shards, tuple(damage)
            return

    def _forget(self, changes: Changes) -> None:
        """Take out what is gone or will be read again."""
        stale = {*changes.gone, *changes.to_read}
        shards: dict[str, Shard] = {}
        for name, shard in self._shards.items():
            fresh = np.flatnonzero([n not in stale for n in shard.names])
            if len(fresh) == len(shard):
                shards[name] = shard
            elif len(fresh):
                shards |= self._write(select([shard], [fresh]))
        failures = {n: f for n, f in self._manifest.failures.items() if n not in stale}
        manifest = replace(
            self._manifest,
            failures=failures,
            dependency_digest=changes.dependency_digest,
            written_by=__version__,
        )
        self._commit(manifest, shards)

    def _add(self, built: Built, ready: "_Ready") -> None:
        """Add what was read of a portion, and what could not be."""
        for file, error in ((failure.item, failure.error) for failure in built.failures):
            ready.failures[file.name] = FailedFile(
                file.state, file.sidecar, error.text_after(file.path), type(error).__name__
            )
        if built.shard:
            ready.shards[built.shard] = self._read(built.shard)

    def _join_small(self, building: Building, jobs: Workers) -> None:
        """Join small shards, so that an index that grew file by file stays fast."""
        small = {name: s.n_frames for name, s in self._shards.items() if s.n_frames < LARGE}
        if len(small) <= SMALL_ONES:
            return
        shards = {n: shard for n, shard in self._shards.items() if n not in small}
        groups: list[list[str]] = []
        n_frames = LARGE
        for name, length in small.items():
            if n_frames >= LARGE:
                groups.append([])
                n_frames = 0
            groups[-1].append(name)
            n_frames += length
        for name in building.join(groups, jobs=jobs):
            shards[name] = self._read(name)
        self._commit(self._manifest, shards)

    def _write(self, shard: Shard) -> dict[str, Shard]:
        """A shard as it is on disk from now on, by its name; it does not count yet."""
        name = write_shard(shard, self.place)
        return {name: self._read(name)}

    def _read(self, name: str) -> Shard:
        """A shard that was written just now."""
        return read_shard(self.place, name, self.feature_set, is_checked=False)

    def _commit(self, manifest: Manifest, shards: dict[str, Shard]) -> None:
        """Make a state of the index the one that counts, then remove what it left."""
        before = self._manifest
        manifest = replace(manifest, shards=tuple(shards))
        if manifest == before and (self.place / FILE).exists():
            return
        write_manifest(manifest, self.place)
        self._manifest, self._shards = manifest, shards
        for name in set(before.shards) - set(shards):
            remove_shard(self.place, name)


class _Ready(NamedTuple):
    """What was read and does not count yet."""

    failures: dict[str, FailedFile]
    shards: dict[str, Shard]


def _error(name: str, failed: FailedFile) -> MotionaryError:
    """The error that `text_after` described."""
    place, _, problem = failed.problem.partition(": ")
    kind = _KINDS.get(failed.kind, UnreadableFile)
    return kind(problem, file=name, place=place.removeprefix(", "))
