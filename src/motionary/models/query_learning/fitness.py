"""How good is an individual?

The weighted F-measure of the clips that it retrieves (Baak 2012, eqs 4.9 to 4.11). With
groups, such as actors, the recall is that of the group that it serves worst, or the mean
over groups: what fails for one known actor will fail for an unknown one.

Conventions: nothing retrieved has precision 0, and so fitness 0.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Across = Literal["pooled", "mean", "worst"]


class Score(NamedTuple):
    """Measures of an individual, each in [0, 1]."""

    fitness: float
    precision: float
    recall: float


def weighted_f(precision: float, recall: float, *, beta: float) -> float:
    """F-measure in which recall weighs `beta` times as much as precision; 0 if both are 0."""
    weighted = beta * beta * precision + recall
    return (1.0 + beta * beta) * precision * recall / weighted if weighted > 0.0 else 0.0


@dataclass(frozen=True, slots=True)
class Fitness:
    """Fitness from retrieved clips, the positives before the negatives.

    Attributes
    ----------
    groups : array, shape (groups, positives), 0/1: members of each group; none if positives
        are pooled
    sizes : array, shape (groups,): number of members
    n_positives : clips that are to be retrieved
    beta : weight of recall
    worst : whether recall is the least over groups; otherwise the mean
    """

    groups: NDArray[np.float64]
    sizes: NDArray[np.float64]
    n_positives: int
    beta: float
    worst: bool

    def score(self, retrieved: NDArray[np.bool_]) -> Score:
        """Fitness, precision and recall of retrieved clips, shape (clips,)."""
        positives = retrieved[: self.n_positives]
        n_right = np.count_nonzero(positives)
        if n_right == 0:
            return Score(0.0, 0.0, 0.0)
        precision = float(n_right / np.count_nonzero(retrieved))
        recall = float(n_right / self.n_positives)
        if len(self.groups):
            recalls = self.groups @ positives / self.sizes
            recall = float(recalls.min() if self.worst else recalls.mean())
        return Score(weighted_f(precision, recall, beta=self.beta), precision, recall)


def fitness_of(groups: NDArray[np.intp], *, beta: float, across: Across = "pooled") -> Fitness:
    """Fitness over positives of some groups, to be followed by negatives.

    Parameters
    ----------
    groups : array, shape (positives,): number of the group of each
    beta : weight of recall
    across : whether recall is that of all positives, the mean over groups or the least
    """
    members = (groups == np.unique(groups)[:, None]).astype(np.float64)
    if across == "pooled":
        members = members[:0]
    return Fitness(members, members.sum(axis=1), len(groups), beta, across == "worst")
