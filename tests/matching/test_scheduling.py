"""Choosing among overlapping matches: against brute force, and what must hold."""

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.matching.scheduling import (
    ScheduleState,
    advance,
    choose_causally,
    choose_intervals,
    intervals,
    join_states,
)
from oracles import scheduling as oracle

ALIKE, SEVERAL = [7], [1, 2, 3, 4, 6, 7]


def random_intervals(seed, masks, *, most=10, span=24):
    """Intervals with values of which no two sets sum to the same, but for chance."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(0, most + 1))
    starts = rng.integers(0, span, n).astype(float)
    ends = starts + rng.integers(0, 10, n)
    return intervals(starts, ends, rng.normal(1, 2, n), rng.choice(masks, n))


def as_lists(given):
    bits = [{b for b in range(8) if mask >> b & 1} for mask in given.parts.tolist()]
    return list(zip(given.starts, given.ends, given.values, bits, strict=True))


@pytest.mark.parametrize("masks", [ALIKE, SEVERAL, [1, 2], [1, 2, 3]], ids=str)
@pytest.mark.parametrize("shrink", [0, 0.1, 0.3])
def test_the_chosen_set_has_the_largest_total(masks, shrink):
    for seed in range(25):
        given = random_intervals(seed, masks)
        chosen = choose_intervals(given, shrink=shrink)
        assert set(chosen.tolist()) == oracle.best_set(as_lists(given), shrink)
        assert (np.diff(given.ends[chosen]) >= 0).all()


@pytest.mark.parametrize("masks", [ALIKE, SEVERAL], ids=str)
@pytest.mark.parametrize("look_ahead", [0, 3, 8])
def test_each_end_is_decided_by_what_ended_shortly_after(masks, look_ahead):
    for seed in range(15):
        given = random_intervals(seed, masks, most=8)
        chosen = choose_causally(given, look_ahead=look_ahead, shrink=0.1)
        assert set(chosen.tolist()) == oracle.causal_set(as_lists(given), 0.1, look_ahead)
        assert (np.diff(given.ends[chosen]) >= 0).all()


@pytest.mark.parametrize("masks", [ALIKE, SEVERAL], ids=str)
def test_a_look_ahead_over_everything_chooses_the_best(masks):
    for seed in range(20):
        given = random_intervals(seed, masks, most=60, span=200)
        best, late = choose_intervals(given), choose_causally(given, look_ahead=1000)
        assert late.tolist() == sorted(best.tolist(), key=lambda i: (given.ends[i], i))


@pytest.mark.parametrize("masks", [ALIKE, SEVERAL], ids=str)
def test_chunks_of_any_length_give_the_same_choice(masks):
    for seed in range(12):
        given = random_intervals(seed, masks, most=80, span=200)
        order = np.argsort(given.ends, kind="stable")
        whole = choose_causally(given, look_ahead=12)
        rng = np.random.default_rng(seed)
        cuts = [*np.sort(rng.uniform(0, 210, 9)).tolist(), 80.0, np.inf]
        state, chosen, before = ScheduleState(), [], -np.inf
        for now in sorted(cuts):
            part = order[(given.ends[order] > before) & (given.ends[order] <= now)]
            chunk = intervals(*(field[part] for field in given))
            found, state = advance(state, chunk, now=now, look_ahead=12)
            assert (given.ends[order[found]] + 12 <= now).all()
            chosen += order[found].tolist()
            before = now
        assert chosen == whole.tolist()


def test_equal_totals_leave_out_the_interval_that_ends_last():
    given = intervals([0, 5], [10, 15], [1, 1])
    assert choose_intervals(given).tolist() == [0]


def test_labels_of_different_parts_may_overlap():
    arms, legs, both = 1, 2, 3
    starts, ends = [0, 0, 0], [10, 10, 10]
    assert choose_intervals(intervals(starts, ends, [2, 2, 3], [arms, legs, both])).tolist() == [
        0,
        1,
    ]
    assert choose_intervals(intervals(starts, ends, [2, 2, 5], [arms, legs, both])).tolist() == [2]


def test_many_intervals_of_several_parts_never_conflict_and_beat_one_mask():
    rng = np.random.default_rng(5)
    starts = np.sort(rng.uniform(0, 200, 500))
    ends = starts + rng.uniform(5, 60, 500)
    values, parts = rng.exponential(3, 500), rng.choice(SEVERAL, 500)
    given = intervals(starts, ends, values, parts)
    chosen = choose_intervals(given)
    assert oracle.fit([as_lists(given)[i] for i in chosen], 0.1)
    alone = choose_intervals(intervals(starts, ends, values))
    assert values[chosen].sum() >= values[alone].sum()
    assert values[chosen].sum() <= sum(
        values[choose_intervals(intervals(starts, ends, np.where(parts & bit, values, 0)))].sum()
        for bit in (1, 2, 4)
    )


WALK, KICK = 0, 1


@pytest.mark.parametrize(
    ("starts", "ends", "classes", "parts", "expected"),
    [
        ([0, 10, 20], [10, 20, 30], [WALK, WALK, WALK], 3, [0, 0, 0]),
        ([0, 14, 25], [10, 20, 30], [WALK, WALK, WALK], 3, [0, 0, 0]),
        ([0, 16], [10, 20], [WALK, WALK], 3, [0, 1]),
        ([0, 10, 20], [10, 20, 30], [KICK, KICK, KICK], 3, [0, 1, 2]),
        ([0, 10, 12], [10, 12, 30], [WALK, KICK, WALK], 3, [0, 1, 2]),
        ([0, 10, 12], [10, 12, 30], [WALK, KICK, WALK], [1, 2, 1], [0, 1, 0]),
        ([0, 9, 10], [10, 12, 30], [WALK, KICK, WALK], [1, 3, 1], [0, 1, 2]),
        ([], [], [], 3, []),
    ],
)
def test_neighbours_of_a_state_are_one_label(starts, ends, classes, parts, expected):
    given = intervals(starts, ends, np.ones(len(starts)), parts)
    is_state = np.array(classes) == WALK
    assert join_states(given, classes, is_state, most_gap=5).tolist() == expected


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0], [1, 2], [1]), "one length"),
        (([2], [1], [1]), "end before"),
        (([0], [np.nan], [1]), "finite"),
        (([0], [1], [1], 0), "part of the body"),
        (([0], [1], [1], [1, 2]), "parts need shape"),
    ],
)
def test_what_is_no_interval_is_refused(arguments, message):
    with pytest.raises(InvalidInput, match=message):
        intervals(*arguments)


def test_settings_and_order_are_checked():
    given = intervals([0, 1], [4, 3], [1, 1])
    with pytest.raises(InvalidInput, match="shrink"):
        choose_intervals(given, shrink=0.5)
    with pytest.raises(InvalidInput, match="look_ahead"):
        choose_causally(given, look_ahead=-1)
    with pytest.raises(InvalidInput, match="arrive by their ends"):
        advance(ScheduleState(), given, now=10, look_ahead=1)
    with pytest.raises(InvalidInput, match="arrive by their ends"):
        advance(ScheduleState(now=4), intervals([0], [4], [1]), now=10, look_ahead=1)
