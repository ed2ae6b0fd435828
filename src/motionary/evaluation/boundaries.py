"""How far off are the ends of labels, and how much work is left for a person?

Two measures of our own, stated here because the literature uses several.

- *Boundary error*: predicted and true segments of one class are paired, best overlap
  (IoU) first, each at most once; of the pairs, the distances of starts and of ends.
- *Edits to a correct labelling*: the smallest number of single corrections after which
  predicted and true segments pair up with equal names and with starts and ends within a
  tolerance. One correction adds a segment, deletes one, renames one, or moves one end of
  one. To split a segment or to join two takes two corrections.

Conventions: segments half-open, in the unit of the result (seconds).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.evaluation.tables import (
    ROUNDING,
    Segments,
    check_iou,
    check_segments,
    compute_iou,
    to_times,
)

# A pair must overlap at least so much for the distance of its ends to mean anything.
LEAST_IOU = 0.1

# An end within a quarter of a second is one that a person leaves alone: the ends of two
# annotators of CMU 86_01 lie 0.22 s apart in the median.
TOLERANCE_S = 0.25


class BoundaryError(NamedTuple):
    """How far off the ends of matched segments are.

    Attributes
    ----------
    median, mean : distance in the unit of the segments; NaN without a matched segment
    matched : number of matched segments, two ends each
    """

    median: float
    mean: float
    matched: int


def pair_segments(
    predicted: Segments, truth: Segments, *, iou: float = LEAST_IOU
) -> list[tuple[int, int]]:
    """Pairs of equal name, best overlap first, each segment at most once.

    Parameters
    ----------
    predicted, truth : sequences of Segment
    iou : float
        Least temporal intersection over union, inclusive.

    Returns
    -------
    list of (position in predicted, position in truth)
    """
    least = check_iou(iou)
    predicted = check_segments(predicted, where="the prediction")
    truth = check_segments(truth, where="the truth")
    overlaps = compute_iou(predicted, truth) * _have_equal_names(predicted, truth)
    rows, columns = np.nonzero(overlaps >= least)
    # Equal overlaps go to the earlier segments, whatever the order of the tables.
    times = (*to_times(truth)[columns].T[::-1], *to_times(predicted)[rows].T[::-1])
    order = np.lexsort((*times, -overlaps[rows, columns]))
    pairs: list[tuple[int, int]] = []
    used_rows: set[int] = set()
    used_columns: set[int] = set()
    for row, column in zip(rows[order].tolist(), columns[order].tolist(), strict=True):
        if row not in used_rows and column not in used_columns:
            used_rows.add(row)
            used_columns.add(column)
            pairs.append((row, column))
    return pairs


def compute_boundary_offsets(
    predicted: Segments, truth: Segments, *, iou: float = LEAST_IOU
) -> NDArray[np.float64]:
    """Start and end of matched segments, predicted minus true.

    Positive is late.

    Returns
    -------
    array, shape (matched, 2), unit of the segments
    """
    pairs = np.array(pair_segments(predicted, truth, iou=iou), dtype=np.int64).reshape(-1, 2)
    return to_times(predicted)[pairs[:, 0]] - to_times(truth)[pairs[:, 1]]


def compute_boundary_error(offsets: NDArray[np.float64]) -> BoundaryError:
    """Median and mean distance of ends, of one or several recordings.

    Parameters
    ----------
    offsets : array, shape (matched, 2)
        From `compute_boundary_offsets`.
    """
    distances = np.abs(offsets)
    if distances.size == 0:
        return BoundaryError(float("nan"), float("nan"), 0)
    return BoundaryError(float(np.median(distances)), float(distances.mean()), len(distances))


def count_edits(predicted: Segments, truth: Segments, *, tolerance: float = TOLERANCE_S) -> int:
    """Smallest number of corrections to a correct labelling, as told above.

    Parameters
    ----------
    predicted, truth : sequences of Segment
    tolerance : float
        Largest distance of a start or an end that is left as it is, inclusive.
    """
    if not (np.isfinite(tolerance) and tolerance >= 0):
        raise InvalidInput(f"a tolerance must be finite and not below 0, got {tolerance}")
    predicted = check_segments(predicted, where="the prediction")
    truth = check_segments(truth, where="the truth")
    # Late: of the package this function alone needs it, and it takes longest to import.
    from scipy.optimize import linear_sum_assignment

    saved = _compute_savings(predicted, truth, tolerance)
    best = saved[linear_sum_assignment(saved, maximize=True)].sum()
    return len(predicted) + len(truth) - int(best)


def _have_equal_names(predicted: Segments, truth: Segments) -> NDArray[np.bool_]:
    claimed = np.array([segment.name for segment in predicted], dtype=object)
    real = np.array([segment.name for segment in truth], dtype=object)
    return np.asarray(claimed[:, None] == real[None], dtype=np.bool_)


def _compute_savings(predicted: Segments, truth: Segments, tolerance: float) -> NDArray[np.int64]:
    """What correcting each pair saves against deleting one and adding the other."""
    distances = np.abs(to_times(predicted)[:, None] - to_times(truth)[None])
    moves = (distances > tolerance + ROUNDING).sum(axis=2)
    corrections = moves + ~_have_equal_names(predicted, truth)
    return np.asarray(np.maximum(2 - corrections, 0), dtype=np.int64)
