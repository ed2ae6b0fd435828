"""A body followed by regions of colour, in small flat-coloured images."""

import numpy as np
import pytest

from motionary.body import Camera, Pose, load_body, pose_body, render_depth, skin
from motionary.errors import InvalidInput
from motionary.io.cameras import CalibratedCamera
from motionary.multiview import (
    RegionSettings,
    find_contours,
    fit_regions,
    follow_regions,
    project,
    straighten,
)
from motionary.multiview.regions import compare_colours

SETTINGS = RegionSettings(reach_px=8, most_steps=6)


def turned(body, *, elbow=0.0, step=(0.0, 0.0, 0.0)):
    """The body at rest with a bent elbow, moved."""
    turns = np.tile(np.eye(3), (1, len(body.names), 1, 1))
    turns[0, body.index("lforearm")] = [
        [np.cos(elbow), -np.sin(elbow), 0], [np.sin(elbow), np.cos(elbow), 0], [0, 0, 1],
    ]  # fmt: skip
    return pose_body(body, turns, np.array([step]))


def paint(body, pose, cameras):
    """A dark red person in front of grey walls."""
    rng = np.random.default_rng(0)
    images = []
    for camera in cameras:
        seen = render_depth(np.asarray(skin(body, pose)[0]), body.faces, camera)
        image = np.full((camera.height, camera.width, 3), 0.6)
        image[seen.faces >= 0] = (0.4, 0.1, 0.1)
        images.append(np.clip(image + rng.normal(0, 0.02, image.shape), 0, 1))
    return images


@pytest.fixture(scope="module")
def known():
    body = load_body()
    camera = Camera(200, 200, (220.0, 220.0), (100.0, 100.0))
    target = np.array([0.0, 0.85, 0.0])
    cameras = [camera.looking_at(np.array(at), target) for at in ((0.5, 1, 3), (3, 1.2, -0.6))]
    truth = turned(body)
    return body, cameras, truth, paint(body, truth, cameras)


def test_colours_speak_for_the_side_that_has_them():
    inside = np.zeros((20, 20), dtype=bool)
    inside[5:15, 5:15] = True
    image = np.where(inside[..., None], [0.8, 0.1, 0.1], [0.1, 0.1, 0.8])
    evidence = compare_colours(image, inside, bins=8)
    assert (evidence[inside] > 1).all()
    assert (evidence[~inside] < -1).all()


def test_contours_move_by_what_the_body_is_off(known):
    body, cameras, _, images = known
    off = turned(body, step=(0.04, 0.0, 0.0))
    (contour, _) = find_contours(body, off, images, cameras, settings=SETTINGS)
    step = cameras[0].project(np.array([[0.0, 0.85, 0.0], [0.04, 0.85, 0.0]]))
    wanted = contour.normals @ (step[0] - step[1])
    upright = (np.abs(contour.normals[:, 0]) > 0.9) & (contour.contrast > 0.8)
    assert upright.sum() > 30
    assert np.median(np.abs(contour.shifts - wanted)[upright]) <= 1.0


def test_a_displaced_body_comes_back(known):
    body, cameras, truth, images = known
    start = turned(body, elbow=0.3, step=(0.04, 0.02, -0.03))
    found = fit_regions(body, start, images, cameras, settings=SETTINGS)
    before, after = (np.linalg.norm(one.joints - truth.joints, axis=-1) for one in (start, found))
    assert before.mean() > 0.05
    assert after.mean() < 0.015
    followed = follow_regions(body, found, [images], cameras, settings=SETTINGS)
    assert np.linalg.norm(followed.joints - truth.joints, axis=-1).mean() < 0.015


def test_what_cannot_be_followed_is_refused(known):
    body, cameras, truth, images = known
    with pytest.raises(InvalidInput, match=r"images of shapes \[\(200, 200, 3\)"):
        fit_regions(body, truth, images[:1], cameras)
    for wrong in (np.uint8(255 * images[0]), np.full_like(images[0], np.nan)):
        with pytest.raises(InvalidInput, match="from 0 to 1, got"):
            fit_regions(body, truth, [wrong, images[1]], cameras)
    with pytest.raises(InvalidInput, match="start nearer"):
        fit_regions(body, turned(body, step=(9.0, 0, 0)), images, cameras)
    with pytest.raises(InvalidInput, match="one pose"):
        fit_regions(body, Pose(truth.rotations[:0], truth.joints[:0]), images, cameras)
    with pytest.raises(InvalidInput, match="got none"):
        follow_regions(body, truth, [], cameras)


def test_a_straightened_image_has_points_where_a_pinhole_sees_them():
    matrix = np.array([[150.0, 0, 80], [0, 140.0, 60], [0, 0, 1]])
    lens = np.array([-0.3, 0.1, 0.0, 0.0, 0.0])
    bent = CalibratedCamera("c", matrix, np.eye(3), np.zeros(3), lens)
    point = np.array([400.0, 300.0, 1000.0])
    column, row = np.rint(project(bent, point)).astype(int)
    image = np.zeros((120, 160, 3))
    image[row - 1 : row + 2, column - 1 : column + 2] = 1.0
    straight, camera = straighten(image, bent, unit_m=0.001)
    rows, columns = np.nonzero(straight[..., 0] > 0.5)
    seen = camera.project(point / 1000)
    assert np.allclose([columns.mean(), rows.mean()], seen, atol=1.0)
    assert np.linalg.norm(seen - [column, row]) > 3
