"""The distance function in NumPy: a row of the pattern at a time over many frames.

With steps (1, 1), (1, 2), (2, 1) no cell depends on its own row, so a row is one vector
operation over a tile of frames. `_compiled` is the twin and gives the same bits.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from motionary.matching.pattern import Floats, Pattern
from motionary.words import Words, unpack

Single = NDArray[np.float32]

# Large enough that the calls cost little, small enough for a processor's second cache.
_TILE = 16384


class Columns(NamedTuple):
    """A pattern of one integer a column as the kernels want it.

    Attributes
    ----------
    values, fixed : arrays, shape (K,), uint64
    half : array, shape (K,), uint8: fewest known entries of a cell that is judged
    full : array, shape (K,), float32: cost of a cell that is not
    unit : array, shape (K, entries + 1), float32
        Cost of one disagreement by the number of known entries.
    all_known : array, shape (K,), float32: the same where all are known
    """

    values: NDArray[np.uint64]
    fixed: NDArray[np.uint64]
    half: NDArray[np.uint8]
    full: Single
    unit: Single
    all_known: Single


def prepare(pattern: Pattern) -> Columns:
    """Columns of a pattern that has one integer a column and no entry weights."""
    n_seen = np.arange(65)
    unit = (pattern.column_weights[:, np.newaxis] / np.maximum(n_seen, 1)).astype(np.float32)
    return Columns(
        np.ascontiguousarray(pattern.values[:, 0]),
        np.ascontiguousarray(pattern.fixed[:, 0]),
        ((pattern.n_fixed + 1) // 2).astype(np.uint8),
        pattern.column_weights.astype(np.float32),
        unit,
        unit[np.arange(len(unit)), pattern.n_fixed],
    )


class RowCosts(Protocol):
    """Costs of a pattern's columns against the frames of a tile."""

    def enter(self, start: int, stop: int) -> None:
        """Go to the frames start to stop."""

    def write(self, column: int, out: Single) -> None:
        """Write the costs of one column at these frames to `out`."""


def row_costs(pattern: Pattern, words: Words, known: Words | None) -> RowCosts:
    """The way to compute costs that fits the pattern and the document."""
    if pattern.entry_weights is not None or words.shape[1] > 1:
        return _WeighedCosts(pattern, words, known)
    if known is None:
        return _KnownCosts(prepare(pattern), words[:, 0])
    return _MaskedCosts(prepare(pattern), words[:, 0], known[:, 0])


class _KnownCosts:
    """One integer a frame, everything known: a popcount a cell."""

    def __init__(self, columns: Columns, words: NDArray[np.uint64]) -> None:
        self._columns, self._words = columns, words

    def enter(self, start: int, stop: int) -> None:
        self._tile = self._words[start:stop]
        self._bits = np.empty(stop - start, dtype=np.uint64)
        self._wrong = np.empty(stop - start, dtype=np.uint8)

    def write(self, column: int, out: Single) -> None:
        np.bitwise_xor(self._tile, self._columns.values[column], out=self._bits)
        np.bitwise_and(self._bits, self._columns.fixed[column], out=self._bits)
        np.bitwise_count(self._bits, out=self._wrong)
        np.multiply(self._wrong, self._columns.all_known[column], out=out)


class _MaskedCosts:
    """One integer a frame, some relations unknown."""

    def __init__(
        self, columns: Columns, words: NDArray[np.uint64], known: NDArray[np.uint64]
    ) -> None:
        self._columns, self._words, self._known = columns, words, known

    def enter(self, start: int, stop: int) -> None:
        self._tile, self._mask = self._words[start:stop], self._known[start:stop]

    def write(self, column: int, out: Single) -> None:
        values, fixed, half, full, unit, _ = self._columns
        seen = self._mask & fixed[column]
        n_seen = np.bitwise_count(seen)
        wrong = self._tile ^ values[column]
        wrong &= seen
        np.take(unit[column], n_seen, out=out, mode="clip")
        out *= np.bitwise_count(wrong)
        out[n_seen < half[column]] = full[column]


class _WeighedCosts:
    """Any pattern: products of matrices, whose sums are exact (see `pattern`)."""

    def __init__(self, pattern: Pattern, words: Words, known: Words | None) -> None:
        entries = pattern.entry_weights
        n_relations = 64 * words.shape[1] if entries is None else entries.shape[1]
        fixed = unpack(pattern.fixed, n_relations)
        value = unpack(pattern.values, n_relations)
        weight = fixed.astype(np.float64) if entries is None else fixed * entries
        # Wrong is a 1 that is not there, or one that should not be.
        self._if_known = np.concatenate([weight * value, weight, fixed])
        self._if_set = np.where(value, -weight, weight)
        self._n_fixed, self._full = pattern.n_fixed, pattern.column_weights
        self._n_relations, self._words, self._known = n_relations, words, known

    def enter(self, start: int, stop: int) -> None:
        words = self._words[start:stop]
        if self._known is None:
            seen = np.ones((1, self._n_relations))
        else:
            words = words & self._known[start:stop]
            seen = self._bits(self._known[start:stop])
        wrong, weight, n_seen = np.split(self._if_known @ seen.T, 3)
        self._share = self._if_set @ self._bits(words).T
        self._share += wrong
        self._share /= np.where(weight > 0, weight, 1.0)
        self._unseen = 2 * n_seen < self._n_fixed[:, np.newaxis]

    def write(self, column: int, out: Single) -> None:
        full = self._full[column]
        out[:] = np.where(self._unseen[column], 1.0, self._share[column]) * full

    def _bits(self, words: Words) -> Floats:
        return unpack(words, self._n_relations).astype(np.float64)


class _Row(NamedTuple):
    """Accumulated costs of one column over a tile, as seen from this and later frames."""

    edge: Single
    here: Single
    one_back: Single
    two_back: Single
    last_two: Single


def march(
    costs: RowCosts, blocked: NDArray[np.intp], skip: np.float32, last_two: Single, out: Single
) -> None:
    """Accumulated costs of the last column, written to `out`.

    `last_two` (K, 2) holds every column's two frames before the first and is updated;
    no path goes through the frames that are `blocked`.
    """
    buffer = np.empty((4, min(_TILE, len(out)) + 2), dtype=np.float32)
    for start in range(0, len(out), _TILE):
        stop = min(start + _TILE, len(out))
        costs.enter(start, stop)
        rows = [_views(row[: stop - start + 2]) for row in buffer[:3]]
        inside = blocked[np.searchsorted(blocked, start) : np.searchsorted(blocked, stop)] - start
        _march_tile(costs, rows, buffer[3, : stop - start], inside, skip, last_two)
        out[start:stop] = rows[(len(last_two) - 1) % 3].here


def _views(row: Single) -> _Row:
    return _Row(row[:2], row[2:], row[1:-1], row[:-2], row[-2:])


def _march_tile(
    costs: RowCosts,
    rows: list[_Row],
    cost: Single,
    blocked: NDArray[np.intp],
    skip: np.float32,
    last_two: Single,
) -> None:
    for k in range(len(last_two)):
        row, before, skipped = rows[k % 3], rows[(k - 1) % 3], rows[(k - 2) % 3]
        here = row.here
        row.edge[:] = last_two[k]
        costs.write(k, here if k == 0 else cost)
        if k > 0:
            np.minimum(before.one_back, before.two_back, out=here)
            np.add(here, cost, out=here)
        if k > 1:
            np.multiply(cost, skip, out=cost)
            np.add(cost, skipped.one_back, out=cost)
            np.minimum(here, cost, out=here)
        if len(blocked):
            here[blocked] = np.inf
        last_two[k] = row.last_two
