"""Columns of templates as keyframes: given, by the rule of thumb, with examples."""

import numpy as np
import pytest

from keyframe_cases import learned_template, sequence_of
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FULL_BODY_2006
from motionary.models.keyframes import (
    Gap,
    choose_keyframes,
    from_features,
    from_template,
    search_packed,
)
from motionary.models.keyframes.choosing import MOST_STEADY, align_columns
from motionary.models.templates import QuantisedTemplate
from oracles import keyframes as oracle

N = len(FULL_BODY)


#: Features that make the motion: 3 comes on, then 7 does while 3 goes off.
FIRST, SECOND = 3, 7


#: Changes at random, in examples and elsewhere.
NOISE = 20


def template_of(rows) -> QuantisedTemplate:
    """Template over the 40 features, all free but what rows {column: {id: value}} fix."""
    n_columns = rows["n"]
    shape = (n_columns, len(FULL_BODY))
    values, fixed = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    for column, features in rows.items():
        for name, value in features.items() if column != "n" else ():
            values[column, FULL_BODY.ids.index(name)] = value
            fixed[column, FULL_BODY.ids.index(name)] = True
    return QuantisedTemplate(values, fixed, np.ones(n_columns), FULL_BODY.ids, FULL_BODY.name)


def test_columns_of_a_template():
    template = template_of({"n": 30, 4: {"F1": True, "F20": False}, 14: {"F20": True}})
    query = from_template(template, [4, 14], stiffness=0.5)
    expected = from_features(
        [{"F1": True, "F20": False}, {"F20": True}], [Gap(5, 20)], positions=[4, 14]
    )
    assert query == expected
    lower = from_template(template, [4, 14], stiffness=[0.0], groups=["lower", None])
    assert lower.gaps == (Gap(0, None),)
    assert lower == from_features([{"F20": False}, {"F20": True}], lower.gaps, positions=[4, 14])


@pytest.mark.parametrize(
    ("positions", "options", "complaint"),
    [
        ([], {}, "positions must be columns"),
        ([30], {}, "columns of the template, 0 to 29"),
        ([3, 1], {}, "distance must be at least 0"),
        ([1], {"groups": ["arms"]}, "no group 'arms'"),
        ([1], {"groups": ["mix", "mix"]}, "1 keyframes need as many groups"),
        ([1], {"groups": ["mix"], "feature_set": FULL_BODY_2006}, "full-body-40.*full-body-39"),
    ],
)
def test_bad_columns(positions, options, complaint):
    template = template_of({"n": 30})
    with pytest.raises(InvalidInput, match=complaint):
        from_template(template, positions, stiffness=1.0, **options)


def random_template(seed, n_columns=40) -> QuantisedTemplate:
    rng = np.random.default_rng(seed)
    shape = (n_columns, len(FULL_BODY))
    return QuantisedTemplate(
        rng.random(shape) < 0.5, rng.random(shape) < rng.random((n_columns, 1)),
        np.ones(n_columns), FULL_BODY.ids, FULL_BODY.name,
    )  # fmt: skip


@pytest.mark.parametrize("zero_weight", [1.0, 1.2])
@pytest.mark.parametrize("seed", range(6))
def test_choosing_follows_its_definition(seed, zero_weight):
    template = random_template(seed, n_columns=[1, 4, 7, 25, 40, 90][seed])
    groups = [feature.group for feature in FULL_BODY.features]
    for count in (1, 3, 5):
        chosen = choose_keyframes(template, count=count, min_distance=3, zero_weight=zero_weight)
        expected = oracle.choose(template.values, template.fixed, groups, count, 3, zero_weight)
        assert [(c.position, c.group) for c in chosen] == expected


def test_an_all_free_template_has_no_keyframes():
    assert choose_keyframes(template_of({"n": 20}), count=5) == []


def test_chosen_keyframes_make_a_query():
    template = random_template(3)
    chosen = choose_keyframes(template, count=3)
    assert 2 <= len(chosen) <= 3
    query = from_template(
        template, [c.position for c in chosen], stiffness=0.5, groups=[c.group for c in chosen]
    )
    assert len(query) == len(chosen)
    # A document that plays the template has a hit.
    assert len(search_packed(query, template.packed_values)) == 1


def test_bad_choosing():
    with pytest.raises(InvalidInput, match="count must be at least 1"):
        choose_keyframes(random_template(0), count=0)
    with pytest.raises(InvalidInput, match=r"full-body-40.*full-body-39"):
        choose_keyframes(random_template(0), feature_set=FULL_BODY_2006)


def test_columns_follow_the_alignment():
    features = np.zeros((20, N), dtype=bool)
    features[5:10, FIRST] = features[12:18, SECOND] = True
    slow = np.repeat(features, 2, axis=0)
    examples = [sequence_of(features), sequence_of(slow)]
    aligned = align_columns(learned_template(examples[:1]), examples, tolerance=1)
    assert aligned.n_columns == 20
    for column in range(20):
        first, second = aligned.frames[:, column]
        np.testing.assert_array_equal(features[first], slow[second])
    # 20 changes nothing: as steady as is counted. 3 comes on at frame 5.
    assert (aligned.tolerance[:, NOISE] == MOST_STEADY).all()
    assert aligned.tolerance[7, FIRST] == 2
    assert aligned.disagreement.max() == 0.0


@pytest.mark.parametrize("n", [1, 2, 5])
def test_disagreement_is_what_one_breaks_and_all_others_share(n):
    examples = [sequence_of(np.zeros((20, N))) for _ in range(n)]
    odd = np.zeros((20, N))
    odd[:, NOISE] = 1
    aligned = align_columns(learned_template(examples), [*examples, sequence_of(odd)], tolerance=0)
    expected = np.zeros(N)
    # Of two, each breaks what the other shows.
    expected[NOISE] = 2.0 if n == 1 else 1.0
    np.testing.assert_allclose(aligned.disagreement, expected)
