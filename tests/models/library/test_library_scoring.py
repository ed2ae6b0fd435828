"""Priors, folded sides and rates of false labels: what labels by scores need."""

from dataclasses import replace

import numpy as np
import pytest

from library_cases import made_class, perform, performances
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FULL_BODY, FULL_BODY_2006
from motionary.models.library import (
    ClassLibrary,
    FalseRates,
    JudgedLabel,
    MotionClass,
    Scoring,
    TrainingOptions,
    add_examples,
    calibrate_scores,
    choose_candidates,
    false_rates_of,
    find_candidates,
    fit_false_rates,
    fit_probability,
    fold_sides,
    learn,
    merge_libraries,
    mirror_sequence,
    thresholds_for,
)
from motionary.models.library.scoring import CORPUS_OF_CMU, STEEP, TAIL
from motionary.retrieval.annotation import annotate
from packing_cases import sequence


def other_motion(seed, n_frames=900):
    rng = np.random.default_rng([seed, 5])
    rows = np.repeat(rng.random((n_frames // 6, 40)) < 0.3, 6, axis=0)
    return sequence(rows, feature_set=FULL_BODY, name=f"other-{seed}")


@pytest.fixture(scope="module")
def examples():
    return {"one": performances(1, 4), "two": performances(2, 4)}


@pytest.fixture(scope="module")
def library(examples):
    return learn(examples, mirror=True, keep_examples=True)


# -- priors ------------------------------------------------------------------------------


def test_the_prior_is_half_examples_half_corpus_of_both_sides(library, examples):
    frames = np.concatenate([e.features for of_class in examples.values() for e in of_class])
    fraction = (frames.sum(axis=0) + 1) / (len(frames) + 2)
    expected = (fraction + np.array(CORPUS_OF_CMU)) / 2
    expected = (expected + expected[FULL_BODY.mirror_order]) / 2
    assert library.has_scores
    for one in library:
        assert np.allclose(one.prior, expected, atol=1e-6)


def test_other_motion_that_is_given_is_the_corpus(examples):
    others = [other_motion(seed) for seed in range(2)]
    frames = np.concatenate([one.features for one in others])
    learned = learn(examples, negatives=others)
    expected = (frames.sum(axis=0) + 1) / (len(frames) + 2)
    assert np.allclose(learned.scoring.corpus, expected, atol=1e-6)


def test_a_feature_set_without_a_corpus_has_no_scores():
    rows = np.random.default_rng(3).random((30, len(FULL_BODY_2006))) < 0.5
    learned = learn(
        {"one": [sequence(rows, feature_set=FULL_BODY_2006)]}, feature_set=FULL_BODY_2006
    )
    assert not learned.has_scores
    assert learned.scoring is None
    with pytest.raises(InvalidInput, match="no corpus"):
        find_candidates(sequence(rows, feature_set=FULL_BODY_2006), learned)


def test_classes_that_learn_more_have_the_prior_of_all(library, examples):
    more = performances(1, 2, first=4)
    expanded = add_examples(library, "one", more)
    whole = learn({**examples, "one": [*examples["one"], *more]}, mirror=True, keep_examples=True)
    assert [one.prior for one in expanded] == [one.prior for one in whole]


# -- groups ------------------------------------------------------------------------------


def people(seed, name):
    found = []
    for person in ("ann", "bob"):
        found += performances(seed, 2, first=len(found), name=f"{person}/{name}")
    return found


def test_each_group_has_a_template_beside_the_common_one(tmp_path):
    examples = {"one": people(1, "one"), "two": performances(2, 2, name="ann/two")}
    plain = learn(examples, mirror=True)
    learned = learn(examples, mirror=True, groups="(ann|bob)/", per_group=True)
    assert [p.name for p in learned["one"].prototypes if not p.mirror_of] == [
        "one", "one, ann", "one, bob",
    ]  # fmt: skip
    assert [p.name for p in learned["two"].prototypes if not p.mirror_of] == ["two"]
    common, ann = learned["one"].prototypes[:2]
    assert np.array_equal(common.template.values, plain["one"].prototypes[0].template.values)
    alone = learn({"one": examples["one"][:2]})["one"].prototypes[0]
    assert np.array_equal(ann.template.values, alone.template.values)
    assert learned["one"].prior == plain["one"].prior
    learned.save(tmp_path)
    assert ClassLibrary.load(tmp_path).training == learned.training


@pytest.mark.parametrize(
    "wrong",
    [
        {"groups": None},
        {"groups": "a", "keep_examples": True},
        {"groups": "a", "queries": "chosen"},
    ],
)
def test_templates_of_groups_need_groups_alone(wrong):
    with pytest.raises(InvalidInput, match="per_group"):
        TrainingOptions(per_group=True, **wrong)


# -- files -------------------------------------------------------------------------------


def test_what_scores_need_is_kept_in_files(examples, tmp_path):
    learned = learn(examples, negatives=[other_motion(1)], fold_sides=True)
    first = replace(learned.classes[0], kind="state", parts=("arms", "legs"))
    changed = replace(learned, classes=(first, *learned.classes[1:]))
    changed.save(tmp_path / "lib")
    loaded = ClassLibrary.load(tmp_path / "lib")
    assert loaded.scoring == changed.scoring
    assert loaded.training == changed.training
    for one, two in zip(changed, loaded, strict=True):
        assert (one.prior, one.kind, one.parts, one.false_level) == (
            two.prior, two.kind, two.parts, two.false_level,
        )  # fmt: skip
    before = (tmp_path / "lib" / "one.toml").read_bytes()
    loaded.save(tmp_path / "lib")
    assert (tmp_path / "lib" / "one.toml").read_bytes() == before


def test_a_library_from_before_has_no_scores(library, tmp_path):
    library.save(tmp_path)
    for path in tmp_path.glob("*.toml"):
        lines = path.read_text("utf-8").splitlines(keepends=True)
        kept = [x for x in lines if not x.startswith(("prior", "fold_sides"))]
        text = "".join(kept)
        if "[scoring]" in text:
            start, stop = text.index("[scoring]"), text.index("[training]")
            rest = text[start:]
            following = rest.find("\n[", 1)
            end = start + following + 1 if following >= 0 else len(text)
            text = text[:start] + text[end:] if start != stop else text
        path.write_text(text, "utf-8")
    loaded = ClassLibrary.load(tmp_path)
    assert not loaded.has_scores
    assert loaded.training == library.training


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("kind", '"often"', "kind must be event or state"),
        ("parts", '["tail"]', "parts must be of arms, legs, trunk"),
        ("prior", "[0.5]", "prior needs 40 fractions"),
        ("false_level", '"low"', "must be a number"),
    ],
)
def test_wrong_values_are_refused_with_their_line(library, tmp_path, key, value, problem):
    library.save(tmp_path)
    path = tmp_path / "one.toml"
    lines = [x for x in path.read_text("utf-8").splitlines() if not x.startswith(f"{key} =")]
    path.write_text("\n".join([f"{key} = {value}", *lines]), "utf-8")
    with pytest.raises(UnreadableFile, match=problem) as refused:
        ClassLibrary.load(tmp_path)
    assert "(line 1)" in str(refused.value)


def test_merged_libraries_keep_scores_but_no_rates(examples):
    one = learn({"one": examples["one"]}, negatives=[other_motion(1)])
    two = learn({"two": examples["two"]}, negatives=[other_motion(2)])
    merged = merge_libraries([one, two])
    assert merged.has_scores
    assert false_rates_of(one) is not None
    assert false_rates_of(merged) is None


# -- sides -------------------------------------------------------------------------------


def test_mirror_images_of_mirror_images_are_the_same():
    one = perform(made_class(3), 1)
    twice = mirror_sequence(mirror_sequence(one))
    assert np.array_equal(twice.packed, one.packed)
    assert np.array_equal(mirror_sequence(one).features, one.features[:, FULL_BODY.mirror_order])


@pytest.mark.parametrize("exchanged", [(), (1,), (0, 3), (0, 1, 2)])
def test_examples_of_either_side_are_brought_to_one(exchanged):
    plain = performances(4, 5)
    mixed = [mirror_sequence(e) if i in exchanged else e for i, e in enumerate(plain)]
    folded = fold_sides(mixed)
    # Most stay as they are, so that three exchanged ones of five bring the others over.
    expected = plain if len(exchanged) < 3 else [mirror_sequence(e) for e in plain]
    assert all(np.array_equal(a.packed, b.packed) for a, b in zip(folded, expected, strict=True))


def test_one_example_stays_as_it_is():
    (one,) = performances(5, 1)
    assert fold_sides([one]) == [one]


# -- candidates and choice ---------------------------------------------------------------


def test_planted_motions_are_the_candidates_that_are_chosen(library):
    rows, spans = [other_motion(1, 60).features], []
    for name in (1, 2, 1):
        shown = perform(made_class(name), [name, 77]).features
        start = sum(map(len, rows))
        spans.append((name, start, start + len(shown)))
        rows += [shown, other_motion(name + 5, 60).features]
    stream = sequence(np.concatenate(rows), feature_set=FULL_BODY)
    found = find_candidates(stream, library)
    chosen = choose_candidates(found, library, threshold=6.0)
    assert [int(found.classes[i]) + 1 for i in chosen] == [name for name, _, _ in spans]
    for i, (_, start, stop) in zip(chosen, spans, strict=True):
        assert abs(found.paths.starts[i] - start) <= 3
        assert abs(found.paths.stops[i] - stop) <= 3
    assert len(choose_candidates(found, library, threshold=99.0)) == 0


def test_classes_of_different_parts_may_overlap(library):
    masks = [
        replace(library["one"], parts=parts).parts_mask for parts in (("arms",), ("legs",), ())
    ]
    assert masks[0] & masks[1] == 0
    assert masks[0] & masks[2]
    assert masks[1] & masks[2]


# -- rates of false labels ---------------------------------------------------------------


def test_rates_of_an_exponential_tail_are_found():
    rng = np.random.default_rng(8)
    scores = [TAIL + rng.exponential(1 / 1.5, size=n) for n in (4000, 1000)]
    rates = fit_false_rates(scores, 100.0)
    assert rates.slope == pytest.approx(1.5, rel=0.05)
    assert np.exp(rates.levels) == pytest.approx([40, 10], rel=0.05)
    assert rates.expected(TAIL) == pytest.approx(50, rel=0.05)
    for at_most in (0.1, 1.0, 7.0):
        assert rates.expected(rates.shift(6.0, at_most)) == pytest.approx(at_most)
        each = rates.shift([6.0, 4.0], at_most)
        assert each[0] - each[1] == pytest.approx(2.0)
        assert rates.expected(each) == pytest.approx(at_most)
    assert rates.of_class(0, 7.0) + rates.of_class(1, 7.0) == pytest.approx(rates.expected(7.0))


def test_rates_grow_faster_below_the_least_scores():
    least = np.array([6.0, 4.0])
    flat, steep = (FalseRates(np.zeros(2), 0.3, limit) for limit in (None, least))
    assert steep.expected(least) == pytest.approx(flat.expected(least))
    assert steep.expected(least + 1) == pytest.approx(flat.expected(least + 1))
    assert steep.expected(least - 1) == pytest.approx(flat.expected(least) * np.exp(STEEP))
    assert steep.of_class(0, 5.0) > flat.of_class(0, 5.0)
    for at_most in (0.1, 3.0, 20.0):
        shifted = steep.shift(least, at_most)
        assert steep.expected(shifted) == pytest.approx(at_most)
        assert (flat.shift(least, at_most) <= shifted + 1e-9).all()


def test_rates_above_the_least_scores_are_fitted_there_alone():
    rng, slope = np.random.default_rng(2), 0.4
    above = 6.0 + rng.exponential(1 / slope, 2000)
    # Below them rates grow by STEEP, so that a unit lower there are e^STEEP times as many.
    below = rng.uniform(5.0, 6.0, round(2000 * (np.exp(STEEP) - 1)))
    rates = fit_false_rates([np.concatenate([above, below])], 100.0, lowest=5.0, least=6.0)
    assert rates.slope == pytest.approx(slope, rel=0.05)
    for score, expected in ((5.0, 20 * np.exp(STEEP)), (6.0, 20), (8.0, 20 * np.exp(-2 * slope))):
        assert rates.expected(score) == pytest.approx(expected, rel=0.1)


def test_rates_without_a_false_label_are_finite():
    rates = fit_false_rates([[], []], 2.0)
    assert np.isfinite(rates.levels).all()
    assert np.isfinite(rates.shift(6.0, 1.0))


@pytest.mark.parametrize(("scores", "minutes"), [([], 1.0), ([[6.0]], 0.0)])
def test_rates_need_classes_and_recordings(scores, minutes):
    with pytest.raises(InvalidInput, match="rates of false labels need"):
        fit_false_rates(scores, minutes)


@pytest.mark.parametrize("at_most", [0.0, -1.0, float("nan")])
def test_a_rate_that_is_asked_for_is_above_zero(at_most):
    with pytest.raises(InvalidInput, match="must be above 0"):
        FalseRates(np.zeros(1), 1.0).shift(6.0, at_most)


def test_thresholds_by_rates_need_rates(library, examples):
    assert thresholds_for(library).tolist() == [library.scoring.threshold] * 2
    with pytest.raises(InvalidInput, match="how many false labels"):
        thresholds_for(library, 1.0)
    calibrated = learn(examples, negatives=[other_motion(1)])
    assert (thresholds_for(calibrated, 0.1) > thresholds_for(calibrated, 1.0)).all()


def test_classes_have_least_scores_of_their_own(library):
    one = replace(library["one"], score_threshold=50.0)
    harder = replace(library, classes=(one, library["two"]))
    assert thresholds_for(harder).tolist() == [50.0, library.scoring.threshold]
    stream = sequence(
        np.concatenate([perform(made_class(name), [name, 77]).features for name in (1, 2)]),
        feature_set=FULL_BODY,
    )
    for given, names in ((library, ["one", "two"]), (harder, ["two"])):
        assert [label.name for label in annotate(stream, given)] == names
    given = annotate(stream, harder, assignment="scores", threshold=6.0)
    assert [label.name for label in given] == ["one", "two"]


# -- probabilities -----------------------------------------------------------------------


def test_probabilities_follow_how_often_labels_are_right():
    rng = np.random.default_rng(9)
    margins = rng.uniform(0, 6, size=4000)
    right = rng.random(4000) < 1 / (1 + np.exp(-(-0.5 + 0.8 * margins)))
    at_least, growth = fit_probability(margins, right)
    assert (at_least, growth) == pytest.approx((-0.5, 0.8), abs=0.15)
    assert fit_probability(margins, rng.random(4000) < 0.5)[1] >= 0
    assert np.isfinite(fit_probability([1.0], [True])).all()
    with pytest.raises(InvalidInput, match="needs labels"):
        fit_probability([], [])


def test_calibrated_labels_say_how_probably_they_are_right(library, tmp_path):
    judged = [JudgedLabel("one", 6.0 + i / 10, i > 5) for i in range(40)]
    calibrated = calibrate_scores(library, judged, minutes=3.0)
    calibrated.save(tmp_path)
    loaded = ClassLibrary.load(tmp_path)
    assert loaded.scoring == calibrated.scoring
    label = next(iter(annotate(perform(made_class(1), 78), loaded)))
    assert label.probability == loaded.scoring.probability_of(label.score - 6.0)
    assert loaded.scoring.probability_of(0.0) < label.probability <= 1
    assert next(iter(annotate(perform(made_class(1), 78), library))).probability is None


@pytest.mark.parametrize(
    "wrong",
    [{"corpus": ()}, {"corpus": (1.0,)}, {"threshold": 0.0}, {"look_ahead_s": -1.0},
     {"false_slope": 0.0}, {"probability": (1.0,)}],
)  # fmt: skip
def test_wrong_settings_of_scores_are_refused(wrong):
    with pytest.raises(InvalidInput):
        Scoring(**{"corpus": (0.5,), **wrong})


def test_a_class_without_a_prior_has_no_ratios(library):
    plain = MotionClass("plain", library["one"].prototypes)
    with pytest.raises(InvalidInput, match="has no prior"):
        _ = plain.ratios
