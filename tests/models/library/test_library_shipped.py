"""The library of everyday motion: whole, small, under its licences, and used by default."""

import shutil
from pathlib import Path

import pytest

from motionary.errors import InvalidInput
from motionary.features import compute_features
from motionary.models.library import (
    ClassLibrary,
    editing,
    false_rates_of,
    format_thresholds,
    load_everyday,
    load_library,
    merge_libraries,
    open_library,
    thresholds_for,
)
from motionary.models.library.editing import (
    _FOLDERS,
    CALIBRATION,
    load_parts,
    write_calibration,
)
from motionary.retrieval.annotation import annotate
from motionary.samples import synthetic_motion

HOME = Path(editing.__file__).parents[2] / "libraries"
ASKED = {
    "walk", "run", "sneak", "jump", "hop", "turn around", "kick", "throw", "squat", "sit down",
    "stand up", "lunge", "side lunge", "knee raise", "leg raise", "arm raise sideways",
    "arm raise forward", "arm circles", "elbow to knee", "reach up", "put down", "lie down",
}  # fmt: skip


def test_it_holds_everyday_motion_and_is_small():
    library = load_everyday()
    assert set(library.names) >= ASKED
    assert library.has_scores
    assert library["walk"].kind == "state"
    assert library["kick"].kind == "event"
    assert sum(path.stat().st_size for path in HOME.rglob("*.*")) < 2_000_000


def test_what_was_learned_from_hdm05_lies_in_its_folder_under_its_licence():
    free, bound = (load_library(HOME / one) for one in _FOLDERS)
    assert free.licence == "Apache-2.0"
    assert "HDM05" not in free.provenance
    assert bound.licence == "CC BY-SA 3.0"
    assert "CG-2007-2" in bound.provenance
    assert "by-sa/3.0" in (HOME / _FOLDERS[1] / "LICENCE.txt").read_text("utf-8")
    sources = [(HOME / one / "SOURCES.txt").read_text("utf-8") for one in _FOLDERS]
    assert "hdm05/" not in sources[0]
    assert "ui_prmd/" in sources[0]
    assert "hdm05/" in sources[1]
    assert all(len(line.split("  ")[0]) == 64 for text in sources for line in text.splitlines())


def test_classes_keep_origin_and_licence_in_other_libraries(tmp_path):
    everyday = load_everyday()
    assert everyday["reach up"].licence == "CC BY-SA 3.0"
    assert everyday["lunge"].licence == "Apache-2.0"
    assert everyday["squat"].licence == "Apache-2.0; CC BY-SA 3.0"
    merge_libraries([everyday]).save(tmp_path / "mine")
    again = open_library(tmp_path / "mine")
    assert isinstance(again, ClassLibrary)
    assert {one.name: (one.licence, one.provenance) for one in again} == {
        one.name: (one.licence, one.provenance) for one in everyday
    }


def test_it_says_how_sure_labels_are_and_how_many_are_false():
    everyday = load_everyday()
    assert false_rates_of(everyday) is not None
    least = dict(zip(everyday.names, thresholds_for(everyday), strict=True))
    assert (least["walk"], least["kick"], least["T-pose"]) == (6.5, 6.0, 7.5)
    assert (thresholds_for(everyday, 0.1) > thresholds_for(everyday, 1.0)).all()
    assert "T-pose, arm raise sideways 7.5" in format_thresholds(everyday)
    walk = compute_features(synthetic_motion("walk", seed=1))
    labels = list(annotate(walk, at_most_false_per_min=20.0))
    assert labels
    assert all(0 < label.probability <= 1 and label.false_per_min > 0 for label in labels)


def test_who_walks_may_turn_around_meanwhile():
    everyday = load_everyday()
    turn, walk = everyday["turn around"], everyday["walk"]
    assert not turn.parts_mask & walk.parts_mask
    assert turn.parts_mask & everyday["squat"].parts_mask


def test_a_calibration_is_read_as_it_was_written(tmp_path):
    everyday = load_everyday()
    for one in _FOLDERS:
        shutil.copytree(HOME / one, tmp_path / one)
    path = tmp_path / _FOLDERS[1] / CALIBRATION
    path.unlink()
    write_calibration(everyday, path)
    again = load_parts(tmp_path)
    assert again.scoring == everyday.scoring
    assert [one.false_level for one in again] == [one.false_level for one in everyday]
    with pytest.raises(InvalidInput, match="not calibrated"):
        write_calibration(load_library(HOME / _FOLDERS[0]), path)


def test_it_is_the_default_of_annotate_and_opened_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert open_library("everyday") is load_everyday()
    sequence = compute_features(synthetic_motion("squat", seed=1))
    assert annotate(sequence) == annotate(sequence, load_everyday())
    with pytest.raises(InvalidInput, match="its classes are"):
        load_everyday()["juggling"]
