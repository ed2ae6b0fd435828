"""The genetic algorithm: individuals, their fitness, generations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput
from motionary.models.keyframes import index_packed
from motionary.models.query_learning import Augmentation, GeneticSettings, Individual, to_query
from motionary.models.query_learning.generations import (
    PUBLISHED,
    Clips,
    Evaluator,
    Fitness,
    augment,
    gaps_alone,
    genetic,
    random_creation,
    run_generations,
    sample_universally,
)
from motionary.models.query_learning.individuals import (
    GenePool,
    add_keyframe,
    generalise,
    initialise,
    mutate,
    recombine,
    remove_keyframe,
    shift_gap,
    simplify,
    specialise,
    without_free_keyframes,
)
from motionary.packing import pack
from oracles import query_learning as oracle

N_FEATURES = 5
seeds = st.integers(0, 10_000)


def random_pool(rng, n_columns=None) -> GenePool:
    n_columns = n_columns or int(rng.integers(1, 12))
    fixed = tuple(int(f) for f in rng.integers(0, 2**N_FEATURES, n_columns))
    majority = tuple(int(m) for m in rng.integers(0, 2**N_FEATURES, n_columns))
    values = tuple(f & m for f, m in zip(fixed, majority, strict=True))
    return GenePool(values, fixed, majority, N_FEATURES)


def random_clips(rng, count=6, longest=9):
    clips = [rng.random((int(rng.integers(1, longest)), N_FEATURES)) < 0.5 for _ in range(count)]
    known = [rng.random(clip.shape) < 0.9 for clip in clips]
    return [clip & mask for clip, mask in zip(clips, known, strict=True)], known


def index_of(clips, known):
    ids = tuple(f"R{i}" for i in range(N_FEATURES))
    return index_packed(
        [pack(c) for c in clips], [pack(k) for k in known], feature_set="five", feature_ids=ids
    )


def is_legal(individual: Individual, pool: GenePool) -> bool:
    return oracle.is_legal(*individual, len(pool), N_FEATURES)


def as_bits(number):
    return [number >> i & 1 for i in range(N_FEATURES)]


@given(seeds)
def test_every_individual_stays_a_legal_query(seed):
    rng = np.random.default_rng(seed)
    pool = random_pool(rng)
    one, other = initialise(pool, rng), initialise(pool, rng)
    for _ in range(20):
        assert is_legal(one, pool)
        to_query(one, "five", tuple(f"R{i}" for i in range(N_FEATURES)))
        one, other = mutate(recombine(one, other, pool, rng), pool, rng), one


@given(seeds)
def test_each_mutation_changes_what_it_says(seed):
    rng = np.random.default_rng(seed)
    pool = random_pool(rng, n_columns=8)
    one = initialise(pool, rng)
    more, narrower, wider = add_keyframe(one, pool, rng), specialise(one, pool, rng), None
    assert len(more.positions) - len(one.positions) == (len(set(one.positions)) < len(pool))
    assert set(one.positions) <= set(more.positions)
    assert narrower.n_fixed - one.n_fixed in (0, 1)
    for value, fixed, before, column in zip(
        narrower.values, narrower.fixed, one.fixed, one.positions, strict=True
    ):
        assert value & fixed & ~before == pool.majority[column] & fixed & ~before
    wider = generalise(one, rng)
    assert one.n_fixed - wider.n_fixed in (0, 1)
    assert (wider.positions, wider.least, wider.most) == (one.positions, one.least, one.most)
    moved = shift_gap(one, rng)
    assert moved[:3] == one[:3]
    changed = [a != b for a, b in zip(zip(*moved[3:], strict=True), zip(*one[3:], strict=True),
                                      strict=True)]  # fmt: skip
    assert sum(changed) <= 1
    fewer = remove_keyframe(more, rng)
    assert len(fewer.positions) == len(more.positions) - 1
    assert all(is_legal(i, pool) for i in (more, narrower, wider, moved, fewer))


@given(seeds)
def test_gaps_are_centred_on_the_distance_of_the_columns(seed):
    rng = np.random.default_rng(seed)
    one = initialise(random_pool(rng, n_columns=12), rng)
    distances = np.diff(one.positions)
    assert (np.array(one.least) <= distances).all()
    assert (distances <= np.array(one.most)).all()
    assert (np.array(one.most) <= 2 * distances).all()


@given(seeds)
def test_a_recombination_keeps_the_order_and_takes_from_both(seed):
    rng = np.random.default_rng(seed)
    pool = random_pool(rng, n_columns=12)
    first, second = initialise(pool, rng), initialise(pool, rng)
    child = recombine(first, second, pool, rng)
    keyframes = list(zip(*child[:3], strict=True))
    assert list(child.positions) == sorted(child.positions)
    assert len(set(keyframes)) == len(keyframes)
    for parent in (first, second):
        assert set(keyframes) & set(zip(*parent[:3], strict=True))
    assert set(child.positions) <= {*first.positions, *second.positions}


@given(seeds)
def test_retrieved_clips_are_those_with_a_hit(seed):
    rng = np.random.default_rng(seed)
    clips, known = random_clips(rng)
    evaluator = Clips(index_of(clips, known))
    pool = random_pool(rng, n_columns=4)
    one = initialise(pool, rng)
    for _ in range(4):
        one = mutate(one, pool, rng)
        keyframes = [(as_bits(v), as_bits(f)) for v, f in zip(one.values, one.fixed, strict=True)]
        if len(keyframes) > 3:
            continue
        gaps = list(zip(one.least, one.most, strict=True))
        expected = [
            oracle.holds_a_hit(keyframes, gaps, c, k) for c, k in zip(clips, known, strict=True)
        ]
        assert evaluator.retrieved(one).tolist() == expected


@given(seeds)
def test_removing_a_keyframe_or_entry_loses_no_clip(seed):
    rng = np.random.default_rng(seed)
    clips = Clips(index_of(*random_clips(rng, count=12)))
    pool = random_pool(rng, n_columns=6)
    one = add_keyframe(initialise(pool, rng), pool, rng)
    before = clips.retrieved(one)
    for other in (remove_keyframe(one, rng), generalise(one, rng)):
        assert (clips.retrieved(other) >= before).all()


@given(st.sets(st.integers(0, 9)), st.integers(1, 9), st.sampled_from([0.5, 1.0, 2.0]))
def test_fitness_of_the_thesis(retrieved, n_positives, beta):
    fitness = Fitness(n_positives, beta)
    mask = np.isin(np.arange(10), list(retrieved))
    expected = oracle.fitness(retrieved, set(range(n_positives)), beta)
    assert fitness.score(mask).fitness == pytest.approx(float(expected), abs=1e-12)


@given(seeds, st.integers(1, 8))
def test_sampling_is_universal(seed, count):
    rng = np.random.default_rng(seed)
    values = [int(v) for v in rng.integers(0, 4, 6)]
    expected = oracle.expected_counts(values, count)
    chosen = sample_universally(values, count, rng)
    counts = np.bincount(chosen, minlength=6)
    assert len(chosen) == count
    for number, wanted in zip(counts, expected, strict=True):
        assert wanted - 1 < number < wanted + 1


def test_sampling_chooses_as_often_as_expected():
    rng = np.random.default_rng(1)
    values = [3, 0, 1, 2, 5]
    counts = sum(np.bincount(sample_universally(values, 3, rng), minlength=5) for _ in range(4000))
    expected = np.array([float(e) for e in oracle.expected_counts(values, 3)])
    assert counts / 4000 == pytest.approx(expected, abs=0.03)


def planted(rng):
    """Positives that show feature 0, then 1; negatives in the other order."""

    def clip(first, second):
        bits = rng.random((12, N_FEATURES)) < 0.3
        bits[:, :2] = False
        bits[2:4, first] = bits[8:10, second] = True
        return bits

    positives, negatives = [clip(0, 1) for _ in range(6)], [clip(1, 0) for _ in range(6)]
    known = [np.ones_like(c) for c in positives + negatives]
    clips = Clips(index_of(positives + negatives, known))
    evaluator = Evaluator(clips, Fitness(6, 2.0))
    pool = GenePool(*((0, 0, 1, 1, 0, 0, 0, 0, 2, 2, 0, 0),) , (3,) * 12,
                    (0, 0, 1, 1, 0, 0, 0, 0, 2, 2, 0, 0), N_FEATURES)  # fmt: skip
    return pool, evaluator


@pytest.mark.parametrize("reproduction", [genetic, random_creation])
def test_a_planted_order_is_found(reproduction):
    pool, evaluator = planted(np.random.default_rng(3))
    settings = GeneticSettings(population=10, generations=10)
    run = run_generations(
        reproduction(pool), evaluator, settings=settings, rng=np.random.default_rng(0)
    )
    assert run.score.fitness == 1.0
    assert run.history.shape == (10, 3, 2)
    assert len(run.verified) == 0


def test_survivors_never_get_worse():
    pool, evaluator = planted(np.random.default_rng(3))
    rng = np.random.default_rng(1)
    run = run_generations(
        genetic(pool), evaluator, settings=PUBLISHED, rng=rng, verification=evaluator
    )
    assert (np.diff(run.history[:, 0, 0]) >= -1e-12).all()
    assert np.array_equal(run.history, run.verified)


def test_a_simplified_query_is_as_fit_and_asks_for_less():
    pool, evaluator = planted(np.random.default_rng(3))
    rng = np.random.default_rng(2)
    best = run_generations(genetic(pool), evaluator, settings=PUBLISHED, rng=rng).best
    simple = simplify(best, evaluator, rng)
    assert evaluator(simple).fitness >= evaluator(best).fitness
    assert simple.n_fixed < best.n_fixed
    assert simple.slack >= best.slack
    assert all(simple.fixed[1:-1])


@given(seeds)
def test_keyframes_that_ask_for_nothing_are_not_missed(seed):
    rng = np.random.default_rng(seed)
    clips = Clips(index_of(*random_clips(rng, count=12)))
    pool = random_pool(rng, n_columns=6)
    one = initialise(pool, rng)
    free = tuple(fixed * int(rng.integers(0, 2)) for fixed in one.fixed)
    values = tuple(v & f for v, f in zip(one.values, free, strict=True))
    one = one._replace(fixed=free, values=values)
    less = without_free_keyframes(one)
    assert np.array_equal(clips.retrieved(less), clips.retrieved(one))
    assert len(less.least) == len(less.most) == len(less.positions) - 1
    assert all(less.fixed[1:-1])


def test_gaps_alone_leave_keyframes_as_they_are():
    _, evaluator = planted(np.random.default_rng(3))
    start = Individual((2, 8), (1, 2), (3, 3), (6,), (6,))
    reproduction = gaps_alone(lambda _: start)
    run = run_generations(reproduction, evaluator, settings=PUBLISHED, rng=np.random.default_rng(0))
    assert run.best[:3] == start[:3]
    assert run.score.fitness == 1.0


def test_copies_keep_what_they_do_not_augment():
    rng = np.random.default_rng(0)
    bits = rng.random((20, N_FEATURES)) < 0.5
    same, known = augment(bits, ~bits, Augmentation(shift=0, tempo=1.0), rng)
    assert np.array_equal(same, bits)
    assert np.array_equal(known, ~bits)
    for _ in range(20):
        copy, _ = augment(bits, bits, Augmentation(shift=2, tempo=2.0), rng)
        assert 10 <= len(copy) <= 40


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (dict(population=0), "population"),
        (dict(generations=0), "generations"),
        (dict(parents=1), "2 parents"),
        (dict(beta=0.0), "beta"),
        (dict(parsimony=-1.0), "parsimony"),
    ],
)
def test_impossible_settings(settings, message):
    with pytest.raises(InvalidInput, match=message):
        GeneticSettings(**settings)


@pytest.mark.parametrize("settings", [dict(negative_copies=-1), dict(shift=-1), dict(tempo=0.5)])
def test_impossible_copies(settings):
    with pytest.raises(InvalidInput, match="copies need"):
        Augmentation(**settings)
