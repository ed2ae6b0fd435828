"""Are thresholds chosen on examples that were held out, and do they keep what they promise?"""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from library_cases import made_class, perform, performances
from motionary.errors import InvalidInput
from motionary.evaluation import LabelledSegment, count_overlaps, pool_counts
from motionary.features import FULL_BODY, FeatureSequence
from motionary.models.library import (
    THRESHOLD,
    Calibration,
    ClassLibrary,
    TrainingOptions,
    apply_calibrations,
    calibrate_thresholds,
    learn,
    learn_classes,
    load_library,
)
from motionary.models.library.calibration import (
    TRIED,
    count_alone,
    count_together,
    make_stream,
    run_trial,
)
from motionary.models.library.training import N_FOLDS, make_folds
from motionary.retrieval.annotation import annotate
from packing_cases import random_rows, sequence


def made_examples(n=6, *, classes=(1, 2, 3), **how):
    """Examples of made-up classes, by actors a and b in turn."""
    return {
        f"class{c}": {
            f"class{c}": [
                item.renamed(f"class{c}/{'ab'[i % 2]}_{i}.bvh")
                for i, item in enumerate(performances(c, n, **how))
            ]
        }
        for c in classes
    }


def noise(seed, n_frames=400):
    """A recording of nothing: relations that change now and then."""
    rows = np.repeat(random_rows([seed, 3], n_frames // 10), 10, axis=0)
    return sequence(rows, name=f"noise{seed}")


def all_items(examples):
    return [item for subs in examples.values() for items in subs.values() for item in items]


# -- holding out ----------------------------------------------------------------------------


@pytest.mark.parametrize("n", [2, 3, 5, 7, 23])
def test_every_example_is_held_out_once_and_never_learned_then(n):
    examples = made_examples(n)
    folds = make_folds(examples, groups=None, seed=0)
    assert 2 <= len(folds) <= N_FOLDS
    held = Counter(id(item) for fold in folds for _, item in fold.held_out)
    assert held == Counter(id(item) for item in all_items(examples))
    for fold in folds:
        out = {id(item) for _, item in fold.held_out}
        learned = {id(item) for item in all_items(fold.learned)}
        assert not out & learned
        assert len(out | learned) == len(held)
        assert {name for name, _ in fold.held_out} <= fold.learned.keys()


def test_a_lone_example_is_always_learned():
    examples = {**made_examples(4), "rare": {"rare": performances(9, 1)}}
    for fold in make_folds(examples, groups=None, seed=0):
        assert "rare" in fold.learned
        assert "rare" not in {name for name, _ in fold.held_out}


@pytest.mark.parametrize("alone", ["front", "side"])
def test_a_lone_example_of_one_of_several_prototypes_is_always_learned(alone):
    prototypes = {"front": performances(1, 6), "side": performances(2, 6)}
    prototypes[alone] = prototypes[alone][:1]
    folds = make_folds({"kick": prototypes, **made_examples(6)}, groups=None, seed=0)
    assert len(folds) == N_FOLDS
    (lone,) = prototypes[alone]
    for fold in folds:
        assert all(item is not lone for _, item in fold.held_out)
        assert fold.learned["kick"][alone] == [lone]


def test_groups_are_held_out_together():
    folds = make_folds(made_examples(6), groups=r"/(.)_", seed=0)
    assert len(folds) == 2
    for fold in folds:
        assert len({item.source[7] for _, item in fold.held_out}) == 1
    whole = make_folds(made_examples(6), groups="[ab]_", seed=0)
    assert [len(fold.held_out) for fold in whole] == [9, 9]


def test_many_groups_are_dealt_into_few_parts():
    examples = made_examples(23)
    folds = make_folds(examples, groups=r"_(\d+)", seed=0)
    assert len(folds) == N_FOLDS
    parts = {item.source.split("_")[1]: i for i, f in enumerate(folds) for _, item in f.held_out}
    held = [(item.source.split("_")[1], i) for i, f in enumerate(folds) for _, item in f.held_out]
    assert all(parts[group] == i for group, i in held)


def test_what_a_group_alone_has_is_not_asked_for():
    examples = made_examples(4)
    only = [item.renamed("own/a_1.bvh") for item in performances(8, 3)]
    for fold in make_folds({**examples, "own": {"own": only}}, groups=r"/(.)_", seed=0):
        assert "own" not in {name for name, _ in fold.held_out}


@pytest.mark.parametrize(
    ("groups", "message"),
    [
        ("(", "groups '\\(' is no regular expression"),
        ("actor_(.)", "groups 'actor_\\(.\\)' matches nothing in 'class1/a_0.bvh'"),
        ("class", "groups 'class' puts all examples into one group, 'class'"),
    ],
)
def test_groups_that_make_no_sense(groups, message):
    with pytest.raises(InvalidInput, match=message):
        calibrate_thresholds(made_examples(), training=TrainingOptions(groups=groups))


def test_a_stream_holds_each_example_whole_and_not_too_much_else():
    held_out = [("one", perform(made_class(1), i)) for i in range(5)]
    others = [noise(1), noise(2), noise(3, 30)]
    frames = sum(len(item) for _, item in held_out)
    for most in (0.0, 0.5, 1.0, 50.0):
        rng = np.random.default_rng(2)
        stream = make_stream(held_out, others, other_per_frame=most, rng=rng)
        assert len(stream.packed) == len(stream.known) == frames + stream.other_frames
        assert stream.other_frames <= min(most * frames, 830)
        found = [stream.packed[int(s.start) : int(s.end)].tobytes() for s in stream.truth]
        assert sorted(found) == sorted(item.packed.tobytes() for _, item in held_out)
        assert {s.name for s in stream.truth} == {"one"}
    assert stream.other_frames == 830


def test_parts_and_streams_follow_the_seed():
    examples = made_examples(7)
    first, same, other = (
        [[item.source for _, item in f.held_out] for f in make_folds(examples, groups=None, seed=s)]
        for s in (0, 0, 1)
    )
    assert first == same != other


# -- trials ---------------------------------------------------------------------------------


def a_trial(**changes):
    fold = make_folds(made_examples(6), groups=None, seed=0)[0]
    settings = {"others": [noise(1), noise(2)], "other_per_frame": 3.0,
                "training": TrainingOptions(), "most_cost": 0.3, "seed": 0, **changes}  # fmt: skip
    return fold, run_trial((0, fold), **settings), settings


def test_counts_are_those_of_annotation():
    """The same labels as `annotate` gives to the stream, for thresholds of each class."""
    fold, trial, settings = a_trial()
    rng = np.random.default_rng([0, 0])
    stream = make_stream(fold.held_out, settings["others"], other_per_frame=3.0, rng=rng)
    library = learn_classes(fold.learned, training=TrainingOptions())
    recording = sequence(np.zeros((len(stream.packed), 40)))
    recording = replace(recording, packed=stream.packed, known=stream.known)
    for thresholds in ((0.02, 0.05, 0.1), (0.3, 0.3, 0.3), (0.15, 0.0, 0.25)):
        chosen = dict(zip(library.names, thresholds, strict=True))
        classes = tuple(replace(c, threshold=chosen[c.name]) for c in library)
        track = annotate(recording, ClassLibrary(classes))
        claimed = [LabelledSegment(x.name, 30 * x.start_s, 30 * x.end_s) for x in track]
        assert count_together(trial, chosen) == count_overlaps(claimed, list(trial.truth))
        for name in library.names:
            alone = annotate(recording, ClassLibrary((library[name],)), threshold=chosen[name])
            claimed = [LabelledSegment(x.name, 30 * x.start_s, 30 * x.end_s) for x in alone]
            truth = [s for s in trial.truth if s.name == name]
            expected = count_overlaps(claimed, truth)[name]
            assert count_alone(trial, name, [chosen[name]]) == [expected]


def test_a_trial_leaves_out_what_has_nothing_in_common():
    fold, _, settings = a_trial()
    odd = [sequence(random_rows(seed, 40)) for seed in range(9)]
    fold = fold._replace(learned={**fold.learned, "odd": {"odd": odd}})
    trial = run_trial((0, fold), **settings)
    assert set(trial.matches) <= {"class1", "class2", "class3", "odd"}
    assert {"class1", "class2", "class3"} <= set(trial.matches)


# -- suggestions ----------------------------------------------------------------------------


def test_suggested_thresholds_keep_their_promise_on_new_performances():
    examples = made_examples(9, flaws=0.04)
    others = [noise(seed) for seed in range(4)]
    calibrations = calibrate_thresholds(examples, negatives=others[:2])
    library = apply_calibrations(learn_classes(examples, training=TrainingOptions()), calibrations)
    fresh = [
        (f"class{c}", item) for c in (1, 2, 3) for item in performances(c, 8, first=50, flaws=0.04)
    ]
    stream = make_stream(fresh, others[2:], other_per_frame=3.0, rng=np.random.default_rng(5))
    recording = FeatureSequence(stream.packed, stream.known, FULL_BODY)
    claimed = [
        LabelledSegment(x.name, 30 * x.start_s, 30 * x.end_s) for x in annotate(recording, library)
    ]
    counted = pool_counts(count_overlaps(claimed, stream.truth).values())
    promised = [(s.precision, s.recall) for s in calibrations.values()]
    assert counted.correct / counted.predicted >= np.mean(promised, axis=0)[0]
    assert counted.found / counted.true >= np.mean(promised, axis=0)[1]
    assert all(0.5 < fraction < 1.0 for pair in promised for fraction in pair)


def test_what_a_suggestion_tells():
    examples = made_examples(5)
    calibrations = calibrate_thresholds(examples)
    assert list(calibrations) == list(examples)
    frames = {name: sum(len(i) for i in subs[name]) for name, subs in examples.items()}
    for name, one in calibrations.items():
        assert isinstance(one, Calibration)
        assert TRIED[0] <= one.threshold <= TRIED[-1]
        assert one.n_positives == 5
        other = sum(frames.values()) - frames[name]
        assert one.negative_minutes == pytest.approx(other / 1800)


def test_promises_are_careful_where_there_was_little_to_tell_from():
    few, many = (calibrate_thresholds(made_examples(n)) for n in (3, 12))
    for name in few:
        # All were found without a false label; the promise is that of one more of each.
        assert few[name].recall == pytest.approx(4 / 5)
        assert many[name].recall == pytest.approx(13 / 14)
        assert few[name].precision < many[name].precision < 1.0


def test_a_class_of_few_examples_is_drawn_to_what_is_common():
    easy = made_examples(16, classes=(1, 2, 3), flaws=0.0, slowest=1.05)
    rare = performances(4, 2, flaws=0.0, slowest=1.05)
    calibrations = calibrate_thresholds({**easy, "rare": {"rare": rare}}, negatives=[noise(1)])
    common = np.mean([calibrations[name].threshold for name in easy])
    assert abs(calibrations["rare"].threshold - common) < 0.02


def test_negatives_that_look_alike_lower_the_threshold():
    examples = made_examples(8)
    near = made_class(1) ^ (np.random.default_rng(1).random((40, 40)) < 0.12)
    alike = [perform(near, i, name=f"other{i}") for i in range(12)]
    without = calibrate_thresholds(examples)["class1"].threshold
    assert calibrate_thresholds(examples, negatives=alike)["class1"].threshold < without


@pytest.mark.usefixtures("two_processes")
def test_the_same_seed_gives_the_same_thresholds_in_any_number_of_processes():
    examples = made_examples(4)
    first = calibrate_thresholds(examples, negatives=[noise(1)], seed=3)
    assert first == calibrate_thresholds(examples, negatives=[noise(1)], seed=3, jobs=2)


def test_progress_is_told_part_by_part():
    done = []
    calibrate_thresholds(made_examples(4), on_done=done.append)
    assert len(done) == N_FOLDS


@pytest.mark.parametrize(
    "examples",
    [
        {},
        {"only": {"only": performances(1, 6)}},
        {"a": {"a": performances(1, 1)}, "b": {"b": performances(2, 1)}},
    ],
)
def test_nothing_is_suggested_where_nothing_can_be_told(examples):
    assert calibrate_thresholds(examples) == {}


def test_one_class_against_other_recordings():
    (one,) = calibrate_thresholds(
        {"only": {"only": performances(1, 6)}}, negatives=[noise(1), noise(2)]
    ).values()
    assert one.recall > 0.8
    assert one.negative_minutes > 0.2


def test_subclasses_and_mirror_images_take_part():
    examples = {
        "kick": {"front": performances(1, 4), "side": performances(2, 4)},
        "squat": {"squat": performances(3, 4)},
    }
    calibrations = calibrate_thresholds(examples, training=TrainingOptions(mirror=True))
    assert calibrations["kick"].n_positives == 8
    assert calibrations["squat"].n_positives == 4


def test_learning_with_suggestions_writes_them_down(tmp_path):
    examples = {name: subs[name] for name, subs in made_examples(5).items()}
    examples["rare"] = performances(9, 1)
    plain, calibrated = learn(examples, calibrate=False), learn(examples, calibrate=True)
    expected = calibrate_thresholds({name: {name: items} for name, items in examples.items()})
    assert {c.threshold for c in plain} == {THRESHOLD}
    for one in calibrated:
        if one.name == "rare":
            assert (one.threshold, one.estimated_precision) == (THRESHOLD, None)
            continue
        assert one.threshold == expected[one.name].threshold
        assert one.estimated_precision == round(expected[one.name].precision, 3)
        assert one.estimated_recall == round(expected[one.name].recall, 3)
    calibrated.save(tmp_path / "library")
    again = load_library(tmp_path / "library")
    for one, other in zip(calibrated, again, strict=True):
        assert one.estimated_precision == other.estimated_precision
        assert one.estimated_recall == other.estimated_recall
        assert one.threshold == other.threshold
