"""Live labels are those of the whole recording, however its poses arrive."""

from dataclasses import replace

import numpy as np
import pytest

import motionary as mo
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FULL_BODY, FeatureStream
from motionary.live.poses import MOST_GAP_S, EvenTimes
from motionary.models.library import load_everyday
from motionary.motion import GENERIC_JOINTS
from motionary.samples import SYNTHETIC_CLASSES, synthetic_stream

RATE_HZ = 60.0


def chunks(n, sizes, seed=0):
    """Beginnings and ends of chunks; of random sizes where `sizes` is 0."""
    rng, start = np.random.default_rng(seed), 0
    while start < n:
        stop = min(n, start + (sizes or int(rng.integers(1, 60))))
        yield slice(start, stop)
        start = stop


@pytest.fixture(scope="module")
def take():
    """A stream of planted motions, of which a stretch and an arm for a while are not seen."""
    motion, _ = synthetic_stream(SYNTHETIC_CLASSES, seed=3, rate_hz=RATE_HZ)
    positions = motion.generic_positions()[: int(18 * RATE_HZ)].copy()
    positions[:40] = np.nan
    positions[400:460] = np.nan
    positions[700:900, 10:13] = np.nan
    return positions


def facts(label):
    return (
        label.name, label.start_s, label.end_s, label.start_frame, label.end_frame, label.score,
        label.cost, label.probability, label.false_per_min, label.known, label.side,
    )  # fmt: skip


def run(positions, sizes):
    """Events, each with how much had been seen when it came."""
    annotator = mo.LiveAnnotator(rate_hz=RATE_HZ, threshold=4.0)
    events = []
    for part in chunks(len(positions), sizes):
        found = annotator.push(positions[part])
        events += [(annotator.duration_s, event) for event in found]
    return [*events, *((annotator.duration_s, event) for event in annotator.finish())]


@pytest.fixture(scope="module")
def in_fives(take):
    return run(take, 5)


@pytest.fixture(scope="module")
def offline(take):
    sequence = mo.compute_features(take, rate_hz=RATE_HZ)
    return mo.annotate(sequence, load_everyday(), threshold=4.0, assignment="scores")


@pytest.mark.parametrize("sizes", [5, 100, 0])
def test_what_is_final_is_what_annotate_gives(take, offline, in_fives, sizes):
    events = in_fives if sizes == 5 else run(take, sizes)
    final = sorted(facts(event.label) for _, event in events if event.status == "final")
    assert len(final) > 3
    assert final == sorted(map(facts, offline))


def test_what_is_not_assessed_is_what_annotate_tells(offline, in_fives):
    found = [event.label for _, event in in_fives if event.status == "unassessed"]
    assert [(one.start_s, one.end_s) for one in found] == [tuple(one) for one in offline.unassessed]
    assert len(found) >= 2


def test_a_stream_that_is_saved_goes_on_as_if_it_had_not_been(take, in_fives, tmp_path):
    path = tmp_path / "state.npz"
    annotator = mo.LiveAnnotator(rate_hz=RATE_HZ, threshold=4.0)
    events = []
    for i, part in enumerate(chunks(len(take), 5)):
        events += annotator.push(take[part])
        # Before anything is seen, in a gap, and where labels are open.
        if i in (4, 9, 85, 150):
            annotator.save(path)
            annotator = mo.LiveAnnotator.resume(path)
    assert [*events, *annotator.finish()] == [event for _, event in in_fives]


def test_times_go_on_after_a_break_and_other_files_and_libraries_are_refused(take, tmp_path):
    path, other = tmp_path / "state.npz", tmp_path / "other.npz"
    annotator = mo.LiveAnnotator(rate_hz=RATE_HZ, skeleton=GENERIC_JOINTS)
    annotator.push(take[500:503], [7.0, 7.1, 7.2])
    annotator.save(path)
    again = mo.LiveAnnotator.resume(path)
    with pytest.raises(InvalidInput, match=r"got 7.15 s after 7.2 s"):
        again.push(take[503], 7.15)
    again.push(take[503], 7.25)
    assert again.duration_s == pytest.approx(16 / RATE_HZ)
    with pytest.raises(UnreadableFile, match="no such file"):
        mo.LiveAnnotator.resume(other)
    np.savez(other, facts=np.zeros(3, dtype=np.uint8))
    for content in (b"", b"PK\x03\x04 cut", path.read_bytes()[:5000], other.read_bytes()):
        other.write_bytes(content)
        with pytest.raises(UnreadableFile):
            mo.LiveAnnotator.resume(other)
    everyday = load_everyday()
    with pytest.raises(InvalidInput, match="another library"):
        mo.LiveAnnotator.resume(path, replace(everyday, classes=everyday.classes[:3]))


@pytest.mark.parametrize("rate_hz", [24.0, 30.0, 90.0, 120.0])
def test_features_are_those_of_the_whole_at_any_rate(take, rate_hz):
    positions = take[:333]
    whole = mo.compute_features(positions, rate_hz=rate_hz)
    stream = FeatureStream(FULL_BODY, rate_hz)
    parts = [stream.push(positions[part]) for part in chunks(len(positions), 0)]
    packed, known = (np.concatenate(p) for p in zip(*parts, stream.finish(), strict=True))
    assert np.array_equal(packed, whole.packed)
    assert np.array_equal(known, whole.known)


def test_of_one_pose_and_of_none_the_features_are_those_of_the_whole(take):
    for n in (0, 1, 2):
        stream = FeatureStream(FULL_BODY, RATE_HZ)
        (before, _), (after, _) = stream.push(take[500 : 500 + n]), stream.finish()
        packed = np.concatenate([before, after])
        assert len(packed) == min(n, 1)
        if n:
            whole = mo.compute_features(take[500 : 500 + n], rate_hz=RATE_HZ)
            assert np.array_equal(packed, whole.packed)


def test_a_length_that_is_first_seen_late_in_the_first_second_counts_from_the_beginning(take):
    positions = take[600:900].copy()
    positions[:30, 10:24] = np.nan
    whole = mo.compute_features(positions, rate_hz=RATE_HZ)
    stream = FeatureStream(FULL_BODY, RATE_HZ)
    early, _ = stream.push(positions[:50])
    assert len(early) == 0
    later = [stream.push(positions[50:])[0], stream.finish()[0]]
    assert np.array_equal(np.concatenate(later), whole.packed)


def test_each_label_is_foreseen_then_final_and_told_once(in_fives):
    events = [event for _, event in in_fives]
    final = [event for event in events if event.status == "final"]
    assert len({event.id for event in final}) == len(final)
    assert all(event.why for event in final)
    ended = set()
    for event in events:
        assert event.id not in ended
        if event.status in ("final", "withdrawn"):
            ended.add(event.id)
    foreseen = {event.id for event in events if event.status == "provisional"}
    assert len({event.id for event in final} & foreseen) >= len(final) - 1


def test_events_are_final_within_the_look_ahead(in_fives, take):
    annotator = mo.LiveAnnotator(rate_hz=RATE_HZ)
    kinds = {one.name: one.kind for one in annotator.library}
    late = [
        seen_s - event.label.end_s - annotator.look_ahead_s
        for seen_s, event in in_fives
        if event.status == "final" and kinds[event.label.name] == "event"
    ]
    assert late
    # A chunk comes as a whole.
    assert max(late) <= 5 / RATE_HZ + 1e-9


def test_poses_at_uneven_times_are_those_between_them(take):
    rng = np.random.default_rng(5)
    times = (np.arange(200) + rng.uniform(-0.3, 0.3, 200)) / RATE_HZ + 1000.0
    positions = take[500:700]
    even = EvenTimes(RATE_HZ)
    parts = [even.push(positions[part], times[part]) for part in chunks(200, 0)]
    found = np.concatenate(parts)
    at = times[0] + np.arange(len(found)) / RATE_HZ
    assert len(found) in (199, 200)
    for joint in (0, 5, 23):
        for axis in range(3):
            expected = np.interp(at, times, positions[:, joint, axis])
            assert found[:, joint, axis] == pytest.approx(expected, abs=1e-9, nan_ok=True)


def test_poses_far_apart_leave_a_gap_between_them(take):
    positions = take[500:520]
    times = np.arange(20) / RATE_HZ
    times[10:] += 2 * MOST_GAP_S
    found = EvenTimes(RATE_HZ).push(positions, times)
    n_gap = round(2 * MOST_GAP_S * RATE_HZ)
    assert len(found) == 20 + n_gap
    assert np.isnan(found[10 : 10 + n_gap]).all()
    assert found[10 + n_gap :] == pytest.approx(positions[10:], abs=1e-9)


def test_times_that_a_clock_rounds_are_even(take):
    positions = take[380:420]
    for first, digits in ((0.0, 6), (1.8e9, 7)):
        times = np.round(first + np.arange(40) / RATE_HZ, digits)
        even = EvenTimes(RATE_HZ)
        found = np.concatenate([even.push(positions[p], times[p]) for p in chunks(40, 3)])
        assert np.array_equal(np.isnan(found), np.isnan(positions))
        assert found == pytest.approx(positions, abs=1e-9, nan_ok=True)


def test_what_does_not_fit_is_refused_and_nothing_is_kept(take):
    annotator = mo.LiveAnnotator(rate_hz=RATE_HZ)
    annotator.push(take[:2], [0.0, 0.1])
    for positions, times, what in (
        (take[:1], [0.05], "backwards"),
        (take[:1], [np.nan], "times must grow"),
        (take[:1], [1e6], "at most 60 s apart"),
        (take[:2], [0.2], "as many times"),
        (take[:1, :7], None, "24 joints"),
    ):
        with pytest.raises(InvalidInput, match=what):
            annotator.push(positions, times)
    assert annotator.duration_s == pytest.approx(7 / RATE_HZ)
    annotator.finish()
    assert annotator.finish() == ()
    with pytest.raises(InvalidInput, match="finished"):
        annotator.push(take[:1])
    with pytest.raises(InvalidInput, match="rate_hz"):
        mo.LiveAnnotator(rate_hz=0)
