"""Is a library changed by hand what was asked for, and a grown class as if learned at once?"""

import re
from dataclasses import replace

import numpy as np
import pytest

from library_cases import Listening, performances
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY_2006, LEGS
from motionary.models.keyframes import parse_query
from motionary.models.library import (
    ClassLibrary,
    MotionClass,
    Prototype,
    TrainingOptions,
    add_examples,
    find_clashes,
    find_prototype,
    join_classes,
    learn,
    learn_classes,
    load_library,
    merge_libraries,
    remove_class,
    rename_class,
    replace_class,
    replace_template,
    training_of,
)
from motionary.models.templates import MotionTemplate, join, mirror, restrict, template_from_text
from packing_cases import sequence

KEPT = TrainingOptions(keep_examples=True)
QUERY = parse_query("right hand fast")


def examples_of(*classes, n=5, first=0):
    names = [f"class{c}" for c in classes]
    return {
        name: {name: performances(c, n, first=first, name=name)}
        for c, name in zip(classes, names, strict=True)
    }


def content(library):
    """Everything that decides what a library finds."""
    return [
        (
            c.name, c.threshold, c.tolerance, c.background,
            [
                (s.name, s.template.values.tolist(), s.template.weights.tolist(),
                 s.template.n_examples, s.template.provenance, len(s.examples))
                for s in c.prototypes
            ],
        )
        for c in library
    ]  # fmt: skip


# -- learning further -----------------------------------------------------------------------


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_grown_class_is_as_if_learned_from_all_at_once(tmp_path, mirrored):
    training = replace(KEPT, mirror=mirrored)
    examples = examples_of(1, 2, n=7)
    early = {name: {name: subs[name][:4]} for name, subs in examples.items()}
    library = learn_classes(early, training=training)
    for name, subs in examples.items():
        for late in (subs[name][4:6], subs[name][6:]):
            library.save(tmp_path / "library")
            library = add_examples(load_library(tmp_path / "library"), name, late)
    assert content(library) == content(learn_classes(examples, training=training))


def test_unseen_entries_of_kept_examples_stay_unseen(tmp_path):
    rng = np.random.default_rng(3)
    items = [
        sequence(item.features, rng.random(item.features.shape) < 0.8)
        for item in performances(1, 5)
    ]
    library = learn_classes({"a": {"a": items[:3]}}, training=KEPT)
    library.save(tmp_path / "library")
    expanded = add_examples(load_library(tmp_path / "library"), "a", items[3:])
    assert content(expanded) == content(learn_classes({"a": {"a": items}}, training=KEPT))


def test_an_example_counts_once():
    examples = examples_of(1, 2)
    library = learn_classes(examples, training=KEPT)
    again = add_examples(library, "class1", examples["class1"]["class1"][1:3])
    assert again is library


def test_without_kept_examples_the_template_stands_for_them():
    examples = examples_of(1, 2, n=8)
    library = learn_classes(examples, training=TrainingOptions(mirror=True))
    new = performances(1, 2, first=20)
    expanded = add_examples(library, "class1", new)
    template = expanded["class1"].prototypes[0].template
    expected = join(
        library["class1"].prototypes[0].template,
        learn_classes({"a": {"a": new}}, training=TrainingOptions())["a"].prototypes[0].template,
    )
    assert np.array_equal(template.values, expected.values)
    assert template.n_examples == 10
    assert template.provenance == "learned from 8 recordings, then averaged with 2 more"
    assert np.array_equal(
        expanded["class1"].prototypes[1].template.values,
        mirror(template, expanded.feature_set.mirror_order).values,
    )
    assert expanded["class1"].background == library["class1"].background
    assert expanded["class2"] is library["class2"]
    assert not expanded["class1"].prototypes[0].keeps_examples


def test_what_was_promised_and_asked_of_the_old_template_goes():
    library = learn_classes(examples_of(1, 2), training=KEPT)
    one = library["class1"]
    with_query = replace(one.prototypes[0], queries=(QUERY,))
    one = replace(one, prototypes=(with_query,), threshold=0.04, estimated_recall=0.9)
    expanded = add_examples(
        replace_class(library, "class1", one), "class1", performances(1, 1, first=9)
    )["class1"]
    assert (expanded.threshold, expanded.estimated_recall, expanded.prototypes[0].queries) == (
        0.04,
        None,
        (),
    )
    assert expanded.prototypes[0].keeps_examples


def test_one_of_several_templates_learns():
    examples = {"kick": {"front": performances(1, 3), "side": performances(2, 3)}}
    library = learn_classes(examples, training=KEPT)
    new = performances(2, 2, first=5)
    with pytest.raises(InvalidInput, match="'kick' has several templates, say which: 'front', 's"):
        add_examples(library, "kick", new)
    expanded = add_examples(library, "kick", new, prototype="side")
    examples["kick"]["side"] += new
    assert content(expanded) == content(learn_classes(examples, training=KEPT))


def test_examples_over_other_features_are_refused():
    library = learn_classes(examples_of(1), training=KEPT)
    other = sequence(np.zeros((9, 14)), feature_set=LEGS, name="a.bvh")
    with pytest.raises(InvalidInput, match=r"a\.bvh is over .legs-14., the library over"):
        add_examples(library, "class1", [other])
    with pytest.raises(InvalidInput, match="no class 'gone'"):
        add_examples(library, "gone", [])
    with pytest.raises(InvalidInput, match="an example of it over 'legs-14'"):
        replace(library["class1"].prototypes[0], examples=(other,))


def test_a_library_from_before_options_were_remembered_learns_further_the_same(tmp_path):
    training = TrainingOptions(mirror=True, keep_examples=True, tolerance=0.1)
    examples = examples_of(1, 2, n=6)
    early = {name: {name: subs[name][:4]} for name, subs in examples.items()}
    learn(early, training, calibrate=True).save(tmp_path / "library")
    forget(tmp_path / "library")
    old = load_library(tmp_path / "library")
    assert old.training is None
    assert [s.mirror_of for c in old for s in c.prototypes] == ["", "class1", "", "class2"]
    remembered = training_of(old)
    assert (remembered.mirror, remembered.tolerance, remembered.calibrate) == (True, 0.1, True)
    for name, subs in examples.items():
        old = add_examples(old, name, subs[name][4:])
    assert content(old) == content(learn(examples, training, calibrate=True))


def forget(folder):
    """Make the files those of a version that remembered neither options nor mirror images."""
    for path in folder.glob("*.toml"):
        text = re.sub(r"(?m)^mirror_of = .*\n", "", path.read_text("utf-8"))
        text = re.sub(r"(?ms)^\[training\]\n.*?(?=^\[)", "", text)
        path.write_text(text, "utf-8")


def test_classes_that_were_trained_in_several_ways_have_no_common_options():
    library = learn_classes(examples_of(1, 2), training=TrainingOptions())
    one = replace(library["class1"], tolerance=0.1)
    other = replace(replace_class(library, "class1", one), training=None)
    assert training_of(other) is None
    assert training_of(library) == TrainingOptions()


def test_a_calibrated_library_is_calibrated_again(tmp_path):
    examples = examples_of(1, 2, n=7)
    early = {name: {name: subs[name][:5]} for name, subs in examples.items()}
    settings = TrainingOptions(keep_examples=True, calibrate=True, groups=r"/(\d)")
    library = learn(early, settings)
    for name, subs in examples.items():
        library = add_examples(library, name, subs[name][5:])
    assert content(library) == content(learn(examples, settings))
    # Examples come back without their names, so that nothing can be grouped by them.
    library.save(tmp_path / "library")
    monitor = Listening()
    new = performances(1, 1, first=30)
    again = add_examples(load_library(tmp_path / "library"), "class1", new, monitor=monitor)
    examples["class1"]["class1"] += new
    assert content(again) == content(learn(examples, replace(settings, groups=None)))
    assert [notice.text for notice in monitor.notices] == [
        "names of examples are not kept: they are dealt at random, not by '/(\\\\d)'"
    ]


# -- joining --------------------------------------------------------------------------------


def test_joined_classes_are_learned_from_the_examples_of_both():
    examples = examples_of(1, 2, 3)
    library = learn_classes(examples, training=KEPT)
    joined = join_classes(library, "class1", "class2", name="either")
    assert joined.names == ("either", "class3")
    both = [*examples["class1"]["class1"], *examples["class2"]["class2"]]
    expected = learn_classes({"either": {"either": both}}, training=KEPT)["either"]
    got = joined["either"].prototypes[0]
    assert np.array_equal(got.template.values, expected.prototypes[0].template.values)
    assert len(got.examples) == 10


def test_joined_classes_without_examples_are_averaged_and_mirrored():
    library = learn_classes(examples_of(1, 2, n=4), training=TrainingOptions(mirror=True))
    library = replace_class(library, "class2", replace(library["class2"], threshold=0.1))
    joined = join_classes(library, "class2", "class1")
    assert joined.names == ("class2",)
    one, image = joined["class2"].prototypes
    expected = join(*(library[n].prototypes[0].template for n in ("class2", "class1")))
    assert np.array_equal(one.template.values, expected.values)
    assert (one.name, image.name) == ("class2", "class2Mirrored")
    order = library.feature_set.mirror_order
    assert np.array_equal(image.template.values, one.template.values[:, order])
    assert joined["class2"].threshold == pytest.approx(0.08)


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        ("class1", "class1", "two classes, got 'class1' twice"),
        ("class1", "gone", "no class 'gone'; its classes are: class1, kick"),
        ("class1", "kick", "'kick' has several templates \\('front', 'side'\\)"),
    ],
)
def test_what_cannot_be_joined(first, second, message):
    examples = examples_of(1)
    examples["kick"] = {"front": performances(2, 2), "side": performances(3, 2)}
    with pytest.raises(InvalidInput, match=message):
        join_classes(learn_classes(examples, training=KEPT), first, second)


# -- editing --------------------------------------------------------------------------------


def test_removing_and_renaming():
    library = learn_classes(examples_of(1, 2, 3), training=TrainingOptions(mirror=True))
    assert remove_class(library, "class2").names == ("class1", "class3")
    renamed = rename_class(library, "class2", "squat")
    assert renamed.names == ("class1", "squat", "class3")
    assert [s.name for s in renamed["squat"].prototypes] == ["squat", "squatMirrored"]
    assert [s.mirror_of for s in renamed["squat"].prototypes] == ["", "squat"]
    assert renamed.training == library.training
    assert rename_class(library, "class2", "class2").names == library.names
    with pytest.raises(InvalidInput, match="has a class 'class3' already"):
        rename_class(library, "class2", "class3")
    with pytest.raises(InvalidInput, match="no class 'gone'"):
        rename_class(library, "gone", "class4")
    with pytest.raises(InvalidInput, match="needs a name"):
        rename_class(library, "class2", "")


def test_another_template_takes_its_mirror_image_along():
    library = learn_classes(
        examples_of(1, 2), training=TrainingOptions(mirror=True, keep_examples=True)
    )
    library = replace_class(library, "class1", replace(library["class1"], estimated_precision=0.9))
    template = restrict(library["class1"].prototypes[0].template, ["F13", "F20"])
    changed = replace_template(library, "class1", template)["class1"]
    one, image = changed.prototypes
    assert one.template is template
    free = (image.template.values == 0.5).all(axis=0)
    assert [library.feature_set.ids[i] for i in np.flatnonzero(~free)] == ["F14", "F21"]
    assert one.examples == ()
    assert changed.estimated_precision is None
    same = library["class2"].prototypes[0].template
    assert replace_template(library, "class2", same) is library


def test_templates_that_cannot_be_taken():
    library = learn_classes(examples_of(1), training=TrainingOptions())
    legs = MotionTemplate(np.ones((4, 14)), np.ones(4), LEGS.ids, LEGS.name)
    with pytest.raises(InvalidInput, match="is over 'legs-14', the library over 'full-body-40'"):
        replace_template(library, "class1", legs)
    with pytest.raises(InvalidInput, match="no fixed cell"):
        replace_template(library, "class1", template_from_text("for 1 s: anything"))
    with pytest.raises(InvalidInput, match="no template 'side': 'class1'"):
        replace_template(library, "class1", legs, prototype="side")


def test_the_subclass_that_is_meant():
    template = template_from_text("for 1 s: F1")
    lone = MotionClass("a", (Prototype("b", template),))
    assert find_prototype(lone).name == "b"
    several = MotionClass("a", (Prototype("b", template), Prototype("a", template)))
    assert find_prototype(several).name == "a"
    assert find_prototype(several, "b").name == "b"


# -- merging --------------------------------------------------------------------------------


def test_merging_keeps_order_background_and_origins():
    first = learn_classes(
        examples_of(1, 2), training=TrainingOptions(provenance="lab", licence="CC0")
    )
    second = learn_classes(
        examples_of(3), training=TrainingOptions(provenance="stage", licence="CC0")
    )
    merged = merge_libraries([first, second])
    assert merged.names == ("class1", "class2", "class3")
    assert merged["class3"].prototypes is second["class3"].prototypes
    assert (merged["class3"].provenance, merged["class3"].licence) == ("stage", "CC0")
    assert (merged["class1"].provenance, merged["class1"].licence) == ("lab", "CC0")
    assert (merged.provenance, merged.licence) == ("lab; stage", "CC0")
    assert merge_libraries([first]).names == first.names


def test_names_that_clash():
    first = learn_classes(examples_of(1, 2), training=TrainingOptions(mirror=True))
    second = learn_classes(examples_of(2, 3, first=9), training=TrainingOptions(mirror=True))
    assert find_clashes([first, second]) == ["class2"]
    with pytest.raises(InvalidInput, match="several of the libraries have 'class2'; rename them"):
        merge_libraries([first, second])
    kept = merge_libraries([first, second], clash="first")
    assert kept.names == ("class1", "class2", "class3")
    assert kept["class2"] is first["class2"]
    both = merge_libraries([first, second, second], clash="both")["class2"]
    assert [s.name for s in both.prototypes] == [
        "class2", "class2Mirrored", "class2-2", "class2Mirrored-2", "class2-3", "class2Mirrored-3",
    ]  # fmt: skip
    assert both.prototypes[2].template is second["class2"].prototypes[0].template
    origins = [s.mirror_of for s in both.prototypes]
    assert origins == ["", "class2", "", "class2-2", "", "class2-3"]
    assert both.prototypes[2].template is second["class2"].prototypes[0].template
    assert first.training == merge_libraries([first, second], clash="first").training
    other = replace(second, training=replace(second.training, tolerance=0.1))
    assert merge_libraries([first, other], clash="first").training is None


def test_libraries_that_cannot_be_merged():
    first = learn_classes(examples_of(1), training=TrainingOptions())
    with pytest.raises(InvalidInput, match=r"one feature set .* 'full-body-40' and 'full-body-39'"):
        merge_libraries([first, ClassLibrary((), FULL_BODY_2006)])
    with pytest.raises(InvalidInput, match="at least one library"):
        merge_libraries([])
