"""The distance function in NumPy: a row of the pattern at a time over many frames.

With steps (1, 1), (1, 2), (2, 1) no cell depends on its own row, so a row is one vector
operation over the whole tile. `_compiled` is the twin and gives the same bits.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from motionary.matching.pattern import Pattern, cell_costs
from motionary.words import Words

Single = NDArray[np.float32]


class RowCosts(Protocol):
    """Costs of one column of a pattern against a stretch of frames."""

    n_columns: int

    def row(self, column: int, start: int, stop: int) -> Single:
        """Costs of the frames start to stop, shape (stop - start,)."""


def unit_costs(pattern: Pattern) -> Single:
    """Cost of one disagreement by column and number of known entries, (K, entries + 1)."""
    n_seen = np.arange(int(pattern.n_fixed.max()) + 1)
    return (pattern.column_weights[:, np.newaxis] / np.maximum(n_seen, 1)).astype(np.float32)


def row_costs(pattern: Pattern, words: Words, known: Words | None) -> RowCosts:
    """The way to compute costs that fits the pattern and the document."""
    if pattern.entry_weights is not None or words.shape[1] > 1:
        return _TabledCosts(pattern, words, known)
    if known is None:
        return _KnownCosts(pattern, words[:, 0])
    return _MaskedCosts(pattern, words[:, 0], known[:, 0])


class _KnownCosts:
    """One word a frame, everything known: a popcount a cell."""

    def __init__(self, pattern: Pattern, words: Words) -> None:
        self.n_columns = len(pattern)
        self._values, self._fixed = pattern.values[:, 0], pattern.fixed[:, 0]
        self._scales = unit_costs(pattern)[np.arange(len(pattern)), pattern.n_fixed]
        self._words = words

    def row(self, column: int, start: int, stop: int) -> Single:
        wrong = self._words[start:stop] ^ self._values[column]
        wrong &= self._fixed[column]
        costs: Single = np.bitwise_count(wrong) * self._scales[column]
        return costs


class _MaskedCosts:
    """One word a frame, some relations unknown."""

    def __init__(self, pattern: Pattern, words: Words, known: Words) -> None:
        self.n_columns = len(pattern)
        self._values, self._fixed = pattern.values[:, 0], pattern.fixed[:, 0]
        self._n_fixed = pattern.n_fixed
        self._unit_costs = unit_costs(pattern)
        self._full = pattern.column_weights.astype(np.float32)
        self._words, self._known = words, known

    def row(self, column: int, start: int, stop: int) -> Single:
        seen = self._known[start:stop] & self._fixed[column]
        n_seen = np.bitwise_count(seen)
        wrong = np.bitwise_count((self._words[start:stop] ^ self._values[column]) & seen)
        costs: Single = wrong * self._unit_costs[column][n_seen]
        costs[2 * n_seen.astype(np.int64) < self._n_fixed[column]] = self._full[column]
        return costs


class _TabledCosts:
    """Any pattern: costs of the distinct words, then looked up."""

    def __init__(self, pattern: Pattern, words: Words, known: Words | None) -> None:
        self.n_columns = len(pattern)
        self._pattern = pattern
        n_words = words.shape[1]
        if known is None:
            known = np.broadcast_to(np.bitwise_or.reduce(pattern.fixed, axis=0), words.shape)
        both = np.concatenate([words, known], axis=1)
        distinct, self._which = np.unique(both, axis=0, return_inverse=True)
        self._words, self._known = distinct[:, :n_words], distinct[:, n_words:]
        self._column, self._costs = -1, np.empty(0, dtype=np.float32)
        self._table: list[Single] = [self._distinct_costs(k) for k in range(len(pattern))]

    def _distinct_costs(self, column: int) -> Single:
        costs = cell_costs(self._pattern, column, self._words, self._known)
        return costs.astype(np.float32)

    def row(self, column: int, start: int, stop: int) -> Single:
        return self._table[column][self._which[start:stop]]


def march(
    costs: RowCosts,
    start: int,
    blocked: NDArray[np.intp],
    skip: np.float32,
    last_two: Single,
    out: Single,
) -> None:
    """Accumulated costs of the last column over a tile, written to `out`.

    `last_two` (K, 2) holds every column's two frames before the tile and is updated.
    """
    n = len(out)
    rows = [np.empty(n + 2, dtype=np.float32) for _ in range(3)]
    for k in range(costs.n_columns):
        before, row = rows[(k - 1) % 3], rows[k % 3]
        row[:2] = last_two[k]
        cost = costs.row(k, start, start + n)
        if k == 0:
            row[2:] = cost
        else:
            np.minimum(before[1:-1], before[:-2], out=row[2:])
            row[2:] += cost
        if k > 1:
            cost *= skip
            cost += rows[(k - 2) % 3][1:-1]
            np.minimum(row[2:], cost, out=row[2:])
        row[2:][blocked] = np.inf
        last_two[k] = row[-2:]
    out[:] = rows[(costs.n_columns - 1) % 3][2:]
