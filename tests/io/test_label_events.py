"""Labels as events of C3D files and as markers of Blender."""

import json

import ezc3d
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from cli_cases import run, write_bvh
from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.io import read, read_labels, write, write_labels
from motionary.io.labels.lines import list_moments, pair_moments
from motionary.labels import Label, LabelTrack
from motionary.motion import Event, Motion
from motionary.recording import Recording, Segment
from motionary.samples import synthetic_motion
from oracles.c3d_files import DEC, INTEL, MIPS, c3d_bytes

names = st.sampled_from(["walk", "walk #2", "jump start", "été", "[x] y", "end"])
frames = st.lists(st.integers(0, 400), min_size=2, max_size=2, unique=True).map(sorted)


def make(content, unseen=(), rate=120.0, name="take"):
    labels = (
        Label(text, a / rate, b / rate, extra={"track": track} if track else {})
        for text, (a, b), track in content
    )
    gaps = tuple(sorted(Segment(a / rate, b / rate) for a, b in unseen))
    return LabelTrack(Recording(name, rate_hz=rate), tuple(labels), gaps)


def found(track, rate):
    return sorted(
        (x.name, round(x.start_s * rate), round(x.end_s * rate), x.extra.get("track", ""))
        for x in track
    )


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    """A motion of 2000 frames at 120 Hz with two events, as C3D from frame 41 on."""
    folder = tmp_path_factory.mktemp("takes")
    positions = np.random.default_rng(0).uniform(0, 1, (500, 3, 3))
    motion = Motion(
        ("a", "b", "c"),
        positions,
        Recording("take.c3d", rate_hz=120, n_frames=500, first_frame=41),
        events=(Event("Foot Strike", "left", 0.5), Event("Foot Off", "right", 1.5)),
    )
    write(motion, folder / "take.c3d")
    return folder / "take.c3d"


@settings(max_examples=15, deadline=None, phases=[Phase.generate])
@given(
    st.lists(st.tuples(names, frames, st.sampled_from(["", "left hand"])), max_size=6),
    st.lists(frames, max_size=2),
    st.sampled_from([24, 29.97, 30, 50, 59.94, 100, 120]),
)
def test_moments_give_their_labels_back(content, unseen, rate):
    moments = [(moment.time_s, moment.text) for moment in list_moments(make(content, unseen, rate))]
    texts = [
        (f"[{track}] {text}" if track else "[] [x] y" if text == "[x] y" else text, a, b)
        for text, (a, b), track in content
    ] + [("[unassessed]", a, b) for a, b in unseen]
    pairs = [(text, round(a * rate), round(b * rate)) for text, (a, b) in pair_moments(moments)]
    assert sorted(pairs) == sorted(texts)


def test_moments_without_a_partner_have_no_duration():
    pairs = pair_moments([(1, "a end"), (2, "b start"), (3, "b start"), (4, "b end"), (5, "c")])
    assert [(text, *segment) for text, segment in pairs] == [
        ("a end", 1, 1), ("b start", 2, 2), ("b", 3, 4), ("c", 5, 5),
    ]  # fmt: skip


def test_events_go_into_a_copy_and_all_else_stays(take, tmp_path):
    content = [("walk", (12, 61), ""), ("walk", (50, 90), ""), ("wave", (7, 8), "left hand")]
    out = tmp_path / "labelled.c3d"
    write_labels(make(content, [(100, 110)]), out, recording=take)
    before, after = ezc3d.c3d(str(take)), ezc3d.c3d(str(out))
    np.testing.assert_array_equal(after["data"]["points"], before["data"]["points"])
    labels = after["parameters"]["EVENT"]["LABELS"]["value"]
    assert labels[:2] == ["Foot Strike", "Foot Off"]
    assert {"walk start", "walk #2 end", "[left hand] wave start"} <= set(labels)
    assert after["parameters"]["EVENT"]["USED"]["value"][0] == len(labels) == 10
    again = read_labels(out)["labelled.c3d"]
    assert found(again, 120) == sorted(
        [
            *((text, a, b, track) for text, (a, b), track in content),
            ("Left Foot Strike", 60, 60, ""),
            ("Right Foot Off", 180, 180, ""),
        ]
    )
    assert again.unassessed == (Segment(100 / 120, 110 / 120),)
    assert {x.start_s for x in again if x.name == "walk"} == {12 / 120, 50 / 120}


@pytest.mark.parametrize("machine", [INTEL, DEC, MIPS])
def test_events_are_written_in_the_numbers_of_any_machine(tmp_path, machine):
    points = np.random.default_rng(0).uniform(-900, 900, (200, 3, 3)).round(1)
    (tmp_path / "a.c3d").write_bytes(c3d_bytes(points, ["a", "b", "c"], machine=machine))
    motion = read(tmp_path / "a.c3d")
    rate = motion.rate_hz
    content = [(f"motion {i}", (i, 90 + i), "") for i in range(50)]
    write_labels(make(content, rate=rate), tmp_path / "b.c3d", recording=tmp_path / "a.c3d")
    np.testing.assert_array_equal(read(tmp_path / "b.c3d").positions, motion.positions)
    assert len(found(read_labels(tmp_path / "b.c3d")["b.c3d"], rate)) == 50


def test_what_c3d_cannot_hold_is_refused(take, tmp_path):
    out = tmp_path / "out.c3d"
    with pytest.raises(InvalidInput, match="hold 255 events"):
        write_labels(make([(f"x{i}", (1, 2), "") for i in range(128)]), out, recording=take)
    with pytest.raises(InvalidInput, match="up to 255 bytes"):
        write_labels(make([("x" * 300, (1, 2), "")]), out, recording=take)
    with pytest.raises(UnwritableFile, match="is the recording itself"):
        write_labels(make([]), take, recording=take)
    with pytest.raises(InvalidInput, match="needs the recording"):
        write_labels(make([]), out)
    (tmp_path / "x.bvh").write_text("x")
    with pytest.raises(InvalidInput, match="a copy of a C3D file"):
        write_labels(make([]), out, recording=tmp_path / "x.bvh")
    assert not out.exists()


def test_blender_gets_markers_a_motion_and_an_addon(tmp_path, capsys, monkeypatch):
    write_bvh(synthetic_motion("squat", seed=0, rate_hz=30), tmp_path / "take.bvh")
    content = [("walk", (3, 9), ""), ("walk", (9, 20), ""), ("blink", (5, 6), "")]
    track = make(content, [(30, 40)], rate=30, name="take.bvh")
    instant = Label("foot strike", 0.5, 0.5)
    track = LabelTrack(track.recording, (*track.labels, instant), track.unassessed)
    write_labels(track, tmp_path / "labels.csv")
    ran = run(
        capsys, monkeypatch, "labels", "convert", tmp_path / "labels.csv", "-o", tmp_path / "out",
        "--to", "blender", "--recordings", tmp_path / "take.bvh",
    )  # fmt: skip
    assert ran.code == 0, ran.err
    files = {path.name: path for path in (tmp_path / "out").iterdir()}
    assert set(files) == {"take.json", "take.bvh", "motionary_markers.py"}
    assert files["take.bvh"].read_bytes() == (tmp_path / "take.bvh").read_bytes()
    compile(files["motionary_markers.py"].read_text(), "motionary_markers.py", "exec")
    markers = json.loads(files["take.json"].read_text())["markers"]
    # Frames as Blender counts them: the first is 1, the last belongs to the label.
    assert {(x["frame"], x["name"]) for x in markers} >= {
        (4, "walk start"), (9, "walk end"), (10, "walk start"), (20, "walk end"),
        (6, "blink start"), (6, "blink end"), (16, "foot strike"),
    }  # fmt: skip
    again = read_labels(files["take.json"])["take.bvh"]
    assert found(again, 30) == found(track, 30)
    assert again.unassessed == track.unassessed


def test_markers_that_make_no_sense_are_refused(tmp_path):
    (tmp_path / "x.json").write_text('{"rate_hz": 0, "markers": []}')
    with pytest.raises(UnreadableFile, match="rate_hz must be"):
        read_labels(tmp_path / "x.json")
    (tmp_path / "x.json").write_text('{"rate_hz": 30, "markers": [{"frame": "x"}]}')
    with pytest.raises(UnreadableFile, match="expected a number"):
        read_labels(tmp_path / "x.json")
