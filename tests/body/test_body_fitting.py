"""Planted poses and shapes are found again; motions drive the body."""

import numpy as np
import pytest

from motionary.body import (
    FitSettings,
    fit_points,
    fit_shape,
    fit_surface,
    load_body,
    pose_body,
    pose_from_motion,
    skin,
)
from motionary.errors import InvalidInput
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.recording import Recording
from motionary.rotations import quaternions_to_matrices, rotation_vectors_to_quaternions
from motionary.samples import synthetic_motion

BODY = load_body()


def planted(seed, size=0.35):
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(len(BODY.names), 3)) * size
    turns = quaternions_to_matrices(rotation_vectors_to_quaternions(vectors))
    return rng, pose_body(BODY, turns[None], rng.normal(size=(1, 3)))


def test_a_planted_pose_is_found_from_noisy_joints_with_outliers():
    errors = []
    for seed in range(3):
        rng, pose = planted(seed)
        targets = pose.joints[0] + rng.normal(size=(20, 3)) * 0.01 / np.sqrt(3)
        targets[rng.choice(20, 2, replace=False)] += rng.normal(size=(2, 3)) * 0.5
        targets[7] = np.nan
        fit = fit_points(BODY, BODY.joint_points(), targets)
        errors.append(np.median(np.linalg.norm(fit.pose.joints - pose.joints, axis=2)))
        assert np.isnan(fit.residuals[7])
    assert np.median(errors) < 0.01


def test_a_planted_pose_is_found_from_its_surface():
    rng, pose = planted(1, 0.2)
    vertices = skin(BODY, pose)[0]
    start = fit_points(BODY, BODY.joint_points(), pose.joints[0] + rng.normal(size=(20, 3)) * 0.01)
    chosen = BODY.faces[rng.integers(len(BODY.faces), size=600)]
    cloud = (rng.dirichlet((1, 1, 1), 600)[..., None] * vertices[chosen]).sum(axis=1)
    fit = fit_surface(BODY, cloud, start=start.pose, rounds=6)
    before = np.linalg.norm(start.pose.joints - pose.joints, axis=2).mean()
    after = np.linalg.norm(fit.pose.joints - pose.joints, axis=2).mean()
    assert after < 0.7 * before
    assert after < 0.007


def test_a_planted_height_is_found_from_lengths_with_a_wrong_one():
    tall = BODY.shaped({"height": 0.3})
    lengths = {
        (name, BODY.names[parent]): float(np.linalg.norm(joint - tall.joints[parent]))
        for name, parent, joint in zip(BODY.names, BODY.parents, tall.joints, strict=True)
        if parent >= 0
    }
    lengths[("lshank", "lthigh")] += 0.2
    assert fit_shape(BODY, lengths)["height"] == pytest.approx(0.3, abs=0.06)
    with pytest.raises(InvalidInput, match="positive"):
        fit_shape(BODY, {("lshank", "lthigh"): -1.0})


def test_shape_is_fitted_with_the_pose_where_asked_for():
    short = BODY.shaped({"height": -0.3})
    _, pose = planted(2, 0.1)
    posed = pose_body(short, pose.rotations[:, :1].repeat(20, axis=1))
    points = BODY.joint_points()
    fit = fit_points(BODY, points, posed.joints[0], settings=FitSettings(shape_prior_m=0.005))
    assert fit.shape["height"] == pytest.approx(-0.3, abs=0.05)
    assert fit.converged


def test_a_fit_without_points_is_refused():
    with pytest.raises(InvalidInput, match="at least four"):
        fit_points(BODY, BODY.joint_points(), np.full((20, 3), np.nan))
    _, pose = planted(0)
    with pytest.raises(InvalidInput, match="cloud"):
        fit_surface(BODY, np.full((5, 3), np.nan), start=pose)


def on_legs(driven, motion):
    joints = motion.generic_positions()
    pairs = (("thigh", "hip"), ("shank", "knee"), ("foot", "ankle"))
    return max(
        np.linalg.norm(
            driven.pose.joints[:, BODY.index(side + bone)]
            - joints[:, GENERIC_JOINTS.index(side + joint)],
            axis=1,
        ).max()
        for side in "lr"
        for bone, joint in pairs
    )


@pytest.mark.parametrize("with_rotations", [True, False])
def test_a_synthetic_motion_drives_the_body(with_rotations):
    motion = synthetic_motion("jumping_jack", seed=1)
    if not with_rotations:
        motion = Motion(motion.names, motion.positions, motion.recording, motion.mapping)
    driven = pose_from_motion(BODY, motion)
    assert on_legs(driven, motion) < 1e-3
    assert driven.twist_known.all() == with_rotations
    lowest = skin(BODY, driven.pose)[..., 1].min(axis=1)
    assert abs(np.median(lowest) - np.nanmin(motion.positions[..., 1])) < 0.09
    kept = pose_from_motion(BODY, motion, lengths="kept")
    steps = kept.pose.joints[:, BODY.index("lshank")] - kept.pose.joints[:, BODY.index("lthigh")]
    own = np.linalg.norm(BODY.joints[BODY.index("lshank")] - BODY.joints[BODY.index("lthigh")])
    np.testing.assert_allclose(np.linalg.norm(steps, axis=1), own, atol=1e-9)


def test_what_cannot_drive_is_refused():
    motion = synthetic_motion("jumping_jack", seed=1)
    positions = motion.positions.copy()
    positions[5, motion.names.index("lknee")] = np.nan
    gap = Motion(motion.names, positions, Recording("gap", rate_hz=120.0), motion.mapping)
    with pytest.raises(InvalidInput, match="frame 5"):
        pose_from_motion(BODY, gap)
    with pytest.raises(InvalidInput, match="'adapted' or 'kept'"):
        pose_from_motion(BODY, motion, lengths="long")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["cmu/35_01.amc", "cmu/iclone_07_01.bvh"])
def test_a_walk_drives_the_body(data, name):
    import motionary as mo

    motion = mo.read(data / name)
    part = motion.cut(0, min(motion.n_frames, 240))
    driven = pose_from_motion(BODY, part)
    assert on_legs(driven, part) < 1e-3
    assert driven.twist_known.all()
    lowest = skin(BODY, driven.pose)[..., 1].min(axis=1)
    assert abs(np.median(lowest)) < 0.03
    shoulder = part.generic_positions()[:, GENERIC_JOINTS.index("lshoulder")]
    chest = driven.pose.rotations[:, BODY.index("chest")]
    away = driven.pose.joints[:, BODY.index("lupperarm")] - shoulder
    assert np.einsum("fji,fj->fi", chest, away).std(axis=0).max() < 0.01
