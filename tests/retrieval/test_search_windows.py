"""What the ranking between people and styles finds, where, in what order, and why."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from cli_cases import write_bvh
from motionary.features import FULL_BODY, compute_features, load_everyday_set
from motionary.models.keyframes import parse_queries
from motionary.retrieval.explanation import compare_quantities, describe_comparison, explain
from motionary.retrieval.index import Collection, Index
from motionary.retrieval.search import QueryExpansion, RelevanceFeedback, search
from motionary.retrieval.search.examples import ExampleMatches
from motionary.retrieval.search.similar import WindowSettings, sample_windows, smallest_costs
from motionary.samples import synthetic_motion, synthetic_stream

EVERYDAY = load_everyday_set()
NAMES = ("squat", "kick_left", "wave_right", "walk")


def features(motion):
    return compute_features(motion, feature_set=EVERYDAY)


@pytest.fixture(scope="module")
def world():
    clips = [
        features(synthetic_motion(name, seed=seed).renamed(f"{name}-{seed}"))
        for name in NAMES
        for seed in range(2)
    ]
    stream, labels = synthetic_stream(["bow", "squat", "kick_left", "squat"], seed=3)
    return Collection((*clips, features(stream.renamed("stream"))), EVERYDAY), labels


def squat(world):
    collection, labels = world
    first = next(label for label in labels if label[0] == "squat")
    stream = collection.sequences[-1]
    return stream.part(round(30 * first[1]), round(30 * first[2])), first


def test_the_example_itself_comes_first_then_its_kind(world):
    example, where = squat(world)
    hits = search(example, world[0], limit=4)
    assert hits[0].cost == 0
    assert hits[0].recording.name == "stream"
    assert hits[0].start_s == pytest.approx(where[1], abs=0.05)
    assert hits[0].end_s == pytest.approx(where[2], abs=0.05)
    assert {hit.recording.name.split("-")[0] for hit in hits[1:]} == {"squat", "stream"}
    costs = [hit.cost for hit in hits]
    assert costs == sorted(costs)


@pytest.mark.parametrize("n_frames", [None, 24])
def test_hits_of_one_recording_do_not_repeat_each_other(world, n_frames):
    example, _ = squat(world)
    example = example.part(0, n_frames or len(example))
    spans = sorted(
        (hit.start_s, hit.end_s)
        for hit in search(example, world[0], limit=None)
        if hit.recording.name == "stream"
    )
    assert len(spans) > 2
    for (a, b), (c, d) in pairwise(spans):
        assert min(b, d) - max(a, c) < 0.5 * min(b - a, d - c) + 1e-9


def test_a_limit_and_a_threshold_keep_the_first_hits(world):
    example, _ = squat(world)
    every = list(search(example, world[0], limit=None))
    for limit in (1, 3, 6):
        assert list(search(example, world[0], limit=limit)) == every[:limit]
    below = [hit for hit in every if hit.cost <= 0.2]
    assert 1 < len(below) < len(every)
    assert list(search(example, world[0], limit=None, threshold=0.2)) == below


def test_where_nothing_is_near_enough_the_nearest_is_named(world):
    result = search(features(synthetic_motion("jump", seed=1)), world[0], threshold=0.001)
    assert not result.hits
    assert result.nearest.startswith("nearest is ")
    assert "threshold 0.001" in result.nearest


def test_best_costs_are_those_of_the_hits(world):
    example, _ = squat(world)
    smallest = ExampleMatches(RelevanceFeedback(example), world[0], QueryExpansion()).smallest
    hits = search(example, world[0], limit=None)
    for number, sequence in enumerate(world[0].sequences):
        costs = [hit.cost for hit in hits if hit.recording.name == sequence.source]
        assert min(costs) <= smallest[number] + 1e-6


def test_a_longer_example_is_found_window_by_window(world):
    stream = world[0].sequences[-1]
    assert len(stream) > 150
    hits = search(stream, world[0], limit=3)
    assert hits[0].recording.name == "stream"
    assert (hits[0].cost, hits[0].start_s) == (0, 0)


def test_relevant_hits_are_looked_for_too(world):
    example, _ = squat(world)
    kick = next(s for s in world[0].sequences if s.source == "kick_left-0")
    before = search(example, world[0], limit=None)
    after = search(RelevanceFeedback(example, relevant=(kick,)), world[0], limit=None)

    def rank(result):
        return [h.recording.name for h in result].index("kick_left-1")

    assert rank(after) < rank(before)
    again = search(RelevanceFeedback(example, tuple(before[1:3]), (before[-1],)), world[0])
    assert again[0].recording.name == "stream"


def test_recordings_in_which_anything_fits_are_put_further_off(world):
    example, _ = squat(world)
    feedback, settings = RelevanceFeedback(example), WindowSettings()

    def matches(settings):
        return ExampleMatches(feedback, world[0], QueryExpansion(), settings)

    plain, corrected = matches(replace(settings, hub=0.0)), matches(settings)
    windows = plain.windows.smallest
    more = (corrected.smallest - plain.smallest) * (1 + plain.weight)
    samples = sample_windows(world[0], travelling=False, settings=settings)
    assert len(samples) == settings.samples
    assert {number for number, _ in samples} > {0, len(world[0]) - 1}
    general = np.mean([smallest_costs(window, world[0]) for _, window in samples], axis=0)
    fits = windows > 0.01
    assert np.count_nonzero(fits) > 5
    assert np.corrcoef(more[fits] / windows[fits], general[fits])[0, 1] < -0.8
    hits = search(example, world[0], limit=1)
    assert (hits[0].recording.name, hits[0].cost) == ("stream", 0)


def test_quantities_say_why(world):
    example, _ = squat(world)
    hits = search(example, world[0], limit=2)
    itself = compare_quantities(hits[0].comparison)
    assert all(one.differs == 0 and one.example == one.found for one in itself)
    others = compare_quantities(hits[1].comparison)
    assert len(others) == 102
    assert {one.name for one in others} == {one.name for one in itself}
    assert any(one.differs > 0 for one in others)
    assert all(0 <= value <= 1 for one in others for value in one[1:])
    (line,) = describe_comparison(hits[0].comparison)
    assert line.startswith("alike: ")


def test_an_explanation_speaks_of_the_frames_of_the_hit(world):
    example, _ = squat(world)
    for hit in search(example, world[0], limit=None):
        why = explain(hit)
        assert (why.start_s, why.end_s, why.cost) == (hit.start_s, hit.end_s, hit.cost)
        for finding in (*why.held, *why.failed):
            assert hit.start_s - 1e-6 <= finding.start_s < finding.end_s <= hit.end_s + 1 / 30
        assert why.compared == tuple(describe_comparison(hit.comparison))
        assert str(why).endswith("; ".join(why.compared))


def test_motions_and_files_are_measured_as_the_example_needs(world, tmp_path):
    motions = {name: synthetic_motion(name, seed=4, rate_hz=30) for name in NAMES[:2]}
    query = synthetic_motion("squat", seed=8)
    found = search(query, motions)
    assert found[0].recording.name == "squat"
    assert all(hit.comparison for hit in found)
    published = [compute_features(motion) for motion in motions.values()]
    assert not any(hit.comparison for hit in search(query, published))
    as_published = search(query, motions, expansion=QueryExpansion(published=True))
    assert not any(hit.comparison for hit in as_published)


def test_one_collection_answers_published_queries(world):
    collection, _ = world
    published = Collection(tuple(s.leading(FULL_BODY) for s in collection.sequences))
    keyframes = parse_queries("right knee bent", vocabulary=FULL_BODY)
    assert list(search(keyframes, collection)) == list(search(keyframes, published))
    example, _ = squat(world)
    as_published = QueryExpansion(published=True)
    expected = list(search(example.leading(FULL_BODY), published))
    assert list(search(example, collection, expansion=as_published)) == expected


def test_one_index_answers_both(world, tmp_path):
    for name in NAMES[:2]:
        path = tmp_path / "takes" / f"{name}.bvh"
        path.parent.mkdir(exist_ok=True)
        write_bvh(synthetic_motion(name, seed=4, rate_hz=30), path)
    at = tmp_path / "index"
    Index.open(tmp_path / "takes", at=at, feature_set=EVERYDAY).update()
    index = Index.open(tmp_path / "takes", at=at, feature_set=EVERYDAY)
    fresh = Index.open(tmp_path / "takes", at=tmp_path / "other", feature_set=FULL_BODY)
    fresh.update()
    query = synthetic_motion("squat", seed=8)
    assert search(query, index)[0].recording.name == "squat.bvh"
    as_published = QueryExpansion(published=True)
    assert list(search(query, index, expansion=as_published)) == list(search(query, fresh))
    keyframes = parse_queries("left knee bent", vocabulary=FULL_BODY)
    assert list(search(keyframes, index)) == list(search(keyframes, fresh))
    bits = np.unpackbits(index.collection().parts[0].shard.planes.view(np.uint8)).sum()
    assert bits == np.unpackbits(fresh.collection().parts[0].shard.planes.view(np.uint8)).sum()


def test_a_body_kept_in_place_is_still_found(world):
    motion = replace(synthetic_motion("walk", seed=5), in_place=True)
    hits = search(features(motion), world[0], limit=2)
    assert {hit.recording.name.split("-")[0] for hit in hits} == {"walk"}
