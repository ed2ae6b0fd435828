"""Alignments: where a match begins, and which frames meet which columns.

Start frames are computed on demand, for the ends that are asked for: the pattern is run
over the few frames before each end, in double precision.

Conventions: paths are pairs (column, frame), 0-based. Of equally cheap steps into a cell
the first of (1, 1), (1, 2), (2, 1) is taken.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.matching.distance import SKIP_WEIGHT
from motionary.matching.pattern import (
    Pattern,
    byte_tables,
    cell_costs,
    check_sequence,
    check_skip_weight,
)
from motionary.packing import PackedFeatures, distinct_frames

_STEPS = ((1, 1), (1, 2), (2, 1))
#: Costs are sums of fractions; equal ones may differ in the last bits.
_EQUAL = 1e-9
_BATCH = 128


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
    entries = pattern.entry_weights
    tables = None if entries is None else byte_tables(entries)
    for k in range(len(pattern)):
        left = len(pattern) - 1 - k
        here = slice(width - 1 - 2 * left, width - (left + 1) // 2)
        cost = cell_costs(pattern, k, packed, known, tables=tables)[frames[:, here]]
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
