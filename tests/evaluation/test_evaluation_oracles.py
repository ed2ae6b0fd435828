"""Do the measures equal their definitions, and keep what must hold?"""

import math
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.evaluation import (
    LabelledSegment,
    compute_average_precision,
    compute_average_precisions,
    compute_boundary_error,
    compute_boundary_offsets,
    compute_edit_distance,
    compute_edit_score,
    compute_mean_average_precision,
    compute_r_precision,
    compute_rates,
    compute_rates_at,
    confuse_frames,
    count_edits,
    count_false,
    count_frames,
    count_matches,
    count_overlaps,
    evaluate,
    interval,
    pool_counts,
    score_classification,
)
from oracles import measures as oracle

NAMES = ("jump", "kick", "walk")
COSTS = (0.0, 0.05, 0.1, 0.2, math.inf)
IOUS = (0.1, 0.25, 0.5, 0.7)
N_FRAMES = 40


def segments(max_size):
    """Tables on a grid of quarters, so that ends, overlaps and costs often coincide."""
    one = st.builds(
        lambda name, start, length, cost: LabelledSegment(
            name, start / 4, (start + length) / 4, cost
        ),
        st.sampled_from(NAMES),
        st.integers(0, 60),
        st.integers(1, 30),
        st.sampled_from(COSTS),
    )
    return st.lists(one, max_size=max_size)


documents = st.lists(st.tuples(segments(5), segments(5)), min_size=1, max_size=4)
rankings = st.lists(st.tuples(st.sampled_from(COSTS), st.booleans()), min_size=1, max_size=6)


def rates(counts):
    return compute_rates(pool_counts(counts.values()))


def shuffled(items, seed=0):
    return random.Random(seed).sample(items, len(items))


@given(segments(7), segments(7), st.sampled_from([1.0, 1.5]))
def test_frames_equal_their_definition(predicted, truth, rate):
    expected = oracle.frame_rates(predicted, truth, rate, N_FRAMES)
    assert rates(count_frames(predicted, truth, rate_hz=rate)) == pytest.approx(expected)


@given(segments(6), segments(6), st.integers(0, N_FRAMES))
def test_confusion_equals_its_definition(predicted, truth, duration):
    got = confuse_frames(predicted, truth, rate_hz=1, duration=duration, names=NAMES)
    last = max((s.end for s in (*predicted, *truth)), default=0)
    n_frames = max(duration, math.ceil(last - 0.5))
    expected = oracle.confusion(predicted, truth, 1, n_frames, NAMES)
    rows = [*NAMES, None]
    np.testing.assert_array_equal(got.matrix, [[expected[t, p] for p in rows] for t in rows])


@given(segments(7), segments(7))
def test_segments_equal_their_definition(predicted, truth):
    expected = oracle.segment_rates(predicted, truth)
    assert rates(count_overlaps(predicted, truth)) == pytest.approx(expected)


@given(segments(7), segments(7), st.sampled_from(IOUS))
def test_segment_f_equals_its_definition(predicted, truth, iou):
    expected = oracle.segment_f(predicted, truth, iou)
    assert rates(count_matches(predicted, truth, iou=iou)).f == pytest.approx(expected)


@given(segments(5), segments(5))
def test_edit_distance_equals_its_definition(predicted, truth):
    expected = oracle.levenshtein(oracle.order(predicted), oracle.order(truth))
    assert compute_edit_distance(predicted, truth) == expected
    longest = max(len(predicted), len(truth), 1)
    assert compute_edit_score(predicted, truth) == pytest.approx(1 - expected / longest)


@given(segments(5), segments(5), st.sampled_from([0.0, 0.25, 1.0]))
def test_edits_equal_the_cheapest_of_all_corrections(predicted, truth, tolerance):
    expected = oracle.edits(predicted, truth, tolerance)
    assert count_edits(predicted, truth, tolerance=tolerance) == expected


@given(segments(6), segments(6), st.sampled_from(IOUS))
def test_boundary_error_equals_its_definition(predicted, truth, iou):
    error = compute_boundary_error(compute_boundary_offsets(predicted, truth, iou=iou))
    expected = oracle.boundary_distances(predicted, truth, iou)
    assert error.matched == len(expected) / 2
    if expected:
        assert error[:2] == pytest.approx((np.median(expected), np.mean(expected)))


@given(documents)
def test_detection_equals_its_definition(pairs):
    predicted, truth = zip(*pairs, strict=True)
    by_class = compute_average_precisions(predicted, truth, ious=IOUS)
    for name, values in by_class.items():
        expected = [oracle.detection_average_precision(pairs, name, iou) for iou in IOUS]
        np.testing.assert_allclose(values, expected, rtol=1e-12)
    means = compute_mean_average_precision(predicted, truth, ious=IOUS)
    defined = [values for values in by_class.values() if not np.isnan(values[0])]
    expected = np.mean(defined, axis=0) if defined else [math.nan] * len(IOUS)
    np.testing.assert_allclose(means, expected, rtol=1e-12)


@given(rankings)
def test_rankings_equal_the_worst_order_that_the_costs_allow(items):
    costs, relevant = zip(*items, strict=True)
    if not any(relevant):
        assert math.isnan(compute_average_precision(costs, relevant))
        return
    assert compute_average_precision(costs, relevant) == pytest.approx(
        oracle.average_precision(costs, relevant)
    )
    assert compute_r_precision(costs, relevant) == pytest.approx(
        oracle.r_precision(costs, relevant)
    )


@given(rankings, st.sampled_from(COSTS))
def test_rates_at_a_threshold_equal_their_definition(items, threshold):
    retrieved = [r for c, r in items if c <= threshold and c < math.inf]
    right, relevant = sum(retrieved), sum(r for _, r in items)
    expected = oracle.rates(right, len(retrieved), right, relevant)
    costs, flags = zip(*items, strict=True)
    assert compute_rates_at(costs, flags, threshold=threshold) == pytest.approx(expected)


@given(st.lists(st.tuples(*[st.sampled_from(COSTS)] * 3, st.sampled_from(NAMES)), min_size=1))
def test_classification_equals_its_definition(clips):
    costs, truth = [clip[:3] for clip in clips], [clip[3] for clip in clips]
    result = score_classification(costs, truth, names=NAMES)
    chosen = [None if min(row) == math.inf else NAMES[row.index(min(row))] for row in costs]
    pairs = list(zip(truth, chosen, strict=True))
    assert result.accuracy == pytest.approx(sum(t == p for t, p in pairs) / len(pairs))
    rows = [*NAMES, None]
    expected = [[pairs.count((t, p)) for p in rows] for t in rows]
    np.testing.assert_array_equal(result.confusion.matrix, expected)


@given(segments(7), segments(7))
def test_swapping_the_tables_swaps_precision_and_recall(predicted, truth):
    for count in (count_frames, count_overlaps):
        there, back = rates(count(predicted, truth)), rates(count(truth, predicted))
        assert there[:2] == back[1::-1]
        assert there.f == pytest.approx(back.f)
    assert compute_edit_distance(predicted, truth) == compute_edit_distance(truth, predicted)
    assert count_edits(predicted, truth) == count_edits(truth, predicted)
    confusions = confuse_frames(predicted, truth), confuse_frames(truth, predicted)
    np.testing.assert_array_equal(confusions[0].matrix, confusions[1].matrix.T)


@given(segments(6).filter(bool))
def test_the_truth_itself_is_perfect(table):
    truth = sorted(set(segment._replace(cost=0.0) for segment in table))
    scores = evaluate({"a": truth}, {"a": truth}).concatenated
    assert scores.frames == scores.segments == (1, 1, 1)
    assert scores.edit_score == 1
    assert scores.boundary[:2] == (0, 0)
    assert scores.edits_per_minute == scores.false_per_minute == 0
    assert set(scores.mean_average_precision.values()) == {1}
    alone = [s for s in truth if sum(s.name == t.name for t in truth) == 1]
    assert rates(count_matches(alone, alone, iou=1)).f == 1


@given(segments(7), segments(7))
def test_bounds_hold(predicted, truth):
    scores = evaluate({"a": predicted}, {"a": truth}, durations_s={"a": 60})
    row = scores.concatenated
    fractions = [*row.frames, *row.segments, *row.segment_f.values(), row.edit_score]
    assert all(0 <= fraction <= 1 for fraction in fractions)
    assert all(math.isnan(v) or 0 <= v <= 1 for v in row.mean_average_precision.values())
    assert row.segment_f[0.1] >= row.segment_f[0.25] >= row.segment_f[0.5]
    total = len(predicted) + len(truth)
    assert abs(len(predicted) - len(truth)) <= count_edits(predicted, truth) <= total
    assert row.false_per_minute == count_false(predicted, truth) <= len(predicted)


@given(documents)
def test_the_order_of_recordings_and_labels_does_not_matter(pairs):
    predicted = {str(i): p for i, (p, _) in enumerate(pairs)}
    truth = {str(i): t for i, (_, t) in enumerate(pairs)}
    scores = evaluate(predicted, truth)
    turned = evaluate(
        [(name, shuffled(table)) for name, table in reversed(predicted.items())],
        [(name, shuffled(table, 1)) for name, table in shuffled(list(truth.items()))],
    )
    assert turned.as_dict() == scores.as_dict()


@given(documents)
def test_concatenated_counts_are_those_of_one_long_document(pairs):
    predicted, truth = {}, {}
    long_predicted, long_truth = [], []
    for i, (p, t) in enumerate(pairs):
        predicted[str(i)], truth[str(i)] = p, t
        for long, table in (long_predicted, p), (long_truth, t):
            long += [s._replace(start=s.start + 100 * i, end=s.end + 100 * i) for s in table]
    apart = evaluate(predicted, truth).concatenated
    joined = evaluate({"all": long_predicted}, {"all": long_truth}).concatenated
    assert joined.frames == apart.frames
    assert joined.segments == apart.segments
    assert joined.segment_f == apart.segment_f
    for iou, value in joined.mean_average_precision.items():
        assert apart.mean_average_precision[iou] == pytest.approx(value, nan_ok=True)


@given(segments(7), segments(7), st.integers(-20, 20), st.sampled_from([0.5, 2.0]))
def test_segments_do_not_depend_on_origin_and_unit(predicted, truth, shift, unit):
    moved = [
        [s._replace(start=unit * (s.start + shift), end=unit * (s.end + shift)) for s in table]
        for table in (predicted, truth)
    ]
    assert count_overlaps(*moved) == count_overlaps(predicted, truth)
    assert count_matches(*moved, iou=0.5) == count_matches(predicted, truth, iou=0.5)
    assert count_edits(*moved, tolerance=unit) == count_edits(predicted, truth, tolerance=1)


@given(documents)
def test_worse_costs_of_right_detections_never_help(pairs):
    truth = [t for _, t in pairs]
    sure = [[s._replace(cost=0.0) for s in t] for t in truth]
    false = [[s._replace(cost=0.1) for s in p] for p, _ in pairs]
    first = compute_mean_average_precision(
        [a + b for a, b in zip(sure, false, strict=True)], truth, ious=[0.7]
    )
    last = compute_mean_average_precision(
        [[s._replace(cost=0.2) for s in a] + b for a, b in zip(sure, false, strict=True)],
        truth,
        ious=[0.7],
    )
    assert math.isnan(first[0]) or last[0] <= first[0] <= 1


GROUPS = {"bd": [0.9, 0.8, 1.0], "bk": [0.4, 0.6], "dg": [0.7], "mm": [0.95, 0.85]}


def test_interval_equals_the_distribution_of_all_draws():
    got = interval(GROUPS, seed=3, level=0.9)
    means = oracle.bootstrap_means(GROUPS)
    assert got.mean == pytest.approx(
        np.mean([value for values in GROUPS.values() for value in values])
    )
    assert got.low == pytest.approx(np.quantile(means, 0.05), abs=0.02)
    assert got.high == pytest.approx(np.quantile(means, 0.95), abs=0.02)


def test_interval_is_repeatable_and_moves_with_its_values():
    got = interval(GROUPS, seed=3)
    assert got == interval(GROUPS, seed=3)
    assert got.low < got.mean < got.high
    doubled = interval({k: [2 * v + 1 for v in vs] for k, vs in GROUPS.items()}, seed=3)
    assert doubled[:3] == pytest.approx([2 * value + 1 for value in got[:3]])
    narrow = interval(GROUPS, seed=3, level=0.5)
    assert got.low < narrow.low < narrow.high < got.high


def test_interval_leaves_out_what_is_not_defined():
    assert interval({**GROUPS, "tr": [math.nan]}, seed=3) == interval(GROUPS, seed=3)
