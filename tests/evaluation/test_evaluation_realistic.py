"""Do the measures say about real annotators what is known about them?

Two people annotated CMU 86_01: the author of the thesis (15 classes, labels overlap,
turns apart, pauses left blank) and another, who cut the whole take into seven pieces.
"""

import csv
from collections import defaultdict

import pytest

from motionary.evaluation import LabelledSegment, evaluate, rename_segments

RATE_HZ = 120
LENGTHS_S = {"01_01": 2751, "49_08": 575, "86_01": 4579, "HDM_bd_03-03_01_120": 3134}
DURATIONS_S = {name: frames / RATE_HZ for name, frames in LENGTHS_S.items()}

# What the eleven classes of HDM05 at hand are called in the truth of the thesis.
TAUGHT = {"grabDepR", "exercise", "jump", "move", "kick", "sitLieDown", "rotateArms", "throwR"}


def read(path):
    """Tables by recording; frames in the file count from 1 and include the last."""
    tables = defaultdict(list)
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            start, end = int(row["first_frame"]) - 1, int(row["last_frame"])
            tables[row["recording"]].append(
                LabelledSegment(row["label"], start / RATE_HZ, end / RATE_HZ)
            )
    return tables


@pytest.fixture
def truth(data):
    return read(data / "truth" / "annotation_2009.csv")


@pytest.fixture
def second(data):
    table = read(data / "truth" / "segments_86_01.csv")["86_01"]
    return rename_segments(table, {"walk": "move", "leg_kick": "kick"})


def compare(second, first, **settings):
    durations = {"86_01": DURATIONS_S["86_01"]}
    return evaluate({"86_01": second}, {"86_01": first}, durations_s=durations, **settings)


def test_two_annotators_agree_where_the_second_has_the_classes(truth, second):
    scores = compare(second, truth["86_01"], classes={s.name for s in second})
    assert round(scores.concatenated.frames.f, 2) == 0.94
    assert scores.concatenated.segments == (1, 1, 1)


@pytest.mark.parametrize("rate_hz", [30, 120])
@pytest.mark.parametrize(
    ("renamed", "f"), [({}, 0.88), ({"turn": "move"}, 0.97)], ids=["turns missed", "turns move"]
)
def test_two_annotators_under_other_readings_of_turn(truth, second, rate_hz, renamed, f):
    first = rename_segments(truth["86_01"], renamed)
    assert compare(second, first, rate_hz=rate_hz).concatenated.frames.f == pytest.approx(
        f, abs=0.005
    )


def test_two_annotators_differ_in_pauses_and_pieces(truth, second):
    scores = compare(second, truth["86_01"], classes={s.name for s in second})
    matrix = scores.confusion.matrix
    mistaken = matrix[:-1, :-1].sum() - matrix[:-1, :-1].trace()
    # Of 3.6 s that they name differently, the first leaves 2.9 s blank.
    assert (mistaken, matrix[-1].sum(), matrix[:, -1].sum()) == (19, 88, 0)
    # One kick of the second is three kicks of the first.
    assert scores.classes["kick"].segment_f == {0.1: 0.5, 0.25: 0.5, 0.5: 0}
    assert scores.concatenated.boundary.matched == 7
    assert scores.concatenated.boundary.median == pytest.approx(0.22, abs=0.005)


def test_everything_is_jump(truth):
    """A trivial labeller; classes that the eleven do not cover are left out."""
    predicted = {
        name: [LabelledSegment("jump", 0, seconds)] for name, seconds in DURATIONS_S.items()
    }
    trained = evaluate(predicted, truth, classes=TAUGHT, durations_s=DURATIONS_S)
    assert round(trained.concatenated.frames.f, 2) == 0.25
    everything = evaluate(predicted, truth, durations_s=DURATIONS_S)
    assert round(everything.concatenated.frames.f, 2) == 0.21
    assert everything.concatenated.frames.precision == trained.concatenated.frames.precision
    assert trained.confusion.matrix.sum() == pytest.approx(30 * sum(DURATIONS_S.values()), abs=4)
