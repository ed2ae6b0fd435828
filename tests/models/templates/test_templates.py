"""Do templates hold what they promise, and do cells at the edges go the right way?"""

import copy
import dataclasses
import pickle
from fractions import Fraction
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput
from motionary.models import templates
from motionary.models.templates import MotionTemplate, QuantisedTemplate, mirror, quantise
from motionary.packing import unpack
from oracles import learning as oracle


def template_of(values, **changes):
    values = np.asarray(values, dtype=float)
    names = tuple(f"relation {i}" for i in range(values.shape[-1]))
    given = {"weights": np.ones(len(values)), "feature_names": names, "feature_set": "a set"}
    return MotionTemplate(values, **(given | changes))


def test_the_contents_are_complete():
    names = {
        name
        for name, value in vars(templates).items()
        if not name.startswith("_") and not isinstance(value, ModuleType)
    }
    assert set(templates.__all__) == names
    assert len(templates.__all__) == len(names)


def test_a_template_tells_its_size():
    template = template_of(np.zeros((4, 3)), weights=[0.75, 1.5, 1.0, 1.25])
    assert (template.n_columns, template.n_features, template.rate_hz) == (4, 3, 30.0)
    assert template.duration_s == pytest.approx(4.5 / 30)


def test_a_template_keeps_its_own_copy():
    values, weights = np.zeros((2, 2)), np.ones(2)
    template = template_of(values, weights=weights)
    values[:], weights[:] = 1.0, 7.0
    assert not template.values.any()
    assert (template.weights == 1.0).all()
    for array in (template.values, template.weights):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.5


def test_rounding_noise_outside_0_and_1_is_clipped():
    template = template_of([[-1e-12, 1 + 1e-12]])
    assert template.values.tolist() == [[0.0, 1.0]]


@pytest.mark.parametrize(
    ("values", "changes", "packed"),
    [
        (np.zeros(3), {}, "columns, features"),
        (np.zeros((0, 3)), {}, "at least 1"),
        (np.zeros((3, 0)), {}, "at least 1"),
        ([[0.5, 1.1]], {}, "got 1.1"),
        ([[0.5, -0.1]], {}, "got -0.1"),
        ([[0.5, np.nan]], {}, "got nan"),
        ([[0.5]], {"weights": [1.0, 1.0]}, r"shape \(1,\)"),
        ([[0.5]], {"weights": [0.0]}, "positive"),
        ([[0.5]], {"weights": [np.inf]}, "finite"),
        ([[0.5]], {"weights": [np.nan]}, "positive"),
        ([[0.5, 0.5]], {"feature_names": ("a",)}, "2 features"),
        ([[0.5, 0.5]], {"feature_names": ("a", "a")}, "1 different"),
        ([[0.5]], {"feature_set": ""}, "feature set"),
        ([[0.5]], {"n_examples": 0}, "n_examples"),
    ],
)
def test_a_malformed_template_is_refused(values, changes, packed):
    with pytest.raises(InvalidInput, match=packed):
        template_of(values, **changes)


@pytest.mark.parametrize("tolerance", [0.0, 0.05, 0.1, 0.25, 0.49])
def test_quantising_is_inclusive_for_every_share_of_up_to_30_examples(tolerance):
    fractions = [Fraction(k, n) for n in range(1, 31) for k in range(n + 1)]
    # As averages come: summed, then divided. Compare with exact fractions.
    means = [
        float(np.mean([1.0] * s.numerator + [0.0] * (s.denominator - s.numerator)))
        for s in fractions
    ]
    quantised = quantise(template_of([means]), tolerance=tolerance)
    wanted = [oracle.quantise(fraction, Fraction(str(tolerance))) for fraction in fractions]
    assert quantised.fixed[0].tolist() == [w is not None for w in wanted]
    assert quantised.values[0].tolist() == [w == 1 for w in wanted]


@pytest.mark.parametrize(
    ("value", "fixed"),
    [
        (0.1, True),
        (0.1 + 5e-10, True),
        (0.1 + 2e-9, False),
        (0.9, True),
        (0.9 - 5e-10, True),
        (0.9 - 2e-9, False),
        (1 - 0.9, True),
        (sum([0.1] * 9), True),
    ],
)
def test_the_slack_is_1e_9(value, fixed):
    assert quantise(template_of([[value]]), tolerance=0.1).n_fixed == fixed


def test_without_tolerance_only_agreement_is_fixed():
    quantised = quantise(template_of([[0.0, 0.01, 0.5, 0.99, 1.0]]), tolerance=0.0)
    assert quantised.fixed.tolist() == [[True, False, False, False, True]]
    assert quantised.values.tolist() == [[False, False, False, False, True]]


def test_a_tolerance_just_below_a_half_never_fixes_a_cell_both_ways():
    quantised = quantise(template_of([[0.4, 0.5, 0.6]]), tolerance=0.5 - 1e-12)
    assert quantised.fixed.tolist() == [[True, False, True]]
    assert quantised.values.tolist() == [[False, False, True]]


@pytest.mark.parametrize("tolerance", [-0.1, 0.5, 1.0, float("nan")])
def test_a_tolerance_outside_0_to_half_is_refused(tolerance):
    with pytest.raises(InvalidInput, match="tolerance"):
        quantise(template_of([[0.5]]), tolerance=tolerance)


def test_an_all_free_template_is_legal_and_says_so():
    quantised = quantise(template_of(np.full((3, 2), 0.5)), tolerance=0.1)
    assert quantised.n_fixed == 0
    assert not quantised.packed_fixed.any()


@pytest.mark.parametrize("n_features", [1, 39, 40, 64, 65, 130])
def test_words_hold_the_matrices(n_features):
    values = np.random.default_rng(1).choice([0.0, 0.3, 1.0], size=(7, n_features))
    quantised = quantise(template_of(values), tolerance=0.1)
    assert (quantised.n_columns, quantised.n_features) == (7, n_features)
    assert np.array_equal(unpack(quantised.packed_values, n_features), values == 1.0)
    assert np.array_equal(unpack(quantised.packed_fixed, n_features), values != 0.3)
    assert quantised.n_fixed == np.count_nonzero(values != 0.3)


def test_a_free_cell_carries_no_value():
    quantised = QuantisedTemplate(
        values=np.ones((1, 2), bool),
        fixed=np.array([[True, False]]),
        weights=np.ones(1),
        feature_names=("a", "b"),
        feature_set="a set",
    )
    assert quantised.values.tolist() == [[True, False]]
    assert quantised.packed_values.tolist() == [[1]]


@pytest.mark.parametrize(
    ("values", "fixed"), [((1, 2), (1, 3)), ((2,), (2,)), ((0, 2), (0, 2)), ((2, 0), (2, 0))]
)
def test_a_malformed_quantised_template_is_refused(values, fixed):
    with pytest.raises(InvalidInput, match="same shape"):
        QuantisedTemplate(
            values=np.ones(values, bool),
            fixed=np.ones(fixed, bool),
            weights=np.ones(values[0]),
            feature_names=("a", "b"),
            feature_set="a set",
        )


@st.composite
def swaps(draw):
    n = draw(st.integers(1, 12))
    shuffled = draw(st.permutations(range(n)))
    order = list(range(n))
    for a, b in zip(shuffled[0::2], shuffled[1::2], strict=False):
        if draw(st.booleans()):
            order[a], order[b] = b, a
    return order


@given(swaps())
def test_mirroring_swaps_and_twice_gives_the_template_back(order):
    values = np.random.default_rng(2).random((3, len(order)))
    template = template_of(values, weights=[1.0, 0.8, 1.2], provenance="three clips", n_examples=3)
    once = mirror(template, order)
    for feature, partner in enumerate(order):
        assert np.array_equal(once.values[:, feature], values[:, partner])
    assert once.feature_names == template.feature_names
    assert np.array_equal(once.weights, template.weights)
    assert (once.n_examples, once.provenance) == (3, "mirror image of three clips")
    assert np.array_equal(mirror(once, order).values, values)


@pytest.mark.parametrize(
    ("order", "packed"),
    [
        ([0, 1], "3 features"),
        ([0, 0, 1], "once"),
        ([0, 1, 3], "once"),
        ([-1, 0, 1], "once"),
        ([0.0, 1.0, 2.0], "once"),
        ([1, 2, 0], "swap pairs"),
    ],
)
def test_an_order_that_is_no_mirror_is_refused(order, packed):
    with pytest.raises(InvalidInput, match=packed):
        mirror(template_of(np.zeros((1, 3))), order)


@pytest.mark.parametrize(
    "clone", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]
)
def test_templates_travel_between_processes(clone):
    template = template_of([[0.0, 0.5, 1.0]])
    quantised = quantise(template, tolerance=0.1)
    for original in (template, quantised):
        travelled = clone(original)
        for part in dataclasses.fields(original):
            assert np.array_equal(getattr(travelled, part.name), getattr(original, part.name))
