"""Individuals of the genetic algorithm: made, recombined, mutated, simplified, added up.

An individual is a keyframe query in whole numbers (Baak 2012, section 4.1): template
columns, features as bits of a number, and the fewest and most frames between neighbours.
Individuals are hashable, so that what was evaluated once is not evaluated again.

Initialisation (Baak 2012, Algorithm 2), recombination and the three mutations
(section 4.4). Where the thesis is silent: gaps are centred on the distance of the columns;
keyframes carry their column and are sorted by it; a keyframe that is removed leaves the sum
of its two gaps, so that no hit is lost; one entry at a time becomes fixed or free.

Of two equally fit queries the more general one asks for less and leaves more time: entries
go one by one where the fitness allows it, gaps widen at both ends.

Runs of the algorithm differ; what their individuals share characterises the class (Baak
2012, section 4.4 and Fig. 4.2): keyframes are added up at their columns of the template.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.models.keyframes import Gap, KeyframeQuery
from motionary.models.templates import MotionTemplate, QuantisedTemplate
from motionary.packing import count_integers, from_numbers, pack, to_numbers, unpack

Floats = NDArray[np.float64]
Numbers = tuple[int, ...]
Keyframe = tuple[int, int, int]

#: Algorithm 2, line 1: mean and standard deviation of the number of keyframes.
_MEAN_KEYFRAMES, _SPREAD_KEYFRAMES = 3.0, 2.0
_FEWEST_KEYFRAMES = 2
#: Columns on either side in which keyframes of other runs are the same one.
_NEAR = 2
#: Frames by which a bound is moved, tried from the largest.
_STEPS = (8, 4, 2, 1)


class Individual(NamedTuple):
    """A candidate query.

    Attributes
    ----------
    positions : column of the template of each keyframe, ascending, from 0
    values, fixed : per keyframe, features that hold and that are asked for, as bits
    least, most : per gap, frames between neighbouring keyframes, both included
    """

    positions: Numbers
    values: Numbers
    fixed: Numbers
    least: Numbers
    most: Numbers

    @property
    def n_fixed(self) -> int:
        """Features asked for in all keyframes."""
        return sum(fixed.bit_count() for fixed in self.fixed)

    @property
    def slack(self) -> int:
        """Frames by which the gaps may vary, in all."""
        return sum(self.most) - sum(self.least)


class Score(NamedTuple):
    """Measures of an individual, each in [0, 1]."""

    fitness: float
    precision: float
    recall: float


def to_query(
    individual: Individual, feature_set: str, feature_ids: tuple[str, ...]
) -> KeyframeQuery:
    """The individual as a query over a set of features."""
    n_integers = count_integers(len(feature_ids))
    gaps = tuple(Gap(*gap) for gap in zip(individual.least, individual.most, strict=True))
    return KeyframeQuery(
        from_numbers(individual.values, n_integers), from_numbers(individual.fixed, n_integers),
        gaps, feature_set, feature_ids, individual.positions,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class GenePool:
    """Columns that keyframes come from.

    Attributes
    ----------
    values, fixed : per column of the quantised template, features as bits
    majority : per column, features that more examples show than not
    n_features : number of features
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


def free_entry(individual: Individual, k: int, bit: int) -> Individual:
    """Without one entry of keyframe k."""
    return individual._replace(
        values=put(individual.values, k, individual.values[k] & ~bit),
        fixed=put(individual.fixed, k, individual.fixed[k] & ~bit),
    )


def without_keyframe(individual: Individual, k: int) -> Individual:
    """The individual without keyframe k, whose two gaps become their sum."""
    least, most = (_without_gap(bounds, k) for bounds in (individual.least, individual.most))
    positions, values, fixed = ((*numbers[:k], *numbers[k + 1 :]) for numbers in individual[:3])
    return Individual(positions, values, fixed, least, most)


def bits(number: int) -> list[int]:
    """The set bits of a number, each as a number."""
    bits = []
    while number:
        bits.append(number & -number)
        number &= number - 1
    return bits


def put(numbers: Numbers, k: int, number: int) -> Numbers:
    """The numbers with another one at place k."""
    return (*numbers[:k], number, *numbers[k + 1 :])


def _without_gap(bounds: Numbers, k: int) -> Numbers:
    beside = bounds[max(k - 1, 0) : k + 1]
    between = (sum(beside),) if len(beside) == 2 and k > 0 else ()
    return (*bounds[: max(k - 1, 0)], *between, *bounds[k + 1 :])


def simplify(
    individual: Individual, evaluator: Callable[[Individual], Score], rng: np.random.Generator
) -> Individual:
    """The individual without entries and bounds that its fitness does not need.

    Which of several needless entries go first, `rng` decides.
    """
    aim = evaluator(individual).fitness
    entries = [(k, bit) for k, fixed in enumerate(individual.fixed) for bit in bits(fixed)]
    for number in rng.permutation(len(entries)):
        freed = free_entry(individual, *entries[number])
        if evaluator(freed).fitness >= aim:
            individual = freed
    for step in _STEPS:
        for gap in range(len(individual.least)):
            sooner = max(0, individual.least[gap] - step)
            wider = individual._replace(least=put(individual.least, gap, sooner))
            if evaluator(wider).fitness >= aim:
                individual = wider
            later = individual.most[gap] + step
            wider = individual._replace(most=put(individual.most, gap, later))
            if evaluator(wider).fitness >= aim:
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


class Accumulation(NamedTuple):
    """Keyframes of many runs, added up.

    Attributes
    ----------
    values : array, shape (columns, features): mean over the runs, 1 and 0 for entries that
        are asked for, 0.5 for those that are not; what Fig. 4.2 shows
    agreement : array, shape (columns,): fraction of the runs with a keyframe there,
        those beside it counting less
    """

    values: Floats
    agreement: Floats


def accumulate(individuals: Sequence[Individual], pool: GenePool) -> Accumulation:
    """Mean of the keyframes of individuals over the columns of their template."""
    votes, agreement = np.zeros((len(pool), pool.n_features)), np.zeros(len(pool))
    columns = np.arange(len(pool))[:, None]
    for individual in individuals:
        values, fixed = _bits(individual.values, pool), _bits(individual.fixed, pool)
        positions = list(individual.positions)
        np.add.at(votes, positions, fixed * (2.0 * values - 1.0))
        distance = np.abs(columns - positions).min(axis=1)
        agreement += np.maximum(0.0, 1.0 - distance / (_NEAR + 1))
    n = len(individuals)
    return Accumulation(0.5 + votes / (2.0 * n), agreement / n)


def frequent_keyframes(individuals: Sequence[Individual], pool: GenePool) -> list[Keyframe]:
    """Keyframes that most runs agree on, as many as a run has on average.

    They stand at local maxima of the agreement, and ask for what at least half of the
    keyframes there ask for.
    """
    agreed = accumulate(individuals, pool).agreement
    wanted = max(pool.fewest, round(np.mean([len(one.positions) for one in individuals])))
    padded = np.pad(agreed, 1)
    # Of a plateau the first column.
    peaks = np.flatnonzero((agreed > padded[:-2]) & (agreed >= padded[2:]))
    chosen = peaks[np.argsort(-agreed[peaks], kind="stable")][:wanted].tolist()
    return [_consensus(individuals, column, pool) for column in sorted(chosen)]


def _consensus(individuals: Sequence[Individual], column: int, pool: GenePool) -> Keyframe:
    """Entries that at least half of the keyframes near a column ask for."""
    near = [
        keyframe
        for individual in individuals
        for keyframe in _keyframes(individual)
        if abs(keyframe[0] - column) <= _NEAR
    ]
    values, fixed = (_bits([keyframe[i] for keyframe in near], pool) for i in (1, 2))
    ones, zeros = (fixed & values).sum(axis=0), (fixed & ~values).sum(axis=0)
    asked = (2 * np.maximum(ones, zeros) >= len(near)) & (ones != zeros)
    value, mask = to_numbers(pack([asked & (ones > zeros), asked]))
    return column, value, mask


def _bits(numbers: Sequence[int], pool: GenePool) -> NDArray[np.bool_]:
    """The bits of numbers, shape (numbers, features)."""
    return unpack(from_numbers(numbers, count_integers(pool.n_features)), pool.n_features)
