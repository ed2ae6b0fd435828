"""Measures of ranked lists, of costed detections and of choices, and intervals of means.

Retrieval: every item of a collection has a cost and is relevant or not. Classification:
every clip has a cost for each class.

Detections: mean average precision at temporal IoU, in the manner of THUMOS and ActivityNet (Caba
Heilbron et al., 2015): within a class, the predictions of all recordings are taken by
rising cost; each takes the true segment of its recording that it overlaps most among
those not taken yet and is right if there is one with at least the asked IoU. Average
precision is the area under precision, made monotone, over recall.

Conventions: small costs come first. What has an infinite cost is never found, whether it is
right or not. Of equal costs the irrelevant items and wrong predictions come first, so that a tie
never flatters and the given order never matters; within a recording predictions of equal cost
are matched by start, then end. A query without any relevant item, and a class without a true
segment, has no average precision (NaN) and does not enter a mean.

Intervals of a mean that was measured on a few people: values of one actor resemble each
other, so it is actors that are drawn, not values: a cluster bootstrap with percentile limits
(Efron and Tibshirani, An introduction to the bootstrap, 1993, chapters 8 and 13). Every value
weighs the same, so an actor with more values weighs more. With few groups (five actors) such an
interval is too narrow rather than too wide.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.evaluation.counts import (
    Confusion,
    Counts,
    LabelledSegment,
    Rates,
    Segments,
    check_iou,
    check_tables,
    compute_iou,
    compute_rates,
    list_names,
    select_name,
)

IOUS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
RESAMPLES = 10_000


class Retrieval(NamedTuple):
    """Means over queries.

    Attributes
    ----------
    average_precision, r_precision : means; NaN if no query has a relevant item
    queries : number of queries that have one
    """

    average_precision: float
    r_precision: float
    queries: int


class Classification(NamedTuple):
    """Choices among classes.

    Attributes
    ----------
    accuracy : fraction of clips that got their class; NaN without clips
    confusion : row true, column chosen; "no label" is a clip without any finite cost
    """

    accuracy: float
    confusion: Confusion


class Interval(NamedTuple):
    """A mean and its limits.

    Attributes
    ----------
    mean : mean of all values
    low, high : limits
    groups : number of groups with values
    """

    mean: float
    low: float
    high: float
    groups: int


def compute_average_precision(costs: ArrayLike, relevant: ArrayLike) -> float:
    """Mean, over the relevant items, of the precision where each is retrieved.

    Parameters
    ----------
    costs : array, shape (items,)
        Infinite for items that are not retrieved.
    relevant : array, shape (items,), bool

    Returns
    -------
    float
        0 is the precision at an item that is never retrieved; no interpolation.
    """
    costs, relevant = _check_ranking(costs, relevant)
    if not relevant.any():
        return float("nan")
    ranked = _rank(costs, relevant)
    precision = np.cumsum(ranked) / np.arange(1, len(ranked) + 1)
    return float(precision[ranked].sum() / relevant.sum())


def compute_r_precision(costs: ArrayLike, relevant: ArrayLike) -> float:
    """Precision among the first R items, R the number of relevant ones.

    Parameters
    ----------
    costs : array, shape (items,)
    relevant : array, shape (items,), bool
    """
    costs, relevant = _check_ranking(costs, relevant)
    if not relevant.any():
        return float("nan")
    total = int(relevant.sum())
    return float(_rank(costs, relevant)[:total].sum() / total)


def summarize_rankings(rankings: Iterable[tuple[ArrayLike, ArrayLike]]) -> Retrieval:
    """Mean average precision and mean R-precision of queries.

    Parameters
    ----------
    rankings : iterable of (costs, relevant)
        One pair per query, each as `compute_average_precision` takes them.
    """
    values = [
        (compute_average_precision(costs, relevant), compute_r_precision(costs, relevant))
        for costs, relevant in rankings
    ]
    defined = [pair for pair in values if not np.isnan(pair[0])]
    if not defined:
        return Retrieval(float("nan"), float("nan"), 0)
    average, first = np.mean(defined, axis=0)
    return Retrieval(float(average), float(first), len(defined))


def compute_rates_at(costs: ArrayLike, relevant: ArrayLike, *, threshold: float) -> Rates:
    """Precision, recall and F of the items whose cost is at most a threshold.

    Parameters
    ----------
    costs : array, shape (items,)
    relevant : array, shape (items,), bool
    threshold : float
        Inclusive; an infinite cost stays out under any threshold.
    """
    costs, relevant = _check_ranking(costs, relevant)
    if np.isnan(threshold):
        raise InvalidInput("a threshold must be a number, got NaN")
    retrieved = (costs <= threshold) & (costs < np.inf)
    right = int((retrieved & relevant).sum())
    return compute_rates(Counts(right, int(retrieved.sum()), right, int(relevant.sum())))


def score_classification(
    costs: ArrayLike, truth: Sequence[str], *, names: Sequence[str]
) -> Classification:
    """Accuracy and confusion of giving each clip the class of smallest cost.

    Ties go to the earlier class.

    Parameters
    ----------
    costs : array, shape (clips, classes)
    truth : sequence of str
        The true class of each clip, one of `names`.
    names : sequence of str
        The classes, in the order of the columns.
    """
    matrix = _check_costs(costs, len(truth), len(names))
    codes = {name: code for code, name in enumerate(names)}
    unknown = sorted(set(truth) - set(codes))
    if unknown or len(codes) < len(names):
        raise InvalidInput(f"names must hold every class once, got {list(names)}, miss {unknown}")
    real = np.array([codes[name] for name in truth], dtype=np.int64)
    chosen = _choose(matrix)
    confusion = np.zeros((len(names) + 1, len(names) + 1), dtype=np.int64)
    np.add.at(confusion, (real, chosen), 1)
    accuracy = float(np.mean(chosen == real)) if len(real) else float("nan")
    return Classification(accuracy, Confusion(tuple(names), confusion))


def compute_average_precisions(
    predicted: Sequence[Segments], truth: Sequence[Segments], *, ious: Sequence[float] = IOUS
) -> dict[str, NDArray[np.float64]]:
    """Average precision by class.

    Parameters
    ----------
    predicted, truth : sequences of sequences of LabelledSegment
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
    pairs = [check_tables(*pair) for pair in zip(predicted, truth, strict=True)]
    least = np.asarray(ious, dtype=np.float64)
    return {
        name: _compute_class([[select_name(one, name) for one in pair] for pair in pairs], least)
        for name in list_names(*(table for pair in pairs for table in pair))
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


def interval(
    values_by_group: Mapping[str, Sequence[float]], *, seed: int, level: float = 0.95
) -> Interval:
    """Bootstrap interval of the mean over groups.

    Parameters
    ----------
    values_by_group : mapping
        Values of each group (actor). NaN, a value that is not defined, is left out, and
        so is a group without values.
    seed : int
        The same seed gives the same limits.
    level : float
        Fraction of resampled means between the limits, in (0, 1).

    Raises
    ------
    InvalidInput
        For fewer than two groups with values, or an infinite value.
    """
    if not 0 < level < 1:
        raise InvalidInput(f"a level must lie between 0 and 1, got {level}")
    arrays = [np.asarray(values, dtype=np.float64) for values in values_by_group.values()]
    arrays = [values[~np.isnan(values)] for values in arrays]
    arrays = [values for values in arrays if values.size]
    if len(arrays) < 2:
        raise InvalidInput(f"an interval over groups needs at least two, got {len(arrays)}")
    if any(np.isinf(values).any() for values in arrays):
        raise InvalidInput("values must be finite, got an infinite one")
    sums = np.array([values.sum() for values in arrays])
    sizes = np.array([values.size for values in arrays])
    drawn = np.random.default_rng(seed).integers(len(arrays), size=(RESAMPLES, len(arrays)))
    means = sums[drawn].sum(axis=1) / sizes[drawn].sum(axis=1)
    low, high = np.quantile(means, ((1 - level) / 2, (1 + level) / 2))
    return Interval(float(sums.sum() / sizes.sum()), float(low), float(high), len(arrays))


def _choose(costs: NDArray[np.float64]) -> NDArray[np.int64]:
    """Class of smallest cost, shape (clips,); the number of classes for no class."""
    # The extra column also serves a matrix without classes.
    padded = np.pad(costs, ((0, 0), (0, 1)), constant_values=np.inf)
    found = (costs < np.inf).any(axis=1)
    return np.asarray(np.where(found, padded.argmin(axis=1), costs.shape[1]), dtype=np.int64)


def _rank(costs: NDArray[np.float64], relevant: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Relevance of the retrieved items in their order."""
    order = np.lexsort((relevant, costs))
    return relevant[order][: int((costs < np.inf).sum())]


def _check_ranking(
    costs: ArrayLike, relevant: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    numbers, flags = np.asarray(costs, dtype=np.float64), np.asarray(relevant)
    if numbers.ndim != 1 or numbers.shape != flags.shape:
        raise InvalidInput(
            "a ranking needs costs and relevance of the same items, shape (items,), "
            f"got {numbers.shape} and {flags.shape}"
        )
    if flags.size and flags.dtype != np.bool_:
        raise InvalidInput(f"relevance must be bool, got {flags.dtype}")
    if np.isnan(numbers).any():
        raise InvalidInput("costs must be numbers, got NaN; infinite means not retrieved")
    return numbers, flags.astype(np.bool_)


def _check_costs(costs: ArrayLike, n_clips: int, n_classes: int) -> NDArray[np.float64]:
    matrix = np.asarray(costs, dtype=np.float64)
    if matrix.shape != (n_clips, n_classes):
        raise InvalidInput(
            f"costs need shape (clips, classes) = ({n_clips}, {n_classes}), got {matrix.shape}"
        )
    if np.isnan(matrix).any():
        raise InvalidInput("costs must be numbers, got NaN; infinite means not retrieved")
    return matrix


def _compute_class(
    pairs: Sequence[Sequence[list[LabelledSegment]]], ious: NDArray[np.float64]
) -> NDArray[np.float64]:
    n_true = sum(len(real) for _, real in pairs)
    if n_true == 0:
        return np.full(len(ious), np.nan)
    costs: list[float] = []
    right = [np.zeros((0, len(ious)), dtype=np.bool_)]
    for claimed, real in pairs:
        found = sorted(
            (segment for segment in claimed if segment.cost < np.inf),
            key=lambda segment: (segment.cost, segment.start, segment.end),
        )
        costs += [segment.cost for segment in found]
        right.append(_match(compute_iou(found, sorted(real)), ious))
    matched = np.concatenate(right)
    return np.array([_area(np.array(costs), column, n_true) for column in matched.T])


def _match(overlaps: NDArray[np.float64], ious: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether predictions, in their order, take a true segment, shape (predicted, ious)."""
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
