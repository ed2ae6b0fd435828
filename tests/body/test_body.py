"""Body: mesh, chain, skinning, derivatives and depth against their definitions."""

import hashlib
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from evidence.common.twists import exponentials, pose_by_twists, revolute_twists
from hypothesis import given, settings
from hypothesis import strategies as st

from motionary.body import (
    Camera,
    add_kinect_noise,
    add_time_of_flight_noise,
    blend_matrix,
    find_shares,
    jacobian,
    load_body,
    local_rotations,
    pose_body,
    pose_from_motion,
    render_depth,
    shade,
    skin,
)
from motionary.body.model import accumulate, place_joints
from motionary.errors import InvalidInput
from motionary.matching.distance import load_twin
from motionary.motion import Skeleton, forward_kinematics
from motionary.rotations import (
    matrices_to_quaternions,
    quaternions_to_matrices,
    rotation_vectors_to_quaternions,
)
from motionary.samples import synthetic_motion
from oracles.bodies import ray_depths, skinned

BODY = load_body()
ASSETS = files("motionary.io.assets").joinpath("body")
CAMERA = Camera(width=80, height=60, focal=(71.4, 71.4), centre=(40.0, 30.0))


def turns_of(vectors):
    return quaternions_to_matrices(rotation_vectors_to_quaternions(vectors))


def drawn(seed, size=0.6):
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(len(BODY.names), 3)) * size
    return vectors, pose_body(BODY, turns_of(vectors)[None], rng.normal(size=(1, 3)))


@pytest.mark.parametrize("name", ["body.npz", "body_fine.npz"])
def test_the_asset_is_the_one_whose_hash_its_provenance_tells(name):
    content = ASSETS.joinpath(name).read_bytes()
    told = ASSETS.joinpath("PROVENANCE.md").read_text("utf-8")
    assert hashlib.sha256(content).hexdigest() in told
    assert "CC0 1.0" in ASSETS.joinpath("CC0.md").read_text("utf-8")


@pytest.mark.parametrize(
    ("fine", "most_kib", "n_vertices"), [(False, 100, (1170, 1230)), (True, 300, (5800, 6000))]
)
def test_the_body_that_ships_is_small_and_symmetric(fine, most_kib, n_vertices):
    name = "body_fine.npz" if fine else "body.npz"
    assert len(ASSETS.joinpath(name).read_bytes()) <= most_kib * 1024
    body = load_body(fine=fine)
    assert n_vertices[0] <= len(body.vertices) <= n_vertices[1]
    assert body.surface.bones.shape[1] == 4
    np.testing.assert_allclose(body.surface.weights.sum(axis=1), 1, atol=1e-6)
    assert np.ptp(body.vertices[:, 1]) == pytest.approx(1.657, abs=0.005)
    corners = body.vertices[body.faces]
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    left = volumes[corners.mean(axis=1)[:, 0] > 0].sum()
    right = volumes[corners.mean(axis=1)[:, 0] < 0].sum()
    assert left == pytest.approx(right, rel=0.02)
    assert left + right == pytest.approx(0.0545, abs=0.001)
    top, left_hand, right_hand, left_toes, right_toes = body.vertices[body.ends]
    assert top[1] > 1.6
    assert left_hand[0] > 0.4 > -0.4 > right_hand[0]
    assert left_toes[0] > 0.1 > -0.1 > right_toes[0]


def test_skinning_is_the_weighted_mean_of_what_bones_do():
    _, pose = drawn(1)
    points = BODY.points(np.arange(0, 1199, 7))
    expected = skinned(*points[:3], BODY.joints, pose.rotations[0], pose.joints[0])
    np.testing.assert_allclose(skin(BODY, pose, points)[0], expected, atol=1e-12)
    single = blend_matrix(BODY, points).astype(np.float32)
    assert skin(BODY, pose, points, blend=single).dtype == np.float32
    np.testing.assert_allclose(skin(BODY, pose, points, blend=single)[0], expected, atol=1e-5)


def test_at_rest_the_body_is_the_mesh_at_rest_and_many_poses_are_each_of_them():
    rest = pose_body(BODY, np.tile(np.eye(3), (2, len(BODY.names), 1, 1)))
    np.testing.assert_allclose(skin(BODY, rest)[1], BODY.vertices, atol=1e-12)
    vectors = np.random.default_rng(2).normal(size=(300, len(BODY.names), 3)) * 0.4
    poses = pose_body(BODY, turns_of(vectors))
    points = BODY.points(np.arange(9))
    together = skin(BODY, poses, points)
    for k in (0, 255, 256, 299):
        alone = pose_body(BODY, turns_of(vectors[k : k + 1]))
        np.testing.assert_allclose(together[k], skin(BODY, alone, points)[0], atol=1e-12)


def test_a_global_motion_moves_all_points_alike():
    _, pose = drawn(3)
    turn = turns_of(np.array([0.3, -1.2, 0.8]))
    moved = pose._replace(rotations=turn @ pose.rotations, joints=pose.joints @ turn.T + (1, 2, 3))
    np.testing.assert_allclose(skin(BODY, moved), skin(BODY, pose) @ turn.T + (1, 2, 3), atol=1e-12)


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 1e-9, 0.5, 2.0, 3.1]))
def test_the_chain_is_the_product_of_exponentials_and_forward_kinematics(seed, size):
    vectors, pose = drawn(seed, size)
    step = pose.joints[0, 0] - BODY.joints[0]
    motions = pose_by_twists(BODY, vectors, np.concatenate([step, np.zeros(3)]))
    np.testing.assert_allclose(motions[:, :3, :3], pose.rotations[0], atol=1e-12)
    carried = np.einsum("jab,jb->ja", motions[:, :3, :3], BODY.joints) + motions[:, :3, 3]
    np.testing.assert_allclose(carried, pose.joints[0], atol=1e-12)
    parents = np.maximum(BODY.parents, 0)
    offsets = BODY.joints - BODY.joints[parents]
    skeleton = Skeleton(BODY.names, BODY.parents, offsets)
    local = local_rotations(BODY, pose)
    joints = forward_kinematics(skeleton, local, pose.joints[:, 0])
    np.testing.assert_allclose(joints, pose.joints, atol=1e-12)


def test_exponentials_of_twists():
    np.testing.assert_allclose(exponentials([1, 2, 3, 0, 0, 0])[:3, 3], (1, 2, 3))
    point = np.array([0.4, -1.0, 2.0])
    quarter = exponentials(revolute_twists([0, 0, np.pi / 2], point))
    np.testing.assert_allclose(quarter @ [*point, 1], [*point, 1], atol=1e-12)
    np.testing.assert_allclose(quarter[:3, :3] @ (1, 0, 0), (0, 1, 0), atol=1e-12)
    tiny = exponentials(np.array([1.0, 0, 0, 0, 0, 1e-6]))
    np.testing.assert_allclose(tiny[:3, 3], (1, 5e-7, 0), atol=1e-12)


@settings(max_examples=6)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.6, 2.5]), st.booleans())
def test_derivatives_are_differences(seed, size, stretched):
    vectors, pose = drawn(seed, size)
    points = BODY.points(np.random.default_rng(seed).integers(0, 1199, 12))
    step = pose.joints[0, 0] - BODY.joints[0]
    stretch = None
    if stretched:
        stretch = np.eye(3) + np.random.default_rng(seed).normal(size=(20, 3, 3)) * 0.1

    def at(change):
        turned = turns_of(vectors) @ turns_of(change[:60].reshape(20, 3))
        shape = dict(zip(BODY.shape_names, change[63:], strict=True))
        shaped = BODY.shaped(shape)
        posed = pose_body(shaped, turned[None], (step + change[60:63])[None])
        if stretch is not None:
            posed = place_joints(shaped, posed.rotations, posed.joints[:, 0], stretch)
        rest = points.rest + np.tensordot(change[63:], points.shapes, 1)
        return posed, skin(shaped, posed, points._replace(rest=rest))[0]

    found = jacobian(BODY, at(np.zeros(68))[0], points, shape=True, engine="numpy")
    assert found.shape == (12, 3, 68)
    for column in (0, 1, 2, 5, 16, 22, 31, 44, 59, 60, 61, 62, *range(63, 68)):
        change = np.zeros(68)
        change[column] = 1e-6
        difference = (at(change)[1] - at(-change)[1]) / 2e-6
        np.testing.assert_allclose(found[:, :, column], difference, atol=1e-7)


def test_the_twins_of_derivatives_and_depth_agree():
    pytest.importorskip("numba")
    assert load_twin("motionary.body._compiled", "compiled", pays=True) is not None
    _, pose = drawn(4)
    both = [jacobian(BODY, pose, engine=engine) for engine in ("numpy", "compiled")]
    np.testing.assert_allclose(*both, atol=1e-12)
    camera = CAMERA.looking_at(pose.joints[0, 0] + (0.5, 0.4, 2.5), pose.joints[0, 0])
    vertices = skin(BODY, pose)[0]
    images = [render_depth(vertices, BODY.faces, camera, engine=e) for e in ("numpy", "compiled")]
    np.testing.assert_allclose(images[0].depth, images[1].depth, atol=1e-12)
    np.testing.assert_array_equal(images[0].faces, images[1].faces)


def test_depth_is_where_rays_meet_the_surface_also_through_the_near_plane():
    for position, near in (((0.3, 1.1, 2.2), 0.05), ((0.0, 1.0, 0.6), 0.45)):
        half = Camera(40, 30, (35.7, 35.7), (20.0, 15.0), near_m=near)
        camera = half.looking_at(np.array(position), np.array([0, 0.9, 0]))
        image = render_depth(BODY.vertices, BODY.faces, camera, engine="numpy")
        rays = camera.unproject(np.ones((30, 40))) - camera.position
        rays = (rays @ camera.world_from_camera).reshape(-1, 3)
        seen = camera.to_camera(BODY.vertices)
        depth = ray_depths(seen, BODY.faces, rays).reshape(30, 40)
        clear = ~np.isfinite(depth) | (depth > near)
        found = np.where(np.isnan(image.depth), np.inf, image.depth)
        same = np.isclose(found, depth, atol=1e-9) | (np.isinf(found) & np.isinf(depth))
        assert (same | ~clear).mean() > 0.999, "but for rays along an edge"
        hit = image.faces >= 0
        assert hit.sum() > 60
        corners = BODY.vertices[BODY.faces[image.faces[hit]]]
        shares = find_shares(image, BODY.vertices, BODY.faces, camera)
        assert np.nanmin(shares) > -1e-9
        places = (shares[hit][..., None] * corners).sum(axis=1)
        np.testing.assert_allclose(places, camera.unproject(image.depth)[hit], atol=1e-9)
        bright = shade(image, BODY.vertices, BODY.faces, camera)
        assert np.nanmin(bright) >= 0
        assert np.nanmax(bright) <= 1
        assert np.isnan(bright[~hit]).all()


def test_pixels_and_places_agree():
    camera = CAMERA.looking_at(np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, 0.0]))
    depth = np.full((60, 80), 2.5)
    places = camera.unproject(depth)
    rows, columns = np.indices(depth.shape)
    np.testing.assert_allclose(camera.project(places), np.stack([columns, rows], -1), atol=1e-9)
    np.testing.assert_allclose(camera.project(np.array([[0.0, 1.0, 0.0]])), [[40, 30]], atol=1e-9)
    above = camera.project(np.array([[0.0, 1.5, 0.0]]))
    assert above[0, 1] < 30, "y down"


def test_noise_has_the_moments_that_are_told():
    camera = Camera(width=200, height=200, centre=(100.0, 100.0))
    plane = np.full((200, 200), 3.0)
    kinect = add_kinect_noise(plane, camera, seed=0)
    steps = np.unique(1 / kinect[np.isfinite(kinect)]) / 2.78e-3
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
    spread = np.hypot(1.4e-3 * 9, 2.78e-3 * 9 / np.sqrt(12))
    assert np.nanstd(kinect) == pytest.approx(spread, rel=0.05)
    flight = add_time_of_flight_noise(plane, seed=0)
    assert np.nanstd(flight) == pytest.approx(1.5e-3 * 9, rel=0.05)
    np.testing.assert_array_equal(flight, add_time_of_flight_noise(plane, seed=0))
    edge = plane.copy()
    edge[:, :100] = 1.5
    mixed = add_time_of_flight_noise(edge, seed=1)
    between = (mixed > 1.7) & (mixed < 2.8)
    assert between[:, 99].mean() > 0.5
    assert not between[:, :98].any()
    shadow = np.isnan(add_kinect_noise(edge, camera, seed=1))
    # 285.63 * .075 * (1 / 1.5 - 1 / 3) pixels of the far plane are not lit.
    assert shadow.any(axis=0).sum() == pytest.approx(7, abs=4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parents": np.array([-1] * 20)}, "one root"),
        ({"joints": np.full((20, 3), np.nan)}, "NaN"),
        ({"surface": BODY.surface._replace(weights=BODY.surface.weights * 0.9)}, "sum to 0.9"),
        (
            {"surface": BODY.surface._replace(bones=BODY.surface.bones + 17)},
            "bones must be between",
        ),
        ({"faces": BODY.faces + 5}, "faces must be between"),
    ],
)
def test_a_body_that_cannot_be_is_refused(change, message):
    with pytest.raises(InvalidInput, match=message):
        replace(BODY, **change)


def test_wrong_poses_shapes_and_cameras_are_refused():
    with pytest.raises(InvalidInput, match="no joint 'tail'"):
        BODY.index("tail")
    with pytest.raises(InvalidInput, match="no shape 'wings'"):
        BODY.shaped({"wings": 1.0})
    with pytest.raises(InvalidInput, match=r"within ±0.6"):
        BODY.shaped({"height": 0.9})
    with pytest.raises(InvalidInput, match="needs turns"):
        pose_body(BODY, np.zeros((1, 3, 3, 3)))
    with pytest.raises(InvalidInput, match="one pose"):
        jacobian(BODY, pose_body(BODY, np.tile(np.eye(3), (2, 20, 1, 1))))
    with pytest.raises(InvalidInput, match="inside the body"):
        render_depth(BODY.vertices, BODY.faces, replace(CAMERA, position=np.array([0, 1.1, 0.0])))
    with pytest.raises(InvalidInput, match="finite"):
        render_depth(np.full_like(BODY.vertices, np.nan), BODY.faces, CAMERA)
    with pytest.raises(InvalidInput, match="rotation matrix"):
        Camera(world_from_camera=np.zeros((3, 3)))
    with pytest.raises(InvalidInput, match="straight up"):
        CAMERA.looking_at(np.zeros(3), np.array([0, 1.0, 0]))
    away = render_depth(BODY.vertices + np.array([0, 0, -9]), BODY.faces, CAMERA)
    assert np.isnan(away.depth).all(), "what is behind the camera is not seen"


def test_a_rig_that_lies_at_rest_drives_the_body_as_one_that_stands():
    motion = synthetic_motion("squat", seed=2, rate_hz=10.0)
    skeleton, lying = motion.skeleton, turns_of(np.array([0.1, 0.2, -1.6]))
    turned = accumulate(skeleton.parents, quaternions_to_matrices(motion.rotations)) @ lying.T
    local = turned.copy()
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            local[:, joint] = np.swapaxes(turned[:, parent], -1, -2) @ turned[:, joint]
    rig = replace(
        motion,
        skeleton=replace(skeleton, offsets=skeleton.offsets @ lying.T),
        rotations=matrices_to_quaternions(local),
    )
    standing, found = (pose_from_motion(BODY, one).pose for one in (motion, rig))
    assert found.joints == pytest.approx(standing.joints, abs=0.03)
    head = BODY.index("head")
    up = (found.joints[:, head] - found.joints[:, 0])[:, 1]
    assert up.min() > 0.3
