"""Generations of the genetic algorithm of Baak (2012), Algorithm 3.

Where individuals come from and how they reproduce are functions, so that random search, and
the optimisation of gaps alone, are the same loop. An individual is evaluated once; survivors
keep their score. Parents are chosen by stochastic universal sampling after Baker (1987): one
throw, equally spaced pointers; the number of times an individual is chosen differs from its
expectation by less than one.

Of two equally fit queries the more general one asks for less and leaves more time. The
result is made so, if wanted: entries go one by one where the fitness allows it, gaps widen at
both ends.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.models.query_learning.fitness import Augmentation, Evaluator, Score
from motionary.models.query_learning.individuals import (
    GenePool,
    Individual,
    bits,
    free_entry,
    initialise,
    mutate,
    put,
    recombine,
    shift_gap,
    without_keyframe,
)

Generator = np.random.Generator
Create = Callable[[Generator], Individual]
Reproduce = Callable[[Sequence[Individual], Generator], list[Individual]]

#: Frames by which a bound is moved, tried from the largest.
_STEPS = (8, 4, 2, 1)


@dataclass(frozen=True, slots=True)
class GeneticSettings:
    """Settings of the genetic algorithm; numbers of Baak (2012), sections 4.2 and 4.4.

    What the thesis does not have makes queries hold for other people than those of the
    examples; `PUBLISHED` leaves it out.

    Attributes
    ----------
    population : individuals of a generation
    parents : individuals selected from it; any two of them have an offspring
    generations : of one run
    beta : weight of recall in the fitness
    parsimony : what each entry that is asked for costs in fitness
    simplify : whether the result loses all entries that it does not need, and its gaps
        become as wide as they may
    augmentation : varied copies of the examples that it is simplified on
    """

    population: int = 50
    parents: int = 5
    generations: int = 100
    beta: float = 2.0
    parsimony: float = 0.001
    simplify: bool = True
    augmentation: Augmentation = field(default_factory=Augmentation)

    def __post_init__(self) -> None:
        if self.population < 1 or self.generations < 1:
            raise InvalidInput(
                "the genetic algorithm needs a population and generations of at least 1, "
                f"got {self.population} and {self.generations}"
            )
        if self.parents < 2:
            raise InvalidInput(
                f"the genetic algorithm needs at least 2 parents, got {self.parents}"
            )
        if not 0.0 < self.beta < np.inf or not 0.0 <= self.parsimony < np.inf:
            raise InvalidInput(
                "the genetic algorithm needs a positive beta and a parsimony of at least 0, "
                f"got {self.beta} and {self.parsimony}"
            )


#: The genetic algorithm as it is printed.
PUBLISHED = GeneticSettings(parsimony=0.0, simplify=False)


class Reproduction(NamedTuple):
    """Where individuals of the first generation and offspring of selected parents come from."""

    create: Create
    reproduce: Reproduce


class RunResult(NamedTuple):
    """Result of one run.

    Attributes
    ----------
    best : the fittest individual
    score : its score on the examples
    history : array, shape (generations, 3, 2): mean and standard deviation over the
        population of fitness, precision and recall on the examples
    verified : the same on the clips for verification; no rows without them
    """

    best: Individual
    score: Score
    history: NDArray[np.float64]
    verified: NDArray[np.float64]


def genetic(pool: GenePool) -> Reproduction:
    """Columns of the template, recombined and mutated, as in the thesis."""
    return Reproduction(partial(initialise, pool), partial(_recombined, pool))


def random_creation(pool: GenePool) -> Reproduction:
    """As many individuals as `genetic` makes, all of them from scratch."""
    return Reproduction(partial(initialise, pool), partial(_fresh, pool))


def gaps_alone(create: Create) -> Reproduction:
    """The same keyframes in all individuals, whose gaps mutate."""
    return Reproduction(create, _with_other_gaps)


def run_generations(
    reproduction: Reproduction,
    evaluator: Evaluator,
    *,
    settings: GeneticSettings,
    rng: Generator,
    verification: Evaluator | None = None,
) -> RunResult:
    """Fittest individual after all generations, and how the population got there."""
    offspring = [reproduction.create(rng) for _ in range(settings.population)]
    population: list[_Ranked] = []
    history, verified = [], []
    for generation in range(settings.generations):
        population += [_rank(one, evaluator, settings) for one in offspring]
        # Stable: of equals the older stays.
        population.sort(key=lambda one: -one.rank)
        del population[settings.population :]
        history.append(_mean_and_spread([one.score for one in population]))
        if verification is not None:
            scores = [verification(one.individual) for one in population]
            verified.append(_mean_and_spread(scores))
        if generation < settings.generations - 1:
            weights = [one.rank for one in population]
            chosen = sample_universally(weights, settings.parents, rng)
            parents = [population[number].individual for number in chosen]
            offspring = reproduction.reproduce(parents, rng)
    best = population[0]
    return RunResult(
        best.individual, best.score, np.array(history), np.array(verified).reshape(-1, 3, 2)
    )


class _Ranked(NamedTuple):
    rank: float
    individual: Individual
    score: Score


def _rank(individual: Individual, evaluator: Evaluator, settings: GeneticSettings) -> _Ranked:
    score = evaluator(individual)
    cost = settings.parsimony * individual.n_fixed if settings.parsimony else 0.0
    return _Ranked(max(0.0, score.fitness - cost), individual, score)


def _recombined(pool: GenePool, parents: Sequence[Individual], rng: Generator) -> list[Individual]:
    """Mutated offspring of any two parents."""
    return [
        mutate(recombine(first, second, pool, rng), pool, rng)
        for number, first in enumerate(parents)
        for second in parents[number + 1 :]
    ]


def _fresh(pool: GenePool, parents: Sequence[Individual], rng: Generator) -> list[Individual]:
    return [initialise(pool, rng) for _ in range(_count_pairs(parents))]


def _with_other_gaps(parents: Sequence[Individual], rng: Generator) -> list[Individual]:
    return [shift_gap(parents[n % len(parents)], rng) for n in range(_count_pairs(parents))]


def _count_pairs(parents: Sequence[Individual]) -> int:
    return len(parents) * (len(parents) - 1) // 2


def _mean_and_spread(scores: Sequence[Score]) -> NDArray[np.float64]:
    table = np.array(scores)
    return np.stack([table.mean(axis=0), table.std(axis=0)], axis=1)


def sample_universally(fitness: Sequence[float], count: int, rng: Generator) -> list[int]:
    """Numbers of `count` individuals, ascending, each as often as its part of the fitness.

    Where all fitness is 0, all have the same chance; `rng` makes the one throw.
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


def simplify(individual: Individual, evaluator: Evaluator, rng: Generator) -> Individual:
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
