"""Sums along warping paths compiled: the twin of `_paths`, with the same bits."""

from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from motionary.matching._numpy import Steps
from motionary.matching._paths import (
    Indices,
    Integers,
    PathSums,
    Single,
    StepTable,
    SumWeights,
)
from motionary.matching.distance import Abreast
from motionary.packing import PackedFeatures, unpack

Masks = NDArray[np.int8]


class CompiledKernels:
    """`PathKernels` with a compiler; parameters as of `NumpyKernels`."""

    def __init__(
        self,
        packed: PackedFeatures,
        known: PackedFeatures | None,
        n_features: int,
    ) -> None:
        self._steps = StepTable(packed, known, "compiled")
        # Minus one where it holds: all bits set.
        self._set = _as_masks(packed if known is None else packed & known, n_features)
        self._seen = self._set if known is None else _as_masks(known, n_features)
        # What a skeleton lacks, it lacks in every frame; see `_paths.Observed`.
        self._ever = np.ones(n_features, bool) if known is None else self._seen.any(axis=0)
        self._partial = np.zeros(len(packed), dtype=np.bool_)
        if known is not None:
            self._partial = (self._seen == 0)[:, self._ever].any(axis=1)

    def march(self, patterns: Abreast) -> Single:
        """Distance functions, shape (patterns, frames); the steps into their cells are kept."""
        return self._steps.march(patterns)

    def score(self, ends: Sequence[Indices], weights: Sequence[SumWeights]) -> list[PathSums]:
        """Sums of what the features tell along each pattern's paths, where they suffice."""
        return [
            self._score(self._steps.table[: len(pattern), place], own_ends, own_weights)
            for pattern, place, own_ends, own_weights in zip(
                self._steps.patterns.patterns, self._steps.patterns.places, ends, weights,
                strict=True,
            )
        ]  # fmt: skip

    def _score(self, steps: Steps, ends: Indices, weights: SumWeights) -> PathSums:
        starts, sums = sum_along(
            steps, ends, self._set, self._seen, self._partial,
            weights.if_set, weights.if_known * self._ever, np.int64(weights.floor),
        )  # fmt: skip
        places = np.flatnonzero(sums >= weights.least)
        return PathSums(places, starts[places], sums[places])


def _as_masks(packed: PackedFeatures, n_features: int) -> Masks:
    masks: Masks = -unpack(packed, n_features).view(np.int8)
    return masks


@numba.njit(cache=True, nogil=True)
def sum_along(
    steps: Steps,
    ends: Indices,
    is_set: Masks,
    is_known: Masks,
    is_partial: NDArray[np.bool_],
    if_set: Integers,
    if_known: Integers,
    floor: np.int64,
) -> tuple[Indices, NDArray[np.int64]]:
    """First frames of the paths to `ends`, and their sums; masks count in partial frames."""
    n_columns, n_features = if_set.shape
    starts, sums = np.empty(len(ends), dtype=np.intp), np.empty(len(ends), dtype=np.int64)
    told = np.empty(n_features, dtype=np.int32)
    for i in range(len(ends)):
        told[:] = 0
        k, frame = n_columns - 1, ends[i]
        while True:
            if is_partial[frame]:
                for j in range(n_features):
                    known = if_known[k, j] & np.int32(is_known[frame, j])
                    told[j] += known + (if_set[k, j] & np.int32(is_set[frame, j]))
            else:
                for j in range(n_features):
                    told[j] += if_known[k, j] + (if_set[k, j] & np.int32(is_set[frame, j]))
            if k == 0:
                break
            step = steps[k, frame]
            frame -= 2 if step == 1 else 1
            k -= 2 if step > 1 else 1
        total = np.int64(0)
        for j in range(n_features):
            told_here = np.int64(told[j])
            total += told_here if told_here > floor else floor
        starts[i], sums[i] = frame, total
    return starts, sums
