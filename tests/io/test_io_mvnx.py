"""MVNX of Xsens: written after its documentation, read as the same trial; no file of MVN's own."""

import re

import numpy as np
import pytest

from motionary.errors import NotAMotion, UnreadableFile
from motionary.features import compute_features
from motionary.io import ReadOptions, read, write
from motionary.io.finding import list_takes
from motionary.io.formats.mvnx import read_mvnx_sensors
from motionary.samples import synthetic_motion
from oracles.rig_files import XSENS, mvnx_text


@pytest.fixture(scope="module")
def trial():
    return synthetic_motion("kick_left", seed=2, rate_hz=60).cut(0, 50)


@pytest.fixture(scope="module")
def written(trial):
    return mvnx_text(trial, first=7)


def put(folder, text, name="take.mvnx"):
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def test_the_same_trial_has_the_same_joints_and_features(tmp_path, trial, written):
    motion = read(put(tmp_path, written[0]))
    assert (motion.rate_hz, motion.first_frame, motion.n_frames) == (60, 7, 50)
    assert motion.mapping.name == "xsens_segments"
    np.testing.assert_allclose(motion.generic_positions(), trial.generic_positions(), atol=1e-6)
    ours, theirs = compute_features(motion), compute_features(trial)
    assert np.array_equal(ours.packed, theirs.packed)
    assert np.array_equal(ours.known, theirs.known)


def test_segments_make_a_rig(tmp_path, trial, written):
    motion = read(put(tmp_path, written[0]))
    assert motion.rotations.shape == (50, 24, 4)
    write(motion, tmp_path / "a.bvh")
    again = read(tmp_path / "a.bvh")
    columns = [again.names.index(name) for name in XSENS.values()]
    mine = [motion.names.index(name) for name in XSENS.values()]
    np.testing.assert_allclose(again.positions[:, columns], motion.positions[:, mine], atol=2e-5)


def test_segments_that_slide_make_none(tmp_path, written):
    loose = re.sub(r"(<position>(?:\S+ ){45})\S+", r"\g<1>0.2", written[0])
    motion = read(put(tmp_path, loose))
    assert motion.rotations is None
    assert any("not joined rigidly" in note for note in motion.notes)


@pytest.mark.parametrize("name", ["sensorFreeAcceleration", "sensorAcceleration"])
def test_sensors_are_read_when_asked_for(tmp_path, trial, name):
    text, accelerations = mvnx_text(trial.cut(0, 5), acceleration=name)
    sensors = read_mvnx_sensors(put(tmp_path, text), ReadOptions())
    assert sensors.names == ("Pelvis", "RightHand")
    assert sensors.rate_hz == 60
    np.testing.assert_allclose(sensors.accelerations, accelerations)
    assert sensors.free == (name == "sensorFreeAcceleration")
    np.testing.assert_allclose(np.linalg.norm(sensors.orientations, axis=2), 1, atol=1e-8)
    bare = re.sub(r"<sensorOrientation>.*?</sensorOrientation>", "", text)
    with pytest.raises(UnreadableFile, match="no data of sensors"):
        read_mvnx_sensors(put(tmp_path, bare), ReadOptions())


def test_gaps_are_not_seen(tmp_path, written):
    head, _, rest = written[0].partition('type="normal"')
    gap = head + 'type="normal"' + re.sub(r"(<position>)\S+", r"\g<1>nan", rest, count=1)
    motion = read(put(tmp_path, re.sub(r"<orientation>.*?</orientation>", "", gap)))
    assert np.isnan(motion.positions[0, 0]).all()
    assert np.isfinite(motion.positions[1:, 0]).all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t[: len(t) // 2], r"take.mvnx, line \d+: no element found; is the file whole"),
        (lambda t: t.replace("<position>0", "<position>zero"), "expected numbers in <position>"),
        (lambda t: t.replace("<position>", "<position>0.5 ", 3), "needs 63 numbers in <position>"),
        (lambda t: t.replace("\n", '\n<!DOCTYPE a [<!ENTITY b "c">]>', 1), "document type"),
        (lambda t: re.sub("<frame .*</frame>", "", t, flags=re.DOTALL), "no frames of motion"),
        (lambda t: re.sub("<position>.*?</position>", "", t), "expected frames with <position>"),
        (lambda t: "<html></html>", "no frames of motion"),
    ],
)
def test_what_is_wrong_is_told(tmp_path, written, change, words):
    with pytest.raises(UnreadableFile, match=words):
        read(put(tmp_path, change(written[0])))


def test_a_file_without_motion_is_no_motion(tmp_path):
    with pytest.raises(NotAMotion):
        read(put(tmp_path, "<mvnx/>"))


def test_of_several_people_one_is_named(tmp_path, written):
    start, end = written[0].index("<subject"), written[0].index("</mvnx>")
    body = written[0][start:end]
    text = written[0][:end] + body.replace('"P1"', '"P2"') + "</mvnx>"
    with pytest.raises(ValueError, match=r"holds 2 recordings .*P1, P2"):
        read(put(tmp_path, text))
    assert read(put(tmp_path, text), take="P2").n_frames == 50
    assert list_takes(put(tmp_path, text)) == ["P1", "P2"]
    # The second tag lies across two pieces that are looked through.
    at = text.rindex("<subject")
    padded = text[:at] + " " * ((1 << 20) - at - 4) + text[at:]
    assert list_takes(put(tmp_path, padded)) == ["P1", "P2"]
    assert list_takes(put(tmp_path, written[0])) == []
