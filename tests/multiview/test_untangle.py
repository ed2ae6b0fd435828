"""Exchanged sides are found and put right, on synthetic views of a walk."""

import json
from dataclasses import replace

import numpy as np
import pytest

import motionary as mo
from cli_cases import run
from motionary.errors import InvalidInput
from motionary.io.cameras import read_cameras
from motionary.io.keypoints import read_keypoints
from motionary.multiview import fit_views, triangulate
from view_cases import (
    NAMES,
    detect,
    exchange,
    ring,
    walker,
    write_openpose,
    write_toml,
)

LEGS = ("Hip", "Knee", "Ankle", "BigToe", "SmallToe", "Heel")
ARMS = ("Elbow", "Wrist")


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Keypoints of four cameras, with legs and arms exchanged in some, and the calibration."""
    folder = tmp_path_factory.mktemp("session")
    pixels, scores = detect(walker(40), ring())
    write_openpose(folder / "clean", pixels, scores)
    for values in (pixels, scores):
        exchange(values, 0, slice(10, 22), LEGS)
        exchange(values, 2, slice(15, 36), LEGS)
        exchange(values, 3, slice(28, 36), ARMS)
    write_openpose(folder / "pose", pixels, scores)
    write_toml(folder / "calib.toml", ring())
    return folder


def expected():
    legs, arms = np.zeros((4, 40), dtype=bool), np.zeros((4, 40), dtype=bool)
    legs[0, 10:22] = legs[2, 15:36] = arms[3, 28:36] = True
    return {"legs": legs, "arms": arms}


def test_planted_exchanges_are_found_and_none_in_clean_views(session):
    found = mo.untangle(session / "pose", session / "calib.toml", rate_hz=60)
    for one in found.exchanges:
        assert (one.exchanged == expected()[one.limb]).all()
    assert {(label.name, label.extra["camera"]) for label in found.track} == {
        ("legs exchanged", "cam1_json"),
        ("legs exchanged", "cam3_json"),
        ("arms exchanged", "cam4_json"),
    }
    clean = mo.untangle(session / "clean", session / "calib.toml", rate_hz=60)
    assert not any(one.exchanged.any() for one in clean.exchanges)


def test_the_command_writes_clean_files_to_the_byte(session, tmp_path, capsys, monkeypatch):
    output = tmp_path / "fixed"
    given = ("--cameras", session / "calib.toml", "--rate", "60", "-o", output)
    done = run(capsys, monkeypatch, "untangle", session / "pose", *given)
    assert done.code == 0
    files = sorted((session / "clean").rglob("*.json"))
    assert len(files) == 160
    for path in files:
        copy = output / path.relative_to(session / "clean")
        assert copy.read_bytes() == path.read_bytes()
    table = (tmp_path / "fixed.exchanges.csv").read_text().splitlines()
    assert len(table) == 4
    assert table[1].startswith("fixed,legs exchanged")


def test_a_folder_of_images_that_is_missing_is_told_before_any_work(
    session, tmp_path, capsys, monkeypatch
):
    given = ("--cameras", session / "calib.toml", "--rate", "60", "-o", tmp_path / "x.trc")
    pages = ("--report", tmp_path / "x.html", "--images", tmp_path / "none")
    done = run(capsys, monkeypatch, "track", session / "pose", *given, *pages)
    assert done.code == 1
    assert "none: no folder there" in done.err
    assert list(tmp_path.iterdir()) == []


def test_points_are_where_they_were(session):
    views = read_keypoints(session / "clean")
    assert (views.layout, views.n_frames, views.names) == ("HALPE_26", 40, NAMES)
    fitted = fit_views(views, read_cameras(session / "calib.toml"))
    points = triangulate(fitted.sight).points
    assert np.linalg.norm(points - walker(40), axis=-1).mean() < 0.012


def test_a_camera_that_is_far_off_is_left_out(session):
    views = read_keypoints(session / "clean")
    views.pixels[1, :, NAMES.index("LWrist")] += 300
    found = triangulate(fit_views(views, read_cameras(session / "calib.toml")).sight)
    wrist = NAMES.index("LWrist")
    assert not found.used[1, :, wrist].any()
    assert np.linalg.norm(found.points[:, wrist] - walker(40)[:, wrist], axis=-1).max() < 0.05


@pytest.mark.parametrize("n_cameras", [2, 7])
def test_two_cameras_and_more_than_are_decided_together(tmp_path, n_cameras):
    pixels, scores = detect(walker(24), ring(n_cameras))
    exchange(pixels, n_cameras - 1, slice(8, 18), LEGS)
    exchange(scores, n_cameras - 1, slice(8, 18), LEGS)
    scores[n_cameras - 1] *= 0.8  # so that it is decided last
    write_openpose(tmp_path / "pose", pixels, scores)
    write_toml(tmp_path / "calib.toml", ring(n_cameras))
    legs = mo.untangle(tmp_path / "pose", tmp_path / "calib.toml", rate_hz=60).exchanges[0]
    planted = np.zeros((n_cameras, 24), dtype=bool)
    planted[-1, 8:18] = True
    assert (legs.exchanged == planted).mean() > 0.98


def refuse(session, views=None, cameras=None, **given):
    views = views or read_keypoints(session / "clean")
    cameras = cameras or read_cameras(session / "calib.toml")
    with pytest.raises(InvalidInput) as caught:
        fit_views(views, cameras, **given)
    return str(caught.value)


def test_what_does_not_fit_is_told_with_what_would(session):
    views = read_keypoints(session / "clean")
    cameras = read_cameras(session / "calib.toml")
    letters = [replace(camera, name=letter) for camera, letter in zip(cameras, "abcd", strict=True)]
    assert "cam1_json by a, cam2_json by b" in refuse(
        session, cameras=[letters[k] for k in (1, 0, 2, 3)]
    )
    assert "multiplied by 2" in refuse(session, replace(views, pixels=views.pixels / 2))
    assert "is of 3" in refuse(session, cameras=letters[:3])
    moved = replace(cameras[0], translation=cameras[0].translation + np.array([1.5, 0, 0]))
    assert "calibration of this recording" in refuse(session, cameras=[moved, *cameras[1:]])


def test_late_images_are_found_and_moved(session):
    views = read_keypoints(session / "clean")
    pixels = views.pixels.copy()
    pixels[1] = np.roll(pixels[1], 6, axis=0)
    late = replace(views, pixels=pixels)
    assert "cam2_json +6" in refuse(session, late)
    cameras = read_cameras(session / "calib.toml")
    assert fit_views(late, cameras, synchronise=True).offsets.tolist() == [0, 6, 0, 0]


def test_units_are_found_by_the_legs(session, tmp_path):
    write_toml(tmp_path / "mm.toml", ring(), unit=1000)
    fitted = fit_views(read_keypoints(session / "clean"), read_cameras(tmp_path / "mm.toml"))
    assert fitted.unit_m == 0.001


def test_people_and_empty_images(session, tmp_path):
    pose = tmp_path / "pose"
    pixels, scores = detect(walker(12), ring(2))
    write_openpose(pose, pixels, scores)
    files = sorted(pose.rglob("*.json"))
    content = json.loads(files[0].read_text())
    files[0].write_text(json.dumps({"version": 1.3, "people": []}))
    assert np.isnan(read_keypoints(pose).pixels[0, 0]).all()
    for path in files[:12]:
        path.write_text(json.dumps({"people": content["people"] * 2}))
    with pytest.raises(InvalidInput, match="two people in 12 of 12"):
        read_keypoints(pose)
    assert read_keypoints(pose, person=0).n_frames == 12
    for path in files:
        path.write_text(json.dumps({"people": []}))
    with pytest.raises(InvalidInput, match="nobody is seen"):
        read_keypoints(pose)


def test_one_camera_is_not_enough(tmp_path):
    pixels, scores = detect(walker(3), ring(1))
    write_openpose(tmp_path / "pose", pixels, scores)
    with pytest.raises(InvalidInput, match="two are needed"):
        read_keypoints(tmp_path / "pose")


def test_annotations_of_coco_one_file_for_each_camera(tmp_path):
    pixels, scores = detect(walker(10), ring(2))
    for camera in range(2):
        rows = [
            {"image_id": f"{frame:04d}.jpg", "category_id": 1, "keypoints": np.concatenate(
                [pixels[camera, frame, :17], scores[camera, frame, :17, None]], axis=1
            ).ravel().round(2).tolist()}
            for frame in range(10)
        ]  # fmt: skip
        (tmp_path / f"cam{camera}.json").write_text(json.dumps(rows))
    views = read_keypoints(tmp_path)
    assert (views.layout, views.n_frames) == ("COCO", 10)
    assert views.pixels == pytest.approx(pixels[:, :, :17], abs=0.006)
