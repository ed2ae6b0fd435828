"""Labels by scores on planted motions: where, how sure, why; and how many."""

from dataclasses import replace

import numpy as np
import pytest

import motionary as mo
from library_cases import made_class, perform, performances
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FULL_BODY_2006
from motionary.models.library import mirror_sequence
from motionary.retrieval.annotation import default_assignment
from packing_cases import sequence


def other_rows(seed, n_frames=60):
    rng = np.random.default_rng([seed, 5])
    return np.repeat(rng.random((n_frames // 6, 40)) < 0.3, 6, axis=0)


def shown(class_seed, seed=77):
    return perform(made_class(class_seed), [class_seed, seed]).features.astype(bool)


def recording(*parts):
    return sequence(np.concatenate(parts), feature_set=FULL_BODY, name="take")


@pytest.fixture(scope="module")
def library():
    examples = {"one": performances(1, 4), "two": performances(2, 4)}
    others = [recording(other_rows(seed, 900)) for seed in (11, 12)]
    return mo.learn(examples, mirror=True, negatives=others)


@pytest.fixture(scope="module")
def take():
    one = shown(1)
    flipped = one[:, FULL_BODY.mirror_order]
    return recording(other_rows(1), one, other_rows(2), shown(2), one, flipped, other_rows(3))


@pytest.fixture(scope="module")
def track(library, take):
    return mo.annotate(take, library, assignment="scores")


def test_planted_motions_are_labelled_with_their_sides(track):
    found = [(label.name, label.side) for label in track]
    assert found == [
        ("one", "as learned"), ("two", "as learned"), ("one", "as learned"), ("one", "mirrored"),
    ]  # fmt: skip
    assert all(label.score > 6 and label.known == 1 for label in track)
    assert all(label.probability is None for label in track)


def test_the_parts_of_the_features_sum_to_the_score(track):
    for label in track:
        why = mo.explain(label)
        assert why.score == pytest.approx(label.score, abs=1e-9)
        assert sum(gain.part for gain in why.gains) == pytest.approx(label.score, abs=1e-9)
        assert [gain.feature for gain in why.gains] == list(FULL_BODY.ids)
        assert f"score {label.score:.1f}, of it " in str(why)


def test_a_higher_score_means_fewer_false_labels(library, track):
    rates = {label.score: label.false_per_min for label in track if label.name == "one"}
    ordered = [rates[score] for score in sorted(rates)]
    assert ordered == sorted(ordered, reverse=True)


def test_a_threshold_no_label_reaches_says_what_was_nearest(library, take):
    track = mo.annotate(take, library, assignment="scores", threshold=90.0)
    assert len(track) == 0
    assert track.nearest.startswith("nothing of score 90; nearest: ")


def test_fewer_false_labels_are_asked_for_by_their_number(library, take):
    few, many = (
        {(x.name, x.start_s) for x in mo.annotate(take, library, at_most_false_per_min=n)}
        for n in (1e-3, 10.0)
    )
    assert len(few) <= len(many)
    assert many


def test_neighbours_of_a_state_are_one_label(library, take):
    first = replace(library["one"], kind="state")
    changed = replace(library, classes=(first, library["two"]))
    track = mo.annotate(take, changed, assignment="scores")
    assert [label.name for label in track] == ["one", "two", "one"]
    assert track.labels[2].end_s - track.labels[2].start_s > 2.0


def test_what_was_not_seen_is_no_label(library, take):
    blind = sequence(
        take.features.astype(bool), known=np.zeros(take.features.shape, dtype=bool),
        feature_set=FULL_BODY,
    )  # fmt: skip
    track = mo.annotate(blind, library, assignment="scores")
    assert len(track) == 0
    assert track.unassessed


def test_the_mirror_image_has_the_same_labels_on_the_other_side(library, take, track):
    image = mo.annotate(mirror_sequence(take), library, assignment="scores")
    assert [(x.name, x.start_s, x.end_s) for x in image] == [
        (x.name, x.start_s, x.end_s) for x in track
    ]
    assert all(a.side != b.side for a, b in zip(image, track, strict=True))


def test_counts_are_those_of_the_labels(track):
    rows = {(one.name, one.side): one for one in mo.count(track)}
    assert {key: one.number for key, one in rows.items()} == {
        ("one", "as learned"): 2, ("one", "mirrored"): 1, ("two", "as learned"): 1,
    }  # fmt: skip
    twice = rows["one", "as learned"]
    assert twice.per_min == pytest.approx(60 / (twice.starts_s[1] - twice.starts_s[0]))
    assert twice.total_s == pytest.approx(2 * twice.mean_s)
    assert rows["two", "as learned"].per_min is None
    assert mo.count([]) == []


# -- which way is taken ------------------------------------------------------------------


def test_scores_are_the_default_where_costs_were_not_chosen(library):
    assert default_assignment(library) == "scores"
    chosen = replace(library["one"], threshold=0.1)
    assert default_assignment(replace(library, classes=(chosen,))) == "published"
    assert default_assignment(replace(library, scoring=None)) == "published"


def test_a_library_without_scores_says_so():
    rows = np.random.default_rng(3).random((30, len(FULL_BODY_2006))) < 0.5
    one = sequence(rows, feature_set=FULL_BODY_2006)
    old = mo.learn({"one": [one]}, feature_set=FULL_BODY_2006)
    assert default_assignment(old) == "published"
    with pytest.raises(InvalidInput, match="assignment published"):
        mo.annotate(one, old, assignment="scores")


@pytest.mark.parametrize(
    "wrong",
    [
        {"assignment": "best"},
        {"assignment": "published", "at_most_false_per_min": 1.0},
        {"threshold": 7.0, "at_most_false_per_min": 1.0},
        {"at_most_false_per_min": 0.0},
    ],
)
def test_options_that_do_not_go_together_are_refused(library, take, wrong):
    with pytest.raises(InvalidInput):
        mo.annotate(take, library, **wrong)
