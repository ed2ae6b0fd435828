"""The compiled twin of `alignment.align_batched`, behind the extra `fast`.

Adds and compares the same numbers in the same order, so that both engines return the same
paths and costs to the bit. Imported late: loading numba takes as long as learning a class.
"""

from collections.abc import Iterator

import numpy as np
from numba import njit

from motionary.models.templates.alignment import Alignment, Floats, Indices, Pair


def align_compiled(pairs: Iterator[Pair]) -> Alignment:
    """Alignment of all pairs, one after the other; see `alignment.align_all`."""
    none = np.zeros(0, dtype=np.intp)
    references, warpeds = [none], [none]
    largest_cost = 0.0
    for pair in pairs:
        total = _accumulate(pair.cost)
        largest_cost = max(largest_cost, float(total[-1, -1]))
        rows, columns = _walk_back(total, True)
        references.append(rows + pair.first)
        warpeds.append(columns + pair.second)
        rows, columns = _walk_back(total, False)
        references.append(columns + pair.second)
        warpeds.append(rows + pair.first)
    return Alignment(np.concatenate(references), np.concatenate(warpeds), largest_cost)


@njit(cache=True)
def _accumulate(cost: Floats) -> Floats:
    """Cheapest cost up to each cell, counted from 1; infinite borders."""
    n_rows, n_columns = cost.shape
    total = np.empty((n_rows + 1, n_columns + 1))
    total[0, :] = np.inf
    total[0, 0] = 0.0
    for row in range(1, n_rows + 1):
        left = np.inf
        total[row, 0] = left
        for column in range(1, n_columns + 1):
            best = min(total[row - 1, column], total[row - 1, column - 1])
            left = cost[row - 1, column - 1] + min(best, left)
            total[row, column] = left
    return total


@njit(cache=True)
def _walk_back(total: Floats, second_first: bool) -> tuple[Indices, Indices]:
    """Row and column (from 0) of the cheapest path's cells; see the twin for the ties."""
    row, column = total.shape[0] - 1, total.shape[1] - 1
    rows = np.empty(row + column, dtype=np.intp)
    columns = np.empty(row + column, dtype=np.intp)
    n_met = 0
    while row > 0:
        rows[n_met] = row - 1
        columns[n_met] = column - 1
        n_met += 1
        in_row, in_column = total[row - 1, column], total[row, column - 1]
        if total[row - 1, column - 1] <= min(in_row, in_column):
            row -= 1
            column -= 1
        elif in_column < in_row or (second_first and in_column == in_row):
            column -= 1
        else:
            row -= 1
    return rows[:n_met], columns[:n_met]
