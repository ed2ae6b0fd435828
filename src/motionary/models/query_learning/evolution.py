"""Which query serves the examples best?

The genetic algorithm of Baak (2012), Algorithm 3. Where individuals come from and how they
breed are functions, so that random search, and the optimisation of gaps alone, are the same
loop. An individual is evaluated once; survivors keep their score.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.models.query_learning.clips import Clips
from motionary.models.query_learning.copies import Augmentation
from motionary.models.query_learning.fitness import Across, Fitness, Score
from motionary.models.query_learning.individuals import Individual
from motionary.models.query_learning.operators import (
    GenePool,
    initialise,
    mutate,
    recombine,
    shift_gap,
)
from motionary.models.query_learning.selection import sample_universally

Generator = np.random.Generator
Create = Callable[[Generator], Individual]
Breed = Callable[[Sequence[Individual], Generator], list[Individual]]


@dataclass(frozen=True, slots=True)
class GeneticSettings:
    """Settings of the evolution; numbers of Baak (2012), sections 4.2 and 4.4.

    What the thesis does not have makes queries hold for other people than those of the
    examples; `PUBLISHED` leaves it out.

    Attributes
    ----------
    population : individuals of a generation
    parents : individuals selected from it; any two of them have an offspring
    generations : of one run
    beta : weight of recall in the fitness
    across : recall is that of all positives ("pooled"), the mean over groups or the least
    parsimony : what each entry that is asked for costs in fitness
    simplify : whether the result loses all entries that it does not need, and its gaps
        become as wide as they may
    augmentation : varied copies of the examples that it is simplified on
    """

    population: int = 50
    parents: int = 5
    generations: int = 100
    beta: float = 2.0
    across: Across = "pooled"
    parsimony: float = 0.001
    simplify: bool = True
    augmentation: Augmentation = field(default_factory=Augmentation)

    def __post_init__(self) -> None:
        if self.population < 1 or self.generations < 1:
            raise InvalidInput(
                "breeding needs a population and generations of at least 1, "
                f"got {self.population} and {self.generations}"
            )
        if self.parents < 2:
            raise InvalidInput(f"breeding needs at least 2 parents, got {self.parents}")
        if not 0.0 < self.beta < np.inf or not 0.0 <= self.parsimony < np.inf:
            raise InvalidInput(
                "breeding needs a positive beta and a parsimony of at least 0, "
                f"got {self.beta} and {self.parsimony}"
            )
        if self.across not in ("pooled", "mean", "worst"):
            raise InvalidInput(f"across must be 'pooled', 'mean' or 'worst', got {self.across!r}")


#: The evolution as it is printed.
PUBLISHED = GeneticSettings(parsimony=0.0, simplify=False)


class Judge:
    """Scores of individuals on clips, each computed once."""

    def __init__(self, clips: Clips, fitness: Fitness) -> None:
        self.clips = clips
        self.fitness = fitness
        self._scores: dict[Individual, Score] = {}

    def __call__(self, individual: Individual) -> Score:
        """Fitness, precision and recall."""
        score = self._scores.get(individual)
        if score is None:
            score = self.fitness.score(self.clips.retrieved(individual))
            self._scores[individual] = score
        return score

    @property
    def n_evaluated(self) -> int:
        """Different individuals that were searched for."""
        return len(self._scores)


class Ways(NamedTuple):
    """Where individuals come from.

    Attributes
    ----------
    create : one of the first generation
    breed : offspring of selected parents
    """

    create: Create
    breed: Breed


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


def genetic(pool: GenePool) -> Ways:
    """The thesis: columns of the template, recombined and mutated."""
    return Ways(partial(initialise, pool), partial(_recombined, pool))


def random_creation(pool: GenePool) -> Ways:
    """As many individuals as the evolution makes, all of them from scratch."""
    return Ways(partial(initialise, pool), partial(_fresh, pool))


def gaps_alone(create: Create) -> Ways:
    """Keyframes stay what they are, gaps mutate."""
    return Ways(create, _with_other_gaps)


def evolve(
    ways: Ways,
    judge: Judge,
    *,
    settings: GeneticSettings,
    rng: Generator,
    verification: Judge | None = None,
) -> RunResult:
    """Fittest individual after all generations, and how the population got there."""
    offspring = [ways.create(rng) for _ in range(settings.population)]
    population: list[_Ranked] = []
    history, verified = [], []
    for generation in range(settings.generations):
        population += [_rank(one, judge, settings) for one in offspring]
        # Stable: of equals the older stays.
        population.sort(key=_by_rank)
        del population[settings.population :]
        history.append(_mean_and_spread([one.score for one in population]))
        if verification is not None:
            scores = [verification(one.individual) for one in population]
            verified.append(_mean_and_spread(scores))
        if generation < settings.generations - 1:
            weights = [one.rank for one in population]
            chosen = sample_universally(weights, settings.parents, rng)
            offspring = ways.breed([population[number].individual for number in chosen], rng)
    best = population[0]
    return RunResult(
        best.individual, best.score, np.array(history), np.array(verified).reshape(-1, 3, 2)
    )


class _Ranked(NamedTuple):
    rank: float
    individual: Individual
    score: Score


def _rank(individual: Individual, judge: Judge, settings: GeneticSettings) -> _Ranked:
    score = judge(individual)
    cost = settings.parsimony * individual.n_fixed if settings.parsimony else 0.0
    return _Ranked(max(0.0, score.fitness - cost), individual, score)


def _by_rank(one: _Ranked) -> float:
    return -one.rank


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
