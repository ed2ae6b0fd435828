"""Which ends of matches are answers?

Two readings of a distance function: every local minimum below a threshold (annotation),
and ranked hits that exclude their neighbourhood (retrieval, after the authors' programs).

Conventions: frames are 0-based; a hit is half-open, `stop` one past its last frame.
"""

from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.matching.alignment import align
from motionary.matching.distance import SKIP_WEIGHT
from motionary.matching.pattern import Pattern
from motionary.packing import PackedFeatures

Single = NDArray[np.float32]

_BATCH = 32


class Hit(NamedTuple):
    """A stretch of a document that matches.

    Attributes
    ----------
    start, stop : frames, half-open
    cost : value of the distance function at its last frame
    """

    start: int
    stop: int
    cost: float


def local_minima(distance: Single, *, threshold: float) -> NDArray[np.intp]:
    """Frames of the local minima that are at most `threshold`.

    Of a plateau the first frame counts; the ends of a document count when the neighbour
    inside is higher.

    Raises
    ------
    InvalidInput
        If the threshold is not a number.
    """
    _check_threshold(threshold)
    if len(distance) == 0:
        return np.empty(0, dtype=np.intp)
    change = np.flatnonzero(distance[1:] != distance[:-1]) + 1
    first = np.concatenate([[0], change])
    level = distance[first]
    around = np.concatenate([[np.inf], level, [np.inf]])
    lowest = (level < around[:-2]) & (level < around[2:])
    return np.asarray(first[lowest & (level <= threshold)], dtype=np.intp)


def find_hits(
    distance: Single,
    pattern: Pattern,
    packed: PackedFeatures,
    known: PackedFeatures | None = None,
    *,
    threshold: float,
    limit: int | None = None,
    skip_weight: float = SKIP_WEIGHT,
) -> list[Hit]:
    """Hits of a pattern in one document, cheapest first.

    After a hit of n frames, ends within half of n before and a tenth of n after its end
    are excluded, and a later end whose start falls within a tenth of n before or half of n
    after the hit's start is the same hit.

    Parameters
    ----------
    distance : array, shape (frames,), from `distance_function`
    pattern, words, known : what it was computed from
    threshold : largest cost of a hit
    limit : most hits to return

    Raises
    ------
    InvalidInput
        If the threshold is not a number, the limit negative, or the distance function
        another document's.
    """
    _check_threshold(threshold)
    if limit is not None and limit < 0:
        raise InvalidInput(f"limit must be at least 0, got {limit}")
    if len(distance) != len(packed):
        raise InvalidInput(
            f"the distance function has {len(distance)} frames, the document {len(packed)}"
        )
    order = np.argsort(distance, kind="stable")
    order = order[(distance[order] <= threshold) & np.isfinite(distance[order])]
    excluded = np.zeros(len(distance), dtype=np.bool_)
    taken: list[Hit] = []
    while len(order) and (limit is None or len(taken) < limit):
        order = order[~excluded[order]]
        batch, order = order[:_BATCH], order[_BATCH:]
        for found in align(pattern, packed, known, batch, skip_weight=skip_weight):
            if excluded[found.end] or any(_same(found.start, hit) for hit in taken):
                continue
            hit = Hit(found.start, found.end + 1, float(distance[found.end]))
            taken.append(hit)
            _exclude_ends(excluded, hit)
            if limit is not None and len(taken) == limit:
                break
    return taken


def _check_threshold(threshold: float) -> None:
    if np.isnan(threshold):
        raise InvalidInput("threshold must be a number, got NaN")


def _exclude_ends(excluded: NDArray[np.bool_], hit: Hit) -> None:
    length, end = hit.stop - hit.start, hit.stop - 1
    first = max(0, end - ceil(0.5 * length))
    excluded[first : end + ceil(0.1 * length) + 1] = True


def _same(start: int, hit: Hit) -> bool:
    length = hit.stop - hit.start
    return hit.start - ceil(0.1 * length) <= start <= hit.start + ceil(0.5 * length)
