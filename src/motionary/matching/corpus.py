"""How are many documents searched as one?

Documents stand one behind the other with two empty frames between them: no step of the
matcher is longer than two frames, so no path crosses a border.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.packing import PackedFeatures

PADDING = 2


@dataclass(frozen=True, slots=True, eq=False)
class Corpus:
    """Words of documents, padded.

    Attributes
    ----------
    words, known : arrays, shape (frames with padding, n_words), uint64
    starts, lengths : arrays, shape (documents,)
        Where each document begins, and its number of frames.
    blocked : array of the padding frames
    """

    packed: PackedFeatures
    known: PackedFeatures
    starts: NDArray[np.intp]
    lengths: NDArray[np.intp]
    blocked: NDArray[np.intp]

    def document(self, index: int) -> tuple[PackedFeatures, PackedFeatures]:
        """Words and mask of one document."""
        part = slice(self.starts[index], self.starts[index] + self.lengths[index])
        return self.packed[part], self.known[part]

    def split(self, per_frame: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """Parts of an array (padded frames,), one per document."""
        pairs = zip(self.starts, self.lengths, strict=True)
        return [per_frame[start : start + length] for start, length in pairs]


def concatenate(
    packed: Sequence[PackedFeatures], known: Sequence[PackedFeatures], *, full: PackedFeatures
) -> Corpus:
    """Corpus of documents.

    Parameters
    ----------
    words, known : one array (frames, n_words) per document
    full : array, shape (n_words,), the mask in which every relation is known

    Raises
    ------
    InvalidInput
        If there is no document, or words and masks are not of one form.
    """
    if not packed or len(packed) != len(known):
        raise InvalidInput(
            "a corpus needs at least one document, and a mask for each, got "
            f"{len(packed)} and {len(known)}"
        )
    for i, (a, b) in enumerate(zip(packed, known, strict=True)):
        if a.shape != b.shape or a.ndim != 2 or a.shape[1] != len(full):
            raise InvalidInput(
                f"document {i}: words and known need shape (frames, {len(full)}), "
                f"got {a.shape} and {b.shape}"
            )
    lengths = np.array([len(a) for a in packed], dtype=np.intp)
    starts = np.concatenate([[0], np.cumsum(lengths[:-1] + PADDING)]).astype(np.intp)
    total = int(starts[-1] + lengths[-1])
    all_packed = np.zeros((total, len(full)), dtype=np.uint64)
    all_known = np.tile(full, (total, 1))
    inside = np.zeros(total, dtype=np.bool_)
    for a, b, start in zip(packed, known, starts, strict=True):
        part = slice(start, start + len(a))
        all_packed[part], all_known[part], inside[part] = a, b, True
    return Corpus(all_packed, all_known, starts, lengths, np.flatnonzero(~inside))
