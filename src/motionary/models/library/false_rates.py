"""Expected false labels a minute as a function of the threshold.

Scores of the labels in recordings without the classes, all classes competing, fall off
exponentially: the rate of scores above s is exp(level - slope (s - `TAIL`)). Each class has
its level, drawn towards the common one; the slope is common.

Conventions: rates a minute; scores above `TAIL` are fitted.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput

Floats = NDArray[np.float64]

#: Scores from here on are fitted.
TAIL = 5.0
# A class counts the common rate as so many labels.
_DRAWN = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class FalseRates:
    """False labels a minute.

    Attributes
    ----------
    levels : array, shape (classes,): logarithm of each class's rate at the score `TAIL`
    slope : how fast all rates fall, a unit of score
    """

    levels: Floats
    slope: float

    def of_class(self, index: int, score: float) -> float:
        """False labels a minute of one class, of this score or a higher one."""
        return float(np.exp(self.levels[index] - self.slope * (score - TAIL)))

    def expected(self, threshold: float) -> float:
        """False labels a minute of all classes at one threshold."""
        return float(np.exp(self.levels - self.slope * (threshold - TAIL)).sum())

    def threshold(self, at_most: float) -> float:
        """The threshold at which so many false labels a minute are expected.

        Raises
        ------
        InvalidInput
            If `at_most` is not a number above 0.
        """
        if not (np.isfinite(at_most) and at_most > 0):
            raise InvalidInput(f"false labels a minute must be above 0, got {at_most}")
        return TAIL + float(np.log(np.exp(self.levels).sum() / at_most)) / self.slope


def fit_false_rates(scores: Sequence[ArrayLike], minutes: float) -> FalseRates:
    """Rates from the scores of false labels, by class.

    Parameters
    ----------
    scores : one array a class: its labels in recordings that do not show it
    minutes : length of those recordings

    Raises
    ------
    InvalidInput
        If there is no class, or nothing was labelled.
    """
    if not scores or not minutes > 0:
        raise InvalidInput(
            "rates of false labels need a class and recordings without it, got "
            f"{len(scores)} classes and {minutes} minutes"
        )
    above = [np.asarray(s, dtype=np.float64) for s in scores]
    above = [s[s > TAIL] for s in above]
    counts = np.array([len(s) for s in above], dtype=np.float64)
    excess = sum(float((s - TAIL).sum()) for s in above)
    # Maximum likelihood of an exponential tail; one label at the mean of 1 keeps it finite.
    slope = (counts.sum() + 1.0) / (excess + 1.0)
    common = (counts.sum() + 0.5) / (minutes * len(scores))
    rates = (counts + _DRAWN) / (minutes + _DRAWN / common)
    return FalseRates(np.log(rates), float(slope))
