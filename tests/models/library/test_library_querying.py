"""Classes of a library get queries that are chosen from their examples."""

import json
from dataclasses import replace

import numpy as np
import pytest

from cli_cases import CLASSES, run, write_bvh, write_examples, write_stream
from motionary.features import FULL_BODY, FeatureSequence, compute_features, read_features
from motionary.models.keyframes import ChoiceSettings, mirror_query, select_in_sequence
from motionary.models.library import (
    Prototype,
    TrainingOptions,
    choose_queries,
    learn_classes,
    load_library,
)
from motionary.models.templates import learn_template
from motionary.packing import pack
from motionary.samples import synthetic_motion


@pytest.fixture(scope="module")
def queried(examples):
    return choose_queries(learn_classes(examples, training=TrainingOptions(mirror=True)), examples)


def frames_left(prototype, packed):
    """Where the template is matched in a recording."""
    return select_in_sequence(
        prototype.queries, prototype.template.n_columns, packed.packed, packed.known,
        votes=prototype.votes,
    ).n_frames  # fmt: skip


def test_every_class_has_keyframes_that_find_others_of_it_and_leave_little(queried):
    assert queried.without == {}
    unseen = {name: compute_features(synthetic_motion(name, seed=90)) for name in CLASSES}
    for name in CLASSES:
        prototype = queried.library[name].prototypes[0]
        assert prototype.votes == 1
        (query,) = prototype.queries
        assert 2 <= len(query) <= 5
        left = {other: frames_left(prototype, packed) for other, packed in unseen.items()}
        assert left.pop(name) > 0
        elsewhere = sum(len(unseen[other]) for other in left)
        assert sum(left.values()) <= 0.2 * elsewhere, left


def test_the_mirror_image_has_the_mirrored_query(queried):
    for motion_class in queried.library:
        original, mirrored = motion_class.prototypes
        assert mirrored.queries == tuple(mirror_query(q) for q in original.queries)


def test_settings_are_passed_on(examples):
    library = learn_classes(examples, training=TrainingOptions())
    result = choose_queries(library, examples, settings=ChoiceSettings(least=3, most=3))
    assert [len(c.prototypes[0].queries[0]) for c in result.library] == [3] * len(CLASSES)


def test_each_class_is_told_when_it_is_done(examples):
    done = []
    library = learn_classes(examples, training=TrainingOptions())
    choose_queries(library, examples, on_done=lambda: done.append(1))
    assert len(done) == len(CLASSES)


# -- classes without queries -----------------------------------------------------------


def test_a_class_without_others(examples):
    one = {"squat": examples["squat"]}
    result = choose_queries(learn_classes(one, training=TrainingOptions()), one)
    assert "at least one counter-example, got none" in result.without["squat"]
    assert result.library["squat"].prototypes[0].queries == ()


def short(clips):
    return [clip.part(20, 25) for clip in clips]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda clips: clips[:1], "at least 2 examples, got 1"),
        (short, "of 2 keyframes that are 6 columns apart"),
    ],
)
def test_a_class_of_few_or_short_examples(examples, change, reason):
    poor = examples | {"squat": {"squat": change(examples["squat"]["squat"])}}
    result = choose_queries(learn_classes(poor, training=TrainingOptions()), poor)
    assert list(result.without) == ["squat"]
    assert reason in result.without["squat"]
    assert result.library["squat"].prototypes[0].queries == ()


def test_a_class_whose_examples_share_nothing(examples):
    library = learn_classes(examples, training=TrainingOptions())
    rng = np.random.default_rng(0)
    known = pack(np.ones((40, len(FULL_BODY)), dtype=bool))
    noise = [
        FeatureSequence(pack(rng.random((40, len(FULL_BODY))) < 0.5), known, FULL_BODY)
        for _ in range(6)
    ]
    template = learn_template(
        [noise[0].features], feature_names=FULL_BODY.ids, feature_set=FULL_BODY.name
    )
    odd = replace(library["squat"], prototypes=(Prototype("squat", template),))
    others = tuple(c for c in library if c.name != "squat")
    result = choose_queries(
        replace(library, classes=(odd, *others)), examples | {"squat": {"squat": noise}}
    )
    assert "no feature that is steady" in result.without["squat"]
    assert set(result.without) == {"squat"}


# -- the command -----------------------------------------------------------------------


def test_the_command_chooses_keyframes_and_labels_come_from_around_them(
    capsys, monkeypatch, tmp_path
):
    write_examples(tmp_path / "examples")
    bow = tmp_path / "examples" / "bow" / "one.bvh"
    write_bvh(synthetic_motion("bow", seed=0, rate_hz=30.0), bow)
    ran = run(
        capsys, monkeypatch, "learn", tmp_path / "examples", "-o", tmp_path / "lib",
        "--queries", "chosen", "--json",
    )  # fmt: skip
    assert ran.code == 0, ran.err
    assert "'bow' has no queries: choosing keyframes needs at least 2 examples" in ran.err
    library = load_library(tmp_path / "lib")
    assert [len(library[name].prototypes[0].queries) for name in CLASSES] == [1] * len(CLASSES)
    assert not library["bow"].prototypes[0].queries

    stream = tmp_path / "stream.bvh"
    truth = write_stream(stream)
    arguments = ("annotate", stream, "--library", tmp_path / "lib", "--json")
    around = run(capsys, monkeypatch, *arguments)
    everywhere = run(capsys, monkeypatch, *arguments, "--thorough")
    labels = [label["label"] for label in json.loads(around.out)["labels"]]
    assert labels == [name for name, *_ in truth]
    assert around.out == everywhere.out

    (packed,) = read_features([("stream", stream)])
    left = [frames_left(library[name].prototypes[0], packed) / len(packed) for name in CLASSES]
    assert max(left) < 1.0
