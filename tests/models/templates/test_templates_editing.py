"""Templates shaped by hand: restricted, loosened, cut, joined, one after the other."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, LEGS
from motionary.matching import distance_function
from motionary.models.templates import (
    MotionTemplate,
    Pause,
    concatenate,
    cut,
    describe_template,
    fix,
    free,
    join,
    learn_template,
    pattern_of,
    quantise,
    restrict,
    template_from_text,
)
from motionary.packing import pack

NAMES = {"feature_names": FULL_BODY.ids, "feature_set": FULL_BODY.name}


def smooth_example(seed, n_frames=30, n_features=40):
    """Relations that come and go, each once."""
    rng = np.random.default_rng(seed)
    start, stop = np.sort(rng.integers(0, n_frames + 1, size=(2, n_features)), axis=0)
    frames = np.arange(n_frames)[:, None]
    return (start <= frames) & (frames < stop)


def learned(*seeds):
    return learn_template([smooth_example(seed) for seed in seeds], **NAMES)


def quantised_text(template):
    quantised = quantise(template, tolerance=0.05)
    return np.where(quantised.fixed, quantised.values, 2).astype(int).tolist()


def test_restricting_keeps_the_named_relations_alone():
    template = learned(1, 2)
    kept = restrict(template, ["right hand fast", "F14"])
    chosen = [FULL_BODY.ids.index("F13"), FULL_BODY.ids.index("F14")]
    assert np.array_equal(kept.values[:, chosen], template.values[:, chosen])
    assert (np.delete(kept.values, chosen, axis=1) == 0.5).all()
    assert kept.provenance == "a template, restricted to 2 features"
    assert np.array_equal(restrict(template, "F13").values, restrict(kept, ["F13"]).values)


def test_loosening_frees_a_stretch():
    template = learned(1, 2)
    loose = free(template, ["F13"], start_s=0.1, end_s=0.3)
    expected = template.values.copy()
    expected[3:9, FULL_BODY.ids.index("F13")] = 0.5
    assert np.array_equal(loose.values, expected)
    assert (free(template).values == 0.5).all()
    assert (free(template, start_s=0.5).values[15:] == 0.5).all()
    assert np.array_equal(free(template, start_s=0.5).values[:15], template.values[:15])


def test_fixing_and_cutting_by_seconds():
    template = learned(1, 2)
    fixed = fix(template, {"body low": True, "F40": False}, end_s=0.5)
    assert (fixed.values[:15, FULL_BODY.ids.index("F37")] == 1.0).all()
    assert (fixed.values[:15, FULL_BODY.ids.index("F40")] == 0.0).all()
    assert np.array_equal(fixed.values[15:], template.values[15:])
    part = cut(fixed, start_s=0.2, end_s=0.5)
    assert np.array_equal(part.values, fixed.values[6:15])
    assert np.array_equal(part.weights, template.weights[6:15])
    assert part.provenance == "a template, fixed by hand, cut by hand"


def test_what_was_given_is_never_changed():
    template = learned(1, 2)
    before = template.values.copy()
    for change in (
        lambda t: restrict(t, ["F1"]),
        free,
        lambda t: fix(t, {"F1": True}),
        lambda t: cut(t, end_s=0.3),
        lambda t: join(t, learned(3, 4)),
        lambda t: concatenate([t, Pause(0.2, 0.3), t]),
    ):
        change(template)
        assert np.array_equal(template.values, before)


@given(seeds=st.lists(st.integers(0, 99), min_size=1, max_size=4), n_examples=st.integers(1, 60))
def test_joining_a_template_with_itself_changes_nothing(seeds, n_examples):
    template = replace(learned(*seeds), n_examples=n_examples)
    same = join(template, template)
    assert same.values.shape == template.values.shape
    assert np.allclose(same.values, template.values, atol=1e-12)
    assert np.allclose(same.weights, template.weights, atol=1e-12)
    assert same.n_examples == 2 * n_examples


def test_joining_frees_what_separates():
    backward = template_from_text("for 1 s: F1, F3, not F5")
    forward = template_from_text("for 1 s: F1, not F3, not F5")
    assert quantised_text(join(backward, forward)) == quantised_text(
        template_from_text("for 1 s: F1, not F5")
    )


def test_joining_weighs_by_examples():
    # Equal columns align one to one: the average is that of 8 + 2 examples.
    often = replace(template_from_text("for 1 s: F1, F3"), n_examples=8)
    rarely = replace(template_from_text("for 1 s: F1, not F3"), n_examples=2)
    joined = join(often, rarely)
    assert np.allclose(joined.values[:, 2], 0.8)
    assert np.allclose(joined.values[:, 0], 1.0)
    assert joined.n_examples == 10
    # Very rare examples still count, as a twentieth.
    assert np.allclose(join(replace(often, n_examples=500), rarely).values[:, 2], 0.95)


def test_joining_approaches_learning_from_all_examples():
    first, second = [smooth_example(seed) for seed in (1, 2, 3)], [smooth_example(4)]
    joined = join(learn_template(first, **NAMES), learn_template(second, **NAMES))
    together = learn_template(first + second, **NAMES)
    assert joined.n_examples == together.n_examples == 4
    assert joined.duration_s == pytest.approx(together.duration_s, rel=0.02)
    assert abs(joined.values.mean() - together.values.mean()) < 0.05


def test_one_after_the_other_with_a_pause_of_bounded_length():
    first, second = template_from_text("for 0.5 s: F1"), template_from_text("for 0.5 s: F2")
    both = concatenate([first, Pause(0.3, 0.6), second])
    assert both.n_columns == 15 + 13 + 15
    pattern = pattern_of(quantise(both, tolerance=0.05))

    def cheapest(pause_frames):
        features = np.zeros((40 + pause_frames, 40), dtype=bool)
        features[5:20, 0] = True
        features[20 + pause_frames : 35 + pause_frames, 1] = True
        return distance_function(pattern, pack(features)).min()

    assert [cheapest(n) for n in (9, 12, 15, 18)] == [0.0] * 4
    assert cheapest(80) > 0.0


def test_a_pause_at_an_end_and_none_at_all():
    template = learned(5, 6)
    assert np.array_equal(concatenate([template]).values, template.values)
    opened = concatenate([Pause(0.2, 0.2), template])
    assert (opened.values[:6] == 0.5).all()
    assert np.array_equal(opened.values[6:], template.values)
    assert opened.n_examples == 2


def other_features():
    return MotionTemplate(np.ones((20, 14)), np.ones(20), LEGS.ids, LEGS.name)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda t: join(t, other_features()), "same features .* 'full-body-40' .* 'legs-14'"),
        (lambda t: concatenate([t, other_features()]), "same features to be put together"),
        (lambda t: concatenate([Pause(1.0, 2.0)]), "at least one template"),
        (lambda t: concatenate([]), "at least one template"),
        (lambda t: concatenate([t, Pause(0.0, 1.0)]), "0 < least <= most"),
        (lambda t: concatenate([t, Pause(0.1, 1.0)]), "too wide"),
        (lambda t: restrict(t, []), "at least one feature to keep"),
        (lambda t: restrict(t, ["F41"]), "no feature 'F41'; did you mean|it has"),
        (lambda t: restrict(t, ["F1"], feature_set=LEGS), "not those of 'legs-14'"),
        (lambda t: free(t, ["right hand quick"]), "did you mean"),
        (lambda t: free(t, start_s=5.0), "lie in the template, 0 to 1 s, got 5 s to the end"),
        (lambda t: free(t, start_s=0.5, end_s=0.2), "got 0.5 to 0.2 s"),
        (lambda t: free(t, start_s=-1.0), "times from 0 to 600 s"),
        (lambda t: fix(t, {"F1": True}, end_s=2.0), "lie in the template"),
        (lambda t: cut(t, start_s=0.4, end_s=0.4), "lie in the template"),
        (lambda t: cut(t, end_s=float("nan")), "times from 0 to 600 s"),
    ],
)
def test_what_cannot_be_done_is_told(call, message):
    with pytest.raises(InvalidInput, match=message):
        call(template_from_text("for 1 s: F1"))


def test_one_segment_that_is_left_out_is_one(monkeypatch):
    from motionary.models.library import load_everyday
    from motionary.models.templates import editing

    template = load_everyday()["squat"].prototypes[0].template

    def left_out(most):
        monkeypatch.setattr(editing, "_MOST_LINES", most)
        lines = describe_template(template, tolerance=0.1, feature_set=load_everyday().feature_set)
        (line,) = (line.strip() for line in lines if " shorter segment" in line)
        return line.partition("and ")[2]

    number, rest = left_out(1).split(maxsplit=1)
    assert rest == "shorter segments"
    assert left_out(int(number)) == "1 shorter segment"
