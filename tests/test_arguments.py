"""Errors of our own and of Python: what was expected, what came, what to do."""

import io
import json
import pickle
import tomllib
import zipfile

import numpy as np
import pytest

import motionary as mo
from motionary.errors import (
    InvalidInput,
    NotAMotion,
    SeveralRecordings,
    UnreadableFile,
    WrongKind,
    describe_cause,
)
from motionary.models.library import open_library
from motionary.retrieval.index import collect
from motionary.samples import synthetic_motion

WALK = synthetic_motion("walk", seed=0, rate_hz=30)
TRACK = mo.LabelTrack(mo.Recording("a"), (mo.Label("walk", 0.0, 1.0),))
LIBRARY = mo.ClassLibrary(())
PLACES = np.zeros((4, 24, 3))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: mo.annotate([WALK, WALK], LIBRARY), "recording must be Motion or FeatureS.*list"),
        (lambda: mo.annotate("take.bvh", LIBRARY), r"got str; read files first.*read\(path\)"),
        (lambda: mo.annotate(LIBRARY, WALK), "got ClassLibrary"),
        (lambda: mo.annotate(WALK, "library"), r"library must be ClassLibrary, got str.*\.load"),
        (lambda: WALK.cut(1.5, 3.5), r"first must be a whole number, got float; for seconds.*rate"),
        (lambda: WALK.cut(1, 3.5), "stop must be a whole number"),
        (lambda: mo.search(PLACES, [WALK]), r"query must be an example.*Motion .*got ndarray"),
        (lambda: mo.search("take.bvh", [WALK]), r"got str; read files first"),
        (lambda: mo.search([WALK, "x"], [WALK]), r"query must be .*got str"),
        (lambda: mo.search(WALK, WALK), "str or Path or a list, got Motion; .*motions in a list"),
        (lambda: mo.search(WALK, PLACES), r"a recording must be .*got ndarray; give a folder"),
        (lambda: mo.search(WALK, [LIBRARY]), "got ClassLibrary"),
        (lambda: mo.search(WALK, {"a": "a.bvh"}), "'a' must be Motion or FeatureSequence"),
        (lambda: mo.search(WALK, [WALK], threshold="a"), "threshold must be a number, got str"),
        (lambda: mo.search(WALK, [WALK], limit=1.5), "limit must be a whole number, got float"),
        (lambda: mo.learn([WALK, WALK]), "one folder per class, or a dict"),
        (lambda: mo.learn({"walk": WALK}), "examples of 'walk' must be a list, got Motion"),
        (lambda: mo.learn({"walk": ["a.bvh"]}), "an example of 'walk' must be Motion or"),
        (lambda: mo.read(["a.bvh"]), r"path must be str or Path, got list"),
        (lambda: mo.read(PLACES), "got ndarray"),
        (lambda: mo.write("a.bvh", WALK), r"write\(motion, path\)"),
        (lambda: mo.write([WALK], "a.bvh"), "motion must be Motion, got list"),
        (lambda: mo.read_labels(None), "path must be str or Path, got NoneType"),
        (lambda: mo.write_labels([mo.Label("a", 0, 1)], "a.csv"), "a track must be LabelTrack"),
        (lambda: mo.write_labels("a", "a.csv"), "a track must be LabelTrack, got str"),
        (lambda: mo.write_labels(TRACK, None), "path must be"),
        (lambda: mo.explain(TRACK), r"\[explain\(label\) for label in track\]"),
        (lambda: mo.count(TRACK.labels), "a track must be LabelTrack, got Label"),
        (lambda: mo.count(3), "tracks must be a list, got int"),
        (lambda: mo.evaluate("a.csv", "b.csv"), "expected labels by recording, got str"),
        (lambda: mo.evaluate([TRACK, TRACK], TRACK), "comes twice"),
        (lambda: mo.compute_features("a.bvh"), "files are read first"),
        (lambda: mo.compute_features([WALK, WALK]), "one after the other"),
        (lambda: mo.compute_features(PLACES[None], rate_hz=30), "of a batch"),
        (lambda: mo.compute_features(PLACES, rate_hz="30"), "rate_hz must be a number"),
        (lambda: mo.compute_features(WALK, source="a"), "source= go with arrays"),
        (lambda: mo.report("a.bvh", "a.html"), "recordings must be Motion.*, got str; read files"),
        (lambda: mo.Index.open(WALK), "path must be str or Path, got Motion"),
        (lambda: mo.ClassLibrary.load(3), "path must be str or Path, got int"),
        (lambda: mo.Label("a", "0", "1"), "a time must be a number, got str"),
        (lambda: mo.LabelTrack("a.bvh"), "recording must be Recording, got str"),
        (lambda: mo.LabelTrack(mo.Recording("a"), [("a", 0, 1)]), "a label must be Label"),
        (lambda: mo.Recording("a", rate_hz="30"), "rate_hz must be a number, got str"),
        (lambda: mo.Motion(("a",), [[0, 0, 0]], 30), "positions must be a NumPy array, got list"),
        (lambda: mo.Motion(("a",), PLACES[:, :1], 30), "recording must be Recording, got int"),
    ],
)
def test_is_refused(call, words):
    with pytest.raises(InvalidInput, match=words) as told:
        call()
    assert "\n" not in str(told.value)
    if " must be " in str(told.value):
        assert isinstance(told.value, WrongKind)
        assert isinstance(told.value, TypeError)


def test_whole_numbers_of_numpy_are_numbers():
    assert WALK.cut(np.int64(1), np.int32(9)).n_frames == 8
    assert len(collect([mo.compute_features(WALK), WALK])) == 2


def test_arrays_have_names():
    places = WALK.generic_positions()
    named = mo.compute_features(places, rate_hz=30, source="clip.npy")
    assert (named.source, mo.compute_features(places, rate_hz=30).source) == ("clip.npy", "")
    hits = mo.search(WALK, {"one": mo.compute_features(places, rate_hz=30), "two": WALK})
    assert {hit.recording.name for hit in hits} == {"one", "two"}


def test_tracks_are_scored_by_their_recordings():
    assert mo.evaluate(TRACK, TRACK).as_dict() == mo.evaluate({"a": TRACK}, [TRACK]).as_dict()


def test_what_is_large_shows_itself_in_a_line():
    library = open_library("everyday")
    walk = library["walk"]
    features = mo.compute_features(WALK)
    (best, *_) = mo.search(WALK, [features])
    shown = (library, walk, walk.prototypes[0].template, features, features.feature_set,
             WALK.skeleton, best, TRACK, TRACK.labels[0])  # fmt: skip
    for one in shown:
        assert "\n" not in repr(one)
        assert len(repr(one)) < 400
        assert repr(one).startswith(f"{type(one).__name__}(")
    assert len(repr(mo.explain(best))) < 2000


@pytest.mark.parametrize(
    ("error", "text", "after"),
    [
        (UnreadableFile("is empty", file="a.bvh"), "a.bvh: is empty", ": is empty"),
        (
            NotAMotion("odd\nword", file="a.bvh", place="line 3"),
            "a.bvh, line 3: odd word",
            ", line 3: odd word",
        ),
        (InvalidInput("is bad", file="b.asf"), "b.asf: is bad", ": b.asf: is bad"),
        (InvalidInput("is bad", key="rate"), "is bad", ": is bad"),
    ],
)
def test_errors_join_file_place_and_problem(error, text, after):
    assert str(error) == text
    assert error.text_after("there/a.bvh") == after
    # Errors come back from other processes.
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), again.__dict__, str(again)) == (type(error), error.__dict__, text)


def test_an_error_on_several_recordings_comes_back_from_another_process():
    error = SeveralRecordings("b.npy", ["1", "2"])
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)
    assert str(error).startswith("b.npy: holds 2 recordings (1, 2)")
    assert (again.file, again.takes) == ("b.npy", ("1", "2"))


def cause_of(call):
    with pytest.raises(Exception) as caught:
        call()
    return describe_cause(caught.value)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: {}["rate_hz"], "'rate_hz' is missing"),
        (lambda: [][3], "a list in it is shorter than expected; is it whole?"),
        (lambda: float("ab,5"), "expected a number, got 'ab,5'"),
        (lambda: int("ab"), "expected a number, got 'ab'"),
        (lambda: None.items(), "a value in it is of another kind than expected"),
        (lambda: 1 + "a", "a value in it is of another kind than expected"),
        (lambda: b"ab\xff".decode(), "expected text in UTF-8, got other bytes from byte 2"),
        (lambda: json.loads('{"a": ?}'), "in line 1, column 7 stands '?}', which JSON does not"),
        (lambda: json.loads("[1,"), "it ends too early, in line 1; get the whole file"),
        (lambda: tomllib.loads("a = ]"), "Invalid value (at line 1, column 5)"),
        (lambda: json.loads("[" * 100_000), "it has lists within lists without end"),
        (lambda: open("/no/such/file"), "No such file or directory"),  # noqa: SIM115
        (lambda: zipfile.ZipFile(io.BytesIO(b"PK")), "its content is not whole or not of this"),
    ],
)  # fmt: skip
def test_errors_of_python_are_put_into_words(call, said):
    assert cause_of(call).startswith(said)
