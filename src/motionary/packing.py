"""How are yes/no relations stored?

A frame of `n` relations is a *word*: `ceil(n / 64)` unsigned 64-bit integers, relation
`i` in bit `i % 64` of integer `i // 64`. A second array of the same shape, the *mask*,
marks the relations that are known (documents) or fixed (templates).

Conventions: time first, shape (frames, n_words); unused high bits are zero.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput

Words = NDArray[np.uint64]

BITS = 64


def count_words(n_relations: int) -> int:
    """Number of 64-bit integers that hold `n_relations` relations."""
    return -(-n_relations // BITS)


def pack(relations: ArrayLike) -> Words:
    """Words of a matrix of relations.

    Parameters
    ----------
    relations : array, shape (frames, n_relations), of 0/1 or bool

    Returns
    -------
    array, shape (frames, n_words), uint64
    """
    bits = np.asarray(relations)
    if bits.ndim != 2:
        raise InvalidInput(f"relations need shape (frames, relations), got {bits.shape}")
    if bits.dtype != np.bool_:
        if not np.isin(bits, (0, 1)).all():
            raise InvalidInput("relations need values 0 and 1; quantise a template first")
        bits = bits.astype(np.bool_)
    n_words = count_words(bits.shape[1])
    packed = np.zeros((bits.shape[0], n_words * BITS // 8), dtype=np.uint8)
    packed[:, : -(-bits.shape[1] // 8)] = np.packbits(bits, axis=1, bitorder="little")
    return packed.view("<u8").astype(np.uint64, copy=False)


def unpack(words: Words, n_relations: int) -> NDArray[np.bool_]:
    """Relations of packed words, the inverse of `pack`.

    Parameters
    ----------
    words : array, shape (frames, n_words), uint64
    n_relations : int

    Returns
    -------
    array, shape (frames, n_relations), bool
    """
    if words.ndim != 2 or words.shape[1] != count_words(n_relations):
        raise InvalidInput(
            f"{n_relations} relations need {count_words(n_relations)} integers a frame, "
            f"got an array of shape {words.shape}"
        )
    as_bytes = np.ascontiguousarray(words, dtype="<u8").view(np.uint8)
    bits = np.unpackbits(as_bytes, axis=1, count=n_relations, bitorder="little")
    return bits.view(np.bool_)


def full_mask(n_frames: int, n_relations: int) -> Words:
    """Mask in which every relation is set, shape (n_frames, n_words)."""
    row = pack(np.ones((1, n_relations), dtype=np.bool_))
    return np.repeat(row, n_frames, axis=0)


def count(words: Words) -> NDArray[np.int64]:
    """Number of set relations per frame: words (..., n_words) give counts (...)."""
    counts: NDArray[np.int64] = np.bitwise_count(words).sum(axis=-1, dtype=np.int64)
    return counts


def permute(words: Words, order: NDArray[np.intp]) -> Words:
    """Words whose relation `i` is relation `order[i]` of the given words."""
    return pack(unpack(words, len(order))[:, order])
