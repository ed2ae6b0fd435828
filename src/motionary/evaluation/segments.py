"""Measures of segments: found or not, in the right order, with the right ends.

- P2, R2, F2 of the thesis (2012), eqs 5.15-5.16: a predicted segment is right if it
  overlaps any true segment of its class, a true one is found if any predicted segment of
  its class overlaps it. One may serve several; touching is not overlapping.
- Segment F1 at an overlap (IoU), after Lea et al., Temporal convolutional networks for
  action segmentation and detection, 2017: each true segment is matched at most once, so
  that a segment in pieces counts as errors.
- Edit score, after Lea et al., Segmental spatiotemporal CNNs for fine-grained action
  segmentation, 2016: is the order of labels right?

Two measures of our own, stated here because the literature uses several:

- *Boundary error*: predicted and true segments of one class are paired, best overlap
  (IoU) first, each at most once; of the pairs, the distances of starts and of ends.
- *Edits to a correct labelling*: the smallest number of single corrections after which
  predicted and true segments pair up with equal names and with starts and ends within a
  tolerance. One correction adds a segment, deletes one, renames one, or moves one end of
  one. To split a segment or to join two takes two corrections.

Conventions: segments in seconds or frames, half-open, results in the same unit; what has no
label is no segment; scores in [0, 1] (Lea et al. print percent).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.evaluation.counts import (
    ROUNDING,
    Counts,
    LabelledSegment,
    Segments,
    check_iou,
    check_tables,
    compute_iou,
    compute_overlap,
    list_names,
    select_name,
    to_times,
)

# A pair must overlap at least so much for the distance of its ends to mean anything.
LEAST_IOU = 0.1

# An end within a quarter of a second is one that a person leaves alone: the ends of two
# annotators of CMU 86_01 lie 0.22 s apart in the median.
TOLERANCE_S = 0.25


class BoundaryError(NamedTuple):
    """Distances of the ends of matched segments.

    Attributes
    ----------
    median, mean : distance in the unit of the segments; NaN without a matched segment
    matched : number of matched segments, two ends each
    """

    median: float
    mean: float
    matched: int


def count_overlaps(predicted: Segments, truth: Segments) -> dict[str, Counts]:
    """Counts of segments by class, found if they overlap at all.

    Parameters
    ----------
    predicted, truth : sequences of LabelledSegment

    Returns
    -------
    dict
        Counts of each class that occurs in either table; `pool_counts` of all and
        `compute_rates` give P2, R2, F2.
    """
    counts = {}
    for name, claimed, real in _by_class(predicted, truth):
        overlaps = compute_overlap(claimed, real) > 0
        right, found = overlaps.any(axis=1).sum(), overlaps.any(axis=0).sum()
        counts[name] = Counts(int(right), len(claimed), int(found), len(real))
    return counts


def count_matches(predicted: Segments, truth: Segments, *, iou: float) -> dict[str, Counts]:
    """Counts of segments by class, matched one to one.

    As Lea et al. (2017): each predicted segment takes the true segment of its class that
    it overlaps most, the earlier of equals; it is right if that overlap reaches `iou` and
    no other took the same before. It never falls back on its second best, so swapping
    the tables may change the result where `iou` is below a half.

    Parameters
    ----------
    predicted, truth : sequences of LabelledSegment
    iou : float
        Least temporal intersection over union, inclusive.

    Returns
    -------
    dict
        Counts of each class that occurs in either table.
    """
    least = check_iou(iou)
    counts = {}
    for name, claimed, real in _by_class(predicted, truth):
        right = _count_taken(claimed, sorted(real), least)
        counts[name] = Counts(right, len(claimed), right, len(real))
    return counts


def compute_edit_distance(predicted: Segments, truth: Segments) -> int:
    """Least number of labels to add, delete or rename to get the true order of labels.

    Labels are ordered by start, then end, then name; when they happen does not matter.
    """
    predicted, truth = check_tables(predicted, truth)
    orders = (
        [one.name for one in sorted(table, key=lambda s: (s.start, s.end, s.name))]
        for table in (predicted, truth)
    )
    return _levenshtein(*orders)


def compute_edit_score(predicted: Segments, truth: Segments) -> float:
    """1 minus the edit distance divided by the larger number of labels."""
    distance = compute_edit_distance(predicted, truth)
    return 1 - distance / max(len(predicted), len(truth), 1)


def count_false(predicted: Segments, truth: Segments) -> int:
    """Number of predicted segments that overlap no true segment of their class."""
    counts = count_overlaps(predicted, truth).values()
    return sum(one.predicted - one.correct for one in counts)


def pair_segments(
    predicted: Segments, truth: Segments, *, iou: float = LEAST_IOU
) -> list[tuple[int, int]]:
    """Pairs of equal name, best overlap first, each segment at most once.

    Parameters
    ----------
    predicted, truth : sequences of LabelledSegment
    iou : float
        Least temporal intersection over union, inclusive.

    Returns
    -------
    list of (position in predicted, position in truth)
    """
    least = check_iou(iou)
    predicted, truth = check_tables(predicted, truth)
    overlaps = compute_iou(predicted, truth) * _have_equal_names(predicted, truth)
    rows, columns = np.nonzero(overlaps >= least)
    # Equal overlaps go to the earlier segments, whatever the order of the tables.
    times = (*to_times(truth)[columns].T[::-1], *to_times(predicted)[rows].T[::-1])
    order = np.lexsort((*times, -overlaps[rows, columns]))
    pairs: dict[int, int] = {}
    used: set[int] = set()
    for row, column in zip(rows[order].tolist(), columns[order].tolist(), strict=True):
        if row not in pairs and column not in used:
            used.add(column)
            pairs[row] = column
    return list(pairs.items())


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
    predicted, truth : sequences of LabelledSegment
    tolerance : float
        Largest distance of a start or an end that is left as it is, inclusive.
    """
    if not (np.isfinite(tolerance) and tolerance >= 0):
        raise InvalidInput(f"a tolerance must be finite and not below 0, got {tolerance}")
    predicted, truth = check_tables(predicted, truth)
    # Late: of the package this function alone needs it, and it takes longest to import.
    from scipy.optimize import linear_sum_assignment

    saved = _compute_savings(predicted, truth, tolerance)
    best = saved[linear_sum_assignment(saved, maximize=True)].sum()
    return len(predicted) + len(truth) - int(best)


def _by_class(
    predicted: Segments, truth: Segments
) -> Iterator[tuple[str, list[LabelledSegment], list[LabelledSegment]]]:
    predicted, truth = check_tables(predicted, truth)
    for name in list_names(predicted, truth):
        yield name, select_name(predicted, name), select_name(truth, name)


def _count_taken(
    predicted: list[LabelledSegment], truth: list[LabelledSegment], least: float
) -> int:
    if not truth:
        return 0
    taken: set[int] = set()
    for row in compute_iou(predicted, truth):
        best = int(row.argmax())
        if row[best] >= least:
            taken.add(best)
    return len(taken)


def _levenshtein(source: list[str], target: list[str]) -> int:
    """Edit distance, a row of the table at a time."""
    codes = {name: code for code, name in enumerate(sorted({*source, *target}))}
    letters = np.array([codes[name] for name in target], dtype=np.int64)
    steps = np.arange(len(target) + 1)
    row = steps.copy()
    for name in source:
        changed = row[:-1] + (letters != codes[name])
        row = np.concatenate([row[:1] + 1, np.minimum(row[1:] + 1, changed)])
        # Insertions run along the row: a running minimum of what is left after them.
        row = np.minimum.accumulate(row - steps) + steps
    return int(row[-1])


def _have_equal_names(predicted: Segments, truth: Segments) -> NDArray[np.bool_]:
    claimed = np.array([segment.name for segment in predicted], dtype=object)
    real = np.array([segment.name for segment in truth], dtype=object)
    return np.asarray(claimed[:, None] == real[None], dtype=np.bool_)


def _compute_savings(predicted: Segments, truth: Segments, tolerance: float) -> NDArray[np.int64]:
    """Corrections that each pair saves against deleting one and adding the other."""
    distances = np.abs(to_times(predicted)[:, None] - to_times(truth)[None])
    moves = (distances > tolerance + ROUNDING).sum(axis=2)
    corrections = moves + ~_have_equal_names(predicted, truth)
    return np.asarray(np.maximum(2 - corrections, 0), dtype=np.int64)
