"""How good is a list of costed detections, at any threshold?

Mean average precision at temporal IoU, in the manner of THUMOS and ActivityNet (Caba
Heilbron et al., 2015): within a class, the predictions of all recordings are taken by
rising cost; each takes the true segment of its recording that it overlaps most among
those not taken yet and is right if there is one with at least the asked IoU. Average
precision is the area under precision, made monotone, over recall.

Conventions: predictions of infinite cost are never found. Of predictions of equal cost
the wrong ones come first, so that a tie never flatters and order never matters; within a
recording equal costs are matched by start, then end. A class without a true segment has
no average precision (NaN) and does not enter the mean.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.evaluation.tables import (
    Segment,
    Segments,
    check_iou,
    check_segments,
    compute_iou,
    list_names,
    select_name,
)

IOUS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)


def compute_average_precisions(
    predicted: Sequence[Segments], truth: Sequence[Segments], *, ious: Sequence[float] = IOUS
) -> dict[str, NDArray[np.float64]]:
    """Average precision by class.

    Parameters
    ----------
    predicted, truth : sequences of sequences of Segment
        One entry per recording, in the same order.
    ious : sequence of float
        Least temporal intersection over union of a match, inclusive.

    Returns
    -------
    dict
        Of each class that occurs in either, an array of shape (ious,); NaN for a class
        that does not occur in the truth.
    """
    for iou in ious:
        check_iou(iou)
    if len(predicted) != len(truth):
        raise InvalidInput(
            "prediction and truth need one entry per recording, "
            f"got {len(predicted)} and {len(truth)}"
        )
    predicted = [check_segments(one, where="the prediction") for one in predicted]
    truth = [check_segments(one, where="the truth") for one in truth]
    return {
        name: _compute_class(
            [select_name(one, name) for one in predicted],
            [select_name(one, name) for one in truth],
            np.asarray(ious, dtype=np.float64),
        )
        for name in list_names(*predicted, *truth)
    }


def compute_mean_average_precision(
    predicted: Sequence[Segments], truth: Sequence[Segments], *, ious: Sequence[float] = IOUS
) -> NDArray[np.float64]:
    """Mean of the average precisions of the classes that occur in the truth.

    Returns
    -------
    array, shape (ious,)
        NaN if the truth holds no segment.
    """
    by_class = compute_average_precisions(predicted, truth, ious=ious)
    occurring = [values for values in by_class.values() if not np.isnan(values).any()]
    if not occurring:
        return np.full(len(ious), np.nan)
    return np.asarray(np.mean(occurring, axis=0), dtype=np.float64)


def _compute_class(
    predicted: Sequence[list[Segment]],
    truth: Sequence[list[Segment]],
    ious: NDArray[np.float64],
) -> NDArray[np.float64]:
    n_true = sum(len(one) for one in truth)
    if n_true == 0:
        return np.full(len(ious), np.nan)
    costs: list[float] = []
    right = [np.zeros((0, len(ious)), dtype=np.bool_)]
    for claimed, real in zip(predicted, truth, strict=True):
        found = sorted(
            (segment for segment in claimed if segment.cost < np.inf),
            key=lambda segment: (segment.cost, segment.start, segment.end),
        )
        costs += [segment.cost for segment in found]
        right.append(_match(compute_iou(found, sorted(real)), ious))
    matched = np.concatenate(right)
    return np.array([_area(np.array(costs), column, n_true) for column in matched.T])


def _match(overlaps: NDArray[np.float64], ious: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which predictions, in their order, take a true segment, shape (predicted, ious)."""
    right = np.zeros((len(overlaps), len(ious)), dtype=np.bool_)
    if overlaps.size == 0:
        return right
    for k, least in enumerate(ious):
        free = np.ones(overlaps.shape[1], dtype=np.bool_)
        for i, row in enumerate(overlaps):
            best = int(np.where(free, row, -1.0).argmax())
            if free[best] and row[best] >= least:
                right[i, k] = True
                free[best] = False
    return right


def _area(costs: NDArray[np.float64], right: NDArray[np.bool_], n_true: int) -> float:
    """Area under monotone precision over recall."""
    ranked = right[np.lexsort((right, costs))]
    precision = np.cumsum(ranked) / np.arange(1, len(ranked) + 1)
    monotone = np.maximum.accumulate(precision[::-1])[::-1]
    return float(monotone[ranked].sum() / n_true)
