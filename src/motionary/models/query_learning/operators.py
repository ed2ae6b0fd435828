"""How do individuals come about, and from each other?

Initialisation (Baak 2012, Algorithm 2), recombination and the three mutations
(section 4.4). Where the thesis is silent: gaps are centred on the distance of the columns;
keyframes carry their column and are sorted by it; a keyframe that is removed leaves the sum
of its two gaps, so that no hit is lost; one entry at a time becomes fixed or free.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from motionary.models.query_learning.individuals import (
    Individual,
    Numbers,
    bits,
    free_entry,
    put,
    to_numbers,
    without_keyframe,
)
from motionary.models.templates import MotionTemplate, QuantisedTemplate
from motionary.packing import pack

#: Algorithm 2, line 1: mean and standard deviation of the number of keyframes.
_MEAN_KEYFRAMES, _SPREAD_KEYFRAMES = 3.0, 2.0
_FEWEST_KEYFRAMES = 2

Keyframe = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class GenePool:
    """Columns that keyframes come from.

    Attributes
    ----------
    values, fixed : per column of the quantised template, relations as bits
    majority : per column, relations that more examples show than not
    n_features : number of relations
    """

    values: Numbers
    fixed: Numbers
    majority: Numbers
    n_features: int

    def __len__(self) -> int:
        return len(self.values)

    @property
    def fewest(self) -> int:
        """Fewest keyframes of an individual: two, if there are two columns."""
        return min(_FEWEST_KEYFRAMES, len(self.values))


def gene_pool(template: MotionTemplate, quantised: QuantisedTemplate) -> GenePool:
    """Columns of a template, as it is and quantised."""
    return GenePool(
        to_numbers(quantised.packed_values),
        to_numbers(quantised.packed_fixed),
        to_numbers(pack(template.values >= 0.5)),
        template.n_features,
    )


def initialise(pool: GenePool, rng: np.random.Generator) -> Individual:
    """A random individual (Algorithm 2)."""
    wanted = round(rng.normal(_MEAN_KEYFRAMES, _SPREAD_KEYFRAMES))
    count = min(max(pool.fewest, wanted), len(pool))
    columns = sorted(rng.choice(len(pool), size=count, replace=False).tolist())
    return assemble([_column(pool, column) for column in columns], rng)


def recombine(
    first: Individual, second: Individual, pool: GenePool, rng: np.random.Generator
) -> Individual:
    """Some keyframes of each parent in the order of their columns, with new gaps."""
    chosen = {*_some(first, rng), *_some(second, rng)}
    everything = [*_keyframes(first), *_keyframes(second)]
    while len(chosen) < pool.fewest and len(set(everything)) > len(chosen):
        chosen.add(everything[_below(len(everything), rng)])
    return assemble(sorted(chosen), rng)


def mutate(individual: Individual, pool: GenePool, rng: np.random.Generator) -> Individual:
    """The individual after one random mutation."""
    kind = _below(3, rng)
    forward = rng.random() < 0.5
    if kind == 0:
        full = len(individual.positions) >= len(pool)
        few = len(individual.positions) <= pool.fewest
        if full and few:
            return individual
        add = few or (forward and not full)
        return add_keyframe(individual, pool, rng) if add else remove_keyframe(individual, rng)
    if kind == 1:
        return specialise(individual, pool, rng) if forward else generalise(individual, rng)
    return shift_gap(individual, rng)


def add_keyframe(individual: Individual, pool: GenePool, rng: np.random.Generator) -> Individual:
    """With a column that it did not have; the gaps beside it are drawn anew."""
    free = sorted(set(range(len(pool))) - set(individual.positions))
    if not free:
        return individual
    column = free[_below(len(free), rng)]
    keyframes = _keyframes(individual)
    at = sum(position < column for position in individual.positions)
    keyframes.insert(at, _column(pool, column))
    gaps = list(zip(individual.least, individual.most, strict=True))
    near = [
        draw_gap(keyframes[k][0], keyframes[k + 1][0], rng)
        for k in (at - 1, at)
        if 0 <= k < len(keyframes) - 1
    ]
    gaps[max(at - 1, 0) : at] = near
    return _join(keyframes, gaps)


def remove_keyframe(individual: Individual, rng: np.random.Generator) -> Individual:
    """Without one of its keyframes, whose two gaps become their sum."""
    return without_keyframe(individual, _below(len(individual.positions), rng))


def specialise(individual: Individual, pool: GenePool, rng: np.random.Generator) -> Individual:
    """With one more entry asked for, as most of the examples show it there."""
    k = _below(len(individual.positions), rng)
    free = bits(~individual.fixed[k] & ((1 << pool.n_features) - 1))
    if not free:
        return individual
    bit = free[_below(len(free), rng)]
    value = individual.values[k] | (bit & pool.majority[individual.positions[k]])
    return individual._replace(
        values=put(individual.values, k, value),
        fixed=put(individual.fixed, k, individual.fixed[k] | bit),
    )


def generalise(individual: Individual, rng: np.random.Generator) -> Individual:
    """With one entry less asked for."""
    k = _below(len(individual.positions), rng)
    fixed = bits(individual.fixed[k])
    if not fixed:
        return individual
    return free_entry(individual, k, fixed[_below(len(fixed), rng)])


def shift_gap(individual: Individual, rng: np.random.Generator) -> Individual:
    """With both bounds of one gap moved by up to half of its width, a frame at least."""
    if not individual.least:
        return individual
    k = _below(len(individual.least), rng)
    bounds = individual.least[k], individual.most[k]
    reach = max(2, bounds[1] - bounds[0]) / 2.0
    moved = [bound + round(reach * (2.0 * rng.random() - 1.0)) for bound in bounds]
    least = max(0, moved[0])
    return individual._replace(
        least=put(individual.least, k, least),
        most=put(individual.most, k, max(least, moved[1])),
    )


def _column(pool: GenePool, column: int) -> Keyframe:
    return column, pool.values[column], pool.fixed[column]


def _keyframes(individual: Individual) -> list[Keyframe]:
    return list(zip(individual.positions, individual.values, individual.fixed, strict=True))


def _some(individual: Individual, rng: np.random.Generator) -> list[Keyframe]:
    """A random number of the keyframes, at least one."""
    keyframes = _keyframes(individual)
    count = 1 + _below(len(keyframes), rng)
    return [keyframes.pop(_below(len(keyframes), rng)) for _ in range(count)]


def assemble(keyframes: list[Keyframe], rng: np.random.Generator) -> Individual:
    """Individual of keyframes, in the order of their columns, with random gaps."""
    return _join(keyframes, [draw_gap(a[0], b[0], rng) for a, b in itertools.pairwise(keyframes)])


def _join(keyframes: list[Keyframe], gaps: list[tuple[int, int]]) -> Individual:
    positions, values, fixed = zip(*keyframes, strict=True)
    least, most = zip(*gaps, strict=True) if gaps else ((), ())
    return Individual(positions, values, fixed, least, most)


def draw_gap(before: int, after: int, rng: np.random.Generator) -> tuple[int, int]:
    """Random gap between two columns (Algorithm 2, lines 8 to 10), centred on their distance."""
    distance = after - before
    below, above = (round(distance * rng.random()) for _ in range(2))
    return max(0, distance - below), distance + above


def _below(count: int, rng: np.random.Generator) -> int:
    """A whole number from 0, below `count`; faster than `rng.integers` for a single one."""
    return int(rng.random() * count)
