"""Are labelled parts of recordings examples of their classes, in any format and from arrays?"""

from dataclasses import replace

import numpy as np
import pytest
from test_library import contents

import motionary as mo
from cli_cases import write_stream
from library_cases import Listening, made_class, perform
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import compute_features
from motionary.io import read, write_labels
from motionary.labels import Label, LabelTrack
from motionary.models.library import TrainingOptions, cut_example, learn, read_labelled
from motionary.models.library.training import make_folds
from motionary.recording import Recording
from motionary.samples import synthetic_motion


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """Two recordings, and a track of labels of each."""
    folder = tmp_path_factory.mktemp("takes")
    tracks = {}
    for seed, name in enumerate(("one.bvh", "two.bvh")):
        segments = write_stream(folder / name, seed=seed)
        labels = [Label(*segment, extra={"person": f"p{seed}"}) for segment in segments]
        tracks[name] = LabelTrack(Recording(name), tuple(labels))
    return folder, tracks


def parts_of(folder, tracks):
    """The same examples, cut by hand."""
    examples = {}
    for name, track in tracks.items():
        sequence = compute_features(read(folder / name))
        for label in track:
            part = sequence.part(round(label.start_s * 30), round(label.end_s * 30))
            examples.setdefault(label.name, []).append(part)
    return examples


@pytest.mark.parametrize("suffix", [".csv", ".xlsx", ".jsonl"])
def test_a_table_of_times_teaches_what_its_parts_teach(world, tmp_path, suffix):
    folder, tracks = world
    pytest.importorskip("openpyxl" if suffix == ".xlsx" else "numpy")
    table = tmp_path / f"times{suffix}"
    write_labels(tracks, table)
    got = learn(table, recordings=folder)
    assert contents(got) == contents(learn(parts_of(folder, tracks)))
    read_again = read_labelled(table, folder)
    assert not read_again.failures
    assert not read_again.unusable
    people = {
        x.recording.person for c in read_again.classes.values() for p in c.values() for x in p
    }
    assert people == {"p0", "p1"}


def test_a_table_lies_beside_its_recordings(world):
    folder, tracks = world
    write_labels(tracks, folder / "times.csv")
    assert contents(learn(folder / "times.csv")) == contents(learn(tracks, recordings=folder))


def test_events_of_a_recording_are_its_labels(world, tmp_path):
    folder, tracks = world
    mo.write(read(folder / "one.bvh"), tmp_path / "plain.c3d")
    write_labels(tracks["one.bvh"], tmp_path / "take.c3d", recording=tmp_path / "plain.c3d")
    library = learn(tmp_path / "take.c3d")
    assert set(library.names) == {label.name for label in tracks["one.bvh"]}


def test_arrays_are_measured_with_a_rate_and_a_skeleton():
    motion = synthetic_motion("squat", seed=0, rate_hz=60)
    array = motion.generic_positions()
    expected = learn({"squat": [compute_features(array, rate_hz=60)]})
    assert contents(learn({"squat": [array]}, rate_hz=60)) == contents(expected)
    long = np.concatenate([array] * 3)
    label = Label("squat", 0.5, 1.5)
    track = LabelTrack(Recording("take"), (label,))
    got = learn(track, recordings={"take": long}, rate_hz=60)
    part = cut_example(compute_features(long, rate_hz=60), label)
    assert contents(got) == contents(learn({"squat": [part]}))
    with pytest.raises(InvalidInput, match="needs rate_hz="):
        learn({"squat": [array]})


def test_what_cannot_be_used_is_told_and_the_rest_is_learned(world):
    folder, tracks = world
    end = read(folder / "one.bvh").recording.duration_s
    wrong = [
        LabelTrack(Recording("nowhere.bvh"), (Label("squat", 0.0, 1.0),)),
        LabelTrack(Recording("one.bvh"), (Label("late", end - 1, end + 5),)),
        LabelTrack(Recording("two.bvh"), (Label("moment", 1.0, 1.0),)),
    ]
    heard = Listening()
    library = learn([*wrong, tracks["one.bvh"]], recordings=folder, monitor=heard)
    assert set(library.names) == set(tracks["one.bvh"].names)
    told = [n.text for n in heard.notices if n.is_failure]
    assert told[0] == (
        "nowhere.bvh: there is no recording of this name; there are one.bvh, two.bvh"
    )
    assert "are the labels of another recording?" in told[1]
    assert told[2] == "two.bvh 1.00-1.00 s (moment): too short for an example; left out"
    assert heard.stages["reading"] == (4 - 1, 4)
    for track in wrong:
        with pytest.raises(InvalidInput):
            learn(track, recordings=folder)


def test_recordings_that_are_not_there_are_told_from_those_that_several_may_be(world):
    _, tracks = world
    named = [replace(tracks["one.bvh"], recording=Recording(name)) for name in ("one", "x", "y")]
    array = np.zeros((9, 24, 3))
    read = read_labelled(named, {"a/one.bvh": array, "b/one.bvh": array})
    assert [str(error) for error in read.unusable] == [
        "x, y: there is no recording of this name; there are a/one.bvh, b/one.bvh",
        "one: several recordings may be meant, a/one.bvh, b/one.bvh; name one of them with its "
        "folder and suffix",
    ]
    assert not read.classes


def test_labels_without_recordings_or_without_labels(world, tmp_path):
    folder, tracks = world
    with pytest.raises(InvalidInput, match="need the recordings"):
        learn(tracks)
    with pytest.raises(InvalidInput, match="no labels to learn from"):
        learn(LabelTrack(Recording("one.bvh")), recordings=folder)
    with pytest.raises(InvalidInput, match="go with labels of their times"):
        learn(folder, recordings=folder)
    with pytest.raises(UnreadableFile, match="no such folder"):
        learn(tmp_path / "nothing.csv")


def test_people_are_held_out_together():
    def example(i, person):
        one = perform(made_class(1), i, name=f"{i}.bvh")
        return replace(one, recording=replace(one.recording, person=person))

    people = [f"p{i % 3}" for i in range(9)]
    examples = {"step": {"step": [example(i, person) for i, person in enumerate(people)]}}
    for fold in make_folds(examples, groups=None, seed=0):
        held = {x.recording.person for _, x in fold.held_out}
        learned = {x.recording.person for x in fold.learned["step"]["step"]}
        assert len(held) == 1
        assert held.isdisjoint(learned)
    unknown = {"step": {"step": [example(i, "") for i in range(9)]}}
    assert len(make_folds(unknown, groups=None, seed=0)) == 5


def test_a_library_of_a_table_remembers_no_names(world, tmp_path):
    folder, tracks = world
    library = learn(tracks, TrainingOptions(keep_examples=True), recordings=folder)
    library.save(tmp_path / "library")
    text = "".join(p.read_text() for p in (tmp_path / "library").glob("*.toml"))
    assert "p0" not in text
    assert "one.bvh" not in text
