"""A subset of the variants of `evidence/variants.py`: right features, a note, or an error."""

import importlib
from collections import Counter
from pathlib import Path

import pytest

SOURCES = (
    "hdm05/kickLFront1Reps/HDM_bd_kickLFront1Reps_001_120.amc",
    "hdm05/lieDownFloor/HDM_bd_lieDownFloor_001_120.amc",
    "cmu/07_04.amc",
    "bandai/walk_normal_001.bvh",
)
COUNT = 40
SEED = 5
# Every so manyth goes through kinds and formats alike.
STEP = 7


@pytest.fixture(scope="module")
def rows(data):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).resolve().parents[2]))
        script = importlib.import_module("evidence.variants")
    tasks = script.plan(script.load_sources(data, SOURCES), COUNT * STEP, seed=SEED)
    reviewer = script.Reviewer(None)
    return [reviewer.review(task) for task in tasks[::STEP]]


def test_none_is_silently_wrong(rows):
    assert len(rows) == COUNT
    assert len({row["kind"] for row in rows}) > 15
    assert {row["format"] for row in rows} == {"amc", "bvh", "c3d", "trc", "npz"}
    assert [row for row in rows if row["verdict"] == "silently wrong"] == []


def test_most_are_the_same_and_few_are_false_alarms(rows):
    verdicts = Counter(row["verdict"] for row in rows)
    assert verdicts["same"] > 0.6 * COUNT
    assert verdicts["error, rightly"] > 0.1 * COUNT
    assert verdicts["false alarm"] <= 2


def test_values_differ_by_flips_alone(rows):
    same = [row for row in rows if row["verdict"] == "same"]
    assert max(row["flips"] for row in same) < 0.03
