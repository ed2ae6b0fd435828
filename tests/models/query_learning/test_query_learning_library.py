"""Classes of a library get queries that the genetic algorithm learned from their examples."""

import json
from dataclasses import replace

import numpy as np
import pytest

from cli_cases import CLASSES, run, write_bvh, write_examples
from motionary.features import compute_features
from motionary.models.keyframes import index_packed, mirror_query, search_query
from motionary.models.library import TrainingOptions, learn_classes, learn_queries, load_library
from motionary.models.query_learning import GeneticSettings
from motionary.samples import synthetic_motion

QUICK = GeneticSettings(population=20, generations=15)


@pytest.fixture(scope="module")
def queried(examples):
    library = learn_classes(examples, training=TrainingOptions(mirror=True))
    return learn_queries(library, examples, settings=QUICK, runs=5)


def test_every_class_has_queries_that_find_others_of_it(queried):
    assert queried.without == {}
    unseen = [compute_features(synthetic_motion(name, seed=90)) for name in CLASSES]
    features = unseen[0].feature_set
    index = index_packed(
        [clip.packed for clip in unseen], feature_set=features.name, feature_ids=features.ids
    )
    for number, name in enumerate(CLASSES):
        prototype = queried.library[name].prototypes[0]
        assert len(prototype.queries) == 5
        hits = [number in search_query(q, index).hit_sequences for q in prototype.queries]
        assert sum(hits) >= prototype.votes


def test_the_mirror_image_has_the_mirrored_queries(queried):
    for motion_class in queried.library:
        original, mirrored = motion_class.prototypes
        assert mirrored.queries == tuple(mirror_query(q) for q in original.queries)
        assert mirrored.votes == original.votes


def test_a_library_with_learned_queries_comes_back_from_disk(queried, tmp_path):
    queried.library.save(tmp_path / "lib")
    again = load_library(tmp_path / "lib")
    for one, other in zip(queried.library, again, strict=True):
        for a, b in zip(one.prototypes, other.prototypes, strict=True):
            assert a.votes == b.votes
            assert [q.gaps for q in a.queries] == [q.gaps for q in b.queries]
            assert all(
                np.array_equal(p.values, q.values)
                for p, q in zip(a.queries, b.queries, strict=True)
            )


def test_a_class_without_others_stays_without_queries(examples):
    one = {"squat": examples["squat"]}
    result = learn_queries(
        learn_classes(one, training=TrainingOptions()), one, settings=QUICK, runs=1
    )
    assert "needs negatives" in result.without["squat"]
    assert result.library["squat"].prototypes[0].queries == ()


def test_a_class_of_one_example_stays_without_queries(examples):
    few = examples | {"squat": {"squat": examples["squat"]["squat"][:1]}}
    library = learn_classes(few, training=TrainingOptions())
    result = learn_queries(library, few, settings=replace(QUICK, generations=2), runs=1)
    assert list(result.without) == ["squat"]
    assert "at least 2 positives, got 1" in result.without["squat"]


def test_the_command_learns_queries(capsys, monkeypatch, tmp_path):
    write_examples(tmp_path / "examples")
    write_bvh(
        synthetic_motion("bow", seed=0, rate_hz=30.0), tmp_path / "examples" / "bow" / "one.bvh"
    )
    ran = run(
        capsys, monkeypatch, "learn", tmp_path / "examples", "-o", tmp_path / "lib",
        "--queries", "learned", "--query-runs", 2, "--json",
    )  # fmt: skip
    assert ran.code == 0, ran.err
    assert "'bow' has no queries" in ran.err
    assert {json.loads(line)["class"] for line in ran.out.splitlines()} == {*CLASSES, "bow"}
    library = load_library(tmp_path / "lib")
    assert all(len(library[name].prototypes[0].queries) == 2 for name in CLASSES)
    assert not library["bow"].prototypes[0].queries
