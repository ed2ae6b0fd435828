"""The distance function of an example over a recording, whatever a cell costs.

The distance function of Müller and Röder (2006), eq. 2, on a full matrix of costs: the
steps are those of `motionary.matching`, which compares packed features and keeps no matrix.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.matching import SKIP_WEIGHT

Floats = NDArray[np.float64]


class Matches(NamedTuple):
    """The best match that ends at each frame.

    Attributes
    ----------
    distance : array, shape (frames,), cost by columns; inf where no path fits
    starts : array, shape (frames,), where it begins; -1 where no path fits
    """

    distance: Floats
    starts: NDArray[np.intp]


def match_costs(costs: ArrayLike, *, skip_weight: float = SKIP_WEIGHT) -> Matches:
    """Subsequence DTW with the steps (1, 1), (1, 2) and (2, 1) in (example, document).

    Parameters
    ----------
    costs : array, shape (columns, frames), at least 0; inf where no path may go
    skip_weight : how often the cell after a (2, 1) step counts

    Raises
    ------
    InvalidInput
        If the costs have another shape, are negative or NaN.
    """
    matrix = np.asarray(costs, dtype=np.float64)
    if matrix.ndim != 2 or matrix.size == 0:
        raise InvalidInput(
            f"costs need shape (columns, frames), at least one of each, got {matrix.shape}"
        )
    if not (matrix >= 0).all():
        raise InvalidInput("costs must be numbers of at least 0, got negative ones or NaN")
    distance, starts = _march(matrix, skip_weight)
    starts[np.isinf(distance)] = -1
    return Matches(distance / len(matrix), starts)


def _march(costs: Floats, skip_weight: float) -> tuple[Floats, NDArray[np.intp]]:
    n_frames = costs.shape[1]
    rows = [(np.full(n_frames, np.inf), np.full(n_frames, -1))] * 2
    frames = np.arange(n_frames)
    for k, cost in enumerate(costs):
        if k == 0:
            rows = [rows[1], (cost.copy(), frames)]
            continue
        (skipped, from_skipped), (before, from_before) = rows
        ways = np.stack([
            _later(before, 1, np.inf) + cost,
            _later(before, 2, np.inf) + cost,
            _later(skipped, 1, np.inf) + skip_weight * cost,
        ])  # fmt: skip
        begins = np.stack(
            [_later(from_before, 1, -1), _later(from_before, 2, -1), _later(from_skipped, 1, -1)]
        )
        best = ways.argmin(axis=0)
        rows = [rows[1], (ways[best, frames], begins[best, frames])]
    return rows[1]


def _later(row: NDArray[Any], frames: int, fill: float) -> NDArray[Any]:
    shifted = np.full_like(row, fill)
    shifted[frames:] = row[:-frames]
    return shifted
