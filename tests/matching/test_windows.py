"""Windows are where the definition puts them, however they are laid out."""

import numpy as np
import pytest

from motionary.matching import concatenate
from motionary.matching.corpus import (
    FeatureWindow,
    thin,
    window_distance,
    window_path,
)
from motionary.packing import full_mask, pack

N = 70
FULL = full_mask(1, N)[0]
HEAVY = pack(np.arange(N)[np.newaxis] >= 60)[0]


def cell(example, seen, target, known, weights):
    both = seen & known
    if (both * weights).sum() < 0.5 * (seen * weights).sum():
        return 1.0
    return ((example != target) & both) @ weights / (both @ weights)


def cheapest(cost, k, n):
    """Least total of a path that ends in a cell: by its definition."""
    if k < 0 or n < 0:
        return np.inf
    if k == 0:
        return cost[0, n]
    ways = [(1, 1), (1, 2), (1, 3), (2, 1), (3, 1)]
    return min(cheapest(cost, k - a, n - b) + a * cost[k, n] for a, b in ways)


def case(seed, *, with_gaps):
    rng = np.random.default_rng(seed)
    sequences = [rng.random((n, N)) < 0.5 for n in (40, 3, 25)]
    masks = [rng.random((len(s), N)) < (0.6 if with_gaps else 2) for s in sequences]
    corpus = concatenate([pack(s & m) for s, m in zip(sequences, masks, strict=True)],
                         [pack(m) for m in masks], full=FULL)  # fmt: skip
    example = rng.random((6, N)) < 0.5
    seen = rng.random((6, N)) < (0.8 if with_gaps else 2)
    window = FeatureWindow(pack(example & seen), pack(seen), HEAVY, extra=1.5)
    return sequences, masks, example, seen, window, thin(corpus, full=FULL)


@pytest.mark.parametrize("with_gaps", [False, True])
@pytest.mark.parametrize("seed", range(2))
def test_the_distance_is_that_of_the_definition(seed, with_gaps):
    sequences, masks, example, seen, window, corpus = case(seed, with_gaps=with_gaps)
    weights = np.where(np.arange(N) >= 60, 2.5, 1.0)
    distance = window_distance(window, corpus)
    assert np.isinf(distance[corpus.blocked]).all()
    for number, (rows, known) in enumerate(zip(sequences, masks, strict=True)):
        cost = np.array([
            [cell(a, m, b, k, weights) for b, k in zip(rows[::3], known[::3], strict=True)]
            for a, m in zip(example, seen, strict=True)
        ])  # fmt: skip
        expected = [cheapest(cost, 5, n) / 6 for n in range(cost.shape[1])]
        start, length = corpus.starts[number], corpus.lengths[number]
        assert distance[start : start + length] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_a_path_costs_what_its_end_says(seed):
    sequences, masks, example, seen, window, corpus = case(seed, with_gaps=True)
    weights = np.where(np.arange(N) >= 60, 2.5, 1.0)
    distance = window_distance(window, corpus)
    end = int(np.argmin(np.where(np.isfinite(distance), distance, np.inf)))
    number = int(np.searchsorted(corpus.starts, end, side="right")) - 1
    start = int(corpus.starts[number])
    path = window_path(window, corpus, start, end) - start
    assert path[-1] == end - start
    assert (np.diff(path) >= 0).all()
    assert (np.diff(path) <= 3).all()
    rows, known = sequences[number][::3], masks[number][::3]
    # A column that is left out counts as the next one, which meets the same frame.
    counts = [max(np.flatnonzero(path == n)) for n in path]
    total = sum(cell(example[k], seen[k], rows[n], known[n], weights)
                for k, n in zip(counts, path, strict=True))  # fmt: skip
    assert total / 6 == pytest.approx(distance[end], rel=1e-5)


def test_long_corpora_are_matched_as_short_ones(monkeypatch):
    *_, window, corpus = case(5, with_gaps=True)
    whole = window_distance(window, corpus)
    monkeypatch.setattr("motionary.matching.corpus._TILE", 4)
    assert np.array_equal(window_distance(window, corpus), whole)
