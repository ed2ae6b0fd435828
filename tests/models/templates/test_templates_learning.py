"""Is learning the authors', step by step, and does nothing get lost on the way?"""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motionary.errors import InvalidInput
from motionary.models.templates import Learning, learn_template
from motionary.models.templates import alignment as alignment_module
from motionary.models.templates.alignment import (
    PairCost,
    align_all,
    align_batched,
    align_compiled,
)
from motionary.models.templates.learning import (
    Stack,
    average,
    contract,
    expand,
    learn_pass,
    repeat_passes,
    unwarp,
)
from oracles import learning as oracle

CONTRACT_AT = Learning().contract_at
ENGINES = [pytest.param(align_batched, id="numpy"), pytest.param(align_compiled, id="compiled")]


def stack_of(examples):
    """Stack of (columns, weights) pairs."""
    columns, weights = zip(*examples, strict=True)
    offsets = np.cumsum([0, *(len(w) for w in weights)])
    return Stack(
        np.concatenate(columns).astype(float), np.concatenate(weights).astype(float), offsets
    )


def examples_of(stack):
    bounds = zip(stack.offsets[:-1], stack.offsets[1:], strict=True)
    return [(stack.columns[a:b], stack.weights[a:b]) for a, b in bounds]


def masses(stack):
    """Total weight and weighted sum of each feature, of each example."""
    return np.array([[w.sum(), *(c * w[:, None]).sum(axis=0)] for c, w in examples_of(stack)])


def learn(matrices, **changes):
    names = [f"relation {i}" for i in range(np.shape(matrices[0])[1])]
    return learn_template(matrices, feature_names=names, feature_set="a set", **changes)


def one_pass(stack, engine=align_batched):
    n_features = stack.columns.shape[1]
    return learn_pass(stack, n_features=n_features, contract_at=CONTRACT_AT, engine=engine)


def clips(seed, *, n_examples, n_columns, n_features=12):
    """Runs of relations, each clip in its own tempo and with its own flaws."""
    rng = np.random.default_rng(seed)
    motion = np.repeat(rng.integers(0, 2, (-(-n_columns // 6), n_features)), 6, axis=0)[:n_columns]
    made = []
    for _ in range(n_examples):
        tempo = np.cumsum(rng.uniform(0.4, 1.6, int(n_columns * rng.uniform(0.7, 1.3))))
        clip = motion[np.minimum(tempo.astype(int), n_columns - 1)]
        made.append(clip ^ (rng.random(clip.shape) < 0.03))
    return made


# Few values and dyadic weights: costs are exact, so ties are real and frequent.
@st.composite
def stacks(draw, values=(0.0, 1.0), weights=(0.25, 0.5, 0.75, 1.0, 1.5, 2.5), max_examples=4):
    n_features = draw(st.integers(1, 3))
    examples = []
    for _ in range(draw(st.integers(1, max_examples))):
        n = draw(st.integers(1, 6))
        row = st.lists(st.sampled_from(values), min_size=n_features, max_size=n_features)
        columns = draw(st.lists(row, min_size=n, max_size=n))
        drawn = draw(st.lists(st.sampled_from(weights), min_size=n, max_size=n))
        examples.append((np.array(columns), np.array(drawn)))
    return stack_of(examples)


# --- alignment


@pytest.mark.parametrize("engine", ENGINES)
@given(stack=stacks())
def test_paths_and_costs_are_those_of_the_definition(engine, stack):
    found = align_all(stack.columns, stack.weights, stack.offsets, engine=engine)
    examples = examples_of(stack)
    wanted, costs = [], [0.0]
    for i, reference in enumerate(examples):
        for j, example in enumerate(examples):
            if i != j:
                path, cost = oracle.align(reference, example)
                costs.append(cost)
                wanted += [(stack.offsets[i] + r, stack.offsets[j] + w) for r, w in path]
    assert sorted(zip(found.reference, found.warped, strict=True)) == sorted(wanted)
    assert found.largest_cost == max(costs)


@pytest.mark.parametrize("engine", ENGINES)
def test_ties_go_to_the_diagonal_then_to_a_step_in_the_warped_example(engine):
    # Rows and columns are examples of three columns. Cell (2, 2) is reached for 0 from
    # (1, 2) and (2, 1) alike, while its diagonal neighbour (1, 1) costs 9.
    cost = np.array([[0.0, 0.0, 9.0], [0.0, 9.0, 0.0], [9.0, 0.0, 0.0]])
    found = engine(iter([PairCost(cost, first=0, second=3)]))
    met = set(zip(found.reference.tolist(), found.warped.tolist(), strict=True))
    # Columns of the first example as reference: the last step leads from (2, 1), a step in
    # the warped example only; with the second as reference likewise, the other way round.
    assert {(2, 3 + 1), (2, 3 + 2)} <= met
    assert (1, 3 + 2) not in met
    assert {(3 + 2, 1), (3 + 2, 2)} <= met
    assert (3 + 1, 2) not in met


@pytest.mark.parametrize("engine", ENGINES)
def test_equal_costs_are_walked_diagonally(engine):
    found = engine(iter([PairCost(np.zeros((3, 3)), first=0, second=3)]))
    assert sorted(found.reference.tolist()) == [0, 1, 2, 3, 4, 5]
    assert all(abs(r - w) == 3 for r, w in zip(found.reference, found.warped, strict=True))


@given(stack=stacks(values=(0.0, 0.25, 1.0)))
def test_no_path_turns_a_corner(stack):
    # Hence spreading a column's weight and dividing what was collected come to the same.
    found = align_all(stack.columns, stack.weights, stack.offsets, engine=align_batched)
    met = list(zip(found.reference.tolist(), found.warped.tolist(), strict=True))
    example = np.searchsorted(stack.offsets, np.arange(len(stack.weights)), side="right")
    for r, w in met:
        others_of_r = [b for a, b in met if a == r and example[b] == example[w]]
        others_of_w = [a for a, b in met if b == w and example[a] == example[r]]
        assert len(others_of_r) == 1 or len(others_of_w) == 1


def test_small_batches_find_the_same_paths(monkeypatch):
    stack = stack_of([(c, np.ones(len(c))) for c in clips(3, n_examples=5, n_columns=20)])
    at_once = align_all(stack.columns, stack.weights, stack.offsets, engine=align_batched)
    monkeypatch.setattr(alignment_module, "BATCH_CELLS", 3000)
    in_parts = align_all(stack.columns, stack.weights, stack.offsets, engine=align_batched)
    assert in_parts.largest_cost == at_once.largest_cost
    assert sorted(zip(in_parts.reference, in_parts.warped, strict=True)) == sorted(
        zip(at_once.reference, at_once.warped, strict=True)
    )


# --- averaging and unwarping


@given(stack=stacks(values=(0.0, 0.3, 0.5, 1.0)))
def test_a_pass_is_that_of_the_definition(stack):
    found, cost = one_pass(stack)
    wanted, highest_cost = oracle.one_pass(examples_of(stack))
    assert cost == pytest.approx(highest_cost, abs=1e-12)
    for (columns, weights), (columns_wanted, weights_wanted) in zip(
        examples_of(found), wanted, strict=True
    ):
        assert weights == pytest.approx(np.array(weights_wanted), abs=1e-12)
        assert np.allclose(columns, columns_wanted, rtol=0, atol=1e-12)


@given(stack=stacks(values=(0.0, 0.3, 1.0), weights=(0.1, 0.2, 0.3, 0.75, 1.0, 1.3, 2.5, 7.2)))
def test_averaging_gives_every_reference_all_the_weight_there_is(stack):
    aligned = align_all(stack.columns, stack.weights, stack.offsets, engine=align_batched)
    averaged = average(stack, aligned)
    mean = masses(stack).mean(axis=0)
    assert np.allclose(masses(averaged), mean[None], rtol=1e-12)
    assert np.array_equal(averaged.offsets, stack.offsets)


@pytest.mark.parametrize(
    "step", [expand, lambda s: contract(s, contract_at=0.75), lambda s: unwarp(s, contract_at=0.75)]
)
@given(stack=stacks(values=(0.0, 0.3, 1.0), weights=(0.1, 0.2, 0.3, 0.75, 1.0, 1.3, 2.5, 7.2)))
def test_unwarping_loses_and_adds_nothing(step, stack):
    assert np.allclose(masses(step(stack)), masses(stack), rtol=1e-12)


@given(stack=stacks(weights=(0.1, 0.3, 0.75, 1.0, 1.3, 2.5, 7.2)))
def test_unwarped_columns_last_about_a_frame(stack):
    for _, weights in examples_of(unwarp(stack, contract_at=0.75)):
        if len(weights) > 1:
            assert weights.min() >= 0.75 * (1 - 1e-12)
        assert weights.max() < 1.5


@pytest.mark.parametrize(
    ("weight", "repeats"),
    [(0.1, 1), (0.5, 1), (1.0, 1), (1.49, 1), (1.5, 2), (2.5, 3), (3.5, 4), (4.49, 4)],
)
def test_columns_repeat_as_they_weigh_halves_up(weight, repeats):
    expanded = expand(stack_of([([[0.0, 1.0]], [weight]), ([[1.0, 1.0]], [1.0])]))
    assert expanded.offsets.tolist() == [0, repeats, repeats + 1]
    assert expanded.weights[:repeats].tolist() == [weight / repeats] * repeats
    assert expanded.columns.tolist() == [[0.0, 1.0]] * repeats + [[1.0, 1.0]]


@pytest.mark.parametrize(
    ("weights", "merged"),
    [
        ([1.0, 1.0], [1.0, 1.0]),
        ([0.75, 0.75], [0.75, 0.75]),
        ([0.25, 0.5, 0.75], [0.75, 0.75]),
        ([0.5, 0.5, 0.5, 0.5], [1.0, 1.0]),
        ([0.5, 0.5, 0.5], [1.5]),
        ([1.0, 0.125, 0.125], [1.25]),
        ([0.7, 0.7], [1.4]),
        ([0.125, 0.25], [0.375]),
        ([0.5], [0.5]),
        ([0.5, 2.0, 1.0], [2.5, 1.0]),
    ],
)
def test_light_columns_merge_from_the_left_a_remainder_joins_before(weights, merged):
    columns = np.arange(len(weights), dtype=float)[:, None] / 8
    alone = (np.ones((2, 1)), np.ones(2))
    contracted = contract(stack_of([(columns, weights), alone]), contract_at=0.75)
    assert contracted.weights.tolist() == pytest.approx([*merged, 1.0, 1.0])
    assert contracted.offsets.tolist() == [0, len(merged), len(merged) + 2]
    wanted, _ = oracle.contract((columns, weights))
    assert np.allclose(contracted.columns, [*wanted, [1.0], [1.0]], rtol=0, atol=1e-15)


# --- learning


@pytest.mark.parametrize("n_examples", [1, 2, 3, 7])
@given(data=st.data())
def test_equal_examples_are_a_fixed_point(n_examples, data):
    matrix = clips(data.draw(st.integers(0, 99)), n_examples=1, n_columns=15)[0]
    template = learn([matrix] * n_examples)
    assert np.array_equal(template.values, matrix)
    assert (template.weights == 1.0).all()
    assert template.n_examples == n_examples


@pytest.mark.parametrize("seed", range(6))
def test_the_template_is_that_of_the_definition(seed):
    matrices = clips(seed, n_examples=2 + seed % 3, n_columns=14, n_features=5)
    columns, weights = oracle.learn(matrices)
    template = learn(matrices)
    assert template.weights == pytest.approx(np.array(weights), abs=1e-9)
    assert np.allclose(template.values, columns, rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_the_template_lasts_as_long_as_the_mean_example(seed):
    matrices = clips(seed, n_examples=6, n_columns=30)
    template = learn(matrices)
    assert template.duration_s == pytest.approx(np.mean([len(m) for m in matrices]) / 30)


def test_a_relation_shared_by_all_stays_exactly_so():
    matrices = [
        np.column_stack([c, np.ones(len(c)), np.zeros(len(c))])
        for c in clips(8, n_examples=7, n_columns=40)
    ]
    template = learn(matrices)
    assert (template.values[:, -2] == 1.0).all()
    assert (template.values[:, -1] == 0.0).all()


def test_what_differs_in_time_only_is_learned_without_a_free_cell():
    template = learn([[[0]] * 4 + [[1]] * 8, [[0]] * 8 + [[1]] * 4])
    assert template.values[:, 0].tolist() == [0.0] * 6 + [1.0] * 6


def test_order_of_features_does_not_matter():
    matrices = clips(5, n_examples=5, n_columns=30)
    order = np.random.default_rng(0).permutation(12)
    shuffled = learn([m[:, order] for m in matrices])
    assert np.allclose(shuffled.values, learn(matrices).values[:, order], rtol=0, atol=1e-12)


def test_passes_end_at_the_stop_cost_and_at_the_latest_after_max_passes():
    matrices = clips(5, n_examples=4, n_columns=30)
    stack = stack_of([(m, np.ones(len(m))) for m in matrices])
    mean_length = stack.mean_weight
    costs = []
    for _ in range(6):
        stack, cost = one_pass(stack)
        costs.append(cost / mean_length)
    after = [learn(matrices, learning=Learning(max_passes=n)).values for n in (1, 2, 3)]
    assert costs[0] > costs[1] > costs[2]
    stopped = learn(matrices, learning=Learning(stop=costs[1])).values
    assert np.array_equal(stopped, after[1])
    stopped = learn(matrices, learning=Learning(stop=costs[1] * (1 - 1e-9))).values
    assert np.array_equal(stopped, after[2])
    assert not np.array_equal(after[0], after[1])


def test_no_more_than_10_passes_are_made():
    rng = np.random.default_rng(36)
    matrices = [rng.integers(0, 2, (rng.integers(2, 9), 2)) for _ in range(rng.integers(2, 5))]
    stack = stack_of([(m, np.ones(len(m))) for m in matrices])
    for _ in range(10):
        stack, cost = one_pass(stack)
        assert cost / stack.mean_weight > Learning().stop
    assert np.array_equal(learn(matrices).values, stack.columns[: stack.offsets[1]])
    after_11, _ = one_pass(stack)
    assert not np.array_equal(after_11.columns, stack.columns)


def test_passes_end_when_the_cost_does_not_change():
    costs = iter([3.0, 2.0, 2.0, 1.0])

    def engine(pairs):
        return align_batched(pairs)._replace(largest_cost=next(costs))

    stack = stack_of([(m, np.ones(len(m))) for m in clips(5, n_examples=3, n_columns=20)])
    repeat_passes(stack, stack.columns.shape[1], Learning(), engine)
    assert list(costs) == [1.0]


# --- engines


@pytest.mark.parametrize("seed", range(3))
def test_both_engines_learn_the_same_to_the_bit(seed):
    matrices = clips(seed, n_examples=3 + 4 * seed, n_columns=45, n_features=40)
    by_numpy = learn(matrices, engine="numpy")
    compiled = learn(matrices, engine="compiled")
    assert by_numpy.values.tobytes() == compiled.values.tobytes()
    assert by_numpy.weights.tobytes() == compiled.weights.tobytes()


def run_fresh(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_little_work_does_not_wait_for_numba():
    code = (
        "import sys; from motionary.models.templates import learn_template as learn\n"
        "learn([[[0], [1]], [[1], [1]]], feature_names=['a'], feature_set='a set')\n"
        "print('numba' in sys.modules)"
    )
    assert run_fresh(code) == "False"


def test_without_numba_auto_falls_back_and_compiled_says_what_to_install():
    code = (
        "import sys; sys.modules['numba'] = None\n"
        "from motionary.errors import InvalidInput\n"
        "from motionary.models.templates import learn_template as learn, alignment\n"
        "alignment.WORTH_LOADING = 0\n"
        "names = {'feature_names': ['a'], 'feature_set': 'a set'}\n"
        "print(learn([[[0]], [[1]]], **names).values.tolist())\n"
        "try: learn([[[0]], [[1]]], engine='compiled', **names)\n"
        "except InvalidInput as error: print('motionary[fast]' in str(error))"
    )
    assert run_fresh(code) == "[[0.5]]\nTrue"


# --- what was not seen


def test_masks_that_hide_nothing_change_nothing():
    matrices = clips(4, n_examples=5, n_columns=30)
    masked = learn(matrices, known=[np.ones(m.shape, bool) for m in matrices])
    plain = learn(matrices)
    assert np.array_equal(masked.values, plain.values)
    assert np.array_equal(masked.weights, plain.weights)


def test_an_unseen_entry_leaves_the_average():
    matrices = [np.array([[1, 0], [1, 1]])] * 3
    known = [np.ones((2, 2), bool) for _ in matrices]
    known[0][0, 0] = False
    seen = learn(matrices, known=known)
    assert seen.values.tolist() == [[1.0, 0.0], [1.0, 1.0]]


def test_the_value_of_an_unseen_entry_does_not_matter():
    matrices = clips(4, n_examples=5, n_columns=30)
    known = [np.random.default_rng(i).random(m.shape) < 0.8 for i, m in enumerate(matrices)]
    flipped = [np.where(k, m, 1 - m) for m, k in zip(matrices, known, strict=True)]
    assert np.array_equal(learn(matrices, known=known).values, learn(flipped, known=known).values)


def test_what_nobody_saw_is_left_open():
    matrices = clips(6, n_examples=4, n_columns=30)
    known = [np.ones(m.shape, bool) for m in matrices]
    for mask in known:
        mask[:, 3] = False
    assert (learn(matrices, known=known).values[:, 3] == 0.5).all()


# --- bad input


GOOD = np.zeros((3, 2))


@pytest.mark.parametrize(
    ("matrices", "changes", "packed"),
    [
        ([], {}, "at least one example"),
        ([GOOD, np.zeros((3, 4))], {}, r"\[2, 4\]"),
        ([GOOD, np.zeros(3)], {}, "columns, features"),
        ([GOOD, np.zeros((0, 2))], {}, "at least 1"),
        ([GOOD, GOOD + np.nan], {}, "numbers in"),
        ([GOOD, GOOD + 2], {}, "numbers in"),
        ([GOOD], {"known": []}, "one mask per example"),
        ([GOOD], {"known": [np.ones((2, 2), bool)]}, "one mask per example"),
        ([GOOD], {"engine": "fortran"}, "engine"),
        ([GOOD], {"feature_names": ["a"]}, "2 features"),
        ([GOOD], {"feature_set": ""}, "feature set"),
    ],
)
def test_bad_input_is_refused(matrices, changes, packed):
    settings = {"feature_names": ["a", "b"], "feature_set": "a set"} | changes
    with pytest.raises(InvalidInput, match=packed):
        learn_template(matrices, **settings)


@pytest.mark.parametrize(
    "settings",
    [
        {"stop": -1.0},
        {"stop": float("nan")},
        {"max_passes": 0},
        {"contract_at": 0.0},
        {"contract_at": 1.5},
    ],
)
def test_settings_without_sense_are_refused(settings):
    with pytest.raises(InvalidInput, match=next(iter(settings))):
        Learning(**settings)
