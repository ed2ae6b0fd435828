"""Warping paths and sums along them in NumPy: a column at a time over many paths.

`_paths_compiled` is the twin and gives the same bits. Steps are those of the distance
function; see `_numpy.march`.
"""

import math
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from motionary.matching._numpy import Steps
from motionary.matching.distance import SKIP_WEIGHT, Engine, MatchState, march_pattern
from motionary.matching.pattern import Pattern
from motionary.packing import PackedFeatures, unpack

Single = NDArray[np.float32]
Integers = NDArray[np.int32]
Indices = NDArray[np.intp]
Bools = NDArray[np.bool_]
# Sums of whole numbers, in single precision where that is exact.
Sums = NDArray[np.float32] | NDArray[np.float64]

# Paths at a time: their sums of all features stay in a processor's cache.
_BLOCK = 2048
# Whole numbers below this are exact in single precision.
_EXACT = 2**24
# Paths are given up after any of so many parts of their columns.
_STAGES = 4
# Paths whose features stand in one row when they are multiplied.
_ABREAST = 16
# Frames back by step.
_BACK = np.array([1, 2, 1, 1], dtype=np.int32)


class PathKernels(Protocol):
    """Paths of one pattern after the other in one recording."""

    def march(self, pattern: Pattern) -> Single:
        """Distance function of a pattern; the steps into its cells are kept."""

    def score(self, ends: Indices, weights: "SumWeights") -> "PathSums":
        """Sums of what the features tell along the paths to `ends`, where they suffice."""


class SumWeights(NamedTuple):
    """What is summed along paths, in whole numbers.

    Attributes
    ----------
    if_set, if_known : arrays, shape (columns, features), int32
        What a feature tells that holds, beyond what it tells when it is known.
    floor : least that one feature tells along a path
    least : least sum of a path that is kept
    """

    if_set: Integers
    if_known: Integers
    floor: int
    least: int


class PathSums(NamedTuple):
    """Paths that are kept: their places among the ends, first frames, and sums."""

    places: Indices
    starts: Indices
    sums: NDArray[np.int64]


class NumpyKernels:
    """`PathKernels` without a compiler; traces and explains as well.

    Parameters
    ----------
    packed, known : arrays, shape (frames, n_integers); known may be None
    blocked : frames that no path meets
    n_features : number of features
    """

    def __init__(
        self,
        packed: PackedFeatures,
        known: PackedFeatures | None,
        blocked: Indices,
        n_features: int,
    ) -> None:
        self._packed, self._known, self._n_features = packed, known, n_features
        self._observed: Observed | None = None
        self._steps = StepTable(packed, known, blocked, "numpy")

    def march(self, pattern: Pattern) -> Single:
        """Distance function of a pattern; the steps into its cells are kept."""
        return self._steps.march(pattern)

    def trace(self, ends: Indices) -> Integers:
        """Frame that each column of the paths to `ends` meets, or -1, (columns, paths)."""
        return trace(self._steps.table, ends)

    def score(self, ends: Indices, weights: SumWeights) -> PathSums:
        """Sums of what the features tell along the paths to `ends`, where they suffice."""
        if self._observed is None:
            self._observed = Observed(self._packed, self._known, self._n_features)
        frames = self.trace(ends)
        parts = [
            self._observed.sum_enough(frames[:, first : first + _BLOCK], weights)
            for first in range(0, max(len(ends), 1), _BLOCK)
        ]
        places = np.concatenate([places + i * _BLOCK for i, (places, _) in enumerate(parts)])
        sums = np.concatenate([sums for _, sums in parts])
        return PathSums(places, frames[0, places].astype(np.intp), sums)


class Observed:
    """Features of a recording in the form in which they are summed along paths.

    Parameters as of `NumpyKernels`.
    """

    def __init__(
        self, packed: PackedFeatures, known: PackedFeatures | None, n_features: int
    ) -> None:
        # Row 0 is for columns without a frame.
        self._set = np.zeros((len(packed) + 1, n_features), dtype=np.float32)
        self._set[1:] = unpack(packed if known is None else packed & known, n_features)
        self._ever: Bools = np.ones(n_features, dtype=np.bool_)
        self._unknown: Bools | None = None
        seen = None if known is None else unpack(known, n_features)
        if seen is not None and not seen.all():
            # What a skeleton lacks, it lacks in every frame: only what is known at times
            # has to be looked up.
            self._ever = np.asarray(seen.any(axis=0), dtype=np.bool_)
            self._unknown = np.zeros(self._set.shape, dtype=np.bool_)
            self._unknown[1:] = ~seen & self._ever
            self._n_partial = np.cumsum(self._unknown.any(axis=1))

    def sum_features(self, frames: Integers, weights: SumWeights) -> Sums:
        """Whole numbers: what each feature tells along paths, shape (paths, features).

        Parameters
        ----------
        frames : array, shape (columns, paths), frames or -1
        """
        return self._sum(frames, weights, _exact_type(weights))

    def sum_enough(
        self, frames: Integers, weights: SumWeights
    ) -> tuple[Indices, NDArray[np.int64]]:
        """Places and sums of the paths whose sum is at least `weights.least`.

        Most paths fall short by so much that some of the columns show it.
        """
        dtype = _exact_type(weights)
        most = np.maximum(weights.if_known + np.maximum(weights.if_set, 0), 0)
        floor = dtype(weights.floor)
        places = np.arange(frames.shape[1])
        sums: Sums = np.zeros((len(places), weights.if_set.shape[1]), dtype=dtype)
        total = np.zeros(len(places))
        edges = np.linspace(0, len(frames), _STAGES + 1).astype(int)
        for first, last in pairwise(edges.tolist()):
            part = slice(first, last)
            own = weights._replace(if_set=weights.if_set[part], if_known=weights.if_known[part])
            sums += self._sum(frames[part][:, places], own, dtype)
            rest = most[last:].sum(axis=0).astype(dtype)
            total = np.maximum(sums + rest, floor).sum(axis=1, dtype=np.float64)
            enough = total >= weights.least
            places, sums, total = places[enough], sums[enough], total[enough]
        return places, total.astype(np.int64)

    def _sum(self, frames: Integers, weights: SumWeights, dtype: type) -> Sums:
        always: Sums = np.where(self._ever, weights.if_known, 0).astype(dtype)
        rows = frames + 1
        sums: Sums = (rows > 0).T.astype(dtype) @ always
        _add_along(sums, self._set, rows, weights.if_set.astype(dtype))
        if self._unknown is not None:
            touched = self._touches_unknown(rows)
            if touched.any():
                lost: Sums = np.zeros((np.count_nonzero(touched), sums.shape[1]), dtype=dtype)
                _add_along(lost, self._unknown, rows[:, touched], always)
                sums[touched] -= lost
        return sums

    def _touches_unknown(self, rows: Integers) -> Bools:
        last = rows.max(axis=0, initial=0)
        first = np.where(rows > 0, rows, last).min(axis=0, initial=2**30)
        n_partial = self._n_partial
        touches: Bools = n_partial[last] > n_partial[np.maximum(np.minimum(first, last) - 1, 0)]
        return touches


def _exact_type(weights: SumWeights) -> type:
    """Single precision where no sum over columns can pass what it holds exactly."""
    terms = np.abs(weights.if_set).astype(np.int64) + np.abs(weights.if_known)
    return np.float32 if terms.sum(axis=0).max(initial=0) < _EXACT else np.float64


def _add_along(sums: Sums, table: Single | Bools, rows: Integers, weights: Sums) -> None:
    """Add to `sums` the weighted rows of a table that each path meets."""
    n_paths, n_features = sums.shape
    # Products of few long rows take a third of the time of many short ones.
    padded = np.zeros((-(-n_paths // _ABREAST) * _ABREAST, n_features), dtype=table.dtype)
    weighed = padded if padded.dtype == sums.dtype else np.zeros_like(padded, dtype=sums.dtype)
    cells, abreast = padded[:n_paths], (-1, _ABREAST * n_features)
    tiled = np.tile(weights, (1, _ABREAST))
    for row, weight in zip(rows.astype(np.intp), tiled, strict=True):
        np.take(table, row, axis=0, out=cells, mode="clip")
        np.multiply(padded.reshape(abreast), weight, out=weighed.reshape(abreast))
        np.add(sums, weighed[:n_paths], out=sums)


class StepTable:
    """Steps of the paths of one pattern after the other in one recording.

    Parameters
    ----------
    packed, known, blocked : as of `NumpyKernels`
    engine : which twin of the distance function computes
    """

    def __init__(
        self,
        packed: PackedFeatures,
        known: PackedFeatures | None,
        blocked: Indices,
        engine: Engine,
    ) -> None:
        self._packed, self._known, self._blocked = packed, known, blocked
        self._engine: Engine = engine
        self._room = np.empty(0, dtype=np.uint8)
        self.table: Steps = self._room.reshape(0, 0)

    def march(self, pattern: Pattern) -> Single:
        """Distance function of a pattern; `table` gets the step into every cell."""
        shape = len(pattern), len(self._packed)
        if len(self._room) < math.prod(shape):
            self._room = np.empty(math.prod(shape), dtype=np.uint8)
        self.table = self._room[: math.prod(shape)].reshape(shape)
        state = MatchState.fresh(pattern)
        return march_pattern(
            pattern, self._packed, self._known, self._blocked,
            SKIP_WEIGHT, state, self._engine, self.table,
        )  # fmt: skip


def trace(steps: Steps, ends: Indices) -> Integers:
    """Frame that each column of the paths to `ends` meets, or -1, (columns, paths)."""
    n_columns = len(steps)
    frames = np.empty((n_columns, len(ends)), dtype=np.int32)
    frames[-1] = ends
    at = ends.astype(np.int32)
    moves = np.ones(len(ends), dtype=np.bool_)
    for k in range(n_columns - 1, 0, -1):
        # Paths that leave this column out have passed it already: they wait.
        step = steps[k].take(at, mode="clip")
        at -= _BACK.take(step, mode="clip") * moves
        moves = ~((step > 1) & moves)
        frames[k - 1] = np.where(moves, at, -1)
    return frames
