"""Algorithm 1 of Baak, Müller and Seidel (2008) on inverted lists, as printed.

Line by line and in its letters; the place to read how the method works.

Two things differ from the print: after the end of a list the intersection is empty (line
11 reads past it), and a query of one keyframe returns its segments.

Conventions: segments [s : t] include both ends; frames and pointers count from 0.
"""

import math
from typing import NamedTuple

import numpy as np


class Segment(NamedTuple):
    """Frames s to t, both included; t may be infinite."""

    s: int
    t: float

    def __and__(self, other):
        """The intersection, eq. (7); None where it is empty."""
        if self.t < other.s or other.t < self.s:
            return None
        return Segment(max(self.s, other.s), min(self.t, other.t))


class Match(NamedTuple):
    """A segment of every list that together hold at least one hit.

    Attributes
    ----------
    pointers : p_1 to p_K, the segments by their number
    hit_range : R(M), from the first frame of its first hit to the last frame of its last
    """

    pointers: tuple[int, ...]
    hit_range: Segment


def inverted_lists(packed, known=None):
    """L(v): the frames of one document that show each vector of features, in ascending order.

    packed, known: arrays (frames, integers), uint64. Vectors of which different features are
    known are different vectors; the key holds both.
    """
    masks = np.full_like(packed, ~np.uint64(0)) if known is None else known
    index = {}
    for n, row in enumerate(np.concatenate([packed, masks], axis=1)):
        index.setdefault(row.tobytes(), []).append(n)
    return index


def keyframe_lists(values, fixed, index):
    """Λ_1 to Λ_K, eqs (3) and (4): frames that show each keyframe, as maximal runs.

    values, fixed: arrays (K, integers), uint64; index: of `inverted_lists`.
    """
    lists = []
    for v, mask in zip(values, fixed, strict=True):
        frames = []
        for key, L in index.items():
            vector, known = np.frombuffer(key, dtype=np.uint64).reshape(2, -1)
            # The index holds the vectors that occur; those in V_k agree in what is fixed.
            if not (((vector ^ v) | ~known) & mask).any():
                frames += L
        lists.append(_runs(sorted(frames)))
    return lists


def keyframe_based_search(lists, gaps):
    """Procedure KEYFRAMEBASEDSEARCH: hit ranges and matches.

    lists: Λ_1 to Λ_K of one document; gaps: pairs (least, most) between neighbouring
    keyframes, that is μ_1 to μ_(K-1), most None = no bound.

    The hit ranges are the union of those of all matches, as maximal segments. The matches
    are those that the algorithm visits; it leaves out irrelevant ones, whose ranges add
    nothing to the union.
    """
    K = len(lists)
    p = [0] * K
    matches = []
    intersections = [Segment(0, 0)] * K

    def current(k, admissible):
        return lists[k][p[k]] & admissible if p[k] < len(lists[k]) else None

    def recursive_search(k, admissible):
        while p[k] < len(lists[k]) and lists[k][p[k]].t < admissible.s:
            p[k] += 1
        pointer_incremented = False
        intersection = current(k, admissible)
        while intersection is not None:
            intersections[k] = intersection
            if k == K - 1:
                matches.append(Match(tuple(p), _hit_range(intersections, gaps)))
            else:
                recursive_search(k + 1, mu(intersection, gaps[k]))
            p[k] += 1
            pointer_incremented = True
            intersection = current(k, admissible)
        if pointer_incremented:
            p[k] -= 1

    for p_1, segment in enumerate(lists[0]):
        p[0], intersections[0] = p_1, segment
        if K == 1:
            matches.append(Match((p_1,), segment))
        else:
            recursive_search(1, mu(segment, gaps[0]))
    return union(match.hit_range for match in matches), matches


def mu(segment, gap):
    """μ_k, eq. (9): where the next keyframe may lie when this one lies in the segment."""
    least, most = gap
    return Segment(segment.s + least, math.inf if most is None else segment.t + most)


def union(segments):
    """The frames of all segments, as maximal runs."""
    merged = []
    for s, t in sorted(segments):
        if merged and s <= merged[-1].t + 1:
            merged[-1] = Segment(merged[-1].s, max(merged[-1].t, t))
        else:
            merged.append(Segment(s, t))
    return merged


def _hit_range(intersections, gaps):
    """R(M): the last intersection ends it; its beginning follows by going back."""
    back = intersections[-1]
    for segment, (least, most) in zip(reversed(intersections[:-1]), reversed(gaps), strict=True):
        earliest = -1 if most is None else back.s - most
        back = Segment(max(segment.s, earliest), min(segment.t, back.t - least))
    return Segment(back.s, intersections[-1].t)


def _runs(frames):
    return union(Segment(n, n) for n in frames)
