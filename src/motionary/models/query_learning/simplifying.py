"""Which of two equally fit queries is the more general?

The one that asks for less and leaves more time. An evolved query is made so: entries go
one by one where the fitness allows it, gaps grow at both ends.
"""

import numpy as np

from motionary.models.query_learning.evolution import Judge
from motionary.models.query_learning.individuals import (
    Individual,
    bits,
    free_entry,
    put,
    without_keyframe,
)

#: Frames by which a bound is moved, tried from the largest.
_STEPS = (8, 4, 2, 1)


def simplify(individual: Individual, judge: Judge, rng: np.random.Generator) -> Individual:
    """The individual without entries and bounds that its fitness does not need.

    Parameters
    ----------
    individual : what evolved
    judge : its examples
    rng : decides which of several needless entries go first
    """
    aim = judge(individual).fitness
    entries = [(k, bit) for k, fixed in enumerate(individual.fixed) for bit in bits(fixed)]
    for number in rng.permutation(len(entries)):
        freed = free_entry(individual, *entries[number])
        if judge(freed).fitness >= aim:
            individual = freed
    for step in _STEPS:
        for gap in range(len(individual.least)):
            for widen in (_sooner, _later):
                wider = widen(individual, gap, step)
                if judge(wider).fitness >= aim:
                    individual = wider
    return without_free_keyframes(individual)


def without_free_keyframes(individual: Individual) -> Individual:
    """The individual without keyframes that ask for nothing, which retrieves the same clips.

    At an end, one whose distance has a lower bound stays: it asks that the clip goes on.
    """
    k = 0
    while k < len(individual.positions) > 1:
        inner = 0 < k < len(individual.positions) - 1
        beside = individual.least[max(k - 1, 0)]
        if individual.fixed[k] == 0 and (inner or beside == 0):
            individual, k = without_keyframe(individual, k), 0
        else:
            k += 1
    return individual


def _sooner(individual: Individual, gap: int, step: int) -> Individual:
    least = max(0, individual.least[gap] - step)
    return individual._replace(least=put(individual.least, gap, least))


def _later(individual: Individual, gap: int, step: int) -> Individual:
    return individual._replace(most=put(individual.most, gap, individual.most[gap] + step))
