"""Do classes learn from labels that a person corrected, and is what that did told?"""

from dataclasses import replace

import pytest

from cli_cases import RATE_HZ, write_bvh
from motionary.errors import InvalidInput
from motionary.features import compute_features
from motionary.io import write_labels
from motionary.labels import Label, LabelTrack
from motionary.models.library import cut_example, learn, learn_beside, load_library
from motionary.retrieval.annotation import annotate
from motionary.retrieval.corrections import learn_corrections, split_parts
from motionary.samples import synthetic_motion, synthetic_stream

NAMES = ("squat", "kick_left")
PLAN = ("squat", "kick_left", "bow", "squat", "kick_left", "bow")


@pytest.fixture(scope="module")
def library():
    motions = {name: [synthetic_motion(name, seed=i, rate_hz=30) for i in (0, 1)] for name in NAMES}
    return learn(motions)


@pytest.fixture(scope="module")
def stream():
    """A recording, and everything that happens in it."""
    motion, plan = synthetic_stream(PLAN, seed=4, rate_hz=30)
    sequence = compute_features(motion.renamed("take.bvh"))
    return LabelTrack(sequence.recording, tuple(Label(*one) for one in plan)), sequence


def row_of(corrections, name):
    return next(one for one in corrections.classes if one.name == name)


@pytest.fixture(scope="module")
def came(library, stream):
    """What comes of the whole truth."""
    return learn_corrections(library, [stream])


def test_a_new_name_becomes_a_class_and_is_found(library, stream, came):
    truth, sequence = stream
    assert came.library.names == (*library.names, "bow")
    bow = row_of(came, "bow")
    assert (bow.kept, bow.added, bow.before.recall) == (0, 2, 0.0)
    found = annotate(sequence, came.library)
    assert sorted(x.name for x in found) == sorted(x.name for x in truth)
    assert came.n_changed >= 2


def test_what_is_kept_moved_renamed_and_removed_is_counted(library, stream):
    _, sequence = stream
    own = list(annotate(sequence, library))
    assert len(own) >= 4
    first, second, third, *rest = own
    changed = [
        replace(first, end_s=first.end_s + 0.2),
        replace(second, name="squat" if second.name == "kick_left" else "kick_left"),
        *rest,
    ]
    came = learn_corrections(library, [(LabelTrack(sequence.recording, tuple(changed)), sequence)])
    assert sum(one.moved for one in came.classes) == 1
    assert sum(one.renamed for one in came.classes) == 1
    assert row_of(came, changed[1].name).renamed == 1
    assert row_of(came, third.name).removed == 1
    assert sum(one.kept for one in came.classes) == len(rest)
    assert row_of(came, third.name).before.precision < 1


def test_labels_as_they_are_change_nothing_in_the_counts(library, stream):
    _, sequence = stream
    own = annotate(sequence, library)
    came = learn_corrections(library, [(own, sequence)])
    assert came.n_changed == 0
    assert (came.before.precision, came.before.recall) == (1.0, 1.0)


def test_each_class_learns_beside_what_it_knew(stream, came):
    own, beside = came.library["squat"].prototypes
    assert (own.name, beside.name) == ("squat", "squat 2")
    assert own.template.n_examples == 2 + 2
    assert beside.template.n_examples == 2
    squats = {
        "squat": {"squat": [cut_example(stream[1], x) for x in stream[0] if x.name == "squat"]}
    }
    again = learn_beside(came.library, squats)
    assert [one.name for one in again["squat"].prototypes] == ["squat", "squat 2", "squat 3"]


def test_examples_of_the_other_side_are_mirrored(stream):
    motions = [synthetic_motion("kick_right", seed=i, rate_hz=30) for i in (0, 1)]
    library = learn({"kick_left": motions}, mirror=True)
    truth, sequence = stream
    kicks = LabelTrack(truth.recording, tuple(x for x in truth if x.name == "kick_left"))
    came = learn_corrections(library, [(kicks, sequence)])
    names = [one.name for one in came.library["kick_left"].prototypes]
    assert names == ["kick_left", "kick_leftMirrored", "kick_left 2", "kick_left 2Mirrored"]
    learned = came.library["kick_left"].prototypes[2].template.values
    right = learn({"kick_left": motions})["kick_left"].prototypes[0].template.values
    lifted = [x[:, 19].mean() - x[:, 18].mean() for x in (learned, right)]
    assert lifted[0] * lifted[1] > 0 or lifted == [0, 0]


def test_parts_hold_every_label_once(stream):
    truth, sequence = stream
    parts = split_parts([stream])
    assert len(parts) == 5
    assert sum(len(track) for part in parts for track, _ in part) == len(truth)
    assert sum(len(x) for part in parts for _, x in part) == len(sequence)
    for ((track, part),) in parts:
        # Ends of labels lie between frames of the features.
        assert all(-1 / 30 < x.start_s < x.end_s < (len(part) + 1) / 30 for x in track)
    assert len(split_parts([stream] * 7)) == 5
    assert len(split_parts([(LabelTrack(truth.recording), sequence)])) == 1


def test_nothing_corrected_is_refused(library):
    with pytest.raises(InvalidInput, match="no corrected labels"):
        learn_corrections(library, [])


def test_a_saved_table_teaches_a_library(motionary, library, tmp_path):
    motion, plan = synthetic_stream(PLAN, seed=4, rate_hz=RATE_HZ)
    write_bvh(motion, tmp_path / "take.bvh")
    write_bvh(synthetic_motion("bow", seed=9, rate_hz=RATE_HZ), tmp_path / "empty.bvh")
    library.save(tmp_path / "library")
    rows = [f"take.bvh,{name},{start:.4f},{end:.4f},0" for name, start, end in plan]
    table = tmp_path / "labels.csv"
    # A recording of which no label is left still says so.
    rows = ["recording,label,start_s,end_s,unassessed", *rows, "empty.bvh,,0,0,1"]
    table.write_text("\n".join(rows))
    ran = motionary("learn", "--corrections", table, "--library", tmp_path / "library")
    assert (ran.code, ran.err) == (0, "")
    assert "all: precision" in ran.out
    assert load_library(tmp_path / "library").names == ("squat", "kick_left", "bow")
    named = motionary(
        "learn", "--corrections", table, "--library", tmp_path / "library", "-o", tmp_path / "new",
        "--json",
    )  # fmt: skip
    assert named.code == 0
    assert '"class": "bow"' in named.out
    kept = motionary("learn", "--corrections", table, "--library", "everyday")
    assert kept.code == 2
    assert "the library that ships stays as it is" in kept.err
    assert motionary("learn", table, "--corrections", table, "-o", tmp_path / "x").code == 2
    assert motionary("learn", table).code == 2


def test_corrections_of_other_recordings_are_told(motionary, library, tmp_path):
    library.save(tmp_path / "library")
    write_labels(
        LabelTrack(replace(synthetic_motion("bow", seed=9).recording, name="gone.bvh"),
                   (Label("bow", 0.0, 1.0),)),
        tmp_path / "labels.csv",
    )  # fmt: skip
    write_bvh(synthetic_motion("bow", seed=9, rate_hz=RATE_HZ), tmp_path / "other.bvh")
    ran = motionary(
        "learn", "--corrections", tmp_path / "labels.csv", "--library", tmp_path / "library"
    )
    assert ran.code == 1
    assert "gone.bvh: there is no recording of this name" in ran.err
    assert "nothing was changed" in ran.err
