"""The distance function compiled: the twin of `_numpy.march`.

No fastmath and the same operations in the same order and precision, so that both give the
same bits.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from motionary.matching._numpy import Columns, Single, Steps, WeighedColumns

Integers = NDArray[np.uint64]
Floats = NDArray[np.float64]

_TILE = 1024
# Costs of weighed cells are computed once for each kind of frame; a part of a sequence ends
# where it has shown so many kinds, so that their costs stay in the processor's caches.
_MOST_KINDS = 8192
_SLOTS = 2 * _MOST_KINDS


@numba.njit(cache=True, nogil=True)
def march_packed(
    columns: Columns,
    packed: Integers,
    known: Integers | None,
    blocked: NDArray[np.intp],
    again: np.float32,
    last_two: Single,
    out: Single,
    steps: Steps | None,
) -> None:
    """Accumulated costs of the last column, written to `out`; see `_numpy.march`."""
    rows = np.empty((4, _TILE + 2), dtype=np.float32)
    first = 0
    for start in range(0, len(packed), _TILE):
        stop = min(start + _TILE, len(packed))
        n = stop - start
        last = first
        while last < len(blocked) and blocked[last] < stop:
            last += 1
        cost = rows[3, :n]
        # Elsewhere both ways give the same bits, and this one takes three times as long.
        partial = known is not None and _lacks(columns, known[start:stop])
        for k in range(len(last_two)):
            if known is not None and partial:
                _masked_costs(columns, k, packed[start:stop], known[start:stop], cost)
            else:
                _known_costs(columns, k, packed[start:stop], cost)
            row = rows[k % 3, : n + 2]
            row[:2] = last_two[k]
            before, skipped = rows[(k + 2) % 3], rows[(k + 1) % 3]
            if steps is not None:
                _keep_steps(k, cost, before, skipped, again, steps[k, start:stop])
            _accumulate(k, cost, before, skipped, again, row)
            for i in range(first, last):
                row[blocked[i] - start + 2] = np.inf
            last_two[k] = row[n:]
        out[start:stop] = rows[(len(last_two) - 1) % 3, 2 : n + 2]
        first = last


@numba.njit(cache=True, nogil=True)
def march_weighed(
    columns: WeighedColumns,
    packed: Integers,
    known: Integers,
    blocked: NDArray[np.intp],
    again: np.float32,
    last_two: Single,
    out: Single,
    steps: Steps | None,
) -> None:
    """The same for any pattern; `known` is one row or as many as frames."""
    rows = np.empty((4, _TILE + 2), dtype=np.float32)
    same = np.empty(len(packed), dtype=np.uint16)
    first = part = 0
    while part < len(packed):
        kinds, end = _find_kinds(packed, known, part, same)
        costs = _costs_of_kinds(columns, packed, known, kinds)
        for start in range(part, end, _TILE):
            stop = min(start + _TILE, end)
            n = stop - start
            last = first
            while last < len(blocked) and blocked[last] < stop:
                last += 1
            cost = rows[3, :n]
            for k in range(len(last_two)):
                _take(costs[k], same[start:stop], cost)
                row = rows[k % 3, : n + 2]
                row[:2] = last_two[k]
                before, skipped = rows[(k + 2) % 3], rows[(k + 1) % 3]
                if steps is not None:
                    _keep_steps(k, cost, before, skipped, again, steps[k, start:stop])
                _accumulate(k, cost, before, skipped, again, row)
                for i in range(first, last):
                    row[blocked[i] - start + 2] = np.inf
                last_two[k] = row[n:]
            out[start:stop] = rows[(len(last_two) - 1) % 3, 2 : n + 2]
            first = last
        part = end


@numba.njit(cache=True, nogil=True)
def _lacks(columns: Columns, known: Integers) -> np.bool_:
    """Whether what a column fixes is unknown in a frame."""
    fixed, always = np.uint64(0), ~np.uint64(0)
    for k in range(len(columns.fixed)):
        fixed |= columns.fixed[k]
    for i in range(len(known)):
        always &= known[i]
    lacks: np.bool_ = (fixed & ~always) != np.uint64(0)
    return lacks


@numba.njit(cache=True, nogil=True)
def _take(values: Single, places: NDArray[np.uint16], out: Single) -> None:
    for i in range(len(places)):
        out[i] = values[places[i]]


@numba.njit(cache=True, nogil=True)
def _accumulate(
    k: int, cost: Single, before: Single, skipped: Single, again: np.float32, row: Single
) -> None:
    if k == 0:
        row[2:] = cost
    elif k == 1:
        for i in range(len(cost)):
            row[i + 2] = min(before[i + 1], before[i]) + cost[i]
    else:
        for i in range(len(cost)):
            straight = min(before[i + 1], before[i])
            row[i + 2] = min(straight, skipped[i + 1] + cost[i] * again) + cost[i]


@numba.njit(cache=True, nogil=True)
def _keep_steps(
    k: int, cost: Single, before: Single, skipped: Single, again: np.float32, steps: Steps
) -> None:
    if k == 1:
        for i in range(len(cost)):
            steps[i] = before[i] < before[i + 1]
    elif k > 1:
        for i in range(len(cost)):
            straight = min(before[i + 1], before[i])
            left_out = np.uint8(skipped[i + 1] + cost[i] * again < straight)
            steps[i] = np.uint8(before[i] < before[i + 1]) | (left_out << np.uint8(1))


@numba.njit(cache=True, nogil=True)
def _known_costs(columns: Columns, k: int, packed: Integers, cost: Single) -> None:
    value, fixed, scale = columns.values[k], columns.fixed[k], columns.all_known[k]
    for i in range(len(packed)):
        cost[i] = np.float32(_count((packed[i] ^ value) & fixed)) * scale


@numba.njit(cache=True, nogil=True)
def _masked_costs(
    columns: Columns, k: int, packed: Integers, known: Integers, cost: Single
) -> None:
    value, fixed, unit = columns.values[k], columns.fixed[k], columns.unit[k]
    half, full = columns.half[k], columns.full[k]
    for i in range(len(packed)):
        seen = known[i] & fixed
        n_seen = _count(seen)
        wrong = np.float32(_count((packed[i] ^ value) & seen))
        cost[i] = full if n_seen < half else wrong * unit[n_seen]


@numba.njit(cache=True, nogil=True)
def _find_kinds(
    packed: Integers, known: Integers, start: int, same: NDArray[np.uint16]
) -> tuple[NDArray[np.intp], int]:
    """First frame of each kind, by hashing, and where the part ends that has them.

    The kind of every frame of the part is written to `same`.
    """
    slots = np.full(_SLOTS, -1, dtype=np.int32)
    kinds = np.empty(_MOST_KINDS, dtype=np.intp)
    n_kinds = 0
    for i in range(start, len(packed)):
        if i > start and _is_alike(packed, known, i, i - 1):
            same[i] = same[i - 1]
            continue
        key = np.uint64(0)
        for w in range(packed.shape[1]):
            mask = known[0 if len(known) == 1 else i, w]
            key = (key ^ (packed[i, w] & mask)) * np.uint64(0x9E3779B97F4A7C15)
            key = (key ^ (key >> np.uint64(29)) ^ mask) * np.uint64(0xBF58476D1CE4E5B9)
            key ^= key >> np.uint64(32)
        slot = np.intp(key % np.uint64(_SLOTS))
        while slots[slot] >= 0 and not _is_alike(packed, known, i, kinds[slots[slot]]):
            slot = (slot + 1) % _SLOTS
        if slots[slot] < 0:
            if n_kinds == _MOST_KINDS:
                return kinds, i
            slots[slot] = n_kinds
            kinds[n_kinds] = i
            n_kinds += 1
        same[i] = slots[slot]
    return kinds[:n_kinds], len(packed)


@numba.njit(cache=True, nogil=True)
def _is_alike(packed: Integers, known: Integers, i: int, j: int) -> bool:
    alike = True
    for w in range(packed.shape[1]):
        mask, other = known[0 if len(known) == 1 else i, w], known[0 if len(known) == 1 else j, w]
        alike &= mask == other and (packed[i, w] & mask) == (packed[j, w] & other)
    return alike


@numba.njit(cache=True, nogil=True)
def _costs_of_kinds(
    columns: WeighedColumns, packed: Integers, known: Integers, kinds: NDArray[np.intp]
) -> Single:
    """Cost of every column at each kind of frame, shape (K, kinds)."""
    n = len(kinds)
    # Often one mask holds for all: what a skeleton lacks, it lacks in every frame.
    n_masks = 1 if _is_one(known, kinds) else n
    seen = np.empty((n_masks, packed.shape[1]), dtype=np.uint64)
    shown = np.empty((n, packed.shape[1]), dtype=np.uint64)
    for j in range(n):
        for w in range(packed.shape[1]):
            mask = known[0 if len(known) == 1 else kinds[j], w]
            seen[0 if n_masks == 1 else j, w] = mask
            shown[j, w] = packed[kinds[j], w] & mask
    set_bytes, seen_bytes = _bytes_of(columns, shown), _bytes_of(columns, seen)
    costs = np.empty((len(columns.n_fixed), n), dtype=np.float32)
    wrong, if_known = np.empty(n, dtype=np.float64), np.empty(n_masks, dtype=np.float64)
    weight = np.empty(n_masks, dtype=np.float64)
    is_unseen = np.empty(n_masks, dtype=np.bool_)
    for k in range(len(costs)):
        _sum(columns.if_set[k], set_bytes, wrong)
        _sum(columns.if_known[k], seen_bytes, if_known)
        _sum(columns.weights[k], seen_bytes, weight)
        for j in range(n_masks):
            weight[j] = weight[j] if weight[j] > 0 else 1.0
            n_seen = np.int64(0)
            for w in range(packed.shape[1]):
                n_seen += np.int64(_count(seen[j, w] & columns.fixed[k, w]))
            is_unseen[j] = 2 * n_seen < columns.n_fixed[k]
        full = columns.column_weights[k]
        if n_masks == 1:
            for j in range(n):
                fraction = (wrong[j] + if_known[0]) / weight[0]
                costs[k, j] = np.float32((1.0 if is_unseen[0] else fraction) * full)
        else:
            for j in range(n):
                fraction = (wrong[j] + if_known[j]) / weight[j]
                costs[k, j] = np.float32((1.0 if is_unseen[j] else fraction) * full)
    return costs


@numba.njit(cache=True, nogil=True)
def _is_one(known: Integers, kinds: NDArray[np.intp]) -> bool:
    """Whether all kinds have one mask."""
    one = True
    if len(known) > 1:
        for j in range(1, len(kinds)):
            for w in range(known.shape[1]):
                one &= known[kinds[j], w] == known[kinds[0], w]
    return one


@numba.njit(cache=True, nogil=True)
def _bytes_of(columns: WeighedColumns, packed: Integers) -> NDArray[np.uint8]:
    """Used bytes, shape (bytes, frames)."""
    result = np.empty((len(columns.used), len(packed)), dtype=np.uint8)
    for b in range(len(columns.used)):
        word, shift = columns.used[b] // 8, np.uint64(8 * (columns.used[b] % 8))
        for i in range(len(packed)):
            result[b, i] = np.uint8((packed[i, word] >> shift) & np.uint64(0xFF))
    return result


@numba.njit(cache=True, nogil=True)
def _sum(tables: Floats, places: NDArray[np.uint8], total: Floats) -> None:
    """Sum of what the bytes add, in their order."""
    total[:] = 0.0
    for b in range(len(places)):
        table, place = tables[b], places[b]
        for j in range(len(total)):
            total[j] += table[place[j]]


@numba.njit(cache=True, nogil=True)
def _count(bits: np.uint64) -> np.uint64:
    # Pairwise bit sums: the form that compilers turn into vector instructions.
    bits = bits - ((bits >> np.uint64(1)) & np.uint64(0x5555555555555555))
    bits = (bits & np.uint64(0x3333333333333333)) + (
        (bits >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    bits = (bits + (bits >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (bits * np.uint64(0x0101010101010101)) >> np.uint64(56)
