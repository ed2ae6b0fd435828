"""Posting lists of keyframes as bitmaps and intervals: read, cut and joined by NumPy.

The posting list of a keyframe holds the frames that show it (Baak, Müller and Seidel 2008,
eqs 3 and 4). As a bitmap it is the AND of bitmaps of features over time. Shifted bitmaps
tell, for 64 frames at a time, which lie within a gap of a frame of the keyframe beside. What
is left is joined as intervals: two arrays, starts and stops, half-open, ascending, neither
overlapping nor touching.

The join of a query: a frame of the last keyframe is valid; a frame of an earlier one is,
if a valid frame of its successor lies within the gap. Every valid frame of the first
keyframe begins a hit. Where its latest hit ends, follows from always taking the latest
valid frame: frames x and y of two hits can be exchanged for their maxima, since gaps bound
differences only.

Conventions: position p is bit p % 64 of integer p // 64; the last integer of a bitmap is
empty. Positions run through all sequences; `Layout` has where each begins and ends.
Kernels: arrays and numbers, nothing is checked.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.models.keyframes.query import Gap, KeyframeQuery
from motionary.packing import BITS, PackedFeatures, to_numbers

Bits = NDArray[np.bool_]
Integers = NDArray[np.int64]
Numbers = NDArray[np.int32]

#: Further than any sequence is long.
FAR = 1 << 48

#: Reading single integers beats reading all when at most one in so many is wanted.
_SPARSE = 16

#: Runs are counted in one integer of so many.
_SAMPLED = 16

#: Below so many integers the bits are unpacked rather than peeled off one by one.
_FEW = 64

_ONE = np.uint64(1)
_TOP = np.uint64(BITS - 1)
_BYTE = 8


class Intervals(NamedTuple):
    """A set of positions, half-open."""

    starts: Integers
    stops: Integers

    def __bool__(self) -> bool:
        return len(self.starts) > 0


EMPTY = Intervals(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """First and last positions of sequences.

    Attributes
    ----------
    starts, stops : arrays, shape (sequences,); every start is a multiple of 8
    of_byte : array, the number of the sequence of every eight positions
    """

    starts: Integers
    stops: Integers
    of_byte: Numbers

    @classmethod
    def of_lengths(cls, lengths: Integers) -> "Layout":
        """Sequences one behind the other, with at least one position free after each."""
        n_bytes = lengths // _BYTE + 1
        starts = (np.cumsum(n_bytes) - n_bytes) * _BYTE
        of_byte = np.repeat(np.arange(len(lengths), dtype=np.int32), n_bytes)
        return cls(starts, starts + lengths, of_byte)

    @property
    def n_integers(self) -> int:
        """Integers of a bitmap."""
        # One empty integer at the end, so that a run of bits always has an end.
        return len(self.of_byte) * _BYTE // BITS + 2

    def number(self, positions: Integers) -> Numbers:
        """Number of the sequence of each position."""
        return np.take(self.of_byte, positions >> 3)


class Plan(NamedTuple):
    """Keyframes and gaps as the search takes them.

    Attributes
    ----------
    values, fixed : features of each keyframe and which are fixed, as bits of a number
    gaps : between neighbouring keyframes, none of them 0 to 0
    """

    values: list[int]
    fixed: list[int]
    gaps: list[Gap]


def plan_query(query: KeyframeQuery) -> Plan | None:
    """The query with neighbours at distance 0 as one keyframe; None if they contradict."""
    all_values, all_fixed = to_numbers(query.values), to_numbers(query.fixed)
    plan = Plan([all_values[0]], [all_fixed[0]], [])
    for value, fixed, gap in zip(all_values[1:], all_fixed[1:], query.gaps, strict=True):
        if gap.most != 0:
            plan.values.append(value)
            plan.fixed.append(fixed)
            plan.gaps.append(gap)
            continue
        if (plan.values[-1] ^ value) & plan.fixed[-1] & fixed:
            return None
        plan.values[-1] |= value
        plan.fixed[-1] |= fixed
    return plan


def reading_order(n_frames: Sequence[int]) -> list[int]:
    """Keyframes from the rarest outwards, the rarer neighbour first."""
    n = len(n_frames)
    left = right = n_frames.index(min(n_frames))
    order = [left]
    while len(order) < n:
        if left == 0 or (right + 1 < n and n_frames[right + 1] <= n_frames[left - 1]):
            right += 1
            order.append(right)
        else:
            left -= 1
            order.append(left)
    return order


def count_runs(planes: PackedFeatures, rows: list[int]) -> float:
    """Runs of frames that all rows hold, for an integer of a bitmap, from a sample."""
    bits = np.bitwise_and.reduce(planes[rows, ::_SAMPLED])
    return float(np.bitwise_count(bits & ~(bits << _ONE)).mean())


def read_posting_lists(
    planes: PackedFeatures, rows: list[list[int]], order: list[int], gaps: list[Gap]
) -> list[Intervals] | None:
    """Frames of each keyframe that may belong to a hit; None if nothing is left.

    Borders of sequences do not count here: what is left may lie across one.

    Parameters
    ----------
    planes : bitmaps
    rows : per keyframe, the bitmaps that all hold its frames, the rarest first
    order : of reading; each keyframe but the first is beside one read before
    gaps : between neighbouring keyframes
    """
    bitmaps = np.empty((len(rows), planes.shape[1]), dtype=np.uint64)
    first, *others = order
    _conjunction(planes, rows[first], None, bitmaps[first])
    for k in others:
        if k > first:
            near = reach(bitmaps[k - 1], gaps[k - 1])
        else:
            near = reach(bitmaps[k + 1], gaps[k], back=True)
        _conjunction(planes, rows[k], near, bitmaps[k])
        bitmaps[k] &= near
        if not bitmaps[k].any():
            return None
    return _runs_of_bits(bitmaps)


def join(
    lists: Sequence[Intervals], gaps: Sequence[Gap], layout: Layout
) -> tuple[Intervals, Numbers]:
    """Hit ranges of posting lists, and the number of the sequence of each.

    Parameters
    ----------
    lists : the frames of each keyframe; frames that belong to no hit may be missing
    gaps : frames between neighbouring keyframes
    """
    valid = [lists[-1]]
    for keyframe, gap in zip(reversed(lists[:-1]), reversed(gaps), strict=True):
        valid.append(_intersection(keyframe, _reach_back(valid[-1], gap, layout)))
    valid.reverse()
    number = layout.number(valid[0].starts)
    if not valid[0]:
        return EMPTY, number
    stops = _latest_ends(valid, gaps, layout.stops[number])
    first, last = merge_touching(valid[0].starts, stops, number)
    return Intervals(valid[0].starts[first], stops[last]), number[first]


def merge_touching(
    starts: Integers, stops: Integers, number: NDArray[np.integer]
) -> tuple[Bits, Bits]:
    """Which of ascending intervals begin, and which end, one that is merged of them.

    number : of the sequence of each; those of different sequences stay apart
    """
    apart = (starts[1:] > stops[:-1]) | (number[1:] != number[:-1])
    return np.concatenate([[True], apart]), np.concatenate([apart, [True]])


def reach(bitmap: PackedFeatures, gap: Gap, *, back: bool = False) -> PackedFeatures:
    """Positions within the gap after a set one, or before one; without a bound at least those."""
    if gap.most is None:
        result = np.zeros_like(bitmap)
        at = np.flatnonzero(bitmap)
        if len(at):
            result[slice(at[-1] + 1) if back else slice(at[0], None)] = ~np.uint64(0)
        return result
    result, covered, width = bitmap.copy(), 1, gap.most - gap.least + 1
    while covered < width:
        step = min(covered, width - covered)
        result |= _shift(result, -step if back else step)
        covered += step
    return _shift(result, -gap.least if back else gap.least)


def _shift(bitmap: PackedFeatures, by: int) -> PackedFeatures:
    """The bitmap with every bit so many positions later; earlier where negative."""
    if by == 0:
        return bitmap
    whole, rest = divmod(abs(by), BITS)
    left, into = np.uint64(rest), np.uint64(BITS - rest)
    result = np.zeros_like(bitmap)
    n = max(len(bitmap) - whole, 0)
    if by > 0:
        np.left_shift(bitmap[:n], left, out=result[len(bitmap) - n :])
        if rest and n > 1:
            result[whole + 1 :] |= bitmap[: n - 1] >> into
    else:
        np.right_shift(bitmap[len(bitmap) - n :], left, out=result[:n])
        if rest and n > 1:
            result[: n - 1] |= bitmap[whole + 1 :] << into
    return result


def _conjunction(
    planes: PackedFeatures, rows: list[int], near: PackedFeatures | None, out: PackedFeatures
) -> None:
    """Write the frames that all rows of `planes` hold, at least those of `near`."""
    if near is not None:
        wanted = near != 0
        if np.count_nonzero(wanted) * _SPARSE < len(wanted):
            at = np.flatnonzero(wanted)
            some = planes[rows[0]][at]
            for row in rows[1:]:
                some &= planes[row][at]
            out[:] = 0
            out[at] = some
            return
    if len(rows) == 1:
        out[:] = planes[rows[0]]
        return
    np.bitwise_and(planes[rows[0]], planes[rows[1]], out=out)
    for row in rows[2:]:
        np.bitwise_and(out, planes[row], out=out)


def _runs_of_bits(bitmaps: PackedFeatures) -> list[Intervals]:
    """Maximal runs of set bits of each row, shape (rows, integers)."""
    n_rows, n_integers = bitmaps.shape
    bitmap = bitmaps.reshape(-1)
    touched = bitmap != 0
    touched[1:] |= touched[:-1].copy()
    at = np.flatnonzero(touched)
    bits = bitmap[at]
    # A bit differs from the one before it at the first of a run and one past its last.
    positions = _set_bits(bits ^ ((bits << _ONE) | (bitmap[at - 1] >> _TOP)), at)
    begin = np.arange(n_rows) * (n_integers * BITS)
    parts = np.split(positions, np.searchsorted(positions, begin[1:]))
    return [
        Intervals(part[::2] - first, part[1::2] - first)
        for part, first in zip(parts, begin, strict=True)
    ]


def _set_bits(bits: PackedFeatures, number: Integers) -> Integers:
    """Positions of the set bits of some integers, ascending."""
    left = np.flatnonzero(bits != 0)
    bits, bases = bits[left], number[left] * BITS
    ends = np.cumsum(np.bitwise_count(bits), dtype=np.int64)
    result = np.empty(ends[-1] if len(ends) else 0, dtype=np.int64)
    at = np.concatenate([[0], ends[:-1]])
    # The lowest bit of all integers at once, until few have bits left.
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


def _intersection(a: Intervals, b: Intervals) -> Intervals:
    if len(a.starts) > len(b.starts):
        a, b = b, a
    first = np.searchsorted(b.stops, a.starts, side="right")
    n = np.searchsorted(b.starts, a.stops, side="left") - first
    ends = np.cumsum(n)
    if not a or ends[-1] == 0:
        return EMPTY
    i = np.repeat(np.arange(len(n)), n)
    j = np.arange(ends[-1]) + np.repeat(first - ends + n, n)
    return Intervals(np.maximum(a.starts[i], b.starts[j]), np.minimum(a.stops[i], b.stops[j]))


def _reach_back(after: Intervals, gap: Gap, layout: Layout) -> Intervals:
    """Positions with a position of `after` behind them, within the gap and the sequence."""
    begin = layout.starts[layout.number(after.starts)]
    most = FAR if gap.most is None else gap.most
    starts = np.maximum(after.starts - most, begin)
    stops = after.stops - gap.least
    if gap.least > 0:
        inside = stops > begin
        starts, stops = starts[inside], stops[inside]
    apart = starts[1:] > stops[:-1]
    if not apart.all():
        starts = starts[np.concatenate([[True], apart])]
        stops = stops[np.concatenate([apart, [True]])]
    return Intervals(starts, stops)


def _latest_ends(valid: Sequence[Intervals], gaps: Sequence[Gap], limits: Integers) -> Integers:
    """One past the last frame of the latest hit from the last frame of each first interval."""
    position = valid[0].stops - 1
    for keyframe, gap in zip(valid[1:], gaps, strict=True):
        most = FAR if gap.most is None else gap.most
        position = np.minimum(position + most, limits - 1)
        at = np.searchsorted(keyframe.starts, position, side="right") - 1
        position = np.minimum(position, keyframe.stops[at] - 1)
    return position + 1
