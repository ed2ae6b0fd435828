"""Masked subsequence DTW, minima and hits, written down as they are defined.

A column is a list of 0, 1 and None (free), a frame a list of 0, 1 and None (unknown); all
numbers are fractions, so that equal costs are equal.
"""

from fractions import Fraction
from functools import cache
from math import inf

STEPS = ((1, 1), (1, 2), (2, 1))


def cell_cost(column, frame, *, weight, entries=None):
    """Share of the column's fixed and known entries that disagree, times the weight."""
    entries = entries or [1] * len(column)
    fixed = [j for j, value in enumerate(column) if value is not None and entries[j] > 0]
    seen = [j for j in fixed if frame[j] is not None]
    if not fixed:
        return Fraction(0)
    factor = (Fraction(weight) + 1) / 2
    if 2 * len(seen) < len(fixed):
        return factor
    wrong = sum(Fraction(entries[j]) for j in seen if frame[j] != column[j])
    return factor * wrong / sum(Fraction(entries[j]) for j in seen)


def best_matches(cost, *, skip_weight):
    """Cheapest match that ends at each frame: (cost by columns, path), or (inf, None).

    `cost` is a list of rows, one per column. Of equally cheap steps into a cell the first
    of STEPS is taken.
    """
    n_columns, n_frames = len(cost), len(cost[0])

    @cache
    def cheapest(k, i):
        if k < 0 or i < 0:
            return inf, None
        if k == 0:
            return cost[0][i], ((0, i),)
        best = inf, None
        for down, back in STEPS:
            before, path = cheapest(k - down, i - back)
            if path is None:
                continue
            total = before + cost[k][i] * (skip_weight if down == 2 else 1)
            if total < best[0]:
                best = total, (*path, (k, i))
        return best

    matches = [cheapest(n_columns - 1, i) for i in range(n_frames)]
    return [(total / n_columns, path) for total, path in matches]


def local_minima(distance, *, threshold):
    """First frames of plateaus that both neighbours exceed and the threshold does not."""
    found = []
    for i, value in enumerate(distance):
        j = i
        while j < len(distance) and distance[j] == value:
            j += 1
        before = distance[i - 1] if i > 0 else inf
        after = distance[j] if j < len(distance) else inf
        if before > value and after > value and value <= threshold:
            found.append(i)
    return found


def hits(distance, starts, *, threshold, limit):
    """Ranked hits (start, stop, cost); `starts` has the start of the match at each end."""
    taken = []
    for end in sorted(range(len(distance)), key=lambda i: (distance[i], i)):
        if len(taken) == limit:
            break
        if distance[end] > threshold or distance[end] == inf:
            break
        if not any(is_excluded(starts[end], end, hit) for hit in taken):
            taken.append((starts[end], end + 1, distance[end]))
    return taken


def is_excluded(start, end, hit):
    """Whether a match is the hit again, by its end or by its start."""
    first, last = hit[0], hit[1] - 1
    length = last - first + 1
    half, tenth = -(-length // 2), -(-length // 10)
    by_end = last - half <= end <= last + tenth
    by_start = first - tenth <= start <= first + half
    return by_end or by_start
