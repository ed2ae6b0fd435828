"""Which keyframes do many runs agree on?

Runs differ; what they share characterises the class (Baak 2012, section 4.4 and Fig. 4.2).
Keyframes are added up at their columns of the template, and those that stand out become one
query, whose gaps are then bred anew.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.models.query_learning.individuals import Individual
from motionary.models.query_learning.operators import GenePool, Keyframe

Floats = NDArray[np.float64]

#: Columns on either side in which keyframes of other runs are the same one.
_NEAR = 2


class Accumulation(NamedTuple):
    """Keyframes of many runs, added up.

    Attributes
    ----------
    values : array, shape (columns, features): mean over the runs, 1 and 0 for entries that
        are asked for, 0.5 for those that are not; what Fig. 4.2 shows
    agreement : array, shape (columns,): share of the runs with a keyframe there,
        those beside it counting less
    """

    values: Floats
    agreement: Floats


def accumulate(individuals: Sequence[Individual], pool: GenePool) -> Accumulation:
    """Mean of the keyframes of individuals over the columns of their template."""
    ones, zeros = _count_entries(individuals, pool)
    values = 0.5 + (ones - zeros) / (2.0 * len(individuals))
    agreement = np.zeros(len(pool))
    for individual in individuals:
        agreement += _closeness(individual, len(pool))
    return Accumulation(values, agreement / len(individuals))


def frequent_keyframes(individuals: Sequence[Individual], pool: GenePool) -> list[Keyframe]:
    """Keyframes that most runs agree on, as many as a run has on average.

    They stand at local maxima of the agreement, and ask for what at least half of the
    keyframes there ask for.
    """
    agreement = accumulate(individuals, pool).agreement
    wanted = max(pool.fewest, round(np.mean([len(one.positions) for one in individuals])))
    padded = np.pad(agreement, 1)
    # Of a plateau the first column.
    is_peak = (agreement > padded[:-2]) & (agreement >= padded[2:])
    peaks = np.flatnonzero(is_peak)
    chosen = peaks[np.argsort(-agreement[peaks], kind="stable")][:wanted].tolist()
    return [_consensus(individuals, column) for column in sorted(chosen)]


def _count_entries(individuals: Sequence[Individual], pool: GenePool) -> tuple[Floats, Floats]:
    ones = np.zeros((len(pool), pool.n_features))
    zeros = np.zeros_like(ones)
    for individual in individuals:
        for column, value, fixed in zip(*individual[:3], strict=True):
            ones[column] += _unpack(value & fixed, pool.n_features)
            zeros[column] += _unpack(fixed & ~value, pool.n_features)
    return ones, zeros


def _closeness(individual: Individual, n_columns: int) -> Floats:
    """How near each column is to a keyframe, from 0 to 1."""
    columns = np.arange(n_columns)[:, None]
    distance = np.abs(columns - np.array(individual.positions)).min(axis=1)
    closeness: Floats = np.maximum(0.0, 1.0 - distance / (_NEAR + 1))
    return closeness


def _consensus(individuals: Sequence[Individual], column: int) -> Keyframe:
    """What at least half of the keyframes near a column ask for."""
    near = [
        (value, fixed)
        for individual in individuals
        for position, value, fixed in zip(*individual[:3], strict=True)
        if abs(position - column) <= _NEAR
    ]
    n_bits = max(fixed.bit_length() for _, fixed in near)
    value_of, fixed_of = 0, 0
    for bit in (1 << i for i in range(n_bits)):
        ones = sum(bool(value & fixed & bit) for value, fixed in near)
        zeros = sum(bool(fixed & ~value & bit) for value, fixed in near)
        if 2 * max(ones, zeros) >= len(near) and ones != zeros:
            fixed_of |= bit
            value_of |= bit if ones > zeros else 0
    return column, value_of, fixed_of


def _unpack(number: int, n_features: int) -> Floats:
    return np.array([number >> i & 1 for i in range(n_features)], dtype=np.float64)
