"""MatchedColumns of the examples of one class: which of their columns belong together.

Classical dynamic time warping of every example against every other, after Müller and
Röder (2006), section 4.1: steps (1, 0), (0, 1), (1, 1); a pair of columns costs their
Manhattan distance times the mean of their weights. Where several paths cost the same, the
one that walks back diagonally is taken, then the one that steps in the warped example
only, then the one that steps in the reference only.

Costs do not depend on which of the two is the reference, so each unordered pair is summed
up once and walked back twice. Both engines give the same result to the bit.

Conventions: a *stack* holds the columns of all examples below one another; example `i` is
rows `offsets[i]` to `offsets[i + 1]`.
"""

from collections.abc import Callable, Iterator
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.matching import load_twin

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Cells that the NumPy engine holds at once: 32 MB, whatever the number of examples.
BATCH_CELLS = 4_000_000
#: Pairs of columns in one pass (48 examples of 74 columns) above which loading numba costs
#: less time than it saves.
WORTH_LOADING = 6_000_000

EngineName = Literal["auto", "numpy", "compiled"]


class MatchedColumns(NamedTuple):
    """Pairs of columns that met, over all ordered pairs of different examples.

    `reference` and `warped` are rows of the stack, shape (n_met,), in no particular order;
    `largest_cost` is the highest cost of a path.
    """

    reference: Indices
    warped: Indices
    largest_cost: float


class PairCost(NamedTuple):
    """Cost of each pair of columns of two examples, and their first rows in the stack."""

    cost: Floats
    first: int
    second: int


Engine = Callable[[Iterator[PairCost]], MatchedColumns]


def align_all(
    values: Floats, weights: Floats, offsets: Indices, *, engine: Engine
) -> MatchedColumns:
    """Columns that meet when each example of a stack in turn is the reference of all others."""
    return engine(_pairs(values, weights, offsets))


def _pairs(values: Floats, weights: Floats, offsets: Indices) -> Iterator[PairCost]:
    """Costs of all unordered pairs, computed for one example against all later ones."""
    # Late: a quarter of a second that who only uses templates need not wait.
    from scipy.spatial.distance import cdist

    # A feature that nobody changes adds exact zeros to every distance.
    changing = values[:, np.ptp(values, axis=0) > 0.0]
    for example in range(len(offsets) - 2):
        begin, rest = offsets[example], offsets[example + 1]
        mean_weights = 0.5 * (weights[begin:rest, None] + weights[None, rest:])
        costs = cdist(changing[begin:rest], changing[rest:], "cityblock") * mean_weights
        for first, end in zip(offsets[example + 1 : -1], offsets[example + 2 :], strict=True):
            yield PairCost(costs[:, first - rest : end - rest], int(begin), int(first))


def align_batched(pairs: Iterator[PairCost]) -> MatchedColumns:
    """MatchedColumns of all pairs, many at a time along their anti-diagonals."""
    parts = [_align(batch) for batch in _batches(pairs)]
    none = np.zeros(0, dtype=np.intp)
    return MatchedColumns(
        np.concatenate([none, *(part.reference for part in parts)]),
        np.concatenate([none, *(part.warped for part in parts)]),
        max((part.largest_cost for part in parts), default=0.0),
    )


def align_compiled(pairs: Iterator[PairCost]) -> MatchedColumns:
    """Alignment of all pairs, one after the other, by the kernels of the extra `fast`."""
    # Late: loading numba takes as long as learning a class.
    from motionary.models.templates.compiled import accumulate, walk_back

    none = np.zeros(0, dtype=np.intp)
    references, warpeds = [none], [none]
    largest_cost = 0.0
    for pair in pairs:
        total = accumulate(pair.cost)
        largest_cost = max(largest_cost, float(total[-1, -1]))
        rows, columns = walk_back(total, True)
        references.append(rows + pair.first)
        warpeds.append(columns + pair.second)
        rows, columns = walk_back(total, False)
        references.append(columns + pair.second)
        warpeds.append(rows + pair.first)
    return MatchedColumns(np.concatenate(references), np.concatenate(warpeds), largest_cost)


def choose_engine(name: EngineName, offsets: Indices) -> Engine:
    """The engine of a name; "auto" takes the compiled one where it is worth loading."""
    lengths = np.diff(offsets)
    n_cells = int(lengths.sum() ** 2 - (lengths**2).sum()) // 2
    compiler = load_twin("numba", name, pays=n_cells >= WORTH_LOADING)
    return align_batched if compiler is None else align_compiled


def _batches(pairs: Iterator[PairCost]) -> Iterator[list[PairCost]]:
    batch: list[PairCost] = []
    rows = columns = 0
    for pair in pairs:
        rows = max(rows, pair.cost.shape[0])
        columns = max(columns, pair.cost.shape[1])
        if batch and (len(batch) + 1) * (rows + 1) * (rows + columns + 1) > BATCH_CELLS:
            yield batch
            batch = []
            rows, columns = pair.cost.shape
        batch.append(pair)
    if batch:
        yield batch


def _align(batch: list[PairCost]) -> MatchedColumns:
    lengths = np.array([pair.cost.shape for pair in batch])
    first = np.array([pair.first for pair in batch])
    second = np.array([pair.second for pair in batch])
    total = _accumulate(batch, *lengths.max(axis=0))
    ends = total[lengths.sum(axis=1), lengths[:, 0], np.arange(len(batch))]
    rows, columns, which = _walk_back(total, lengths, second_first=True)
    met_first = [first[which] + rows, second[which] + columns]
    rows, columns, which = _walk_back(total, lengths, second_first=False)
    met_second = [second[which] + columns, first[which] + rows]
    reference, warped = np.concatenate([met_first, met_second], axis=1)
    return MatchedColumns(reference, warped, float(ends.max()))


def _accumulate(batch: list[PairCost], n_rows: int, n_columns: int) -> Floats:
    """Cheapest cost up to each cell, shape (row + column, row, pair), counted from 1.

    With anti-diagonals as the first axis, a cell depends on the two before only, and one
    vector operation serves a diagonal of all pairs.
    """
    total = np.full((n_rows + n_columns + 1, n_rows + 1, len(batch)), np.inf)
    diagonal_step, row_step, pair_step = total.strides
    for index, pair in enumerate(batch):
        cells = np.ndarray(
            pair.cost.shape,
            buffer=total,
            offset=2 * diagonal_step + row_step + index * pair_step,
            strides=(diagonal_step + row_step, diagonal_step),
        )
        cells[...] = pair.cost
    total[0, 0] = 0.0
    for diagonal in range(2, n_rows + n_columns + 1):
        begin, end = max(1, diagonal - n_columns), min(n_rows, diagonal - 1) + 1
        best = np.minimum(total[diagonal - 1, begin:end], total[diagonal - 1, begin - 1 : end - 1])
        np.minimum(best, total[diagonal - 2, begin - 1 : end - 1], out=best)
        total[diagonal, begin:end] += best
    return total


def _walk_back(
    total: Floats, lengths: NDArray[np.int_], *, second_first: bool
) -> tuple[Indices, Indices, Indices]:
    """Row, column (from 0) and pair of every cell of the cheapest paths.

    `second_first` says which step is taken when both steps along one axis cost the same
    and less than the diagonal: in the column's example only, or in the row's only.
    """
    _, width, n_pairs = total.shape
    flat = total.reshape(-1)
    one_row, one_column = (width + 1) * n_pairs, width * n_pairs
    pair = np.arange(n_pairs)
    row, column = lengths[:, 0].copy(), lengths[:, 1].copy()
    met: list[tuple[Indices, Indices, Indices]] = []
    while len(pair):
        met.append((row - 1, column - 1, pair))
        here = ((row + column) * width + row) * n_pairs + pair
        in_row, in_column = flat[here - one_row], flat[here - one_column]
        diagonal = flat[here - one_row - one_column] <= np.minimum(in_row, in_column)
        along_column = in_column <= in_row if second_first else in_column < in_row
        row = row - (diagonal | ~along_column)
        column = column - (diagonal | along_column)
        open_ = row > 0
        if not open_.all():
            pair, row, column = pair[open_], row[open_], column[open_]
    rows, columns, pairs = (np.concatenate(part) for part in zip(*met, strict=True))
    return rows, columns, pairs
