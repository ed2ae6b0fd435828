"""How are the words of a folder kept, so that only what changed is read again?

An index lies in the user's cache, or where it is told to. Recordings are read in portions;
each is kept when it is complete, so that an interrupted run is taken up where it ended.
Files that could not be read are remembered with their reason until they change.
"""

import hashlib
import os
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Self

import numpy as np

from motionary import __version__
from motionary.batch import Failure
from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet, NamedFile, read_features
from motionary.io import ReadOptions
from motionary.retrieval.index.changes import Changes, Seen, find_changes
from motionary.retrieval.index.collection import Collection
from motionary.retrieval.index.manifest import (
    FILE,
    FailedFile,
    Making,
    Manifest,
    check_making,
    read_manifest,
    write_manifest,
)
from motionary.retrieval.index.shard import DOCUMENT, Shard, join_shards, make_shard, select
from motionary.retrieval.index.shard_files import UNFINISHED, read_shard, remove_shard, write_shard

#: Says where the cache is, instead of the place that the system has for it.
CACHE_VARIABLE = "MOTIONARY_CACHE"

# A portion is kept after so many files, or so many words.
_PORTION = 64
_PORTION_WORDS = 1 << 18
# Shards are joined until they have so many words; so many smaller ones may stay.
_LARGE = 1 << 20
_SMALL_ONES = 8

_ATTEMPTS = 3
_LEFT_ALONE_S = 3600.0


class Index:
    """Words of the recordings below a folder, kept on disk: open, update, collection.

    Attributes
    ----------
    folder : the recordings
    place : the folder of the index
    feature_set : what the bits of the words mean
    """

    def __init__(
        self, folder: Path, place: Path, *, feature_set: FeatureSet, reading: ReadOptions
    ) -> None:
        self.folder = folder
        self.place = place
        self.feature_set = feature_set
        self._reading = reading
        self._manifest = Manifest(Making.of(feature_set, reading))
        self._shards: tuple[Shard, ...] = ()

    @classmethod
    def open(
        cls,
        folder: str | Path,
        *,
        at: str | Path | None = None,
        reading: ReadOptions | None = None,
        feature_set: FeatureSet = FULL_BODY,
    ) -> Self:
        """The index of a folder as it is; nothing is read from the recordings yet.

        Parameters
        ----------
        folder : the recordings
        at : folder of the index; by default one in the user's cache for this folder,
            feature set and reading
        reading : what the files do not say themselves
        feature_set : relations to measure

        Raises
        ------
        UnreadableFile
            If what lies at `at` is damaged, newer, or no index; an index in the cache is
            made anew instead.
        InvalidInput
            If the index at `at` has another feature set, or its files were read otherwise.
        """
        reading = reading or ReadOptions()
        path = Path(folder)
        making = Making.of(feature_set, reading)
        place = _cache_place(path, making) if at is None else Path(at)
        index = cls(path, place, feature_set=feature_set, reading=reading)
        try:
            index._load()
        except (UnreadableFile, InvalidInput):
            if at is not None:
                raise
            index._manifest, index._shards = Manifest(making), ()
        return index

    def __len__(self) -> int:
        return sum(len(shard) for shard in self._shards)

    @property
    def n_frames(self) -> int:
        """Words of all recordings."""
        return sum(shard.n_frames for shard in self._shards)

    @property
    def n_bytes(self) -> int:
        """Bytes on disk."""
        return sum(file.stat().st_size for file in self.place.rglob("*") if file.is_file())

    @property
    def failures(self) -> tuple[Failure[NamedFile], ...]:
        """Files that could not be read, and why."""
        return tuple(
            Failure((name, self.folder / name), UnreadableFile(f"{Path(name).name}{f.problem}"))
            for name, f in sorted(self._manifest.failures.items())
        )

    def collection(self) -> Collection:
        """What is ready to be searched."""
        return Collection.of_shards(self._shards, self.feature_set, self.failures)

    def changes(self) -> Changes:
        """What is new, changed or gone in the folder; reads no recording.

        Raises
        ------
        UnreadableFile
            If the folder is missing, or may not be read.
        """
        seen = {
            name: Seen(f.state.mtime_ns, f.state.size, f.sidecar, f.state.ctime_ns)
            for name, f in self._manifest.failures.items()
        }
        for shard in self._shards:
            columns = (shard.table[key].tolist() for key in ("mtime_ns", "size", "companion"))
            seen.update(zip(shard.names, map(Seen, *columns), strict=True))
        if self._manifest.written_by != __version__:
            # Another version may read files otherwise.
            seen = dict.fromkeys(seen, Seen(-1, -1, 0))
        return find_changes(self.folder, seen, self._manifest.dependency_digest, self._reading)

    def update(
        self,
        changes: Changes | None = None,
        *,
        jobs: int = 1,
        on_done: Callable[[NamedFile], None] | None = None,
    ) -> Changes:
        """Read what is new or changed, forget what is gone, and keep the rest.

        What was read before an interruption is kept.

        Parameters
        ----------
        changes : from `changes`; looked for if left out
        jobs : processes that read; the result does not depend on it
        on_done : called after each file

        Raises
        ------
        UnreadableFile
            If the folder is missing, or may not be read.
        UnwritableFile
            If the index cannot be written.
        """
        changes = self.changes() if changes is None else changes
        self._forget(changes)
        files = [(name, self.folder / name) for name in changes.to_read]
        ready: list[tuple[str, FeatureSequence | Failure[NamedFile]]] = []
        items = read_features(
            files, options=self._reading, feature_set=self.feature_set, jobs=jobs, on_done=on_done
        )
        try:
            for (name, _), item in zip(files, items, strict=True):
                ready.append((name, item))
                if len(ready) == _PORTION or _count_integers(ready) >= _PORTION_WORDS:
                    self._keep(ready, changes)
                    ready = []
        finally:
            # Keeping a portion may itself have been interrupted, before its end or after.
            kept = self._shards[-1].names if self._shards else ()
            self._keep([pair for pair in ready if pair[0] not in kept], changes)
        self._join_small()
        self._clean()
        return changes

    def _load(self) -> None:
        for attempt in range(1, _ATTEMPTS + 1):
            manifest = read_manifest(self.place)
            if manifest is None:
                return
            check_making(self._manifest.making, manifest.making, self.place)
            try:
                shards = [
                    read_shard(self.place / name, self.feature_set) for name in manifest.shards
                ]
            except UnreadableFile as error:
                # Another process may have joined these shards meanwhile.
                if attempt < _ATTEMPTS and read_manifest(self.place) != manifest:
                    continue
                raise UnreadableFile(f"{error}; delete the index to make it anew") from error
            self._manifest, self._shards = manifest, tuple(shards)
            return

    def _forget(self, changes: Changes) -> None:
        """Take out what is gone or will be read again."""
        stale = {*changes.gone, *changes.to_read}
        shards: list[Shard] = []
        names: list[str] = []
        for shard, name in zip(self._shards, self._manifest.shards, strict=True):
            fresh = np.array(
                [i for i, n in enumerate(shard.names) if n not in stale], dtype=np.intp
            )
            if len(fresh) == len(shard):
                shards.append(shard)
                names.append(name)
            elif len(fresh):
                names.append(write_shard(select([shard], [fresh]), self.place))
                shards.append(read_shard(self.place / names[-1], self.feature_set))
        failures = {n: f for n, f in self._manifest.failures.items() if n not in stale}
        manifest = replace(
            self._manifest,
            shards=tuple(names),
            failures=failures,
            dependency_digest=changes.dependency_digest,
            written_by=__version__,
        )
        self._commit(manifest, shards)

    def _keep(
        self, portion: Sequence[tuple[str, FeatureSequence | Failure[NamedFile]]], changes: Changes
    ) -> None:
        """Add what was read, and what could not be."""
        failures = dict(self._manifest.failures)
        read: list[FeatureSequence] = []
        states = []
        for name, item in portion:
            state, sidecar = changes.states[name], changes.sidecars[name]
            if isinstance(item, Failure):
                failures[name] = FailedFile(state, sidecar, _problem(item))
            else:
                read.append(item)
                states.append((0, 0, 0, 0.0, state.mtime_ns, state.size, sidecar))
        manifest, shards = replace(self._manifest, failures=failures), list(self._shards)
        if read:
            table = np.array(states, dtype=DOCUMENT)
            name = write_shard(make_shard(read, self.feature_set, states=table), self.place)
            manifest = replace(manifest, shards=(*manifest.shards, name))
            shards.append(read_shard(self.place / name, self.feature_set))
        self._commit(manifest, shards)

    def _join_small(self) -> None:
        """Join small shards, so that an index that grew file by file stays fast."""
        pairs = list(zip(self._manifest.shards, self._shards, strict=True))
        small = [pair for pair in pairs if pair[1].n_frames < _LARGE]
        if len(small) <= _SMALL_ONES:
            return
        kept = [pair for pair in pairs if pair[1].n_frames >= _LARGE]
        group: list[Shard] = []
        for number, (_, shard) in enumerate(small, start=1):
            group.append(shard)
            if number == len(small) or sum(s.n_frames for s in group) >= _LARGE:
                name = write_shard(join_shards(group), self.place)
                kept.append((name, read_shard(self.place / name, self.feature_set)))
                group = []
        manifest = replace(self._manifest, shards=tuple(name for name, _ in kept))
        self._commit(manifest, [shard for _, shard in kept])

    def _clean(self) -> None:
        """Remove what runs that ended before their time have left."""
        latest = time.time() - _LEFT_ALONE_S
        for entry in self.place.iterdir() if self.place.is_dir() else ():
            # What is young may belong to a process that is at work.
            is_left = entry.is_dir() and entry.name not in self._manifest.shards
            if is_left and entry.stat().st_mtime < latest:
                remove_shard(entry)

    def _commit(self, manifest: Manifest, shards: Sequence[Shard]) -> None:
        """Make a state of the index the one that counts, then remove what it left."""
        before = self._manifest
        if manifest == before and (self.place / FILE).exists():
            return
        _check_target(self.place)
        write_manifest(manifest, self.place)
        self._manifest, self._shards = manifest, tuple(shards)
        for name in set(before.shards) - set(manifest.shards):
            remove_shard(self.place / name)


def _cache_place(folder: Path, making: Making) -> Path:
    told = os.environ.get(CACHE_VARIABLE)
    if told:
        cache = Path(told)
    else:
        from platformdirs import user_cache_path

        cache = user_cache_path("motionary", appauthor=False)
    resolved = folder.resolve()
    key = repr((str(resolved), making)).encode("utf-8", "surrogateescape")
    name = re.sub(r"[^\w.-]", "_", resolved.name)[:40] or "folder"
    return cache / "indexes" / f"{name}-{hashlib.sha256(key).hexdigest()[:16]}"


def _check_target(place: Path) -> None:
    """Refuse to write among files that are no index."""
    if not place.is_dir() or (place / "index.json").exists():
        return
    foreign = [entry.name for entry in place.iterdir() if not entry.name.startswith(UNFINISHED)]
    if foreign:
        raise UnwritableFile(
            f"{place}: holds files but no index ({foreign[0]}); give a new or empty folder"
        )


def _problem(failure: Failure[NamedFile]) -> str:
    """What an error says after the name of its file."""
    text = str(failure.error)
    _, path = failure.item
    for name in (str(path), path.name):
        if text.startswith(name):
            return text.removeprefix(name)
    return f": {text}"


def _count_integers(portion: Sequence[tuple[str, FeatureSequence | Failure[NamedFile]]]) -> int:
    return sum(len(item) for _, item in portion if not isinstance(item, Failure))
