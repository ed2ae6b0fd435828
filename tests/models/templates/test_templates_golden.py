"""Are learned templates the authors' own?

`cartwheels.npz` is from the authors' published toolbox: four cartwheels of HDM05 (39
features) after one and after 32 passes, and the alignment behind the first average. Their
matrices are (features, columns).

`half_split.json` names the clips of eleven HDM05 classes that the authors trained on.
"""

import json

import numpy as np
import pytest

from motionary.features import FULL_BODY_2006
from motionary.models.templates import Learning, learn_template
from motionary.models.templates.alignment import align_batched, align_compiled
from motionary.models.templates.learning import Stack, learn_pass, unwarp
from oracles import learning as oracle

CONTRACT_AT = Learning().contract_at
EXAMPLES = (1, 2, 3, 4)


@pytest.fixture(scope="module")
def cartwheels(golden):
    with np.load(golden / "cartwheels.npz") as arrays:
        return dict(arrays)


def stack_of_pass(cartwheels, number):
    columns = [cartwheels[f"it{number}_template_{i}"].T for i in EXAMPLES]
    weights = [cartwheels[f"it{number}_weights_{i}"] for i in EXAMPLES]
    offsets = np.cumsum([0, *map(len, weights)])
    return Stack(np.concatenate(columns), np.concatenate(weights), offsets)


def test_the_average_of_the_warped_cartwheels(cartwheels):
    warped = [
        (cartwheels[f"warped_{i}"].T.astype(float), weights)
        for i, weights in zip(EXAMPLES, cartwheels["warped_weights"], strict=True)
    ]
    columns, weights = oracle.average(warped)
    assert np.allclose(np.transpose(columns), cartwheels["average"], rtol=0, atol=1e-15)
    assert np.allclose(weights, cartwheels["average_weights"], rtol=0, atol=1e-15)


def test_the_balanced_average_is_the_first_cartwheel_after_one_pass(cartwheels):
    weights = cartwheels["average_weights"]
    average = Stack(cartwheels["average"].T, weights, np.array([0, len(weights)]))
    found = unwarp(average, contract_at=CONTRACT_AT)
    assert np.allclose(found.columns.T, cartwheels["it1_template_1"], rtol=0, atol=1e-16)
    assert np.array_equal(found.weights, cartwheels["it1_weights_1"])


@pytest.mark.parametrize("engine", [align_batched, align_compiled])
def test_31_passes_lead_from_pass_1_to_pass_32(cartwheels, engine):
    stack = stack_of_pass(cartwheels, 1)
    for _ in range(31):
        stack, cost = learn_pass(stack, n_features=39, contract_at=CONTRACT_AT, engine=engine)
    wanted = stack_of_pass(cartwheels, 32)
    assert np.array_equal(stack.offsets, wanted.offsets)
    assert np.allclose(stack.columns, wanted.columns, rtol=0, atol=1e-12)
    assert np.allclose(stack.weights, wanted.weights, rtol=0, atol=1e-12)
    # Here they agree, and that is where the authors stopped.
    assert cost / stack.mean_weight <= Learning().stop


@pytest.fixture(scope="module")
def training_halves(hdm05, golden):
    """Matrices of the 39 features of 2006, by class."""
    split = json.loads((golden / "half_split.json").read_text())
    return {
        name: [hdm05[clip].features[:, : len(FULL_BODY_2006)] for clip in halves["train"]]
        for name, halves in split.items()
    }


# Number of columns, and the authors' own (their table). Repeatable with the cut clips; the
# authors took features from the uncut takes.
@pytest.mark.parametrize(
    ("name", "n_columns", "of_the_authors"),
    [
        ("depositFloorR", 74, 73),
        ("elbowToKnee1RepsLelbowStart", 38, 38),
        ("grabHighR", 68, 69),
        ("hopBothLegs1hops", 24, 24),
        ("jogLeftCircle4StepsRstart", 62, 63),
        ("kickLFront1Reps", 55, 55),
        ("lieDownFloor", 165, 170),
        ("rotateArmsBothBackward1Reps", 28, 29),
        ("sneak2StepsLStart", 58, 58),
        ("squat1Reps", 47, 47),
        ("throwBasketball", 95, 95),
    ],
)
def test_templates_of_the_training_halves_are_as_long(
    training_halves, name, n_columns, of_the_authors
):
    matrices = training_halves[name]
    template = learn_template(
        matrices,
        feature_names=FULL_BODY_2006.names,
        feature_set=FULL_BODY_2006.name,
    )
    assert template.n_columns == n_columns
    assert template.n_columns == pytest.approx(of_the_authors, rel=0.035)
    assert template.duration_s == pytest.approx(np.mean([len(m) for m in matrices]) / 30)


def test_both_engines_learn_the_same_from_recordings(training_halves):
    for matrices in training_halves.values():
        names = {"feature_names": FULL_BODY_2006.names, "feature_set": FULL_BODY_2006.name}
        by_numpy = learn_template(matrices, engine="numpy", **names)
        compiled = learn_template(matrices, engine="compiled", **names)
        assert by_numpy.values.tobytes() == compiled.values.tobytes()
        assert by_numpy.weights.tobytes() == compiled.weights.tobytes()
