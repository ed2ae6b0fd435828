"""Hits from the ends of matches, and label assignment where several patterns match.

Two readings of a distance function: every local minimum below a threshold (annotation), and
ranked hits that exclude their neighbourhood (retrieval, after the authors' programs).

Label assignment is that of Müller, Baak and Seidel (2009), section 4: per class a modified
distance function that gives every frame of a match the cost of the match; per frame the
class with the least; runs of one class, extended while the class's own function does not
rise. Ties go to the earlier class.

Conventions: frames are counted from 0; hits and segments are half-open.
"""

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.matching.pattern import SKIP_WEIGHT, Alignment, Pattern, align
from motionary.packing import PackedFeatures
from motionary.recording import FrameRange, split_runs

Single = NDArray[np.float32]
Floats = NDArray[np.float64]

_BATCH = 32


class Hit(NamedTuple):
    """A segment of a sequence that matches.

    Attributes
    ----------
    start, stop : frames, half-open
    cost : value of the distance function at its last frame
    """

    start: int
    stop: int
    cost: float


class ClassSegment(NamedTuple):
    """Frames of one class, by its index among the classes."""

    class_index: int
    frames: FrameRange


def local_minima(distance: Single, *, threshold: float) -> NDArray[np.intp]:
    """Frames of the local minima that are at most `threshold`.

    Of a plateau the first frame counts; the ends of a sequence count when the neighbour
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
    """Hits of a pattern in one sequence, cheapest first; see `align_hits`."""
    found = align_hits(
        distance, pattern, packed, known, threshold=threshold, limit=limit, skip_weight=skip_weight
    )
    return [Hit(one.start, one.end + 1, float(distance[one.end])) for one in found]


def align_hits(
    distance: Single,
    pattern: Pattern,
    packed: PackedFeatures,
    known: PackedFeatures | None = None,
    *,
    threshold: float,
    limit: int | None = None,
    skip_weight: float = SKIP_WEIGHT,
) -> list[Alignment]:
    """Alignments of the hits of a pattern in one sequence, by the distance at their ends.

    After a hit of n frames, ends within half of n before and a tenth of n after its end
    are excluded, and a later end whose start falls within a tenth of n before or half of n
    after the hit's start is the same hit.

    Parameters
    ----------
    distance : array, shape (frames,), from `distance_function`
    pattern, packed, known : what it was computed from
    threshold : largest cost of a hit
    limit : most hits to return

    Raises
    ------
    InvalidInput
        If the threshold is not a number, the limit negative, or the distance function
        another sequence's.
    """
    _check_threshold(threshold)
    if limit is not None and limit < 0:
        raise InvalidInput(f"limit must be at least 0, got {limit}")
    if len(distance) != len(packed):
        raise InvalidInput(
            f"the distance function has {len(distance)} frames, the sequence {len(packed)}"
        )
    order = np.argsort(distance, kind="stable")
    order = order[(distance[order] <= threshold) & np.isfinite(distance[order])]
    excluded = np.zeros(len(distance), dtype=np.bool_)
    taken: list[Alignment] = []
    while len(order) and (limit is None or len(taken) < limit):
        order = order[~excluded[order]]
        # At first likely hits, one of each; then what lies beside them and may be another.
        ends = order[:_BATCH].tolist() if taken else _ends_apart(order, len(pattern), limit)
        aligned = align(pattern, packed, known, ends, skip_weight=skip_weight)
        found = dict(zip(ends, aligned, strict=True))
        n_done = 0
        for end in order.tolist():
            if not excluded[end] and end not in found:
                break
            n_done += 1
            if not excluded[end] and not any(_same(found[end].start, hit) for hit in taken):
                taken.append(found[end])
                if len(taken) == limit:
                    return taken
                _exclude_ends(excluded, end, end + 1 - found[end].start)
        order = order[n_done:]
    return taken


def _ends_apart(order: NDArray[np.intp], n_columns: int, limit: int | None) -> list[int]:
    """The first ends of which none is excluded by one before, however short that hit is."""
    most = _BATCH if limit is None else min(limit, _BATCH)
    apart: list[int] = []
    excluded = np.zeros(order.max(initial=-1) + 1, dtype=np.bool_)
    for end in order.tolist():
        if not excluded[end]:
            apart.append(end)
            _exclude_ends(excluded, end, (n_columns + 1) // 2)
            if len(apart) == most:
                break
    return apart


def _check_threshold(threshold: float) -> None:
    if np.isnan(threshold):
        raise InvalidInput("threshold must be a number, got NaN")


def _exclude_ends(excluded: NDArray[np.bool_], end: int, length: int) -> None:
    first = max(0, end - ceil(0.5 * length))
    excluded[first : end + ceil(0.1 * length) + 1] = True


def _same(start: int, hit: Alignment) -> bool:
    length = hit.end + 1 - hit.start
    return hit.start - ceil(0.1 * length) <= start <= hit.start + ceil(0.5 * length)


def modify(matches: Sequence[Alignment], *, n_frames: int) -> tuple[Floats, NDArray[np.intp]]:
    """Modified distance function: every frame of a match gets the match's cost.

    Parameters
    ----------
    matches : with first and last frame and cost
    n_frames : length of the recording

    Returns
    -------
    modified, owner : arrays, shape (frames,): the least cost and which match has it;
        infinite and -1 without one
    """
    modified = np.full(n_frames, np.inf)
    owner = np.full(n_frames, -1, dtype=np.intp)
    for i, match in enumerate(matches):
        inside = slice(match.start, match.end + 1)
        cheaper = match.cost < modified[inside]
        modified[inside][cheaper] = match.cost
        owner[inside][cheaper] = i
    return modified, owner


def annotate_distances(modified: Sequence[Floats]) -> list[ClassSegment]:
    """Segments from the classes' modified distance functions, eqs. 3 and 4 and extension.

    Segments of one class that touch or overlap after the extension are one; segments of
    different classes may overlap.
    """
    if not modified:
        return []
    matrix = np.array(modified)
    best = np.where(np.isfinite(matrix.min(axis=0)), matrix.argmin(axis=0), -1)
    extended = [
        ClassSegment(int(best[start]), _extend(matrix[best[start]], start, stop))
        for start, stop in split_runs(best)
        if best[start] >= 0
    ]
    return _merge(extended)


def _extend(modified: Floats, start: int, stop: int) -> FrameRange:
    """Walk outwards while the class's own function is finite and does not rise."""
    while start > 0 and np.isfinite(modified[start - 1]):
        if modified[start - 1] > modified[start]:
            break
        start -= 1
    while stop < len(modified) and np.isfinite(modified[stop]):
        if modified[stop] > modified[stop - 1]:
            break
        stop += 1
    return FrameRange(start, stop)


def _merge(segments: Sequence[ClassSegment]) -> list[ClassSegment]:
    merged: list[ClassSegment] = []
    for segment in sorted(segments):
        index, frames = merged[-1] if merged else (-1, segment.frames)
        if index == segment.class_index and segment.frames.start <= frames.stop:
            joined = FrameRange(frames.start, max(frames.stop, segment.frames.stop))
            merged[-1] = ClassSegment(index, joined)
        else:
            merged.append(segment)
    return sorted(merged, key=lambda s: (s.frames, s.class_index))
