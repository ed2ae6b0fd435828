"""From examples to scored labels on synthetic motions, without any recording."""

from collections import Counter

import pytest

from motionary.evaluation import evaluate
from motionary.features import compute_features
from motionary.labels import Label, LabelTrack
from motionary.models.library import ClassLibrary, learn
from motionary.retrieval.annotation import annotate
from motionary.retrieval.explanation import explain
from motionary.retrieval.search import search
from motionary.samples import synthetic_motion, synthetic_stream

CLASSES = ("squat", "jump", "bow", "kick_left", "kick_right", "raise_arms", "wave_right")
STREAMS = {
    "one": ("squat", "kick_left", "raise_arms", "bow", "jump", "wave_right"),
    "two": ("kick_right", "bow", "squat", "squat", "kick_left", "jump"),
}


@pytest.fixture(scope="module")
def library():
    return learn({name: [synthetic_motion(name, seed=i) for i in range(4)] for name in CLASSES})


@pytest.fixture(scope="module")
def streams():
    """Words of streams by figures that taught nothing, and the truth."""
    packed, truth = {}, {}
    for i, (name, classes) in enumerate(STREAMS.items()):
        motion, segments = synthetic_stream(classes, seed=100 + i)
        packed[name] = compute_features(motion)
        labels = tuple(Label(*segment) for segment in segments)
        truth[name] = LabelTrack(packed[name].recording, labels)
    return packed, truth


@pytest.fixture(scope="module")
def tracks(library, streams):
    packed, _ = streams
    return {name: annotate(sequence, library) for name, sequence in packed.items()}


def trivial(truth):
    """Everything is what is most common."""
    seconds = Counter()
    for track in truth.values():
        for label in track:
            seconds[label.name] += label.end_s - label.start_s
    name = seconds.most_common(1)[0][0]
    return {
        key: LabelTrack(track.recording, (Label(name, 0.0, track.duration_s),))
        for key, track in truth.items()
    }


def test_labels_are_far_better_than_a_trivial_labellers(tracks, streams):
    _, truth = streams
    scores = evaluate(tracks, truth).concatenated
    assert scores.frames.f >= 0.9
    assert scores.segments.f >= 0.9
    least = evaluate(trivial(truth), truth).concatenated
    assert least.frames.f < 0.4
    assert scores.frames.f > 2 * least.frames.f
    assert scores.segments.f > 2 * least.segments.f


def test_labels_stand_where_the_motions_are(tracks, streams):
    _, truth = streams
    found = 0
    for name, track in tracks.items():
        real = {(label.name, label.start_s, label.end_s) for label in truth[name]}
        for label in track:
            (match,) = [r for r in real if r[1] < label.end_s and label.start_s < r[2]]
            assert match[0] == label.name
            assert match[1:] == pytest.approx((label.start_s, label.end_s), abs=0.4)
            assert str(explain(label)).startswith(f"{label.name} at ")
            found += 1
    # A figure may move too differently from four others; no more than one does.
    assert found >= sum(map(len, truth.values())) - 1


def test_a_library_from_disk_labels_the_same(tracks, streams, library, tmp_path):
    library.save(tmp_path / "library")
    loaded = ClassLibrary.load(tmp_path / "library")
    packed, _ = streams
    assert {name: annotate(sequence, loaded) for name, sequence in packed.items()} == tracks


@pytest.mark.parametrize("name", ["squat", "kick_left", "bow"])
def test_one_example_finds_its_kind(streams, name):
    packed, truth = streams
    wanted = [(key, label) for key, track in truth.items() for label in track if label.name == name]
    hits = search(synthetic_motion(name, seed=50), list(packed.values()), limit=len(wanted))
    sources = {sequence.source: key for key, sequence in packed.items()}
    for hit in hits:
        assert any(
            sources[hit.recording.name] == key
            and min(hit.end_s, label.end_s) - max(hit.start_s, label.start_s) > 0.5
            for key, label in wanted
        )
