"""When is which pattern shown, if several match?

The decisions of Müller, Baak and Seidel (2009), section 4: per class a modified distance
function that gives every frame of a match the cost of the match; per frame the class with
the least; runs of one class, extended while the class's own function does not rise.

Conventions: frames are 0-based, segments half-open; ties go to the earlier class.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.matching.alignment import Alignment

Floats = NDArray[np.float64]


class Segment(NamedTuple):
    """A stretch of one class: index of the class, first frame, one past the last."""

    class_index: int
    start: int
    stop: int


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


def annotate_distances(modified: Sequence[Floats]) -> list[Segment]:
    """Segments from the classes' modified distance functions, eqs. 3 and 4 and extension.

    Segments of one class that touch or overlap after the extension are one; segments of
    different classes may overlap.
    """
    if not modified:
        return []
    matrix = np.array(modified)
    best = np.where(np.isfinite(matrix.min(axis=0)), matrix.argmin(axis=0), -1)
    extended = [
        Segment(index, *_extend(matrix[index], start, stop))
        for index, start, stop in find_runs(best)
        if index >= 0
    ]
    return _merge(extended)


def find_runs(values: NDArray[np.intp]) -> list[tuple[int, int, int]]:
    """Runs of equal values as (value, start, stop)."""
    if len(values) == 0:
        return []
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [len(values)]])
    starts, stops = edges[:-1].tolist(), edges[1:].tolist()
    return [(int(values[a]), a, b) for a, b in zip(starts, stops, strict=True)]


def _extend(modified: Floats, start: int, stop: int) -> tuple[int, int]:
    """Walk outwards while the class's own function is finite and does not rise."""
    while start > 0 and np.isfinite(modified[start - 1]):
        if modified[start - 1] > modified[start]:
            break
        start -= 1
    while stop < len(modified) and np.isfinite(modified[stop]):
        if modified[stop] > modified[stop - 1]:
            break
        stop += 1
    return start, stop


def _merge(segments: Sequence[Segment]) -> list[Segment]:
    merged: list[Segment] = []
    for segment in sorted(segments):
        last = merged[-1] if merged else None
        if last and last.class_index == segment.class_index and segment.start <= last.stop:
            merged[-1] = last._replace(stop=max(last.stop, segment.stop))
        else:
            merged.append(segment)
    return sorted(merged, key=lambda s: (s.start, s.stop, s.class_index))
