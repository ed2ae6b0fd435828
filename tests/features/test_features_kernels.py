"""Do the relations, their switch and their velocities equal slow transcriptions?"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.features import FULL_BODY, FULL_BODY_2006, feature_matrix
from motionary.features.body import smoothed_velocity, window_frames
from motionary.features.feature_set import hysteresis
from oracles import features as oracle

# Together they show all relations both ways.
SEEDS = (0, 1, 2, 3, 4, 5, 10)
STATES = st.sampled_from(["unknown", "neither", "weak", "strong"])


def switch_inputs(states):
    strong = np.array([s == "strong" for s in states], dtype=bool)
    weak = np.array([s in ("weak", "strong") for s in states], dtype=bool)
    return strong, weak, np.array([s != "unknown" for s in states], dtype=bool)


def random_positions(seed, *, frames):
    """Smooth random tracks of 24 joints around a standing figure, wild or tame."""
    wildness = (0.7, 0.2, 0.1)[seed % 3]
    rng = np.random.default_rng(seed)
    t = np.arange(frames)[:, None, None] / 120
    waves = [
        rng.normal(0, wildness / 2, (1, 24, 3)) * np.sin(t * rng.uniform(1, 9, (1, 24, 3)) + phase)
        for phase in rng.uniform(0, 6, 3)
    ]
    return oracle.as_array([oracle.standing()]) + np.sum(waves, axis=0)


@given(st.lists(STATES, min_size=1, max_size=40), st.booleans())
def test_hysteresis_equals_the_state_machine(states, before):
    strong, weak, known = switch_inputs(states)
    expected = oracle.hysteresis(strong, weak, known, before)
    assert hysteresis(strong, weak, known, before=before).tolist() == expected.tolist()


@given(st.lists(STATES, min_size=2, max_size=40), st.data())
def test_hysteresis_of_chunks_is_that_of_the_whole(states, data):
    strong, weak, known = switch_inputs(states)
    cut = data.draw(st.integers(1, len(states) - 1))
    head = hysteresis(strong[:cut], weak[:cut], known[:cut])
    tail = hysteresis(strong[cut:], weak[cut:], known[cut:], before=bool(head[-1]))
    whole = hysteresis(strong, weak, known)
    assert np.concatenate([head, tail]).tolist() == whole.tolist()


@given(
    seed=st.integers(0, 2**32 - 1),
    frames=st.integers(1, 100),
    window_ms=st.sampled_from([0, 17, 100, 250]),
    n_gaps=st.integers(0, 2),
)
def test_velocity_equals_its_definition(seed, frames, window_ms, n_gaps):
    rng = np.random.default_rng(seed)
    track = np.cumsum(rng.normal(size=(frames, 3)), axis=0)
    for start in rng.integers(0, frames, n_gaps):
        track[start : start + rng.integers(1, 6)] = np.nan
    width = window_frames(window_ms / 1000, 120)
    got = smoothed_velocity(track.T, width=width, rate_hz=120).T
    expected = oracle.smoothed_velocity(track, window_ms)
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-9)


@given(
    seed=st.integers(0, 2**32 - 1),
    lengths=st.lists(st.integers(1, 60), min_size=2, max_size=5),
    width=st.sampled_from([1, 2, 12, 30]),
)
def test_recordings_one_after_the_other_are_those_alone(seed, lengths, width):
    rng = np.random.default_rng(seed)
    tracks = [np.cumsum(rng.normal(size=(3, n)), axis=1) for n in lengths]
    for track in tracks:
        track[:, rng.random(track.shape[1]) < 0.03] = np.nan
    starts = (0, *np.cumsum(lengths[:-1]).tolist())
    alone = [smoothed_velocity(track, width=width, rate_hz=120) for track in tracks]
    joined = np.concatenate(tracks, axis=1)
    together = smoothed_velocity(joined, width=width, rate_hz=120, starts=starts)
    np.testing.assert_array_equal(together, np.concatenate(alone, axis=1))

    states = [
        switch_inputs(rng.choice(["unknown", "neither", "weak", "strong"], n)) for n in lengths
    ]
    switched = [hysteresis(*each) for each in states]
    whole = hysteresis(*map(np.concatenate, zip(*states, strict=True)), starts=starts)
    np.testing.assert_array_equal(whole, np.concatenate(switched))


def test_windows_are_those_of_the_table():
    assert [window_frames(s, 120.0) for s in (0.0, 0.1, 0.25)] == [1, 12, 30]
    assert window_frames(0.1, 30.0) == 3


def test_the_end_of_a_track_is_reflected_with_its_edge():
    track = np.array([[0.0, 1.0, 3.0, 6.0]] * 3)
    # Differences 1, 2, 3, 3; of three, from one before to one after.
    got = smoothed_velocity(track, width=3, rate_hz=3.0)
    assert got[0].tolist() == [4.0, 6.0, 8.0, 9.0]


@pytest.mark.parametrize("seed", SEEDS)
def test_relations_of_random_movement_equal_the_transcription(seed):
    positions = random_positions(seed, frames=150)
    features, known = feature_matrix(positions, FULL_BODY)
    expected, expected_known = oracle.features(oracle.as_tracks(positions))
    assert FULL_BODY.ids == tuple(oracle.IDS)
    assert known.all()
    assert expected_known.all()
    assert np.argwhere(features != expected).tolist() == []


def test_random_movement_shows_every_relation_both_ways():
    positions = [random_positions(seed, frames=150) for seed in SEEDS]
    shown = np.concatenate([feature_matrix(p, FULL_BODY)[0] for p in positions])
    assert shown.any(axis=0).all()
    assert not shown.all(axis=0).any()


@pytest.mark.parametrize("seed", range(6))
def test_relations_with_gaps_equal_the_transcription(seed):
    rng = np.random.default_rng(seed)
    positions = random_positions(seed, frames=90)
    for joint in rng.choice(24, 6, replace=False):
        start = rng.integers(0, 90)
        # Some gaps begin with the first frame, where lengths are measured.
        positions[0 if rng.random() < 0.5 else start : start + rng.integers(1, 40), joint] = np.nan
    features, known = feature_matrix(positions, FULL_BODY)
    expected, expected_known = oracle.features(oracle.as_tracks(positions))
    assert np.argwhere(known != expected_known).tolist() == []
    assert np.argwhere(features != expected).tolist() == []
    assert not known.all()


def test_thresholds_and_tests_are_those_of_the_table():
    positions = oracle.as_array([oracle.standing()] * 2)
    table = oracle.table(oracle.as_tracks(positions))
    for feature in FULL_BODY.features:
        _, test, weak, strong = table[feature.id]
        if test == "in":
            assert (feature.weak, feature.strong) == (
                (90 - weak, 90 + weak),
                (90 - strong, 90 + strong),
            )
        else:
            assert (feature.test, feature.weak, feature.strong) == (test, weak, strong)


def test_the_state_before_a_piece_carries_on():
    positions = random_positions(3, frames=200)
    whole, _ = feature_matrix(positions, FULL_BODY_2006)
    # Every pose but the first is that of the piece; lengths are of the first frame.
    static = [i for i, r in enumerate(FULL_BODY_2006.features) if r.id in ("F7", "F8", "F20")]
    piece, _ = feature_matrix(positions[77:], FULL_BODY_2006, before=whole[76])
    assert np.array_equal(piece[:, static], whole[77:, static])
