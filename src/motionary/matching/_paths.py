"""Warping paths and sums along them in NumPy: a column at a time over many paths.

`_paths_compiled` is the twin and gives the same bits. Steps are those of the distance
function; see `_numpy.march`.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from motionary.matching._numpy import Steps
from motionary.matching.distance import Abreast, Engine, march_abreast
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
# Numbers that are weighed and summed at a time: they stay in a processor's nearest caches.
_AT_ONCE = 65536
# Frames back by step.
_BACK = np.array([1, 2, 1, 1], dtype=np.int32)


class PathKernels(Protocol):
    """Paths of some patterns after others in one recording."""

    def march(self, patterns: Abreast) -> Single:
        """Distance functions, shape (patterns, frames); the steps into their cells are kept."""

    def score(self, ends: Sequence[Indices], weights: Sequence["SumWeights"]) -> list["PathSums"]:
        """Sums of what the features tell along each pattern's paths, where they suffice."""


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
    n_features : number of features
    """

    def __init__(
        self,
        packed: PackedFeatures,
        known: PackedFeatures | None,
        n_features: int,
    ) -> None:
        self._packed, self._known, self._n_features = packed, known, n_features
        self._observed: Observed | None = None
        self._steps = StepTable(packed, known, "numpy")

    def march(self, patterns: Abreast) -> Single:
        """Distance functions, shape (patterns, frames); the steps into their cells are kept."""
        return self._steps.march(patterns)

    def trace(self, ends: Sequence[Indices]) -> list[Integers]:
        """Frame that each column of each pattern's paths meets, or -1, (columns, paths)."""
        return trace(self._steps.table, self._steps.patterns, ends)

    def score(self, ends: Sequence[Indices], weights: Sequence[SumWeights]) -> list[PathSums]:
        """Sums of what the features tell along each pattern's paths, where they suffice."""
        if self._observed is None:
            self._observed = Observed(self._packed, self._known, self._n_features)
        traced = zip(self.trace(ends), weights, strict=True)
        return [_sum_in_blocks(self._observed, frames, own) for frames, own in traced]


def _sum_in_blocks(observed: "Observed", frames: Integers, weights: SumWeights) -> PathSums:
    parts = [
        observed.sum_enough(frames[:, first : first + _BLOCK], weights)
        for first in range(0, max(frames.shape[1], 1), _BLOCK)
    ]
    places = np.concatenate([places + i * _BLOCK for i, (places, _) in enumerate(parts)])
    sums = np.concatenate([sums for _, sums in parts])
    return PathSums(places, frames[0, places].astype(np.intp), sums)


class Observed:
    """Features of a recording, as of `NumpyKernels`, in the form that is summed along paths."""

    def __init__(
        self, packed: PackedFeatures, known: PackedFeatures | None, n_features: int
    ) -> None:
        # Row 0 is for columns without a frame.
        self._set = np.zeros((len(packed) + 1, n_features), dtype=np.float32)
        self._set[1:] = unpack(packed if known is None else packed & known, n_features)
        self._ever: Bools = np.ones(n_features, dtype=np.bool_)
        self._unknown: Single | None = None
        seen = None if known is None else unpack(known, n_features)
        if seen is not None and not seen.all():
            # What a skeleton lacks, it lacks in every frame: only what is known at times
            # has to be looked up.
            self._ever = np.asarray(seen.any(axis=0), dtype=np.bool_)
            self._unknown = np.zeros_like(self._set)
            self._unknown[1:] = ~seen & self._ever
            self._n_partial = np.cumsum(self._unknown.any(axis=1))

    def sum_features(self, frames: Integers, weights: SumWeights) -> Sums:
        """Whole numbers: what each feature tells along paths (columns, paths) of frames or -1."""
        return self._sum(frames, weights, _exact_type(weights))

    def sum_enough(
        self, frames: Integers, weights: SumWeights
    ) -> tuple[Indices, NDArray[np.int64]]:
        """Places and sums of the paths whose sum is at least `weights.least`."""
        dtype = _exact_type(weights)
        sums = self._sum(frames, weights, dtype)
        total = np.maximum(sums, dtype(weights.floor)).sum(axis=1, dtype=np.float64)
        places = np.flatnonzero(total >= weights.least)
        return places, total[places].astype(np.int64)

    def _sum(self, frames: Integers, weights: SumWeights, dtype: type) -> Sums:
        always: Sums = np.where(self._ever, weights.if_known, 0).astype(dtype)
        rows = frames + 1
        sums: Sums = (rows > 0).T.astype(dtype) @ always
        sums += _sum_along(self._set, rows, weights.if_set.astype(dtype))
        if self._unknown is not None:
            touched = self._touches_unknown(rows)
            if touched.any():
                sums[touched] -= _sum_along(self._unknown, rows[:, touched], always)
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


def _sum_along(table: Single, rows: Integers, weights: Sums) -> Sums:
    """Sums of the weighted rows of a table that each path meets, shape (paths, features)."""
    sums: Sums = np.empty((rows.shape[1], weights.shape[1]), dtype=weights.dtype)
    n_at_once = max(1, _AT_ONCE // weights.size)
    for first in range(0, len(sums), n_at_once):
        part = slice(first, first + n_at_once)
        met = table.take(rows[:, part].T, axis=0, mode="clip")
        np.einsum("pkf,kf->pf", met, weights, out=sums[part])
    return sums


class StepTable:
    """Steps of the paths of some patterns after others in one recording, by either twin."""

    def __init__(
        self,
        packed: PackedFeatures,
        known: PackedFeatures | None,
        engine: Engine,
    ) -> None:
        self._packed, self._known = packed, known
        self._engine: Engine = engine
        self._room = np.empty(0, dtype=np.uint8)
        self.table: Steps = self._room.reshape(0, 0, 0)
        self.patterns = Abreast((), (), ())

    def march(self, patterns: Abreast) -> Single:
        """Distance functions of patterns; `table` gets the step into every cell."""
        n_cells = patterns.n_cells(len(self._packed))
        if len(self._room) < n_cells:
            self._room = np.empty(n_cells, dtype=np.uint8)
        shape = len(patterns.longest[0]), len(patterns.longest), len(self._packed)
        self.table, self.patterns = self._room[:n_cells].reshape(shape), patterns
        return march_abreast(patterns, self._packed, self._known, self._engine, self.table)


def trace(steps: Steps, patterns: Abreast, ends: Sequence[Indices]) -> list[Integers]:
    """Frame that each column of each pattern's paths meets, or -1, (columns, paths)."""
    lengths = np.array([len(pattern) for pattern in patterns.patterns])
    # The longest first: of the others nothing is left when these go on.
    order = np.argsort(-lengths, kind="stable").tolist()
    n_paths = np.array([len(ends[i]) for i in order])
    _, n_abreast, n_frames = steps.shape
    at = np.concatenate([ends[i] for i in order]).astype(np.int32)
    places = np.repeat(np.array(patterns.places)[order], n_paths)
    columns = np.repeat(lengths[order], n_paths)
    # Cell of the flat table that belongs to frame 0 of a path's column.
    row = ((columns - 1) * n_abreast + places) * n_frames
    frames = np.empty((int(lengths.max()), len(at)), dtype=np.int32)
    frames[0] = at
    moves = np.ones(len(at), dtype=np.bool_)
    flat = steps.reshape(-1)
    for back, n in enumerate(_longer_than(columns), start=1):
        at, moves, row = at[:n], moves[:n], row[:n]
        # Paths that leave this column out have passed it already: they wait.
        step = flat.take(row + at, mode="clip")
        at -= _BACK.take(step, mode="clip") * moves
        moves = ~((step > 1) & moves)
        frames[back, :n] = np.where(moves, at, -1)
        row -= n_abreast * n_frames
    stops = np.cumsum(n_paths).tolist()
    traced = [frames[:0]] * len(order)
    for i, stop, n in zip(order, stops, n_paths.tolist(), strict=True):
        traced[i] = frames[: lengths[i], stop - n : stop][::-1]
    return traced


def _longer_than(columns: Indices) -> list[int]:
    """How many of these descending numbers are above 1, 2, …, up to the largest."""
    numbers = np.arange(1, columns.max(initial=1))
    return [int(n) for n in np.searchsorted(-columns, -numbers)]
