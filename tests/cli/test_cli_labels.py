"""`motionary labels`: to other programs and back, compared, summed up."""

import json

import pytest

from cli_cases import RATE_HZ, run, write_bvh
from motionary.io import read_labels
from motionary.labels import Label, compare_labels
from motionary.samples import synthetic_motion

TABLE = """recording,label,start_s,end_s,cost,note
one.bvh,squat,0.5,1.5,0.02,deep
one.bvh,wave,1,1.75,0.03,
two.bvh,squat,0.25,1.25,0.05,
"""


@pytest.fixture
def motionary(capsys, monkeypatch):
    return lambda *arguments: run(capsys, monkeypatch, *arguments)


@pytest.fixture
def table(tmp_path):
    (tmp_path / "labels.csv").write_text(TABLE)
    for name in ("one", "two"):
        write_bvh(synthetic_motion("squat", seed=0, rate_hz=RATE_HZ), tmp_path / f"{name}.bvh")
    return tmp_path / "labels.csv"


def test_a_table_goes_to_elan_and_comes_back(motionary, table, tmp_path):
    ran = motionary(
        "labels", "convert", table, "-o", tmp_path / "elan", "--to", "eaf",
        "--recordings", tmp_path / "*.bvh",
    )  # fmt: skip
    assert ran.code == 0, ran.err
    assert "ELAN does not keep cost, note" in ran.err
    assert sorted(path.name for path in (tmp_path / "elan").iterdir()) == ["one.eaf", "two.eaf"]
    assert read_labels(tmp_path / "elan" / "one.eaf")["one.bvh"].rate_hz == RATE_HZ
    back = tmp_path / "back.jsonl"
    assert motionary("labels", "convert", tmp_path / "elan" / "*.eaf", "-o", back).code == 0
    assert motionary("labels", "diff", table, back).out == "3 kept\n"
    again = motionary("labels", "convert", table, "-o", back)
    assert (again.code, "exists; say --force" in again.err) == (1, True)


def test_labels_of_another_recording_are_refused(motionary, table, tmp_path):
    out = tmp_path / "x.jsonl"
    ran = motionary("labels", "convert", table, "-o", out, "--recordings", tmp_path / "one.bvh")
    assert ran.code == 1
    assert "two.bvh: there is no recording of this name" in ran.err
    table.write_text(TABLE.replace("1.25", "125"))
    ran = motionary("labels", "convert", table, "-o", out, "--recordings", tmp_path / "*.bvh")
    assert ran.code == 1
    assert "a label ends at 125.00 s ('squat')" in ran.err
    assert not out.exists()


def test_a_choice_of_labels_is_written(motionary, table, tmp_path):
    out = tmp_path / "some.csv"
    assert motionary("labels", "convert", table, "-o", out, "--only", "wave").code == 0
    assert [x.name for track in read_labels(out).values() for x in track] == ["wave"]
    ran = motionary("labels", "convert", table, "-o", tmp_path / "x.csv", "--track", "truth")
    assert (ran.code, "there is no tier truth; the tiers are labels" in ran.err) == (2, True)
    ran = motionary("labels", "convert", table, "-o", tmp_path / "x.doc")
    assert (ran.code, "not written as .doc" in ran.err) == (2, True)


def test_a_differing_table_says_what_changed(motionary, table, tmp_path):
    changed = tmp_path / "changed.csv"
    changed.write_text(TABLE.replace("wave", "bow").replace("0.25", "0.35") + "two.bvh,bow,3,4,,\n")
    ran = motionary("labels", "diff", table, changed, "--json")
    rows = [json.loads(line) for line in ran.out.splitlines()]
    assert [(x["recording"], x["change"], x["label"], x["new_label"]) for x in rows] == [
        ("one.bvh", "renamed", "wave", "bow"),
        ("two.bvh", "moved", "squat", "squat"),
        ("two.bvh", "added", None, "bow"),
    ]
    assert "1 kept, 1 moved, 1 renamed, 1 added" in motionary("labels", "diff", table, changed).out
    changed.write_text("recording,label,start_s,end_s\nthree,x,0,1\n")
    assert "no recording is in both" in motionary("labels", "diff", table, changed).err


def test_labels_are_summed_up_by_name(motionary, table):
    rows = [json.loads(x) for x in motionary("labels", "stats", table, "--json").out.splitlines()]
    assert rows[0] == {
        "label": "squat", "number": 2, "recordings": 2, "total_s": 2.0, "mean_s": 1.0,
        "shortest_s": 1.0, "longest_s": 1.0,
    }  # fmt: skip
    assert "3 labels in 2 recordings" in motionary("labels", "stats", table).out


def test_labels_are_paired_with_those_they_share_most_time_with():
    def kinds(before, after):
        return [
            (change.kind, change.before and change.before.start_s)
            for change in compare_labels([Label(*x) for x in before], [Label(*x) for x in after])
        ]

    two = [("a", 0, 2), ("a", 2, 4)]
    assert kinds(two, two) == [("kept", 0), ("kept", 2)]
    assert kinds(two, [("a", 1.5, 4)]) == [("removed", 0), ("moved", 2)]
    assert kinds(two, [("b", 0, 2), ("a", 2, 4.0004)]) == [("renamed", 0), ("kept", 2)]
    assert kinds(two, [("b", 0, 0.5)]) == [("added", None), ("removed", 0), ("removed", 2)]
    assert kinds([("a", 1, 1)], [("a", 1, 1)]) == [("kept", 1)]
    assert kinds([], []) == []


def test_tables_may_count_in_frames_everywhere(motionary, table, tmp_path):
    framed = tmp_path / "framed.csv"
    rate = f"{RATE_HZ:g}"
    rows = ["one.bvh,squat,15,44", "one.bvh,wave,30,52", "two.bvh,squat,8,37"]
    framed.write_text("\n".join(["recording,label,start_s,end_s", *rows]))
    seconds = tmp_path / "seconds.csv"
    options = ("--frames", "--recordings", tmp_path / "*.bvh")
    assert motionary("labels", "convert", framed, "-o", seconds, *options).code == 0
    first = next(iter(read_labels(seconds)["one.bvh"]))
    assert (first.start_s, first.end_s, first.start_frame) == (0.5, 1.5, 15)
    again = tmp_path / "again.csv"
    ran = motionary("labels", "convert", framed, "-o", again, "--frames", "--rate", rate)
    assert ran.code == 0, ran.err
    assert motionary("labels", "diff", seconds, again).out == "3 kept\n"
    assert motionary("labels", "diff", framed, framed, "--frames").code == 1
    ran = motionary("labels", "stats", framed, "--frames", "--rate", rate, "--json")
    assert json.loads(ran.out.splitlines()[0])["mean_s"] == 1.0
    scores = motionary(
        "evaluate", framed, "--truth", framed, "--frames", "--rate", rate, "--json"
    )  # fmt: skip
    assert scores.code == 0, scores.err
    clips = tmp_path / "clips"
    ran = motionary("cut", framed, tmp_path / "one.bvh", tmp_path / "two.bvh", "-o", clips,
                    "--frames")  # fmt: skip
    assert ran.code == 0, ran.err
    assert "one_squat_0.50-1.50s.bvh" in {path.name for path in clips.iterdir()}
    page = tmp_path / "page.html"
    ran = motionary("report", tmp_path / "one.bvh", tmp_path / "two.bvh", "-o", page,
                    "--labels", framed, "--frames")  # fmt: skip
    assert ran.code == 0, ran.err


def test_a_table_without_labels_is_told(tmp_path, motionary):
    table = tmp_path / "none.csv"
    table.write_text("recording,label,start_s,end_s\n", "utf-8")
    done = motionary("labels", "convert", table, "-o", tmp_path / "none.eaf")
    assert done.code == 1
    assert "no labels to convert" in done.err
    assert not (tmp_path / "none.eaf").exists()
