"""A person tracked in synthetic views of a walk."""

import base64
import io
import json

import numpy as np
import pytest

import motionary as mo
from cli_cases import documented_keys, run
from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.keypoints import Views
from motionary.multiview import see
from motionary.multiview.chain import linearise, measure_chain, move, points_of, pose_points
from motionary.multiview.tracking import track_points
from motionary.reporting import report_tracking
from motionary.rotations import quaternions_to_matrices, rotation_vectors_to_quaternions
from view_cases import (
    NAMES,
    as_calibrated,
    detect,
    exchange,
    pinhole,
    ring,
    walker,
    write_openpose,
    write_toml,
)

FRAMES = 30
LEGS = ("Hip", "Knee", "Ankle", "BigToe", "SmallToe", "Heel")


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Views of a walk with exchanged legs, lost points and outliers."""
    folder = tmp_path_factory.mktemp("track")
    pixels, scores = detect(walker(FRAMES), ring(), noise_px=4.0)
    rng = np.random.default_rng(3)
    wild = rng.uniform(size=scores.shape) < 0.02
    pixels[wild] += rng.normal(0, 100, (wild.sum(), 2))
    scores[:, 12:20, NAMES.index("LWrist")] = 0
    for values in (pixels, scores):
        exchange(values, 0, slice(5, 18), LEGS)
        exchange(values, 1, slice(10, 22), LEGS)
    write_openpose(folder / "pose", pixels, scores)
    write_toml(folder / "calib.toml", ring())
    return folder


def to_y_up(points):
    return points[..., [1, 2, 0]]


@pytest.fixture(scope="module")
def found(session):
    return mo.track(session / "pose", session / "calib.toml", rate_hz=60)


def test_the_track_is_near_the_truth_and_has_no_gaps(found):
    names = found.motion.names
    truth = to_y_up(walker(FRAMES))[:, [NAMES.index(name) for name in names]]
    far = np.linalg.norm(found.motion.positions - truth, axis=-1)
    assert far.mean() < 0.02
    unseen = far[12:20, names.index("LWrist")]
    assert unseen.max() < 0.08
    assert (found.confidence[13:19, names.index("LWrist")] < 0.05).all()
    assert np.median(found.confidence) > 0.9
    assert found.before.gaps > found.after.gaps == 0
    assert found.after.jitter < 0.5 * found.before.jitter
    assert not np.isnan(found.motion.generic_positions()[:, 1:9]).any()


@pytest.mark.parametrize("suffix", [".trc", ".bvh"])
def test_the_command_writes_what_can_be_read(session, tmp_path, capsys, monkeypatch, suffix):
    path, table = tmp_path / f"walk{suffix}", tmp_path / "confidence.csv"
    given = ("--cameras", session / "calib.toml", "--rate", "60", "-o", path,
             "--report", tmp_path / "walk.html", "--confidence", table)  # fmt: skip
    done = run(capsys, monkeypatch, "track", session / "pose", *given)
    assert (done.code, "sliding" in done.out) == (0, True)
    rows = [row.split(",") for row in table.read_text().splitlines()]
    assert len(rows) == FRAMES + 1
    assert float(rows[15][rows[0].index("LWrist")]) < 0.05
    assert (tmp_path / "walk.html").stat().st_size > 100_000
    motion = mo.read(path)
    joint = "LKnee" if suffix != ".bvh" else "lknee"
    truth = to_y_up(walker(FRAMES))[:, NAMES.index("LKnee")]
    far = np.linalg.norm(motion.positions[:, motion.names.index(joint)] - truth, axis=-1)
    assert far.mean() < 0.03


def test_json_is_what_the_reference_says(session, tmp_path, capsys, monkeypatch):
    given = ("--cameras", session / "calib.toml", "--rate", "60", "-o", tmp_path / "walk.npz")
    done = run(capsys, monkeypatch, "track", session / "pose", *given, "--json")
    told = json.loads(done.out)
    inner = {"label", "start_s", "end_s", "name", "taken", "not_taken", *told["before"]}
    assert told.keys() | inner == set(documented_keys("`motionary track --json` gives one object"))
    assert (told["recording"], told["frames"], told["labels"]) == ("walk", FRAMES, None)
    assert list(told["before"]) == ["sliding_m_s", "below_floor", "unknown", "jitter_m_s2"]
    assert told["after"]["unknown"] == 0 < told["before"]["unknown"]
    assert all(set(one) == {"label", "start_s", "end_s"} for one in told["exchanges"])


def test_a_page_shows_the_track_as_each_camera_saw_it(found, tmp_path):
    """Places and lenses on the page put points where the cameras have them."""
    Image = pytest.importorskip("PIL.Image")
    for camera in range(4):
        folder = tmp_path / f"cam{camera + 1}_json"
        folder.mkdir()
        for frame in range(FRAMES):
            Image.new("RGB", (64, 36), (0, 8 * frame, 0)).save(folder / f"{frame}.png")
    text = report_tracking(found, images=tmp_path).text
    content = json.loads(text.split('id="content">')[1].split("</script>")[0])
    (recording,) = content["recordings"]
    assert [lane["name"] for lane in recording["lanes"]] == ["sides"]
    assert len(recording["views"]) == 4
    points = walker(FRAMES)[0]
    for view, camera in zip(recording["views"], ring(), strict=True):
        away = (to_y_up(points) - view["place"]) @ np.array(view["axes"]).T
        pixels = away[:, :2] * [1, -1] / -away[:, 2:] * view["focal"] + view["centre"]
        assert pixels == pytest.approx(pinhole(camera, points), abs=0.5)
        assert len(view["images"]) == 5
        block = text.split(f'id="{view["images"][-1]}"')[1].split(">", 1)[1].split("<")[0]
        # At 10 Hz the last one is frame 24, by number and not by letters.
        with Image.open(io.BytesIO(base64.b64decode(block))) as image:
            assert image.getpixel((5, 5))[1] == pytest.approx(8 * 24, abs=3)
    (tmp_path / "cam1_json" / "0.png").unlink()
    with pytest.raises(InvalidInput, match="an image for each of 30 frames, got 29"):
        report_tracking(found, images=tmp_path)
    with pytest.raises(UnreadableFile, match="no folder of images"):
        report_tracking(found, images=tmp_path / "cam1_json")


def test_exchanges_are_told_by_the_frames_of_each_cameras_own_images():
    pixels, scores = detect(walker(42), ring())
    late = 6
    for values in (pixels, scores):
        values[1, late:] = values[1, :-late].copy()
        exchange(values, 1, slice(20, 34), LEGS)
    views = Views(tuple("abcd"), NAMES, pixels, scores)
    cameras = as_calibrated(ring())
    found = mo.track(views, cameras, rate_hz=60, synchronise=True)
    assert any("moved" in note for note in found.notes)
    told = [(one.extra["camera"], one.start_frame, one.end_frame) for one in found.exchanges]
    assert told == [("b", 20, 33)]


def a_chain():
    points = to_y_up(walker(FRAMES))
    chain = measure_chain(NAMES, points)
    return chain, points, pose_points(chain, NAMES, points)


def test_the_chain_has_the_lengths_of_the_person_and_goes_through_the_points():
    chain, points, pose = a_chain()
    lengths = dict(zip(chain.joints, np.linalg.norm(chain.offsets, axis=1), strict=True))
    assert lengths["lknee"] == pytest.approx(0.43, abs=1e-6)
    assert lengths["rankle"] == pytest.approx(0.42, abs=1e-6)
    assert lengths["lhip"] == pytest.approx(0.1, abs=1e-6)
    own = [NAMES.index(name) for name in chain.points]
    assert np.linalg.norm(points_of(chain, pose) - points[:, own], axis=-1).max() < 0.03


def test_points_move_by_the_twists_of_the_joints_above_them():
    """Against central differences of the product of exponentials, joint by joint."""
    chain, _, pose = a_chain()
    one = type(pose)(pose.turns[:1], pose.centres[:1])
    points = points_of(chain, one)
    rows = linearise(chain, one, points)
    step = 1e-5
    for unknown in range(rows.shape[-1]):
        twist = np.zeros((1, rows.shape[-1]))
        twist[0, unknown] = step
        ahead, behind = (points_of(chain, move(chain, one, sign * twist)) for sign in (1, -1))
        assert rows[..., unknown] == pytest.approx((ahead - behind) / (2 * step), abs=1e-6)


def test_a_turn_of_the_root_turns_all_points():
    chain, _, pose = a_chain()
    vector = np.array([0.3, -0.2, 0.5])
    twists = np.zeros((FRAMES, 3 + 3 * len(chain.joints)))
    twists[:, 3:6] = vector
    turn = quaternions_to_matrices(rotation_vectors_to_quaternions(vector))
    root = pose.centres[:, :1]
    expected = (points_of(chain, pose) - root) @ turn.T + root
    assert points_of(chain, move(chain, pose, twists)) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("lost", [("LAnkle",), ("Knee", "Ankle", "Toe", "Heel")])
def test_people_are_tracked_whose_legs_no_camera_shows_whole(lost):
    pixels, scores = detect(walker(6), ring())
    unseen = [k for k, name in enumerate(NAMES) if name.endswith(lost)]
    scores[:, :, unseen] = 0
    found = track_points(see_ring(pixels, scores), rate_hz=60)
    names = [name for name in NAMES if not name.endswith(lost)]
    own = [found.chain.points.index(name) for name in names]
    truth = walker(6)[:, [NAMES.index(name) for name in names]]
    assert np.linalg.norm(found.points[:, own] - to_y_up(truth), axis=-1).mean() < 0.02


def test_few_images_are_tracked_and_one_or_no_hip_is_refused(tmp_path):
    write_toml(tmp_path / "calib.toml", ring())
    for n in (2, 3):
        write_openpose(tmp_path / f"pose{n}", *detect(walker(n), ring()))
        found = mo.track(tmp_path / f"pose{n}", tmp_path / "calib.toml", rate_hz=60)
        assert found.motion.n_frames == n
        assert np.isfinite(found.motion.positions).all()
    pixels, scores = detect(walker(4), ring())
    with pytest.raises(InvalidInput, match=r"two images or more with both hips.*got 1"):
        track_points(see_ring(pixels[:, :1], scores[:, :1]), rate_hz=60)
    scores[:, :, NAMES.index("LHip")] = 0
    with pytest.raises(InvalidInput, match=r"both hips.*got 4 with"):
        track_points(see_ring(pixels, scores), rate_hz=60)


def see_ring(pixels, scores):
    """What the ring of cameras sees, y up, without the points that it never sees."""
    views = Views(tuple(f"cam_{k + 1:02d}" for k in range(4)), NAMES, pixels, scores)
    sight = see(views, as_calibrated(ring()))
    turn = np.array([[0, 1.0, 0], [0, 0, 1], [1, 0, 0]])
    sight = sight._replace(directions=sight.directions @ turn.T, origins=sight.origins @ turn.T)
    return sight.of_points(np.flatnonzero(scores.any(axis=(0, 1))).tolist())
