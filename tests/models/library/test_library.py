"""Does a library come back from disk as it was, whatever its classes are called?"""

import os
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.features import FULL_BODY, FULL_BODY_2006
from motionary.models.keyframes import parse_query
from motionary.models.library import (
    ClassLibrary,
    MotionClass,
    Prototype,
    TrainingOptions,
    learn,
    learn_classes,
)
from motionary.models.templates import MotionTemplate
from motionary.retrieval.annotation import annotate
from packing_cases import N, random_rows, sequence, stream

NAMES = [
    "squat",
    "Squat",
    "SQUAT",
    "a/b",
    "a_b",
    "a b",
    "a\\b",
    "CON",
    "con",
    "nul.txt",
    "COM1",
    "..",
    ".",
    ".hidden",
    "dots.in.name.",
    "Knie­beuge (tief) ä",
    "スクワット",
    "e\u0301",
    "é",
    "library",
    'quote " and = [x] # \\',
    "line\nbreak\ttab \x7f",
    " spaces ",
    "x" * 300,
    "-",
    "👟",
]


def template(seed, *, n_columns=4, feature_set=FULL_BODY):
    """A template of values that no rounding leaves as they are."""
    rng = np.random.default_rng(seed)
    return MotionTemplate(
        values=rng.random((n_columns, len(feature_set))),
        weights=rng.uniform(0.3, 3, n_columns),
        feature_names=feature_set.ids,
        feature_set=feature_set.name,
        provenance=f"made with seed {seed}",
        n_examples=seed + 1,
    )


def make_library(*names, seed=0, feature_set=FULL_BODY, **about):
    classes = tuple(
        MotionClass(
            name,
            (Prototype(name, template(seed + i, feature_set=feature_set)),),
            threshold=0.05 + i / 1000,
            tolerance=0.1,
        )
        for i, name in enumerate(names)
    )
    return ClassLibrary(classes, feature_set, **about)


def contents(library):
    """Everything a library holds, comparable."""
    return (
        library.feature_set.name,
        library.provenance,
        library.licence,
        [
            (
                c.name,
                c.threshold,
                c.tolerance,
                c.background,
                [of_prototype(s) for s in c.prototypes],
            )
            for c in library
        ],
    )


def of_prototype(prototype):
    t = prototype.template
    numbers = (t.values.tobytes(), t.values.shape, t.weights.tobytes())
    about = t.feature_names, t.feature_set, t.provenance, t.n_examples
    kept = prototype.queries, prototype.votes, prototype.mirror_of
    return prototype.name, *numbers, *about, *kept


def files(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


# -- there and back ----------------------------------------------------------------------


def test_a_library_comes_back_to_the_bit(tmp_path):
    fractions = tuple(np.random.default_rng(3).uniform(0.01, 0.99, N).tolist())
    prototypes = tuple(Prototype(f"way {i}", template(i, n_columns=3 + i)) for i in range(3))
    library = ClassLibrary(
        (MotionClass("squat", prototypes, 0.1234567890123456, 0.05, fractions),),
        provenance='clips of "mine",\nfrom two days – ä',
        licence="CC BY-SA 3.0",
    )
    library.save(tmp_path / "library")
    assert contents(ClassLibrary.load(tmp_path / "library")) == contents(library)


def test_keyframes_come_back_as_lines_that_a_person_reads(tmp_path):
    text = "at 0 s: right hand above neck, not left knee bent\nthen within 0.1 to 0.5 s\n"
    query = parse_query(text + "at 0.1 s: right hand fast")
    classes = (MotionClass("reach", (Prototype("reach", template(1), (query, query), 2),)),)
    ClassLibrary(classes).save(tmp_path)
    assert ClassLibrary.load(tmp_path)["reach"].prototypes[0].queries == (query, query)
    assert '"then within 0.1 to 0.5 s"' in (tmp_path / "reach.toml").read_text("utf-8")


def test_any_names_come_back_in_their_order(tmp_path):
    library = make_library(*NAMES)
    library.save(tmp_path / "library")
    assert ClassLibrary.load(tmp_path / "library").names == tuple(NAMES)
    assert contents(ClassLibrary.load(tmp_path / "library")) == contents(library)


@pytest.mark.parametrize("name", NAMES)
def test_a_name_alone_comes_back(tmp_path, name):
    make_library(name).save(tmp_path / "library")
    assert ClassLibrary.load(tmp_path / "library").names == (name,)


def test_file_names_are_fit_for_every_file_system(tmp_path):
    make_library(*NAMES).save(tmp_path / "library")
    names = [path.name for path in (tmp_path / "library").iterdir()]
    assert len({name.casefold() for name in names}) == len(names) == 2 * len(NAMES) + 1
    reserved = {"con", "prn", "aux", "nul", *(f"{d}{i}" for d in ("com", "lpt") for i in range(10))}
    for name in names:
        assert name.split(".")[0].casefold() not in reserved
        assert not name.startswith((".", " "))
        assert not set(name) & set('<>:"/\\|?*\n\t\x7f')
        assert len(name.encode()) <= 200
        assert name == name.strip()


def test_saving_twice_gives_the_same_bytes(tmp_path):
    library = make_library("a b", "a_b", "c")
    library.save(tmp_path / "one")
    library.save(tmp_path / "two")
    assert files(tmp_path / "one") == files(tmp_path / "two")
    library.save(tmp_path / "one")
    ClassLibrary.load(tmp_path / "one").save(tmp_path / "two")
    assert files(tmp_path / "one") == files(tmp_path / "two")


def test_what_was_learned_comes_back_and_labels_the_same(tmp_path):
    step, turn = random_rows(1, 20), random_rows(2, 25)
    library = learn(
        {"step": [sequence(step), sequence(step[2:])], "turn": [sequence(turn)]},
        training=TrainingOptions(mirror=True, provenance="drawn", licence="CC0"),
    )
    library.save(tmp_path / "library")
    loaded = ClassLibrary.load(tmp_path / "library")
    assert contents(loaded) == contents(library)
    recording = sequence(stream(step, turn)[0])
    assert annotate(recording, loaded) == annotate(recording, library)
    assert len(annotate(recording, loaded)) == 2


def test_how_it_was_trained_comes_back(tmp_path):
    rows = random_rows(1, 20)
    training = TrainingOptions(
        0.07, 0.1, mirror=True, by_self_information=False, keep_examples=True, calibrate=True,
        groups=r'"(\d)"\n', queries="chosen", query_runs=3, provenance="drawn", licence="CC0",
    )  # fmt: skip
    for options in (training, TrainingOptions()):
        library = learn_classes({"step": {"step": [sequence(rows)]}}, training=options)
        assert library.training == options
        library.save(tmp_path / "library")
        assert ClassLibrary.load(tmp_path / "library").training == options
    assert ClassLibrary.load(tmp_path / "library")["step"].prototypes[0].mirror_of == ""
    learn_classes({"step": {"a": [sequence(rows)]}}, training=training).save(tmp_path / "library")
    one, image = ClassLibrary.load(tmp_path / "library")["step"].prototypes
    assert (one.mirror_of, image.mirror_of) == ("", "a")


def test_what_a_person_wrote_into_the_files_stays(tmp_path):
    make_library("squat", "kick").save(tmp_path)
    index, path = tmp_path / "library.toml", tmp_path / "squat.toml"
    index.write_text(index.read_text("utf-8").replace("version", "# ours\nversion", 1), "utf-8")
    text = path.read_text("utf-8").replace("threshold = ", "# strict\nthreshold =  ", 1)
    path.write_text(text.replace("examples = 1", "examples = 1 # of Monday"), "utf-8")
    library = ClassLibrary.load(tmp_path)
    changed = tuple(replace(one, tolerance=0.2) for one in library)
    replace(library, classes=changed).save(tmp_path)
    assert "# ours\nversion = 1\n" in index.read_text("utf-8")
    text = path.read_text("utf-8")
    assert "# strict\nthreshold =  0.05\ntolerance = 0.2\n" in text
    assert "examples = 1 # of Monday\n" in text
    assert ClassLibrary.load(tmp_path)["squat"].tolerance == 0.2


def test_features_that_no_example_shows_are_remembered(tmp_path):
    rows, known = random_rows(1, 20), np.ones((20, N), dtype=np.bool_)
    known[:, [0, 4]] = False
    library = learn({"step": [sequence(rows, known)]}, mirror=True)
    library.save(tmp_path)
    for loaded in (library, ClassLibrary.load(tmp_path)):
        one, image = (s.template for s in loaded["step"].prototypes)
        assert one.unmeasured == (FULL_BODY.ids[0], FULL_BODY.ids[4])
        swapped = {FULL_BODY.ids[i] for i in FULL_BODY.mirror_order[[0, 4]]}
        assert set(image.unmeasured) == swapped


def test_a_library_of_another_feature_set_comes_back(tmp_path):
    library = make_library("squat", feature_set=FULL_BODY_2006)
    library.save(tmp_path / "library")
    loaded = ClassLibrary.load(tmp_path / "library")
    assert loaded.feature_set.name == FULL_BODY_2006.name
    assert contents(loaded) == contents(library)


def test_an_empty_library_comes_back(tmp_path):
    ClassLibrary((), provenance="nothing yet").save(tmp_path / "library")
    loaded = ClassLibrary.load(tmp_path / "library")
    assert len(loaded) == 0
    assert loaded.provenance == "nothing yet"


def test_numbers_of_numpy_are_saved_as_numbers(tmp_path):
    fraction = tuple(np.full(N, 0.25, dtype=np.float32))
    prototypes = (Prototype("a", template(1)),)
    library = ClassLibrary(
        (MotionClass("a", prototypes, np.float32(0.125), np.float32(0.25), fraction),)
    )
    library.save(tmp_path / "library")
    (loaded,) = ClassLibrary.load(tmp_path / "library")
    assert (loaded.threshold, loaded.tolerance, loaded.background) == (0.125, 0.25, (0.25,) * N)


def test_the_files_are_readable(tmp_path):
    library = make_library("deep squat", licence="CC0")
    library.save(tmp_path)
    index = tomllib.loads((tmp_path / "library.toml").read_text("utf-8"))
    assert index["classes"] == {"deep squat": "deep_squat"}
    assert index["licence"] == "CC0"
    assert index["version"] == 1
    settings = tomllib.loads((tmp_path / "deep_squat.toml").read_text("utf-8"))
    assert settings["threshold"] == 0.05
    assert settings["templates"][0]["provenance"] == "made with seed 0"


def test_settings_edited_by_hand_count(tmp_path):
    make_library("squat").save(tmp_path)
    path = tmp_path / "squat.toml"
    path.write_text(path.read_text("utf-8").replace("threshold = 0.05", "threshold = 1"), "utf-8")
    assert ClassLibrary.load(tmp_path)["squat"].threshold == 1.0


# -- saving over a library ---------------------------------------------------------------


def test_classes_that_are_gone_disappear(tmp_path):
    make_library("squat", "kick", "jump").save(tmp_path)
    make_library("kick").save(tmp_path)
    assert ClassLibrary.load(tmp_path).names == ("kick",)
    assert len(files(tmp_path)) == 3


def test_other_peoples_files_stay(tmp_path):
    make_library("squat", "kick").save(tmp_path)
    own = ["features.npz", "notes.toml", "README.md", "squat.amc", ".gitignore", "squat.mine.npz"]
    for name in own:
        (tmp_path / name).write_text("mine")
    make_library("kick").save(tmp_path)
    assert ClassLibrary.load(tmp_path).names == ("kick",)
    assert {name: (tmp_path / name).read_text() for name in own} == dict.fromkeys(own, "mine")
    assert len(files(tmp_path)) == 3 + len(own)


def test_a_folder_with_files_but_no_library_is_refused(tmp_path):
    (tmp_path / "holiday.jpg").write_bytes(b"")
    with pytest.raises(UnwritableFile, match=r"holds files but no library.*empty folder"):
        make_library("squat").save(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["holiday.jpg"]


def test_a_path_that_is_a_file_is_refused(tmp_path):
    path = tmp_path / "library"
    path.write_text("")
    with pytest.raises(UnwritableFile, match="is a file"):
        make_library("squat").save(path)
    with pytest.raises(UnwritableFile):
        make_library("squat").save(path / "below")
    with pytest.raises(UnreadableFile, match=r"library\.toml|no library"):
        ClassLibrary.load(path)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write all")
def test_a_read_only_folder_is_refused(tmp_path):
    folder = tmp_path / "library"
    make_library("squat").save(folder)
    before = files(folder)
    folder.chmod(0o500)
    try:
        with pytest.raises(UnwritableFile, match="library"):
            make_library("kick").save(folder)
        with pytest.raises(UnwritableFile, match="cannot be made"):
            make_library("kick").save(folder / "below")
        assert files(folder) == before
    finally:
        folder.chmod(0o700)


# -- what a library may hold -------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "packed"),
    [
        ({"threshold": 7.0}, r"'a': threshold .*\[0, 1\], got 7"),
        ({"threshold": float("nan")}, "threshold"),
        ({"tolerance": 0.5}, r"'a': tolerance .*below 0\.5, got 0\.5"),
        ({"tolerance": -0.1}, "tolerance"),
        ({"background": (0.5,)}, f"'a': background needs {N} fractions"),
        ({"background": (0.0,) * N}, "background"),
        ({"prototypes": ()}, "'a' needs at least one template"),
        ({"name": ""}, "needs a name"),
    ],
)
def test_a_class_that_could_not_be_used_is_refused(settings, packed):
    given = {"name": "a", "prototypes": (Prototype("a", template(1)),)} | settings
    with pytest.raises(InvalidInput, match=packed):
        MotionClass(**given)


@pytest.mark.parametrize("mirror_of", ["a", "gone", "image"])
def test_a_mirror_image_is_of_another_prototype(mirror_of):
    others = (Prototype("b", template(1)), Prototype("image", template(1), mirror_of="b"))
    with pytest.raises(InvalidInput, match="'x': mirror_of of 'a' must name a prototype"):
        MotionClass("x", (Prototype("a", template(1), mirror_of=mirror_of), *others))


def test_templates_are_quantised_once():
    (one,) = make_library("a")
    assert one.patterns is one.patterns
    assert one.patterns[0].template is one.quantised[0]


def test_names_are_unique():
    twice = (Prototype("a", template(1)), Prototype("a", template(2)))
    with pytest.raises(InvalidInput, match="unique"):
        MotionClass("a", twice)
    with pytest.raises(InvalidInput, match="unique"):
        make_library("a", "a")


def test_a_library_has_one_feature_set():
    classes = make_library("a", feature_set=FULL_BODY_2006).classes
    with pytest.raises(InvalidInput, match=r"template 'a'.*full-body-39.*full-body-40"):
        ClassLibrary(classes, FULL_BODY)


def test_a_missing_class_is_named():
    with pytest.raises(InvalidInput, match=r"no class 'jump'.*squat, kick"):
        make_library("squat", "kick")["jump"]
