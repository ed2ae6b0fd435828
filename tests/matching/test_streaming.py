"""Paths in a stream are those of the whole, and known half a second after they end."""

import numpy as np
import pytest

from matching_cases import random_rows, words_and_mask
from motionary.matching import (
    PathScoreSettings,
    PathStream,
    Pattern,
    StateJoiner,
    cell_ratios,
    score_patterns,
)
from motionary.matching.path_scores import SETTLED

SETTINGS = PathScoreSettings(most_cost=0.7, least_score=-5.0)


def case(seed, *, n_features=20, entries=False, n_frames=150):
    """Patterns, their ratios, and features that often stay for a while."""
    rng = np.random.default_rng(seed)
    patterns, ratios = [], []
    for n in (1, 2, 3, 9, 14):
        values, fixed = words_and_mask(random_rows(rng, n, n_features, share_none=0.3), n_features)
        weights = rng.random((n, n_features)) * (rng.random((n, n_features)) < 0.9)
        patterns.append(Pattern(values, fixed, rng.random(n) + 0.5, weights if entries else None))
        prior = rng.uniform(0.1, 0.9, n_features)
        ratios.append(cell_ratios(rng.random((n, n_features)), prior, n_examples=3))
    rows = random_rows(rng, n_frames // 3, n_features, share_none=0.15)
    held = [
        row for row in rows for _ in range(int(rng.choice([1, 2, 3, 25], p=[0.4, 0.3, 0.25, 0.05])))
    ]
    return patterns, ratios, *words_and_mask(held, n_features)


@pytest.mark.parametrize(
    "options",
    [{}, {"entries": True}, {"n_features": 70}, {"n_features": 70, "entries": True}],
    ids=["plain", "weighed", "two integers", "two integers weighed"],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_paths_are_those_of_the_whole_sequence(seed, options):
    patterns, ratios, packed, known = case(seed, **options)
    stream, found = PathStream(patterns, ratios, SETTINGS), []
    for i, row in enumerate(zip(packed, known, strict=True)):
        settled = stream.push(*row)
        # A path that ends at frame e is known before frame e + SETTLED is over.
        assert all(i + 2 - SETTLED <= path.stop <= i + 1 for path in settled)
        found += settled
    found += stream.finish()
    whole = score_patterns(patterns, ratios, packed, known, settings=SETTINGS)
    names = ("patterns", "stops", "starts", "scores", "costs")
    columns = (getattr(whole, name).tolist() for name in names)
    expected = sorted(zip(*columns, strict=True))
    assert len(expected) > 30
    assert sorted((p.pattern, p.stop, p.start, p.score, p.cost) for p in found) == expected


def test_a_level_that_lasts_is_open_until_it_is_settled():
    patterns, ratios, packed, known = case(1)
    # The same frame again and again: every level lasts.
    stream, opened = PathStream(patterns, ratios, SETTINGS), []
    for i in range(3 * SETTLED):
        stream.push(packed[0], known[0])
        opened += [(i, path) for path in stream.find_open()]
    assert opened
    assert all(path.stop <= i and i + 1 - path.stop < SETTLED for i, path in opened)


def test_states_join_across_what_needs_other_parts():
    joiner = StateJoiner(5)
    numbers = [
        joiner.add(0, 10, 0, 1, is_state=True),
        joiner.add(11, 14, 1, 2, is_state=False),
        joiner.add(12, 20, 0, 1, is_state=True),
        joiner.add(21, 24, 1, 3, is_state=False),
        joiner.add(22, 30, 0, 1, is_state=True),
        joiner.add(36, 40, 0, 1, is_state=True),
    ]
    assert numbers == [0, 1, 0, 2, 3, 4]
