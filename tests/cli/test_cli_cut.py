"""`motionary cut`: labels become files in the rig and rate of their recording."""

import re

import numpy as np
import pytest

from cli_cases import write_bvh
from motionary.io import read, read_labels
from motionary.samples import synthetic_motion

TABLE = """recording,label,start_s,end_s
a/take.bvh,squat,0.5,1.5
a/take.bvh,bow,1.0,2.0
b.bvh,squat,0.2,0.9
"""


@pytest.fixture
def world(tmp_path):
    for i, name in enumerate(("a/take.bvh", "b.bvh")):
        motion = synthetic_motion("squat", seed=i, rate_hz=30)
        write_bvh(motion, tmp_path / "recordings" / name)
    (tmp_path / "labels.csv").write_text(TABLE)
    return tmp_path


def test_labels_become_clips(motionary, world):
    ran = motionary("cut", world / "labels.csv", world / "recordings", "-o", world / "clips")
    assert (ran.code, ran.out) == (0, "")
    assert ran.err == f"motionary: 3 of 3 clips written to {world / 'clips'}\n"
    assert sorted(path.name for path in (world / "clips").iterdir()) == [
        "b_squat_0.20-0.90s.bvh", "take_bow_1.00-1.80s.bvh", "take_squat_0.50-1.50s.bvh",
    ]  # fmt: skip
    clip, whole = (read(world / path) for path in
                   ("clips/take_squat_0.50-1.50s.bvh", "recordings/a/take.bvh"))  # fmt: skip
    assert np.array_equal(clip.positions, whole.positions[15:45])


def test_some_labels(motionary, world):
    cut = ("cut", world / "labels.csv", world / "recordings", "-o", world / "clips")
    assert motionary(*cut, "--only", "bow").code == 0
    assert [path.name for path in (world / "clips").iterdir()] == ["take_bow_1.00-1.80s.bvh"]
    ran = motionary(*cut, "--only", "bwo")
    assert ran.code == 2
    assert "no label is called bwo; there are bow, squat" in " ".join(ran.err.split())


def test_a_batch_finishes(motionary, world):
    table = TABLE + "none.bvh,squat,0,1\nb.bvh,late,90,91\n"
    (world / "labels.csv").write_text(table)
    ran = motionary("cut", world / "labels.csv", world / "recordings", world / "nothing", "-o",
                    world / "clips")  # fmt: skip
    assert ran.code == 1
    told = ran.err.splitlines()
    assert re.match(r"motionary: .*nothing: no such file or folder", told[0])
    assert "none_squat_0.00-1.00s.bvh: none.bvh: there is no recording of this name" in ran.err
    assert "b_late_90.00-91.00s.bvh: b.bvh: lasts " in ran.err
    assert told[-1].endswith(f"3 of 5 clips written to {world / 'clips'}")


@pytest.mark.parametrize(
    ("table", "words"),
    [("recording,label\n", "column start_s, end_s is missing"), (None, "cannot be read")],
)
def test_a_table_that_is_none(motionary, world, table, words):
    (world / "labels.csv").unlink()
    if table is not None:
        (world / "labels.csv").write_text(table)
    ran = motionary("cut", world / "labels.csv", world / "recordings", "-o", world / "clips")
    assert ran.code == 1
    assert words in ran.err


def test_a_folder_that_cannot_be_made(motionary, world):
    (world / "file").touch()
    ran = motionary("cut", world / "labels.csv", world / "recordings", "-o", world / "file" / "x")
    assert ran.code == 1
    assert "file is a file, not a folder" in ran.err


def test_clips_of_recordings_are_what_was_labelled(motionary, data, tmp_path):
    (tmp_path / "labels.csv").write_text(
        "recording,label,start_s,end_s,start_frame,end_frame\n"
        "86_01,walk,1,2,121,240\n01_01.bvh,jump,1,2,120,239\n"
    )
    ran = motionary("cut", tmp_path / "labels.csv", data / "cmu" / "86_01.amc",
                    data / "cmu" / "01_01.bvh", "-o", tmp_path / "clips")  # fmt: skip
    assert ran.code == 0, ran.err
    names = sorted(path.name for path in (tmp_path / "clips").iterdir())
    assert names == ["01_01_jump_1.00-2.00s.bvh", "86.asf", "86_01_walk_1.00-2.00s.amc"]
    for clip, whole in ((names[2], "86_01.amc"), (names[0], "01_01.bvh")):
        cut, full = read(tmp_path / "clips" / clip), read(data / "cmu" / whole)
        assert np.array_equal(cut.positions, full.positions[120:240])
        assert (cut.names, cut.rate_hz) == (full.names, full.rate_hz)


def test_labels_of_annotate_and_search_are_cut(motionary, world):
    from motionary.models.library import learn

    learn({"squat": [read(world / "recordings" / "b.bvh")]}).save(world / "library")
    table = world / "found.csv"
    motionary("annotate", world / "recordings", "--library", world / "library", "-o", table,
              "--threshold", 0.2)  # fmt: skip
    labels = read_labels(table)
    assert labels
    ran = motionary("cut", table, world / "recordings", "-o", world / "clips")
    assert ran.code == 0, ran.err
    assert len(list((world / "clips").iterdir())) == sum(map(len, labels.values()))
