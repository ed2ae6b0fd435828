"""Are the features of dance generation those in print, and the corrected ones right?"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import sqrtm

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, compute_features
from motionary.generation_metrics import (
    JOINTS,
    PUBLISHED_COLUMNS,
    diversity,
    frechet_distance,
    motion_features,
    published_features,
)
from motionary.io import read
from motionary.motion import GENERIC_JOINTS
from motionary.recording import Recording
from motionary.samples import synthetic_motion
from oracles import generation

NAMES = ("86_01_kick", "01_01_jump", "49_18_dance", "bd_throw")


@pytest.mark.parametrize("name", NAMES)
def test_published_features_are_those_of_the_published_code(golden, name):
    with np.load(golden / "generation_features.npz") as file:
        positions = file[f"{name}_60hz_positions"]
        for every, rate in ((1, 60), (2, 30)):
            expected = file[f"{name}_{rate}hz_features"]
            assert np.abs(published_features(positions[::every]) - expected).max() < 1e-6


def test_published_features_of_a_recording_are_those_of_its_array(golden, data):
    with np.load(golden / "generation_features.npz") as file:
        start = file["86_01_kick_60hz_positions"][0, 0]
        expected = file["86_01_kick_60hz_features"]
        n_frames = len(file["86_01_kick_60hz_positions"])
    motion = read(data / "cmu" / "86_01.amc")
    distance = np.abs(motion.generic_positions()[:, 0] - start).max(axis=1)
    first = int(distance.argmin())
    part = motion.cut(first, first + 2 * n_frames)
    halved = replace(
        part, positions=part.positions[::2], rotations=None, recording=Recording(rate_hz=60.0)
    )
    assert np.abs(motion_features(halved, mode="published") - expected).max() < 1e-6


def test_published_features_are_what_the_table_says():
    random = np.random.default_rng(3)
    start = random.normal(size=(1, 24, 3))
    path = start + np.cumsum(random.normal(scale=0.004, size=(40, 24, 3)), axis=0)
    np.testing.assert_allclose(published_features(path), generation.fractions(path.tolist()))


def standing():
    """A pose of a person, 20 times, joints in the order of SMPL."""
    pose = synthetic_motion("squat", seed=0).generic_positions()[0]
    places = [GENERIC_JOINTS.index("chest" if joint == "spine" else joint) for joint in JOINTS]
    return np.repeat(pose[places][np.newaxis], 20, axis=0)


def moved(joint, direction):
    """The standing person with one joint that moves at 2.4 m/s, as the code has it."""
    positions = standing()
    steps = 0.02 * np.arange(len(positions))[:, np.newaxis]
    positions[:, JOINTS.index(joint)] += steps * np.asarray(direction)
    return published_features(positions)


def test_the_columns_have_the_faults_that_are_told():
    pose = standing()[0]
    ahead = pose[JOINTS.index("ltoes")] - pose[JOINTS.index("lankle")]
    ahead[1] = 0
    ahead /= np.linalg.norm(ahead)
    assert moved("rwrist", ahead)[0] == 0
    assert moved("rwrist", -ahead)[0] == 1
    assert moved("lwrist", ahead)[1] == 1
    assert moved("rwrist", (0, 1, 0))[4] == 0
    assert moved("chest", (0, 1, 0))[4:6].tolist() == [1, 1]
    assert len(PUBLISHED_COLUMNS) == 32


@pytest.mark.parametrize("mode", ["published", "corrected"])
@pytest.mark.parametrize("shift", [(3.0, 0.0, -2.0), (0.0, 1.5, 0.0)])
def test_where_a_motion_takes_place_does_not_matter(mode, shift):
    motion = synthetic_motion("kick_left", seed=1)
    moved = replace(motion, positions=motion.positions + np.array(shift))
    np.testing.assert_allclose(
        motion_features(moved, mode=mode), motion_features(motion, mode=mode), atol=0.02
    )


def test_corrected_features_hardly_change_with_the_rate_and_published_ones_do(data):
    motion = read(data / "cmu" / "86_01.amc")
    by_rate = {"published": [], "corrected": []}
    for every in (2, 4):
        thinned = replace(
            motion,
            positions=motion.positions[::every],
            rotations=None,
            recording=Recording(rate_hz=motion.rate_hz / every),
        )
        for mode, values in by_rate.items():
            values.append(motion_features(thinned, mode=mode))
    change = {mode: np.abs(a - b).max() for mode, (a, b) in by_rate.items()}
    assert change["corrected"] < 0.03
    assert change["published"] > 0.2


def test_corrected_features_are_shares_of_what_is_known():
    motion = synthetic_motion("squat", seed=2)
    packed = compute_features(motion)
    np.testing.assert_allclose(motion_features(motion), packed.features.mean(axis=0))
    names = list(motion.names)
    hidden = motion.positions.copy()
    hidden[:, names.index("rfingers")] = np.nan
    fractions = motion_features(replace(motion, positions=hidden, rotations=None))
    assert np.isnan(fractions[FULL_BODY.ids.index("F13")])
    assert np.isfinite(fractions[FULL_BODY.ids.index("F1")])


def test_arrays_are_in_the_order_of_smpl():
    array = np.cumsum(np.random.default_rng(0).normal(scale=0.01, size=(30, 24, 3)), axis=0)
    np.testing.assert_array_equal(
        motion_features(array, mode="published"), published_features(array)
    )
    expected = compute_features(array, rate_hz=60, skeleton="smpl")
    got = motion_features(array, rate_hz=60)
    known = expected.known_features.any(axis=0)
    assert (np.isfinite(got) == known).all()


def test_fid_is_the_distance_of_normal_distributions():
    random = np.random.default_rng(5)
    real, made = random.uniform(size=(60, 4)), random.uniform(size=(50, 4)) ** 2
    mean, scale = real.mean(axis=0), real.std(axis=0)
    a, b = (made - mean) / scale, (real - mean) / scale
    one, two = np.cov(a.T), np.cov(b.T)
    gap = a.mean(axis=0) - b.mean(axis=0)
    expected = gap @ gap + np.trace(one + two - 2 * sqrtm(one @ two).real)
    for mode in ("published", "corrected"):
        assert frechet_distance(made, real, mode=mode) == pytest.approx(expected)


@pytest.mark.parametrize("mode", ["published", "corrected"])
def test_a_set_is_at_no_distance_from_itself(mode):
    features = np.random.default_rng(1).uniform(size=(10, 32))
    assert frechet_distance(features, features, mode=mode) == pytest.approx(0, abs=1e-6)


def test_what_no_real_motion_varies_decides_published_fid_alone():
    random = np.random.default_rng(2)
    real, made = random.uniform(size=(20, 3)), random.uniform(size=(20, 3))
    real[:, 2], made[:, 2] = 0.0, 0.01 * random.uniform(size=20)
    assert frechet_distance(made, real, mode="published") > 1e12
    assert frechet_distance(made, real, mode="corrected") < 10


def test_unknown_features_are_left_out():
    random = np.random.default_rng(4)
    real, made = random.uniform(size=(20, 3)), random.uniform(size=(20, 3))
    expected = frechet_distance(made[:, :2], real[:, :2])
    made[3, 2] = np.nan
    assert frechet_distance(made, real) == pytest.approx(expected)
    assert diversity(made, real) == pytest.approx(diversity(made[:, :2], real[:, :2]))


def test_diversity_is_the_mean_distance_of_pairs():
    features = np.random.default_rng(6).uniform(size=(7, 5))
    scaled = (features - features.mean(axis=0)) / features.std(axis=0)
    assert diversity(features) == pytest.approx(generation.pair_distance(scaled.tolist()))


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: published_features(np.zeros((5, 22, 3))), "24 joints of SMPL"),
        (lambda: published_features(np.zeros((1, 24, 3))), "at least two frames"),
        (lambda: published_features(np.full((5, 24, 3), np.nan)), "not seen"),
        (lambda: motion_features(np.zeros((5, 24, 3)), mode="geometric"), "mode must be"),
        (lambda: motion_features(np.zeros((5, 24, 3))), "rate_hz="),
        (
            lambda: motion_features(np.zeros((5, 22, 3)), mode="published", skeleton="humanml3d"),
            "SMPL's 24 joints only",
        ),
        (lambda: frechet_distance(np.zeros((1, 3)), np.zeros((4, 3))), "at least two motions"),
        (lambda: frechet_distance(np.zeros((4, 2)), np.zeros((4, 3))), "the same features"),
        (lambda: frechet_distance(np.full((4, 2), np.nan), np.zeros((4, 2))), "known in every"),
        (
            lambda: frechet_distance(np.full((4, 2), np.nan), np.ones((4, 2)), mode="published"),
            "never NaN",
        ),
        (lambda: diversity(np.zeros((4, 2)), mode="odd"), "mode must be"),
    ],
)
def test_what_does_not_fit_is_told(call, told):
    with pytest.raises(InvalidInput, match=told):
        call()
