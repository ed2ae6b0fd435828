"""Poses from depth: preparation, graph and extrema by definition, fits, lookup, tracking."""

import hashlib
from importlib.resources import files

import numpy as np
import pytest

from motionary.body import Camera, load_body, local_rotations, render_depth, skin
from motionary.depth import (
    DepthTracker,
    PreparationSettings,
    TrackerSettings,
    build_database,
    build_graph,
    find_extrema,
    fitting,
    judging,
    learn_background,
    load_database,
    lookup,
    poses,
    prepare,
    tracking,
)
from motionary.errors import InvalidInput
from motionary.matching.distance import load_twin
from motionary.rotations import quaternions_to_matrices, rotation_vectors_to_quaternions
from motionary.samples import synthetic_motion
from oracles.depth import cleaned, extrema

BODY = load_body()
CAMERA = Camera(160, 120, (142.8, 142.8), (80.0, 60.0)).looking_at(
    np.array([0.0, 1.0, 2.8]), np.array([0.0, 0.9, 0.0])
)
NAMES = ("jumping_jack", "kick_left")
COMPILED = load_twin("motionary.depth._compiled", "auto", pays=True) is not None
NEEDS_NUMBA = pytest.mark.skipif(not COMPILED, reason="the compiled twins need numba")
ENGINES = ["numpy", pytest.param("compiled", marks=NEEDS_NUMBA)]


def turns(seed, size=0.25):
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(1, len(poses.ACTIVE), 3)) * size
    vectors[:, 0] *= 0.3
    return quaternions_to_matrices(rotation_vectors_to_quaternions(vectors))


def posed(seed, size=0.25):
    root = np.array([[0.05, BODY.joints[0, 1], 0.1]])
    return poses.expand_pose(BODY, turns(seed, size), root)


def seen(pose, noise=0.0, seed=0):
    vertices = np.asarray(skin(BODY, pose))[0]
    image = render_depth(vertices, BODY.faces, CAMERA).depth
    return image + np.random.default_rng(seed).normal(size=image.shape) * noise


@pytest.fixture(scope="module")
def database():
    return build_database([synthetic_motion(name, seed=1) for name in NAMES], rate_hz=6)


@pytest.mark.parametrize("engine", ENGINES)
def test_cleaning_drops_floating_pixels_and_takes_medians(engine):
    rng = np.random.default_rng(3)
    image = np.full((120, 160), np.nan)
    image[40:60, 70:95] = 2 + rng.normal(size=(20, 25)) * 0.06
    image[rng.random(image.shape) < 0.3] = np.nan
    found = prepare(image, CAMERA, engine=engine)
    expected = cleaned(image[30:70, 60:105], 5, 0.1)
    np.testing.assert_array_equal(found.depth[30:70, 60:105], expected)
    np.testing.assert_allclose(
        CAMERA.project(found.points), np.stack([found.pixels % 160, found.pixels // 160], 1),
        atol=1e-9,
    )  # fmt: skip


def test_what_is_not_in_front_of_the_background_is_left_out():
    image = seen(posed(0))
    wall = np.where(np.isnan(image), 4.0, image)
    empty = learn_background(np.full((3, *image.shape), 4.0))
    with_wall = prepare(wall, CAMERA, background=empty)
    np.testing.assert_array_equal(with_wall.depth, prepare(image, CAMERA).depth)
    assert len(prepare(wall, CAMERA, PreparationSettings(far_m=3.9)).points) == len(
        with_wall.points
    )
    above = prepare(image, CAMERA, PreparationSettings(floor_m=0.5))
    assert above.points[:, 1].min() > 0.5
    assert len(prepare(np.zeros(image.shape), CAMERA).points) == 0
    deleted = prepare(image, CAMERA, PreparationSettings(contours="delete"))
    assert 0 < len(deleted.points) < len(with_wall.points)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("seed", [1, 2])
def test_the_incremental_search_finds_what_starting_anew_finds(engine, seed):
    graph = build_graph(prepare(seen(posed(seed, 0.5), 0.01, seed), CAMERA), 142.8, engine=engine)
    found = find_extrema(graph, 8, engine=engine)
    edges = {
        node: [
            (int(other), float(weight))
            for other, weight in zip(
                graph.neighbours[first:stop], graph.weights[first:stop], strict=True
            )
        ]
        for node, (first, stop) in enumerate(zip(graph.starts[:-1], graph.starts[1:], strict=True))
    }
    nodes, lengths = extrema(edges, len(graph.points), graph.source, 8)
    assert found.nodes.tolist() == nodes
    np.testing.assert_allclose(found.distances, lengths, atol=1e-9)
    assert (found.visited[1:] < found.visited[0]).all()


def test_a_part_that_hangs_apart_is_joined_and_crumbs_are_dropped():
    image = np.full((120, 160), np.nan)
    image[20:60, 60:90] = 2.0
    image[64:80, 60:70] = 2.0
    image[100:102, 150:155] = 2.0
    graph = build_graph(prepare(image, CAMERA), 142.8)
    assert graph.torso.sum() == 1200
    assert len(graph.points) == 1200 + 160
    assert np.isfinite(find_extrema(graph, 3).distances).all()
    assert find_extrema(graph, 3).visited[0] == 1360


@pytest.mark.parametrize("published", [False, True])
def test_a_pose_is_found_again_from_near_it(database, published):
    true, start = posed(5, 0.2), posed(5, 0.12)
    cloud = prepare(seen(true), CAMERA)
    surface = fitting.make_surface(BODY, database, fitting.SurfaceSettings())
    state = fitting.State(local_rotations(BODY, start)[0], start.joints[0, 0] + 0.03)
    before = np.linalg.norm(fitting.place_surface(surface, state)[1] - true.joints[0], axis=1)
    if published:
        fitted = fitting.fit_published(surface, state, cloud.points)
    else:
        fitted, visible = fitting.fit_pose(
            surface, state, cloud.points, cloud.depth, CAMERA, engine="numpy",
            settings=fitting.SurfaceSettings(steps=10),
        )  # fmt: skip
        assert 200 < visible.sum() < 900
    after = np.linalg.norm(fitting.place_surface(surface, fitted)[1] - true.joints[0], axis=1)
    assert before.mean() > 0.04
    assert after.mean() < (0.07 if published else 0.03)


@NEEDS_NUMBA
def test_the_twins_fit_and_compare_alike(database):
    cloud = prepare(seen(posed(6)), CAMERA)
    surface = fitting.make_surface(BODY, database, fitting.SurfaceSettings())
    start = posed(6, 0.2)
    state = fitting.State(local_rotations(BODY, start)[0], start.joints[0, 0])
    settings = fitting.SurfaceSettings(points=200, steps=3)
    found = [
        fitting.fit_pose(
            surface, state, fitting.thin(cloud.points, 200), cloud.depth, CAMERA,
            settings=settings, engine=engine,
        )
        for engine in ("numpy", "compiled")
    ]  # fmt: skip
    for one, other in zip(found[0][0], found[1][0], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    np.testing.assert_array_equal(found[0][1], found[1][1])
    small, eye = fitting.shrink(cloud.depth, CAMERA, 300)
    vertices = np.stack([np.asarray(skin(BODY, posed(k)))[0] for k in (6, 7)])
    costs = [
        fitting.compare_images(vertices, BODY.faces, small, eye, engine=engine)
        for engine in ("numpy", "compiled")
    ]
    np.testing.assert_allclose(costs[0].costs, costs[1].costs, atol=1e-6)
    np.testing.assert_allclose(costs[0].apart, costs[1].apart, atol=1e-6)
    assert costs[0].costs[0] < costs[0].costs[1]


def test_assignments_are_those_in_reach_and_those_with_the_feet_below():
    ends = np.array([[0, 1.7, 0], [0.7, 1, 0], [-0.7, 1, 0], [0.2, 0, 0], [-0.2, 0, 0]], float)
    assert [0, 1, 2, 3, 4] in lookup.permit(ends, ends, jumped=False).tolist()
    # The feet are within half a metre of each other, all else is too far apart.
    assert len(lookup.permit(ends, ends, jumped=False)) == 2
    both = lookup.permit(ends, None, jumped=True)
    assert len(both) == 12
    assert all({row[3], row[4]} == {3, 4} for row in both.tolist())
    mixed = np.concatenate([ends[[3, 0]], [[0.0, 1.2, 0.1]], ends[[2, 4, 1]]])
    np.testing.assert_array_equal(lookup.choose_ends(mixed, ends + 0.05), ends)


def test_the_database_holds_poses_that_differ_and_their_mirror_images(database):
    pose = poses.expand_pose(BODY, quaternions_to_matrices(database.turns))
    flat = (pose.joints - pose.joints[:, :1])[:, 1:].reshape(len(database), -1)
    apart = np.linalg.norm(flat[:, None] - flat[None], axis=2)[~np.eye(len(flat), dtype=bool)]
    assert apart.min() > 0.018 * 19 - 1e-3
    headings = poses.heading_of(pose.rotations, BODY)
    np.testing.assert_allclose(headings, 0, atol=1e-5)
    again = poses.database_from_arrays(poses.database_to_arrays(database))
    np.testing.assert_allclose(again.turns, database.turns, atol=1e-3)
    with pytest.raises(InvalidInput, match="motionary depth database"):
        poses.database_from_arrays({"turns": database.turns})


def test_the_database_that_ships_is_the_one_whose_hash_its_provenance_tells():
    folder = files("motionary.io.assets").joinpath("poses")
    content = folder.joinpath("poses.npz").read_bytes()
    assert hashlib.sha256(content).hexdigest() in folder.joinpath("PROVENANCE.md").read_text(
        "utf-8"
    )
    assert len(content) < 3 << 20
    database = load_database()
    assert "86" not in database.provenance["people"]
    assert len(database) > 1000
    assert "CMU" in database.licence


@pytest.mark.parametrize("published", [False, True])
def test_a_person_is_tracked_lost_and_found_again(database, published):
    settings = TrackerSettings(published=published, ranked=2)
    tracker = DepthTracker(CAMERA, database, settings=settings, engine="numpy")
    errors, names = [], []
    for k in range(8):
        pose = poses.expand_pose(
            BODY, quaternions_to_matrices(database.turns[3:4]),
            np.array([[0.02 * k, BODY.joints[0, 1], 0.0]]),
        )  # fmt: skip
        image = seen(pose, 0.003, k) if k != 5 else np.full((120, 160), np.nan)
        found = tracker.track(image)
        names.append(found.hypothesis)
        errors.append(np.linalg.norm(found.joints - pose.joints[0], axis=1).mean())
    assert np.isnan(errors[5])
    assert names[5] == "none"
    assert names[0] == names[6] == "lookup"
    assert np.nanmax(errors) < (0.15 if published else 0.05)


def track(database, settings, n):
    tracker = DepthTracker(CAMERA, database, settings=settings)
    pose = poses.expand_pose(
        BODY, quaternions_to_matrices(database.turns[3:4]), BODY.joints[None, 0]
    )
    return [tracker.track(seen(pose, 0.003, k)) for k in range(n)]


def test_the_lookup_is_asked_every_few_images(database):
    found = track(database, TrackerSettings(ranked=2, every=3, duel=0), 6)
    asked = [not np.isnan(pose.extrema).any() for pose in found]
    assert asked == [True, False, False, True, False, False]
    assert max(pose.cost for pose in found) < 0.05


@pytest.mark.parametrize(
    "wrong", [{"every": 0}, {"every": 4, "published": True}, {"every": 4, "hypotheses": "lookup"}]
)
def test_images_without_any_hypothesis_are_refused(wrong):
    with pytest.raises(InvalidInput, match="every needs to be 1"):
        TrackerSettings(**wrong)


def test_a_start_that_stays_undecided_stays_unsure(database, monkeypatch):
    settings = TrackerSettings(ranked=2, duel=2)
    assert track(database, settings, 6)[-1].status == "tracked"
    # As if the pose that looks the other way were never clearly worse.
    monkeypatch.setattr(tracking, "_CLEAR", 1e6)
    assert "which way" in track(database, settings, 6)[-1].reason


@pytest.mark.parametrize("engine", ENGINES)
def test_a_fit_ends_where_little_changes(database, engine):
    cloud = prepare(seen(posed(5, 0.2)), CAMERA)
    start = posed(5, 0.12)
    state = fitting.State(local_rotations(BODY, start)[0], start.joints[0, 0])

    def fit(steps, converged):
        settings = fitting.SurfaceSettings(steps=steps, converged=converged)
        surface = fitting.make_surface(BODY, database, settings)
        return fitting.fit_pose(
            surface, state, fitting.thin(cloud.points, 150), cloud.depth, CAMERA, engine=engine,
            settings=settings,
        )[0]  # fmt: skip

    np.testing.assert_array_equal(fit(4, 10.0).turns, fit(1, 0.0).turns)
    assert np.abs(fit(4, 0.0).turns - fit(1, 0.0).turns).max() > 1e-3


def test_wrong_input_is_told():
    with pytest.raises(InvalidInput, match="160 x 120"):
        prepare(np.zeros((50, 50)), CAMERA)
    with pytest.raises(InvalidInput, match="near < far"):
        PreparationSettings(near_m=3, far_m=1)
    with pytest.raises(InvalidInput, match="contours"):
        PreparationSettings(contours="keep")
    with pytest.raises(InvalidInput, match="stature_m"):
        DepthTracker(CAMERA, stature_m=170)
    with pytest.raises(InvalidInput, match="at least one recording"):
        build_database([])
    with pytest.raises(InvalidInput, match="at least 15 points"):
        build_graph(prepare(np.zeros((120, 160)), CAMERA), 142.8)


def judged(image):
    cloud = prepare(image, CAMERA)
    return judging.judge_cloud(cloud, build_graph(cloud, CAMERA.focal[0]), CAMERA)


def test_what_is_not_one_whole_person_is_told():
    image = seen(posed(0))
    assert judged(image) == ""
    beside = np.fmin(np.roll(image, 45, axis=1), np.roll(image, -45, axis=1))
    assert "more than one person" in judged(beside)
    down = np.full_like(image, np.nan)
    down[40:] = image[:-40]
    assert "cut off by the image's edge" in judged(down)
    # As if the unit or the focal length were three times too large.
    assert "no person has this size" in judged(image / 3)
