"""Are planted motions labelled, and nothing else; is what was not seen told apart?"""

from functools import partial

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY_2006, FeatureSequence
from motionary.matching import align, distance_function, local_minima
from motionary.models.library import ClassLibrary, TrainingOptions, learn
from motionary.retrieval import annotation
from motionary.retrieval.annotation import annotate_fully, unassessed
from motionary.retrieval.explanation import explain
from motionary.retrieval.labelling import class_distance
from oracles import annotation as oracle
from packing_cases import N, random_rows, seconds, sequence, stream

# What is tested here is the assignment by costs, as published.
annotate = partial(annotation.annotate, assignment="published")

LENGTH = 30
STEP, TURN = random_rows(1, LENGTH), random_rows(2, LENGTH)
PLAIN = TrainingOptions(by_self_information=False)


def teach(training=PLAIN, **classes) -> ClassLibrary:
    """A library of one example, or several, for each class."""
    examples = {
        name: [sequence(rows) for rows in (given if isinstance(given, list) else [given])]
        for name, given in classes.items()
    }
    return learn(examples, training=training)


@pytest.fixture(scope="module")
def library():
    return teach(step=STEP, turn=TURN)


def spans(track):
    return [(label.name, round(30 * label.start_s), round(30 * label.end_s)) for label in track]


# -- what is there -----------------------------------------------------------------------


def test_planted_motions_are_labelled_where_they_are(library):
    rows, (a, b, c) = stream(STEP, TURN, STEP)
    track = annotate(sequence(rows, name="take"), library)
    expected = [("step", a, a + LENGTH), ("turn", b, b + LENGTH), ("step", c, c + LENGTH)]
    assert spans(track) == expected
    assert all(label.cost == 0 and label.known == 1 for label in track)
    assert (track.recording.name, track.duration_s) == ("take", seconds(len(rows)))
    assert track.unassessed == ()
    assert track.nearest == ""


def test_labels_name_the_files_own_frames(library):
    rows, (a,) = stream(STEP)
    about = {"rate_hz": 120.0, "n_frames": 4 * len(rows), "first_frame": 2925}
    (label,) = annotate(sequence(rows, **about), library)
    assert (label.start_frame, label.end_frame) == (2925 + 4 * a, 2925 + 4 * (a + LENGTH) - 1)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("training", [PLAIN, TrainingOptions()], ids=["plain", "by surprise"])
def test_labels_are_those_of_the_definition(seed, training):
    """Given distance functions and paths: least of the subclasses, runs, extension, merging."""
    rng = np.random.default_rng(seed)
    examples = [random_rows([seed, i], 12)[:, :N] for i in range(3)]
    mixed = np.where(rng.random((12, N)) < 0.6, examples[0], examples[1])
    library = teach(training, a=examples[0], b=[examples[1], mixed], c=examples[2])
    rows, _ = stream(mixed, examples[1], examples[0][:8], examples[2], seed=seed, pause=5)
    recording = sequence(rows)
    # High enough that matches of all classes overlap.
    found = annotate(recording, library, threshold=0.45)
    distances = []
    for motion_class in library:
        matches = []
        for _, pattern in motion_class.patterns:
            distance = distance_function(pattern, recording.packed, recording.known)
            ends = local_minima(distance, threshold=0.45)
            matches += align(pattern, recording.packed, recording.known, ends)
        triples = [(m.start, m.end, m.cost) for m in matches]
        distances.append(oracle.modified_distance(triples, len(rows)))
    expected = oracle.segments(distances)
    assert len({number for number, *_ in expected}) > 1
    assert sorted(spans(found)) == sorted((library.names[n], a, b) for n, a, b in expected)
    for label in found:
        own = distances[library.names.index(label.name)]
        inside = own[round(30 * label.start_s) : round(30 * label.end_s)]
        assert label.cost == min(inside) == label.evidence.alignment.cost


def test_labels_of_different_classes_may_overlap():
    # The second motion starts within the first: the first half of one is the end of another.
    joined = np.concatenate([STEP, TURN])
    long, short = joined[:45], joined[20:]
    rows, (a,) = stream(joined)
    track = annotate(sequence(rows), teach(long=long, short=short))
    assert spans(track) == [("long", a, a + 45), ("short", a + 20, a + 60)]


def test_the_cheapest_subclass_gives_the_label():
    prototypes = {"ways": [sequence(STEP)]}
    library = learn(prototypes, training=TrainingOptions(by_self_information=False, mirror=True))
    (motion_class,) = library
    assert [s.name for s in motion_class.prototypes] == ["ways", "waysMirrored"]
    mirrored = STEP[:, library.feature_set.mirror_order]
    rows, (a, b) = stream(STEP, mirrored)
    track = annotate(sequence(rows), library)
    assert spans(track) == [("ways", a, a + LENGTH), ("ways", b, b + LENGTH)]
    assert [label.cost for label in track] == [0, 0]


def test_the_threshold_of_the_call_overrules_the_classes(library):
    noisy = STEP.copy()
    noisy[:, :4] ^= True
    recording = sequence(stream(noisy)[0])
    assert len(annotate(recording, library)) == 0
    (label,) = annotate(recording, library, threshold=0.1)
    assert label.cost == pytest.approx(4 / N)


def test_each_class_has_its_own_threshold():
    noisy = STEP.copy()
    noisy[:, :4] ^= True
    strict = teach(step=STEP, turn=TURN)
    loose = teach(TrainingOptions(by_self_information=False, threshold=0.15), step=STEP)
    recording = sequence(stream(noisy)[0])
    assert spans(annotate(recording, strict)) == []
    assert [name for name, *_ in spans(annotate(recording, loose))] == ["step"]


# -- what was not seen -------------------------------------------------------------------


def blind(rows, *segments, features=slice(None)):
    """Words in which relations are unknown in some stretches."""
    known = np.ones_like(rows)
    for start, stop in segments:
        known[start:stop, features] = False
    return sequence(rows, known)


@pytest.mark.parametrize("threshold", [None, 0.5, 1.0])
@pytest.mark.parametrize("by_self_information", [False, True])
def test_a_drop_out_is_never_labelled(threshold, by_self_information):
    library = teach(TrainingOptions(by_self_information=by_self_information), step=STEP, turn=TURN)
    rows = np.zeros((100, N), dtype=np.bool_)
    track = annotate(blind(rows, (0, 100)), library, threshold=threshold)
    assert len(track) == 0
    assert track.unassessed == ((0.0, seconds(100)),)
    assert track.nearest == "no class fits into what was seen in 3.3 s"


@pytest.mark.parametrize("threshold", [None, 0.25])
def test_a_motion_in_a_drop_out_is_not_labelled_and_one_beside_it_is(library, threshold):
    rows, (a, b) = stream(STEP, STEP)
    track = annotate(blind(rows, (a - 5, a + LENGTH + 5)), library, threshold=threshold)
    assert spans(track) == [("step", b, b + LENGTH)]
    assert track.unassessed == ((seconds(a - 5), seconds(a + LENGTH + 5)),)


def test_a_partly_unknown_motion_says_how_much_was_seen(library):
    rows, (a,) = stream(STEP)
    track = annotate(blind(rows, (0, len(rows)), features=slice(0, 15)), library)
    assert spans(track) == [("step", a, a + LENGTH)]
    (label,) = track
    assert label.known == (N - 15) / N
    assert label.cost == 0
    assert track.unassessed == ()
    assert len(explain(label).unknown) == 15


@pytest.mark.parametrize(("n_unknown", "assessed"), [(N // 2, True), (N // 2 + 1, False)])
def test_at_least_half_must_be_seen(library, n_unknown, assessed):
    rows, (a,) = stream(STEP)
    recording = blind(rows, (0, len(rows)), features=slice(0, n_unknown))
    track = annotate(recording, library, threshold=1.0)
    if assessed:
        assert ("step", a, a + LENGTH) in spans(annotate(recording, library))
        assert track.unassessed == ()
        assert all(label.known >= 0.5 for label in track)
    else:
        assert len(track) == 0
        assert track.unassessed == ((0.0, seconds(len(rows))),)


@pytest.mark.parametrize("seed", range(8))
def test_known_shares_lie_above_0_and_are_those_of_the_path(seed):
    rng = np.random.default_rng(seed)
    rows, _ = stream(STEP, TURN, STEP, seed=seed, pause=15)
    known = rng.random(rows.shape) < rng.choice([0.3, 0.6, 0.9], (len(rows), 1))
    track = annotate(sequence(rows, known), teach(step=STEP, turn=TURN), threshold=0.6)
    for label in track:
        evidence = label.evidence
        assert 0.5 <= label.known <= 1
        cells = [
            known[frame, i]
            for column, frame in evidence.alignment.path
            for i in range(N)
            if evidence.template.fixed[column, i]
        ]
        assert label.known == pytest.approx(np.mean(cells))


def test_a_short_gap_inside_a_motion_does_not_part_its_label(library):
    rows, (a,) = stream(STEP)
    track = annotate(blind(rows, (a + 10, a + 11)), library)
    assert spans(track) == [("step", a, a + LENGTH)]
    assert track.unassessed == ((seconds(a + 10), seconds(a + 11)),)
    (label,) = track
    # At most one of 30 columns meets what was not seen, as if everything there were wrong.
    assert 0 < label.cost <= 1 / LENGTH
    assert label.known >= (LENGTH - 1) / LENGTH


def test_unassessed_stretches_end_with_the_recording():
    rows = random_rows(5, 50)
    recording = blind(rows, (0, 10), (45, 50))
    assert unassessed(recording) == ((0.0, seconds(10)), (seconds(45), seconds(50)))


# -- no answer, and no question ----------------------------------------------------------


def test_without_a_label_the_nearest_class_says_why(library):
    noisy = STEP.copy()
    noisy[:, 19] ^= True
    noisy[:, :3] ^= True
    rows, (a,) = stream(noisy)
    track = annotate(sequence(rows), library)
    assert len(track) == 0
    assert track.nearest.startswith(f"nothing below 0.06; nearest: step 0.100 at {a / 30:.1f} s, ")
    assert "failed: " in track.nearest
    assert "not seen" not in track.nearest


def test_the_nearest_class_says_what_was_not_seen(library):
    noisy = STEP.copy()
    noisy[:, :4] ^= True
    rows, _ = stream(noisy)
    track = annotate(blind(rows, (0, len(rows)), features=[39]), library)
    assert ", not seen: " in track.nearest
    assert library.feature_set.names[39] in track.nearest


def test_a_recording_shorter_than_half_of_every_template(library):
    track = annotate(sequence(STEP[:15]), library)
    assert len(track) == 0
    assert track.nearest == "no class fits into what was seen in 0.5 s"
    assert len(annotate(sequence(STEP[:16]), library, threshold=1.0)) >= 1


def test_an_empty_library_is_refused():
    with pytest.raises(InvalidInput, match="no classes"):
        annotate(sequence(STEP), ClassLibrary(()))


def test_words_of_another_set_are_refused(library):
    other = sequence(STEP[:, :39], feature_set=FULL_BODY_2006, name="old take")
    with pytest.raises(InvalidInput, match=r"old take.*full-body-39.*full-body-40"):
        annotate(other, library)


def test_the_same_input_gives_the_same_labels(library):
    rows, _ = stream(STEP, TURN)
    first, second = (annotate(sequence(rows), library) for _ in range(2))
    assert first == second


def test_a_class_distance_owns_its_frames(library):
    rows, (a, b) = stream(STEP, STEP)
    distance = class_distance(sequence(rows), library["step"])
    covered = np.flatnonzero(np.isfinite(distance.modified))
    assert covered.tolist() == [*range(a, a + LENGTH), *range(b, b + LENGTH)]
    assert (distance.owner[covered] >= 0).all()
    assert distance.least is not None
    assert isinstance(distance.least.sequence, FeatureSequence)


def test_the_distances_of_an_annotation_are_those_of_its_classes(library):
    rows, _ = stream(STEP, TURN)
    found = annotate_fully(sequence(rows), library, assignment="published")
    assert found.track == annotate(sequence(rows), library)
    assert list(found.distances) == ["step", "turn"]
    for name, distance in found.distances.items():
        alone = class_distance(sequence(rows), library[name])
        assert np.array_equal(distance.modified, alone.modified)
        assert np.isfinite(distance.modified).any()
