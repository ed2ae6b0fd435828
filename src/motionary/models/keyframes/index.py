"""Posting-list index of packed features, and the hit ranges that searches return.

Every feature is a bitmap over time, and so is its opposite: a keyframe with n fixed
features reads n bitmaps, an eighth of a byte per frame each, and no other. The inverted
lists of Baak, Müller and Seidel (2008) need one list per distinct pattern of features, and
in motion every third frame brings a new one. All that is stored are arrays, which may be
memory-mapped.

Another person does the same motion a little differently: a feature turns on a few frames
sooner or later. For this temporal tolerance a strict index has a feature only where it holds
for some frames around, a loose one where it holds at any of them.

Conventions: a feature that is unknown neither holds nor fails, so that no keyframe that
fixes it is seen there. Frames count from 0 within each sequence; hit ranges are half-open,
`stop` one past the last frame; those of one sequence neither overlap nor touch.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.models.keyframes.posting_lists import Layout, merge_touching
from motionary.models.keyframes.query import KeyframeQuery
from motionary.packing import BITS, PackedFeatures, count_integers, unpack

Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class PostingIndex:
    """Bitmaps of features over the frames of sequences.

    Attributes
    ----------
    planes : array, shape (2 * features + 1, integers), uint64
        Row 2 i: where feature i is known not to hold; row 2 i + 1: where it holds; last row:
        where there is a frame.
    lengths : array, shape (sequences,), frames of each sequence
    feature_set : name of the set of the features
    feature_ids : its ids, in the order of the rows
    counts : frames of each row; counted if left out
    layout : where sequences begin and end
    """

    planes: PackedFeatures
    lengths: Integers
    feature_set: str
    feature_ids: tuple[str, ...]
    counts: tuple[int, ...] = field(default=(), repr=False)
    layout: Layout = field(init=False, repr=False)

    def __post_init__(self) -> None:
        layout = Layout.of_lengths(self.lengths)
        shape = (2 * len(self.feature_ids) + 1, layout.n_integers)
        if self.planes.shape != shape or self.planes.dtype != np.uint64:
            raise InvalidInput(
                f"an index of {len(self.feature_ids)} features and {self.n_frames} frames needs "
                f"planes of shape {shape}, uint64; got {self.planes.shape}, {self.planes.dtype}"
            )
        # A view of the same memory: compiled code does not know memory-mapped arrays.
        object.__setattr__(self, "planes", np.asarray(self.planes))
        object.__setattr__(self, "layout", layout)
        if not self.counts:
            counts = (int(np.bitwise_count(row).sum(dtype=np.int64)) for row in self.planes)
            object.__setattr__(self, "counts", tuple(counts))

    @property
    def n_frames(self) -> int:
        """Frames of all sequences."""
        return int(self.lengths.sum())

    @property
    def n_sequences(self) -> int:
        """Number of sequences."""
        return len(self.lengths)

    @property
    def n_bytes(self) -> int:
        """Bytes of the stored arrays."""
        return self.planes.nbytes + self.lengths.nbytes

    def rows(self, value: int, fixed: int) -> list[int]:
        """Rows whose common frames show a keyframe, the rarest first.

        Parameters
        ----------
        value, fixed : features of the keyframe and which are fixed, as bits of a number
        """
        rows = []
        while fixed:
            i = (fixed & -fixed).bit_length() - 1
            rows.append(2 * i + (value >> i & 1))
            fixed &= fixed - 1
        rows.sort(key=self.counts.__getitem__)
        return rows or [len(self.planes) - 1]


def index_packed(
    packed: Sequence[PackedFeatures],
    known: Sequence[PackedFeatures] | None = None,
    *,
    feature_set: str,
    feature_ids: Sequence[str],
) -> PostingIndex:
    """Index of the packed features of sequences.

    Parameters
    ----------
    packed : one array, shape (frames, n_integers), uint64, per sequence
    known : masks of the same shapes: which features are known; all if left out
    feature_set : name of the set of the features
    feature_ids : its ids, in the order of the bits

    Raises
    ------
    InvalidInput
        If there is no sequence, or one has another shape.
    """
    if len(packed) == 0:
        raise InvalidInput("an index needs at least one sequence, got none")
    _check_shapes(packed, known, n_integers=count_integers(len(feature_ids)))
    lengths = np.array([len(sequence) for sequence in packed], dtype=np.int64)
    layout = Layout.of_lengths(lengths)
    joined = np.concatenate(packed)
    seen = None if known is None else np.concatenate(known)
    planes = np.empty((2 * len(feature_ids) + 1, layout.n_integers), dtype=np.uint64)
    before = np.cumsum(lengths) - lengths
    positions = np.repeat(layout.starts - before, lengths) + np.arange(len(joined))

    def bitmap(holds: NDArray[np.bool_]) -> PackedFeatures:
        spaced = np.zeros(layout.n_integers * BITS, dtype=np.bool_)
        spaced[positions] = holds
        return np.packbits(spaced, bitorder="little").view("<u8").astype(np.uint64, copy=False)

    planes[-1] = bitmap(np.ones(len(joined), dtype=np.bool_))
    for i in range(len(feature_ids)):
        column, bit = i // BITS, np.uint64(1 << i % BITS)
        holds = bitmap(joined[:, column] & bit != 0)
        is_known = planes[-1] if seen is None else bitmap(seen[:, column] & bit != 0)
        planes[2 * i] = is_known & ~holds
        planes[2 * i + 1] = is_known & holds
    return PostingIndex(planes, lengths, feature_set, tuple(feature_ids))


def _check_shapes(
    packed: Sequence[PackedFeatures], known: Sequence[PackedFeatures] | None, *, n_integers: int
) -> None:
    if known is not None and len(known) != len(packed):
        raise InvalidInput(f"{len(packed)} sequences need as many masks, got {len(known)}")
    for number, sequence in enumerate(packed):
        if sequence.ndim != 2 or sequence.shape[1] != n_integers:
            raise InvalidInput(
                f"sequence {number}: packed features need shape (frames, {n_integers}), "
                f"got {sequence.shape}"
            )
        if known is not None and known[number].shape != sequence.shape:
            raise InvalidInput(
                f"sequence {number}: known needs the shape of the packed features "
                f"{sequence.shape}, got {known[number].shape}"
            )


def steady_mask(packed: PackedFeatures, known: PackedFeatures, frames: int) -> PackedFeatures:
    """Which features are known and the same for so many frames before and after.

    The ends of a sequence count as if it went on as it begins and ends.
    """
    steady = known.copy()
    for shift in range(1, min(frames, len(packed) - 1) + 1):
        differs = (packed[shift:] ^ packed[:-shift]) | ~(known[shift:] & known[:-shift])
        steady[shift:] &= ~differs
        steady[:-shift] &= ~differs
    return steady


def count_steady(
    sequence: FeatureSequence, frames: NDArray[np.intp], most: int
) -> NDArray[np.intp]:
    """For how many frames around each of some frames every feature keeps its value.

    Parameters
    ----------
    sequence : features of a recording
    frames : array, shape (n,)
    most : largest count

    Returns
    -------
    array, shape (n, features); 0 where a feature is unknown or differs beside the frame
    """
    n_features = len(sequence.feature_set)
    total = np.zeros((len(frames), n_features), dtype=np.intp)
    for around in range(1, most + 1):
        mask = steady_mask(sequence.packed, sequence.known, around)[frames]
        if not mask.any():
            break
        total += unpack(mask, n_features)
    return total


def strict_index(sequences: Sequence[FeatureSequence], frames: int) -> PostingIndex:
    """Index in which a feature is known only where it keeps its value for so many frames."""
    masks = [steady_mask(s.packed, s.known, frames) for s in sequences]
    feature_set = sequences[0].feature_set
    name, ids = feature_set.name, feature_set.ids
    return index_packed([s.packed for s in sequences], masks, feature_set=name, feature_ids=ids)


def loose_index(sequences: Sequence[FeatureSequence], frames: int) -> PostingIndex:
    """Index in which a feature holds where it does at any of so many frames around.

    The same goes for its opposite, so that near a change both are found.
    """
    name, ids = sequences[0].feature_set.name, sequences[0].feature_set.ids
    on = [_spread(s.packed & s.known, frames) for s in sequences]
    off = [_spread(~s.packed & s.known, frames) for s in sequences]
    nowhere = [np.zeros_like(mask) for mask in off]
    holds = index_packed(on, on, feature_set=name, feature_ids=ids)
    fails = index_packed(nowhere, off, feature_set=name, feature_ids=ids)
    return PostingIndex(holds.planes | fails.planes, holds.lengths, name, ids)


def _spread(mask: PackedFeatures, frames: int) -> PackedFeatures:
    spread = mask.copy()
    for shift in range(1, min(frames, len(mask) - 1) + 1):
        spread[shift:] |= mask[:-shift]
        spread[:-shift] |= mask[shift:]
    return spread


class HitRange(NamedTuple):
    """Frames of one sequence that hold hits, half-open."""

    sequence: int
    start: int
    stop: int


@dataclass(frozen=True, slots=True, eq=False)
class HitRanges:
    """Frames that hold hits, by sequence and then by time.

    The union of all frames from the first to the last keyframe of a hit, after Baak, Müller
    and Seidel (2008), section 3.2.

    Attributes
    ----------
    sequences, starts, stops : arrays, shape (ranges,)
    """

    sequences: Integers
    starts: Integers
    stops: Integers

    @classmethod
    def none(cls) -> "HitRanges":
        """No ranges."""
        empty = np.empty(0, dtype=np.int64)
        return cls(empty, empty, empty)

    def __len__(self) -> int:
        return len(self.starts)

    def __iter__(self) -> Iterator[HitRange]:
        columns = (self.sequences.tolist(), self.starts.tolist(), self.stops.tolist())
        return (HitRange(*row) for row in zip(*columns, strict=True))

    @property
    def n_frames(self) -> int:
        """Frames in all ranges."""
        return int((self.stops - self.starts).sum())

    @property
    def hit_sequences(self) -> Integers:
        """Numbers of the sequences with at least one hit, ascending."""
        return np.unique(self.sequences)

    def of(self, sequence: int) -> list[tuple[int, int]]:
        """Ranges (start, stop) of one sequence."""
        here = self.sequences == sequence
        return list(zip(self.starts[here].tolist(), self.stops[here].tolist(), strict=True))


def margins(query: KeyframeQuery, n_columns: int) -> tuple[int, int]:
    """Frames to match before and after a hit: twice what the template has around it.

    Parameters
    ----------
    query : with the template positions of its keyframes
    n_columns : columns of that template

    Raises
    ------
    InvalidInput
        If the query has no positions, or they lie beyond the template.
    """
    if query.positions is None:
        raise InvalidInput("the query carries no template positions; give the margins instead")
    first, last = query.positions[0], query.positions[-1]
    if last >= n_columns:
        raise InvalidInput(f"the last keyframe stands at column {last} of only {n_columns}")
    return 2 * first, 2 * (n_columns - 1 - last)


def extend(ranges: HitRanges, before: int, after: int, lengths: ArrayLike) -> HitRanges:
    """Ranges that are longer at both ends, cut at the sequences, merged where they meet.

    Parameters
    ----------
    ranges : HitRanges
    before, after : frames to add, at least 0
    lengths : array, shape (sequences,), frames of each sequence
    """
    if before < 0 or after < 0:
        raise InvalidInput(f"before and after must be at least 0 frames, got {before}, {after}")
    if len(ranges) == 0:
        return ranges
    length = np.asarray(lengths, dtype=np.int64)
    if length.ndim != 1 or len(length) <= ranges.sequences.max():
        raise InvalidInput(
            f"lengths need one number for each sequence, got shape {length.shape} for a hit in "
            f"sequence {ranges.sequences.max()}"
        )
    starts = np.maximum(ranges.starts - before, 0)
    stops = np.minimum(ranges.stops + after, length[ranges.sequences])
    first, last = merge_touching(starts, stops, ranges.sequences)
    return HitRanges(ranges.sequences[first], starts[first], stops[last])


def agree(several: Sequence[HitRanges], *, votes: int = 1) -> HitRanges:
    """Frames that lie in ranges of at least so many queries over the same sequences."""
    check_votes(votes, n_queries=len(several))
    if len(several) == 1:
        return several[0]
    sequences, starts, stops = (
        np.concatenate([getattr(ranges, name) for ranges in several])
        for name in ("sequences", "starts", "stops")
    )
    # On one line, on which sequences lie apart.
    far = int(stops.max(initial=0)) + 1
    places, at = np.unique(
        np.concatenate([starts, stops]) + far * np.tile(sequences, 2), return_inverse=True
    )
    changes = np.bincount(at[: len(starts)], minlength=len(places))
    changes -= np.bincount(at[len(starts) :], minlength=len(places))
    edges = np.flatnonzero(np.diff(np.cumsum(changes) >= votes, prepend=False))
    first, last = places[edges[::2]], places[edges[1::2]]
    sequence = first // far
    return HitRanges(sequence, first - sequence * far, last - sequence * far)


def check_votes(votes: int, *, n_queries: int) -> None:
    """Refuse a number of votes that so many queries cannot have.

    Raises
    ------
    InvalidInput
    """
    if not 1 <= votes <= n_queries:
        raise InvalidInput(
            f"{n_queries} queries have 1 to {n_queries} votes, got {votes}", key="votes"
        )
