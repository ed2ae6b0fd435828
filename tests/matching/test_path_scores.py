"""Paths and scores against their definition, and what must hold."""

import numpy as np
import pytest

from matching_cases import random_rows, same_bits, words_and_mask
from motionary.errors import InvalidInput
from motionary.matching import Pattern, concatenate, corpus_distance, distance_function
from motionary.matching.path_scores import (
    GRAIN,
    CellRatios,
    PathScoreSettings,
    cell_ratios,
    explain_scores,
    find_paths,
    find_paths_to,
    minima_ends,
    score_patterns,
)
from motionary.packing import full_mask, pack
from oracles import path_scores as oracle

ALL = PathScoreSettings(most_cost=2.0, least_score=-1e6)


class Case:
    """A template of values with free cells, its pattern, and a recording."""

    def __init__(self, seed, *, n_features=40, unknown=0.1, weighed=False, n_frames=45):
        rng = np.random.default_rng(seed)
        n_columns = int(rng.integers(1, 9))
        self.columns = random_rows(rng, n_columns, n_features, share_none=0.2)
        packed, fixed = words_and_mask(self.columns, n_features)
        self.weights = rng.uniform(0.5, 2, n_columns)
        self.entries = rng.choice([0, 0.5, 1], (n_columns, n_features)) if weighed else None
        self.pattern = Pattern(packed, fixed, self.weights, self.entries)
        self.values = rng.random((n_columns, n_features)).round(1)
        self.prior = rng.random(n_features)
        self.n_examples = int(rng.integers(1, 9))
        self.ratios = cell_ratios(self.values, self.prior, n_examples=self.n_examples)
        # Motion often stays the same, so that minima last.
        rows = random_rows(rng, n_frames, n_features, share_none=unknown)
        self.recording = [rows[i] for i in np.sort(rng.integers(0, n_frames, n_frames))]
        self.packed, self.known = words_and_mask(self.recording, n_features)
        self.n_features = n_features

    def costs(self):
        entries = [None] * len(self.columns) if self.entries is None else self.entries
        return np.array(
            [
                [oracle.cell_cost(column, f, weight=w, entries=e) for f in self.recording]
                for column, w, e in zip(self.columns, self.weights, entries, strict=True)
            ],
            dtype=np.float32,
        )

    def oracle_parts(self, frames):
        cells = oracle.ratio_cells(self.values, self.prior, self.n_examples)
        return oracle.parts(cells, frames, self.recording, n_features=self.n_features)


CASES = [
    {},
    {"unknown": 0.0},
    {"unknown": 0.7},
    {"n_features": 5},
    {"n_features": 70},
    {"n_features": 64, "weighed": True},
]


def large_case(seed=0, *, n_frames=40_000, n_patterns=4, n_features=40):
    """Patterns cut from a long recording in which some features are unknown for a while."""
    rng = np.random.default_rng(seed)
    flips = rng.random((n_frames, n_features)) < 0.02
    features = np.cumsum(flips, axis=0) % 2
    known = np.ones(features.shape, dtype=bool)
    known[n_frames // 3 : n_frames // 2, ::3] = False
    known[:, 7] = False
    packed, mask = pack(features), pack(known)
    patterns, ratios = [], []
    for i in range(n_patterns):
        part = slice(300 * i, 300 * i + 20 + 7 * i)
        noise = rng.random((20 + 7 * i, n_features))
        fixed = pack(noise < 0.5)
        patterns.append(Pattern(packed[part], fixed, rng.uniform(0.75, 1.5, len(fixed))))
        values = np.where(noise < 0.7, features[part], 0.5)
        ratios.append(cell_ratios(values, features.mean(axis=0), n_examples=5))
    return patterns, ratios, packed & mask, mask


@pytest.mark.parametrize("kind", CASES, ids=str)
def test_paths_are_the_cheapest_ones(kind):
    for seed in range(4):
        case = Case(seed, **kind)
        distance = distance_function(case.pattern, case.packed, case.known, engine="numpy")
        paths = find_paths(case.pattern, case.packed, case.known, settings=ALL)
        assert paths.ends.tolist() == oracle.minima_ends(distance, threshold=2.0)
        assert same_bits(paths.costs, distance[paths.ends])
        cost = case.costs()
        # Costs of one integer and equal entries are single precision from the first.
        exact = case.entries is None and case.n_features <= 64
        for frames, end in zip(paths.frames, paths.ends.tolist(), strict=True):
            met = np.flatnonzero(frames >= 0)
            times = np.diff(met, prepend=-1)
            assert (cost[met, frames[met]] * times).sum() / len(frames) == pytest.approx(
                distance[end], abs=1e-5
            )
            if exact:
                total, expected = oracle.best_path(cost, end)
                assert total == distance[end]
                assert frames.tolist() == expected


@pytest.mark.parametrize("kind", CASES, ids=str)
def test_scores_are_the_sums_of_what_cells_tell(kind):
    for seed in range(4):
        case = Case(seed, **kind)
        paths = find_paths(case.pattern, case.packed, case.known, settings=ALL)
        parts = explain_scores(case.ratios, paths, case.packed, case.known)
        expected = np.array([case.oracle_parts(frames) for frames in paths.frames])
        np.testing.assert_allclose(parts, expected.reshape(parts.shape), rtol=0, atol=1e-4)
        scored = score_patterns(
            [case.pattern], [case.ratios], case.packed, case.known, settings=ALL, engine="numpy"
        )
        np.testing.assert_allclose(scored.scores, parts.sum(axis=1), rtol=0, atol=1e-9)
        assert scored.starts.tolist() == paths.starts.tolist()
        assert scored.stops.tolist() == (paths.ends + 1).tolist()
        assert same_bits(scored.costs, paths.costs)


def test_ratios_are_those_of_the_definition():
    case = Case(3)
    cells = oracle.ratio_cells(case.values, case.prior, case.n_examples)
    for k in range(len(case.values)):
        for j in range(case.n_features):
            own = case.ratios.if_one[k, j] * GRAIN, case.ratios.if_zero[k, j] * GRAIN
            assert own == cells.get((k, j), (0.0, 0.0))
    assert case.ratios.scale == pytest.approx(sum(max(c) for c in cells.values()) ** 0.5)


def test_who_holds_the_posture_gains_less_than_who_moves():
    steady, moving = np.full((10, 1), 0.9), np.repeat([0.1, 0.9], 5)[:, np.newaxis]
    prior = np.array([0.5])
    still, moves = (cell_ratios(v, prior, n_examples=9) for v in (steady, moving))
    assert still.if_one[-1, 0] < moves.if_one[-1, 0]


@pytest.mark.parametrize("least", [-1e6, 0.0, 2.0, 6.0])
def test_paths_that_tell_too_little_are_left_out_and_no_others(least):
    patterns, ratios, packed, known = large_case()
    every, some = (
        score_patterns(
            patterns, ratios, packed, known, engine="numpy",
            settings=PathScoreSettings(most_cost=0.5, least_score=value),
        )
        for value in (-1e6, least)
    )  # fmt: skip
    enough = every.scores >= least
    assert np.count_nonzero(enough) > 0
    for a, b in zip(every, some, strict=True):
        assert same_bits(a[enough], b)


@pytest.mark.parametrize("kind", CASES, ids=str)
def test_the_compiled_twin_gives_the_same_bits(kind):
    for seed in range(3):
        case = Case(seed, **kind)
        for known in (case.known, None):
            found = [
                score_patterns(
                    [case.pattern], [case.ratios], case.packed, known,
                    settings=ALL, engine=engine,
                )
                for engine in ("numpy", "compiled")
            ]  # fmt: skip
            assert all(same_bits(a, b) for a, b in zip(*found, strict=True))


def test_the_compiled_twin_gives_the_same_bits_over_many_tiles():
    patterns, ratios, packed, known = large_case()
    found = [
        score_patterns(
            patterns, ratios, packed, known,
            engine=engine, settings=PathScoreSettings(least_score=-5.0),
        )
        for engine in ("numpy", "compiled")
    ]  # fmt: skip
    assert len(found[0].scores) > 100
    assert all(same_bits(a, b) for a, b in zip(*found, strict=True))
    # Padding at, before and behind the borders of tiles.
    parts = [slice(0, 1022), slice(1022, 5000), slice(5000, 32763), slice(32763, 40_000)]
    pieces = ([rows[part] for part in parts] for rows in (packed, known))
    corpus = concatenate(*pieces, full=full_mask(1, 40)[0])
    one, other = (
        corpus_distance(patterns[0], corpus, engine=engine) for engine in ("numpy", "compiled")
    )
    assert same_bits(one, other)
    assert np.isinf(one[corpus.blocked]).all()


@pytest.mark.parametrize("mask", ["none", "one for all frames", "now and then"])
def test_patterns_together_score_as_each_alone(mask):
    patterns, ratios, packed, known = large_case(n_frames=3000)
    known = {"none": None, "one for all frames": np.full_like(known, known[1500])}.get(mask, known)
    # Patterns that begin with another's columns, the same twice, and one with entry weights.
    long, ratio = patterns[3], ratios[3]
    for n in (1, 30, len(long)):
        patterns.append(Pattern(long.values[:n], long.fixed[:n], long.weights[:n]))
        ratios.append(CellRatios(ratio.if_one[:n], ratio.if_zero[:n]))
    entries = np.random.default_rng(0).random((30, 40))
    patterns.insert(2, Pattern(long.values[:30], long.fixed[:30], long.weights[:30], entries))
    ratios.insert(2, ratios[-2])
    settings = PathScoreSettings(most_cost=0.5, least_score=-5.0)
    together = score_patterns(patterns, ratios, packed, known, settings=settings, engine="numpy")
    assert np.bincount(together.patterns).min() > 0
    for i, (pattern, ratio) in enumerate(zip(patterns, ratios, strict=True)):
        alone = score_patterns([pattern], [ratio], packed, known, settings=settings, engine="numpy")
        own = together.patterns == i
        assert all(same_bits(a[own], b) for a, b in zip(together[1:], alone[1:], strict=True))


def test_paths_to_given_ends_are_those_of_all_ends():
    patterns, _, packed, known = large_case()
    for pattern in patterns:
        paths = find_paths(pattern, packed, known)
        some = np.arange(0, len(paths.costs), 17)
        alone = find_paths_to(pattern, packed, known, paths.ends[some].astype(np.intp))
        assert same_bits(alone.frames, paths.frames[some])
        assert same_bits(alone.costs, paths.costs[some])


def test_a_recording_told_as_fully_known_scores_as_without_a_mask():
    case = Case(1, unknown=0.0)
    mask = full_mask(len(case.packed), 40)
    a, b = (
        score_patterns([case.pattern], [case.ratios], case.packed, known, settings=ALL)
        for known in (mask, None)
    )
    assert all(same_bits(x, y) for x, y in zip(a, b, strict=True))


def test_sums_beyond_single_precision_stay_exact():
    case = Case(2, unknown=0.1)
    big = CellRatios(case.ratios.if_one * 900, case.ratios.if_zero * 900)
    settings = PathScoreSettings(most_cost=2.0, least_score=-1e6, floor=-1e6)
    scores, times = (
        score_patterns(
            [case.pattern], [r], case.packed, case.known, settings=settings, engine="numpy"
        ).scores * r.scale / GRAIN
        for r in (case.ratios, big)
    )  # fmt: skip
    assert len(scores)
    assert np.rint(times).tolist() == (900 * np.rint(scores)).tolist()


def test_nothing_gives_nothing():
    case = Case(1)
    empty = score_patterns([case.pattern], [case.ratios], case.packed[:0], case.known[:0])
    assert [len(part) for part in empty] == [0] * 5
    assert [len(part) for part in score_patterns([], [], case.packed)] == [0] * 5
    assert len(find_paths(case.pattern, case.packed[:0]).frames) == 0


def test_what_does_not_fit_is_refused():
    case, other = Case(1), Case(1, n_features=70)
    longer = CellRatios(np.zeros((99, 40), np.int32), np.zeros((99, 40), np.int32))
    with pytest.raises(InvalidInput, match="needs its ratios"):
        score_patterns([case.pattern], [], case.packed)
    with pytest.raises(InvalidInput, match="its own template"):
        score_patterns([case.pattern], [longer], case.packed)
    with pytest.raises(InvalidInput, match="one feature set"):
        score_patterns([case.pattern] * 2, [case.ratios, other.ratios], case.packed)
    with pytest.raises(InvalidInput, match="a prior"):
        cell_ratios(case.values, case.prior[:3], n_examples=1)
    with pytest.raises(InvalidInput, match="no path"):
        find_paths_to(case.pattern, case.packed, None, np.array([len(case.packed)]))


def test_minima_that_last_have_ends_every_four_frames():
    rng = np.random.default_rng(4)
    for _ in range(50):
        distance = rng.integers(0, 4, 60).astype(np.float32).repeat(rng.integers(1, 7, 60))
        expected = oracle.minima_ends(distance, threshold=2)
        assert minima_ends(distance, threshold=2).tolist() == expected
