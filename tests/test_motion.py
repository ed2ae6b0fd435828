"""Does a recording hold what it says, and do its joints lie where the tree puts them?"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput
from motionary.motion import (
    GENERIC_JOINTS,
    JointMapping,
    Motion,
    Skeleton,
    forward_kinematics,
    resample,
)
from motionary.recording import Recording
from oracles import kinematics as oracle


def random_skeleton(rng, n_joints, *, ends):
    parents = np.array([-1] + [rng.integers(-1, i) for i in range(1, n_joints)], dtype=np.intp)
    names = tuple(f"joint {i}" for i in range(n_joints))
    return Skeleton(names, parents, rng.normal(size=(n_joints, 3)), ends=ends)


def random_rotations(rng, *shape):
    angles = rng.uniform(-180, 180, (*shape, 3))
    flat = [oracle.about_moving_axes("ZXY", row) for row in angles.reshape(-1, 3)]
    return np.array(flat).reshape(*shape, 3, 3)


@given(st.integers(1, 9), st.booleans(), st.integers(0, 2**32 - 1))
def test_forward_kinematics_is_the_joint_by_joint_sum(n_joints, ends, seed):
    rng = np.random.default_rng(seed)
    skeleton = random_skeleton(rng, n_joints, ends=ends)
    rotations = random_rotations(rng, 4, n_joints)
    roots = rng.normal(size=(4, 3))
    positions = forward_kinematics(skeleton, rotations, roots)
    for frame in range(4):
        expected = oracle.place_joints(
            skeleton.parents, skeleton.offsets, rotations[frame], roots[frame], ends
        )
        np.testing.assert_allclose(positions[frame], expected, atol=1e-12)


def test_translations_replace_offsets():
    rng = np.random.default_rng(5)
    skeleton = random_skeleton(rng, 5, ends=False)
    rotations, roots = random_rotations(rng, 3, 5), rng.normal(size=(3, 3))
    moved = {joint: rng.normal(size=(3, 3)) for joint in (0, 2, 4)}
    positions = forward_kinematics(skeleton, rotations, roots, moved)
    for frame in range(3):
        offsets = skeleton.offsets.copy()
        for joint, translation in moved.items():
            offsets[joint] = translation[frame]
        expected = oracle.place_joints(
            skeleton.parents, offsets, rotations[frame], roots[frame], False
        )
        np.testing.assert_allclose(positions[frame], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("names", "parents", "offsets", "packed"),
    [
        (("a", "a"), [-1, 0], np.zeros((2, 3)), "unique"),
        (("a", "b"), [-1], np.zeros((2, 3)), "need parents"),
        (("a", "b"), [-1, 0], np.zeros((2, 2)), "need parents"),
        (("a", "b"), [1, -1], np.zeros((2, 3)), "before it"),
        (("a", "b"), [-1, 1], np.zeros((2, 3)), "before it"),
        (("a", "b"), [-2, 0], np.zeros((2, 3)), "before it"),
    ],
)
def test_broken_trees_are_refused(names, parents, offsets, packed):
    with pytest.raises(InvalidInput, match=packed):
        Skeleton(names, np.array(parents, dtype=np.intp), offsets)


@pytest.mark.parametrize(
    ("positions", "rate_hz", "packed"),
    [
        (np.zeros((4, 3, 3)), 30.0, "2 joints"),
        (np.zeros((4, 6)), 30.0, "shape"),
        (np.zeros((0, 2, 3)), 30.0, "at least one frame"),
        (np.zeros((4, 2, 3)), 0.0, "rate_hz"),
        (np.zeros((4, 2, 3)), np.nan, "rate_hz"),
        (np.full((4, 2, 3), np.inf), 30.0, "finite"),
    ],
)
def test_impossible_motions_are_refused(positions, rate_hz, packed):
    with pytest.raises(InvalidInput, match=packed):
        Motion(("a", "b"), positions, Recording(rate_hz=rate_hz))


def test_generic_joints_are_weighted_sums_and_unknown_without_their_points():
    mapping = JointMapping(
        "test", {"root": {"a": 1.0}, "chest": {"a": 0.25, "b": 0.75}, "head": {"c": 1.0}}
    )
    positions = np.random.default_rng(1).normal(size=(5, 2, 3))
    generic = Motion(("a", "b"), positions, Recording(rate_hz=30.0), mapping).generic_positions()
    assert generic.shape == (5, 24, 3)
    np.testing.assert_array_equal(generic[:, GENERIC_JOINTS.index("root")], positions[:, 0])
    np.testing.assert_allclose(
        generic[:, GENERIC_JOINTS.index("chest")], positions[:, 0] / 4 + positions[:, 1] * 3 / 4
    )
    others = [i for i, joint in enumerate(GENERIC_JOINTS) if joint not in ("root", "chest")]
    assert np.isnan(generic[:, others]).all()


def test_an_unknown_skeleton_is_said():
    with pytest.raises(InvalidInput, match="skeleton="):
        Motion(("a",), np.zeros((1, 1, 3)), Recording(rate_hz=30.0)).generic_positions()


def test_a_cut_keeps_the_numbers_of_the_frames():
    motion = Motion(
        ("a",), np.arange(30.0).reshape(10, 1, 3), Recording(rate_hz=20.0, first_frame=5)
    )
    part = motion.cut(2, 6)
    assert (part.n_frames, part.duration_s, part.first_frame) == (4, 0.2, 7)
    np.testing.assert_array_equal(part.positions, motion.positions[2:6])
    for first, stop in ((-1, 3), (3, 3), (4, 2), (0, 11)):
        with pytest.raises(InvalidInput, match="a cut needs"):
            motion.cut(first, stop)


@pytest.mark.parametrize(("rate_hz", "to_hz"), [(30, 120), (120, 30), (100, 120), (59.94, 120)])
def test_resampling_keeps_straight_lines_and_hits_the_first_frame(rate_hz, to_hz):
    times = np.arange(50) / rate_hz
    line = np.stack((2 * times - 1, -times, 0 * times + 3), axis=1)[:, None]
    new = resample(line, rate_hz=rate_hz, to_hz=to_hz)
    at = np.arange(len(new)) / to_hz
    assert at[-1] <= times[-1] + 1e-9 < at[-1] + 1 / to_hz + 1e-9
    inner = (at >= 1 / rate_hz) & (at <= times[-2])
    np.testing.assert_allclose(new[inner, 0, 0], 2 * at[inner] - 1, atol=1e-9)
    np.testing.assert_array_equal(new[0], line[0])


def test_resampling_keeps_given_frames_and_the_length_of_gaps():
    positions = np.random.default_rng(2).normal(size=(20, 1, 3))
    positions[8:11] = np.nan
    new = resample(positions, rate_hz=30, to_hz=120)
    np.testing.assert_array_equal(new[::4], positions)
    unseen = np.flatnonzero(np.isnan(new[:, 0, 0]))
    assert (unseen.min(), unseen.max()) == (7 * 4 + 1, 11 * 4 - 1)


def test_part_and_whole_are_resampled_alike():
    positions = np.random.default_rng(4).normal(size=(40, 2, 3))
    whole = resample(positions, rate_hz=30, to_hz=120)
    part = resample(positions[10:30], rate_hz=30, to_hz=120)
    np.testing.assert_allclose(part[8:-8], whole[48 : 40 + len(part) - 8], atol=1e-12)


def test_motions_and_skeletons_compare_and_hash_without_raising():
    positions = np.zeros((2, 1, 3))
    one, other = (Motion(("a",), positions, Recording(rate_hz=30.0)) for _ in range(2))
    assert one == one
    assert one != other
    assert len({one, other, one}) == 2
    tree = Skeleton(("a",), np.array([-1]), np.zeros((1, 3)))
    assert tree != Skeleton(("a",), np.array([-1]), np.zeros((1, 3)))
    assert len({tree, tree}) == 1


def test_a_motion_is_told_in_a_line():
    motion = Motion(("a",), np.zeros((60, 1, 3)), Recording("take.bvh", rate_hz=30.0))
    assert repr(motion) == "Motion('take.bvh', 60 frames at 30 Hz, 2.00 s, 1 joints, 0 notes)"
