"""Which layout answers keyframe queries fastest?

Every relation is a bitmap over time, and so is its opposite: a keyframe with n fixed
relations reads n bitmaps, an eighth of a byte per frame each, and no other. The paper's
inverted lists (see `algorithm`) need one list per distinct word, and in motion every third
frame brings a new one.

All that is stored are arrays, which may be memory-mapped.

Conventions: a relation that is unknown neither holds nor fails, so that no keyframe that
fixes it is seen there. Documents begin at multiples of eight positions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.models.keyframes.intervals import Documents
from motionary.packing import BITS, PackedFeatures, count_integers

_BITS_OF_BYTE = 8


@dataclass(frozen=True, slots=True, eq=False)
class PostingIndex:
    """Bitmaps of relations over the frames of documents.

    Attributes
    ----------
    planes : array, shape (2 * features + 1, blocks), uint64
        Row 2 i: where feature i is known not to hold; row 2 i + 1: where it holds; last row:
        where there is a frame.
    lengths : array, shape (documents,), frames of each document
    feature_set : name of the set of the features
    feature_ids : its ids, in the order of the rows
    documents : where documents begin and end
    counts : frames of each row
    """

    planes: PackedFeatures
    lengths: NDArray[np.int64]
    feature_set: str
    feature_ids: tuple[str, ...]
    documents: Documents = field(init=False, repr=False)
    counts: tuple[int, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        documents = Documents.lay_out(self.lengths)
        shape = (2 * len(self.feature_ids) + 1, _count_blocks(documents))
        if self.planes.shape != shape or self.planes.dtype != np.uint64:
            raise InvalidInput(
                f"an index of {len(self.feature_ids)} features and {self.n_frames} frames needs "
                f"planes of shape {shape}, uint64; got {self.planes.shape}, {self.planes.dtype}"
            )
        # A view of the same memory: compiled code does not know memory-mapped arrays.
        object.__setattr__(self, "planes", np.asarray(self.planes))
        object.__setattr__(self, "documents", documents)
        counts = (int(np.bitwise_count(row).sum(dtype=np.int64)) for row in self.planes)
        object.__setattr__(self, "counts", tuple(counts))

    @property
    def n_frames(self) -> int:
        """Frames of all documents."""
        return int(self.lengths.sum())

    @property
    def n_documents(self) -> int:
        """Number of documents."""
        return len(self.lengths)

    @property
    def n_bytes(self) -> int:
        """Bytes of the stored arrays."""
        return self.planes.nbytes + self.lengths.nbytes

    def rows(self, value: int, fixed: int) -> list[int]:
        """Rows whose common frames show a keyframe, the rarest first.

        Parameters
        ----------
        value, fixed : relations of the keyframe and which are fixed, as bits of a number
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
    """Index of documents.

    Parameters
    ----------
    words : one array, shape (frames, n_words), uint64, per document
    known : masks of the same shapes: which relations are known; all if left out
    feature_set : name of the set of the features
    feature_ids : its ids, in the order of the bits

    Raises
    ------
    InvalidInput
        If there is no document, or one has another shape.
    """
    if len(packed) == 0:
        raise InvalidInput("an index needs at least one document, got none")
    _check_shapes(packed, known, n_integers=count_integers(len(feature_ids)))
    lengths = np.array([len(document) for document in packed], dtype=np.int64)
    documents = Documents.lay_out(lengths)
    joined = np.concatenate(packed)
    seen = None if known is None else np.concatenate(known)
    n_blocks = _count_blocks(documents)
    planes = np.empty((2 * len(feature_ids) + 1, n_blocks), dtype=np.uint64)
    before = np.cumsum(lengths) - lengths
    positions = np.repeat(documents.starts - before, lengths) + np.arange(len(joined))

    def bitmap(holds: NDArray[np.bool_]) -> PackedFeatures:
        spaced = np.zeros(n_blocks * BITS, dtype=np.bool_)
        spaced[positions] = holds
        packed = np.packbits(spaced, bitorder="little").view("<u8")
        return packed.astype(np.uint64, copy=False)

    planes[-1] = bitmap(np.ones(len(joined), dtype=np.bool_))
    for i in range(len(feature_ids)):
        word, bit = i // BITS, np.uint64(1 << i % BITS)
        holds = bitmap(joined[:, word] & bit != 0)
        is_known = planes[-1] if seen is None else bitmap(seen[:, word] & bit != 0)
        planes[2 * i] = is_known & ~holds
        planes[2 * i + 1] = is_known & holds
    return PostingIndex(planes, lengths, feature_set, tuple(feature_ids))


def _count_blocks(documents: Documents) -> int:
    # One empty block at the end, so that a run of bits always has an end.
    return len(documents.of_byte) * _BITS_OF_BYTE // BITS + 2


def _check_shapes(
    packed: Sequence[PackedFeatures], known: Sequence[PackedFeatures] | None, *, n_integers: int
) -> None:
    if known is not None and len(known) != len(packed):
        raise InvalidInput(f"{len(packed)} documents need as many masks, got {len(known)}")
    for number, document in enumerate(packed):
        if document.ndim != 2 or document.shape[1] != n_integers:
            raise InvalidInput(
                f"document {number}: words need shape (frames, {n_integers}), got {document.shape}"
            )
        if known is not None and known[number].shape != document.shape:
            raise InvalidInput(
                f"document {number}: known needs the shape of words {document.shape}, "
                f"got {known[number].shape}"
            )
