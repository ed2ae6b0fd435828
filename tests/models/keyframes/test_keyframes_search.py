"""Keyframe search against trying everything, and against the published algorithm."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keyframe_cases import SET, Case, cases, ids_of, query_of_streams, streams
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY
from motionary.models.keyframes import (
    Gap,
    KeyframeQuery,
    from_features,
    gap_of,
    index_packed,
    search_packed,
    search_query,
    single_hits,
)
from motionary.models.keyframes.posting_lists import count_runs, reach
from motionary.packing import pack
from oracles import keyframes as oracle
from oracles.keyframe_search import (
    Segment,
    inverted_lists,
    keyframe_based_search,
    keyframe_lists,
    union,
)

ENGINES = ["numpy", "compiled"]


def lists_of(query, packed, known=None):
    """The frames of one document that show each keyframe, as runs."""
    return keyframe_lists(query.values, query.fixed, inverted_lists(packed, known))


def ranges_by_algorithm(query, packed, known=None):
    """Algorithm 1 on one document, as half-open ranges."""
    lists = lists_of(query, packed, known)
    return [(s, t + 1) for s, t in keyframe_based_search(lists, query.gaps)[0]]


# The running example: three keyframes that show in the frames of eq. (8), 15 frames.

LISTS = (
    [(3, 4), (6, 7)],
    [(1, 2), (4, 6), (9, 10)],
    [(1, 3), (5, 8), (11, 12), (14, 15)],
)
TABLE_1 = {
    (1, 2, 2): [(3, 5, 8)],
    # Print forgets (3, 5, 12): its distances 2 and 7 are admissible.
    (1, 2, 3): [(3, 5, 11), (3, 5, 12), (3, 6, 11), (3, 6, 12), (4, 6, 11), (4, 6, 12)],
    (1, 2, 4): [(3, 6, 14), (4, 6, 14)],
    (1, 3, 4): [(3, 9, 14), (3, 9, 15), (4, 9, 14), (4, 9, 15), (4, 10, 14), (4, 10, 15)],
    (2, 3, 4): [
        *[(6, 9, 14), (6, 9, 15), (6, 10, 14), (6, 10, 15)],
        *[(7, 9, 14), (7, 9, 15), (7, 10, 14), (7, 10, 15)],
    ],
}
RANGES_OF_TABLE_1 = {
    (1, 2, 2): (3, 8), (1, 2, 3): (3, 12), (1, 2, 4): (3, 14), (1, 3, 4): (3, 15),
    (2, 3, 4): (6, 15),
}  # fmt: skip


@pytest.fixture
def example() -> Case:
    """The running example with frame n of the paper as frame n - 1."""
    document = np.zeros((15, 3), dtype=bool)
    for k, segments in enumerate(LISTS):
        for s, t in segments:
            document[s - 1 : t, k] = True
    gaps = [gap_of(3, 0.5), gap_of(5, 0.6)]
    return Case(np.eye(3, dtype=bool), np.eye(3, dtype=bool), gaps, [document], [document | True])


def test_the_gaps_of_the_running_example(example):
    # mu_1([3 : 4]) = [5 : 10] and mu_2([5 : 6]) = [8 : 14].
    assert example.gaps == [Gap(2, 6), Gap(3, 8)]


def test_the_lists_of_the_running_example(example):
    lists = keyframe_lists(
        example.query.values, example.query.fixed, inverted_lists(example.packed[0])
    )
    assert [[(s + 1, t + 1) for s, t in segments] for segments in lists] == list(LISTS)


def test_table_1_matches_and_their_ranges(example):
    lists = keyframe_lists(
        example.query.values, example.query.fixed, inverted_lists(example.packed[0])
    )
    ranges, matches = keyframe_based_search(lists, example.gaps)
    found = {
        tuple(p + 1 for p in match.pointers): (match.hit_range.s + 1, match.hit_range.t + 1)
        for match in matches
    }
    assert found == RANGES_OF_TABLE_1
    assert list(found) == list(TABLE_1), "found in the order of print"
    assert ranges == [Segment(2, 14)]


def test_table_1_hits(example):
    hits = single_hits(example.query, example.packed[0])
    by_match = {}
    for hit in (hits + 1).tolist():
        match = tuple(p + 1 for p in oracle.match_of(hit, LISTS))
        by_match.setdefault(match, []).append(tuple(hit))
    # Two matches that the algorithm leaves out are irrelevant: (1, 3, 3) and (2, 3, 3).
    assert {match: by_match[match] for match in TABLE_1} == TABLE_1
    assert set(by_match) - set(TABLE_1) == {(1, 3, 3), (2, 3, 3)}


@pytest.mark.parametrize("engine", ENGINES)
def test_the_union_of_the_running_example(example, engine):
    assert list(search_query(example.query, example.index, engine=engine)) == [(0, 2, 15)]


# Everything against everything.


@given(case=cases())
def test_algorithm_1_finds_the_ranges_of_all_hits(case):
    for packed, mask, document, known in zip(
        case.packed, case.masks, case.documents, case.known, strict=True
    ):
        hits = oracle.all_hits(case.keyframes, case.gaps, document, known)
        expected = oracle.covered_ranges(hits, len(document))
        assert ranges_by_algorithm(case.query, packed, mask) == expected


@pytest.mark.parametrize("engine", ENGINES)
@given(case=cases())
def test_search_finds_the_ranges_of_all_hits(case, engine):
    found = search_query(case.query, case.index, engine=engine)
    for i, (document, known) in enumerate(zip(case.documents, case.known, strict=True)):
        hits = oracle.all_hits(case.keyframes, case.gaps, document, known)
        assert found.of(i) == oracle.covered_ranges(hits, len(document))


@given(case=cases())
def test_one_document_searched_without_index(case):
    for packed, mask, document, known in zip(
        case.packed, case.masks, case.documents, case.known, strict=True
    ):
        hits = oracle.all_hits(case.keyframes, case.gaps, document, known)
        found = search_packed(case.query, packed, mask)
        assert found.of(0) == oracle.covered_ranges(hits, len(document))


@given(case=cases(), limit=st.sampled_from([1, 5, 10_000]))
def test_single_hits_are_the_first_of_all_hits(case, limit):
    for packed, mask, document, known in zip(
        case.packed, case.masks, case.documents, case.known, strict=True
    ):
        hits = oracle.all_hits(case.keyframes, case.gaps, document, known)
        found = single_hits(case.query, packed, mask, limit=limit)
        assert [tuple(hit) for hit in found.tolist()] == hits[:limit]


@given(case=cases())
def test_the_range_of_a_match_spans_its_hits(case):
    for packed, mask, document, known in zip(
        case.packed, case.masks, case.documents, case.known, strict=True
    ):
        lists = lists_of(case.query, packed, mask)
        hits = oracle.all_hits(case.keyframes, case.gaps, document, known)
        for match in keyframe_based_search(lists, case.query.gaps)[1]:
            inside = [hit for hit in hits if oracle.match_of(hit, lists) == match.pointers]
            ends = (min(hit[0] for hit in inside), max(hit[-1] for hit in inside))
            assert match.hit_range == ends


GAPS_OF_STREAMS = [
    ((0, 9), (2, 40)),
    ((1, None), (0, 0)),
    ((70, 130), (64, 64)),
    ((0, None), (300, None)),
    ((5, 600), (0, 3)),
    ((128, 128), (0, None)),
]


@pytest.mark.parametrize("gaps", GAPS_OF_STREAMS)
@pytest.mark.parametrize("seed", range(4))
def test_search_equals_algorithm_1_over_many_blocks(gaps, seed):
    lengths = [700, 1, 64, 63, 0, 65, 2000, 128, 500, 8, 7, 320]
    documents = [pack(document) for document in streams(seed, lengths=lengths)]
    query = query_of_streams(seed + 100, gaps=gaps).query
    index = index_packed(documents, feature_set=SET, feature_ids=ids_of(12))
    expected = [
        (i, start, stop)
        for i, packed in enumerate(documents)
        for start, stop in ranges_by_algorithm(query, packed)
    ]
    assert expected, "a test without hits shows nothing"
    for engine in ENGINES:
        assert list(search_query(query, index, engine=engine)) == expected
    alone = [
        (i, *r[1:]) for i, packed in enumerate(documents) for r in search_packed(query, packed)
    ]
    assert alone == expected


@pytest.mark.parametrize("n_keyframes", [1, 2, 6])
def test_search_equals_algorithm_1_for_rare_keyframes(n_keyframes):
    # Many documents and few frames that show anything: single blocks are read, not all.
    documents = [pack(d) for d in streams(5, lengths=[61] * 400, n_features=40, flip=0.02)]
    rng = np.random.default_rng(n_keyframes)
    shown = documents[7][np.sort(rng.choice(61, n_keyframes, replace=False))]
    fixed = pack(rng.random((n_keyframes, 40)) < 0.6)
    gaps = (Gap(0, 20),) * (n_keyframes - 1)
    query = KeyframeQuery(shown, fixed, gaps, SET, ids_of(40))
    index = index_packed(documents, feature_set=SET, feature_ids=ids_of(40))
    found = [search_query(query, index, engine=engine) for engine in ENGINES]
    assert list(found[0]) == list(found[1])
    for i, packed in enumerate(documents):
        assert found[0].of(i) == ranges_by_algorithm(query, packed)


# Edges, named.


def stream(*rows: str) -> np.ndarray:
    """Words of a document, one row of 0/1 signs per feature."""
    return pack(np.array([[sign == "1" for sign in row] for row in rows]).T)


def query_for(n_keyframes, *gaps) -> KeyframeQuery:
    """Keyframe k is feature k and nothing else."""
    eye = pack(np.eye(n_keyframes, dtype=bool))
    return KeyframeQuery(eye, eye, tuple(Gap(*g) for g in gaps), SET, ids_of(n_keyframes))


def both(query, *documents, known=None):
    index = index_packed(documents, known, feature_set=SET, feature_ids=query.feature_ids)
    found = [list(search_query(query, index, engine=engine)) for engine in ENGINES]
    assert found[0] == found[1]
    return found[0]


def test_one_keyframe_gives_its_runs():
    assert both(query_for(1), stream("0110001"), stream("1")) == [(0, 1, 3), (0, 6, 7), (1, 0, 1)]


def test_touching_ranges_are_one_range():
    query = query_for(2, (1, 1))
    assert both(query, stream("101010", "010101")) == [(0, 0, 6)]


def test_no_hit_crosses_the_border_of_documents():
    query = query_for(2, (0, None))
    assert both(query, stream("1000", "0000"), stream("0000", "0001")) == []


def test_zero_gap_asks_for_both_in_one_frame():
    query = query_for(2, (0, 0))
    assert both(query, stream("0110", "0011")) == [(0, 2, 3)]


def test_keyframes_that_contradict_in_one_frame_have_no_hit():
    values, fixed = pack([[1], [0]]), pack([[1], [1]])
    query = KeyframeQuery(values, fixed, (Gap(0, 0),), SET, ids_of(1))
    assert both(query, stream("0101")) == []
    assert ranges_by_algorithm(query, stream("0101")) == []


def test_a_free_keyframe_is_every_frame():
    query = KeyframeQuery(pack([[0], [1]]), pack([[0], [1]]), (Gap(2, 2),), SET, ids_of(1))
    assert both(query, stream("00010"), stream("1")) == [(0, 1, 4)]


def test_a_query_longer_than_its_document():
    assert both(query_for(2, (5, 9)), stream("11111", "11111")) == []


@pytest.mark.parametrize("held", [0, 1])
def test_an_unknown_relation_neither_holds_nor_fails(held):
    query = KeyframeQuery(pack([[held]]), pack([[1]]), (), SET, ids_of(1))
    packed, known = pack([[held]] * 3), pack([[1], [0], [1]])
    # Unknown features are 0 in the packed ones.
    assert both(query, packed & known, known=[known]) == [(0, 0, 1), (0, 2, 3)]
    assert list(search_packed(query, packed & known, known)) == [(0, 0, 1), (0, 2, 3)]


def test_documents_without_frames():
    assert both(query_for(1), stream("")[:0].reshape(0, 1), stream("1")) == [(1, 0, 1)]


def test_the_latest_end_belongs_to_the_same_document():
    query = query_for(2, (0, None))
    first, second = stream("1000000", "0010000"), stream("1000000", "0000001")
    assert both(query, first, second) == [(0, 0, 3), (1, 0, 7)]


def test_union_of_segments_is_maximal():
    segments = [Segment(5, 6), Segment(0, 2), Segment(3, 3), Segment(5, 9)]
    assert union(segments) == [Segment(0, 3), Segment(5, 9)]


def test_segments_intersect():
    assert Segment(2, 5) & Segment(5, math.inf) == Segment(5, 5)
    assert Segment(2, 5) & Segment(6, 7) is None


@pytest.mark.parametrize(("start", "stop"), [(0, 64), (64, 128), (60, 128), (0, 200), (63, 65)])
def test_runs_that_end_with_a_block(start, stop):
    row = "".join("1" if start <= n < stop else "0" for n in range(200))
    assert both(query_for(1), stream(row), stream("1")) == [(0, start, stop), (1, 0, 1)]
    two = query_for(2, (1, 3))
    assert both(two, stream(row, "0" + row[:-1])) == [(0, start, min(stop + 1, 200))]


@pytest.mark.parametrize(
    ("least", "most"),
    [(0, 0), (0, 1), (3, 40), (16, 16), (64, 64), (63, 129), (100, 700), (290, 310), (2000, 3000)],
)
@pytest.mark.parametrize("back", [False, True])
def test_what_is_within_a_gap_is_reached_and_nothing_else(back, least, most):
    bits = np.random.default_rng(0).random(20 * 64) < 0.01
    expected = np.zeros(len(bits), dtype=bool)
    for frame in np.flatnonzero(bits):
        first, last = (frame - most, frame - least) if back else (frame + least, frame + most)
        expected[max(first, 0) : max(last + 1, 0)] = True
    reached = reach(bitmap_of(bits), Gap(least, most), back=back)
    assert bits_of(reached).tolist() == expected.tolist()


def test_a_gap_without_a_bound_reaches_everything_on_one_side():
    bits = np.zeros(10 * 64, dtype=bool)
    bits[[200, 300]] = True
    after = bits_of(reach(bitmap_of(bits), Gap(5, None)))
    before = bits_of(reach(bitmap_of(bits), Gap(5, None), back=True))
    assert after[205:].all()
    assert before[:296].all()
    assert not after[:128].any()
    assert not before[384:].any()
    assert not reach(np.zeros(4, dtype=np.uint64), Gap(5, None)).any()


def test_where_a_keyframe_comes_and_goes_often_the_steps_are_those_of_frames():
    often, seldom = "01" * 400, "0" * 700 + "1" * 100
    index = index_packed([stream(often, seldom)], feature_set=ids_of(2)[0], feature_ids=ids_of(2))
    assert count_runs(index.planes, [3]) < 0.3 < count_runs(index.planes, [1])


def bitmap_of(bits):
    return np.packbits(bits, bitorder="little").view("<u8").astype(np.uint64)


def bits_of(bitmap):
    return np.unpackbits(bitmap.astype("<u8").view(np.uint8), bitorder="little").astype(bool)


# Refused.


def test_query_and_index_of_different_sets_are_refused():
    index = index_packed([stream("01")], feature_set="another", feature_ids=ids_of(1))
    with pytest.raises(InvalidInput, match=r"'another'.*both must be of one set"):
        search_query(query_for(1), index)


def test_the_published_39_are_not_the_40():
    index = index_packed([stream("01")], feature_set="full-body-39", feature_ids=["F1"])
    query = from_features([{"F1": True}], [], vocabulary=FULL_BODY)
    with pytest.raises(InvalidInput, match=r"full-body-40.*full-body-39"):
        search_query(query, index)


def test_words_of_another_width_are_refused():
    with pytest.raises(InvalidInput, match="both must come from one feature set"):
        search_packed(query_for(1), np.zeros((3, 2), dtype=np.uint64))
    with pytest.raises(InvalidInput, match="known needs the shape"):
        search_packed(query_for(1), stream("01"), np.zeros((3, 1), dtype=np.uint64))
    with pytest.raises(InvalidInput, match="limit must be at least 1"):
        single_hits(query_for(1), stream("01"), limit=0)
