"""Measures by their definitions: slow, one frame, pair or order at a time.

A segment is a tuple (name, start, end, cost); a table is a list of them.
"""

import itertools
import math


def frame_pairs(table, rate, n_frames):
    """The set of (frame, class): thesis eqs 5.8 and 5.9."""
    return {
        (i, name)
        for i in range(n_frames)
        for name, start, end, _ in table
        if start <= (i + 0.5) / rate < end
    }


def frame_rates(predicted, truth, rate, n_frames):
    """Thesis eqs 5.10 to 5.12."""
    a, m = frame_pairs(predicted, rate, n_frames), frame_pairs(truth, rate, n_frames)
    return rates(len(a & m), len(a), len(a & m), len(m))


def rates(correct, n_predicted, found, n_true):
    if n_predicted == n_true == 0:
        return 1.0, 1.0, 1.0
    precision = correct / n_predicted if n_predicted else 0.0
    recall = found / n_true if n_true else 0.0
    if precision + recall == 0:
        return precision, recall, 0.0
    return precision, recall, 2 * precision * recall / (precision + recall)


def confusion(predicted, truth, rate, n_frames, names):
    """Dict of (true or None, predicted or None) to frames."""
    a, m = frame_pairs(predicted, rate, n_frames), frame_pairs(truth, rate, n_frames)
    counts = {(t, p): 0 for t in [*names, None] for p in [*names, None]}
    for i in range(n_frames):
        claimed = {name for j, name in a if j == i}
        real = {name for j, name in m if j == i}
        if not claimed and not real:
            counts[None, None] += 1
            continue
        for name in claimed & real:
            counts[name, name] += 1
        missed, surplus = real - claimed, claimed - real
        if missed or surplus:
            for t, p in itertools.product(missed or {None}, surplus or {None}):
                counts[t, p] += 1
    return counts


def common(a, b):
    return max(0.0, min(a[2], b[2]) - max(a[1], b[1]))


def iou(a, b):
    return common(a, b) / ((a[2] - a[1]) + (b[2] - b[1]) - common(a, b))


def segment_rates(predicted, truth):
    """P2, R2, F2: any overlap with one of the same class."""
    correct = sum(any(p[0] == t[0] and common(p, t) > 0 for t in truth) for p in predicted)
    found = sum(any(p[0] == t[0] and common(p, t) > 0 for p in predicted) for t in truth)
    return rates(correct, len(predicted), found, len(truth))


def segment_f(predicted, truth, least):
    """Lea et al. (2017): in order of time, the best true one, if it is still free."""
    used = set()
    right = 0
    truth = sorted(truth)
    for p in sorted(predicted):
        scores = [iou(p, t) if p[0] == t[0] else 0.0 for t in truth]
        if scores:
            best = scores.index(max(scores))
            if scores[best] >= least and best not in used:
                used.add(best)
                right += 1
    return rates(right, len(predicted), right, len(truth))[2]


def levenshtein(a, b):
    if not a or not b:
        return len(a) + len(b)
    if a[-1] == b[-1]:
        return levenshtein(a[:-1], b[:-1])
    return 1 + min(levenshtein(a[:-1], b), levenshtein(a, b[:-1]), levenshtein(a[:-1], b[:-1]))


def order(table):
    return [s[0] for s in sorted(table, key=lambda s: (s[1], s[2], s[0]))]


def edits(predicted, truth, tolerance):
    """Cheapest way to correct the first prediction, then the rest."""
    if not predicted:
        return len(truth)
    first, rest = predicted[0], predicted[1:]
    costs = [1 + edits(rest, truth, tolerance)]
    for j, t in enumerate(truth):
        corrections = first[0] != t[0]
        corrections += abs(first[1] - t[1]) > tolerance
        corrections += abs(first[2] - t[2]) > tolerance
        costs.append(corrections + edits(rest, truth[:j] + truth[j + 1 :], tolerance))
    return min(costs)


def boundary_distances(predicted, truth, least):
    """Ends of pairs of one class, best overlap first."""
    left, open_ = list(predicted), list(truth)
    distances = []
    while True:
        pairs = [(-iou(p, t), p[1:3], t[1:3], p, t) for p in left for t in open_ if p[0] == t[0]]
        pairs = [pair for pair in pairs if -pair[0] >= least]
        if not pairs:
            return distances
        *_, p, t = min(pairs)
        distances += [abs(p[1] - t[1]), abs(p[2] - t[2])]
        left.remove(p)
        open_.remove(t)


def detection_average_precision(documents, name, least):
    """Mean over true segments of the best precision with at least so many found."""
    flags = []
    n_true = 0
    for predicted, truth in documents:
        free = sorted(t for t in truth if t[0] == name)
        n_true += len(free)
        claimed = [p for p in predicted if p[0] == name and p[3] < math.inf]
        for p in sorted(claimed, key=lambda p: (p[3], p[1], p[2])):
            match = max(free, key=lambda t: iou(p, t), default=None)
            right = match is not None and iou(p, match) >= least
            if right:
                free.remove(match)
            flags.append((p[3], right))
    if n_true == 0:
        return math.nan
    flags.sort()  # equal cost: wrong ones first
    right = [flag for _, flag in flags]
    points = [(sum(right[:k]), sum(right[:k]) / k) for k in range(1, len(right) + 1)]
    best = [
        max((precision for found, precision in points if found >= n), default=0.0)
        for n in range(1, n_true + 1)
    ]
    return sum(best) / n_true


def possible_orders(costs, relevant):
    """Every order of the retrieved items by rising cost, as lists of relevance."""
    items = [(c, r) for c, r in zip(costs, relevant, strict=True) if c < math.inf]
    for permutation in set(itertools.permutations(items)):
        if all(a[0] <= b[0] for a, b in itertools.pairwise(permutation)):
            yield [r for _, r in permutation]


def average_precision(costs, relevant):
    """The worst of all orders that the costs allow."""
    total = sum(relevant)
    return min(
        sum(sum(ranked[: k + 1]) / (k + 1) for k, r in enumerate(ranked) if r) / total
        for ranked in possible_orders(costs, relevant)
    )


def r_precision(costs, relevant):
    total = sum(relevant)
    return min(sum(ranked[:total]) / total for ranked in possible_orders(costs, relevant))


def bootstrap_means(values_by_group):
    """Means of all ways to draw as many groups as there are."""
    groups = list(values_by_group.values())
    means = []
    for drawn in itertools.product(groups, repeat=len(groups)):
        values = [value for group in drawn for value in group]
        means.append(sum(values) / len(values))
    return sorted(means)
