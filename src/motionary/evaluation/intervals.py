"""How far may a mean be trusted that was measured on a few people?

Values of one actor resemble each other, so it is actors that are drawn, not values: a
cluster bootstrap with percentile limits (Efron and Tibshirani, An introduction to the
bootstrap, 1993, chapters 8 and 13).

Conventions: every value weighs the same, so an actor with more values weighs more. With
few groups (five actors) such an interval is too narrow rather than too wide.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput

RESAMPLES = 10_000


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
        Share of resampled means between the limits, in (0, 1).

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
