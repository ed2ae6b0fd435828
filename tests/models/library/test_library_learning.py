"""Are classes learned from what lies in folders, always the same, and is nonsense refused?"""

from dataclasses import replace

import numpy as np
import pytest
from test_library import contents

from cli_cases import write_bvh
from library_cases import Listening
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FULL_BODY, FULL_BODY_2006, compute_features
from motionary.io import read
from motionary.models.library import (
    TrainingOptions,
    learn,
    learn_classes,
    list_examples,
    read_examples,
)
from motionary.samples import synthetic_motion
from packing_cases import N, random_rows, sequence

STEP, TURN = random_rows(1, 20), random_rows(2, 24)
PLAIN = TrainingOptions(by_self_information=False)


# -- from words --------------------------------------------------------------------------


def test_one_example_is_its_own_template():
    (motion_class,) = learn({"step": [sequence(STEP)]}, training=PLAIN)
    (prototype,) = motion_class.prototypes
    assert (motion_class.name, prototype.name) == ("step", "step")
    assert np.array_equal(prototype.template.values, STEP)
    assert prototype.template.n_examples == 1
    assert prototype.template.provenance == "learned from 1 recording"


def test_several_examples_share_what_they_have_in_common():
    examples = [STEP, STEP.copy(), STEP.copy()]
    examples[1][:, 0] ^= True
    (motion_class,) = learn({"step": [sequence(rows) for rows in examples]}, training=PLAIN)
    template = motion_class.prototypes[0].template
    assert template.n_examples == 3
    (quantised,) = motion_class.quantised
    assert not quantised.fixed[:, 0].any()
    assert quantised.fixed[:, 1:].all()


def test_settings_go_into_the_classes():
    training = TrainingOptions(threshold=0.11, tolerance=0.2, provenance="my clips", licence="CC0")
    library = learn({"step": [sequence(STEP)]}, training=training)
    assert (library["step"].threshold, library["step"].tolerance) == (0.11, 0.2)
    assert (library.provenance, library.licence) == ("my clips", "CC0")


def test_motions_are_measured():
    motion = synthetic_motion("squat", seed=0)
    of_motion = learn({"squat": [motion]}, training=PLAIN)
    of_words = learn({"squat": [compute_features(motion)]}, training=PLAIN)
    assert contents(of_motion) == contents(of_words)


@pytest.mark.parametrize("training", [None, PLAIN, TrainingOptions(mirror=True)])
def test_mirrored_templates_join_their_class(training):
    library = learn({"step": [sequence(STEP)]}, mirror=True, training=training)
    prototype, mirrored = library["step"].prototypes
    assert (prototype.name, mirrored.name) == ("step", "stepMirrored")
    order = FULL_BODY.mirror_order
    assert np.array_equal(mirrored.template.values, prototype.template.values[:, order])
    assert mirrored.template.provenance == "mirror image of learned from 1 recording"
    plain = learn({"step": [sequence(STEP)]}, training=training and replace(training, mirror=False))
    fractions = np.array(plain["step"].background)
    expected = (fractions + fractions[order]) / 2 if len(fractions) else fractions
    np.testing.assert_allclose(library["step"].background, expected, atol=1e-6)


def test_rare_relations_are_known_by_all_examples_of_all_classes():
    rows = np.zeros((30, N), dtype=np.bool_)
    rows[:10, 0] = True
    library = learn({"a": [sequence(rows[:15])], "b": [sequence(rows[15:])]})
    assert library["a"].background == library["b"].background
    # One frame of either value is added to 10 of 30.
    assert library["a"].background[0] == pytest.approx(11 / 32, abs=1e-6)
    assert library["a"].background[1] == pytest.approx(1 / 32, abs=1e-6)
    assert learn({"a": [sequence(rows)]}, training=PLAIN)["a"].background == ()


def test_what_no_example_knows_stays_free():
    known = np.ones_like(STEP)
    known[:, 5] = False
    library = learn({"step": [sequence(STEP, known), sequence(STEP, known)]}, training=PLAIN)
    (quantised,) = library["step"].quantised
    assert not quantised.fixed[:, 5].any()
    assert quantised.fixed[:, 6:].all()


# -- what cannot be learned --------------------------------------------------------------


def test_no_class_and_no_example_are_refused():
    with pytest.raises(InvalidInput, match="no examples to learn from"):
        learn({})
    with pytest.raises(InvalidInput, match=r"'step' needs at least one example, got none"):
        learn({"step": []})


def test_examples_with_nothing_in_common_are_refused():
    still = np.repeat(STEP[:1], 10, axis=0)
    with pytest.raises(InvalidInput, match=r"'blur' has no fixed cell.*split the class"):
        learn({"blur": [sequence(still), sequence(~still)]})
    with pytest.raises(InvalidInput, match=r"'dark' has no fixed cell"):
        learn({"dark": [sequence(STEP, np.zeros_like(STEP))]})


def test_examples_of_several_feature_sets_are_refused():
    old = sequence(STEP[:, :39], feature_set=FULL_BODY_2006)
    with pytest.raises(InvalidInput, match=r"one feature set.*full-body-39, full-body-40"):
        learn({"step": [sequence(STEP)], "turn": [old]})
    assert learn({"step": [old]}).feature_set.name == FULL_BODY_2006.name


@pytest.mark.parametrize("name", ["", "stepMirrored"])
def test_names_that_cannot_be_are_refused(name):
    if name:
        examples = {"step": {"step": [sequence(STEP)], name: [sequence(TURN)]}}
        with pytest.raises(InvalidInput, match="unique"):
            learn_classes(examples, training=TrainingOptions(mirror=True))
    else:
        with pytest.raises(InvalidInput, match="needs a name"):
            learn({name: [sequence(STEP)]})


# -- from folders ------------------------------------------------------------------------

FILES = [
    ("squat", "b two.bvh", 1),
    ("squat", "a one.bvh", 0),
    ("kick/left", "1.bvh", 2),
    ("kick/left", "2.BVH", 3),
    ("kick/right", "1.bvh", 4),
    ("kick", "plain.bvh", 5),
]


def write_folder(folder, files):
    for place, name, seed in files:
        kind = "squat" if place == "squat" else "kick_left"
        write_bvh(synthetic_motion(kind, seed=seed, rate_hz=30), folder / place / name)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Examples as a person keeps them, with other things between."""
    folder = write_folder(tmp_path_factory.mktemp("examples"), FILES)
    (folder / "notes.txt").write_text("squats of Monday")
    (folder / "squat" / "thumbs.db").write_text("")
    (folder / "stray.bvh").write_text("not in a class")
    (folder / ".hidden").mkdir()
    (folder / ".hidden" / "x.bvh").write_text("not seen")
    (folder / "squat" / "._a one.bvh").write_text("what some systems leave behind")
    (folder / "empty class").mkdir()
    return folder


def test_folders_are_classes_and_folders_in_them_subclasses(folder):
    found = [(name, sub, path.name) for name, sub, path in list_examples(folder)]
    assert found == [
        ("kick", "left", "1.bvh"),
        ("kick", "left", "2.BVH"),
        ("kick", "kick", "plain.bvh"),
        ("kick", "right", "1.bvh"),
        ("squat", "squat", "a one.bvh"),
        ("squat", "squat", "b two.bvh"),
    ]
    library = learn(folder)
    assert library.names == ("kick", "squat")
    assert [s.name for s in library["kick"].prototypes] == ["left", "kick", "right"]
    counts = [s.template.n_examples for c in library for s in c.prototypes]
    assert counts == [2, 1, 1, 2]


def test_a_folder_teaches_what_its_motions_teach(folder):
    library = learn(folder, mirror=True)
    motions = [read(path) for _, _, path in list_examples(folder)]
    squat = learn({"squat": motions[4:]}, training=PLAIN)["squat"].prototypes[0].template
    learned, mirrored = library["squat"].prototypes
    assert learned.template.values.tobytes() == squat.values.tobytes()
    assert mirrored.name == "squatMirrored"


def test_the_order_of_files_on_disk_does_not_count(folder, tmp_path):
    again = write_folder(tmp_path, FILES[::-1])
    assert contents(learn(again)) == contents(learn(folder))


@pytest.mark.usefixtures("two_processes")
def test_two_processes_learn_the_same(folder):
    assert contents(learn(folder, jobs=2)) == contents(learn(folder))


def test_an_example_that_cannot_be_read_is_named(folder, tmp_path):
    write_folder(tmp_path, FILES[:2])
    (tmp_path / "squat" / "c three.bvh").write_text("HIERARCHY")
    with pytest.raises(UnreadableFile, match=r"c three\.bvh"):
        learn(tmp_path)
    result = read_examples(tmp_path)
    assert [f.item[0].split("/")[-1] for f in result.failures] == ["c three.bvh"]
    assert {name: len(subs[name]) for name, subs in result.classes.items()} == {"squat": 2}


def test_a_monitor_is_told_of_every_step_and_the_rest_is_learned(tmp_path):
    write_folder(tmp_path, [*FILES[:2], ("lone", "one.bvh", 7)])
    (tmp_path / "squat" / "c three.bvh").write_text("HIERARCHY")
    (tmp_path / "lost").mkdir()
    (tmp_path / "lost" / "a.bvh").write_text("")
    (tmp_path / "stray.bvh").write_text("not in a class")
    monitor = Listening()
    library = learn(
        tmp_path, calibrate=True, queries="chosen", monitor=monitor, by_self_information=False
    )
    assert library.names == ("lone", "squat")
    assert library.training == TrainingOptions(
        by_self_information=False, calibrate=True, queries="chosen"
    )
    assert list(monitor.stages) == ["reading", "learning", "calibrating thresholds", "keyframes"]
    assert monitor.stages["reading"] == (5, 5)
    assert monitor.stages["learning"] == monitor.stages["keyframes"] == (2, 2)
    failures = [notice for notice in monitor.notices if notice.is_failure]
    names = [notice.file and notice.file[0] for notice in failures]
    assert names == ["lost/a.bvh", "squat/c three.bvh", None, None]
    assert [bool(notice.error) for notice in failures] == [True, True, False, False]
    assert failures[2].text == "class 'lost': none of its examples could be read; left out"
    assert failures[3].text.startswith("stray.bvh: in no class")
    rest = "\n".join(notice.text for notice in monitor.notices if not notice.is_failure)
    assert "class 'lone': one example: too few" in rest
    assert "class 'lone': too little to calibrate its threshold by; it stays 0.06" in rest
    assert "class 'lone' has no queries: choosing keyframes needs at least 2 examples" in rest


def test_a_class_that_cannot_be_learned_is_told_and_left_out():
    still = np.repeat(STEP[:1], 10, axis=0)
    examples = {"blur": [sequence(still), sequence(~still)], "step": [sequence(STEP)]}
    monitor = Listening()
    assert learn(examples, calibrate=True, monitor=monitor).names == ("step",)
    (refused,) = (notice for notice in monitor.notices if notice.is_failure)
    assert refused.text.startswith("class 'blur' is left out: template 'blur' has no fixed cell")
    assert isinstance(refused.error, InvalidInput)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"mirrored": True}, TypeError, "mirrored"),
        ({"queries": "bred"}, InvalidInput, "queries must be one of none, learned, chosen"),
        ({"query_runs": 0}, InvalidInput, "query_runs must be at least 1, got 0"),
    ],
)
def test_options_that_there_are_not(options, error, message):
    with pytest.raises(error, match=message):
        learn({"step": [sequence(STEP)]}, **options)


def test_folders_without_examples_say_what_is_expected(tmp_path):
    with pytest.raises(UnreadableFile, match=r"no such folder.*one folder per class"):
        learn(tmp_path / "nowhere")
    (tmp_path / "file.bvh").write_text("")
    for path in (tmp_path, tmp_path / "file.bvh"):
        with pytest.raises(UnreadableFile, match="one folder per class"):
            learn(path)
