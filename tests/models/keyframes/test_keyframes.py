"""Keyframe queries: gaps, building, choosing, ranking, ranges."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import motionary.models.keyframes as kf
from keyframe_cases import SET, ids_of
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FULL_BODY_2006
from motionary.matching import Pattern, distance_function
from motionary.models.keyframes import (
    Gap,
    HitRanges,
    KeyframeQuery,
    choose_keyframes,
    extend,
    from_features,
    from_patterns,
    from_template,
    gap_of,
    gap_of_seconds,
    join_queries,
    margins,
    mirror_query,
    search_packed,
    spring_of,
    template_of_query,
)
from motionary.models.templates import QuantisedTemplate
from motionary.packing import pack, permute, unpack
from oracles import keyframes as oracle


def query_for(values, fixed, gaps=(), positions=None) -> KeyframeQuery:
    gaps = tuple(Gap(*gap) for gap in gaps)
    ids = ids_of(np.shape(values)[1])
    return KeyframeQuery(pack(values), pack(fixed), gaps, SET, ids, positions)


def ranges_of(*rows) -> HitRanges:
    return HitRanges(*np.array(rows, dtype=np.int64).reshape(-1, 3).T)


def template_of(rows) -> QuantisedTemplate:
    """Template over the 40 relations, all free but what rows {column: {id: value}} fix."""
    n_columns = rows["n"]
    shape = (n_columns, len(FULL_BODY))
    values, fixed = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    for column, features in rows.items():
        for name, value in features.items() if column != "n" else ():
            values[column, FULL_BODY.ids.index(name)] = value
            fixed[column, FULL_BODY.ids.index(name)] = True
    return QuantisedTemplate(values, fixed, np.ones(n_columns), FULL_BODY.ids, FULL_BODY.name)


# Gaps.


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


# Queries.


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
    assert first == query_for([[1, 0]], [[1, 0]]), "free relations have no value"
    assert hash(first) == hash(query_for([[1, 0]], [[1, 0]]))
    assert first != query_for([[1, 0]], [[1, 1]])
    assert first != "a query"
    assert not first.values.flags.writeable
    assert len(first) == 1


def test_relations_by_id_or_name():
    query = from_features([{"F3": True, "Left  Knee bent": False}], [])
    assert query.feature_set == "full-body-40"
    fixed, values = unpack(query.fixed, 40)[0], unpack(query.values, 40)[0]
    assert [FULL_BODY.ids[i] for i in np.flatnonzero(fixed)] == ["F3", "F21"]
    assert [FULL_BODY.ids[i] for i in np.flatnonzero(values)] == ["F3"]


@pytest.mark.parametrize(
    ("keyframes", "complaint"),
    [
        ([], "at least one keyframe"),
        ([{"right hand above the neck": True}], "did you mean 'right hand above neck'"),
        ([{"F99": True}], "no feature 'F99' in 'full-body-40'"),
        ([{"F3": True, "right hand above neck": False}], "to hold and not to hold"),
    ],
)
def test_unknown_relations(keyframes, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        from_features(keyframes, [])


def test_patterns_cover_their_group():
    query = from_patterns(
        ["1*0", "*1"], ["lower", "mix"], distances=[10], stiffness=[0.5], positions=[3, 13]
    )
    # lower begins with F15, mix with F27.
    first = from_features(
        [{"F15": True, "F17": False}, {"F28": True}], [Gap(5, 20)], positions=[3, 13]
    )
    assert query == first


@pytest.mark.parametrize(
    ("patterns", "groups", "stiffness", "complaint"),
    [
        (["1"], ["middle"], [], "no group 'middle'.*lower, mix, upper"),
        (["1" * 15], ["upper"], [], "at most 14 signs"),
        (["1?"], ["upper"], [], "got '1\\?'"),
        (["1", "0"], ["upper"], [1.0], "2 keyframes need as many groups"),
        (["1", "0"], ["upper"] * 2, [], "1 gaps need as many stiffness values, got 0"),
        ([], [], [], "at least one keyframe"),
    ],
)
def test_malformed_patterns(patterns, groups, stiffness, complaint):
    distances = [1] * max(len(patterns) - 1, 0)
    with pytest.raises(InvalidInput, match=complaint):
        from_patterns(patterns, groups, distances=distances, stiffness=stiffness)


def test_columns_of_a_template():
    template = template_of({"n": 30, 4: {"F1": True, "F20": False}, 14: {"F20": True}})
    query = from_template(template, [4, 14], stiffness=0.5)
    expected = from_features(
        [{"F1": True, "F20": False}, {"F20": True}], [Gap(5, 20)], positions=[4, 14]
    )
    assert query == expected
    lower = from_template(template, [4, 14], stiffness=[0.0], groups=["lower", None])
    assert lower.gaps == (Gap(0, None),)
    assert lower == from_features([{"F20": False}, {"F20": True}], lower.gaps, positions=[4, 14])


@pytest.mark.parametrize(
    ("positions", "options", "complaint"),
    [
        ([], {}, "positions must be columns"),
        ([30], {}, "columns of the template, 0 to 29"),
        ([3, 1], {}, "distance must be at least 0"),
        ([1], {"groups": ["arms"]}, "no group 'arms'"),
        ([1], {"groups": ["mix", "mix"]}, "1 keyframes need as many groups"),
        ([1], {"groups": ["mix"], "feature_set": FULL_BODY_2006}, "full-body-40.*full-body-39"),
    ],
)
def test_bad_columns(positions, options, complaint):
    template = template_of({"n": 30})
    with pytest.raises(InvalidInput, match=complaint):
        from_template(template, positions, stiffness=1.0, **options)


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


# Choosing.


def random_template(seed, n_columns=40) -> QuantisedTemplate:
    rng = np.random.default_rng(seed)
    shape = (n_columns, len(FULL_BODY))
    return QuantisedTemplate(
        rng.random(shape) < 0.5, rng.random(shape) < rng.random((n_columns, 1)),
        np.ones(n_columns), FULL_BODY.ids, FULL_BODY.name,
    )  # fmt: skip


@pytest.mark.parametrize("zero_weight", [1.0, 1.2])
@pytest.mark.parametrize("seed", range(6))
def test_choosing_follows_its_definition(seed, zero_weight):
    template = random_template(seed, n_columns=[1, 4, 7, 25, 40, 90][seed])
    groups = [feature.group for feature in FULL_BODY.features]
    for count in (1, 3, 5):
        chosen = choose_keyframes(template, count=count, min_distance=3, zero_weight=zero_weight)
        expected = oracle.choose(template.values, template.fixed, groups, count, 3, zero_weight)
        assert [(c.position, c.group) for c in chosen] == expected


def test_an_all_free_template_has_no_keyframes():
    assert choose_keyframes(template_of({"n": 20}), count=5) == []


def test_chosen_keyframes_make_a_query():
    template = random_template(3)
    chosen = choose_keyframes(template, count=3)
    assert 2 <= len(chosen) <= 3
    query = from_template(
        template, [c.position for c in chosen], stiffness=0.5, groups=[c.group for c in chosen]
    )
    assert len(query) == len(chosen)
    # A document that plays the template has a hit.
    assert len(search_packed(query, template.packed_values)) == 1


def test_bad_choosing():
    with pytest.raises(InvalidInput, match="count must be at least 1"):
        choose_keyframes(random_template(0), count=0)
    with pytest.raises(InvalidInput, match=r"full-body-40.*full-body-39"):
        choose_keyframes(random_template(0), feature_set=FULL_BODY_2006)


# Ranking.


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


# Ranges.


def test_margins_are_twice_those_of_the_template():
    query = query_for([[1]] * 2, [[1]] * 2, [(1, 9)], positions=(12, 24))
    # Columns 13 and 25 of 38, counted from 1: 2 * 12 and 2 * (38 - 25).
    assert margins(query, 38) == (24, 26)
    with pytest.raises(InvalidInput, match="column 24 of only 20"):
        margins(query, 20)
    with pytest.raises(InvalidInput, match="no template positions"):
        margins(query_for([[1]], [[1]]), 20)


@given(
    rows=st.sets(st.tuples(st.integers(0, 2), st.integers(0, 11)), max_size=12),
    before=st.integers(0, 4),
    after=st.integers(0, 4),
)
def test_extended_ranges_cover_their_neighbourhood(rows, before, after):
    frames = {(d, n) for d in range(3) for n in range(12)}
    single = ranges_of(*sorted((d, n, n + 1) for d, n in rows))
    found = extend(single, before, after, [12, 12, 12])
    covered = {(d, n) for d, start, stop in found for n in range(start, stop)}
    expected = {
        (d, n)
        for d, n in frames
        if any(d == other and m - before <= n <= m + after for other, m in rows)
    }
    assert covered == expected
    apart = [
        (a.sequence, a.stop) < (b.sequence, b.start)
        for a, b in zip(found, list(found)[1:], strict=False)
    ]
    assert all(apart)


def test_extending_beyond_what_is_known():
    with pytest.raises(InvalidInput, match="at least 0 frames"):
        extend(ranges_of((0, 1, 2)), -1, 0, [5])
    with pytest.raises(InvalidInput, match="one number for each sequence"):
        extend(ranges_of((3, 1, 2)), 1, 1, [5])
    assert list(extend(HitRanges.none(), 1, 1, [])) == []


def test_ranges_tell_their_documents():
    ranges = ranges_of((0, 1, 4), (2, 0, 2), (2, 5, 6))
    assert len(ranges) == 3
    assert ranges.n_frames == 6
    assert ranges.hit_sequences.tolist() == [0, 2]
    assert ranges.of(2) == [(0, 2), (5, 6)]
    assert ranges.of(1) == []


def test_the_table_of_contents_is_complete():
    for name in kf.__all__:
        assert getattr(kf, name).__doc__, name
