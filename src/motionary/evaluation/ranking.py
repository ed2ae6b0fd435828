"""How good is a ranked list, and a choice among classes?

Retrieval: every item of a collection has a cost and is relevant or not. Classification:
every clip has a cost for each class.

Conventions: small costs come first. An item of infinite cost is never retrieved: if it is
relevant, it counts as not found. Of items of equal cost the irrelevant come first, so
that a tie never flatters and the given order never matters. A query without any relevant
item has no average precision (NaN) and does not enter a mean.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.evaluation.counts import Confusion, Counts, Rates, compute_rates


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
    """Which class was chosen.

    Attributes
    ----------
    accuracy : share of clips that got their class; NaN without clips
    confusion : row true, column chosen; "no label" is a clip without any finite cost
    """

    accuracy: float
    confusion: Confusion


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
