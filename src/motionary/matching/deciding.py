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
from motionary.recording import FrameRange, split_runs

Floats = NDArray[np.float64]


class ClassSegment(NamedTuple):
    """Frames of one class, by its index among the classes."""

    class_index: int
    frames: FrameRange


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
