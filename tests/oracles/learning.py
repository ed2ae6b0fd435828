"""Learning of motion templates, transcribed from Müller and Röder (2006), section 4.1.

One example at a time, one cell at a time. An example is a pair: a list of columns (arrays)
and a list of weights.
"""

import math

import numpy as np


def learn(matrices, *, stop=0.005, max_passes=10):
    """Columns and weights of the template."""
    examples = [([np.array(c, float) for c in m], [1.0] * len(m)) for m in matrices]
    before = None
    for _ in range(max_passes):
        total = sum(sum(weights) for _, weights in examples) / len(examples)
        examples, highest_cost = one_pass(examples)
        if highest_cost / total <= stop or highest_cost == before:
            break
        before = highest_cost
    return examples[0]


def one_pass(examples):
    """Every example as the reference of all, and the cost of the dearest path."""
    results, costs = [], [0.0]
    for reference in examples:
        warped = []
        for example in examples:
            if example is reference:
                warped.append(reference)
                continue
            path, cost = align(reference, example)
            costs.append(cost)
            warped.append(warp(example, path, len(reference[0])))
        results.append(unwarp(average(warped)))
    return results, max(costs)


def align(reference, example):
    """Cheapest path as pairs (column of the reference, column of the example)."""
    (R, wR), (W, wW) = reference, example

    def local(r, w):
        distance = 0.0
        for a, b in zip(R[r], W[w], strict=True):
            distance += abs(a - b)
        return distance * ((wR[r] + wW[w]) / 2)

    total = {(-1, -1): 0.0}

    def cheapest(r, w):
        return total.get((r, w), math.inf)

    for r in range(len(R)):
        for w in range(len(W)):
            before = min(cheapest(r - 1, w - 1), cheapest(r, w - 1), cheapest(r - 1, w))
            total[r, w] = local(r, w) + before
    here = (len(R) - 1, len(W) - 1)
    path = []
    while here != (-1, -1):
        path.append(here)
        r, w = here
        # min keeps the first of equals: diagonal, example only, reference only.
        here = min((r - 1, w - 1), (r, w - 1), (r - 1, w), key=lambda cell: cheapest(*cell))
    return path[::-1], total[len(R) - 1, len(W) - 1]


def warp(example, path, n_columns):
    """The example with the columns of the reference."""
    W, weights = example
    columns, sums = [], []
    for k in range(n_columns):
        column, weight = 0.0, 0.0
        for w in [w for r, w in path if r == k]:
            met = len([r for r, other in path if other == w])
            column = column + W[w] * (weights[w] / met)
            weight += weights[w] / met
        columns.append(column / weight)
        sums.append(weight)
    return columns, sums


def average(warped):
    """Average by weight, and arithmetic mean of the weights."""
    columns, means = [], []
    for k in range(len(warped[0][0])):
        total = sum(weights[k] for _, weights in warped)
        columns.append(sum(W[k] * weights[k] for W, weights in warped) / total)
        means.append(total / len(warped))
    return columns, means


def unwarp(example):
    return expand(contract(expand(example)))


def expand(example):
    columns, weights = [], []
    for column, weight in zip(*example, strict=True):
        n = max(1, math.floor(weight + 0.5))
        columns += [column] * n
        weights += [weight / n] * n
    return columns, weights


def contract(example):
    columns, weights, open_ = [], [], False
    for column, weight in zip(*example, strict=True):
        if open_:
            merge(columns, weights, column, weight)
        else:
            columns.append(column)
            weights.append(weight)
        open_ = weights[-1] < 0.75
    if open_ and len(columns) > 1:
        merge(columns, weights, columns.pop(), weights.pop())
    return columns, weights


def merge(columns, weights, column, weight):
    total = weights[-1] + weight
    columns[-1] = (columns[-1] * weights[-1] + column * weight) / total
    weights[-1] = total


def quantise(value, tolerance):
    """0, 1 or None for free, of an exact fraction."""
    if value <= tolerance:
        return 0
    if value >= 1 - tolerance:
        return 1
    return None
