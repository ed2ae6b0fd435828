"""A pattern, a quantised template as the matcher sees it, and its alignments.

Conventions: K columns of packed features with a mask of the fixed ones; free cells cost
nothing. The cost of a cell is the fraction of the column's fixed and known features that
disagree (Müller and Röder 2006, eq. 1), each entry with its weight, times the mean of the
column's weight and 1.

An alignment says where a match begins, and which frames meet which columns, in pairs (column,
frame), 0-based. It is computed on demand, for the ends that are asked for: the pattern is run
over the few frames before each end, in double precision. Of equally cheap steps into a cell the
first of (1, 1), (1, 2), (2, 1) is taken.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.packing import PackedFeatures, count, count_integers, distinct_frames, pack

Floats = NDArray[np.float64]

#: The authors' programs count the cell after a (2, 1) step twice, for the column left out.
SKIP_WEIGHT = 2.0

_STEPS = ((1, 1), (1, 2), (2, 1))
#: Costs are sums of fractions; equal ones may differ in the last bits.
_EQUAL = 1e-9
_BATCH = 128


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """Columns to be found in sequences.

    Attributes
    ----------
    values, fixed : arrays, shape (K, n_integers), uint64
        Relations and which of them are fixed; values of free features are ignored.
    weights : array, shape (K,)
        Time that a column stands for; the matcher takes its mean with 1.
    entry_weights : array, shape (K, n_features), or None
        Weights of the single entries, for patterns in which what is rare tells more. An
        entry of weight 0 is free.
    n_fixed : array, shape (K,), the number of fixed entries
    """

    values: PackedFeatures
    fixed: PackedFeatures
    weights: Floats
    entry_weights: Floats | None = None
    n_fixed: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        fixed = _check_fixed(self.values, self.fixed)
        weights = _check_weights(self.weights, n_columns=len(fixed))
        if self.entry_weights is not None:
            entries = _check_entries(self.entry_weights, fixed)
            fixed = fixed & pack(entries > 0)
            object.__setattr__(self, "entry_weights", entries)
        object.__setattr__(self, "values", self.values & fixed)
        object.__setattr__(self, "fixed", fixed)
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "n_fixed", count(fixed))

    def __len__(self) -> int:
        return len(self.values)

    @property
    def column_weights(self) -> Floats:
        """Factor of each column's cells, shape (K,)."""
        return (self.weights + 1.0) / 2.0

    def fully_seen(self, known: PackedFeatures) -> bool:
        """Whether every feature that a column fixes is known in all frames."""
        return not (~known & np.bitwise_or.reduce(self.fixed, axis=0)).any()


def cell_costs(pattern: Pattern, packed: PackedFeatures, known: PackedFeatures) -> Floats:
    """Costs of all columns against frames.

    Parameters
    ----------
    packed, known : arrays, shape (..., n_integers), uint64, that broadcast

    Returns
    -------
    array, shape (columns, ...), float64. Unknown entries leave the fraction; a column of which
    fewer than half of the fixed entries are known costs its whole weight.
    """

    def by_column(values: NDArray[Any]) -> NDArray[Any]:
        # An axis for each of the frames, before those of a value.
        shape = (-1, *(1,) * (max(packed.ndim, known.ndim) - 1), *values.shape[1:])
        return values.reshape(shape)

    seen = known & by_column(pattern.fixed)
    wrong = (packed ^ by_column(pattern.values)) & seen
    n_seen = count(seen)
    if pattern.entry_weights is None:
        fraction = count(wrong) / np.maximum(n_seen, 1)
    else:
        tables = byte_tables(pattern.entry_weights)
        seen_weight = _weigh(seen, tables)
        fraction = _weigh(wrong, tables) / np.where(seen_weight > 0, seen_weight, 1.0)
    unseen = 2 * n_seen < by_column(pattern.n_fixed)
    return np.asarray(np.where(unseen, 1.0, fraction) * by_column(pattern.column_weights))


def byte_tables(weights: Floats) -> Floats:
    """Weight of each value of each byte of features (K, features), shape (K, bytes, 256)."""
    n_bytes = -(-weights.shape[1] // 8)
    by_byte = np.zeros((len(weights), n_bytes * 8))
    by_byte[:, : weights.shape[1]] = weights
    by_byte = by_byte.reshape(len(weights), n_bytes, 8)
    tables = np.zeros((len(weights), n_bytes, 256))
    for bit in range(8):
        half = 1 << bit
        tables[..., half : 2 * half] = tables[..., :half] + by_byte[..., bit, np.newaxis]
    return tables


def check_sequence(pattern: Pattern, packed: PackedFeatures, known: PackedFeatures | None) -> None:
    """Raise InvalidInput unless features and mask have the pattern's form."""
    if packed.ndim != 2 or packed.shape[1] != pattern.values.shape[1]:
        raise InvalidInput(
            f"the pattern has {pattern.values.shape[1]} integers a frame, the sequence has "
            f"shape {packed.shape}; both must come from one feature set"
        )
    if known is not None and known.shape != packed.shape:
        raise InvalidInput(
            f"known needs the shape {packed.shape} of the features, got {known.shape}"
        )


def check_skip_weight(skip_weight: float) -> None:
    """Raise InvalidInput unless the weight is finite and at least 0."""
    if not 0 <= skip_weight < np.inf:
        raise InvalidInput(f"skip_weight must be finite and at least 0, got {skip_weight}")


def _check_fixed(values: PackedFeatures, fixed: PackedFeatures) -> PackedFeatures:
    if values.ndim != 2 or values.shape != fixed.shape:
        raise InvalidInput(
            "a pattern needs values and fixed of one shape (columns, integers), got "
            f"{values.shape} and {fixed.shape}"
        )
    if values.dtype != np.uint64 or fixed.dtype != np.uint64:
        raise InvalidInput(
            f"a pattern needs packed features (uint64), got {values.dtype} and {fixed.dtype}; "
            "see motionary.packing.pack"
        )
    if 0 in values.shape:
        raise InvalidInput(f"a pattern needs at least one column and integer, got {values.shape}")
    return fixed


def _check_weights(weights: Floats, *, n_columns: int) -> Floats:
    weights = np.asarray(weights, dtype=np.float64)
    if weights.shape != (n_columns,) or not ((weights > 0) & np.isfinite(weights)).all():
        raise InvalidInput(
            f"a pattern of {n_columns} columns needs as many finite, positive weights, got "
            f"shape {weights.shape}"
        )
    return weights


def _check_entries(entries: Floats, fixed: PackedFeatures) -> Floats:
    entries = np.asarray(entries, dtype=np.float64)
    form = (len(fixed), fixed.shape[1])
    if entries.ndim != 2 or (len(entries), count_integers(entries.shape[1])) != form:
        raise InvalidInput(
            f"entry weights need shape (columns, features) for {form[0]} columns of {form[1]} "
            f"integers, got {entries.shape}"
        )
    if not ((entries >= 0) & np.isfinite(entries)).all():
        raise InvalidInput("entry weights must be finite and at least 0")
    return entries


def _weigh(packed: PackedFeatures, tables: Floats) -> Floats:
    """Sum of the weights of what is set, in the order of bytes whatever stands beside."""
    as_bytes = np.ascontiguousarray(packed, dtype="<u8").view(np.uint8)
    total = np.zeros(packed.shape[:-1])
    for column, of_column in enumerate(tables):
        for i, table in enumerate(of_column):
            total[column] += table.take(as_bytes[column, ..., i])
    return total


# -- alignments -----------------------------------------------------------------------------


class Alignment(NamedTuple):
    """One match.

    Attributes
    ----------
    start, end : first and last frame
    cost : total along the path, divided by the number of columns
    path : array, shape (cells, 2), of (column, frame)
    """

    start: int
    end: int
    cost: float
    path: NDArray[np.intp]

    def shifted(self, frames: int) -> "Alignment":
        """The same match, so many frames later: of a part, as the whole counts frames."""
        path = self.path + np.array([0, frames])
        return Alignment(self.start + frames, self.end + frames, self.cost, path)


def align(
    pattern: Pattern,
    packed: PackedFeatures,
    known: PackedFeatures | None,
    ends: ArrayLike,
    *,
    skip_weight: float = SKIP_WEIGHT,
    since: ArrayLike = 0,
) -> list[Alignment]:
    """Best matches that end at given frames of one sequence.

    Parameters
    ----------
    pattern : Pattern
    packed, known : arrays, shape (frames, n_integers); known may be None
    ends : frames at which the distance function is finite
    since : frame before which no match may begin, or one for each end

    Returns
    -------
    list of Alignment, in the order of `ends`

    Raises
    ------
    InvalidInput
        If pattern and sequence do not fit, or no path ends at one of the frames.
    """
    check_sequence(pattern, packed, known)
    check_skip_weight(skip_weight)
    if known is not None and pattern.fully_seen(known):
        known = None
    frames = np.asarray(ends, dtype=np.intp)
    if len(frames) and not 0 <= frames.min() <= frames.max() < len(packed):
        raise InvalidInput(
            f"ends must be frames of the sequence (0 to {len(packed) - 1}), got "
            f"{frames.min()} to {frames.max()}"
        )
    begin = np.broadcast_to(np.maximum(np.asarray(since, dtype=np.intp), 0), frames.shape)
    result: list[Alignment] = []
    for first in range(0, len(frames), _BATCH):
        batch = slice(first, first + _BATCH)
        result += _align_batch(pattern, packed, known, frames[batch], begin[batch], skip_weight)
    return result


def _align_batch(
    pattern: Pattern,
    packed: PackedFeatures,
    known: PackedFeatures | None,
    ends: NDArray[np.intp],
    begin: NDArray[np.intp],
    skip_weight: float,
) -> list[Alignment]:
    width = 2 * len(pattern) - 1
    at = ends[:, np.newaxis] + np.arange(1 - width, 1)
    outside = at < begin[:, np.newaxis]
    used, inverse = np.unique(np.maximum(at, 0), return_inverse=True)
    mask = np.full_like(packed[:1], ~np.uint64(0)) if known is None else known[used]
    first, same = distinct_frames(packed[used], mask)
    mask = mask if known is None else mask[first]
    frames = same[inverse.reshape(at.shape)]
    total, steps = _accumulate(pattern, packed[used[first]], mask, frames, outside, skip_weight)
    if not np.isfinite(total).all():
        bad = int(ends[~np.isfinite(total)][0])
        raise InvalidInput(f"no path of {len(pattern)} columns ends at frame {bad}")
    return [
        _backtrack(steps[:, i], int(end), float(cost) / len(pattern))
        for i, (end, cost) in enumerate(zip(ends, total, strict=True))
    ]


def _accumulate(
    pattern: Pattern,
    packed: PackedFeatures,
    known: PackedFeatures,
    frames: NDArray[np.intp],
    outside: NDArray[np.bool_],
    skip_weight: float,
) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Costs at the last frame of each window, and the step into every cell.

    Only cells from which steps lead to the last frame are computed; `frames` are the rows
    of `packed` in each window.
    """
    n_windows, width = outside.shape
    steps = np.zeros((len(pattern), n_windows, width), dtype=np.int8)
    padded = np.full((3, n_windows, width + 2), np.inf)
    costs = cell_costs(pattern, packed, known)
    for k in range(len(pattern)):
        left = len(pattern) - 1 - k
        here = slice(width - 1 - 2 * left, width - (left + 1) // 2)
        cost = costs[k][frames[:, here]]
        row, before, skipped = (padded[(k - back) % 3] for back in range(3))
        if k > 0:
            one = before[:, here.start + 1 : here.stop + 1]
            candidates = [before[:, here.start : here.stop] + cost]
            if k > 1:
                candidates.append(skipped[:, here.start + 1 : here.stop + 1] + skip_weight * cost)
            cost = _cheapest(one + cost, candidates, steps[k, :, here])
        cost[outside[:, here]] = np.inf
        row[:, here.start + 2 : here.stop + 2] = cost
    return padded[(len(pattern) - 1) % 3][:, -1], steps


def _cheapest(
    best: NDArray[np.float64], candidates: list[NDArray[np.float64]], steps: NDArray[np.int8]
) -> NDArray[np.float64]:
    """Least cost; which of the candidates has it, counted from 1, is written to `steps`."""
    for number, other in enumerate(candidates, start=1):
        better = other < best - _EQUAL
        steps[better] = number
        best = np.where(better, other, best)
    return best


def _backtrack(steps: NDArray[np.int8], end: int, cost: float) -> Alignment:
    n_columns, width = steps.shape
    column, place = n_columns - 1, width - 1
    cells = [(column, place)]
    while column > 0:
        down, back = _STEPS[steps[column, place]]
        column, place = column - down, place - back
        cells.append((column, place))
    path = np.array(cells[::-1], dtype=np.intp)
    path[:, 1] += end - (width - 1)
    return Alignment(int(path[0, 1]), end, cost, path)
