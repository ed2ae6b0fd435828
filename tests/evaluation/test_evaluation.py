"""Do the measures give what their papers print, and sense at their edges?"""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from motionary import evaluation
from motionary.errors import InvalidInput
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
    pair_segments,
    pool_counts,
    rename_segments,
    score_classification,
    summarize_rankings,
    to_segments,
)
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording

NAN = math.nan


def rates(counts):
    return compute_rates(pool_counts(counts.values()))


def inclusive(name, first, last):
    """A segment of frames first to last, both counted, as the papers write them."""
    return LabelledSegment(name, first, last + 1)


# Thesis (2012), Figure 5.3 and eqs 5.13-5.16. The text gives class1 and the totals; the
# other rows of the figure are ours, chosen so that every printed total holds.
FIGURE_TRUTH = [inclusive("class1", 2, 4), inclusive("class1", 8, 10), inclusive("class2", 4, 7)]
FIGURE_PREDICTED = [
    inclusive("class1", 1, 3),
    inclusive("class1", 6, 7),
    inclusive("class2", 3, 8),
    inclusive("class3", 9, 10),
]


def test_worked_example_of_the_thesis_frames():
    counts = pool_counts(count_frames(FIGURE_PREDICTED, FIGURE_TRUTH, rate_hz=1).values())
    assert counts == (6, 13, 6, 10)
    assert compute_rates(counts)[:2] == (6 / 13, 6 / 10)


def test_worked_example_of_the_thesis_segments():
    counts = pool_counts(count_overlaps(FIGURE_PREDICTED, FIGURE_TRUTH).values())
    assert counts == (2, 4, 2, 3)
    assert compute_rates(counts)[:2] == (2 / 4, 2 / 3)


def test_worked_example_of_the_thesis_by_class():
    assert count_frames(FIGURE_PREDICTED, FIGURE_TRUTH, rate_hz=1) == {
        "class1": (2, 5, 2, 6),
        "class2": (4, 6, 4, 4),
        "class3": (0, 2, 0, 0),
    }


def test_worked_example_of_the_thesis_through_evaluate():
    scores = evaluate({"a": FIGURE_PREDICTED}, {"a": FIGURE_TRUTH}, rate_hz=1)
    assert scores.concatenated.frames[:2] == (6 / 13, 6 / 10)
    assert scores.concatenated.segments[:2] == (2 / 4, 2 / 3)
    assert scores.recordings["a"] == scores.concatenated
    assert scores.classes["class3"].false_per_minute == 1 / (11 / 60)


# The edges of every measure are one test; a new measure joins the list.
# Of two tables: both empty, equal, nothing predicted, nothing true.
TRUTH = [
    LabelledSegment("walk", 0, 2),
    LabelledSegment("kick", 1.5, 3),
    LabelledSegment("walk", 4, 5),
]
TABLE_MEASURES = {
    "P1": (lambda p, t: rates(count_frames(p, t)).precision, 1, 1, 0, 0),
    "R1": (lambda p, t: rates(count_frames(p, t)).recall, 1, 1, 0, 0),
    "F1": (lambda p, t: rates(count_frames(p, t)).f, 1, 1, 0, 0),
    "P2": (lambda p, t: rates(count_overlaps(p, t)).precision, 1, 1, 0, 0),
    "R2": (lambda p, t: rates(count_overlaps(p, t)).recall, 1, 1, 0, 0),
    "F2": (lambda p, t: rates(count_overlaps(p, t)).f, 1, 1, 0, 0),
    "F at IoU 1": (lambda p, t: rates(count_matches(p, t, iou=1)).f, 1, 1, 0, 0),
    "edit score": (compute_edit_score, 1, 1, 0, 0),
    "edit distance": (compute_edit_distance, 0, 0, 3, 3),
    "edits": (lambda p, t: count_edits(p, t, tolerance=0), 0, 0, 3, 3),
    "false": (count_false, 0, 0, 0, 3),
    "pairs": (lambda p, t: len(pair_segments(p, t)), 0, 3, 0, 0),
    "boundary": (
        lambda p, t: compute_boundary_error(compute_boundary_offsets(p, t)).mean,
        *(NAN, 0, NAN, NAN),
    ),
    "confusion": (lambda p, t: confuse_frames(p, t).matrix.trace(), 0, 165, 30, 30),
    "mAP": (lambda p, t: compute_mean_average_precision([p], [t])[-1], NAN, 1, 0, NAN),
    "AP": (
        lambda p, t: compute_average_precisions([p], [t]).get("kick", [NAN])[0],
        *(NAN, 1, 0, NAN),
    ),
    "evaluate": (lambda p, t: evaluate({"a": p}, {"a": t}).mean.frames.f, 1, 1, 0, 0),
}
MALFORMED = {
    "ends before it starts": LabelledSegment("walk", 2, 1),
    "no length": LabelledSegment("walk", 1, 1),
    "no name": LabelledSegment("", 0, 1),
    "name of no text": LabelledSegment(3, 0, 1),
    "NaN": LabelledSegment("walk", NAN, 1),
    "without end": LabelledSegment("walk", 0, math.inf),
    "text for a time": LabelledSegment("walk", "0", 1),
    "NaN cost": LabelledSegment("walk", 0, 1, NAN),
    "no segment": ("walk", 0, 1),
}


@pytest.mark.parametrize("measure", TABLE_MEASURES)
def test_edges_of_measures_of_tables(measure):
    compute, empty, perfect, unclaimed, untrue = TABLE_MEASURES[measure]
    assert compute([], []) == pytest.approx(empty, nan_ok=True)
    assert compute(TRUTH, TRUTH) == pytest.approx(perfect, nan_ok=True)
    assert compute([], TRUTH) == pytest.approx(unclaimed, nan_ok=True)
    assert compute(TRUTH, []) == pytest.approx(untrue, nan_ok=True)


@pytest.mark.parametrize("broken", MALFORMED)
@pytest.mark.parametrize("measure", TABLE_MEASURES)
def test_malformed_tables_are_refused_by_measures(measure, broken):
    compute = TABLE_MEASURES[measure][0]
    for tables in ([MALFORMED[broken]], TRUTH), (TRUTH, [*TRUTH, MALFORMED[broken]]):
        with pytest.raises(InvalidInput, match=r"segment \d|label \d"):
            compute(*tables)


# Of a ranking: no items, perfect, nothing retrieved, nothing relevant.
RANKING_MEASURES = {
    "AP": (compute_average_precision, NAN, 1, 0, NAN),
    "R-precision": (compute_r_precision, NAN, 1, 0, NAN),
    "mAP": (lambda c, r: summarize_rankings([(c, r)]).average_precision, NAN, 1, 0, NAN),
    "mean R-precision": (lambda c, r: summarize_rankings([(c, r)]).r_precision, NAN, 1, 0, NAN),
    "precision at": (lambda c, r: compute_rates_at(c, r, threshold=0.5).precision, 1, 1, 0, 0),
    "recall at": (lambda c, r: compute_rates_at(c, r, threshold=0.5).recall, 1, 1, 0, 0),
}


@pytest.mark.parametrize("measure", RANKING_MEASURES)
def test_edges_of_measures_of_rankings(measure):
    compute, empty, perfect, unretrieved, irrelevant = RANKING_MEASURES[measure]
    assert compute([], []) == pytest.approx(empty, nan_ok=True)
    assert compute([0.9, 0.1, 0.2], [False, True, True]) == perfect
    assert compute([math.inf] * 2, [False, True]) == unretrieved
    assert compute([0.1, 0.2], [False, False]) == pytest.approx(irrelevant, nan_ok=True)
    for costs, relevant in (
        ([0.1, NAN], [True, False]),
        ([0.1], [True, False]),
        ([[0.1]], [[True]]),
        ([0.1, 0.2], [1, 0]),
    ):
        with pytest.raises(InvalidInput):
            compute(costs, relevant)


def test_edges_of_classification():
    names = ["jump", "kick"]
    empty = score_classification(np.zeros((0, 2)), [], names=names)
    assert math.isnan(empty.accuracy)
    assert empty.confusion.matrix.sum() == 0
    assert score_classification([[0, 1], [1, 0]], names, names=names).accuracy == 1
    for costs, truth in (
        ([[0, 1]], ["walk"]),
        ([[0, NAN]], ["jump"]),
        ([[0, 1, 2]], ["jump"]),
        ([[0, 1]], ["jump", "kick"]),
    ):
        with pytest.raises(InvalidInput):
            score_classification(costs, truth, names=names)
    with pytest.raises(InvalidInput, match="once"):
        score_classification([[0, 1]], ["jump"], names=["jump", "jump"])


def test_edges_of_intervals():
    assert interval({"bd": [1, 1], "bk": [1]}, seed=0) == (1, 1, 1, 2)
    for values in ({}, {"bd": [1]}, {"bd": [1], "bk": [NAN]}, {"bd": [1], "bk": [math.inf]}):
        with pytest.raises(InvalidInput):
            interval(values, seed=0)
    for level in (0, 1, NAN):
        with pytest.raises(InvalidInput, match="level"):
            interval({"bd": [1], "bk": [2]}, seed=0, level=level)


def test_every_measure_is_in_the_tables_above():
    named = set(evaluation.__all__)
    measures = {n for n in named if n[0].islower()} - {"rename_segments", "to_segments"}
    assert measures <= set(globals())
    assert sorted(evaluation.__all__) == evaluation.__all__


@pytest.mark.parametrize(
    "call",
    [
        lambda: count_frames(TRUTH, TRUTH, rate_hz=0),
        lambda: confuse_frames(TRUTH, TRUTH, rate_hz=NAN),
        lambda: confuse_frames(TRUTH, TRUTH, names=("walk",)),
        lambda: confuse_frames(TRUTH, TRUTH, names=("walk", "kick", "kick")),
        lambda: count_matches(TRUTH, TRUTH, iou=0),
        lambda: pair_segments(TRUTH, TRUTH, iou=1.1),
        lambda: count_edits(TRUTH, TRUTH, tolerance=-1),
        lambda: compute_average_precisions([TRUTH], [TRUTH, TRUTH]),
        lambda: compute_average_precisions([TRUTH], [TRUTH], ious=[0.5, 2]),
        lambda: compute_rates_at([0.1], [True], threshold=NAN),
    ],
)
def test_settings_out_of_range_are_refused(call):
    with pytest.raises(InvalidInput, match=r"got|missing"):
        call()


def test_a_frame_bears_a_label_if_its_centre_lies_within():
    counts = count_frames(
        [LabelledSegment("walk", 0.5, 2.5)], [LabelledSegment("walk", 0.6, 2.6)], rate_hz=1
    )
    assert counts["walk"] == (1, 2, 1, 2)  # frames 0, 1 against 1, 2


def test_float_noise_moves_no_frame():
    noisy = sum([0.1] * 3)  # 0.30000000000000004
    counts = count_frames(
        [LabelledSegment("walk", noisy, 1)], [LabelledSegment("walk", 0.3, 1)], rate_hz=5
    )
    assert counts["walk"] == (4, 4, 4, 4)


def test_touching_is_not_overlapping():
    assert (
        count_false([LabelledSegment("walk", 0, 1)], [LabelledSegment("walk", 1 - 1e-12, 2)]) == 1
    )


def test_a_segment_in_pieces_counts_once():
    truth = [LabelledSegment("walk", 0, 10)]
    pieces = [LabelledSegment("walk", 0, 5), LabelledSegment("walk", 5, 10)]
    assert count_overlaps(pieces, truth)["walk"] == (2, 2, 1, 1)
    assert count_matches(pieces, truth, iou=0.5)["walk"] == (1, 2, 1, 1)
    assert count_edits(pieces, truth) == 2


def test_equal_overlaps_go_to_the_earlier_segment():
    truth = [LabelledSegment("walk", 0, 2), LabelledSegment("walk", 2, 4)]
    between = LabelledSegment("walk", 1, 3, 0.1)
    predicted = [between, LabelledSegment("walk", 0, 2, 0.2)]
    for table in truth, truth[::-1]:
        assert count_matches(predicted, table, iou=0.25)["walk"].correct == 1
        assert compute_mean_average_precision([predicted], [table], ious=[0.25]) == [0.5]
        np.testing.assert_array_equal(compute_boundary_offsets([between], table), [[1, 1]])


@pytest.mark.parametrize(
    ("predicted", "edits"),
    [
        ([LabelledSegment("walk", 0.2, 4.8), LabelledSegment("kick", 6, 7)], 0),
        ([LabelledSegment("walk", 0.5, 5), LabelledSegment("kick", 6, 7)], 1),
        ([LabelledSegment("walk", 0, 5), LabelledSegment("jump", 6, 7)], 1),
        ([LabelledSegment("walk", 0, 5)], 1),
        (
            [
                LabelledSegment("walk", 0, 5),
                LabelledSegment("kick", 6, 7),
                LabelledSegment("kick", 6, 7),
            ],
            1,
        ),
        ([LabelledSegment("jump", 0.5, 5), LabelledSegment("kick", 6, 7)], 2),
        ([LabelledSegment("jump", 1, 4), LabelledSegment("kick", 6, 7)], 2),
    ],
)
def test_edits_to_a_correct_labelling(predicted, edits):
    assert (
        count_edits(predicted, [LabelledSegment("walk", 0, 5), LabelledSegment("kick", 6, 7)])
        == edits
    )


def test_boundary_offsets_tell_late_from_early():
    offsets = compute_boundary_offsets(
        [LabelledSegment("walk", 1, 4)], [LabelledSegment("walk", 2, 3)]
    )
    np.testing.assert_array_equal(offsets, [[-1, 1]])
    assert compute_boundary_error(offsets) == (1, 1, 1)


def test_a_second_detection_of_one_segment_is_false():
    truth = [[LabelledSegment("walk", 0, 10), LabelledSegment("walk", 20, 30)]]
    found = [
        [
            LabelledSegment("walk", 0, 10, 0.1),
            LabelledSegment("walk", 1, 10, 0.2),
            LabelledSegment("walk", 20, 30, 0.3),
        ]
    ]
    # Precision 1 at the first, 2/3 at the third.
    assert compute_mean_average_precision(found, truth, ious=[0.5]) == [
        pytest.approx((1 + 2 / 3) / 2)
    ]


def test_a_detection_in_another_recording_is_false():
    here, there = [LabelledSegment("walk", 0, 10, 0.1)], [LabelledSegment("walk", 0, 10, 0.2)]
    values = compute_mean_average_precision([here, there], [[], there], ious=[0.5])
    assert values == [0.5]


def test_classes_without_truth_leave_the_mean_alone():
    truth = [LabelledSegment("walk", 0, 10)]
    with_false = [*truth, LabelledSegment("kick", 0, 10, 0.0)]
    assert compute_mean_average_precision([with_false], [truth], ious=[0.5]) == [1]
    assert np.isnan(compute_average_precisions([with_false], [truth])["kick"]).all()


def test_ties_go_against_the_answer_and_the_infinite_is_not_found():
    assert compute_average_precision([0.1, 0.1, math.inf], [True, False, True]) == 0.25
    assert compute_r_precision([0.1, 0.1, math.inf], [True, False, True]) == 0.5
    assert compute_rates_at([0.1, math.inf], [True, True], threshold=math.inf) == (1, 0.5, 2 / 3)


def test_queries_without_relevant_items_leave_the_mean_alone():
    rankings = [([0.1, 0.2], [False, True]), ([0.1], [False]), ([0.1], [True])]
    assert summarize_rankings(rankings) == (0.75, 0.5, 2)


def test_classification_knows_no_answer_and_breaks_ties_early():
    costs = [[0.2, 0.2], [math.inf, math.inf], [0.3, 0.1]]
    result = score_classification(costs, ["jump", "jump", "jump"], names=["jump", "kick"])
    assert result.accuracy == pytest.approx(1 / 3)
    np.testing.assert_array_equal(result.confusion.matrix, [[1, 1, 1], [0, 0, 0], [0, 0, 0]])


def test_confusion_of_single_labels_counts_each_frame_once():
    predicted = [LabelledSegment("walk", 0, 4), LabelledSegment("kick", 4, 6)]
    truth = [LabelledSegment("walk", 0, 3), LabelledSegment("jump", 3, 5)]
    confusion = confuse_frames(predicted, truth, rate_hz=1, duration=8)
    assert confusion.names == ("jump", "kick", "walk")
    expected = [[0, 1, 1, 0], [0, 0, 0, 0], [0, 0, 3, 0], [0, 1, 0, 2]]
    np.testing.assert_array_equal(confusion.matrix, expected)


def test_renamed_segments_keep_their_times():
    renamed = rename_segments(
        [LabelledSegment("squat", 0, 1, 0.2), LabelledSegment("walk", 1, 2)], {"squat": "exercise"}
    )
    assert renamed == [LabelledSegment("exercise", 0, 1, 0.2), LabelledSegment("walk", 1, 2)]


def test_evaluate_takes_tracks_and_their_durations():
    take = Recording("86_01", rate_hz=30.0, n_frames=1800)
    track = LabelTrack(take, (Label("walk", 0, 5, cost=0.04),))
    truth = LabelTrack(take, (Label("walk", 30, 35),))
    scores = evaluate([("86_01", track)], {"86_01": truth})
    assert scores.concatenated.minutes == 1
    assert scores.concatenated.false_per_minute == 1
    assert scores.concatenated.edits_per_minute == 2
    assert scores.confusion.matrix.sum() == 1800
    assert (
        evaluate([("86_01", track)], {"86_01": truth}, durations_s={"86_01": 120}).mean.minutes == 2
    )


def test_evaluate_concatenates_and_takes_means():
    predicted = {
        "a": [LabelledSegment("walk", 0, 3)],
        "b": [LabelledSegment("walk", 0, 1)],
        "c": [],
    }
    truth = {"a": [LabelledSegment("walk", 0, 1)], "b": [LabelledSegment("walk", 0, 1)], "c": []}
    scores = evaluate(predicted, truth, rate_hz=1)
    assert scores.concatenated.frames.precision == 2 / 4
    assert scores.mean.frames.precision == pytest.approx((1 / 3 + 1 + 1) / 3)
    assert scores.mean.mean_average_precision[0.5] == 0.5  # "c" has nothing to find
    assert scores.mean.boundary.matched == 2


def test_evaluate_pools_edit_scores_by_recording():
    walk, kick = LabelledSegment("walk", 0, 1), LabelledSegment("kick", 1, 2)
    scores = evaluate({"a": [walk], "b": [walk, kick]}, {"a": [kick], "b": [walk, kick]})
    assert scores.recordings["a"].edit_score == 0
    assert scores.concatenated.edit_score == pytest.approx(2 / 3)
    assert scores.mean.edit_score == 0.5


def test_labels_of_another_recording_are_refused_by_name():
    predicted, truth = {"86_01": [], "01_01": []}, {"86_01": [], "49_08": []}
    with pytest.raises(InvalidInput, match=r"only in the prediction: 01_01.*truth: 49_08"):
        evaluate(predicted, truth)
    skipped = evaluate(predicted, truth, missing="skip")
    assert list(skipped.recordings) == ["86_01"]
    assert skipped.skipped == ("01_01", "49_08")
    assert list(evaluate(predicted, truth, missing="empty").recordings) == [
        "01_01",
        "49_08",
        "86_01",
    ]


@pytest.mark.parametrize(
    ("call", "packed"),
    [
        (lambda: evaluate({}, {}), "no recording"),
        (lambda: evaluate({"a": []}, {"b": []}, missing="skip"), "in the truth: b"),
        (lambda: evaluate({"a": []}, {"a": []}, missing="ignore"), "missing must be"),
        (lambda: evaluate([("a", []), ("a", [])], {"a": []}), "comes twice"),
        (
            lambda: evaluate([Label("walk", 0, 1)], {"a": []}),
            "mapping",
        ),
        (lambda: evaluate({"a": [("walk", 0, 1)]}, {"a": []}), "prediction of a: expected name"),
        (lambda: evaluate({"a": []}, {"a": [Label("walk", 1, 1)]}), "truth of a: 'walk' must end"),
        (lambda: evaluate({"a": []}, {"a": []}, durations_s={"a": -1}), "duration of a"),
        (lambda: evaluate({"a": []}, {"a": []}, classes="walk"), "list of names"),
        (lambda: evaluate({str(i): [] for i in range(9)}, {}), "and 4 more"),
    ],
)
def test_evaluate_says_what_is_wrong(call, packed):
    with pytest.raises(InvalidInput, match=packed):
        call()


def test_evaluate_can_leave_out_classes_that_were_never_taught():
    predicted = {"a": [LabelledSegment("walk", 0, 2)]}
    truth = {"a": [LabelledSegment("walk", 0, 2), LabelledSegment("turn", 0, 2)]}
    assert evaluate(predicted, truth).concatenated.frames.recall == 0.5
    assert evaluate(predicted, truth, classes=["walk"]).concatenated.frames.recall == 1


def test_scores_are_json_and_know_no_nan():
    scores = evaluate({"a": []}, {"a": []})
    text = json.dumps(scores.as_dict(), allow_nan=False)
    assert json.loads(text)["concatenated"]["boundary_s"] == {
        "median": None,
        "mean": None,
        "matched": 0,
    }
    full = evaluate({"a": TRUTH}, {"a": TRUTH}).as_dict()
    assert json.loads(json.dumps(full, allow_nan=False))["mean"]["segment_f"]["0.25"] == 1
    assert list(full["classes"]) == ["kick", "walk"]


def test_anything_with_name_and_times_is_a_label():
    row = SimpleNamespace(name="walk", start_s=0, end_s=1)
    assert to_segments([row], where="the table") == [LabelledSegment("walk", 0, 1)]
