"""How are frames found with whole machine words?

A bitmap holds one bit per position, 64 to a block. Relations are bitmaps over time
(`planes`); the frames that show a keyframe are the AND of its planes. Stretches of 16
frames without a frame of one keyframe rule out stretches of its neighbours, before any
single frame is looked at: `marks` are the stretches that are left.

Conventions: position p is bit p % 64 of block p // 64; the last block of a bitmap is empty.
Kernels: arrays and numbers, nothing is checked.
"""

import sys

import numpy as np
from numpy.typing import NDArray

from motionary.models.keyframes.intervals import Intervals
from motionary.packing import BITS, PackedFeatures

Marks = NDArray[np.bool_]
Integers = NDArray[np.int64]

#: Reading single blocks beats reading all when at most one in so many is wanted.
_SPARSE = 16

#: Below so many blocks the bits are unpacked rather than peeled off one by one.
_FEW = 64

#: Marks are spread by shifting up to so many times, by counting beyond.
_MOST_SHIFTS = 16

#: Frames per mark. Parts of a block are in the order of time on little-endian machines only.
_GRAIN = 16 if sys.byteorder == "little" else BITS
_PART = np.dtype(f"uint{_GRAIN}")
_MARKS_OF_BLOCK = np.dtype(f"uint{8 * BITS // _GRAIN}")

_ONE = np.uint64(1)
_TOP = np.uint64(BITS - 1)


def conjunction(
    planes: PackedFeatures, rows: list[int], near: Marks | None, out: PackedFeatures
) -> None:
    """Write the frames that all rows of `planes` hold, at least those that `near` marks."""
    if near is not None:
        wanted = near.view(_MARKS_OF_BLOCK) != 0
        if np.count_nonzero(wanted) * _SPARSE < len(wanted):
            blocks = np.flatnonzero(wanted)
            some = planes[rows[0]][blocks]
            for row in rows[1:]:
                some &= planes[row][blocks]
            out[:] = 0
            out[blocks] = some
            return
    if len(rows) == 1:
        out[:] = planes[rows[0]]
        return
    np.bitwise_and(planes[rows[0]], planes[rows[1]], out=out)
    for row in rows[2:]:
        np.bitwise_and(out, planes[row], out=out)


def mark(bitmap: PackedFeatures) -> Marks:
    """Stretches with a set bit."""
    return np.asarray(bitmap.view(_PART) != 0)


def keep(bitmap: PackedFeatures, marks: Marks) -> None:
    """Clear the bits of unmarked stretches."""
    parts = bitmap.view(_PART)
    np.multiply(parts, marks, out=parts)


def spread(marks: Marks, least: int, most: int | None) -> Marks:
    """Stretches with a frame from `least` to `most` frames after one of a marked stretch.

    Negative numbers look back; `most` None looks ahead without end.
    """
    n = len(marks)
    first = least // _GRAIN
    if most is None:
        return _shift(np.logical_or.accumulate(marks), first)
    last = (most + _GRAIN - 1) // _GRAIN
    if last - first < _MOST_SHIFTS:
        result = _shift(marks, first)
        for offset in range(first + 1, last + 1):
            if offset >= 0:
                result[offset:] |= marks[: max(n - offset, 0)]
            else:
                result[:offset] |= marks[-offset:]
        return result
    before = np.concatenate([[0], np.cumsum(marks)])
    segment = np.arange(n)
    upto = before[np.clip(segment - first + 1, 0, n)]
    return np.asarray(upto > before[np.clip(segment - last, 0, n)])


def spread_back(marks: Marks, least: int, most: int | None) -> Marks:
    """Stretches with a frame from `least` to `most` frames before one of a marked stretch."""
    if most is None:
        return np.ascontiguousarray(spread(marks[::-1], least, None)[::-1])
    return spread(marks, -most, -least)


def runs(bitmaps: PackedFeatures) -> list[Intervals]:
    """Maximal runs of set bits of each row, shape (rows, blocks)."""
    n_rows, n_blocks = bitmaps.shape
    bitmap = bitmaps.reshape(-1)
    touched = bitmap != 0
    touched[1:] |= touched[:-1].copy()
    blocks = np.flatnonzero(touched)
    bits = bitmap[blocks]
    # A bit differs from the one before it at the first of a run and one past its last.
    positions = _set_bits(bits ^ ((bits << _ONE) | (bitmap[blocks - 1] >> _TOP)), blocks)
    begin = np.arange(n_rows) * (n_blocks * BITS)
    parts = np.split(positions, np.searchsorted(positions, begin[1:]))
    return [
        Intervals(part[::2] - first, part[1::2] - first)
        for part, first in zip(parts, begin, strict=True)
    ]


def _shift(marks: Marks, offset: int) -> Marks:
    result = np.zeros_like(marks)
    if offset >= 0:
        result[offset:] = marks[: max(len(marks) - offset, 0)]
    else:
        result[:offset] = marks[-offset:]
    return result


def _set_bits(bits: PackedFeatures, blocks: Integers) -> Integers:
    """Positions of the set bits of some blocks, ascending."""
    left = np.flatnonzero(bits != 0)
    bits, bases = bits[left], blocks[left] * BITS
    ends = np.cumsum(np.bitwise_count(bits), dtype=np.int64)
    result = np.empty(ends[-1] if len(ends) else 0, dtype=np.int64)
    at = np.concatenate([[0], ends[:-1]])
    # The lowest bit of all blocks at once, until few blocks have bits left.
    while len(bits) >= _FEW:
        lowest = bits & (~bits + _ONE)
        result[at] = bases + np.bitwise_count(lowest - _ONE)
        bits ^= lowest
        left = np.flatnonzero(bits != 0)
        bits, bases, at = bits[left], bases[left], at[left] + 1
    if len(bits):
        unpacked = np.unpackbits(bits.astype("<u8", copy=False).view(np.uint8), bitorder="little")
        index = np.flatnonzero(unpacked)
        block = index // BITS
        nth = np.arange(len(index)) - np.searchsorted(block, np.arange(len(bits)))[block]
        result[at[block] + nth] = bases[block] + index % BITS
    return result
