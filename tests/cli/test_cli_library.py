"""`motionary library` on small libraries: listed, read, edited, merged and grown."""

import json
import shutil

import numpy as np
import pytest

from cli_cases import CLASSES, EXAMPLES, RATE_HZ, write_bvh, write_examples, write_stream
from motionary.models.library import ClassLibrary, TrainingOptions, learn, load_library
from motionary.samples import synthetic_motion

PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """Examples, a library that was learned from them, and one that keeps them."""
    folder = tmp_path_factory.mktemp("world")
    write_examples(folder / "examples")
    learn(folder / "examples").save(folder / "plain")
    training = TrainingOptions(keep_examples=True, provenance="synthetic", licence="CC0")
    learn(folder / "examples", training=training, calibrate=True).save(folder / "kept")
    return folder


@pytest.fixture
def library(world, tmp_path):
    """A library to change."""
    shutil.copytree(world / "plain", tmp_path / "library")
    return tmp_path / "library"


def rows_of(text):
    return [json.loads(line) for line in text.splitlines()]


def fixed(library, name):
    (one, *_) = load_library(library)[name].quantised
    return one


# -- list -----------------------------------------------------------------------------------


def test_listing_tells_templates_thresholds_and_promises(motionary, world, tmp_path):
    ran = motionary("library", "list", world / "kept", "--plot", tmp_path / "x.png")
    assert (ran.code, ran.err) == (0, "")
    first, header, *rows = ran.out.splitlines()
    assert first.endswith("kept: 3 classes over full-body-40; from: synthetic; licence: CC0")
    assert header.split() == [
        "class", "template", "examples", "columns", "seconds", "fixed", "threshold", "precision",
        "recall",
    ]  # fmt: skip
    assert [row.split()[0] for row in rows] == sorted(CLASSES)
    assert all(row.count("%") == 3 for row in rows)
    assert (tmp_path / "x.png").read_bytes().startswith(PNG)


def test_programs_get_the_same(motionary, world):
    rows = rows_of(motionary("library", "list", world / "kept", "--json").out)
    for row, one in zip(rows, load_library(world / "kept"), strict=True):
        assert row["class"] == one.name
        assert row["threshold"] == one.threshold
        assert row["promised_recall"] == one.estimated_recall
        assert (row["examples"], row["kept_examples"]) == (EXAMPLES, EXAMPLES)
        assert (row["licence"], row["feature_set"]) == ("CC0", "full-body-40")


def test_an_empty_library_is_listed(motionary, tmp_path):
    ClassLibrary(()).save(tmp_path / "empty")
    ran = motionary("library", "list", tmp_path / "empty", "--plot", tmp_path / "x.png")
    assert ran.code == 0
    assert "0 classes" in ran.out
    assert not (tmp_path / "x.png").exists()


# -- show and edit --------------------------------------------------------------------------


def test_what_is_shown_can_be_given_back(motionary, library, tmp_path):
    before = load_library(library)["squat"].prototypes[0].template
    ran = motionary("library", "show", library, "squat", "--plot", tmp_path / "x.png")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith("# learned from 3 recordings\nfeatures: full-body-40\nlasts ")
    assert (tmp_path / "x.png").read_bytes().startswith(PNG)
    (tmp_path / "squat.txt").write_text(ran.out)
    ran = motionary("library", "edit", library, "squat", "--text", tmp_path / "squat.txt")
    assert (ran.code, ran.err) == (0, "")
    after = load_library(library)["squat"].prototypes[0].template
    assert np.array_equal(after.values, before.values)
    assert after.provenance == before.provenance


def test_an_edited_text_changes_what_it_says_and_nothing_else(motionary, library, tmp_path):
    before = fixed(library, "squat")
    text = motionary("library", "show", library, "squat").out
    line = next(x for x in text.splitlines() if x.startswith("throughout: "))
    feature = line.removeprefix("throughout: ").split(",")[0]
    edited = tmp_path / "squat.txt"
    edited.write_text(text.replace(f"throughout: {feature},", "throughout:", 1))
    ran = motionary("library", "edit", library, "squat", "--text", edited, "--plot",
                    tmp_path / "x.png")  # fmt: skip
    assert ran.code == 0
    assert "squat: threshold" in ran.out
    assert "edited by hand" in ran.out
    after = fixed(library, "squat")
    changed = np.flatnonzero((before.fixed != after.fixed).any(axis=0))
    assert [load_library(library).feature_set.names[i] for i in changed] == [
        feature.removeprefix("not ")
    ]
    assert not after.fixed[:, changed].any()


def test_text_comes_through_a_pipe(motionary, library, monkeypatch):
    import io

    monkeypatch.setattr("sys.stdin", io.StringIO("for 1 s: right hand fast"))
    assert motionary("library", "edit", library, "squat", "--text", "-").code == 0
    assert fixed(library, "squat").n_fixed == 30


def test_a_class_designed_from_nothing(motionary, tmp_path):
    text = tmp_path / "sweeping.txt"
    text.write_text("for 1.5 s: right hand fast, spine horizontal, right hand low\n")
    ran = motionary("library", "edit", tmp_path / "own", "sweeping", "--new", "--text", text,
                    "--threshold", 0.1)  # fmt: skip
    assert ran.code == 0, ran.err
    own = load_library(tmp_path / "own")
    assert own.names == ("sweeping",)
    assert own["sweeping"].threshold == 0.1
    assert own["sweeping"].prototypes[0].template.provenance == "sweeping, designed by hand"
    ran = motionary("library", "edit", tmp_path / "own", "sweeping", "--new", "--text", text)
    assert ran.code == 1
    assert "has a class 'sweeping' already; leave out --new" in ran.err
    text.write_text("for 1 s: right hand fast (very)")
    ran = motionary("library", "edit", tmp_path / "fine", "hit", "--new", "--text", text,
                    "--features", "three-levels-129")  # fmt: skip
    assert ran.code == 0
    assert load_library(tmp_path / "fine").feature_set.name == "three-levels-129"


def test_thresholds_names_and_restrictions(motionary, world, tmp_path):
    shutil.copytree(world / "kept", tmp_path / "library")
    library = tmp_path / "library"
    ran = motionary("library", "edit", library, "squat", "--threshold", 0.04, "--rename", "knees",
                    "--restrict", "right knee bent", "--restrict", "F21")  # fmt: skip
    assert ran.code == 0, ran.err
    changed = load_library(library)
    assert changed.names == ("kick_left", "knees", "wave_right")
    assert (changed["knees"].threshold, changed["knees"].estimated_recall) == (0.04, None)
    asked = fixed(library, "knees").fixed.any(axis=0)
    assert {changed.feature_set.ids[i] for i in np.flatnonzero(asked)} == {"F20", "F21"}
    assert motionary("library", "edit", library, "knees", "--remove").out == "knees: removed\n"
    assert load_library(library).names == ("kick_left", "wave_right")


def test_two_classes_become_one(motionary, library):
    n_fixed = fixed(library, "squat").n_fixed / fixed(library, "squat").fixed.size
    ran = motionary("library", "edit", library, "squat", "--join", "kick_left", "--rename", "legs")
    assert ran.code == 0, ran.err
    assert load_library(library).names == ("legs", "wave_right")
    joined = fixed(library, "legs")
    assert joined.n_fixed / joined.fixed.size < n_fixed


def test_queries_of_a_template_that_changed_are_told_to_be_gone(motionary, library, tmp_path):
    from dataclasses import replace

    from motionary.models.keyframes import parse_query
    from motionary.models.library import replace_class

    loaded = load_library(library)
    one = loaded["squat"]
    asked = replace(one.prototypes[0], queries=(parse_query("right knee bent"),))
    replace_class(loaded, "squat", replace(one, prototypes=(asked,))).save(library)
    ran = motionary("library", "edit", library, "squat", "--rename", "knees")
    assert (ran.code, ran.err) == (0, "")
    (tmp_path / "t.txt").write_text("for 1 s: body low")
    ran = motionary("library", "edit", library, "knees", "--text", tmp_path / "t.txt")
    assert "class 'knees': its keyframe queries were of the template before, and are" in ran.err
    assert load_library(library)["knees"].prototypes[0].queries == ()


def test_a_joined_class_of_kept_examples_gets_a_threshold_of_its_own(motionary, world, tmp_path):
    shutil.copytree(world / "kept", tmp_path / "library")
    ran = motionary("library", "edit", tmp_path / "library", "squat", "--join", "wave_right")
    assert ran.code == 0, ran.err
    joined = load_library(tmp_path / "library")["squat"]
    assert joined.prototypes[0].template.n_examples == 2 * EXAMPLES
    assert joined.estimated_recall is not None


# -- merge ----------------------------------------------------------------------------------


def test_merging_tells_what_clashes(motionary, world, tmp_path):
    out = tmp_path / "out"
    ran = motionary("library", "merge", world / "plain", world / "kept", "-o", out)
    assert ran.code == 1
    assert "several of the libraries have 'kick_left', 'squat', 'wave_right'; nothing" in ran.err
    assert not out.exists()
    ran = motionary("library", "merge", world / "plain", world / "kept", "-o", out,
                    "--on-clash", "first", "--plot", tmp_path / "x.png")  # fmt: skip
    assert ran.code == 0
    assert "class 'squat' is in several libraries: the first is kept" in ran.err
    assert load_library(out)["squat"].prototypes[0].examples == ()
    assert (tmp_path / "x.png").read_bytes().startswith(PNG)
    ran = motionary("library", "merge", world / "plain", world / "kept", "-o", out,
                    "--on-clash", "both", "--force")  # fmt: skip
    assert ran.code == 0
    assert [s.name for s in load_library(out)["squat"].prototypes] == ["squat", "squat-2"]


def test_merging_without_clash(motionary, library, world, tmp_path):
    other = tmp_path / "other"
    shutil.copytree(world / "kept", other)
    for name in CLASSES:
        motionary("library", "edit", other, name, "--rename", f"{name} 2")
    ran = motionary("library", "merge", library, other, "-o", tmp_path / "out")
    assert (ran.code, ran.err) == (0, "")
    assert "6 classes over full-body-40" in ran.out


# -- add ------------------------------------------------------------------------------------


def new_examples(folder, *, seeds=(20, 21)):
    for seed in seeds:
        write_bvh(synthetic_motion("squat", seed=seed, rate_hz=RATE_HZ), folder / f"{seed}.bvh")
    return folder


def test_a_library_that_keeps_examples_grows_as_if_learned_at_once(motionary, world, tmp_path):
    shutil.copytree(world / "kept", tmp_path / "library")
    new = new_examples(tmp_path / "new")
    ran = motionary("library", "add", tmp_path / "library", "squat", new)
    assert (ran.code, ran.err) == (0, "")
    assert "learned from 5 recordings" in ran.out
    shutil.copytree(world / "examples", tmp_path / "all")
    for file in sorted(new.iterdir()):
        shutil.copy(file, tmp_path / "all" / "squat" / f"z{file.name}")
    training = TrainingOptions(keep_examples=True)
    expected = learn(tmp_path / "all", training=training, calibrate=True)
    got = load_library(tmp_path / "library")
    for one, other in zip(got, expected, strict=True):
        assert np.array_equal(
            one.prototypes[0].template.values, other.prototypes[0].template.values
        )
        assert one.background == other.background
        assert one.threshold == other.threshold
        assert one.estimated_precision == other.estimated_precision


def test_a_library_that_does_not_says_so(motionary, library, tmp_path):
    before = load_library(library)["squat"].threshold
    new = new_examples(tmp_path / "new", seeds=(20,))
    ran = motionary("library", "add", library, "squat", new / "20.bvh")
    assert ran.code == 0
    assert "were not kept (learn --keep-examples): its template stands for them" in ran.err
    changed = load_library(library)["squat"]
    assert changed.threshold == before
    assert changed.prototypes[0].template.n_examples == 4


def test_known_examples_change_nothing_and_broken_ones_are_told(motionary, world, tmp_path):
    shutil.copytree(world / "kept", tmp_path / "library")
    before = {p.name: p.read_bytes() for p in (tmp_path / "library").iterdir()}
    (tmp_path / "broken.bvh").write_text("nonsense")
    known = world / "examples" / "squat" / "squat 0.bvh"
    ran = motionary("library", "add", tmp_path / "library", "squat", known, tmp_path / "broken.bvh")
    assert ran.code == 1
    assert "no example is new" in ran.err
    assert "broken.bvh: " in ran.err
    assert {p.name: p.read_bytes() for p in (tmp_path / "library").iterdir()} == before


# -- learn ----------------------------------------------------------------------------------


def test_learning_advises_chooses_thresholds_and_tells_what_to_expect(motionary, world, tmp_path):
    examples = tmp_path / "examples"
    shutil.copytree(world / "examples", examples)
    for seed in range(5, 9):
        write_bvh(synthetic_motion("squat", seed=seed, rate_hz=RATE_HZ),
                  examples / "squat" / f"s{seed}.bvh")  # fmt: skip
    odd = examples / "squat" / "odd.bvh"
    write_bvh(synthetic_motion("wave_right", seed=30, rate_hz=RATE_HZ), odd)
    write_bvh(synthetic_motion("bow", seed=0, rate_hz=RATE_HZ), tmp_path / "other" / "bow.bvh")
    ran = motionary("learn", examples, "-o", tmp_path / "lib", "--json", "--keep-examples",
                    "--calibrate", "--negatives", tmp_path / "other")  # fmt: skip
    assert ran.code == 0
    assert "class 'squat': squat/odd.bvh does not fit" in ran.err
    rows = rows_of(ran.out)
    assert all(0 < row["threshold"] < 0.2 and row["promised_recall"] > 0.4 for row in rows)
    learned = load_library(tmp_path / "lib")
    assert [row["threshold"] for row in rows] == [one.threshold for one in learned]
    assert len(learned["squat"].prototypes[0].examples) == EXAMPLES + 5
    told = motionary("learn", examples, "-o", tmp_path / "lib2", "--threshold", 0.07, "--json")
    assert {row["threshold"] for row in rows_of(told.out)} == {0.07}
    assert {row["promised_recall"] for row in rows_of(told.out)} == {None}
    told = motionary("learn", examples, "-o", tmp_path / "lib2", "--json", "--force")
    assert {row["threshold"] for row in rows_of(told.out)} == {0.06}


def test_learning_with_groups_and_another_set(motionary, world, tmp_path):
    ran = motionary("learn", world / "examples", "-o", tmp_path / "lib", "--calibrate",
                    "--groups", r"(\d)\.bvh", "--features", "legs-14", "--json")  # fmt: skip
    assert ran.code == 0, ran.err
    assert load_library(tmp_path / "lib").feature_set.name == "legs-14"
    ran = motionary("annotate", world / "examples" / "squat", "--library", tmp_path / "lib")
    assert ran.code == 0
    ran = motionary("learn", world / "examples", "-o", tmp_path / "lib",
                    "--calibrate", "--groups", "actor(.)", "--force")  # fmt: skip
    assert ran.code == 1
    assert "groups 'actor(.)' matches nothing in 'kick_left/kick_left 0.bvh'" in ran.err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--groups", "a(.)"), "--groups: goes with --calibrate or --per-group"),
        (("--per-group",), "--per-group: needs --groups"),
        (("--per-group", "--groups", "a(.)", "--keep-examples"), "goes neither with"),
        (("--negatives", "takes"), "--negatives: goes with --calibrate"),
        (("--calibrate", "--threshold", 0.05), "given or chosen, not both"),
    ],
)
def test_options_of_thresholds_that_do_not_go_together(
    motionary, world, tmp_path, options, message
):
    ran = motionary("learn", world / "examples", "-o", tmp_path / "lib", *options)
    assert ran.code == 2
    assert message in " ".join(ran.err.split())
    assert not (tmp_path / "lib").exists()


# -- trouble --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("list", "{tmp}/none"), 1, "no library there"),
        (("show", "{lib}", "jump"), 1, "no class 'jump'; its classes are: kick_left, squat"),
        (("show", "{lib}", "squat", "--template", "deep"), 1, "has no template 'deep': 'squat'"),
        (("show", "{lib}", "squat", "--plot", "x.gif"), 2, ".png, .svg, .pdf"),
        (("edit", "{lib}", "squat"), 2, "nothing to change"),
        (("edit", "{lib}", "squat", "--new"), 2, "nothing to change"),
        (("edit", "{lib}", "squat", "--new", "--rename", "x"), 2, "needs --text"),
        (("edit", "{lib}", "squat", "--threshold", "2"), 2, "'--threshold'"),
        (("edit", "{lib}", "squat", "--rename", "kick_left"), 1, "has a class 'kick_left' already"),
        (("edit", "{lib}", "squat", "--join", "squat"), 1, "two classes, got 'squat' twice"),
        (("edit", "{lib}", "squat", "--restrict", "hand quick"), 1, "did you mean"),
        (("edit", "{lib}", "squat", "--text", "{tmp}/none.txt"), 1, "none.txt: cannot be read"),
        (("edit", "{lib}", "squat", "--text", "{tmp}/odd.txt"), 1,
         "odd.txt: line 2: 'not right hand fast' contradicts 'right hand fast' of line 1"),
        (("edit", "{lib}", "sweep", "--text", "{tmp}/odd.txt"), 1, "--new makes it from the text"),
        (("edit", "{lib}", "squat", "--text", "{tmp}/free.txt"), 1, "no fixed cell"),
        (("edit", "{lib}", "x", "--text", "{tmp}/odd.txt", "--new", "--features", "arms"), 2,
         "no set 'arms'; choose one of full-body-40"),
        (("merge", "{lib}", "{tmp}/legs", "-o", "{tmp}/out"), 1, "one feature set to be merged"),
        (("add", "{lib}", "jump", "{examples}"), 1, "no class 'jump'"),
        (("add", "{lib}", "squat", "{tmp}/none"), 1, "none"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_one_line(
    motionary, library, world, tmp_path, arguments, code, message
):
    from motionary.features import LEGS

    ClassLibrary((), LEGS).save(tmp_path / "legs")
    (tmp_path / "odd.txt").write_text("for 1 s: right hand fast\nthroughout: not right hand fast")
    (tmp_path / "free.txt").write_text("for 1 s: anything")
    before = {p.name: p.read_bytes() for p in library.iterdir()}
    places = {"lib": library, "tmp": tmp_path, "examples": world / "examples" / "squat"}
    ran = motionary("library", *(str(a).format(**places) for a in arguments))
    assert ran.code == code
    assert message in " ".join(ran.err.split())
    assert "Traceback" not in ran.err
    assert {p.name: p.read_bytes() for p in library.iterdir()} == before


@pytest.mark.parametrize("command", ["list", "show", "edit", "merge", "add"])
def test_every_command_has_help_with_an_example(motionary, command):
    ran = motionary("library", command, "--help")
    assert ran.code == 0
    assert f"motionary library {command} " in ran.out.split("Options:")[0].split("\n\n", 1)[1]


# -- from a table of times ----------------------------------------------------------------


def test_a_table_of_times_teaches_and_counts(motionary, tmp_path):
    segments = write_stream(tmp_path / "takes" / "one.bvh", seed=3)
    rows = [f"one.bvh,{name},{start:.3f},{end:.3f}" for name, start, end in segments[:1]]
    table = tmp_path / "times.csv"
    table.write_text("\n".join(["recording,label,start_s,end_s", *rows]))
    taught = motionary(
        "learn", table, "--recordings", tmp_path / "takes", "-o", tmp_path / "library"
    )
    assert taught.code == 0
    assert "add 2 or more, of other people if you can" in taught.err
    counted = motionary("count", tmp_path / "takes", "--library", tmp_path / "library", "--json")
    (row,) = rows_of(counted.out)
    assert (row["label"], row["number"]) == ("squat", 1)


def test_a_class_learns_more_from_a_table(motionary, library, tmp_path):
    segments = write_stream(tmp_path / "takes" / "one.bvh", seed=3)
    rows = [f"one.bvh,{name},{start:.3f},{end:.3f}" for name, start, end in segments]
    table = tmp_path / "times.csv"
    table.write_text("\n".join(["recording,label,start_s,end_s", *rows]))
    where = ("--recordings", tmp_path / "takes")
    ran = motionary("library", "add", library, "squat", table, *where)
    assert ran.code == 0
    changed = load_library(library)["squat"]
    assert changed.prototypes[0].template.n_examples == EXAMPLES + 1
    table.write_text("recording,label,start_s,end_s\none.bvh,kick,0,1\n")
    ran = motionary("library", "add", library, "squat", table, *where)
    assert (ran.code, ran.out) == (1, "")
    assert "no label is called 'squat'; there are kick" in ran.err
