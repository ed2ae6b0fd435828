"""What does a query read?

A plan: keyframes of one and the same frame as one keyframe, relations as bits of a number.
And from the index, the frames of each keyframe as far as they may belong to a hit.
"""

from typing import NamedTuple

import numpy as np

from motionary.models.keyframes.bitmaps import (
    Marks,
    conjunction,
    keep,
    mark,
    runs,
    spread,
    spread_back,
)
from motionary.models.keyframes.intervals import Intervals
from motionary.models.keyframes.query import Gap, KeyframeQuery
from motionary.models.keyframes.word_index import PostingIndex
from motionary.packing import PackedFeatures


class Plan(NamedTuple):
    """Keyframes and gaps as the search sees them.

    Attributes
    ----------
    values, fixed : relations of each keyframe and which are fixed, as bits of a number
    gaps : between neighbouring keyframes, none of them 0 to 0
    """

    values: list[int]
    fixed: list[int]
    gaps: list[Gap]


def plan_query(query: KeyframeQuery) -> Plan | None:
    """The query with neighbours at distance 0 as one keyframe; None if they contradict."""
    all_values, all_fixed = _to_numbers(query.values), _to_numbers(query.fixed)
    plan = Plan(all_values[:1], all_fixed[:1], [])
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


def reading_order(rarity: list[int]) -> list[int]:
    """Keyframes from the rarest outwards, the rarer neighbour first."""
    n = len(rarity)
    left = right = rarity.index(min(rarity))
    order = [left]
    while len(order) < n:
        if left == 0 or (right + 1 < n and rarity[right + 1] <= rarity[left - 1]):
            right += 1
            order.append(right)
        else:
            left -= 1
            order.append(left)
    return order


def read_lists(
    index: PostingIndex, rows: list[list[int]], gaps: list[Gap]
) -> list[Intervals] | None:
    """Frames of each keyframe, without stretches that hold no hit; None if nothing is left.

    Parameters
    ----------
    index : PostingIndex
    rows : per keyframe, the rows of the index that show it, the rarest first
    gaps : between neighbouring keyframes
    """
    n = len(rows)
    bitmaps = np.empty((n, index.planes.shape[1]), dtype=np.uint64)
    marks: list[Marks] = [np.empty(0, dtype=np.bool_)] * n
    first, *others = reading_order([index.counts[row[0]] for row in rows])
    conjunction(index.planes, rows[first], None, bitmaps[first])
    marks[first] = mark(bitmaps[first])
    for k in others:
        back = k < first
        near = spread_back(marks[k + 1], *gaps[k]) if back else spread(marks[k - 1], *gaps[k - 1])
        conjunction(index.planes, rows[k], near, bitmaps[k])
        marks[k] = near & mark(bitmaps[k])
        if not marks[k].any():
            return None
    for k in range(n - 1):
        marks[k + 1] &= spread(marks[k], *gaps[k])
    for k in reversed(range(n - 1)):
        marks[k] &= spread_back(marks[k + 1], *gaps[k])
    for bitmap, left_over in zip(bitmaps, marks, strict=True):
        keep(bitmap, left_over)
    return runs(bitmaps)


def to_word(number: int, n_integers: int) -> PackedFeatures:
    """Relations that are bits of a number, as a word."""
    row = np.frombuffer(number.to_bytes(n_integers * 8, "little"), dtype="<u8")
    return row.astype(np.uint64, copy=False)


def _to_numbers(packed: PackedFeatures) -> list[int]:
    return [int.from_bytes(row.tobytes(), "little") for row in packed.astype("<u8", copy=False)]
