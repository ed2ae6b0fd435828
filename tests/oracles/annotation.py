"""Annotation from the matches of each class, written down as it is defined.

Müller, Baak and Seidel (2009), section 4. A match is (first frame, last frame, cost), a
modified distance function a list with one cost a frame, infinite where no match is.
Classes are counted from 0; a frame without one has None. Segments are half-open.
"""

from itertools import pairwise
from math import inf


def modified_distance(matches, n_frames):
    """Least cost of the matches that cover each frame."""
    return [
        min((cost for first, last, cost in matches if first <= frame <= last), default=inf)
        for frame in range(n_frames)
    ]


def labels(distances):
    """Class of least cost at each frame, the smallest number of several; eqs. 3 and 4."""
    chosen = []
    for costs in zip(*distances, strict=True):
        least = min(costs)
        chosen.append(None if least == inf else costs.index(least))
    return chosen


def runs(chosen):
    """Longest stretches of one class: (class, start, stop)."""
    found = []
    for frame, number in enumerate(chosen):
        if number is None:
            continue
        if found and found[-1][0] == number and found[-1][2] == frame:
            found[-1] = (number, found[-1][1], frame + 1)
        else:
            found.append((number, frame, frame + 1))
    return found


def extend(distance, start, stop):
    """Smallest r and largest u between which the distance leads down and away."""
    s, t = start, stop - 1
    r = min(r for r in range(s + 1) if never_rises(distance[r : s + 1][::-1]))
    u = max(u for u in range(t, len(distance)) if never_rises(distance[t : u + 1]))
    return r, u + 1


def never_rises(values):
    """Whether no value is above the one before it; infinite frames end a walk."""
    pairs = pairwise(values)
    return inf not in values and all(after <= before for before, after in pairs)


def segments(distances):
    """Extended runs; what touches or overlaps within a class is one."""
    n_frames = len(distances[0]) if distances else 0
    covered = [[False] * n_frames for _ in distances]
    for number, start, stop in runs(labels(distances)):
        first, end = extend(distances[number], start, stop)
        for frame in range(first, end):
            covered[number][frame] = True
    found = [
        (number, start, stop)
        for number, frames in enumerate(covered)
        for _, start, stop in runs([0 if inside else None for inside in frames])
    ]
    return sorted(found, key=lambda s: (s[1], s[2], s[0]))
