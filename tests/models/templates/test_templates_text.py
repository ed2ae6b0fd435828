"""Templates as text: what is written reads back, what contradicts itself is told by line."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from motionary.errors import InvalidInput
from motionary.features import (
    FULL_BODY,
    FULL_BODY_2006,
    LEGS,
    THREE_LEVELS,
    FeatureSet,
    known_sets,
)
from motionary.matching import distance_function, find_hits
from motionary.models.templates import (
    MotionTemplate,
    concatenate,
    pattern_of,
    quantise,
    revise_template,
    template_from_text,
    template_to_text,
)
from motionary.packing import full_mask, pack

SWEEPING = """
# sweeping with a hand brush
features: full-body-40
for 1.5 s: right hand fast, spine horizontal, right hand low
"""
STATES = np.array([0.0, 1.0, 0.5])


def template_of(values, feature_set=FULL_BODY, **rest):
    values = np.asarray(values, dtype=float)
    return MotionTemplate(values, np.ones(len(values)), feature_set.ids, feature_set.name, **rest)


def index_of(*names, feature_set=FULL_BODY):
    return [feature_set.names.index(name) for name in names]


def test_sweeping_is_the_published_design():
    # Müller and Röder (2006), section 5.4: length 50, 0.5 but for F13, F32 and F33.
    template = template_from_text(SWEEPING.replace("1.5", "1.667"), name="sweeping")
    expected = np.full((50, 40), 0.5)
    expected[:, [FULL_BODY.ids.index(i) for i in ("F13", "F32", "F33")]] = 1.0
    assert np.array_equal(template.values, expected)
    assert template.weights.tolist() == [1.0] * 50
    assert template.provenance == "sweeping, designed by hand"


def test_sweeping_is_found_where_it_was_planted():
    rng = np.random.default_rng(7)
    features = np.repeat(rng.random((60, 40)) < 0.3, 15, axis=0)
    asked = index_of("right hand fast", "spine horizontal", "right hand low")
    features[:, asked[1]] = False
    for start in (200, 640):
        features[start : start + 55, asked] = True
        features[start + 20 : start + 23, asked[0]] = False  # the hand turns round
    pattern = pattern_of(quantise(template_from_text(SWEEPING), tolerance=0.05))
    packed, known = pack(features), full_mask(len(features), 40)
    distance = distance_function(pattern, packed, known)
    hits = find_hits(distance, pattern, packed, known, threshold=0.1)
    planted = {start: set(range(start, start + 55)) for start in (200, 640)}
    found = {}
    for hit in hits:
        frames = set(range(hit.start, hit.stop))
        fractions = {start: len(frames & inside) / len(frames) for start, inside in planted.items()}
        best = max(fractions, key=fractions.get)
        assert fractions[best] > 0.9
        found[best] = min(hit.cost, found.get(best, 1.0))
    assert found.keys() == planted.keys()
    assert max(found.values()) < 0.03


def test_stretches_follow_one_another_and_times_count_from_the_beginning():
    template = template_from_text(
        """
        for 0.2 s: F13, not F14
        FOR .1 sec:  Anything
        for 0.5 seconds: not  Right   Knee bent,
            left knee bent,       # goes on here
            body low
        throughout: F40
        from 0.5 to 0.6 s: not right hand fast
        """
    )
    expected = np.full((24, 40), 0.5)
    expected[:6, index_of("right hand fast")] = 1
    expected[:6, index_of("left hand fast")] = 0
    expected[9:, index_of("right knee bent")] = 0
    expected[9:, index_of("left knee bent", "body low")] = 1
    expected[:, index_of("body turns")] = 1
    expected[15:18, index_of("right hand fast")] = 0
    assert np.array_equal(template.values, expected)


def test_what_no_example_shows_is_told_until_it_is_fixed():
    values = np.full((6, 40), 0.5)
    values[:, index_of("body low")] = 1.0
    template = template_of(values, unmeasured=("F13", "F20"))
    text = template_to_text(template, tolerance=0.1)
    assert "# measured in no example: right hand fast, right knee bent\n" in text
    assert revise_template(template, text, tolerance=0.1) is template
    revised = revise_template(template, text + "throughout: F13\n", tolerance=0.1)
    assert revised.unmeasured == ("F20",)
    both = concatenate([template, template_of(np.ones((3, 40)))])
    assert both.unmeasured == ()
    with pytest.raises(InvalidInput, match=r"unmeasured must name features .*got \['F99'\]"):
        template_of(values, unmeasured=("F99",))


def test_what_lasts_longer_than_its_lines_ends_free():
    template = template_from_text("lasts 1 s\nfrom 0 to 0.5 s: body low")
    assert template.n_columns == 30
    assert (template.values[15:] == 0.5).all()


@pytest.mark.parametrize(
    ("segment", "columns"),
    [("0.3 to 0.5 s", 12), ("0.5 s to 0.5 s", 15), ("0.2 to 0.7 s", 11), ("1 to 2 s", 42)],
)
def test_a_range_gets_the_length_whose_half_and_double_cover_it(segment, columns):
    least, most = (float(word) for word in segment.replace("s", "").split(" to "))
    template = template_from_text(f"for {segment}: body low")
    assert template.n_columns == columns
    assert columns / 2 <= round(30 * least)
    assert round(30 * most) <= 2 * columns
    # Without any cost, at both ends of the range.
    pattern = pattern_of(quantise(template_from_text(f"for {segment}: F37"), tolerance=0.0))
    low = index_of("body low")
    for seconds in (least, most):
        features = np.zeros((round(30 * seconds) + 8, 40), dtype=bool)
        features[4:-4, low] = True
        distance = distance_function(pattern, pack(features))
        assert distance.min() == 0.0


@given(
    states=arrays(np.int8, st.tuples(st.integers(1, 40), st.just(40)), elements=st.integers(-1, 1))
)
def test_what_is_written_reads_back(states):
    template = template_of(STATES[states])
    text = template_to_text(template, tolerance=0.1)
    assert np.array_equal(template_from_text(text).values, template.values)


@given(data=st.data())
def test_long_stretches_read_back_too(data):
    segments = data.draw(
        arrays(np.int8, st.tuples(st.integers(1, 8), st.just(14)), elements=st.integers(-1, 1))
    )
    repeats = data.draw(st.lists(st.integers(1, 60), min_size=8, max_size=8))
    template = template_of(np.repeat(STATES[segments], repeats[: len(segments)], axis=0), LEGS)
    text = template_to_text(template, tolerance=0.0)
    assert np.array_equal(template_from_text(text, feature_set=LEGS).values, template.values)


@pytest.mark.parametrize("feature_set", known_sets().values(), ids=lambda s: s.name)
def test_every_known_set_has_names_that_read_back(feature_set):
    values = np.random.default_rng(3).choice([0.0, 0.5, 1.0], size=(7, len(feature_set)))
    text = template_to_text(template_of(values, feature_set), tolerance=0.0)
    got = template_from_text(text, feature_set=feature_set)
    assert np.array_equal(got.values, values)
    assert got.feature_set == feature_set.name


def test_names_that_would_be_misread_are_written_as_ids():
    names = ("not there", "knee, bent", "anything", "same", "same", "fast # slow", "a: b", "R1")
    features = [
        replace(FULL_BODY.features[16], id=f"R{i}", mirror=f"R{i}", name=name)
        for i, name in enumerate(names)
    ]
    odd = FeatureSet("odd", tuple(features))
    values = np.random.default_rng(4).choice([0.0, 0.5, 1.0], size=(9, len(odd)))
    text = template_to_text(template_of(values, odd), tolerance=0.0, feature_set=odd)
    assert np.array_equal(template_from_text(text, feature_set=odd).values, values)


def test_a_learned_template_stays_readable(data):
    from motionary.features import compute_features
    from motionary.io import read
    from motionary.models.templates import learn_template

    clips = sorted((data / "hdm05" / "squat1Reps").glob("HDM_bd*.amc"))
    examples = [compute_features(read(clip)).features for clip in clips]
    template = learn_template(examples, feature_names=FULL_BODY.ids, feature_set=FULL_BODY.name)
    text = template_to_text(template, tolerance=0.05)
    lines = text.splitlines()
    assert len(lines) < 2 * template.n_columns
    assert max(map(len, lines)) <= 100
    expected, got = (quantise(t, tolerance=0.05) for t in (template, template_from_text(text)))
    assert np.array_equal(expected.values, got.values)
    assert np.array_equal(expected.fixed, got.fixed)


def test_revising_keeps_what_was_not_touched():
    rng = np.random.default_rng(5)
    template = replace(
        template_of(rng.random((20, 40)), provenance="learned from 9 recordings", n_examples=9),
        weights=rng.random(20) + 0.5,
    )
    text = template_to_text(template, tolerance=0.2)
    assert revise_template(template, text, tolerance=0.2) is template
    changed = text + "throughout: anything\nfrom 0.1 to 0.2 s: anything\n"
    assert revise_template(template, changed, tolerance=0.2) is template

    free = quantise(template, tolerance=0.2).fixed[3:6, 7].any()
    assert not free or "left elbow bent" in text
    template = replace(template, values=np.where(np.arange(40) == 7, 0.5, template.values))
    text = template_to_text(template, tolerance=0.2) + "from 0.1 to 0.2 s: left elbow bent\n"
    revised = revise_template(template, text, tolerance=0.2)
    expected = template.values.copy()
    expected[3:6, 7] = 1.0
    assert np.array_equal(revised.values, expected)
    assert np.array_equal(revised.weights, template.weights)
    assert revised.n_examples == 9
    assert revised.provenance == "learned from 9 recordings, edited by hand"


def test_a_text_of_another_length_replaces_all():
    template = template_of(np.random.default_rng(5).random((20, 40)), n_examples=9)
    revised = revise_template(template, "for 1 s: body low", tolerance=0.1)
    assert np.array_equal(revised.values, template_from_text("for 1 s: body low").values)
    assert revised.provenance == "a template, edited by hand"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: the text gives no length"),
        ("# nothing\n", "line 1: the text gives no length"),
        ("throughout: body low", "line 1: the text gives no length"),
        ("\nright hand fast", "line 2: not understood: 'right hand fast'; expected 'for 1.5 s"),
        ("for a while: body low", "line 1: not understood: 'for a while'"),
        ("for 1,5 s: body low", "line 1: not understood: 'for 1,5 s'"),
        ("for 1 s:", "line 1: a feature is missing; 'anything' stands for none"),
        ("for 1 s: body low,, F13", "line 1: a feature is missing"),
        ("for 1 s: body low,", "line 1: ends in a comma, and nothing follows"),
        ("for 1 s: body low,\nfor 1 s: F13", "line 1: ends in a comma, and a new line begins"),
        ("for 1 s: body low, anything", "line 1: 'anything' stands alone"),
        ("for 1 s: not anything", "line 1: full-body-40 has no feature 'anything'"),
        (
            "for 1 s: F1\nfor 1 s: right hand quick,\n   right hnad fast",
            "line 2: .* no feature 'right hand quick'; did you mean .*'right hand fast'",
        ),
        (
            "for 1 s: F1,\n\n   right hnad fast",
            "line 3: .* no feature 'right hnad fast'; did you mean 'right hand fast'",
        ),
        (
            "for 1 s: right hand fast, not right hand fast",
            "line 1: 'not right hand fast' contradicts 'right hand fast' of line 1, from 0 to 1 s",
        ),
        (
            "for 1 s: F13\nfor 1 s: F14\nfrom 0.9 to 1.2 s: not F13",
            "line 3: 'not right hand fast' contradicts 'right hand fast' of line 1, "
            "from 0.9 to 1 s",
        ),
        (
            "throughout: not body low\nfor 1 s: F13\nfor 0.5 s: body low",
            "line 3: 'body low' contradicts 'not body low' of line 1, from 1 to 1.5 s",
        ),
        ("for 0 s: F13", "line 1: a segment needs at least 0.03 s"),
        ("for 0.01 s: F13", "line 1: a segment needs at least 0.03 s"),
        ("for 1e9 s: F13", "line 1: not understood"),
        ("for 99999 s: F13", "line 1: a template needs times from 0 to 600 s"),
        ("lasts 99999999999 s\nthroughout: F13", "line 1: a template needs times from 0 to 600"),
        ("for 0.1 to 0.5 s: F13", "line 1: 0.1 to 0.5 s is too wide"),
        ("for 0.5 to 0.1 s: F13", "line 1: a range of lengths needs 0 < least <= most"),
        ("for 0 to 0.1 s: F13", "line 1: a range of lengths needs 0 < least <= most"),
        ("from 0.5 to 0.5 s: F13", "line 1: must end after its start"),
        ("lasts 1 s\nfrom 0.5 to 2 s: F13", "line 2: ends at 2 s, but the template lasts 1 s"),
        ("lasts 1 s\nlasts 1 s\nthroughout: F13", "line 2: the length was given before"),
        ("features: legs-14\nfor 1 s: F20", "line 1: the text is over 'legs-14', asked for is"),
        ("for 1 s: F20\nfeatures: full-body-40", "line 2: the feature set is named in the first"),
    ],
)
def test_what_cannot_be_read_is_told_by_its_line(text, message):
    with pytest.raises(InvalidInput, match=message):
        template_from_text(text)


def test_texts_of_unknown_or_other_sets_are_refused():
    own = replace(LEGS, name="own")
    template = template_of(np.ones((3, 14)), own)
    with pytest.raises(InvalidInput, match="'own' is not known; pass feature_set="):
        template_to_text(template, tolerance=0.1)
    with pytest.raises(InvalidInput, match="not those of 'full-body-39'"):
        template_to_text(template, tolerance=0.1, feature_set=FULL_BODY_2006)
    assert "features: own" in template_to_text(template, tolerance=0.1, feature_set=own)
    with pytest.raises(InvalidInput, match=r"below 0\.5"):
        template_to_text(template, tolerance=0.5, feature_set=own)


def test_a_set_without_readable_names_cannot_be_written():
    feature = replace(FULL_BODY.features[16], id="a,b", mirror="a,b", name="c,d")
    odd = FeatureSet("odd", (feature,))
    with pytest.raises(InvalidInput, match="'a,b' of 'odd' has no name that reads back"):
        template_to_text(template_of([[1.0]], odd), tolerance=0.0, feature_set=odd)


def test_more_than_64_relations_are_no_matter():
    text = "for 0.5 s: right hand fast (very), not right hand low (slightly), right toes fast"
    template = template_from_text(text, feature_set=THREE_LEVELS)
    fixed = quantise(template, tolerance=0.05)
    assert fixed.n_fixed == 45
    assert fixed.packed_fixed.shape == (15, 3)
