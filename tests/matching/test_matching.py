"""The distance function and its paths against their definition, and what must hold."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from matching_cases import Case, cases, random_rows, same_bits, words_and_mask
from motionary.matching import (
    MatchState,
    Pattern,
    _compiled,
    _numpy,
    align,
    cell_costs,
    concatenate,
    corpus_distance,
    distance_function,
)
from motionary.packing import full_mask, pack

ENGINES = ["numpy", "compiled"]
TILES = (_compiled._TILE, _numpy._TILE)


def measure(case: Case, *, engine="numpy", known=True, state=None, part=slice(None)):
    mask = case.known[part] if known else None
    return distance_function(
        case.pattern, case.packed[part], mask,
        skip_weight=case.skip_weight, state=state, engine=engine,
    )  # fmt: skip


def large_case(seed, *, n_frames=40_000, n_columns=9, n_features=40, weighed=False):
    """Words that keep for some frames, as recordings do; several tiles long."""
    rng = np.random.default_rng(seed)
    flips = rng.random((n_frames, n_features)) < 0.05
    packed = pack(np.cumsum(flips, axis=0) % 2)
    known = full_mask(n_frames, n_features) & ~pack(rng.random(flips.shape) < 0.1)
    pattern = Pattern(
        packed[100 : 100 + n_columns],
        pack(rng.random((n_columns, n_features)) < 0.8),
        rng.uniform(0.75, 1.5, n_columns),
        rng.exponential(size=(n_columns, n_features)) if weighed else None,
    )
    return pattern, packed, known


@pytest.mark.parametrize("engine", ENGINES)
@given(case=cases())
def test_distance_is_the_cost_of_the_cheapest_match(case, engine):
    expected = np.array([float(cost) for cost, _ in case.oracle_matches()])
    np.testing.assert_allclose(measure(case, engine=engine), expected, rtol=0, atol=1e-5)


@given(cases())
def test_cell_costs_are_the_fractions_that_disagree(case):
    expected = np.array([[float(c) for c in costs] for costs in case.oracle_costs()])
    costs = cell_costs(case.pattern, case.packed, case.known)
    np.testing.assert_allclose(costs, expected, rtol=0, atol=1e-11)


@given(cases())
def test_paths_are_the_cheapest_ones_and_ties_go_to_the_first_step(case):
    matches = case.oracle_matches()
    ends = [i for i, (_, path) in enumerate(matches) if path is not None]
    found = align(case.pattern, case.packed, case.known, ends, skip_weight=case.skip_weight)
    for end, alignment in zip(ends, found, strict=True):
        cost, path = matches[end]
        assert alignment.path.tolist() == [list(cell) for cell in path]
        assert (alignment.start, alignment.end) == (path[0][1], end)
        assert alignment.cost == pytest.approx(float(cost), abs=1e-11)


@given(cases())
def test_a_path_costs_what_its_end_says(case):
    distance = measure(case)
    ends = np.flatnonzero(np.isfinite(distance))
    for alignment in align(
        case.pattern, case.packed, case.known, ends, skip_weight=case.skip_weight
    ):
        path = alignment.path
        steps = np.diff(path, axis=0)
        counts = [1, *np.where(steps[:, 0] == 2, case.skip_weight, 1)]
        total = sum(
            n * cell_costs(case.pattern, case.packed[i], case.known[i])[k]
            for n, (k, i) in zip(counts, path, strict=True)
        )
        assert total / len(case.columns) == pytest.approx(alignment.cost, abs=1e-11)
        assert alignment.cost == pytest.approx(float(distance[alignment.end]), abs=1e-5)


@pytest.mark.parametrize("weighed", [False, True])
@pytest.mark.parametrize("masked", [False, True])
def test_paths_of_many_ends_are_those_of_each_end(weighed, masked):
    pattern, packed, known = large_case(3, n_frames=400, weighed=weighed)
    mask = known if masked else None
    distance = distance_function(pattern, packed, mask)
    ends = np.flatnonzero(np.isfinite(distance))
    together = align(pattern, packed, mask, ends)
    for end, alignment in list(zip(ends, together, strict=True))[::29]:
        alone = align(pattern, packed, mask, [end])[0]
        assert alone[:3] == alignment[:3]
        assert same_bits(alone.path, alignment.path)
        assert alignment.cost == pytest.approx(float(distance[end]), abs=1e-5)


@pytest.mark.parametrize("weighed", [False, True])
def test_paths_since_a_frame_are_those_of_what_follows_it(weighed):
    pattern, packed, known = large_case(5, n_frames=300, weighed=weighed)
    since = np.repeat([0, 60, 61, 200], 20)
    ends = since + np.arange(80) % 20 + len(pattern)
    together = align(pattern, packed, known, ends, since=since)
    for first, end, found in zip(since.tolist(), ends.tolist(), together, strict=True):
        alone = align(pattern, packed[first:], known[first:], [end - first])[0].shifted(first)
        assert alone[:3] == found[:3]
        assert same_bits(alone.path, found.path)


@pytest.mark.parametrize("engine", ENGINES)
@given(case=cases(most_frames=40), sizes=st.lists(st.integers(0, 7), max_size=10))
def test_chunks_give_what_the_whole_gives(case, sizes, engine):
    whole = measure(case, engine=engine)
    state, parts, start = MatchState.fresh(case.pattern), [whole[:0]], 0
    for size in (*sizes, len(whole)):
        part = slice(start, start + size)
        parts.append(measure(case, engine=engine, state=state, part=part))
        start += size
    assert same_bits(np.concatenate(parts), whole)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("weighed", [False, True])
@pytest.mark.parametrize("masked", [False, True])
def test_chunks_of_any_size_give_the_whole_across_tiles(engine, weighed, masked):
    pattern, packed, known = large_case(1, weighed=weighed)
    mask = known if masked else np.full_like(known, 2**64 - 1)
    whole = distance_function(pattern, packed, mask, engine=engine)
    edges = np.sort(np.random.default_rng(5).integers(TILES[-1] + 1, len(packed), 5))
    state, parts = MatchState.fresh(pattern), []
    for part in np.split(np.arange(len(packed)), [1, 2, *(t + 1 for t in TILES), *edges]):
        parts.append(
            distance_function(pattern, packed[part], mask[part], state=state, engine=engine)
        )
    assert same_bits(np.concatenate(parts), whole)


@given(cases(most_frames=40))
def test_compiled_and_numpy_give_the_same_bits(case):
    assert same_bits(measure(case, engine="compiled"), measure(case, engine="numpy"))


@pytest.mark.parametrize("masked", ["nothing", "the same always", "often"])
@pytest.mark.parametrize(
    ("weighed", "n_features"), [(False, 40), (True, 40), (False, 70), (True, 70)]
)
def test_compiled_and_numpy_give_the_same_bits_across_tiles(masked, weighed, n_features):
    pattern, packed, known = large_case(2, weighed=weighed, n_features=n_features)
    constant = np.broadcast_to(known[5], known.shape)
    mask = {"nothing": None, "the same always": constant, "often": known}[masked]
    twins = [distance_function(pattern, packed, mask, engine=e) for e in ENGINES]
    assert same_bits(*twins)
    assert np.isfinite(twins[0]).sum() > 39_000


def test_weighed_costs_of_more_kinds_of_frames_than_fit_at_once():
    pattern, packed, _ = large_case(8, weighed=True)
    assert len(np.unique(packed)) > 2 * _compiled._MOST_KINDS
    twins = [distance_function(pattern, packed, engine=e) for e in ENGINES]
    assert same_bits(*twins)


@pytest.mark.parametrize("engine", ENGINES)
@given(case=cases(unknown=False))
def test_a_complete_mask_is_no_mask(case, engine):
    with_mask, without = (measure(case, engine=engine, known=k) for k in (True, False))
    assert same_bits(with_mask, without)


@pytest.mark.parametrize("engine", ENGINES)
@given(seed=st.integers(0, 2**32 - 1), case=cases())
def test_no_path_crosses_a_border_between_documents(case, seed, engine):
    rng = np.random.default_rng(seed)
    n = case.n_features
    documents = [case.frames] + [
        # Complete and incomplete documents: alone, they are computed in different ways.
        random_rows(rng, rng.integers(0, 20), n, share_none=rng.choice([0, 0.3]))
        for _ in range(3)
    ]
    pairs = [words_and_mask(documents[i], n) for i in rng.permutation(4)]
    corpus = concatenate(*zip(*pairs, strict=True), full=full_mask(1, n)[0])
    both = {"skip_weight": case.skip_weight, "engine": engine}
    together = corpus_distance(case.pattern, corpus, **both)
    assert np.isinf(together[corpus.blocked]).all()
    for i, ((packed, known), part) in enumerate(zip(pairs, corpus.split(together), strict=True)):
        assert same_bits(part, distance_function(case.pattern, packed, known, **both))
        assert all(map(same_bits, corpus.sequence(i), (packed, known)))


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("masked", [False, True])
def test_borders_hold_across_tiles(masked, engine):
    pattern, packed, known = large_case(4)
    known = known if masked else np.full_like(known, 2**40 - 1)
    cuts = [edge for tile in TILES for edge in (tile - 8, tile - 6, tile - 5, tile - 4)]
    corpus = concatenate(np.split(packed, cuts), np.split(known, cuts), full=full_mask(1, 40)[0])
    together = corpus_distance(pattern, corpus, engine=engine)
    for i, part in enumerate(corpus.split(together)):
        alone = distance_function(pattern, *corpus.sequence(i), engine=engine)
        assert same_bits(part, alone)


@pytest.mark.parametrize("engine", ENGINES)
@given(case=cases(), n_free=st.integers(1, 9))
def test_free_columns_cost_nothing(case, n_free, engine):
    free = case._replace(
        columns=[[None] * case.n_features] * n_free, weights=[1.5] * n_free,
        entries=None, frames=case.frames,
    )  # fmt: skip
    reachable = np.arange(len(case.frames)) >= n_free // 2
    expected = np.where(reachable, 0, np.inf).astype(np.float32)
    assert same_bits(measure(free, engine=engine), expected)


@given(cases())
def test_an_entry_without_weight_is_free(case):
    assume(case.entries is not None)
    freed = [
        [value if weight > 0 else None for value, weight in zip(column, row, strict=True)]
        for column, row in zip(case.columns, case.entries, strict=True)
    ]
    entries = [[weight or 1 for weight in row] for row in case.entries]
    other = case._replace(columns=freed, entries=entries)
    assert same_bits(measure(case), measure(other))


@given(cases(weighed=False))
def test_equal_entry_weights_are_no_entry_weights(case):
    equal = case._replace(entries=[[0.3] * case.n_features] * len(case.columns))
    np.testing.assert_allclose(measure(equal), measure(case), rtol=0, atol=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("n_columns", [1, 2, 7, 60])
def test_a_document_shorter_than_half_a_pattern_has_no_match(n_columns, engine):
    rng = np.random.default_rng(n_columns)
    pattern = Pattern(
        pack(rng.random((n_columns, 40)) < 0.5), full_mask(n_columns, 40), np.ones(n_columns)
    )
    shortest = n_columns // 2 + 1
    packed = pack(rng.random((shortest, 40)) < 0.5)
    distance = distance_function(pattern, packed, engine=engine)
    assert np.isinf(distance[:-1]).all()
    assert np.isfinite(distance[-1])


@pytest.mark.parametrize("engine", ENGINES)
@given(case=cases(most_frames=40), seed=st.integers(0, 2**32 - 1))
def test_a_drop_out_is_never_a_hit(case, seed, engine):
    # Each column asks for something, and a path leaves no column uncounted.
    rng = np.random.default_rng(seed)
    columns = random_rows(rng, len(case.columns), case.n_features, share_none=0.3)
    columns = [[1, *column[1:]] for column in columns]
    entries = None if case.entries is None else (np.array(case.entries) + 0.5).tolist()
    blind = [[None] * case.n_features] * len(case.frames)
    dropped = Case(columns, [1.0] * len(columns), entries, blind, case.n_features, 2)
    distance = measure(dropped, engine=engine)
    assert (distance[len(columns) // 2 :] == 1).all()
    assert (measure(dropped._replace(skip_weight=1), engine=engine) >= 0.5).all()


@pytest.mark.parametrize("weighed", [False, True])
@pytest.mark.parametrize("masked", [False, True])
def test_agreement_costs_exactly_nothing_and_nothing_costs_less(weighed, masked):
    pattern, packed, known = large_case(7, n_frames=2000, weighed=weighed)
    distance = distance_function(pattern, packed, known if masked else None)
    assert distance[108] == 0
    assert (distance >= 0).all()


def test_what_one_frame_costs_does_not_depend_on_the_others():
    pattern, packed, known = large_case(6, n_frames=600, n_columns=1, weighed=True)
    parts = [slice(i, i + 1) for i in range(600)]
    whole = distance_function(pattern, packed, known)
    alone = [distance_function(pattern, packed[i], known[i]) for i in parts]
    assert same_bits(whole, np.concatenate(alone))
    costs = cell_costs(pattern, packed, known)
    alone = [cell_costs(pattern, packed[i], known[i]) for i in parts]
    assert same_bits(costs, np.concatenate(alone, axis=1))
