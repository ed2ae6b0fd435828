"""Collections: the features of many recordings, and what could not be read."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, Self, overload

import numpy as np
from numpy.typing import NDArray

from motionary.batch import Failure, Workers
from motionary.errors import InvalidInput, check_kind
from motionary.features import (
    FULL_BODY,
    FeatureSequence,
    FeatureSet,
    NamedFile,
    compute_features,
    load_everyday_set,
    read_features,
)
from motionary.io import ReadOptions, name_recordings
from motionary.matching import prior_of_counts
from motionary.motion import Motion
from motionary.retrieval.index.shard import Shard, StoredShard, make_shard, select

_MOST_REASONS = 3
# Frames of a portion, five minutes: labelling them takes seconds, sending a library less.
_PORTION_FRAMES = 1 << 13

#: Collections of more frames, 19 hours, are large: what is derived is derived from a sample.
LARGE_COLLECTION = 1 << 21
_SAMPLED_FRAMES = 1 << 20
_SAMPLED_PARTS = 8

#: What features are collected of.
Sources = (
    str
    | Path
    | Sequence[str | Path | Motion | FeatureSequence]
    | Mapping[str, Motion | FeatureSequence]
)


class Part(NamedTuple):
    """A shard of a collection, and the number that each of its sequences has there."""

    shard: Shard
    numbers: NDArray[np.int64]


class Portion(NamedTuple):
    """Some recordings of a collection, for another process to open.

    Attributes
    ----------
    shards : that they lie in
    places : array, shape (recordings, 2): number of the shard, and of the recording in it
    """

    shards: tuple[Shard | StoredShard, ...]
    places: NDArray[np.int64]

    def open(self) -> Iterator[FeatureSequence]:
        """The recordings' features; `UnreadableFile` where a shard cannot be seen from here."""
        shards = [shard.open() for shard in self.shards]
        for shard, place in self.places.tolist():
            yield shards[shard].sequence(place)


@dataclass(frozen=True, eq=False)
class Collection:
    """Recordings as sequences of features.

    Attributes
    ----------
    sequences : of the recordings
    feature_set : what the bits mean
    failures : files that could not be read, and why
    """

    sequences: Sequence[FeatureSequence]
    feature_set: FeatureSet = FULL_BODY
    failures: tuple[Failure[NamedFile], ...] = field(default=())

    def __post_init__(self) -> None:
        if isinstance(self.sequences, _Sequences):
            return
        stray = [s for s in self.sequences if s.feature_set.name != self.feature_set.name]
        if stray:
            raise InvalidInput(
                f"features of {stray[0].feature_set.name!r}, the collection "
                f"is of {self.feature_set.name!r}",
                file=stray[0].source,
            )

    @classmethod
    def of_shards(
        cls,
        shards: Sequence[Shard],
        feature_set: FeatureSet,
        failures: tuple[Failure[NamedFile], ...] = (),
    ) -> Self:
        """The sequences of shards, sorted by name; nothing is copied."""
        names = [name for shard in shards for name in shard.names]
        order = np.array(sorted(range(len(names)), key=names.__getitem__), dtype=np.int64)
        numbers = np.empty_like(order)
        numbers[order] = np.arange(len(order))
        borders = np.cumsum([len(shard) for shard in shards])[:-1]
        split = np.split(numbers, borders) if shards else []
        parts = tuple(Part(shard, part) for shard, part in zip(shards, split, strict=True))
        return cls(_Sequences(parts, order), feature_set, failures)

    @classmethod
    def of_part(cls, part: Part) -> Self:
        """The sequences of one part in the order of their numbers."""
        order = np.argsort(part.numbers, kind="stable")
        ranked = Part(part.shard, np.argsort(order))
        return cls(_Sequences((ranked,), order), part.shard.feature_set)

    def __len__(self) -> int:
        return len(self.sequences)

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The recordings as the matcher and keyframe queries take them.

        Raises
        ------
        InvalidInput
            If there is no recording.
        """
        if not self.sequences:
            reasons = "".join(f"; {f.item[0]}: {f.error}" for f in self.failures[:_MOST_REASONS])
            raise InvalidInput(f"there is no readable recording to search{reasons}")
        if isinstance(self.sequences, _Sequences):
            return self.sequences.parts
        shard = make_shard(self.sequences, self.feature_set)
        return (Part(shard, np.arange(len(shard))),)

    def locate(self, number: int) -> tuple[int, int]:
        """Part in which a recording stands, and its place there."""
        if isinstance(self.sequences, _Sequences):
            return self.sequences.locate(number)
        return 0, number

    def portions(self) -> Iterator[Portion]:
        """The recordings in their order, in portions that are worth being handed over."""
        if not self.sequences:
            return
        places: list[tuple[int, int]] = []
        n_frames = 0
        for number in range(len(self)):
            part, place = self.locate(number)
            places.append((part, place))
            n_frames += int(self.parts[part].shard.table["length"][place])
            if n_frames >= _PORTION_FRAMES or number == len(self) - 1:
                yield self._portion(np.array(places, dtype=np.int64))
                places, n_frames = [], 0

    def _portion(self, places: NDArray[np.int64]) -> Portion:
        numbers, shard_of = np.unique(places[:, 0], return_inverse=True)
        opened: list[Shard | StoredShard] = []
        inside = places[:, 1].copy()
        for i, number in enumerate(numbers.tolist()):
            handle = self.parts[number].shard.handle()
            if isinstance(handle, Shard):
                # Of one in memory only what is needed is sent.
                chosen = np.flatnonzero(shard_of == i)
                handle = select([handle], [inside[chosen]])
                inside[chosen] = np.arange(len(chosen))
            opened.append(handle)
        return Portion(tuple(opened), np.column_stack([shard_of, inside]))

    @property
    def n_frames(self) -> int:
        """Frames of all recordings, at 30 Hz."""
        return sum(part.shard.n_frames for part in self.parts) if len(self) else 0

    @cached_property
    def published(self) -> "Collection":
        """The same recordings over the published features, if they come first."""
        if self.feature_set != load_everyday_set():
            return self
        if not isinstance(self.sequences, _Sequences):
            sequences = tuple(s.leading(FULL_BODY) for s in self.sequences)
            return Collection(sequences, FULL_BODY, self.failures)
        parts = tuple(p._replace(shard=p.shard.leading(FULL_BODY)) for p in self.sequences.parts)
        return Collection(_Sequences(parts, self.sequences.order), FULL_BODY, self.failures)

    @cached_property
    def sample(self) -> "Collection":
        """All recordings of a small collection; of a large one some, spread evenly over it.

        What is found in it stands for the whole where settings are derived.
        """
        if len(self) == 0 or self.n_frames <= LARGE_COLLECTION:
            return self
        step = max(len(self.parts) // _SAMPLED_PARTS, 1)
        parts = self.parts[step // 2 :: step]
        shards = [part.shard for part in parts]
        each = _SAMPLED_FRAMES // len(shards)
        chosen = [
            np.arange(max(int(np.searchsorted(np.cumsum(shard.lengths), each, side="right")), 1))
            for shard in shards
        ]
        return Collection.of_shards([select(shards, chosen)], self.feature_set)

    @cached_property
    def feature_prior(self) -> NDArray[np.float64]:
        """Fraction of known frames in which each feature holds; see `matching.self_information`."""
        counts = np.sum([part.shard.feature_counts for part in self.parts], axis=0)
        return prior_of_counts(counts[1:-1:2], counts[0:-1:2] + counts[1:-1:2])


class _Sequences(Sequence[FeatureSequence]):
    """Sequences of shards in the order of their names, made when they are asked for."""

    def __init__(self, parts: tuple[Part, ...], order: NDArray[np.int64]) -> None:
        self.parts = parts
        self.order = order
        self._ends = np.cumsum([len(part.shard) for part in parts])

    def __len__(self) -> int:
        return len(self.order)

    @overload
    def __getitem__(self, index: int) -> FeatureSequence: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[FeatureSequence]: ...
    def __getitem__(self, index: int | slice) -> FeatureSequence | Sequence[FeatureSequence]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        part, place = self.locate(index)
        return self.parts[part].shard.sequence(place)

    def locate(self, index: int) -> tuple[int, int]:
        place = int(self.order[index])
        part = int(np.searchsorted(self._ends, place, side="right"))
        return part, place - int(self._ends[part]) + len(self.parts[part].shard)


def collect(
    recordings: Sources,
    *,
    reading: ReadOptions | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: Workers = 1,
    on_done: Callable[[NamedFile], None] | None = None,
) -> Collection:
    """Features of recordings.

    Parameters
    ----------
    recordings : a folder, file or pattern, or a sequence of such, of motions or of features;
        or motions or features by the names that they are to have
    reading : what the files do not say themselves
    jobs : processes that read; the result does not depend on it
    on_done : called after each file

    Raises
    ------
    UnreadableFile
        If a path does not exist or holds no recording. A file that is there and cannot be
        read is listed in `failures` instead.
    """
    remedy = "give a folder, paths, or motions in a list; motionary.read reads a file"
    check_kind(recordings, (str, Path, Iterable), name="recordings", remedy=remedy)
    if isinstance(recordings, Mapping):
        recordings = [_named(name, one) for name, one in recordings.items()]
    given = [recordings] if isinstance(recordings, str | Path) else list(recordings)
    for item in given:
        check_kind(item, (str, Path, Motion, FeatureSequence), name="a recording", remedy=remedy)
    paths = [g for g in given if isinstance(g, str | Path)]
    packed = [
        _sequence_of(g, feature_set) for g in given if isinstance(g, Motion | FeatureSequence)
    ]
    if not paths:
        return Collection(tuple(packed), feature_set)
    read = read_collection(
        name_recordings(paths, split=reading is None or reading.take is None).items(),
        reading=reading,
        feature_set=feature_set,
        jobs=jobs,
        on_done=on_done,
    )
    return replace(read, sequences=(*packed, *read.sequences))


def _named(name: str, recording: Motion | FeatureSequence) -> Motion | FeatureSequence:
    check_kind(recording, (Motion, FeatureSequence), name=f"{name!r}", remedy="read files first")
    if isinstance(recording, Motion):
        return recording.renamed(name)
    return replace(recording, recording=recording.recording.renamed(name))


def read_collection(
    files: Iterable[NamedFile],
    *,
    reading: ReadOptions | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: Workers = 1,
    on_done: Callable[[NamedFile], None] | None = None,
) -> Collection:
    """Features of files whose names are given; otherwise as `collect`.

    Parameters
    ----------
    files : pairs of a recording's name and its path
    reading, jobs, on_done : as in `collect`
    """
    items = list(
        read_features(files, options=reading, feature_set=feature_set, jobs=jobs, on_done=on_done)
    )
    return Collection(
        tuple(item for item in items if not isinstance(item, Failure)),
        feature_set,
        tuple(item for item in items if isinstance(item, Failure)),
    )


def join_collections(
    collections: Sequence[Collection], names: Sequence[Mapping[str, str]]
) -> Collection:
    """One collection of several over one feature set, sorted by name.

    Parameters
    ----------
    collections : at least one
    names : for each, the new name of each recording; those without one are left out
    """
    shards = []
    failures: list[Failure[NamedFile]] = []
    for collection, new in zip(collections, names, strict=True):
        for failure in collection.failures:
            name, path = failure.item
            if name in new:
                failures.append(Failure((new[name], path), failure.error))
        for shard, _ in collection.parts if len(collection) else ():
            kept = np.array([i for i, name in enumerate(shard.names) if name in new], dtype=np.intp)
            if len(kept):
                part = shard if len(kept) == len(shard) else select([shard], [kept])
                names_now = tuple(new[name] for name in part.names)
                shards.append(replace(part, names=names_now, place=None))
    failures.sort(key=lambda failure: failure.item[0])
    return Collection.of_shards(shards, collections[0].feature_set, tuple(failures))


def _sequence_of(item: Motion | FeatureSequence, feature_set: FeatureSet) -> FeatureSequence:
    if isinstance(item, Motion):
        return compute_features(item, feature_set=feature_set)
    return item
