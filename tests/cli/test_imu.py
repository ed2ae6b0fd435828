"""`motionary imu` and `motionary synth`, on synthetic recordings."""

import json

import numpy as np
import pytest

import motionary as mo
from cli_cases import documented_keys
from motionary.samples import synthetic_stream

pytest.importorskip("vqf")

#: Of an object of `imu check --json`, as documented.
KEYS = ["recording", "sensor", "limb", "median_deg", "p95_deg", "swing_deg", "twist_deg",
        "deviation_deg", "heading_deg", "drift_deg", "margin", "lag_s", "wrong_s", "wrong",
        "notes"]  # fmt: skip


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    folder = tmp_path_factory.mktemp("worn by Jörg")
    stream, _ = synthetic_stream(["squat", "kick_left", "spin_left"], seed=3, rate_hz=60.0)
    mo.write(stream, folder / "take.bvh")
    return folder


def test_sensors_are_made_and_checked(take, motionary):
    made = motionary("synth", "imu", take / "take.bvh", "-o", take / "s", "--limb", "lthigh",
                     "--limb", "rthigh")  # fmt: skip
    assert made.code == 0
    assert sorted(path.name for path in (take / "s").iterdir()) == [
        "synthetic-lthigh.txt", "synthetic-rthigh.txt"]  # fmt: skip
    done = motionary("imu", "check", take / "take.bvh", "--imu", take / "s", "--json",
                     "-o", take / "t.csv", "--labels", take / "l.csv",
                     "--plot", take / "p.png")  # fmt: skip
    assert done.code == 0
    rows = [json.loads(line) for line in done.out.splitlines()]
    assert {row["sensor"]: row["limb"] for row in rows} == {
        "synthetic-lthigh": "lthigh", "synthetic-rthigh": "rthigh"}  # fmt: skip
    assert all(row["wrong"] == [] and row["median_deg"] < 4 for row in rows)
    assert abs(rows[0]["lag_s"]) < 0.02
    assert all(list(row) == KEYS for row in rows)
    assert {key: type(rows[0][key]).__name__ for key in KEYS} == {
        **dict.fromkeys(KEYS, "float"), "recording": "str", "sensor": "str", "limb": "str",
        "notes": "str", "wrong": "list"}  # fmt: skip
    assert (take / "t.csv").read_text("utf-8").startswith("recording,sensor,limb,median_deg")
    assert (take / "p.png").stat().st_size > 5000
    again = motionary("imu", "check", take / "take.bvh", "--imu", take / "s", "-o", take / "t.csv")
    assert again.code == 1
    assert "--force" in again.err
    limbs = take / "limbs.toml"
    limbs.write_text('"synthetic-lthigh" = "rthigh"\n"synthetic-rthigh" = "lthigh"\n', "utf-8")
    swapped = motionary("imu", "check", take / "take.bvh", "--imu", take / "s", "--map", limbs)
    assert "thigh off" in swapped.out
    assert "fits lthigh much better" in swapped.out


def test_the_keys_of_a_check_are_documented():
    assert documented_keys("gives an object per sensor with `--json`") == KEYS


def test_orientations_are_written_for_opensense(take, motionary):
    motionary("synth", "imu", take / "take.bvh", "-o", take / "o", "--limb", "lshank")
    done = motionary("imu", "orient", take / "o", "-o", take / "o.sto")
    assert done.code == 0
    assert (take / "o.sto").read_text("utf-8").splitlines()[1] == "DataType=Quaternion"


def test_depth_images_are_made(take, motionary):
    from PIL import Image

    done = motionary("synth", "depth", take / "take.bvh", "-o", take / "d", "--images", "1",
                     "--noise", "tof", "--from", "1", "--to", "1.2", "--distance", "1")  # fmt: skip
    assert done.code == 0
    assert "in 1 of 1 images the person is not whole" in done.err
    done = motionary("synth", "depth", take / "take.bvh", "-o", take / "d", "--images", "1",
                     "--noise", "tof", "--force")  # fmt: skip
    assert done.code == 0
    assert done.err == ""
    told = json.loads((take / "d" / "camera.json").read_text("utf-8"))
    assert told["synthetic"] is True
    image = np.array(Image.open(take / "d" / "synthetic-000000.png"))
    assert (image.dtype, image.shape) == (np.uint16, (240, 320))
    body = image[image > 0]
    assert 1000 < len(body) < 8000
    assert 2700 < np.median(body) < 3200


def test_two_runs_do_not_mix(take, motionary):
    folder = take / "m"
    motionary("synth", "imu", take / "take.bvh", "-o", folder, "--limb", "lthigh")
    other = ("synth", "imu", take / "take.bvh", "-o", folder, "--limb", "rthigh")
    refused = motionary(*other)
    assert refused.code == 1
    assert "--force" in refused.err
    (folder / "notes.md").write_text("mine", "utf-8")
    assert motionary(*other, "--force").code == 0
    assert sorted(path.name for path in folder.iterdir()) == [
        "notes.md", "synthetic-rthigh.txt"]  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["imu", "check", "TAKE", "--imu", "nowhere"], "nowhere"),
        (["imu", "check", "TAKE", "--imu", "TAKE"], "recordings of sensors are"),
        (["imu", "check", "TAKE", "--imu", "FOLDER"], "no recordings of sensors"),
        (["imu", "check", "TAKE", "--imu", "FOLDER", "--map", "no.toml"], "no.toml"),
        (["synth", "imu", "TAKE", "-o", "x", "--limb", "tail"], "'tail' are not known"),
        (["synth", "depth", "TAKE", "-o", "x", "--noise", "snow"], "choose one of"),
        (["synth", "depth", "TAKE", "-o", "x", "--images", "0"], "images_hz needs"),
        (["synth", "depth", "TAKE", "-o", "x", "--images", "nan"], "images_hz needs"),
        (["synth", "depth", "TAKE", "-o", "x", "--from", "9", "--to", "8"], "got 9 to 8"),
        (["synth", "depth", "TAKE", "-o", "x", "--distance", "1e9"], "distance_m needs"),
        (["synth", "imu", "TAKE", "-o", "x", "--seed", "-1"], "--seed"),
    ],
)
def test_wrong_use_is_told(take, motionary, arguments, message):
    (take / "empty").mkdir(exist_ok=True)
    known = {"TAKE": str(take / "take.bvh"), "FOLDER": str(take / "empty")}
    told = [known.get(one, one) for one in arguments]
    done = motionary(*told)
    assert done.code in (1, 2)
    assert message in done.err
