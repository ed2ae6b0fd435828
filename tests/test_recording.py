"""Recordings, segments of seconds, ranges of frames, and runs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput
from motionary.recording import FrameRange, Recording, Segment, find_runs, split_runs

TAKE = Recording("take.bvh", person="Ana", rate_hz=60.0, n_frames=120, first_frame=7)


def test_recordings_are_values():
    assert Recording("a", rate_hz=30.0) == Recording("a", rate_hz=30.0)
    assert len({TAKE, TAKE.renamed("take.bvh")}) == 1
    assert str(TAKE) == "take.bvh"
    assert (TAKE.duration_s, Recording("a").duration_s) == (2.0, 0.0)


def test_a_part_keeps_name_person_rate_and_the_files_numbers():
    part = TAKE.part(10, 40)
    assert part == Recording("take.bvh", person="Ana", rate_hz=60.0, n_frames=30, first_frame=17)


@pytest.mark.parametrize("rate_hz", [23.976, 29.97, 30.0, 100.0, 120.0])
def test_a_time_computed_from_a_frame_finds_the_frame(rate_hz):
    recording = Recording("a", rate_hz=rate_hz, n_frames=1000, first_frame=5)
    for frame in range(1000):
        assert recording.frame_at(frame / rate_hz) == 5 + frame
        assert recording.last_frame_before((frame + 1) / rate_hz) == 5 + frame
    assert (recording.frame_at(-1.0), recording.frame_at(1e9)) == (5, 1004)


@pytest.mark.parametrize("wrong", [{"rate_hz": -1.0}, {"rate_hz": np.nan}, {"n_frames": -1}])
def test_impossible_recordings_are_refused(wrong):
    with pytest.raises(InvalidInput, match=next(iter(wrong))):
        Recording("a", **wrong)


def test_segments_are_half_open():
    one, touching, inside = Segment(1.0, 2.0), Segment(2.0, 3.0), Segment(1.5, 4.0)
    assert not one.overlaps(touching)
    assert one.intersection(touching) is None
    assert one.intersection(inside) == inside.intersection(one) == Segment(1.5, 2.0)
    assert (one.duration_s, FrameRange(3, 9).n_frames) == (1.0, 6)


@given(st.lists(st.booleans(), max_size=30))
def test_runs_of_true_hold_all_that_is_true_and_are_longest(flags):
    mask = np.array(flags, dtype=np.bool_)
    covered = np.zeros_like(mask)
    previous = -1
    for start, stop in find_runs(mask).tolist():
        assert previous < start < stop
        covered[start:stop] = True
        previous = stop
    assert np.array_equal(covered, mask)


@given(st.lists(st.integers(0, 2), max_size=30))
def test_runs_of_equal_values_cover_all_and_change_at_each_border(values):
    runs = split_runs(np.array(values, dtype=np.intp))
    assert [i for start, stop in runs for i in range(start, stop)] == list(range(len(values)))
    assert all(len({*values[start:stop]}) == 1 for start, stop in runs)
    assert all(values[run.start] != values[run.start - 1] for run in runs[1:])


def test_rows_are_equal_where_all_of_them_is():
    rows = np.array([[0, 1], [0, 1], [0, 2], [0, 1]])
    assert split_runs(rows) == [(0, 2), (2, 3), (3, 4)]
