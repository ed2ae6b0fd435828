"""Do rotations mean the same in all their forms?"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from motionary.errors import InvalidInput
from motionary.rotations import (
    conjugate_quaternions,
    euler_to_quaternions,
    matrices_to_quaternions,
    multiply_quaternions,
    quaternions_to_euler,
    quaternions_to_matrices,
    rotate,
    rotation_vectors_to_quaternions,
    slerp,
    unit_vectors,
)
from oracles import kinematics as oracle

orders = st.text("XYZ", min_size=0, max_size=4)


@given(orders, st.integers(0, 2**32 - 1))
def test_euler_angles_turn_about_moving_axes(order, seed):
    angles = np.random.default_rng(seed).uniform(-400, 400, (3, len(order)))
    matrices = quaternions_to_matrices(euler_to_quaternions(np.radians(angles), order))
    for row, matrix in zip(angles, matrices, strict=True):
        np.testing.assert_allclose(matrix, oracle.about_moving_axes(order, row), atol=1e-12)
        reverse = oracle.about_fixed_axes(order[::-1], row[::-1])
        np.testing.assert_allclose(matrix, reverse, atol=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_matrices_and_quaternions_are_inverse(seed):
    rng = np.random.default_rng(seed)
    quaternions = rng.normal(size=(2, 5, 4))
    quaternions /= np.linalg.norm(quaternions, axis=-1, keepdims=True)
    quaternions[quaternions[..., 0] < 0] *= -1
    matrices = quaternions_to_matrices(quaternions)
    assert matrices.shape == (2, 5, 3, 3)
    np.testing.assert_allclose(np.linalg.det(matrices), 1, atol=1e-12)
    np.testing.assert_allclose(matrices_to_quaternions(matrices), quaternions, atol=1e-9)


@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize("degrees", [0.0, 1e-9, 90.0, 179.9999999, 180.0, -180.0, 270.0])
def test_half_turns_survive(axis, degrees):
    matrix = oracle.turn(axis, degrees)
    quaternion = matrices_to_quaternions(matrix)
    assert quaternion[0] >= 0
    np.testing.assert_allclose(quaternions_to_matrices(quaternion), matrix, atol=1e-12)


def test_products_of_quaternions_are_products_of_matrices():
    rng = np.random.default_rng(3)
    left, right = (euler_to_quaternions(rng.uniform(-3, 3, (6, 3)), "ZXY") for _ in range(2))
    both = quaternions_to_matrices(multiply_quaternions(left, right))
    np.testing.assert_allclose(
        both, quaternions_to_matrices(left) @ quaternions_to_matrices(right), atol=1e-12
    )
    nothing = multiply_quaternions(left, conjugate_quaternions(left))
    np.testing.assert_allclose(nothing, np.tile([1.0, 0, 0, 0], (6, 1)), atol=1e-12)


def test_unit_vectors_have_length_one_and_nothing_has_no_direction():
    vectors = unit_vectors([[3.0, 0.0, 4.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(vectors[0], [0.6, 0.0, 0.8])
    assert np.isnan(vectors[1]).all()


@pytest.mark.parametrize(("order", "n"), [("XYW", 3), ("XYZ", 2), ("X", 0)])
def test_wrong_orders_are_refused(order, n):
    with pytest.raises(InvalidInput, match=r"order|angles"):
        euler_to_quaternions(np.zeros((2, n)), order)


def test_rotation_vectors_become_quaternions():
    vectors = np.random.default_rng(5).normal(scale=2, size=(50, 3))
    vectors[0], vectors[1] = 0, 1e-12
    expected = Rotation.from_rotvec(vectors).as_matrix()
    got = quaternions_to_matrices(rotation_vectors_to_quaternions(vectors))
    np.testing.assert_allclose(got, expected, atol=1e-12)


@pytest.mark.parametrize("degrees", [0.0, 1e-5, 3.0, 170.0, 179.999])
def test_arcs_are_those_of_scipy(degrees):
    first = Rotation.from_rotvec([0.3, -0.2, 0.9])
    second = first * Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0.0, 0.8]))
    share = np.linspace(0, 1, 7)[:, None]
    before, after = (np.tile(one.as_quat(), (7, 1)) for one in (first, second))
    expected = Slerp([0, 1], Rotation.concatenate([first, second]))(share[:, 0])
    for sign in (1, -1):
        away = Rotation.from_quat(slerp(before, sign * after, share)) * expected.inv()
        assert away.magnitude().max() < 1e-9


@pytest.mark.parametrize("order", ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])
def test_angles_come_back_from_quaternions(order):
    angles = np.random.default_rng(6).uniform(-np.pi, np.pi, (200, 3))
    # Where the middle turn is a right angle, the other two are one turn.
    angles[:20, 1] = np.repeat([np.pi / 2, -np.pi / 2], 10)
    quaternions = euler_to_quaternions(angles, order)
    again = quaternions_to_euler(quaternions, order)
    assert np.abs(again[:, 1]).max() <= np.pi / 2 + 1e-9
    same = np.abs((euler_to_quaternions(again, order) * quaternions).sum(axis=1))
    np.testing.assert_allclose(same, 1, atol=1e-9)


def test_angles_need_three_different_axes():
    with pytest.raises(InvalidInput, match="three different letters"):
        quaternions_to_euler(np.array([1.0, 0, 0, 0]), "XYX")


def test_rotating_equals_the_matrix():
    rng = np.random.default_rng(7)
    quaternions = unit_vectors_of_four(rng.normal(size=(30, 4)))
    vectors = rng.normal(size=(30, 3))
    expected = np.einsum("fij,fj->fi", quaternions_to_matrices(quaternions), vectors)
    np.testing.assert_allclose(rotate(quaternions, vectors), expected, atol=1e-12)


def unit_vectors_of_four(quaternions):
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
