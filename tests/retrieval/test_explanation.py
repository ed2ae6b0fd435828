"""Does an explanation name what held, what failed, and when, so that a person reads it?"""

import re

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, compute_features
from motionary.io import read_labels
from motionary.labels import Label
from motionary.matching import align
from motionary.models.library import TrainingOptions, learn
from motionary.models.templates import QuantisedTemplate, pattern_of
from motionary.retrieval.annotation import annotate
from motionary.retrieval.explanation import Evidence, Finding, describe_nearest, explain
from motionary.retrieval.search import QueryExpansion, search
from motionary.samples import synthetic_motion
from packing_cases import N, sequence

BIT = {feature.id: i for i, feature in enumerate(FULL_BODY.features)}
NAME = {feature.id: feature.name for feature in FULL_BODY.features}
NO = {feature.id: feature.phrase(False) for feature in FULL_BODY.features}


def evidence_of(asked, shown, *, n_columns=10, unknown=(), start=0, weights=None, **about):
    """A match along the diagonal, `asked` and `shown` as {id: (from, to)} or {id: bool}.

    What is asked for is fixed in all columns; what is shown holds from one column to another.
    """
    values = np.zeros((n_columns, N), dtype=np.bool_)
    fixed = np.zeros_like(values)
    for name, value in asked.items():
        fixed[:, BIT[name]] = True
        values[:, BIT[name]] = value
    rows = np.zeros((start + n_columns, N), dtype=np.bool_)
    known = np.ones_like(rows)
    for name, (first, stop) in shown.items():
        rows[start + first : start + stop, BIT[name]] = True
    for name in unknown:
        known[:, BIT[name]] = False
    template = QuantisedTemplate(values, fixed, np.ones(n_columns), FULL_BODY.ids, FULL_BODY.name)
    pattern = pattern_of(template, ones=weights)
    recording = sequence(rows, known, name="take", **about)
    alignment = align(pattern, recording.packed, recording.known, [start + n_columns - 1])[0]
    # Free of dead ends: the path is the diagonal, whatever its cost.
    path = np.column_stack([np.arange(n_columns), start + np.arange(n_columns)])
    return Evidence(
        "reach", template, pattern, recording, alignment._replace(path=path, start=start)
    )


def told(findings):
    return [(f.feature, round(30 * f.start_s), round(30 * f.end_s)) for f in findings]


# -- what held and what failed -----------------------------------------------------------


def test_what_held_and_what_failed_is_named_with_its_time():
    why = explain(evidence_of({"F3": True, "F20": True}, {"F3": (0, 10), "F20": (4, 10)}, start=30))
    assert told(why.held) == [("F3", 30, 40), ("F20", 34, 40)]
    assert told(why.failed) == [("F20", 30, 34)]
    assert why.unknown == ()
    assert why.fraction_held == 16 / 20
    assert (why.name, why.recording) == ("reach", "take")
    assert (why.start_s, why.end_s) == (1.0, 40 / 30)


def test_what_should_not_hold_has_a_phrase_of_its_own():
    why = explain(evidence_of({"F3": False, "F4": False}, {"F4": (2, 5)}))
    assert {f.phrase for f in (*why.held, *why.failed)} == {NO["F3"], NO["F4"]}
    assert told(why.failed) == [("F4", 2, 5)]
    assert told(why.held) == [("F3", 0, 10), ("F4", 0, 2), ("F4", 5, 10)]


def test_what_was_not_seen_neither_holds_nor_fails():
    why = explain(evidence_of({"F3": True, "F20": True}, {"F3": (0, 10)}, unknown=["F20"]))
    assert told(why.held) == [("F3", 0, 10)]
    assert why.failed == ()
    assert why.unknown == (NAME["F20"],)
    assert why.fraction_held == 1.0


def test_what_is_free_is_not_mentioned():
    why = explain(evidence_of({"F3": True}, {"F3": (0, 10), "F20": (0, 10)}))
    assert {f.feature for f in why.held} == {"F3"}
    assert why.failed == ()


def test_frames_that_a_path_leaves_out_are_within_the_time_that_is_told():
    evidence = evidence_of({"F3": True}, {"F3": (0, 10)})
    alignment = evidence.alignment
    path = np.array([(0, 0), (1, 2), (2, 4), (3, 6), (5, 7), (7, 8), (9, 9)])
    evidence = Evidence(
        "reach", evidence.template, evidence.pattern, evidence.sequence,
        alignment._replace(path=path),
    )  # fmt: skip
    assert told(explain(evidence).held) == [("F3", 0, 10)]


def test_times_end_with_the_recording():
    # 37 frames at 120 Hz are 10 words, the last of which is cut short.
    evidence = evidence_of({"F3": True}, {"F3": (0, 10)}, rate_hz=120.0, n_frames=37)
    why = explain(evidence)
    assert why.end_s == why.held[0].end_s == 37 / 120


@pytest.mark.parametrize("seed", range(5))
def test_findings_are_the_cells_of_the_path(seed):
    """Every cell that is asked for and seen is in one finding, and no other is."""
    rng = np.random.default_rng(seed)
    values, fixed = rng.random((2, 12, N)) < [[[0.5]], [[0.3]]]
    rows, known = rng.random((2, 30, N)) < [[[0.5]], [[0.8]]]
    template = QuantisedTemplate(values, fixed, np.ones(12), FULL_BODY.ids, FULL_BODY.name)
    pattern, recording = pattern_of(template), sequence(rows, known)
    (alignment,) = align(pattern, recording.packed, recording.known, [25])
    why = explain(Evidence("any", template, pattern, recording, alignment))
    cells = {
        (True, False): set(), (True, True): set(), (False, False): set(), (False, True): set(),
    }  # fmt: skip
    for column, frame in alignment.path.tolist():
        for i in np.flatnonzero(template.fixed[column] & known[frame]):
            value = bool(template.values[column, i])
            cells[bool(rows[frame, i]) == value, value].add((i, frame))
    for holds, findings in ((True, why.held), (False, why.failed)):
        for value in (True, False):
            frames_told = {
                (BIT[f.feature], frame)
                for f in findings
                if value == (f.phrase == NAME[f.feature])
                for frame in alignment.path[:, 1].tolist()
                if round(30 * f.start_s) <= frame < round(30 * f.end_s)
            }
            assert frames_told == cells[holds, value]
    n_held = sum(len(c) for (holds, _), c in cells.items() if holds)
    assert why.fraction_held == pytest.approx(n_held / sum(map(len, cells.values())))
    assert set(why.unknown) == {
        FULL_BODY.names[i]
        for column, frame in alignment.path.tolist()
        for i in np.flatnonzero(template.fixed[column] & ~known[frame])
    }


# -- in words ----------------------------------------------------------------------------


def test_the_sentence():
    evidence = evidence_of(
        {"F3": True, "F20": True, "F4": False}, {"F3": (0, 10), "F20": (6, 10)}, start=30
    )
    assert str(explain(evidence)) == (
        f"reach at 1.0–1.3 s, cost {evidence.alignment.cost:.3f}: "
        "80 % of what the class asks for held; "
        "held: right hand above neck (1.0–1.3 s), left hand below neck (1.0–1.3 s), "
        "right knee bent (1.2–1.3 s); failed: right knee bent (1.0–1.2 s)"
    )


def test_only_what_tells_most_is_said_and_in_the_order_of_time():
    asked = {f"F{i}": True for i in range(1, 12)}
    shown = {f"F{i}": (11 - i, 10) for i in range(1, 12)}
    why = explain(evidence_of(asked, shown, n_columns=10))
    held = re.search(r"held: (.*); failed", str(why)).group(1)
    times = [float(t) for t in re.findall(r"\((\d+\.\d)–", held)]
    assert len(times) == 4
    assert times == sorted(times)
    assert len(why.worst()) == 4
    assert [f.weight for f in why.worst()] == sorted((f.weight for f in why.failed), reverse=True)[
        :4
    ]


def test_what_is_rare_is_said_first():
    ones = np.full(N, 0.5)
    ones[BIT["F9"]] = 0.001
    asked = {name: True for name in ("F3", "F4", "F7", "F8", "F20", "F9")}
    why = explain(evidence_of(asked, {}, weights=ones))
    assert why.worst()[0].feature == "F9"


def test_an_action_tells_more_than_what_is_left_undone():
    asked = {"F1": False, "F2": False, "F4": False, "F5": False, "F6": False, "F3": True}
    why = explain(evidence_of(asked, {"F3": (0, 10)}))
    assert "held: " + NAME["F3"] in str(why)


def test_the_nearest_says_what_failed_and_what_was_not_seen():
    evidence = evidence_of({"F3": True, "F20": True, "F4": True}, {"F3": (0, 10)}, unknown=["F20"])
    text = describe_nearest(evidence, what="squat", threshold=0.06)
    assert text == (
        f"nothing below 0.06; nearest: squat {evidence.alignment.cost:.3f} at 0.0 s, "
        "failed: left hand above neck (0.0–0.3 s), not seen: right knee bent"
    )


def check_reads_well(text):
    assert "not not" not in text
    assert "  " not in text
    assert "; ;" not in text
    assert not re.search(r"(: ?[;,]|[:;,] ?$|nan|inf\b|None|array)", text)


# -- labels and hits ---------------------------------------------------------------------


def test_a_label_from_a_table_cannot_be_explained(tmp_path):
    with pytest.raises(InvalidInput, match=r"from a table.*annotate the recording again"):
        explain(Label("squat", 0.0, 1.0))
    path = tmp_path / "labels.csv"
    path.write_text("recording,label,start_s,end_s\ntake,squat,0.5,1.5\n")
    for track in read_labels(path).values():
        for label in track:
            with pytest.raises(InvalidInput, match="from a table"):
                explain(label)


@pytest.fixture(scope="module")
def raised():
    """Words of motions in which the arms go up, and of one in which they stay down."""
    up = [compute_features(synthetic_motion("raise_arms", seed=seed)) for seed in range(4)]
    return up, compute_features(synthetic_motion("bow", seed=1))


@pytest.mark.parametrize("by_self_information", [False, True])
def test_raised_arms_are_told(raised, by_self_information):
    up, bow = raised
    training = TrainingOptions(by_self_information=by_self_information)
    library = learn({"arms up": up[:3], "bow": [bow]}, training=training)
    track = annotate(up[3], library, threshold=0.2)
    label = next(label for label in track if label.name == "arms up")
    why = explain(label)
    assert {"F3", "F4"} <= {f.feature for f in why.held if f.phrase == NAME[f.feature]}
    assert "hand" in str(why)
    assert why.name == "arms up"
    check_reads_well(str(why))


def test_arms_that_stay_down_are_what_failed(raised):
    up, bow = raised
    library = learn({"arms up": up[:3]})
    track = annotate(bow, library, assignment="published")
    assert len(track) == 0
    assert "arms up" in track.nearest
    least = search(library["arms up"], [bow], threshold=1.0, limit=1)[0]
    missing = {f.feature for f in explain(least).failed if f.phrase == NAME[f.feature]}
    assert {"F3", "F4"} <= missing
    check_reads_well(track.nearest)


@pytest.mark.parametrize("expansion", [QueryExpansion(hits=0), None], ids=["as it is", "grown"])
def test_every_hit_can_be_explained(raised, expansion):
    up, bow = raised
    for hit in search(up[0], [*up[1:], bow], limit=None, expansion=expansion):
        why = explain(hit)
        assert (why.start_s, why.end_s, why.cost) == (hit.start_s, hit.end_s, hit.cost)
        assert all(why.start_s <= f.start_s < f.end_s <= why.end_s for f in why.held)
        assert all(why.start_s <= f.start_s < f.end_s <= why.end_s for f in why.failed)
        check_reads_well(str(why))


def test_no_name_of_a_relation_reads_twice_not():
    assert not any("not" in name.split() for name in FULL_BODY.names)


def test_a_moment_is_no_span():
    moment = Finding("F8", "left elbow bent", 22.11, 22.14, 1.0)
    assert str(moment) == "left elbow bent (22.1 s)"
    assert str(moment._replace(end_s=22.3)) == "left elbow bent (22.1–22.3 s)"
