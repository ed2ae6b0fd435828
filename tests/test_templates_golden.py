"""Are learned templates the authors' own?

`cartwheels.npz` is from the authors' published toolbox: four cartwheels of HDM05 (39
features) after one and after 32 passes, and the alignment behind the first average. Their
matrices are (features, columns).
"""

import numpy as np
import pytest

from motionary.templates import Learning
from motionary.templates.alignment import align_batched
from motionary.templates.averaging import Stack, unwarp
from motionary.templates.compiled import align_compiled
from motionary.templates.learning import learn_pass
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
