"""Many runs of the genetic algorithm: what is learned, in whatever order, and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FULL_BODY_2006, FeatureSequence
from motionary.models.keyframes import index_packed, search_query
from motionary.models.query_learning import (
    PUBLISHED,
    GeneticSettings,
    Individual,
    accumulate,
    clip_evaluator,
    combine_runs,
    continue_learning,
    learn_query,
    learn_runs,
    state_problem,
)
from motionary.models.query_learning.individuals import GenePool, frequent_keyframes
from motionary.packing import full_mask, pack
from motionary.recording import Recording

QUICK = GeneticSettings(population=30, parents=5, generations=40)


def clip(order, seed, length=24) -> FeatureSequence:
    """A clip in which two features hold one after the other; noise in some others."""
    rng = np.random.default_rng(seed)
    bits = np.zeros((length, len(FULL_BODY)), dtype=np.bool_)
    bits[:, 30:] = rng.random((length, len(FULL_BODY) - 30)) < 0.2
    for k, feature in enumerate(order):
        start = length * (1 + 3 * k) // 6
        bits[start : start + length // 5, feature] = True
    return FeatureSequence(
        pack(bits), full_mask(length, len(FULL_BODY)), FULL_BODY, Recording(f"clip {seed}")
    )


@pytest.fixture(scope="module")
def positives():
    return [clip((3, 7), seed, length=22 + seed) for seed in range(12)]


@pytest.fixture(scope="module")
def negatives():
    return [clip((7, 3), 100 + seed, length=22 + seed % 12) for seed in range(36)]


@pytest.fixture(scope="module")
def learned(positives, negatives):
    return learn_query(positives, negatives, settings=QUICK, runs=6, seed=4)


def index_of(clips):
    return index_packed(
        [c.packed for c in clips], feature_set=FULL_BODY.name, feature_ids=FULL_BODY.ids
    )


def same(runs, others):
    return all(
        a.best == b.best and a.score == b.score and np.array_equal(a.history, b.history)
        for a, b in zip(runs, others, strict=True)
    )


def test_the_order_of_two_features_is_learned(learned):
    unseen = [clip((3, 7), 50), clip((3, 7), 51, length=30), clip((7, 3), 52), clip((7, 3), 53)]
    assert learned.sequences(index_of(unseen)).tolist() == [0, 1]
    found = learned.search(index_of(unseen))
    assert set(found.sequences.tolist()) == {0, 1}
    for query in learned.queries:
        assert query.positions is not None
        assert query.feature_set == FULL_BODY.name


def test_same_seed_same_queries_and_another_seed_others(positives, negatives, learned):
    again = learn_query(positives, negatives, settings=QUICK, runs=6, seed=4)
    other = learn_query(positives, negatives, settings=QUICK, runs=6, seed=5)
    assert same(again.runs, learned.runs)
    assert not same(other.runs, learned.runs)


@pytest.mark.usefixtures("two_processes")
def test_two_processes_learn_the_same(positives, negatives, learned):
    done = []
    both = learn_query(
        positives, negatives, settings=QUICK, runs=6, seed=4, jobs=2, on_done=done.append
    )
    assert same(both.runs, learned.runs)
    assert done == list(range(6))


def test_learning_goes_on_where_it_stopped(positives, negatives, learned):
    some = learn_query(positives, negatives, settings=QUICK, runs=2, seed=4)
    all_of_them = continue_learning(some, runs=6)
    assert same(all_of_them.runs, learned.runs)
    assert all_of_them.votes == learned.votes
    (fifth,) = learn_runs(learned.problem, [5])
    assert same([fifth], learned.runs[5:])


def test_copies_are_part_of_the_seed(positives, negatives):
    varied = replace(QUICK, augmentation=replace(QUICK.augmentation, negative_copies=3))
    one, two = (
        learn_query(positives, negatives, settings=varied, runs=2, seed=1) for _ in range(2)
    )
    assert same(one.runs, two.runs)


def test_verification_is_recorded_beside(positives, negatives):
    problem = state_problem(positives, negatives, settings=replace(QUICK, simplify=False))
    seen = clip_evaluator(positives, negatives, settings=problem.settings)
    (run,) = learn_runs(problem, [0], verification=seen)
    assert run.verified.shape == (QUICK.generations, 3, 2)
    assert np.array_equal(run.history, run.verified)


def test_random_search_evaluates_as_many(positives, negatives):
    problem = state_problem(positives, negatives, settings=PUBLISHED)
    (run,) = learn_runs(problem, [0], random_search=True)
    assert len(run.history) == PUBLISHED.generations
    assert run.score.fitness <= 1.0


def test_runs_combine_to_one_query(positives, negatives):
    whole = replace(QUICK, simplify=False)
    learned = learn_query(positives, negatives, settings=whole, runs=6, seed=4)
    combined = combine_runs(learned)
    assert list(combined.best.positions) == sorted(set(combined.best.positions))
    assert combined.score.fitness >= 0.9
    assert learned.accumulation.values.shape == (len(learned.problem.pool), len(FULL_BODY))


def test_accumulated_keyframes_stand_where_runs_agree():
    pool = GenePool((0,) * 12, (0,) * 12, (0,) * 12, 3)
    runs = [
        Individual((2, 8), (1, 2), (3, 2), (6,), (6,)),
        Individual((2, 9), (1, 2), (1, 6), (6,), (8,)),
        Individual((3, 8), (1, 2), (1, 2), (5,), (5,)),
    ]
    added = accumulate(runs, pool)
    assert added.values[2].tolist() == pytest.approx([0.5 + 2 / 6, 0.5 - 1 / 6, 0.5])
    assert added.values[0].tolist() == [0.5, 0.5, 0.5]
    assert added.agreement[[2, 8, 5]].tolist() == pytest.approx([8 / 9, 8 / 9, 1 / 9])
    first, second = frequent_keyframes(runs, pool)
    assert first[1:] == (1, 1)
    assert second[1:] == (2, 2)


def test_votes_that_are_impossible(learned):
    for votes in (0, 7):
        with pytest.raises(InvalidInput, match="votes"):
            replace(learned, votes=votes)


def test_fewer_votes_find_more(learned, positives, negatives):
    index = index_of([*positives, *negatives])
    found = [replace(learned, votes=votes) for votes in range(1, 7)]
    n_sequences = [len(one.sequences(index)) for one in found]
    n_frames = [one.search(index).n_frames for one in found]
    assert n_sequences == sorted(n_sequences, reverse=True)
    assert n_frames == sorted(n_frames, reverse=True)


def test_bad_examples_are_refused(positives, negatives):
    with pytest.raises(InvalidInput, match="needs negatives"):
        learn_query(positives, [])
    with pytest.raises(InvalidInput, match="at least 2 positives, got 1"):
        learn_query(positives[:1], negatives)
    with pytest.raises(InvalidInput, match="shorter than any query"):
        learn_query([positives[0], positives[1].part(0, 1)], negatives)
    with pytest.raises(InvalidInput, match="at least 1 run"):
        learn_query(positives, negatives, runs=0)
    packed = np.zeros((9, 1), dtype=np.uint64)
    other = FeatureSequence(packed, full_mask(9, len(FULL_BODY_2006)), FULL_BODY_2006)
    with pytest.raises(InvalidInput, match="use one set for all"):
        learn_query(positives, [*negatives, other])


def test_positives_with_nothing_in_common_are_refused(negatives):
    bits = np.zeros((9, len(FULL_BODY)), dtype=np.bool_)
    known = full_mask(9, len(FULL_BODY))
    opposite = [FeatureSequence(pack(b), known, FULL_BODY) for b in (bits, ~bits)]
    with pytest.raises(InvalidInput, match="no feature in common"):
        learn_query(opposite, negatives)


def test_clips_shorter_than_a_query_hold_no_hit(learned):
    for query in learned.queries:
        span = sum(gap.least for gap in query.gaps)
        cut = [clip((3, 7), seed, length=40).part(0, span) for seed in range(60, 80) if span > 0]
        assert not cut or len(search_query(query, index_of(cut))) == 0


def test_squats_of_people_never_seen(data: Path, hdm05):
    def clips(name, actors):
        paths = sorted((data / "hdm05").rglob(f"HDM_*_{name}*.[aA][mM][cC]"))
        chosen = [p for p in paths if p.stem.split("_")[1] in actors]
        return [hdm05[path.stem] for path in chosen[:5]]

    seen, unseen = ("bd", "dg"), ("tr",)
    others = ("kickL", "hopBoth", "elbowToKnee")
    negatives = [c for name in others for c in clips(name, seen)]
    settings = replace(QUICK, population=20, generations=20)
    learned = learn_query(clips("squat", seen), negatives, settings=settings, runs=5)
    squats = clips("squat", unseen)
    documents = [*squats, *(c for name in others for c in clips(name, unseen))]
    index = index_of(documents)
    for query, run in zip(learned.queries, learned.runs, strict=True):
        hit = search_query(query, index_of(negatives)).hit_sequences
        assert len(hit) == 0 or run.score.precision < 1.0
    found = learned.sequences(index)
    assert np.mean(found < len(squats)) >= 0.7
    assert np.mean(np.isin(np.arange(len(squats)), found)) >= 0.7
