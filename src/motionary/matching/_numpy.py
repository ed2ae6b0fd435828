"""The distance function in NumPy: a row of the pattern at a time over many frames.

With steps (1, 1), (1, 2), (2, 1) no cell depends on its own row, so a row is one vector
operation over a tile of frames, and over as many patterns abreast as fit into the tile.
`_compiled` is the twin and gives the same bits.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from motionary.matching.pattern import Floats, Pattern, byte_tables
from motionary.packing import PackedFeatures, count, distinct_frames, unpack

Single = NDArray[np.float32]
Steps = NDArray[np.uint8]

# Cells at a time: enough that the calls cost little, few enough for a processor's caches.
_TILE = 32768


class Columns(NamedTuple):
    """A pattern of one integer a column as the kernels want it; or several, see `stack`.

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


class WeighedColumns(NamedTuple):
    """Any pattern as the kernels want it: tables of what each byte of a frame adds.

    Attributes
    ----------
    used : array, shape (B,): the bytes in which a column fixes a feature
    if_set, if_known, weights : arrays, shape (K, B, 256), float64, by the byte's value
        What set features add to the weight of what disagrees, what known ones add, and the
        weight of the known ones.
    fixed : array, shape (K, n_integers), uint64
    n_fixed : array, shape (K,), int64
    column_weights : array, shape (K,), float64
    """

    used: NDArray[np.intp]
    if_set: Floats
    if_known: Floats
    weights: Floats
    fixed: PackedFeatures
    n_fixed: NDArray[np.int64]
    column_weights: Floats


def prepare(pattern: Pattern) -> Columns:
    """Columns of a pattern that has one integer a column and no entry weights."""
    n_seen = np.arange(65)
    unit = (pattern.column_weights[:, np.newaxis] / np.maximum(n_seen, 1)).astype(np.float32)
    return Columns(
        np.ascontiguousarray(pattern.values[:, 0]),
        # A copy: frozen arrays are of another type, for which the twin would be compiled again.
        pattern.fixed[:, 0].copy(),
        ((pattern.n_fixed + 1) // 2).astype(np.uint8),
        pattern.column_weights.astype(np.float32),
        unit,
        unit[np.arange(len(unit)), pattern.n_fixed],
    )


def stack(patterns: Sequence[Columns]) -> Columns:
    """Columns of patterns abreast, shape (K, T, ...); zeros where one is shorter."""
    longest = max(len(columns.values) for columns in patterns)

    def join(parts: tuple[NDArray[Any], ...]) -> NDArray[Any]:
        together = np.zeros((longest, len(parts), *parts[0].shape[1:]), dtype=parts[0].dtype)
        for i, part in enumerate(parts):
            together[: len(part), i] = part
        return together

    return Columns(*(join(parts) for parts in zip(*patterns, strict=True)))


@lru_cache(maxsize=16)
def prepare_weighed(pattern: Pattern) -> WeighedColumns:
    """Columns of any pattern; without entry weights every fixed entry weighs 1.

    Kept for some patterns: one is matched with many parts of an archive.
    """
    n_features = 64 * pattern.values.shape[1]
    fixed, value = unpack(pattern.fixed, n_features), unpack(pattern.values, n_features)
    weight = fixed.astype(np.float64)
    if pattern.entry_weights is not None:
        weight[:, : pattern.entry_weights.shape[1]] *= pattern.entry_weights
    used = np.flatnonzero(fixed.any(axis=0).reshape(-1, 8).any(axis=1))
    features = (8 * used[:, np.newaxis] + np.arange(8)).reshape(-1)
    # Wrong is a 1 that is not there, or one that should not be.
    if_set, if_known = np.where(value, -weight, weight), weight * value
    tables = [byte_tables(table[:, features]) for table in (if_set, if_known, weight)]
    return WeighedColumns(
        used,
        tables[0],
        tables[1],
        tables[2],
        np.ascontiguousarray(pattern.fixed),
        pattern.n_fixed,
        pattern.column_weights,
    )


class RowCosts(Protocol):
    """Costs of the columns of patterns abreast against the frames of a tile."""

    def enter(self, start: int, stop: int) -> None:
        """Go to the frames start to stop."""

    def write(self, column: int, out: Single) -> None:
        """Write costs of one column of the first len(out) patterns at these frames to `out`."""


def row_costs(
    columns: Columns | WeighedColumns, packed: PackedFeatures, known: PackedFeatures | None
) -> RowCosts:
    """The way to compute costs that fits the sequence and the columns: stacked, or weighed."""
    if isinstance(columns, WeighedColumns):
        mask = ~np.zeros((1, packed.shape[1]), np.uint64) if known is None else known
        return _WeighedCosts(columns, packed, mask)
    if known is None:
        return _KnownCosts(columns, packed[:, 0])
    return _MaskedCosts(columns, packed[:, 0], known[:, 0])


class _KnownCosts:
    """One integer a frame, everything known: a popcount a cell."""

    def __init__(self, columns: Columns, packed: NDArray[np.uint64]) -> None:
        self._columns, self._packed = columns, packed

    def enter(self, start: int, stop: int) -> None:
        self._tile = self._packed[start:stop]
        shape = self._columns.values.shape[1], stop - start
        self._bits = np.empty(shape, dtype=np.uint64)
        self._wrong = np.empty(shape, dtype=np.uint8)

    def write(self, column: int, out: Single) -> None:
        n = len(out)
        bits, wrong = self._bits[:n], self._wrong[:n]
        values, fixed, unit = (
            part[column, :n, np.newaxis]
            for part in (self._columns.values, self._columns.fixed, self._columns.all_known)
        )
        np.bitwise_xor(self._tile, values, out=bits)
        np.bitwise_and(bits, fixed, out=bits)
        np.bitwise_count(bits, out=wrong)
        np.multiply(wrong, unit, out=out)


class _MaskedCosts:
    """One integer a frame, some features unknown in some frames."""

    def __init__(
        self, columns: Columns, packed: NDArray[np.uint64], known: NDArray[np.uint64]
    ) -> None:
        self._columns, self._packed, self._known = columns, packed, known
        self._fixed = np.bitwise_or.reduce(columns.fixed, axis=None)
        # Where each pattern's costs by number of known entries begin.
        self._unit_at = np.arange(columns.unit.shape[1])[:, np.newaxis] * columns.unit.shape[2]
        self._rest = _KnownCosts(columns, packed)

    def enter(self, start: int, stop: int) -> None:
        tile, mask = self._packed[start:stop], self._known[start:stop]
        # Elsewhere both ways give the same bits, and this one takes three times as long.
        partial = np.flatnonzero(~mask & self._fixed)
        self._partial = partial if 2 * len(partial) < len(mask) else None
        if self._partial is not None:
            self._rest.enter(start, stop)
            tile, mask = tile[partial], mask[partial]
        # Often one mask holds for all: what a skeleton lacks, it lacks in every frame.
        self._tile, self._mask = tile, mask[:1] if len(mask) and (mask == mask[0]).all() else mask

    def write(self, column: int, out: Single) -> None:
        if self._partial is None:
            self._write_masked(column, out)
            return
        self._rest.write(column, out)
        if len(self._partial):
            costs = np.empty((len(out), len(self._partial)), dtype=np.float32)
            self._write_masked(column, costs)
            out[:, self._partial] = costs

    def _write_masked(self, column: int, out: Single) -> None:
        n, columns = len(out), self._columns
        fixed = columns.fixed[column, :n, np.newaxis]
        seen = self._mask & fixed
        n_seen = np.bitwise_count(seen)
        wrong = self._tile ^ columns.values[column, :n, np.newaxis]
        wrong &= seen
        unit = columns.unit[column].take(n_seen + self._unit_at[:n])
        np.multiply(np.bitwise_count(wrong), unit, out=out)
        unseen = n_seen < columns.half[column, :n, np.newaxis]
        np.copyto(out, columns.full[column, :n, np.newaxis], where=unseen)


class _WeighedCosts:
    """Any pattern, alone: what each byte of a frame adds, summed in the order of bytes.

    Once for each kind of frame in a tile.
    """

    def __init__(
        self, columns: WeighedColumns, packed: PackedFeatures, known: PackedFeatures
    ) -> None:
        self._columns, self._packed, self._known = columns, packed, known

    def enter(self, start: int, stop: int) -> None:
        seen = self._known if len(self._known) == 1 else self._known[start:stop]
        # Often one mask holds for all: what a skeleton lacks, it lacks in every frame.
        seen = seen[:1] if (seen == seen[0]).all() else seen
        packed = self._packed[start:stop] & seen
        first, self._same = distinct_frames(packed, seen)
        self._seen = seen if len(seen) == 1 else seen[first]
        self._seen_bytes = self._bytes(self._seen)
        self._set_bytes = self._bytes(packed[first])

    def write(self, column: int, out: Single) -> None:
        columns = self._columns
        fraction = _sum(columns.if_set[column], self._set_bytes)
        fraction += _sum(columns.if_known[column], self._seen_bytes)
        weight = _sum(columns.weights[column], self._seen_bytes)
        fraction /= np.where(weight > 0, weight, 1.0)
        unseen = 2 * count(self._seen & columns.fixed[column]) < columns.n_fixed[column]
        costs = np.where(unseen, 1.0, fraction) * columns.column_weights[column]
        costs.astype(np.float32).take(self._same, out=out[0], mode="clip")

    def _bytes(self, packed: PackedFeatures) -> NDArray[np.intp]:
        """Used bytes, shape (bytes, frames)."""
        as_bytes = np.ascontiguousarray(packed, dtype="<u8").view(np.uint8)
        return as_bytes.T[self._columns.used].astype(np.intp)


def _sum(tables: Floats, places: NDArray[np.intp]) -> Floats:
    total = np.zeros(places.shape[1])
    for table, place in zip(tables, places, strict=True):
        total += table.take(place)
    return total


class _Row(NamedTuple):
    """Accumulated costs of one column over a tile, as seen from this and later frames."""

    edge: Single
    here: Single
    one_back: Single
    two_back: Single
    last_two: Single

    def of_first(self, n: int) -> "_Row":
        """Those of the first patterns."""
        return _Row(*(view[:n] for view in self))


def march(
    costs: RowCosts,
    ends: Mapping[int, Sequence[tuple[int, int]]],
    n_abreast: NDArray[np.intp],
    blocked: NDArray[np.intp],
    again: np.float32,
    last_two: Single,
    out: Single,
    steps: Steps | None = None,
) -> None:
    """Accumulated costs of the last columns of patterns abreast, written to `out`.

    The cell after a (2, 1) step counts once and `again` times more; no path goes through
    the frames that are `blocked`.

    Parameters
    ----------
    ends : rows of `out` by the column that they show: each with its pattern
    n_abreast : array, shape (K,): how many patterns have a column; the longest come first
    last_two : array, shape (K, T, 2): every column's two frames before the first; is updated
    steps : array, shape (K, T, frames): gets the step into each cell but those of the first
        column: 0 for (1, 1), 1 for (1, 2), 2 or 3 for (2, 1)
    """
    n_patterns, n_frames = last_two.shape[1], out.shape[1]
    tile = max(min(_TILE // n_patterns, n_frames), 1)
    buffer = np.empty((4, n_patterns, tile + 2), dtype=np.float32)
    for start in range(0, n_frames, tile):
        stop = min(start + tile, n_frames)
        costs.enter(start, stop)
        rows = [_views(row[:, : stop - start + 2]) for row in buffer[:3]]
        inside = blocked[np.searchsorted(blocked, start) : np.searchsorted(blocked, stop)] - start
        own = None if steps is None else steps[..., start:stop]
        for k, row in _march_tile(
            costs, n_abreast, rows, buffer[3, :, : stop - start], inside, again, last_two, own
        ):
            for into, pattern in ends.get(k, ()):
                out[into, start:stop] = row[pattern]


def _views(row: Single) -> _Row:
    return _Row(row[:, :2], row[:, 2:], row[:, 1:-1], row[:, :-2], row[:, -2:])


def _march_tile(
    costs: RowCosts,
    n_abreast: NDArray[np.intp],
    rows: list[_Row],
    cost: Single,
    blocked: NDArray[np.intp],
    again: np.float32,
    last_two: Single,
    steps: Steps | None,
) -> Iterator[tuple[int, Single]]:
    """Columns and their accumulated costs, which hold until the next column."""
    spare = np.empty(cost.shape, dtype=np.uint8)
    for k, n in enumerate(n_abreast.tolist()):
        row, before, skipped = (rows[(k - back) % 3].of_first(n) for back in range(3))
        here, cost, better = row.here, cost[:n], spare[:n]
        row.edge[:] = last_two[k, :n]
        costs.write(k, here if k == 0 else cost)
        if k > 0:
            if steps is not None:
                np.less(before.two_back, before.one_back, out=steps[k, :n].view(np.bool_))
            np.minimum(before.one_back, before.two_back, out=here)
        if k > 1:
            # In place: nothing reads that row again.
            twice = skipped.one_back
            np.add(twice, cost if again == 1 else cost * again, out=twice)
            if steps is not None:
                np.less(twice, here, out=better.view(np.bool_))
                np.add(better, better, out=better)
                np.bitwise_or(steps[k, :n], better, out=steps[k, :n])
            np.minimum(here, twice, out=here)
        if k > 0:
            np.add(here, cost, out=here)
        if len(blocked):
            here[:, blocked] = np.inf
        last_two[k, :n] = row.last_two
        yield k, here
