"""How does the published algorithm find keyframes?

Algorithm 1 of Baak, Müller and Seidel (2008) on inverted lists, line by line and in its
letters. `search` is what one uses; this is what it is held against, and the place to read
how the method works.

Two things differ from the print: after the end of a list the intersection is empty (line
11 reads past it), and a query of one keyframe returns its segments.

Conventions: segments [s : t] include both ends; frames and pointers count from 0.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from motionary.models.keyframes.query import Gap, KeyframeQuery
from motionary.packing import PackedFeatures


class Segment(NamedTuple):
    """Frames s to t, both included; t may be infinite."""

    s: int
    t: float

    def __and__(self, other: "Segment") -> "Segment | None":
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


def inverted_lists(
    packed: PackedFeatures, known: PackedFeatures | None = None
) -> dict[bytes, list[int]]:
    """L(v): the frames of one document that show each word, in ascending order.

    Words of which different relations are known are different words; the key holds both.
    """
    masks = np.full_like(packed, ~np.uint64(0)) if known is None else known
    index: dict[bytes, list[int]] = {}
    for n, row in enumerate(np.concatenate([packed, masks], axis=1)):
        index.setdefault(row.tobytes(), []).append(n)
    return index


def keyframe_lists(query: KeyframeQuery, index: dict[bytes, list[int]]) -> list[list[Segment]]:
    """Λ_1 to Λ_K, eqs (3) and (4): frames that show each keyframe, as maximal runs."""
    lists = []
    for value, fixed in zip(query.values, query.fixed, strict=True):
        frames: list[int] = []
        for key, L in index.items():
            word, known = np.frombuffer(key, dtype=np.uint64).reshape(2, -1)
            # The index holds the words that occur; those in V_k agree in what is fixed.
            if not (((word ^ value) | ~known) & fixed).any():
                frames += L
        lists.append(_runs(sorted(frames)))
    return lists


def keyframe_based_search(
    lists: Sequence[Sequence[Segment]], gaps: Sequence[Gap]
) -> tuple[list[Segment], list[Match]]:
    """Procedure KEYFRAMEBASEDSEARCH.

    Parameters
    ----------
    lists : Λ_1 to Λ_K of one document
    gaps : bounds between neighbouring keyframes, that is μ_1 to μ_(K-1)

    Returns
    -------
    hit_ranges : union of the hit ranges of all matches, as maximal segments
    matches : those that the algorithm visits; it leaves out irrelevant ones, whose ranges
        add nothing to the union
    """
    K = len(lists)
    p = [0] * K
    matches: list[Match] = []
    intersections: list[Segment] = [Segment(0, 0)] * K

    def current(k: int, admissible: Segment) -> Segment | None:
        return lists[k][p[k]] & admissible if p[k] < len(lists[k]) else None

    def recursive_search(k: int, admissible: Segment) -> None:
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


def mu(segment: Segment, gap: Gap) -> Segment:
    """μ_k, eq. (9): where the next keyframe may lie when this one lies in the segment."""
    return Segment(segment.s + gap.least, math.inf if gap.most is None else segment.t + gap.most)


def union(segments: Iterable[Segment]) -> list[Segment]:
    """The frames of all segments, as maximal runs."""
    merged: list[Segment] = []
    for s, t in sorted(segments):
        if merged and s <= merged[-1].t + 1:
            merged[-1] = Segment(merged[-1].s, max(merged[-1].t, t))
        else:
            merged.append(Segment(s, t))
    return merged


def _hit_range(intersections: Sequence[Segment], gaps: Sequence[Gap]) -> Segment:
    """R(M): the last intersection ends it; its beginning follows by going back."""
    back = intersections[-1]
    for segment, gap in zip(reversed(intersections[:-1]), reversed(gaps), strict=True):
        earliest = -1 if gap.most is None else back.s - gap.most
        back = Segment(max(segment.s, earliest), min(segment.t, back.t - gap.least))
    return Segment(back.s, intersections[-1].t)


def _runs(frames: Sequence[int]) -> list[Segment]:
    return union(Segment(n, n) for n in frames)
