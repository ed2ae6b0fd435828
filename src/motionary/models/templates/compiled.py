"""Compiled kernels of aligning examples, behind the extra `fast`.

They add and compare the same numbers in the same order as those of `alignment`, so that both
return the same paths and costs to the bit.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


@njit(cache=True)
def accumulate(cost: Floats) -> Floats:
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
def walk_back(total: Floats, second_first: bool) -> tuple[Indices, Indices]:
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
