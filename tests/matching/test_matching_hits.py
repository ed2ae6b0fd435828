"""Minima and ranked hits against their definition, and one example per clause."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from matching_cases import cases
from motionary.matching import Hit, Pattern, distance_function, find_hits, local_minima
from motionary.packing import full_mask, pack
from oracles import matching as oracle

INF = np.inf


@given(st.lists(st.sampled_from([0.0, 0.1, 0.2, 0.3, INF]), max_size=12), st.floats(0, 0.4))
def test_minima_are_those_of_the_definition(values, threshold):
    found = local_minima(np.array(values, dtype=np.float32), threshold=np.float32(threshold))
    single = [float(np.float32(value)) for value in values]
    assert found.tolist() == oracle.local_minima(single, threshold=np.float32(threshold))


@pytest.mark.parametrize(
    ("values", "threshold", "minima"),
    [
        ([], 1, []),
        ([INF, INF], INF, []),
        ([0.5], 1, [0]),
        ([0.5, 0.5], 1, [0]),
        ([0.5, 0.5], 0.5, [0]),
        ([0.5, 0.5], 0.4, []),
        ([0.5, 0.6], 1, [0]),
        ([0.6, 0.5], 1, [1]),
        ([0.6, 0.5, 0.5], 1, [1]),
        ([0.6, 0.5, 0.5, 0.7, 0.1, 0.7], 1, [1, 4]),
        ([0.6, 0.5, 0.5, 0.4, 0.7], 1, [3]),
        ([INF, 0.5, 0.6, INF], 1, [1]),
        ([INF, 0.6, 0.5, INF, 0.6], 1, [2, 4]),
    ],
)
def test_minima_at_plateaus_and_ends(values, threshold, minima):
    assert local_minima(np.array(values, np.float32), threshold=threshold).tolist() == minima


@given(
    cases(most_frames=60),
    st.sampled_from([0, 0.1, 0.3, 0.6, INF]),
    st.sampled_from([None, 0, 1, 3]),
)
def test_hits_are_those_of_the_definition(case, threshold, limit):
    pattern, packed, known = case.pattern, case.packed, case.known
    distance = distance_function(pattern, packed, known, skip_weight=case.skip_weight)
    starts = [path[0][1] if path else None for _, path in case.oracle_matches()]
    expected = oracle.hits(
        [float(d) for d in distance], starts, threshold=np.float32(threshold), limit=limit
    )
    hits = find_hits(
        distance, pattern, packed, known,
        threshold=threshold, limit=limit, skip_weight=case.skip_weight,
    )  # fmt: skip
    assert [tuple(hit) for hit in hits] == expected


def find_among(ends: dict[int, float], pattern, packed, *, threshold=1.0, limit=None):
    """Hits where only the given ends have a finite cost."""
    distance = np.full(len(packed), INF, dtype=np.float32)
    for end, cost in ends.items():
        distance[end] = cost
    return find_hits(distance, pattern, packed, threshold=threshold, limit=limit)


def free_pattern(n_columns: int) -> Pattern:
    """All paths cost nothing, so the first step is always taken: hits of K frames."""
    nothing = np.zeros((n_columns, 1), dtype=np.uint64)
    return Pattern(nothing, nothing, np.ones(n_columns))


@pytest.mark.parametrize(
    ("other_end", "is_hit"),
    [
        (34, True),
        (35, False),  # half of 10 before the end
        (39, False),
        (40, False),
        (41, False),  # a tenth of 10 after the end
        (45, False),  # starts half of 10 after the start
        (46, True),
    ],
)
def test_what_a_hit_of_ten_frames_excludes(other_end, is_hit):
    hits = find_among({40: 0.1, other_end: 0.1 if other_end == 40 else 0.2},
                      free_pattern(10), np.zeros((60, 1), np.uint64))  # fmt: skip
    first = Hit(31, 41, pytest.approx(0.1))
    second = Hit(other_end - 9, other_end + 1, pytest.approx(0.2))
    assert hits == ([first, second] if is_hit else [first])


@pytest.mark.parametrize(("n_frames", "half"), [(9, 5), (10, 5), (11, 6)])
def test_half_of_a_hit_is_rounded_up(n_frames, half):
    packed = np.zeros((80, 1), np.uint64)
    for other_end, is_hit in [(40 - half, False), (39 - half, True)]:
        hits = find_among({40: 0.1, other_end: 0.2}, free_pattern(n_frames), packed)
        assert len(hits) == 1 + is_hit


@pytest.mark.parametrize(
    ("other_start", "other_end", "is_hit"),
    [
        (24, 30, False),  # two frames, a tenth of 19, after the end
        (24, 31, True),
        (8, 15, False),  # starts a tenth of 19 before the start
        (7, 15, True),
    ],
)
def test_ends_and_starts_exclude_on_their_own(other_start, other_end, is_hit):
    # The first column likes frame 10 a little and the other start more; the rest is free.
    values = np.zeros((10, 2), dtype=np.bool_)
    values[0] = True
    pattern = Pattern(pack(values), pack(values), np.ones(10))
    frames = np.zeros((60, 2), dtype=np.bool_)
    frames[10, 0], frames[other_start] = True, True
    hits = find_among({28: 0.1, other_end: 0.2}, pattern, pack(frames))
    first, second = (10, 29), (other_start, other_end + 1)
    assert [hit[:2] for hit in hits] == ([first, second] if is_hit else [first])


def test_hits_come_cheapest_first_and_ties_earliest_first():
    ends = {10: 0.3, 30: 0.1, 50: 0.3, 70: 0.2}
    hits = find_among(ends, free_pattern(10), np.zeros((80, 1), np.uint64))
    assert [hit.stop - 1 for hit in hits] == [30, 70, 10, 50]


@pytest.mark.parametrize(
    ("threshold", "limit", "ends"),
    [
        (0.25, None, [10, 30]),  # at the threshold is below it
        (0.2499, None, [10]),
        (0.1, None, []),
        (INF, None, [10, 30, 50]),
        (INF, 2, [10, 30]),
        (INF, 0, []),
    ],
)
def test_threshold_and_limit_end_the_search(threshold, limit, ends):
    costs = {10: 0.125, 30: 0.25, 50: 0.5}
    packed = np.zeros((60, 1), np.uint64)
    hits = find_among(costs, free_pattern(10), packed, threshold=threshold, limit=limit)
    assert [hit.stop - 1 for hit in hits] == ends


def test_many_hits_exclude_across_batches_of_candidates():
    rng = np.random.default_rng(8)
    packed = pack(np.cumsum(rng.random((600, 40)) < 0.1, axis=0) % 2)
    pattern = Pattern(packed[50:56], full_mask(6, 40), np.ones(6))
    distance = distance_function(pattern, packed)
    hits = find_hits(distance, pattern, packed, threshold=INF)
    assert hits[0][:2] == (50, 56)
    assert hits[0].cost == 0
    assert len(hits) > 64
    for i, hit in enumerate(hits):
        earlier = [tuple(other) for other in hits[:i]]
        assert not any(oracle.is_excluded(hit.start, hit.stop - 1, e) for e in earlier)
        assert not earlier or earlier[-1][2] <= hit.cost
    for limit in (1, 2, 5, 40):
        assert find_hits(distance, pattern, packed, threshold=INF, limit=limit) == hits[:limit]
