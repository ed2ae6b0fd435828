"""Queries of a class, learned by the genetic algorithm from examples and counter-examples.

Many runs of the algorithm, each from a seed of its own, so that any of them can be
computed alone: in whatever process, before or after a break. Their queries vote; the
keyframes on which they agree make one query besides.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from motionary.batch import Failure, map_ordered
from motionary.errors import InvalidInput
from motionary.features import FeatureSequence, FeatureSet
from motionary.models.keyframes import (
    HitRanges,
    KeyframeQuery,
    PostingIndex,
    check_votes,
    index_packed,
    search_query,
    select_in_index,
)
from motionary.models.query_learning import RUNS
from motionary.models.query_learning.generations import (
    Clips,
    Evaluator,
    Fitness,
    GeneticSettings,
    RunResult,
    augment_clip,
    gaps_alone,
    genetic,
    random_creation,
    run_generations,
)
from motionary.models.query_learning.individuals import (
    Accumulation,
    GenePool,
    accumulate,
    assemble,
    frequent_keyframes,
    gene_pool,
    simplify,
    to_query,
)
from motionary.models.templates import MotionTemplate, quantise, template_of

#: Fraction of the queries that must agree.
AGREEMENT = 0.6
#: Turns of each process, so that none waits long for another, and progress is seen.
_TURNS = 4
#: Seed of the optimisation of gaps, apart from those of the runs.
_GAPS = 1 << 31


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Examples that a query is to tell apart, and the settings of the search.

    Attributes
    ----------
    positives, negatives : clips that show the class, and that do not
    pool : columns of the strict template of the positives
    settings : of the genetic algorithm
    seed : of all runs
    """

    positives: tuple[FeatureSequence, ...]
    negatives: tuple[FeatureSequence, ...]
    pool: GenePool
    settings: GeneticSettings
    seed: int

    @property
    def feature_set(self) -> FeatureSet:
        """The set of the features."""
        return self.positives[0].feature_set

    def rng(self, number: int) -> np.random.Generator:
        """Source of all chance in one run: child `number` of the seed."""
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(number,)))

    def evaluator(self) -> Evaluator:
        """Scores on the examples."""
        return clip_evaluator(self.positives, self.negatives, settings=self.settings)

    def augmented_evaluator(self, rng: np.random.Generator) -> Evaluator:
        """Scores on the examples and varied copies of the negatives."""
        augmentation = self.settings.augmentation
        negatives = [*self.negatives]
        for _ in range(augmentation.negative_copies):
            negatives += [augment_clip(clip, augmentation, rng) for clip in self.negatives]
        return clip_evaluator(self.positives, negatives, settings=self.settings)


def clip_evaluator(
    positives: Sequence[FeatureSequence],
    negatives: Sequence[FeatureSequence],
    *,
    settings: GeneticSettings,
) -> Evaluator:
    """Scores on clips."""
    clips = [*positives, *negatives]
    feature_set = positives[0].feature_set
    every = all(bool(clip.known_features.all()) for clip in clips)
    index = index_packed(
        [clip.packed for clip in clips],
        None if every else [clip.known for clip in clips],
        feature_set=feature_set.name,
        feature_ids=feature_set.ids,
    )
    return Evaluator(Clips(index), Fitness(len(positives), settings.beta))


@dataclass(frozen=True, slots=True, eq=False)
class LearnedQueries:
    """Results of many runs, whose queries vote.

    Attributes
    ----------
    problem : examples and settings
    runs : result of each, by number
    votes : queries that must agree
    """

    problem: Problem
    runs: tuple[RunResult, ...]
    votes: int

    def __post_init__(self) -> None:
        check_votes(self.votes, n_queries=len(self.runs))

    @property
    def queries(self) -> tuple[KeyframeQuery, ...]:
        """The query of each run."""
        features = self.problem.feature_set
        return tuple(to_query(run.best, features.name, features.ids) for run in self.runs)

    @property
    def accumulation(self) -> Accumulation:
        """All keyframes added up (Baak 2012, Fig. 4.2)."""
        return accumulate([run.best for run in self.runs], self.problem.pool)

    def search(self, index: PostingIndex) -> HitRanges:
        """Windows in which the class may lie: hits with what the template has around them."""
        return select_in_index(self.queries, len(self.problem.pool), index, votes=self.votes)

    def sequences(self, index: PostingIndex) -> NDArray[np.int64]:
        """Sequences in which enough queries have a hit, ascending."""
        hits = np.zeros(index.n_sequences, dtype=np.int64)
        for query in self.queries:
            hits[search_query(query, index).hit_sequences] += 1
        return np.flatnonzero(hits >= self.votes)


def learn_query(
    positives: Sequence[FeatureSequence],
    negatives: Sequence[FeatureSequence],
    *,
    settings: GeneticSettings | None = None,
    seed: int = 0,
    template: MotionTemplate | None = None,
    runs: int = RUNS,
    jobs: int = 1,
    on_done: Callable[[int], None] | None = None,
) -> LearnedQueries:
    """Queries that find clips of one class and no others.

    Parameters
    ----------
    positives, negatives : clips of the class, at least two, and of others
    settings : of the genetic algorithm; the default ones if left out
    seed : same seed, same result
    template : of the positives, if it is known already; learned otherwise
    runs : of the genetic algorithm; each gives a query
    jobs : processes; the result does not depend on it
    on_done : called with the number of each run that is done

    Raises
    ------
    InvalidInput
        If there are too few examples, they do not fit together, or the positives have no
        feature in common.
    """
    if runs < 1:
        raise InvalidInput(f"learning needs at least 1 run, got {runs}")
    problem = state_problem(positives, negatives, settings=settings, seed=seed, template=template)
    done = tuple(learn_runs(problem, range(runs), jobs=jobs, on_done=on_done))
    return LearnedQueries(problem, done, votes=default_votes(runs))


def continue_learning(
    learned: LearnedQueries,
    *,
    runs: int,
    jobs: int = 1,
    on_done: Callable[[int], None] | None = None,
) -> LearnedQueries:
    """The same after more runs, equal to all of them at once."""
    numbers = range(len(learned.runs), max(runs, len(learned.runs)))
    done = learned.runs + tuple(learn_runs(learned.problem, numbers, jobs=jobs, on_done=on_done))
    return replace(learned, runs=done, votes=default_votes(len(done)))


def default_votes(n_queries: int) -> int:
    """Queries that must agree by default."""
    return max(1, round(AGREEMENT * n_queries))


def state_problem(
    positives: Sequence[FeatureSequence],
    negatives: Sequence[FeatureSequence],
    *,
    settings: GeneticSettings | None = None,
    seed: int = 0,
    template: MotionTemplate | None = None,
) -> Problem:
    """Checked examples with the columns that queries are made of, as for `learn_query`."""
    _check_examples(positives, negatives)
    template = template or template_of(positives)
    strict = quantise(template, tolerance=0.0)
    if strict.n_fixed == 0:
        raise InvalidInput(
            "the positives have no feature in common at any moment, so that no individual "
            "can be made; split the class, or leave out examples that do not belong"
        )
    pool, settings = gene_pool(template, strict), settings or GeneticSettings()
    return Problem(tuple(positives), tuple(negatives), pool, settings, seed)


def learn_runs(
    problem: Problem,
    numbers: Iterable[int],
    *,
    jobs: int = 1,
    random_search: bool = False,
    verification: Evaluator | None = None,
    on_done: Callable[[int], None] | None = None,
) -> Iterator[RunResult]:
    """Results of the runs of these numbers, in their order.

    Each depends on the problem and its number only: what is there already need not be
    computed again.

    Parameters
    ----------
    random_search : random search with as many individuals in place of the genetic algorithm
    verification : evaluator whose scores are to be recorded beside
    """
    run = partial(_runs, problem=problem, random_search=random_search, verification=verification)
    wanted = list(numbers)
    for number, result in zip(wanted, _in_order(run, wanted, jobs), strict=True):
        if on_done:
            on_done(number)
        yield result


def combine_runs(learned: LearnedQueries) -> RunResult:
    """One query of the keyframes that most runs agree on, its gaps by mutation alone."""
    problem = learned.problem
    keyframes = frequent_keyframes([run.best for run in learned.runs], problem.pool)
    rng = problem.rng(_GAPS)
    reproduction = gaps_alone(partial(assemble, keyframes))
    return run_generations(reproduction, problem.evaluator(), settings=problem.settings, rng=rng)


def _in_order(
    run: Callable[[Sequence[int]], Iterator[RunResult]], numbers: Sequence[int], jobs: int
) -> Iterator[RunResult]:
    """Results of all runs, several to a process at a time: they share what is costly."""
    if jobs == 1:
        yield from run(numbers)
        return
    size = max(1, len(numbers) // (jobs * _TURNS))
    several = [numbers[first : first + size] for first in range(0, len(numbers), size)]
    for results in map_ordered(partial(_listed, run), several, jobs=jobs):
        if isinstance(results, Failure):
            raise results.error
        yield from results


def _listed(
    run: Callable[[Sequence[int]], Iterator[RunResult]], numbers: Sequence[int]
) -> list[RunResult]:
    return list(run(numbers))


def _runs(
    numbers: Sequence[int], *, problem: Problem, random_search: bool, verification: Evaluator | None
) -> Iterator[RunResult]:
    """Runs one after the other; only bitmaps of clips pass from one to the next."""
    shared = problem.evaluator()
    reproduction = random_creation(problem.pool) if random_search else genetic(problem.pool)
    for number in numbers:
        rng = problem.rng(number)
        evaluator = Evaluator(shared.clips, shared.fitness)
        run = run_generations(
            reproduction, evaluator,
            settings=problem.settings, rng=rng, verification=verification,
        )  # fmt: skip
        if problem.settings.simplify:
            best = simplify(run.best, problem.augmented_evaluator(rng), rng)
            run = run._replace(best=best, score=evaluator(best))
        yield run


def _check_examples(
    positives: Sequence[FeatureSequence], negatives: Sequence[FeatureSequence]
) -> None:
    if len(positives) < 2:
        raise InvalidInput(
            f"learning a query needs at least 2 positives, got {len(positives)}; a single one "
            "does not tell what may vary"
        )
    if len(negatives) == 0:
        raise InvalidInput(
            "learning a query needs negatives, got none; give clips of other classes, or "
            "anything would do"
        )
    for kind, clips in (("positive", positives), ("negative", negatives)):
        for number, clip in enumerate(clips):
            if clip.feature_set != positives[0].feature_set:
                raise InvalidInput(
                    f"{kind} {number} is over features {clip.feature_set.name!r}, the first "
                    f"positive over {positives[0].feature_set.name!r}; use one set for all"
                )
            if kind == "positive" and len(clip) < 2:
                raise InvalidInput(
                    f"positive {number} ({clip.source or 'unnamed'}) has {len(clip)} frames, "
                    "shorter than any query; a clip needs at least 2 frames of 30 Hz"
                )
