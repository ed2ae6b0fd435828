"""Do libraries hold any set of relations, and say where a person edited them into nonsense?"""

import io
from dataclasses import replace

import numpy as np
import pytest

from library_cases import performances
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FULL_BODY, LEGS, THREE_LEVELS, FeatureSet, compute_features
from motionary.models.library import (
    ClassLibrary,
    TrainingOptions,
    learn,
    learn_classes,
    load_library,
)
from motionary.retrieval.annotation import annotate
from motionary.samples import synthetic_motion, synthetic_stream
from packing_cases import sequence

CLASSES = ("squat", "kick_left", "jump")
SUBSET = FULL_BODY.select(["F13", "F14", "F33", "F34", "F37", "F40"], name="hands and height")


def own_quantity(body, window_s, joint):
    return body[joint][1]


OWN = FeatureSet(
    "own",
    (
        replace(FULL_BODY.features[16], mirror="F17", quantity=own_quantity),
        FULL_BODY.features[36],
    ),
)


# -- sets of relations ----------------------------------------------------------------------


@pytest.mark.parametrize("feature_set", [LEGS, THREE_LEVELS, SUBSET, OWN], ids=lambda s: s.name)
def test_any_set_works_from_examples_to_labels(tmp_path, feature_set):
    examples = {name: [synthetic_motion(name, seed=s) for s in range(4)] for name in CLASSES}
    library = learn(
        examples, feature_set=feature_set, calibrate=True, training=TrainingOptions(mirror=True)
    )
    library.save(tmp_path / "library")
    given = (feature_set,) if feature_set is OWN else ()
    again = load_library(tmp_path / "library", feature_sets=given)
    assert again.feature_set == feature_set
    if feature_set in (SUBSET, OWN):
        return  # Too few relations to tell the classes apart.
    stream, truth = synthetic_stream(["squat", "jump", "kick_left"], seed=50)
    track = annotate(stream, again)
    for name, start_s, end_s in truth:
        assert any(x.name == name and x.start_s < end_s and x.end_s > start_s for x in track)


def test_a_set_of_ones_own_quantities_must_be_given(tmp_path):
    packed = [compute_features(synthetic_motion("squat", seed=0), feature_set=OWN)]
    learn({"squat": packed}).save(tmp_path / "library")
    with pytest.raises(UnreadableFile, match=r"feature_set 'own' is not known.*line 3"):
        load_library(tmp_path / "library")
    with pytest.raises(UnreadableFile, match=r"features are not those of 'own'.*line 4"):
        ClassLibrary.load(tmp_path / "library", feature_sets=[replace(SUBSET, name="own")])
    assert ClassLibrary.load(tmp_path / "library", feature_sets=[OWN]).feature_set is OWN


def test_a_set_must_not_pretend_to_be_a_known_one(tmp_path):
    fake = replace(SUBSET, name="full-body-40")
    library = ClassLibrary((), fake)
    with pytest.raises(InvalidInput, match="'full-body-40' is not the one of that name"):
        library.save(tmp_path / "library")
    assert not (tmp_path / "library").exists()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('test = ">="', 'test = "about"', "relations: feature 'F13': test must be one of"),
        ('quantity = "speed"', 'quantity = "joy"', "feature 'F13': no quantity 'joy'"),
        ("weak = 2.0", 'weak = "low"', "feature 'F13': weak has no meaning as 'low'"),
        ("weak = 2.0", "weak = 3.0", "F13: the strong threshold must lie at or beyond"),
        ('unit = "humerus"\n', "", "feature 'F13': unit is missing"),
        ('id = "F13"', 'id = "F99"', "must be a feature of the set"),
    ],
)
def test_relations_edited_into_nonsense_are_named(tmp_path, old, new, message):
    ClassLibrary((), SUBSET).save(tmp_path / "library")
    path = tmp_path / "library" / "library.toml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(UnreadableFile, match=rf"library\.toml: .*{message}"):
        load_library(tmp_path / "library")


# -- kept examples --------------------------------------------------------------------------


def kept_library(tmp_path):
    rng = np.random.default_rng(2)
    seen = performances(2, 3)
    unseen = [sequence(i.features, rng.random(i.features.shape) < 0.9) for i in seen]
    examples = {"a": {"a": performances(1, 4)}, "b": {"b": unseen}, "c": {"c": seen[:1]}}
    library = learn_classes(examples, training=TrainingOptions(keep_examples=True, mirror=True))
    library.save(tmp_path / "library")
    return library


def test_kept_examples_come_back_without_their_names(tmp_path):
    library = kept_library(tmp_path)
    for one, again in zip(library, load_library(tmp_path / "library"), strict=True):
        for prototype, other in zip(one.prototypes, again.prototypes, strict=True):
            assert len(prototype.examples) == len(other.examples)
            for example, back in zip(prototype.examples, other.examples, strict=True):
                assert np.array_equal(example.packed, back.packed)
                assert np.array_equal(example.known, back.known)
                assert back.source == ""
    for file in (tmp_path / "library").iterdir():
        assert b".bvh" not in file.read_bytes()


@pytest.mark.parametrize(
    "change",
    [
        {"lengths_0": np.array([-1, 200])},
        {"lengths_0": np.array([0, 5])},
        {"lengths_0": np.ones((2, 2), dtype=int)},
        {"lengths_0": np.array([1.5])},
        {"lengths_0": np.array(["a"])},
        {"lengths_0": np.array(3)},
        {"words_0": np.zeros((3, 1), dtype=np.uint64)},
        {"words_0": np.zeros((3, 2))},
        {"words_0": None},
        {"known_0": np.zeros((3, 1), dtype=np.uint64)},
    ],
)
def test_kept_examples_that_do_not_fit_are_refused(tmp_path, change):
    kept_library(tmp_path)
    (values,) = (tmp_path / "library").glob("b.*.npz")
    with np.load(values) as file:
        arrays = {**file, **change}
    buffer = io.BytesIO()
    np.savez(buffer, **{key: array for key, array in arrays.items() if array is not None})
    values.write_bytes(buffer.getvalue())
    with pytest.raises(UnreadableFile, match=r"b\.toml: templates\[0\]: the packed feat"):
        load_library(tmp_path / "library")


def test_bits_that_mean_nothing_are_dropped(tmp_path):
    kept_library(tmp_path)
    (values,) = (tmp_path / "library").glob("b.*.npz")
    with np.load(values) as file:
        arrays = {**file, "words_0": file["words_0"] | np.uint64(1 << 50)}
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    values.write_bytes(buffer.getvalue())
    (example, *_) = load_library(tmp_path / "library")["b"].prototypes[0].examples
    assert not (example.packed & ~example.known).any()
    assert int(example.packed.max()) < 1 << 40


# -- lines ----------------------------------------------------------------------------------

BEFORE = """\
# a class
name = "squat"
threshold = 0.06
tolerance = 0.05
promised_precision = 0.9
promised_recall = 0.8
background = []
values = "VALUES"

[[templates]]
name = "squat"
examples = 2
columns = 4
provenance = ""

[[templates]]
name = "deep"
examples = 2
columns = 4
provenance = ""
"""


@pytest.fixture
def folder(tmp_path):
    """A library of a class with two templates, its table as a person might keep it."""
    folder = tmp_path / "library"
    ClassLibrary(()).save(folder)
    values = {f"values_{i}": np.full((4, 40), 1.0) for i in (0, 1)}
    weights = {f"weights_{i}": np.ones(4) for i in (0, 1)}
    np.savez(folder / "v.npz", **values, **weights)
    (folder / "squat.toml").write_text(BEFORE.replace("VALUES", "v.npz"))
    index = folder / "library.toml"
    index.write_text(index.read_text() + 'squat = "squat"\n')
    assert load_library(folder).names == ("squat",)
    return folder


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("squat.toml", "threshold = 0.06", "threshold = 7", r"threshold must lie in .*\(line 3\)"),
        ("squat.toml", "threshold = 0.06", 'threshold = "x"', r"threshold must be .*\(line 3\)"),
        ("squat.toml", "tolerance = 0.05", "tolerance = 0.5", r"tolerance must be .*\(line 4\)"),
        ("squat.toml", "threshold =", "treshold =",
         r"threshold is missing; is it 'treshold' \(line 3\)\?"),
        ("squat.toml", "recall = 0.8", "recall = 80", r"promised_recall must lie .*\(line 6\)"),
        ("squat.toml", "recall = 0.8", "recall = true", r"promised_recall must be .*\(line 6\)"),
        ("squat.toml", "background = []", "background = [2]", r"background needs 40 .*\(line 7\)"),
        ("squat.toml", "v.npz", "w.npz", r"values means w.npz, which is missing \(line 8\)"),
        ("squat.toml", 'name = "squat"', 'name = "s"', r"name is 's', but the .*\(line 2\)"),
        ("squat.toml", "examples = 2", "examples = 0", r"templates\[0\]: .*n_examples.*line 12"),
        ("squat.toml", 'name = "deep"\nexamples = 2', 'name = "deep"\nexamples = "two"',
         r"templates\[1\]\.examples must be a whole number, got 'two' \(line 18\)"),
        ("squat.toml", 'name = "deep"\nexamples = 2', 'name = "deep"\nexample = 2',
         r"templates\[1\]\.examples is missing; is it 'example' \(line 18\)\?"),
        ("squat.toml", "columns = 4\nprovenance = \"\"\n\n", "columns = 5\nprovenance = \"\"\n\n",
         r"templates\[0\] needs values of shape \(5, 40\).*\(line 13\)"),
        ("squat.toml", "\n[[templates]]", "\n[[templates]", r"not valid TOML: .*line 10"),
        ("library.toml", "version = 1", "version = 2", r"newer motionary .*\(line 2\)"),
        ("library.toml", "version = 1", "version = 'new'", r"version must be .*\(line 2\)"),
        ("library.toml", '"F1", ', "", r"features are not those of .*\(line 4\)"),
        ("library.toml", 'squat = "squat"', "squat = 1", r"classes\.squat must be .*\(line 9\)"),
        ("library.toml", 'squat = "squat"', 'squat = "gone"',
         r"classes\.squat means gone\.toml, which is missing \(line 9\)"),
    ],
)  # fmt: skip
def test_nonsense_is_named_by_file_key_and_line(folder, file, old, new, message):
    path = folder / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(UnreadableFile, match=message) as caught:
        load_library(folder)
    assert str(path) in str(caught.value)
