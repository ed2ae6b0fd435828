"""Which individuals become parents?

Stochastic universal sampling after Baker (1987): one throw, equally spaced pointers; the
number of times an individual is chosen differs from its expectation by less than one.
"""

from collections.abc import Sequence

import numpy as np


def sample_universally(fitness: Sequence[float], count: int, rng: np.random.Generator) -> list[int]:
    """Numbers of `count` individuals, ascending, each as often as its share of the fitness.

    Parameters
    ----------
    fitness : at least 0; if all are 0, all have the same chance
    count : pointers
    rng : source of the one throw
    """
    fractions = np.asarray(fitness, dtype=np.float64)
    if fractions.sum() <= 0.0:
        fractions = np.ones(len(fractions))
    ends = np.cumsum(fractions)
    pointers = (np.arange(count) + rng.random()) * (ends[-1] / count)
    chosen = np.searchsorted(ends, pointers, side="right")
    # Rounding may put the last pointer on the end itself.
    last = int(np.flatnonzero(fractions)[-1])
    return [min(int(number), last) for number in chosen]
