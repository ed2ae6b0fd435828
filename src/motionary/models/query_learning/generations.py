"""Generations of the genetic algorithm of Baak (2012), Algorithm 3, and their fitness.

Where individuals come from and how they reproduce are functions, so that random search, and
the optimisation of gaps alone, are the same loop. An individual is evaluated once; survivors
keep their score. Parents are chosen by stochastic universal sampling after Baker (1987): one
throw, equally spaced pointers; the number of times an individual is chosen differs from its
expectation by less than one.

The fitness is the weighted F-measure of the retrieved clips (eqs 4.9 to 4.11); nothing
retrieved has precision 0, and so fitness 0. A clip counts once, whatever its hits: only
whether there is a hit is asked, and of all clips at once. A bitmap over the frames of all
clips is one Python integer, bit p for position p of the `PostingIndex`: at tens of thousands
of frames its AND and shift cost a microsecond, less than a call of NumPy on top of its work.

Augmentation makes copies of a clip as another person might have done it: slower or faster,
each feature a little earlier or later than the others. What separates the class from varied
others, too, does not rest on coincidences of the few examples.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence
from motionary.models.keyframes import PostingIndex
from motionary.models.query_learning.individuals import (
    GenePool,
    Individual,
    Score,
    initialise,
    mutate,
    recombine,
    shift_gap,
)
from motionary.packing import pack
from motionary.recording import Recording

Bits = NDArray[np.bool_]
Generator = np.random.Generator
Create = Callable[[Generator], Individual]
Reproduce = Callable[[Sequence[Individual], Generator], list[Individual]]

#: Keyframes remembered; at 42 586 frames they take 25 MB.
_MOST_REMEMBERED = 4096


@dataclass(frozen=True, slots=True)
class Augmentation:
    """Settings of varied copies of clips.

    Attributes
    ----------
    negative_copies : of each negative
    shift : frames by which a feature may come early or late
    tempo : a copy may be so many times slower or faster; 1 keeps the speed
    """

    negative_copies: int = 2
    shift: int = 3
    tempo: float = 1.25

    def __post_init__(self) -> None:
        if min(self.negative_copies, self.shift) < 0 or not 1.0 <= self.tempo <= 10.0:
            raise InvalidInput(
                "copies need a number and a shift of at least 0 and a tempo of 1 to 10, "
                f"got {self.negative_copies}, {self.shift} and {self.tempo}"
            )


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


# -- fitness ------------------------------------------------------------------------------


def weighted_f(precision: float, recall: float, *, beta: float) -> float:
    """F-measure in which recall weighs `beta` times as much as precision; 0 if both are 0."""
    weighted = beta * beta * precision + recall
    return (1.0 + beta * beta) * precision * recall / weighted if weighted > 0.0 else 0.0


class Fitness(NamedTuple):
    """Fitness from retrieved clips, the positives before the negatives."""

    n_positives: int
    beta: float

    def score(self, retrieved: NDArray[np.bool_]) -> Score:
        """Fitness, precision and recall of retrieved clips, shape (clips,)."""
        n_right = np.count_nonzero(retrieved[: self.n_positives])
        if n_right == 0:
            return Score(0.0, 0.0, 0.0)
        precision = float(n_right / np.count_nonzero(retrieved))
        recall = float(n_right / self.n_positives)
        return Score(weighted_f(precision, recall, beta=self.beta), precision, recall)


class Clips:
    """Bitmaps of the clips of an index, each a sequence, and of keyframes that were asked for."""

    def __init__(self, index: PostingIndex) -> None:
        self.n_clips = index.n_sequences
        self._index = index
        self._planes = [int.from_bytes(row.tobytes(), "little") for row in index.planes]
        self._n_bytes = index.planes.shape[1] * 8
        self._clip_of_byte = index.layout.of_byte
        self._longest = int(index.lengths.max())
        self._shown: dict[tuple[int, int], int] = {}
        self._inside: dict[int, int] = {}

    def retrieved(self, individual: Individual) -> NDArray[np.bool_]:
        """Which clips hold a hit, shape (clips,)."""
        found = self._first_frames(individual)
        hit = np.zeros(self.n_clips, dtype=np.bool_)
        if found:
            in_bytes = np.frombuffer(found.to_bytes(self._n_bytes, "little"), dtype=np.uint8)
            hit[self._clip_of_byte[np.flatnonzero(in_bytes)]] = True
        return hit

    def _first_frames(self, individual: Individual) -> int:
        """Frames of the first keyframe that begin a hit."""
        shown = []
        for keyframe in zip(individual.values, individual.fixed, strict=True):
            shown.append(self._keyframe(*keyframe))
            if not shown[-1]:
                return 0
        found = shown.pop()
        for least, most in zip(reversed(individual.least), reversed(individual.most), strict=True):
            found = shown.pop() & self._reach_back(found, least, most)
            if not found:
                return 0
        return found

    def _keyframe(self, value: int, fixed: int) -> int:
        """Frames that show a keyframe."""
        key = value & fixed, fixed
        bitmap = self._shown.get(key)
        if bitmap is None:
            first, *others = self._index.rows(*key)
            bitmap = self._planes[first]
            for row in others:
                bitmap &= self._planes[row]
                if not bitmap:
                    break
            if len(self._shown) >= _MOST_REMEMBERED:
                self._shown.clear()
            self._shown[key] = bitmap
        return bitmap

    def _reach_back(self, found: int, least: int, most: int) -> int:
        """Frames with a found frame from `least` to `most` frames later in the same clip."""
        if least >= self._longest:
            return 0
        width = min(most, self._longest) - least
        covered = 0
        while covered < width:
            step = min(covered + 1, width - covered)
            found |= (found >> step) & self._followed(step)
            covered += step
        return (found >> least) & self._followed(least) if least else found

    def _followed(self, step: int) -> int:
        """Frames whose clip goes on for at least `step` frames."""
        bitmap = self._inside.get(step)
        if bitmap is None:
            layout = self._index.layout
            marks = np.zeros(self._n_bytes * 8 + 1, dtype=np.int8)
            long_enough = self._index.lengths > step
            marks[layout.starts[long_enough]] += 1
            marks[layout.stops[long_enough] - step] -= 1
            packed = np.packbits(np.cumsum(marks[:-1], dtype=np.int8), bitorder="little")
            bitmap = int.from_bytes(packed.tobytes(), "little")
            self._inside[step] = bitmap
        return bitmap


class Evaluator:
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


# -- generations ------------------------------------------------------------------------


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
    """Columns of the template; any two parents recombined and mutated, as in the thesis."""

    def reproduce(parents: Sequence[Individual], rng: Generator) -> list[Individual]:
        pairs = itertools.combinations(parents, 2)
        return [mutate(recombine(*pair, pool, rng), pool, rng) for pair in pairs]

    return Reproduction(partial(initialise, pool), reproduce)


def random_creation(pool: GenePool) -> Reproduction:
    """As many individuals as `genetic` makes, all of them from scratch."""
    return Reproduction(
        partial(initialise, pool),
        lambda parents, rng: [initialise(pool, rng) for _ in range(math.comb(len(parents), 2))],
    )


def gaps_alone(create: Create) -> Reproduction:
    """The same keyframes in all individuals, whose gaps mutate."""

    def reproduce(parents: Sequence[Individual], rng: Generator) -> list[Individual]:
        count = math.comb(len(parents), 2)
        return [shift_gap(one, rng) for one in itertools.islice(itertools.cycle(parents), count)]

    return Reproduction(create, reproduce)


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
        for one in offspring:
            score = evaluator(one)
            rank = max(0.0, score.fitness - settings.parsimony * one.n_fixed)
            population.append(_Ranked(rank, one, score))
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


def augment_clip(
    clip: FeatureSequence, augmentation: Augmentation, rng: Generator
) -> FeatureSequence:
    """A copy of a clip at another tempo, its features shifted against each other."""
    features, known = clip.features.view(np.bool_), clip.known_features.view(np.bool_)
    features, known = augment(features, known, augmentation, rng)
    return FeatureSequence(pack(features), pack(known), clip.feature_set, Recording(clip.source))


def augment(
    features: Bits, known: Bits, augmentation: Augmentation, rng: Generator
) -> tuple[Bits, Bits]:
    """Features and known ones of the copy, shape (other frames, features); the ends are held."""
    n_frames, n_features = features.shape
    speed = augmentation.tempo ** rng.uniform(-1.0, 1.0)
    n_copied = max(1, round(n_frames / speed))
    times = np.minimum((np.arange(n_copied) * speed).astype(np.intp), n_frames - 1)
    shifts = rng.integers(-augmentation.shift, augmentation.shift, size=n_features, endpoint=True)
    at = np.clip(times[:, None] + shifts, 0, n_frames - 1)
    columns = np.arange(n_features)
    return features[at, columns], known[at, columns]
