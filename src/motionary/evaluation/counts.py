"""How many are right, and which rates follow?

Precision, recall and their harmonic mean (thesis, 2012, eqs 5.10-5.12) of counts that are
kept apart for the two tables, because a segment may overlap several.

Conventions for what is undefined:

- A rate 0/0 is 1 where both tables are empty (nothing was to be found and nothing was
  claimed: a perfect answer), and 0 where only one of them is.
- What can only be measured on something that is there (the distance of matched
  boundaries, the average precision of a class that does not occur, a number per minute of
  no time) is NaN, left out of means, and null in JSON.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Rates(NamedTuple):
    """Shares in [0, 1].

    Attributes
    ----------
    precision : of what was predicted, the share that is right
    recall : of what is true, the share that was found
    f : their harmonic mean
    """

    precision: float
    recall: float
    f: float


class Counts(NamedTuple):
    """What rates are made of.

    Attributes
    ----------
    correct : predictions that are right
    predicted : predictions
    found : true ones that were found
    true : true ones
    """

    correct: int
    predicted: int
    found: int
    true: int


class Confusion(NamedTuple):
    """What was taken for what.

    Attributes
    ----------
    names : classes
    matrix : shape (names + 1, names + 1), int; row true, column predicted; the last row
        and column stand for "no label"
    """

    names: tuple[str, ...]
    matrix: NDArray[np.int64]


def pool_counts(counts: Iterable[Counts]) -> Counts:
    """Sum of counts: of classes, or of documents as if they were one."""
    total = np.zeros(4, dtype=np.int64)
    for one in counts:
        total += np.array(one, dtype=np.int64)
    return Counts(*total.tolist())


def compute_rates(counts: Counts) -> Rates:
    """Precision, recall and F of counts."""
    empty = 1.0 if counts.predicted == counts.true == 0 else 0.0
    precision = counts.correct / counts.predicted if counts.predicted else empty
    recall = counts.found / counts.true if counts.true else empty
    return Rates(precision, recall, _harmonic_mean(precision, recall))


def _harmonic_mean(precision: float, recall: float) -> float:
    total = precision + recall
    return 2 * precision * recall / total if total else 0.0
