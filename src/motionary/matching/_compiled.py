"""The distance function compiled: `_numpy.march` for one integer a frame.

No fastmath and the same single-precision operations in the same order, so that both give
the same bits.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from motionary.matching._numpy import Columns, Single

Integers = NDArray[np.uint64]

_TILE = 1024


@numba.njit(cache=True, nogil=True)
def march_packed(
    columns: Columns,
    packed: Integers,
    known: Integers | None,
    blocked: NDArray[np.intp],
    again: np.float32,
    last_two: Single,
    out: Single,
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
        for k in range(len(last_two)):
            if known is None:
                _known_costs(columns, k, packed[start:stop], cost)
            else:
                _masked_costs(columns, k, packed[start:stop], known[start:stop], cost)
            row = rows[k % 3, : n + 2]
            row[:2] = last_two[k]
            _accumulate(k, cost, rows[(k + 2) % 3], rows[(k + 1) % 3], again, row)
            for i in range(first, last):
                row[blocked[i] - start + 2] = np.inf
            last_two[k] = row[n:]
        out[start:stop] = rows[(len(last_two) - 1) % 3, 2 : n + 2]
        first = last


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
def _count(word: np.uint64) -> np.uint64:
    # Pairwise bit sums: the form that compilers turn into vector instructions.
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + (
        (word >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (word * np.uint64(0x0101010101010101)) >> np.uint64(56)
