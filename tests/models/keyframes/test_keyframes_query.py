"""Keyframe queries: gaps, mirroring, joining, and queries as templates."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import motionary.models.keyframes as kf
from keyframe_cases import SET, ids_of, query_for
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FULL_BODY_2006
from motionary.matching import Pattern, distance_function
from motionary.models.keyframes import (
    Gap,
    KeyframeQuery,
    from_features,
    gap_of,
    gap_of_seconds,
    join_queries,
    mirror_query,
    search_packed,
    spring_of,
    template_of_query,
)
from motionary.packing import pack, permute


@pytest.mark.parametrize(
    ("distance", "stiffness", "gap"),
    [
        (3, 0.5, (2, 6)),  # running example
        (5, 0.6, (3, 8)),
        (7, 1.0, (7, 7)),
        (7, 0.0, (0, None)),
        (0, 0.0, (0, None)),  # 0 / 0
        (0, 1.0, (0, 0)),
        (0, 0.4, (0, 0)),
        # 7 / 0.7 and 0.7 * 10 are 10 and 7, whatever floating point makes of them.
        (7, 0.7, (5, 10)),
        (21, 0.7, (15, 30)),
        (10, 0.7, (7, 14)),
        (10, 0.3, (3, 33)),
    ],
)
def test_stiffness_gives_gaps(distance, stiffness, gap):
    assert gap_of(distance, stiffness) == gap


@given(distance=st.integers(0, 300), tenths=st.integers(1, 10))
def test_stiffness_in_tenths_is_exact(distance, tenths):
    stiffness = Fraction(tenths, 10)
    exact = (math.ceil(stiffness * distance), math.floor(distance / stiffness))
    assert gap_of(distance, tenths / 10) == exact


@given(least=st.integers(1, 500), width=st.integers(0, 500))
def test_a_spring_gives_its_gap_back(least, width):
    gap = Gap(least, least + width)
    assert gap_of(*spring_of(gap)) == gap


@pytest.mark.parametrize("gap", [Gap(0, None), Gap(0, 0)])
def test_springs_at_the_edge(gap):
    assert gap_of(*spring_of(gap)) == gap


def test_springs_of_a_query():
    query = query_for([[1]] * 3, [[1]] * 3, [(4, 9), (3, None)])
    assert query.springs == ((6.0, pytest.approx(2 / 3)), (math.inf, 0.0))


@pytest.mark.parametrize("bad", [(3, -0.1), (3, 1.1), (-1, 0.5), (math.inf, 0.5), (math.nan, 0.5)])
def test_impossible_springs(bad):
    with pytest.raises(InvalidInput, match=r"must|needs"):
        gap_of(*bad)


@pytest.mark.parametrize(
    ("seconds", "gap"),
    [
        ((0.1, 0.5), (3, 15)),
        ((0.12, 0.49), (4, 14)),  # inwards, unless a frame is meant
        ((0.233, 0.233), (7, 7)),
        ((0.0, math.inf), (0, None)),
    ],
)
def test_seconds_give_gaps(seconds, gap):
    assert gap_of_seconds(*seconds, rate_hz=30) == gap


@pytest.mark.parametrize(
    ("bad", "complaint"),
    [
        ((0.5, 0.1), "least <= most"),
        ((-1.0, 1.0), "least <= most"),
        ((math.inf, math.inf), "least <= most"),
        ((math.nan, 1.0), "least <= most"),
        ((0.01, 0.02), "no frame of 30 Hz"),
    ],
)
def test_contradictory_seconds(bad, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        gap_of_seconds(*bad, rate_hz=30)


@pytest.mark.parametrize(
    ("values", "fixed", "gaps", "positions", "complaint"),
    [
        (np.zeros((0, 2)), np.zeros((0, 2)), [], None, "at least one keyframe"),
        ([[1, 0]], [[1, 0]], [(0, 1)], None, "1 keyframes need 0 gaps, got 1"),
        ([[1], [1]], [[1], [1]], [(5, 3)], None, "gap 1 contradicts itself.*got 5 to 3"),
        ([[1], [1]], [[1], [1]], [(-1, 3)], None, "gap 1 contradicts itself"),
        ([[1], [1]], [[1], [1]], [(0, 10**30)], None, "longer than any recording"),
        ([[1], [1]], [[1], [1]], [(0, 3)], (4, 2), "ascending from 0"),
        ([[1], [1]], [[1], [1]], [(0, 3)], (1,), "2 keyframes need as many positions"),
    ],
)
def test_contradictory_queries(values, fixed, gaps, positions, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        query_for(values, fixed, gaps, positions)


def test_words_must_fit_the_features():
    two_words = np.zeros((1, 2), dtype=np.uint64)
    with pytest.raises(InvalidInput, match="3 features need 1 integers a keyframe, got 2"):
        KeyframeQuery(two_words, two_words, (), SET, ids_of(3))
    beyond = np.array([[8]], dtype=np.uint64)
    with pytest.raises(InvalidInput, match="beyond the 3 named features"):
        KeyframeQuery(beyond, beyond, (), SET, ids_of(3))
    with pytest.raises(InvalidInput, match="got 0 features"):
        KeyframeQuery(beyond, beyond, (), SET, ())


def test_queries_are_equal_by_content():
    first = query_for([[1, 1]], [[1, 0]])
    assert first == query_for([[1, 0]], [[1, 0]]), "free features have no value"
    assert hash(first) == hash(query_for([[1, 0]], [[1, 0]]))
    assert first != query_for([[1, 0]], [[1, 1]])
    assert first != "a query"
    assert not first.values.flags.writeable
    assert len(first) == 1


def random_query(seed, n_keyframes=3, vocabulary=FULL_BODY) -> KeyframeQuery:
    rng = np.random.default_rng(seed)
    shape = (n_keyframes, len(vocabulary))
    gaps = [gap_of(d, 0.5) for d in rng.integers(0, 9, n_keyframes - 1)]
    return KeyframeQuery(
        pack(rng.random(shape) < 0.5), pack(rng.random(shape) < 0.2), tuple(gaps),
        vocabulary.name, vocabulary.ids, tuple(range(n_keyframes)),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_a_mirrored_query_finds_the_mirrored_motion(seed):
    query = random_query(seed)
    packed = pack(np.random.default_rng(seed + 50).random((200, 40)) < 0.5)
    # Put one hit in.
    packed[20], packed[20 + query.gaps[0].least] = query.values[0], query.values[1]
    packed[20 + query.gaps[0].least + query.gaps[1].least] = query.values[2]
    mirrored = permute(packed, FULL_BODY.mirror_order)
    found = list(search_packed(query, packed))
    assert list(search_packed(mirror_query(query), mirrored)) == found
    assert mirror_query(mirror_query(query)) == query


def test_a_query_is_mirrored_within_its_own_set():
    with pytest.raises(InvalidInput, match=r"both must be of one set"):
        mirror_query(random_query(0), FULL_BODY_2006)


def test_joined_queries_ask_for_one_after_the_other_with_a_pause():
    first, second = (
        query_for([[1, 0, 0], [0, 1, 0]], np.eye(3)[:2], [(1, 2)]),
        query_for([[0, 0, 1]], [[0, 0, 1]]),
    )
    joined = join_queries(first, second, least_s=0.1, most_s=0.2)
    assert joined.gaps == ((1, 2), (3, 6))
    assert joined.positions is None

    def found_after(pause):
        packed = np.zeros((30, 3), dtype=bool)
        packed[5, 0] = packed[7, 1] = packed[7 + pause, 2] = True
        return list(search_packed(joined, pack(packed)))

    hits = {pause: found_after(pause) for pause in range(10)}
    assert hits == {p: [(0, 5, 8 + p)] if 3 <= p <= 6 else [] for p in range(10)}


def test_queries_over_different_sets_do_not_join():
    with pytest.raises(InvalidInput, match="both must be of one set"):
        join_queries(random_query(0), query_for([[1]], [[1]]), least_s=0, most_s=1)
    with pytest.raises(InvalidInput, match="least <= most"):
        join_queries(random_query(0), random_query(1), least_s=2, most_s=1)
    endless = join_queries(random_query(0), random_query(1), least_s=0, most_s=math.inf)
    assert endless.gaps[2] == (0, None)


def test_the_template_of_a_query_holds_its_keyframes_and_nothing_else():
    query = from_features(
        [{"F1": True}, {"F2": False}, {"F3": True}, {"F4": True}],
        [Gap(4, 9), Gap(0, 0), Gap(2, None)],
    )
    template = template_of_query(query)
    assert template.n_columns == 1 + 6 + 2
    assert np.argwhere(template.fixed).tolist() == [[0, 0], [6, 1], [6, 2], [8, 3]]
    assert np.argwhere(template.values).tolist() == [[0, 0], [6, 2], [8, 3]]
    assert (template.feature_set, template.feature_names) == (FULL_BODY.name, FULL_BODY.ids)


def test_positions_come_before_gaps():
    query = from_features([{"F1": True}, {"F2": True}], [Gap(1, 30)], positions=[7, 12])
    assert np.flatnonzero(template_of_query(query).fixed.any(axis=1)).tolist() == [0, 5]


def test_neighbours_that_may_be_apart_get_columns_of_their_own():
    query = from_features([{"F1": True}, {"F1": False}], [Gap(0, 1)])
    assert template_of_query(query).n_columns == 2


def test_keyframes_that_contradict_in_one_frame_have_no_template():
    query = from_features([{"F1": True}, {"F1": False}], [Gap(0, 0)])
    with pytest.raises(InvalidInput, match="keyframe 2 contradicts"):
        template_of_query(query)


def test_the_template_of_a_query_ranks_its_hits():
    # Both documents have the keyframes in order; the second one strays from the distances.
    query = from_features([{"F1": True}, {"F2": True}, {"F3": True}], [Gap(2, 40), Gap(2, 40)])
    near, far = np.zeros((60, 40), dtype=bool), np.zeros((60, 40), dtype=bool)
    near[[10, 19, 28], [0, 1, 2]] = True
    far[[10, 48, 50], [0, 1, 2]] = True
    template = template_of_query(query)
    pattern = Pattern(template.packed_values, template.packed_fixed, template.weights)
    cost = []
    for document in (near, far):
        assert len(search_packed(query, pack(document))) == 1
        cost.append(float(distance_function(pattern, pack(document), engine="numpy").min()))
    assert cost[0] == 0.0
    assert cost[1] > cost[0]


def test_the_table_of_contents_is_complete():
    for name in kf.__all__:
        assert getattr(kf, name).__doc__, name
