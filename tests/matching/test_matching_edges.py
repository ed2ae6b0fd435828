"""What the matcher refuses, and what it answers at the edges."""

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.matching import (
    MatchState,
    Pattern,
    align,
    concatenate,
    corpus_distance,
    distance_function,
    feature_prior,
    find_hits,
    local_minima,
    self_information,
)
from motionary.packing import full_mask, pack

ONES = np.ones(2)
WORDS = pack(np.eye(2, 40))
FULL = full_mask(2, 40)
PATTERN = Pattern(WORDS, FULL, ONES)
LONG = pack(np.eye(9, 40))
DISTANCE = distance_function(PATTERN, LONG)
NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("values", "fixed", "weights", "entries", "message"),
    [
        (WORDS[:0], FULL[:0], ONES[:0], None, "at least one column"),
        (WORDS[:, :0], FULL[:, :0], ONES, None, "at least one column and integer"),
        (WORDS, FULL[:1], ONES, None, "one shape"),
        (WORDS[0], FULL[0], ONES, None, "one shape"),
        (np.eye(2), np.eye(2), ONES, None, "uint64"),
        (WORDS, FULL, ONES[:1], None, "positive weights"),
        (WORDS, FULL, ONES * 0, None, "positive weights"),
        (WORDS, FULL, -ONES, None, "positive weights"),
        (WORDS, FULL, ONES * NAN, None, "positive weights"),
        (WORDS, FULL, ONES * INF, None, "positive weights"),
        (WORDS, FULL, ONES, np.ones((3, 40)), "entry weights need shape"),
        (WORDS, FULL, ONES, np.ones((2, 65)), "entry weights need shape"),
        (WORDS, FULL, ONES, np.ones(2), "entry weights need shape"),
        (WORDS, FULL, ONES, -np.ones((2, 40)), "at least 0"),
        (WORDS, FULL, ONES, np.ones((2, 40)) * NAN, "finite"),
        (WORDS, FULL, ONES, np.ones((2, 40)) * INF, "finite"),
    ],
)
def test_patterns_that_mean_nothing_are_refused(values, fixed, weights, entries, message):
    with pytest.raises(InvalidInput, match=message):
        Pattern(values, fixed, weights, entries)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: distance_function(PATTERN, np.zeros((9, 2), np.uint64)), "one feature set"),
        (lambda: distance_function(PATTERN, LONG[:, 0]), "one feature set"),
        (lambda: distance_function(PATTERN, LONG, LONG[:3]), "known needs the shape"),
        (lambda: distance_function(PATTERN, LONG, skip_weight=-1), "skip_weight"),
        (lambda: distance_function(PATTERN, LONG, skip_weight=NAN), "skip_weight"),
        (lambda: distance_function(PATTERN, LONG, skip_weight=INF), "skip_weight"),
        (lambda: distance_function(PATTERN, LONG, state=MatchState(DISTANCE)), "its own state"),
        (lambda: align(PATTERN, np.zeros((9, 2), np.uint64), None, [3]), "one feature set"),
        (lambda: align(PATTERN, LONG, None, [3], skip_weight=NAN), "skip_weight"),
        (lambda: align(PATTERN, LONG, None, [9]), "frames of the sequence"),
        (lambda: align(PATTERN, LONG, None, [-1]), "frames of the sequence"),
        (lambda: align(PATTERN, LONG, None, [3, 0]), "no path of 2 columns ends at frame 0"),
        (lambda: local_minima(DISTANCE, threshold=NAN), "got NaN"),
        (lambda: find_hits(DISTANCE, PATTERN, LONG, threshold=NAN), "got NaN"),
        (lambda: find_hits(DISTANCE, PATTERN, LONG, threshold=1, limit=-1), "limit"),
        (lambda: find_hits(DISTANCE[1:], PATTERN, LONG, threshold=1), "8 frames"),
        (lambda: concatenate([], [], full=FULL[0]), "at least one sequence"),
        (lambda: concatenate([WORDS], [], full=FULL[0]), "a mask for each"),
        (lambda: concatenate([WORDS], [FULL[:1]], full=FULL[0]), "sequence 0"),
        (lambda: concatenate([WORDS, LONG[0]], [FULL, LONG[0]], full=FULL[0]), "sequence 1"),
        (lambda: concatenate([WORDS], [FULL], full=full_mask(1, 65)[0]), "sequence 0"),
    ],
)
def test_what_does_not_fit_is_refused(call, message):
    with pytest.raises(InvalidInput, match=message):
        call()


@pytest.mark.parametrize("engine", ["auto", "numpy", "compiled"])
def test_an_empty_document_has_no_frames_and_no_hits(engine):
    distance = distance_function(PATTERN, LONG[:0], engine=engine)
    assert (distance.shape, distance.dtype) == ((0,), np.float32)
    assert find_hits(distance, PATTERN, LONG[:0], threshold=1) == []
    assert align(PATTERN, LONG[:0], None, []) == []


@pytest.mark.parametrize("engine", ["auto", "numpy", "compiled"])
def test_empty_documents_in_a_corpus_stay_empty(engine):
    parts = [LONG[:0], LONG, LONG[:0], LONG[:0]]
    corpus = concatenate(parts, [np.full_like(p, FULL[0, 0]) for p in parts], full=FULL[0])
    split = corpus.split(corpus_distance(PATTERN, corpus, engine=engine))
    assert [len(part) for part in split] == [0, 9, 0, 0]
    np.testing.assert_array_equal(split[1], DISTANCE)


def test_a_recording_from_a_read_only_file_can_be_searched():
    frozen = LONG.copy()
    frozen.setflags(write=False)
    for engine in ("numpy", "compiled"):
        np.testing.assert_array_equal(distance_function(PATTERN, frozen, engine=engine), DISTANCE)


def test_frames_of_many_features_are_told_apart_by_all_of_them():
    rng = np.random.default_rng(7)
    packed = np.stack([rng.permutation(512).astype(np.uint64) for _ in range(8)], axis=1)
    other = packed.copy()
    other[:, 0] = np.roll(other[:, 0], 1)
    document = np.concatenate((packed, other))
    pattern = Pattern(packed[:1], np.full((1, 8), ~np.uint64(0)), np.ones(1))
    expected = np.bitwise_count(document ^ packed[0]).sum(axis=1) / 512
    np.testing.assert_allclose(distance_function(pattern, document), expected, rtol=1e-6)
    costs = [found.cost for found in align(pattern, document, None, range(len(document)))]
    np.testing.assert_allclose(costs, expected)


def test_rarity_counts_known_frames_of_documents_only():
    packed = pack([[1, 0, 1], [1, 0, 0], [1, 0, 0]])
    known = pack([[1, 1, 1], [1, 1, 0], [1, 1, 0]])
    corpus = concatenate([packed[:1], packed[1:]], [known[:1], known[1:]], full=full_mask(1, 3)[0])
    ones = feature_prior(corpus, 3)
    np.testing.assert_allclose(ones, [4 / 5, 1 / 5, 2 / 3])


def test_surprise_is_the_negative_logarithm_of_the_share_that_shows_the_value():
    ones = np.array([0.25, 0.25])
    weights = self_information(np.array([[True, False]]), ones)
    np.testing.assert_allclose(weights, [[np.log(4), np.log(4 / 3)]])
