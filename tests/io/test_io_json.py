"""Keypoints in JSON: those in space are read, of whichever layout; those of images refused."""

import gzip
import json

import numpy as np
import pytest

from motionary import read
from motionary.errors import InvalidInput, NotAMotion, UnreadableFile
from motionary.features import compute_features
from motionary.io import find_recordings, read_all
from motionary.samples import synthetic_motion
from motionary.skeletons import named_mapping

WORLD = named_mapping("mediapipe").order


@pytest.fixture(scope="module")
def trial():
    return synthetic_motion("squat", seed=1, rate_hz=30).cut(0, 20)


def put(folder, content, name="a.json"):
    text = content if isinstance(content, str) else json.dumps(content)
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def by_name(motion, frame):
    return dict(zip(motion.names, motion.positions[frame].tolist(), strict=True))


def with_axes(points):
    return {name: dict(zip("xyz", p, strict=True)) | {"score": 0.9} for name, p in points.items()}


def layouts(motion):
    """The same motion in layouts of scripts and programs."""
    frames = [by_name(motion, i) for i in range(motion.n_frames)]
    lists = motion.positions.tolist()
    names = list(motion.names)
    times = [i / 30 for i in range(motion.n_frames)]
    scored = [[[*p, 0.5] for p in frame] for frame in lists]
    listed = [
        [{"name": n, "x": p[0], "y": p[1], "z": p[2]} for n, p in frame.items()] for frame in frames
    ]
    kinect = [
        {"timestamp_usec": 1e6 * t, "num_bodies": 1, "bodies": [
            {"body_id": 7, "joint_positions": [[1000 * x for x in p] for p in frame]}]}
        for t, frame in zip(times, lists, strict=True)
    ]  # fmt: skip
    mmpose = [
        {"frame_id": i + 1, "instances": [{"keypoints": p, "keypoint_scores": [1] * 24}]}
        for i, p in enumerate(lists)
    ]
    return {
        "frames": {"fps": 30, "frames": [{"joints": frame} for frame in frames]},
        "times": {"frames": [{"time": t, "joints": f} for t, f in zip(times, frames, strict=True)]},
        "clock": [{"timestamp": 1e3 * t, **with_axes(f)}
                  for t, f in zip(times, frames, strict=True)],
        "lists": {"rate_hz": 30, "names": names, "positions": lists},
        "scores": {"metadata": {"fps": 30, "joint_names": names}, "frames": scored},
        "keypoints": {"fps": 30, "names": names, "frames": [{"keypoints3d": p} for p in lists]},
        "objects": {"fps": 30, "frames": listed},
        "places": {"fps": 30, "frames": [
            {"joints": {n: {"position": p, "rotation": [0, 0, 0, 1]} for n, p in frame.items()}}
            for frame in frames]},
        "kinect": {"joint_names": names, "frames": kinect},
        "mmpose": {"fps": 30, "instance_info": mmpose,
                   "meta_info": {"keypoint_id2name": {str(i): n for i, n in enumerate(names)}}},
        "numbered": {"fps": 30, "frames": {f"{i:05}": {"joints": f} for i, f in enumerate(frames)}},
    }  # fmt: skip


LAYOUTS = ["frames", "times", "clock", "lists", "scores", "keypoints", "objects", "places",
           "kinect", "mmpose", "numbered"]  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_hold_the_same_motion(tmp_path, trial, layout):
    motion = read(put(tmp_path, layouts(trial)[layout]))
    assert motion.names == trial.names
    assert motion.rate_hz == pytest.approx(30)
    np.testing.assert_allclose(motion.positions, trial.positions, atol=1e-9)
    features = compute_features(motion)
    assert np.array_equal(features.packed, compute_features(trial).packed)
    assert motion.first_frame == (1 if layout == "mmpose" else 0)
    if layout == "clock":
        assert "times are taken for milliseconds" in motion.notes


def mediapipe(trial):
    """World landmarks of a figure: y down, hips in the origin."""
    body = dict(zip(trial.names, np.moveaxis(trial.positions, 1, 0), strict=True))
    near = {"shoulder": "shoulder", "elbow": "elbow", "wrist": "wrist", "hip": "hip",
            "knee": "knee", "ankle": "ankle", "heel": "ankle", "index": "fingers",
            "pinky": "fingers", "thumb": "fingers", "foot": "toes"}  # fmt: skip
    places = np.empty((trial.n_frames, 33, 3))
    for i, name in enumerate(WORLD):
        side, _, rest = name.partition("_")
        joint = next((j for key, j in near.items() if rest.startswith(key)), "head")
        places[:, i] = body[f"{side[0]}{joint}" if joint != "head" else "head"]
    origin = places[:, [23, 24]].mean(axis=1, keepdims=True)
    return (places - origin) * [1, -1, -1]


@pytest.mark.parametrize("nested", [False, True])
def test_world_landmarks_of_mediapipe(tmp_path, trial, nested):
    frames = []
    for places in mediapipe(trial).tolist():
        marks = [{"x": x, "y": y, "z": z, "visibility": 0.9} for x, y, z in places]
        image = [{"x": 0.5, "y": 0.5, "z": 0.1}] * 33
        frames.append({"pose_world_landmarks": [marks] if nested else {"landmark": marks},
                       "pose_landmarks": image})  # fmt: skip
    motion = read(put(tmp_path, {"fps": 30, "frames": frames}))
    assert motion.mapping.name == "mediapipe"
    assert motion.names == WORLD
    body = motion.generic_positions()
    head, foot = (motion.names.index(name) for name in ("nose", "left_heel"))
    assert (motion.positions[:, head, 1] > motion.positions[:, foot, 1]).all()
    assert np.isfinite(body[:, 0]).all()


def test_what_is_not_seen(tmp_path, trial):
    frames = [{"joints": by_name(trial, i)} for i in range(6)]
    frames[1]["joints"]["head"] = None
    frames[2]["joints"]["head"] = [None, None, None]
    del frames[3]["joints"]["head"]
    frames[4] = {"joints": {}}
    frames[5] = None
    motion = read(put(tmp_path, {"fps": 30, "frames": frames}))
    head = motion.positions[:, motion.names.index("head")]
    assert np.isnan(head[:, 0]).tolist() == [False, True, True, True, True, True]
    assert np.isnan(motion.positions[4:]).all()
    assert np.isfinite(motion.positions[:4, 0]).all()


def test_frames_that_are_missing_are_told(tmp_path, trial):
    frames = [{"frame": i, "joints": by_name(trial, i)} for i in (3, 4, 5, 8, 9, 10, 11)]
    path = put(tmp_path, {"fps": 30, "frames": frames})
    motion = read(path)
    assert (motion.first_frame, motion.n_frames) == (3, 7)
    assert any("2 frames are missing" in note for note in motion.notes)
    even = read(path, even_times=True)
    assert np.isnan(even.positions[:, 0, 0]).tolist() == [False] * 3 + [True] * 2 + [False] * 4


def test_of_several_people_one_is_named(tmp_path, trial):
    frames = [
        {"people": [{"id": f"p{k}", "joints": by_name(trial, i + k)} for k in range(1 + (i > 2))]}
        for i in range(6)
    ]
    path = put(tmp_path, {"fps": 30, "frames": frames})
    with pytest.raises(InvalidInput, match=r"a.json: holds 2 recordings \(p0, p1\)"):
        read(path)
    second = read(path, take="p1")
    assert np.isnan(second.positions[:, 0, 0]).tolist() == [True] * 3 + [False] * 3
    np.testing.assert_allclose(second.positions[4], trial.positions[5])
    assert [motion.n_frames for motion in read_all(path)] == [6, 6]


def test_arrays_and_batches_without_names(tmp_path, trial):
    path = put(tmp_path, [trial.positions.tolist(), trial.positions.tolist()])
    motions = read_all(path, rate_hz=30, skeleton="generic")
    assert [motion.source for motion in motions] == ["a.json#001", "a.json#002"]
    np.testing.assert_allclose(motions[1].positions, trial.positions)
    (tmp_path / "b.json.gz").write_bytes(gzip.compress(path.read_bytes()))
    assert read(tmp_path / "b.json.gz", rate_hz=30, skeleton="generic", take=2).n_frames == 20


def test_units_that_the_file_says(tmp_path, trial):
    frames = [{"joints": {n: [100 * x for x in p] for n, p in by_name(trial, i).items()}}
              for i in range(5)]  # fmt: skip
    motion = read(put(tmp_path, {"fps": 30, "unit": "cm", "frames": frames}))
    np.testing.assert_allclose(motion.positions, trial.positions[:5], atol=1e-9)
    assert "unit cm, as the file says" in motion.notes


FLAT = {
    "openpose": {"version": 1.3, "people": [{"pose_keypoints_2d": [1.0, 2.0, 0.5] * 25}]},
    "coco": {"annotations": [{"image_id": 1, "keypoints": [100, 200, 2] * 17}]},
    "alphapose": [{"image_id": "1.jpg", "keypoints": [100.5, 200.5, 0.9] * 17, "score": 2.0}] * 3,
    "pairs": {"fps": 30, "frames": [{"joints": {"hip": [1, 2], "knee": [3, 4]}}] * 3},
    "lists": {"fps": 30, "names": ["a", "b"], "frames": [[[1, 2], [3, 4]]] * 3},
    "axes": {"fps": 30, "frames": [{"hip": {"x": 1, "y": 2}, "knee": {"x": 1, "y": 3}}] * 3},
    "image": {"fps": 30, "frames": [{"pose_landmarks": [{"x": 0.5, "y": 0.4, "z": 0.1}] * 33}] * 3},
    "normalised": {"fps": 30, "frames": [
        [{"x": 0.3 + 0.01 * i, "y": 0.4, "z": -0.1 + 0.01 * i} for i in range(33)]] * 3},
    "scores": {"fps": 30, "frames": [
        [[100 + 9 * i, 300 - i, 0.5 + 0.01 * i] for i in range(17)]] * 3},
    "zeros": {"fps": 30, "frames": [{"joints": {"a": [1, 2, 0], "b": [3, 5, 0]}}] * 3},
}  # fmt: skip


@pytest.mark.parametrize("name", FLAT)
def test_keypoints_of_images_are_refused_with_what_to_do(tmp_path, name):
    with pytest.raises(NotAMotion, match=r"a.json: .*in two dimensions.*lift them") as caught:
        read(put(tmp_path, FLAT[name]), rate_hz=30)
    assert len(str(caught.value)) < 500


def joints(*points):
    return {"fps": 30, "frames": [{"joints": point} for point in points]}


WRONG = [
    ("", "is no JSON"),
    ("{", "is no JSON"),
    ("[" * 50_000, "lists within lists"),
    ('{"frames":' + "[" * 900 + "1" + "]" * 900 + "}", "a.json: "),
    ("9" * 5000, "is no JSON"),
    ("3", "holds no motion; expected keypoints in three dimensions"),
    ("[]", "holds no motion"),
    ('["a", "b"]', "holds no motion"),
    ({"labels": [{"start": 1}]}, "holds no motion"),
    ({"frames": [1, 2, 3], "fps": 30}, "none of 3 frames has points"),
    (joints({"a": [1, 2, 3], "b": "x"}, {"a": [1, 2, 3], "b": [1, 2, 3]}), None),
    (joints([[1, 2, 3], ["x", 2, 3]]), "expected a point"),
    (joints([[1, 2, 3], {"x": {}, "y": 1, "z": 2}]), "expected a point"),
    (joints([[1, 2, 3], {"x": 1, "y": 1, "z": 2}, {"z": 2}]), "expected a point"),
    ({"fps": 30, "frames": [[[1, 2, 3]] * 3, [[1, 2, 3]] * 2], "names": ["a"] * 3}, "differ"),
    ({"fps": 30, "names": ["a"], "frames": [[[1, 2, 3], [4, 5, 7]]] * 2}, "1 names for 2 joints"),
    ({"frames": [{"joints": {"a": [1, 2, 3], "b": [1, 2, 4]}}]}, "neither times nor a rate"),
]


@pytest.mark.parametrize(("content", "words"), WRONG)
def test_what_is_wrong_is_told(tmp_path, content, words):
    path = put(tmp_path, content)
    if words is None:
        assert "b" in read(path, unit="m", up="y").names
        return
    with pytest.raises((UnreadableFile, InvalidInput), match=words) as caught:
        read(path)
    assert "a.json" in str(caught.value)
    assert len(str(caught.value)) < 500


def test_names_that_differ_in_every_frame_are_no_bomb(tmp_path):
    frames = [{"joints": {f"n{i}": [1, 2, 3]}} for i in range(5000)]
    with pytest.raises(UnreadableFile, match="has 5000 names of points in 5000 frames"):
        read(put(tmp_path, {"fps": 30, "frames": frames}))


def test_a_crowd_is_refused(tmp_path):
    people = [{"id": i, "joints": [[1, 2, 3], [1, 2, 4]]} for i in range(1001)]
    with pytest.raises(UnreadableFile, match="more than 1000 people"):
        read(put(tmp_path, {"fps": 30, "frames": [{"people": people}]}))


def test_huge_and_strange_numbers_are_not_seen(tmp_path):
    text = '{"fps":30,"frames":[{"joints":{"a":[1e400,1,2],"b":[NaN,1,2],"c":[%s,1,2]}},' % (
        "9" * 400
    )
    text += '{"joints":{"a":[0,1,2],"b":[0,1.5,2],"c":[0.5,1,2.5]}}]}'
    motion = read(put(tmp_path, text), unit="m", up="y")
    assert np.isnan(motion.positions[0]).all()
    assert np.isfinite(motion.positions[1]).all()


def test_folders_are_not_searched_for_json(tmp_path, trial):
    put(tmp_path, layouts(trial)["frames"])
    with pytest.raises(UnreadableFile, match="no recordings"):
        find_recordings(tmp_path)
    assert find_recordings(tmp_path / "a.json") == [tmp_path / "a.json"]
