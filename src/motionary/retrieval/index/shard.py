"""Shards: the features of many recordings in arrays, in memory as on disk.

Sequences stand one behind the other as the matcher takes them, with room between, beside
bitmaps of their features as keyframe queries take them. All are plain arrays, which may be
memory-mapped.

Conventions: a position counts frames of the shard, the room between sequences included.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet, load_everyday_set
from motionary.matching import PADDING, Corpus, concatenate
from motionary.matching.corpus import ThinCorpus, thin
from motionary.models.keyframes import HitRanges, PostingIndex, index_packed
from motionary.packing import PackedFeatures, full_mask
from motionary.recording import Recording, split_runs

#: What is known of a sequence beside its features. `mtime_ns`, `size` and `companion` tell the
#: state of the file that it was read from; they are 0 where there is none.
ROW = np.dtype(
    [
        ("length", "<i8"),
        ("file_frames", "<i8"),
        ("first_frame", "<i8"),
        ("rate_hz", "<f8"),
        ("mtime_ns", "<i8"),
        ("size", "<i8"),
        ("companion", "<u8"),
    ]
)


class StoredShard(NamedTuple):
    """Where a shard lies, for another process to open.

    Attributes
    ----------
    folder, name : of the index, and of the shard in it
    stored : features that the shard has there
    feature_set : those that are wanted: the first of them
    """

    folder: Path
    name: str
    stored: FeatureSet
    feature_set: FeatureSet

    def open(self) -> "Shard":
        """The shard; `UnreadableFile` where it cannot be seen from here."""
        from motionary.retrieval.index.shard_files import read_shard

        shard = read_shard(self.folder, self.name, self.stored, is_checked=False)
        return shard if self.feature_set == self.stored else shard.leading(self.feature_set)


@dataclass(frozen=True, eq=False)
class Shard:
    """Features of some recordings, never changed.

    Attributes
    ----------
    names : of the recordings
    table : array, shape (sequences,), of `ROW`
    packed : array, shape (positions, n_integers), uint64; unknown features are 0
    masks : array, shape (runs, 1 + n_integers), uint64
        Which features are known: one past the last position of a run, and the mask that
        holds in it.
    feature_set : what the bits mean
    planes : bitmaps of `keyframes.PostingIndex`; made when they are needed if None
    counts : frames of each bitmap; counted when they are needed if None
    place : of a shard on disk
    clip : the features that count, where `packed` holds others beside them
    """

    names: tuple[str, ...]
    table: NDArray[np.void]
    packed: PackedFeatures
    masks: PackedFeatures
    feature_set: FeatureSet
    planes: PackedFeatures | None = None
    counts: tuple[int, ...] | None = None
    place: StoredShard | None = None
    clip: PackedFeatures | None = None

    def __post_init__(self) -> None:
        n_integers = full_mask(1, len(self.feature_set)).shape[1]
        n_positions = int(self.starts[-1] + self.lengths[-1]) if len(self) else 0
        shapes = self.packed.shape, self.masks.shape[1:], len(self.names)
        if shapes != ((n_positions, n_integers), (1 + n_integers,), len(self.table)):
            raise InvalidInput(
                f"a shard of {len(self.table)} sequences needs features of shape "
                f"({n_positions}, {n_integers}), got {len(self.names)} names and "
                f"{self.packed.shape}"
            )

    def __len__(self) -> int:
        return len(self.table)

    @property
    def lengths(self) -> NDArray[np.int64]:
        """Frames of each sequence, shape (sequences,)."""
        return np.asarray(self.table["length"], dtype=np.int64)

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """Position of the first frame of each sequence, shape (sequences,)."""
        steps = self.lengths + PADDING
        return np.cumsum(steps) - steps

    @property
    def n_frames(self) -> int:
        """Frames of all sequences."""
        return int(self.lengths.sum())

    @cached_property
    def corpus(self) -> Corpus:
        """What the matcher takes; features are not copied."""
        blocked = np.ones(len(self.packed), dtype=np.bool_)
        blocked[_inside(self.starts, self.lengths)] = False
        known = self._known(0, len(self.packed))
        packed = self._clipped(self.packed)
        return Corpus(packed, known, self.starts, self.lengths, np.flatnonzero(blocked))

    @cached_property
    def thinned(self) -> ThinCorpus:
        """What windows are looked for in."""
        return thin(self.corpus, full=full_mask(1, len(self.feature_set))[0])

    def thin_one(self, number: int) -> ThinCorpus:
        """The same of one sequence."""
        full = full_mask(1, len(self.feature_set))[0]
        packed, known = self.features_of(number)
        has_gaps = bool((~self.masks[:, 1:] & full).any())
        return thin(concatenate([packed], [known], full=full), full=full, has_gaps=has_gaps)

    def leading(self, feature_set: FeatureSet) -> "Shard":
        """The same recordings over the set of the first features; see `FeatureSequence.leading`.

        Nothing is copied until it is used.
        """
        mask = full_mask(1, len(feature_set))[0]
        n = len(mask)
        return replace(
            self,
            packed=self.packed[:, :n],
            clip=mask,
            place=self.place and self.place._replace(feature_set=feature_set),
            masks=np.column_stack([self.masks[:, :1], self.masks[:, 1 : 1 + n] & mask]),
            feature_set=feature_set,
        )

    @cached_property
    def posting_index(self) -> PostingIndex:
        """What keyframe queries take: of the published features, where they come first."""
        indexed = indexed_set(self.feature_set)
        name, ids = indexed.name, indexed.ids
        if self.planes is not None:
            return PostingIndex(self.planes, self.lengths, name, ids, self.counts or ())
        if indexed != self.feature_set:
            return self.leading(indexed).posting_index
        parts = [self.features_of(i) for i in range(len(self))]
        return index_packed(
            [packed for packed, _ in parts],
            [known for _, known in parts],
            feature_set=name,
            feature_ids=ids,
        )

    @property
    def feature_counts(self) -> tuple[int, ...]:
        """Frames of each bitmap of the posting index, which need not be read for it."""
        return self.posting_index.counts if self.counts is None else self.counts

    def cut(self, ranges: HitRanges) -> Corpus:
        """Some segments of sequences, at least one, as sequences of their own."""
        lengths = ranges.stops - ranges.starts
        starts = np.cumsum(lengths + PADDING) - lengths - PADDING
        n_positions = int(starts[-1] + lengths[-1])
        inside = _inside(starts, lengths)
        begins = self.starts[ranges.sequences] + ranges.starts
        source = _inside(begins, lengths)
        packed = np.zeros((n_positions, self.packed.shape[1]), dtype=np.uint64)
        packed[inside] = self._clipped(self.packed[source])
        run = np.zeros(n_positions, dtype=np.intp)
        run[inside] = np.searchsorted(self.masks[:, 0].astype(np.int64), source, side="right")
        blocked = np.ones(n_positions, dtype=np.bool_)
        blocked[inside] = False
        return Corpus(packed, self.masks[run, 1:], starts, lengths, np.flatnonzero(blocked))

    def features_of(self, number: int) -> tuple[PackedFeatures, PackedFeatures]:
        """Packed features and mask of a sequence."""
        start = int(self.starts[number])
        stop = start + int(self.table["length"][number])
        return self._clipped(self.packed[start:stop]), self._known(start, stop)

    def sequence(self, number: int) -> FeatureSequence:
        """The sequence of a recording."""
        packed, known = self.features_of(number)
        row = self.table[number]
        return FeatureSequence(
            packed,
            known,
            self.feature_set,
            Recording(
                self.names[number],
                rate_hz=float(row["rate_hz"]),
                n_frames=int(row["file_frames"]),
                first_frame=int(row["first_frame"]),
            ),
        )

    def handle(self) -> "Shard | StoredShard":
        """What another process opens: the place on disk, or the shard itself."""
        return self if self.place is None else self.place

    def open(self) -> "Shard":
        """The shard itself, as of `StoredShard.open`."""
        return self

    def _clipped(self, packed: PackedFeatures) -> PackedFeatures:
        return packed if self.clip is None else packed & self.clip

    def _known(self, start: int, stop: int) -> PackedFeatures:
        stops = self.masks[:, 0].astype(np.int64)
        first, last = np.searchsorted(stops, [start, max(stop - 1, start)], side="right")
        if first == last:
            mask = self.masks[first, 1:]
            return np.broadcast_to(mask, (stop - start, len(mask)))
        inside = np.clip(stops[first : last + 1], start, stop)
        lengths = inside - np.concatenate([[start], inside[:-1]])
        return np.repeat(self.masks[first : last + 1, 1:], lengths, axis=0)


def indexed_set(feature_set: FeatureSet) -> FeatureSet:
    """Features that keyframes are looked for in: of the everyday set the published ones."""
    return FULL_BODY if feature_set == load_everyday_set() else feature_set


def make_shard(
    sequences: Sequence[FeatureSequence],
    feature_set: FeatureSet,
    *,
    states: NDArray[np.void] | None = None,
) -> Shard:
    """Shard of recordings.

    Parameters
    ----------
    sequences : at least one, over `feature_set`
    feature_set : what the bits mean
    states : array, shape (sequences,), of `ROW`, whose file states are taken over

    Raises
    ------
    InvalidInput
        If there is no recording, or features and masks do not fit.
    """
    table = np.zeros(len(sequences), dtype=ROW)
    if states is not None:
        table[:] = states
    table["length"] = [len(s) for s in sequences]
    table["file_frames"] = [s.recording.n_frames for s in sequences]
    table["first_frame"] = [s.recording.first_frame for s in sequences]
    table["rate_hz"] = [s.recording.rate_hz for s in sequences]
    full = full_mask(1, len(feature_set))[0]
    corpus = concatenate([s.packed for s in sequences], [s.known for s in sequences], full=full)
    # What stands between sequences does not count: the same as before it, runs are fewest.
    known = corpus.known.copy()
    for back in range(PADDING):
        between = corpus.blocked[back::PADDING]
        known[between] = known[np.maximum(between - 1, 0)]
    names = tuple(s.source for s in sequences)
    return Shard(names, table, corpus.packed, _runs(known), feature_set)


def join_shards(shards: Sequence[Shard]) -> Shard:
    """One shard with the sequences of several, in their order."""
    return select(shards, [np.arange(len(shard)) for shard in shards])


def select(shards: Sequence[Shard], chosen: Sequence[NDArray[np.intp]]) -> Shard:
    """One shard with the chosen sequences of several."""
    pairs = [(s, int(i)) for s, numbers in zip(shards, chosen, strict=True) for i in numbers]
    states = np.array([shard.table[i] for shard, i in pairs], dtype=ROW)
    sequences = [shard.sequence(i) for shard, i in pairs]
    return make_shard(sequences, shards[0].feature_set, states=states)


def _inside(starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    """Positions of segments, one after the other."""
    before = np.cumsum(lengths) - lengths
    return np.repeat(starts - before, lengths) + np.arange(lengths.sum())


def _runs(known: PackedFeatures) -> PackedFeatures:
    """Masks as runs: one past the last position, and the mask."""
    stops = np.array([stop for _, stop in split_runs(known)])
    return np.column_stack([stops.astype(np.uint64), known[stops - 1]])
