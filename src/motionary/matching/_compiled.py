"""The distance function compiled: `_numpy.march` for words that are all known.

No fastmath and the same single-precision operations in the same order, so that both give
the same bits.
"""

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _count(word: np.uint64) -> np.uint8:
    # Pairwise bit sums: the form that compilers turn into vector instructions.
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + (
        (word >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (word * np.uint64(0x0101010101010101)) >> np.uint64(56)


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def march_words(values, fixed, scales, words, blocked, skip, last_two, out):  # type: ignore[no-untyped-def]
    """Accumulated costs of the last column over a tile of words, written to `out`."""
    n = len(words)
    n_columns = len(values)
    rows = np.empty((3, n + 2), dtype=np.float32)
    for k in range(n_columns):
        row, before, skipped = rows[k % 3], rows[(k + 2) % 3], rows[(k + 1) % 3]
        row[0], row[1] = last_two[k, 0], last_two[k, 1]
        value, mask, scale = values[k], fixed[k], scales[k]
        if k == 0:
            for i in range(n):
                row[i + 2] = np.float32(_count((words[i] ^ value) & mask)) * scale
        elif k == 1:
            for i in range(n):
                cost = np.float32(_count((words[i] ^ value) & mask)) * scale
                row[i + 2] = min(before[i + 1], before[i]) + cost
        else:
            for i in range(n):
                cost = np.float32(_count((words[i] ^ value) & mask)) * scale
                straight = min(before[i + 1], before[i]) + cost
                row[i + 2] = min(straight, cost * skip + skipped[i + 1])
        for i in blocked:
            row[i + 2] = np.inf
        last_two[k, 0], last_two[k, 1] = row[n], row[n + 1]
    out[:] = rows[(n_columns - 1) % 3, 2:]
