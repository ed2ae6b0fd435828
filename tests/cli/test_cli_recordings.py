"""Commands on real recordings: small parts of HDM05 and CMU."""

import json
import shutil

import pytest

from motionary.io import read_labels

SQUAT = "HDM_mm_squat1Reps_037_120.amc"
TAUGHT = {"squat1Reps": "HDM_tr_squat1Reps_04*", "kickLFront1Reps": "HDM_mm_kickLFront1Reps_*"}


@pytest.fixture(scope="module")
def examples(data, tmp_path_factory):
    """Some examples of two classes, copied with the skeletons they need."""
    folder = tmp_path_factory.mktemp("examples")
    for name, pattern in TAUGHT.items():
        (folder / name).mkdir()
        for path in sorted((data / "hdm05" / name).glob(pattern))[:5]:
            shutil.copy(path, folder / name)
    for path in (data / "hdm05").glob("*.asf"):
        shutil.copy(path, folder)
    return folder


def test_one_squat_finds_squats_of_others(motionary, data, examples):
    like = data / "hdm05" / "squat1Reps" / SQUAT
    ran = motionary("search", data / "hdm05" / "sneak2StepsLStart", examples, "--like", like,
                    "--limit", 5, "--json")  # fmt: skip
    assert ran.code == 0, ran.err
    hits = [json.loads(line) for line in ran.out.splitlines()]
    assert all(hit["recording"].startswith("squat1Reps/HDM_tr_") for hit in hits)
    assert len(hits) == 5


def test_from_examples_to_scores(motionary, data, examples, tmp_path):
    library, labels = tmp_path / "library", tmp_path / "labels.csv"
    ran = motionary("learn", examples, "-o", library, "--mirror")
    assert ran.code == 0, ran.err
    take = data / "cmu" / "86_01.amc"
    ran = motionary("annotate", take, data / "hdm05" / "squat1Reps" / SQUAT, "--library", library,
                    "--threshold", 0.12, "-o", labels)  # fmt: skip
    assert ran.code == 0, ran.err
    found = read_labels(labels)
    assert [label.name for label in found[SQUAT]] == ["squat1Reps"]
    assert "kickLFront1Reps" in found["86_01.amc"].names
    truth = data / "truth" / "annotation_2009.csv"
    ran = motionary("evaluate", labels, "--truth", truth, "--rename", "kickLFront1Reps=kick",
                    "--only", "kick", "--json")  # fmt: skip
    scores = json.loads(ran.out)
    assert list(scores["recordings"]) == ["86_01.amc"]
    assert scores["concatenated"]["segments"]["recall"] == 1


def test_info_says_what_was_assumed(motionary, data):
    take = data / "cmu" / "86_01.amc"
    row = json.loads(motionary("info", take, "--json").out)
    assert (row["rate_hz"], row["frames"], row["relations_known"]) == (120, 4579, 40)
    assert "rate assumed 120 Hz" in row["notes"]
    told = json.loads(motionary("info", take, "--rate", 60, "--json").out)
    assert told["duration_s"] == pytest.approx(2 * row["duration_s"])
    assert "rate assumed 120 Hz" not in told["notes"]


def test_a_skeleton_of_another_name(motionary, data):
    take = data / "cmu" / "exercises" / "13_29.amc"
    ran = motionary("info", take)
    assert ran.code == 1
    assert "13_29.amc: no skeleton found" in ran.out
    ran = motionary("info", take, "--asf", data / "cmu" / "86.asf")
    assert ran.code == 0
    assert "skeleton 86.asf" in ran.out


def test_truth_agrees_with_itself(motionary, data):
    truth = data / "truth" / "annotation_2009.csv"
    ran = motionary("evaluate", truth, "--truth", truth, "--json")
    assert json.loads(ran.out)["concatenated"]["frames"]["f"] == 1
