"""Log-likelihood ratios of warping paths: what the frames of a match tell for a class.

A match of a pattern is the warping path of masked subsequence DTW that ends in a local
minimum of the distance function. Its score is the logarithm of how much more likely the
class makes the frames on the path than motion in general does, with features taken as
independent, divided by the square root of the most that the template can tell: scores of
templates that ask for much and for little then compare.

Conventions: a path has at most one frame a column; columns that a step (2, 1) leaves out
have the frame -1. Costs are single precision and equal to those of the distance function;
of steps that cost the same the first of (1, 1), (1, 2), (2, 1) is taken. Ratios are whole
multiples of `GRAIN`, so that sums are exact in any order, in NumPy and compiled.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.matching._paths import NumpyKernels, Observed, PathKernels, SumWeights
from motionary.matching.distance import Engine, alone, load_twin, plan_abreast
from motionary.matching.pattern import Pattern, check_sequence
from motionary.packing import PackedFeatures, count_integers

Floats = NDArray[np.float64]
Single = NDArray[np.float32]
Integers = NDArray[np.int32]
Indices = NDArray[np.intp]

#: Unit of the ratios, in nats.
GRAIN = 2.0**-12
#: A cell of this value is free: by editing, or because no example shows it.
FREE = 0.5

#: A level of the distance function that lasts so many frames after a fall is a minimum,
#: whatever follows: what ends there is known half a second later.
SETTLED = 15

#: From so many cells on the compiled twin is worth the second that loading it takes: NumPy
#: needs as long for them.
COMPILED_PAYS_AT = 80_000_000

_COMPILED = "motionary.matching._paths_compiled"


@dataclass(frozen=True, slots=True)
class PathScoreSettings:
    """Settings of path scores; chosen on repetitions of exercises by four people.

    Attributes
    ----------
    most_cost : highest cost of a path that is scored
    least_score : paths of a lower score are left out
    least_probability : probabilities are kept so far off 0 and 1: no frame decides alone
    prior_examples : a template counts the prior as so many further examples
    posture : fraction of the posture, the template's mean over time, in the alternative
    floor : least that one feature may tell: a person may differ from the examples in one
        habit that lasts
    every : where a minimum lasts, every so many frames end a path
    """

    most_cost: float = 0.3
    least_score: float = 2.0
    least_probability: float = 0.01
    prior_examples: float = 1.0
    posture: float = 0.5
    floor: float = -2.0
    every: int = 4


DEFAULTS = PathScoreSettings()


@dataclass(frozen=True, slots=True, eq=False)
class CellRatios:
    """Log-likelihood ratios of the cells of a template, in units of `GRAIN`.

    Attributes
    ----------
    if_one, if_zero : arrays, shape (columns, features), int32
        What a frame tells in which the feature holds, and in which it does not.
    """

    if_one: Integers
    if_zero: Integers

    @property
    def scale(self) -> float:
        """Square root of the most that the template can tell, in nats; 1 if nothing."""
        most = float(np.maximum(self.if_one, self.if_zero).sum(dtype=np.int64)) * GRAIN
        return most**0.5 if most > 0 else 1.0


class Paths(NamedTuple):
    """Warping paths of one pattern, in the order of their ends.

    Attributes
    ----------
    frames : array, shape (paths, columns), int32: frame that a column meets, or -1
    costs : array, shape (paths,), float32
    """

    frames: Integers
    costs: Single

    @property
    def starts(self) -> Integers:
        """First frames; the first column is in every path."""
        return self.frames[:, 0]

    @property
    def ends(self) -> Integers:
        """Last frames, inclusive."""
        return self.frames[:, -1]


class ScoredPaths(NamedTuple):
    """Extents and scores of paths of several patterns, by pattern, then by end.

    Attributes
    ----------
    patterns : array, shape (paths,): index of each path's pattern
    starts, stops : arrays, shape (paths,): frames, half-open
    scores : array, shape (paths,), float64, nats by the square root of nats
    costs : array, shape (paths,), float32
    """

    patterns: Indices
    starts: Indices
    stops: Indices
    scores: Floats
    costs: Single


def cell_ratios(
    values: Floats, prior: Floats, *, n_examples: int, settings: PathScoreSettings = DEFAULTS
) -> CellRatios:
    """Log-likelihood ratios of a template against motion in general and its own posture.

    The alternative to a cell lies halfway, as a geometric mean, between the prior and the
    template's mean over time: who only holds the posture of the class gains little.

    Parameters
    ----------
    values : array, shape (columns, features), in [0, 1], before quantising
    prior : array, shape (features,): fraction of frames of any motion in which each holds
    n_examples : number of examples behind the values

    Raises
    ------
    InvalidInput
        If the prior is not one number a feature, or there is no example.
    """
    if values.ndim != 2 or prior.shape != values.shape[1:] or n_examples < 1:
        raise InvalidInput(
            "ratios need values (columns, features), a prior (features,) and an example, got "
            f"shapes {values.shape} and {prior.shape} and {n_examples} examples"
        )
    least, extra = settings.least_probability, settings.prior_examples
    q = np.clip(prior, least, 1 - least)
    p = (n_examples * values + extra * q) / (n_examples + extra)
    p = np.clip(p, least, 1 - least)
    tells = values != FREE
    n_telling = tells.sum(axis=0)
    posture = np.where(n_telling > 0, (p * tells).sum(axis=0) / np.maximum(n_telling, 1), q)
    if_one, if_zero = (
        np.where(
            tells,
            np.log(x) - ((1 - settings.posture) * np.log(y) + settings.posture * np.log(z)),
            0.0,
        )
        for x, y, z in ((p, q, posture), (1 - p, 1 - q, 1 - posture))
    )
    return CellRatios(*(np.rint(r / GRAIN).astype(np.int32) for r in (if_one, if_zero)))


def find_paths(
    pattern: Pattern,
    packed: PackedFeatures,
    known: PackedFeatures | None = None,
    *,
    settings: PathScoreSettings = DEFAULTS,
) -> Paths:
    """Paths that end in local minima of the distance function, in order of their ends.

    Parameters
    ----------
    packed, known : arrays, shape (frames, n_integers); all is known without `known`
    """
    check_sequence(pattern, packed, known)
    kernels = NumpyKernels(packed, known, 0)
    (distance,) = kernels.march(alone(pattern))
    ends = minima_ends(distance, threshold=settings.most_cost, every=settings.every)
    (frames,) = kernels.trace([ends])
    return Paths(np.ascontiguousarray(frames.T), distance[ends])


def find_paths_to(
    pattern: Pattern, packed: PackedFeatures, known: PackedFeatures | None, ends: Indices
) -> Paths:
    """The paths to given ends alone, such as those of chosen labels.

    Equal to those of `find_paths`; no other frames are visited.

    Raises
    ------
    InvalidInput
        If no path ends at one of the frames.
    """
    check_sequence(pattern, packed, known)
    frames = np.empty((len(ends), len(pattern)), dtype=np.int32)
    costs = np.empty(len(ends), dtype=np.float32)
    for i, end in enumerate(ends.tolist()):
        # No path is longer than two frames a step.
        first = max(0, end - 2 * len(pattern) + 2)
        part = slice(first, end + 1)
        kernels = NumpyKernels(packed[part], None if known is None else known[part], 0)
        costs[i] = kernels.march(alone(pattern))[0, -1] if end < len(packed) else np.inf
        if not np.isfinite(costs[i]):
            raise InvalidInput(f"no path of {len(pattern)} columns ends at frame {end}")
        found = kernels.trace([np.array([end - first])])[0][:, 0]
        frames[i] = np.where(found < 0, -1, found + first)
    return Paths(frames, costs)


def explain_scores(
    ratios: CellRatios,
    paths: Paths,
    packed: PackedFeatures,
    known: PackedFeatures | None = None,
    *,
    settings: PathScoreSettings = DEFAULTS,
) -> Floats:
    """Part of each feature in the scores of paths, shape (paths, features); rows sum to them."""
    observed = Observed(packed, known, ratios.if_one.shape[1])
    weights = sum_weights(ratios, settings)
    sums = observed.sum_features(np.ascontiguousarray(paths.frames.T), weights)
    parts: Floats = np.maximum(sums, weights.floor).astype(np.float64) * (GRAIN / ratios.scale)
    return parts


def score_patterns(
    patterns: Sequence[Pattern],
    ratios: Sequence[CellRatios],
    packed: PackedFeatures,
    known: PackedFeatures | None = None,
    *,
    settings: PathScoreSettings = DEFAULTS,
    engine: Engine = "auto",
) -> ScoredPaths:
    """Extents and scores of the paths of patterns in one recording that tell enough.

    Parameters
    ----------
    patterns, ratios : of the same templates, in one order
    packed, known : arrays, shape (frames, n_integers); all is known without `known`
    engine : which twin computes; "auto" takes the compiled one where it pays

    Raises
    ------
    InvalidInput
        If patterns, ratios and recording do not fit, or the compiled twin is not installed.
    """
    n_features = check_ratios(patterns, ratios)
    for pattern in patterns:
        check_sequence(pattern, packed, known)
    if not patterns or not len(packed):
        return _join([])
    n_cells = len(packed) * sum(map(len, patterns))
    twin = load_twin(_COMPILED, engine, pays=n_cells >= COMPILED_PAYS_AT)
    kernels: PathKernels
    if twin is None:
        kernels = NumpyKernels(packed, known, n_features)
        planned = plan_abreast(patterns, n_frames=len(packed))
    else:
        kernels = twin.CompiledKernels(packed, known, n_features)
        planned = [((i,), alone(pattern)) for i, pattern in enumerate(patterns)]
    found: dict[int, ScoredPaths] = {}
    for indices, abreast in planned:
        distances = kernels.march(abreast)
        ends = [
            minima_ends(d, threshold=settings.most_cost, every=settings.every) for d in distances
        ]
        scored = kernels.score(ends, [sum_weights(ratios[i], settings) for i in indices])
        for i, own, distance, sums in zip(indices, ends, distances, scored, strict=True):
            kept = own[sums.places]
            scores: Floats = sums.sums * np.float64(GRAIN / ratios[i].scale)
            which = np.full(len(kept), i, dtype=np.intp)
            found[i] = ScoredPaths(which, sums.starts, kept + 1, scores, distance[kept])
    return _join([found[i] for i in range(len(patterns))])


def minima_ends(distance: Single, *, threshold: float, every: int = DEFAULTS.every) -> Indices:
    """Ends of matches: frames of the local minima that are at most `threshold`.

    A level that was fallen to and lasts is one as well, whether the distance then rises or
    falls. Where a minimum lasts, its first end means the fastest way through the template
    and leaves out columns; its last frame and each so many frames between are ends as well.
    """
    if len(distance) == 0:
        return np.empty(0, dtype=np.intp)
    first = np.concatenate([[0], np.flatnonzero(distance[1:] != distance[:-1]) + 1])
    last = np.append(first[1:], len(distance)) - 1
    level = distance[first]
    around = np.concatenate([[np.inf], level, [np.inf]])
    lowest = (level < around[2:]) | (last - first + 1 >= SETTLED)
    lowest &= (level < around[:-2]) & (level <= threshold)
    first, last = first[lowest], last[lowest]
    n_ends = -(-(last - first) // every) + 1
    number = np.arange(n_ends.sum()) - np.repeat(np.cumsum(n_ends) - n_ends, n_ends)
    ends = np.repeat(first, n_ends) + every * number
    return np.asarray(np.minimum(ends, np.repeat(last, n_ends)), dtype=np.intp)


def sum_weights(ratios: CellRatios, settings: PathScoreSettings) -> SumWeights:
    """What is summed along the paths of a template, and the least sum that counts."""
    unit = ratios.scale / GRAIN
    return SumWeights(
        ratios.if_one - ratios.if_zero,
        ratios.if_zero,
        round(settings.floor * unit),
        math.ceil(settings.least_score * unit),
    )


def check_ratios(patterns: Sequence[Pattern], ratios: Sequence[CellRatios]) -> int:
    """Number of features; InvalidInput unless ratios and patterns belong together."""
    if len(patterns) != len(ratios):
        raise InvalidInput(
            f"each pattern needs its ratios, got {len(patterns)} patterns and {len(ratios)} ratios"
        )
    widths = {ratio.if_one.shape[1] for ratio in ratios}
    if len(widths) > 1:
        raise InvalidInput(f"ratios must be of one feature set, got {sorted(widths)} features")
    for pattern, ratio in zip(patterns, ratios, strict=True):
        n_columns, n_features = ratio.if_one.shape
        n_integers = pattern.values.shape[1]
        if len(pattern) != n_columns or count_integers(n_features) != n_integers:
            raise InvalidInput(
                f"a pattern of {len(pattern)} columns of {n_integers} integers needs ratios of "
                f"its own template, got {n_columns} columns of {n_features} features"
            )
    return widths.pop() if widths else 0


def _join(found: Sequence[ScoredPaths]) -> ScoredPaths:
    nothing = np.empty(0, dtype=np.intp)
    none = ScoredPaths(nothing, nothing, nothing, np.empty(0), np.empty(0, dtype=np.float32))
    return ScoredPaths(*map(np.concatenate, zip(none, *found, strict=True)))
