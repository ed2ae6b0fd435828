"""Annotation against its definition, on random matches and distance functions."""

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.matching import Alignment, annotate_distances, modify
from oracles import annotation as oracle

NO_PATH = np.empty((0, 2), dtype=np.intp)
# Few different costs, so that ties, plateaus and equal classes are common.
COSTS = [0.0, 0.01, 0.02, 0.03]


@st.composite
def matches(draw):
    """A number of frames, and matches (first, last, cost) within them."""
    n_frames = draw(st.integers(1, 30))
    frame = st.integers(0, n_frames - 1)
    drawn = draw(st.lists(st.tuples(frame, frame, st.sampled_from(COSTS)), max_size=8))
    return n_frames, [(min(a, b), max(a, b), cost) for a, b, cost in drawn]


@st.composite
def distances(draw):
    """Modified distance functions of up to four classes."""
    n_frames, n_classes = draw(st.integers(1, 24)), draw(st.integers(1, 4))
    cost = st.sampled_from([*COSTS, inf])
    row = st.lists(cost, min_size=n_frames, max_size=n_frames)
    return draw(st.lists(row, min_size=n_classes, max_size=n_classes))


def flat(segments):
    return [(segment.class_index, *segment.frames) for segment in segments]


def as_alignments(drawn):
    return [Alignment(first, last, cost, NO_PATH) for first, last, cost in drawn]


@given(matches())
def test_the_modified_distance_is_the_least_cost_of_the_matches_around_a_frame(case):
    n_frames, drawn = case
    modified, owner = modify(as_alignments(drawn), n_frames=n_frames)
    assert modified.tolist() == oracle.modified_distance(drawn, n_frames)
    for frame, number in enumerate(owner):
        if number < 0:
            assert modified[frame] == inf
        else:
            first, last, cost = drawn[number]
            assert first <= frame <= last
            assert cost == modified[frame]
            # Of equal matches the first owns the frame.
            earlier = drawn[:number]
            assert not any(a <= frame <= b and c == cost for a, b, c in earlier)


@given(distances())
def test_segments_are_those_of_the_definition(rows):
    found = annotate_distances([np.array(row) for row in rows])
    assert flat(found) == oracle.segments(rows)


@given(st.lists(matches(), min_size=1, max_size=4))
def test_from_matches_to_segments(cases):
    n_frames = max(n for n, _ in cases)
    modified = [modify(as_alignments(drawn), n_frames=n_frames)[0] for _, drawn in cases]
    expected = oracle.segments([oracle.modified_distance(drawn, n_frames) for _, drawn in cases])
    assert flat(annotate_distances(modified)) == expected


@given(distances())
def test_every_labelled_frame_is_covered_by_its_class_and_no_other_frame_is(rows):
    covered = {
        (frame, segment.class_index)
        for segment in annotate_distances([np.array(row) for row in rows])
        for frame in range(*segment.frames)
    }
    for frame, number in enumerate(oracle.labels(rows)):
        assert number is None or (frame, number) in covered
    assert all(rows[number][frame] < inf for frame, number in covered)


# -- the definition, on examples that a person can follow --------------------------------


def segments_of(*rows):
    found = annotate_distances([np.array(row) for row in rows])
    assert flat(found) == oracle.segments(list(rows))
    return flat(found)


def test_nothing_and_no_class():
    assert annotate_distances([]) == []
    assert segments_of([inf, inf]) == []
    assert annotate_distances([np.empty(0)]) == []


def test_ties_go_to_the_smaller_class():
    assert segments_of([0.02, 0.02], [0.02, 0.02]) == [(0, 0, 2)]


def test_a_class_extends_into_another_where_its_own_distance_does_not_rise():
    first = [0.01, 0.01, 0.01, inf, inf]
    second = [inf, 0.02, 0.02, 0.02, 0.02]
    assert segments_of(first, second) == [(0, 0, 3), (1, 1, 5)]


def test_a_rising_distance_ends_the_extension():
    first = [0.01, 0.01, 0.01, inf, inf]
    second = [inf, 0.03, 0.02, 0.02, 0.02]
    assert segments_of(first, second) == [(0, 0, 3), (1, 2, 5)]


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ([0.01, inf, 0.01], [(0, 0, 1), (0, 2, 3)]),
        ([0.01, 0.02, 0.01], [(0, 0, 3)]),
        ([inf, 0.02, inf], [(0, 1, 2)]),
    ],
)
def test_infinite_frames_part_segments(row, expected):
    assert segments_of(row) == expected


def test_one_class_around_another_becomes_one_segment():
    around = [0.02, 0.02, 0.02, 0.02, 0.02]
    inside = [inf, inf, 0.01, inf, inf]
    assert segments_of(around, inside) == [(0, 0, 5), (1, 2, 3)]
