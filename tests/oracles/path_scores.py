"""Paths and their scores, cell by cell as they are defined."""

import numpy as np

GRAIN = 2.0**-12


def cell_cost(column, frame, *, weight, entries=None):
    """Single-precision cost of a column of 0, 1, None at a frame of 0, 1, None."""
    entries = [1.0] * len(column) if entries is None else entries
    fixed = [j for j, value in enumerate(column) if value is not None and entries[j] > 0]
    seen = [j for j in fixed if frame[j] is not None]
    factor = (weight + 1) / 2
    if 2 * len(seen) < len(fixed):
        return np.float32(factor)
    wrong = sum(entries[j] for j in seen if frame[j] != column[j])
    n = sum(entries[j] for j in seen)
    return np.float32(wrong) * np.float32(factor / n) if n else np.float32(0)


def best_path(cost, end):
    """Cost and frames of the cheapest path to a frame; -1 for a column left out.

    `cost` is a float32 array (columns, frames); sums are single precision, and of steps
    that cost the same the first of (1, 1), (1, 2), (2, 1) is taken.
    """
    known = {}

    def cheapest(k, n):
        if n < 0 or k < 0:
            return np.float32(np.inf), None
        if k == 0:
            return cost[0, n], None
        if (k, n) not in known:
            best, step = cheapest(k - 1, n - 1)[0], (1, 1)
            if cheapest(k - 1, n - 2)[0] < best:
                best, step = cheapest(k - 1, n - 2)[0], (1, 2)
            if k > 1 and cheapest(k - 2, n - 1)[0] + cost[k, n] < best:
                best, step = cheapest(k - 2, n - 1)[0] + cost[k, n], (2, 1)
            known[k, n] = best + cost[k, n], step
        return known[k, n]

    total = cheapest(len(cost) - 1, end)[0] / np.float32(len(cost))
    frames, k, n = [-1] * len(cost), len(cost) - 1, end
    while k > 0 and np.isfinite(total):
        frames[k] = n
        down, back = cheapest(k, n)[1]
        k, n = k - down, n - back
    frames[0] = n
    return total, frames


def ratio_cells(values, prior, n_examples):
    """(if one, if zero) of every cell, multiples of GRAIN; None for a free cell."""
    n_columns, n_features = values.shape
    q = np.clip(prior, 0.01, 0.99)
    p = np.clip((n_examples * values + q) / (n_examples + 1), 0.01, 0.99)
    cells = {}
    for j in range(n_features):
        telling = [k for k in range(n_columns) if values[k, j] != 0.5]
        for k in telling:
            z = np.mean([p[m, j] for m in telling])
            one = np.log(p[k, j] / np.sqrt(q[j] * z))
            zero = np.log((1 - p[k, j]) / np.sqrt((1 - q[j]) * (1 - z)))
            cells[k, j] = round(one / GRAIN) * GRAIN, round(zero / GRAIN) * GRAIN
    return cells


def parts(cells, frames, recording, *, n_features, floor=-2.0):
    """What each feature tells along a path; `recording` has rows of 0, 1, None."""
    scale = sum(max(pair) for pair in cells.values()) ** 0.5 or 1.0
    told = [0.0] * n_features
    for k, frame in enumerate(frames):
        for j in range(n_features):
            if frame >= 0 and (k, j) in cells and recording[frame][j] is not None:
                one, zero = cells[k, j]
                told[j] += one if recording[frame][j] else zero
    return [max(total / scale, floor) for total in told]


def minima_ends(distance, *, threshold, every=4):
    """First, last and every fourth frame of plateaus that both neighbours exceed, or that
    were fallen to and last half a second."""
    found, i = [], 0
    while i < len(distance):
        j = i
        while j + 1 < len(distance) and distance[j + 1] == distance[i]:
            j += 1
        before = distance[i - 1] if i > 0 else np.inf
        after = distance[j + 1] if j + 1 < len(distance) else np.inf
        lasts = j - i + 1 >= 15
        if before > distance[i] and (distance[i] < after or lasts) and distance[i] <= threshold:
            found += sorted({*range(i, j, every), j})
        i = j + 1
    return found
