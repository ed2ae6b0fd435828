"""Do the baselines compute what their publications say, on motions and on edges?"""

from dataclasses import replace

import numpy as np
import pytest
from evidence.baselines import (
    BASELINES,
    FrameTraining,
    Window,
    feature_frames,
    find_example,
    match_costs,
    position_frames,
    position_windows,
    rotation_frames,
    train_frame_classifier,
)
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput
from motionary.features import compute_features
from motionary.io import read
from motionary.matching import Pattern, distance_function
from motionary.motion import GENERIC_JOINTS
from motionary.packing import full_mask
from motionary.rotations import euler_to_quaternions, quaternions_to_matrices
from motionary.samples import synthetic_motion, synthetic_stream
from oracles import baselines as slow
from oracles import matching as oracle

WITHOUT_ROTATIONS = [name for name in BASELINES if name != "quaternions"]


@given(
    st.integers(1, 5),
    st.integers(1, 12),
    st.sampled_from([1.0, 2.0]),
    st.integers(0, 2**32 - 1),
)
def test_matches_are_those_of_the_definition(n_columns, n_frames, skip_weight, seed):
    costs = np.random.default_rng(seed).integers(0, 8, size=(n_columns, n_frames)).astype(float)
    matches = match_costs(costs, skip_weight=skip_weight)
    expected = oracle.best_matches(costs.tolist(), skip_weight=skip_weight)
    np.testing.assert_allclose(matches.distance, [cost for cost, _ in expected])
    starts = [path[0][1] if path else -1 for _, path in expected]
    assert matches.starts.tolist() == starts


def test_no_path_leads_through_infinite_cells():
    costs = np.zeros((3, 6))
    costs[:, 2:4] = np.inf
    matches = match_costs(costs)
    assert np.isinf(matches.distance[2:5]).all()
    assert (matches.starts[2:5] == -1).all()


def test_relations_of_one_example_are_matched_as_words_with_equal_weights():
    example, stream = (compute_features(synthetic_motion("squat", seed=s)) for s in (0, 3))
    pattern = Pattern(
        example.packed, np.tile(full_mask(1, 40), (len(example), 1)), np.ones(len(example))
    )
    expected = distance_function(pattern, stream.packed)
    way = BASELINES["relations"]
    frames = [way.measure(synthetic_motion("squat", seed=s)) for s in (0, 3)]
    distance = match_costs(way.costs(*frames)).distance
    np.testing.assert_allclose(distance, expected, rtol=1e-5, atol=1e-6)


def test_relations_that_are_unknown_do_not_count():
    frames = feature_frames(synthetic_motion("bow", seed=1))
    hidden = frames.copy()
    hidden[:, :5] = np.nan
    costs = BASELINES["relations"].costs(frames, hidden)
    np.testing.assert_allclose(costs, BASELINES["relations"].costs(frames[:, 5:], frames[:, 5:]))
    hidden[:, :21] = np.nan
    assert (BASELINES["relations"].costs(frames, hidden) == 1).all()


def test_costs_are_those_of_the_definition():
    random = np.random.default_rng(0)
    q, p = (random.normal(size=(n, 3, 4)) for n in (4, 5))
    q, p = (one / np.linalg.norm(one, axis=-1, keepdims=True) for one in (q, p))
    np.testing.assert_allclose(BASELINES["quaternions"].costs(q, p), slow.angles(q, p), atol=1e-6)
    x, y = random.normal(size=(4, 3, 3)), random.normal(size=(5, 3, 3))
    np.testing.assert_allclose(BASELINES["positions"].costs(x, y), slow.distances(x, y))
    # A joint that is not seen does not count.
    x[1, 2] = np.nan
    y[3] = np.nan
    costs = BASELINES["positions"].costs(x, y)
    np.testing.assert_allclose(costs[1, 0], slow.distances(x[1:2, :2], y[:1, :2])[0][0])
    assert np.isinf(costs[:, 3]).all()


def turned_about(axis, degrees):
    return quaternions_to_matrices(euler_to_quaternions(np.radians([degrees]), axis))


def placed(motion, *, degrees=0.0, shift=(0, 0, 0), size=1.0):
    turn = turned_about("Y", degrees)
    return replace(
        motion, positions=motion.positions @ turn.T * size + np.array(shift), rotations=None
    )


@pytest.mark.parametrize("name", WITHOUT_ROTATIONS)
def test_where_who_and_which_way_do_not_matter(name):
    motion = synthetic_motion("kick_left", seed=2)
    elsewhere = placed(motion, degrees=130, shift=(4, 0, -2), size=1.2)
    way = BASELINES[name]
    costs = way.costs(way.measure(motion), way.measure(elsewhere))
    assert match_costs(costs).distance[-1] < 0.01


def test_only_the_whole_rotation_forgets_who_lies():
    motion = synthetic_motion("squat", seed=2)
    positions = motion.positions @ turned_about("X", 90.0).T
    tipped = replace(motion, positions=positions, rotations=None)
    upright = [position_frames(one, removed="rotation") for one in (motion, tipped)]
    np.testing.assert_allclose(upright[0], upright[1], atol=1e-9)
    turned = [position_frames(one) for one in (motion, tipped)]
    assert np.abs(turned[0] - turned[1]).max() > 0.5


def test_rotations_forget_the_root_and_the_sign(data):
    motion = read(next((data / "hdm05").rglob("HDM_mm_squat*_037_120.amc")))
    frames = rotation_frames(motion)
    assert frames.shape[1] == (motion.skeleton.parents >= 0).sum()
    assert len(frames) == len(compute_features(motion))
    flipped = motion.rotations.copy()
    flipped[::2] *= -1
    again = rotation_frames(replace(motion, rotations=flipped))
    np.testing.assert_allclose(np.abs(np.sum(frames * again, axis=-1)), 1)
    costs = BASELINES["quaternions"].costs(frames, frames)
    assert costs.diagonal().max() < 1e-6 < costs[0, len(frames) // 2]


@pytest.mark.parametrize("name", WITHOUT_ROTATIONS)
def test_an_example_is_found_in_a_stream(name):
    stream, truth = synthetic_stream(["squat", "kick_left", "bow"], seed=1)
    example = synthetic_motion("kick_left", seed=5)
    (start, end) = next((s, e) for label, s, e in truth if label == "kick_left")
    best, *rest = find_example(example, stream, baseline=name)
    assert min(best.stop, 30 * end) - max(best.start, 30 * start) > 15
    assert all(hit.cost >= best.cost for hit in rest)
    assert len(find_example(example, stream, baseline=name, limit=1)) == 1
    assert find_example(example, stream, baseline=name, threshold=best.cost / 2) == []


def test_examples_of_people_are_found_again(data):
    folder = data / "hdm05"
    paths = [next(folder.rglob(f"HDM_{who}_squat*.amc")) for who in ("bd", "mm")]
    example, other = (read(path) for path in paths)
    kick = read(next(folder.rglob("HDM_mm_kickLFront*.amc")))
    for name in BASELINES:
        best = [find_example(example, one, baseline=name, limit=1)[0].cost for one in (other, kick)]
        assert best[0] < best[1], name


def test_windows_are_seen_from_the_body():
    motion = synthetic_motion("kick_right", seed=0)
    windows = position_windows(motion)
    assert windows.shape == (len(compute_features(motion)), 7 * 72)
    elsewhere = placed(motion, degrees=-70, shift=(1, 0, 9), size=0.9)
    np.testing.assert_allclose(windows, position_windows(elsewhere), atol=1e-9)
    middle = windows.reshape(len(windows), 7, 24, 3)[:, 3]
    np.testing.assert_allclose(middle[:, GENERIC_JOINTS.index("root")], 0, atol=1e-12)
    np.testing.assert_allclose(middle, position_frames(motion), atol=1e-9)


def test_frames_are_told_apart():
    names = ("squat", "kick_left", "bow")
    examples = {
        name: [position_windows(synthetic_motion(name, seed=s)) for s in range(3)] for name in names
    }
    quick = FrameTraining(cosines=64, rounds=40)
    machine = train_frame_classifier(examples, training=quick)
    for name in names:
        unseen = position_windows(synthetic_motion(name, seed=7))
        guessed = machine.classify(unseen)
        assert np.mean([one == name for one in guessed]) > 0.5
        assert machine.scores(unseen).shape == (len(unseen), 3)
    again = train_frame_classifier(examples, training=quick)
    np.testing.assert_array_equal(machine.weights, again.weights)


def test_the_kernel_is_not_linear():
    # Rings around each other: no plane parts them.
    random = np.random.default_rng(0)
    angle = random.uniform(0, 2 * np.pi, size=(2, 300))
    rings = [
        radius * np.column_stack([np.cos(a), np.sin(a)])
        for radius, a in zip((1, 3), angle, strict=True)
    ]
    machine = train_frame_classifier(
        {"inner": [rings[0]], "outer": [rings[1]]}, training=FrameTraining(cosines=60, rounds=60)
    )
    assert np.mean(np.array(machine.classify(rings[0])) == "inner") > 0.99
    assert np.mean(np.array(machine.classify(rings[1])) == "outer") > 0.99


MOTION = synthetic_motion("bow", seed=0)
UNSEEN = replace(MOTION, positions=np.full_like(MOTION.positions, np.nan), rotations=None)
TRAINED = train_frame_classifier({"a": [np.zeros((3, 2))], "b": [np.ones((3, 2))]})


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: match_costs(np.zeros((0, 3))), "at least one of each"),
        (lambda: match_costs(np.zeros(3)), r"shape \(columns, frames\)"),
        (lambda: match_costs([[0.0, np.nan]]), "NaN"),
        (lambda: match_costs([[0.0, -1.0]]), "negative"),
        (lambda: find_example(MOTION, MOTION, baseline="joints"), "baseline must be one of"),
        (lambda: rotation_frames(replace(MOTION, rotations=None)), "need local rotations"),
        (lambda: position_frames(UNSEEN), "no frame shows"),
        (lambda: position_frames(MOTION, removed="all"), "'heading' or 'rotation'"),
        (lambda: position_windows(UNSEEN), "no frame shows"),
        (lambda: Window(length_s=0.0), "above 0 s"),
        (
            lambda: BASELINES["quaternions"].costs(np.ones((2, 3, 4)), np.ones((2, 5, 4))),
            "the same joints",
        ),
        (lambda: train_frame_classifier({"a": [np.zeros((3, 2))]}), "at least two classes"),
        (lambda: train_frame_classifier({"a": [np.zeros((3, 2))], "b": []}), "two classes"),
        (
            lambda: train_frame_classifier({"a": [np.zeros((3, 2))], "b": [np.zeros((3, 3))]}),
            "alike in all examples",
        ),
        (
            lambda: train_frame_classifier({"a": [np.zeros((3, 2))], "b": [[[np.nan, 1.0]]]}),
            "finite",
        ),
        (lambda: TRAINED.scores(np.zeros((3, 5))), "as in training"),
    ],
)
def test_what_does_not_fit_is_told(call, told):
    with pytest.raises(InvalidInput, match=told):
        call()
