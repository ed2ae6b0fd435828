"""Packed features: yes/no features as bits of 64-bit integers.

A frame of `n` features is `ceil(n / 64)` unsigned integers, feature `i` in bit `i % 64` of
integer `i // 64`. A second array of the same shape, the *mask*, marks the features that are
known (sequences) or fixed (templates).

Conventions: time first, shape (frames, n_integers); unused high bits are zero.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput

PackedFeatures = NDArray[np.uint64]

BITS = 64

# Numbers of kinds of frames stay below this, so that int64 holds them.
_MOST_KINDS = 2**62


def count_integers(n_features: int) -> int:
    """Number of 64-bit integers that hold so many features."""
    return -(-n_features // BITS)


def pack(features: ArrayLike) -> PackedFeatures:
    """Packed features of a matrix of features.

    Parameters
    ----------
    features : array, shape (frames, n_features), of 0/1 or bool

    Returns
    -------
    array, shape (frames, n_integers), uint64
    """
    bits = np.asarray(features)
    if bits.ndim != 2:
        raise InvalidInput(f"features need shape (frames, features), got {bits.shape}")
    if bits.dtype != np.bool_:
        if not np.isin(bits, (0, 1)).all():
            raise InvalidInput("features need values 0 and 1; quantise a template first")
        bits = bits.astype(np.bool_)
    n_integers = count_integers(bits.shape[1])
    packed = np.zeros((bits.shape[0], n_integers * BITS // 8), dtype=np.uint8)
    packed[:, : -(-bits.shape[1] // 8)] = np.packbits(bits, axis=1, bitorder="little")
    return packed.view("<u8").astype(np.uint64, copy=False)


def unpack(packed: PackedFeatures, n_features: int) -> NDArray[np.bool_]:
    """Features of packed ones, the inverse of `pack`.

    Parameters
    ----------
    packed : array, shape (frames, n_integers), uint64
    n_features : int

    Returns
    -------
    array, shape (frames, n_features), bool
    """
    if packed.ndim != 2 or packed.shape[1] != count_integers(n_features):
        raise InvalidInput(
            f"{n_features} features need {count_integers(n_features)} integers a frame, "
            f"got an array of shape {packed.shape}"
        )
    as_bytes = np.ascontiguousarray(packed, dtype="<u8").view(np.uint8)
    bits = np.unpackbits(as_bytes, axis=1, count=n_features, bitorder="little")
    return bits.view(np.bool_)


def full_mask(n_frames: int, n_features: int) -> PackedFeatures:
    """Mask in which every feature is set, shape (n_frames, n_integers)."""
    row = pack(np.ones((1, n_features), dtype=np.bool_))
    return np.repeat(row, n_frames, axis=0)


def count(packed: PackedFeatures) -> NDArray[np.int64]:
    """Number of set features per frame: (..., n_integers) gives counts (...)."""
    counts: NDArray[np.int64] = np.bitwise_count(packed).sum(axis=-1, dtype=np.int64)
    return counts


def permute(packed: PackedFeatures, order: NDArray[np.intp]) -> PackedFeatures:
    """Packed features of which feature `i` is feature `order[i]` of the given ones."""
    return pack(unpack(packed, len(order))[:, order])


def to_numbers(packed: PackedFeatures) -> tuple[int, ...]:
    """One whole number per row of packed features, feature `i` in bit `i`."""
    rows = packed.astype("<u8", copy=False)
    return tuple(int.from_bytes(row.tobytes(), "little") for row in rows)


def from_numbers(numbers: Sequence[int], n_integers: int) -> PackedFeatures:
    """Packed features of whole numbers, the inverse of `to_numbers`."""
    raw = b"".join(number.to_bytes(n_integers * BITS // 8, "little") for number in numbers)
    return np.frombuffer(raw, dtype="<u8").reshape(-1, n_integers).astype(np.uint64)


def distinct_frames(
    packed: PackedFeatures, known: PackedFeatures
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First frame of each kind, and the kind of every frame: motion often stays the same.

    Parameters
    ----------
    packed, known : arrays, shape (frames, n_integers); one row of known holds for all frames
    """
    kind, n_kinds = np.zeros(len(packed), dtype=np.int64), 1
    for column in (*packed.T, *(known.T if len(known) > 1 else ())):
        values, inverse = np.unique(column, return_inverse=True)
        if n_kinds * len(values) > _MOST_KINDS:
            those, kind = np.unique(kind, return_inverse=True)
            n_kinds = len(those)
        kind = kind * len(values) + inverse
        n_kinds *= len(values)
    _, first, same = np.unique(kind, return_index=True, return_inverse=True)
    return first, same
