"""Packed features against whole numbers of any length."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput
from motionary.packing import (
    count,
    count_integers,
    from_numbers,
    full_mask,
    pack,
    permute,
    to_numbers,
    unpack,
)
from oracles import packing as oracle

SIZES = [1, 7, 8, 9, 40, 63, 64, 65, 127, 128, 129]


@st.composite
def features(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    shape = draw(st.integers(0, 9)), draw(st.sampled_from(SIZES))
    return rng.random(shape) < draw(st.sampled_from([0.1, 0.5, 1]))


@given(features())
def test_packed_features_are_the_whole_numbers_of_the_features(matrix):
    packed = pack(matrix)
    assert packed.dtype == np.uint64
    assert packed.shape == (len(matrix), count_integers(matrix.shape[1]))
    assert oracle.join(packed) == oracle.pack(matrix)


@given(features())
def test_packed_features_as_numbers_and_back(matrix):
    packed = pack(matrix)
    numbers = to_numbers(packed)
    assert list(numbers) == oracle.pack(matrix)
    np.testing.assert_array_equal(from_numbers(numbers, packed.shape[1]), packed)


@given(features())
def test_unpacking_returns_what_was_packed(matrix):
    back = unpack(pack(matrix), matrix.shape[1])
    assert back.dtype == np.bool_
    np.testing.assert_array_equal(back, matrix)


@given(features())
def test_packed_features_that_are_not_contiguous_unpack_alike(matrix):
    every_other = np.repeat(pack(matrix), 2, axis=0)[::2]
    np.testing.assert_array_equal(unpack(every_other, matrix.shape[1]), matrix)


@given(features())
def test_numbers_0_and_1_pack_like_truth_values(matrix):
    for dtype in (np.uint8, np.float64):
        np.testing.assert_array_equal(pack(matrix.astype(dtype)), pack(matrix))


@given(features())
def test_count_is_the_number_of_features_that_hold(matrix):
    np.testing.assert_array_equal(count(pack(matrix)), matrix.sum(axis=1))


@given(features(), st.randoms(use_true_random=False))
def test_permuted_packed_features_are_the_packed_features_of_permuted_features(matrix, random):
    order = np.array(random.sample(range(matrix.shape[1]), matrix.shape[1]), dtype=np.intp)
    np.testing.assert_array_equal(permute(pack(matrix), order), pack(matrix[:, order]))


@pytest.mark.parametrize("n", SIZES)
def test_full_mask_sets_every_relation_and_no_other_bit(n):
    mask = full_mask(3, n)
    assert oracle.join(mask) == [2**n - 1] * 3


@pytest.mark.parametrize(
    "features",
    [[[0, 2]], [[0.5, 1.0]], [[float("nan"), 1.0]], [[-1, 1]], [0, 1], 1, [[[1]]]],
    ids=["two", "half", "nan", "minus", "one axis", "scalar", "three axes"],
)
def test_what_is_no_matrix_of_features_is_refused(features):
    with pytest.raises(InvalidInput, match="features need"):
        pack(features)


@pytest.mark.parametrize("n", [64, 0, 129])
def test_packed_features_of_another_number_of_features_are_refused(n):
    with pytest.raises(InvalidInput, match=f"{n} features need"):
        unpack(pack(np.ones((2, 65))), n)
