"""The posting-list index, its temporal tolerance, and hit ranges."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keyframe_cases import SET, ids_of, query_for, query_of_streams, sequence_of, streams
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY
from motionary.models.keyframes import (
    HitRanges,
    KeyframeQuery,
    PostingIndex,
    extend,
    index_packed,
    margins,
    search_packed,
    search_query,
)
from motionary.models.keyframes.index import (
    count_steady,
    loose_index,
    steady_mask,
    strict_index,
)
from motionary.packing import pack, unpack

N = len(FULL_BODY)


ENGINES = ["numpy", "compiled"]


def stream(*rows: str) -> np.ndarray:
    """Words of a document, one row of 0/1 signs per feature."""
    return pack(np.array([[sign == "1" for sign in row] for row in rows]).T)


def test_an_index_may_be_memory_mapped(tmp_path):
    documents = [pack(d) for d in streams(1, lengths=[300, 200])]
    query = query_of_streams(101).query
    index = index_packed(documents, feature_set=SET, feature_ids=ids_of(12))
    np.save(tmp_path / "planes.npy", index.planes)
    planes = np.load(tmp_path / "planes.npy", mmap_mode="r")
    mapped = PostingIndex(planes, index.lengths, SET, ids_of(12))
    for engine in ENGINES:
        assert list(search_query(query, mapped, engine=engine)) == list(search_query(query, index))


def test_the_index_says_what_it_holds():
    index = index_packed([stream("0110", "0001")], feature_set=SET, feature_ids=ids_of(2))
    assert (index.n_frames, index.n_sequences) == (4, 1)
    # Not X1, X1, not X2, X2, frames.
    assert index.counts == (2, 2, 3, 1, 4)
    assert index.n_bytes == index.planes.nbytes + index.lengths.nbytes


@pytest.mark.parametrize(
    ("packed", "known", "complaint"),
    [
        ([], None, "at least one sequence"),
        ([np.zeros((3, 2), dtype=np.uint64)], None, "sequence 0: packed features need shape"),
        ([np.zeros(3, dtype=np.uint64)], None, "sequence 0: packed features need shape"),
        ([np.zeros((3, 1), dtype=np.uint64)], [], "as many masks"),
        ([np.zeros((3, 1), dtype=np.uint64)], [np.zeros((2, 1), dtype=np.uint64)], "known needs"),
    ],
)
def test_an_index_of_bad_documents_is_refused(packed, known, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        index_packed(packed, known, feature_set=SET, feature_ids=ids_of(3))


def test_an_index_of_bad_planes_is_refused():
    with pytest.raises(InvalidInput, match="needs planes of shape"):
        PostingIndex(np.zeros((3, 1), dtype=np.uint64), np.array([200]), SET, ids_of(1))


@st.composite
def documents(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n_frames = draw(st.integers(1, 12))
    shape = (n_frames, N)
    # Long runs of a value, so that some are steady.
    flips = rng.random(shape) < draw(st.sampled_from([0.1, 0.3]))
    return sequence_of(np.cumsum(flips, axis=0) % 2, rng.random(shape) < 0.9)


def is_steady(document, frame, feature, around):
    values, known = document.features, document.known_features
    near = range(max(0, frame - around), min(len(document), frame + around + 1))
    return all(known[t, feature] and values[t, feature] == values[frame, feature] for t in near)


@given(documents(), st.integers(0, 3))
def test_a_steady_feature_is_known_and_the_same_around(document, around):
    found = unpack(steady_mask(document.packed, document.known, around), N)
    expected = [[is_steady(document, t, f, around) for f in range(N)] for t in range(len(document))]
    np.testing.assert_array_equal(found, expected)


@given(documents(), st.integers(1, 4))
def test_steady_frames_around_are_counted(document, most):
    frames = np.arange(len(document))
    found = count_steady(document, frames, most)
    for t in frames:
        for f in range(N):
            steady = [is_steady(document, t, f, around) for around in range(1, most + 1)]
            assert found[t, f] == (steady.index(False) if False in steady else most)


@given(documents(), documents(), st.integers(0, 3), st.integers(0, N - 1), st.booleans())
def test_loose_reading_finds_either_value_near_a_change(first, second, around, feature, value):
    bit = pack(np.eye(N, dtype=bool)[[feature]])
    query = KeyframeQuery(bit * np.uint64(value), bit, (), FULL_BODY.name, FULL_BODY.ids)
    found = search_query(query, loose_index([first, second], around))
    for number, document in enumerate([first, second]):
        shown = (document.features[:, feature] == value) & document.known_features[:, feature]
        expected = [shown[max(0, t - around) : t + around + 1].any() for t in range(len(document))]
        frames = np.zeros(len(document), dtype=bool)
        for start, stop in found.of(number):
            frames[start:stop] = True
        np.testing.assert_array_equal(frames, expected)


@given(documents(), st.integers(0, 2), st.integers(0, N - 1), st.booleans())
def test_strict_loose_and_plain_readings_include_each_other(document, around, feature, value):
    bit = pack(np.eye(N, dtype=bool)[[feature]])
    query = KeyframeQuery(bit * np.uint64(value), bit, (), FULL_BODY.name, FULL_BODY.ids)
    plain = search_packed(query, document.packed, document.known).n_frames
    strict = search_query(query, strict_index([document], around)).n_frames
    loose = search_query(query, loose_index([document], around)).n_frames
    assert strict <= plain <= loose
    if around == 0:
        assert strict == plain == loose


def ranges_of(*rows) -> HitRanges:
    return HitRanges(*np.array(rows, dtype=np.int64).reshape(-1, 3).T)


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
