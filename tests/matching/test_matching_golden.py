"""The authors' hits in the cut of HDM_mm_3-5_c of 2006: a worked example of steps and exclusion.

Their templates are not at hand, so what is checked is what the printed paths and intervals
say by themselves, and that documents that follow these paths are matched along them.
"""

import json

import numpy as np
import pytest

from motionary.matching import Pattern, align, distance_function, find_hits
from motionary.packing import full_mask, pack
from oracles import matching as oracle

N_COLUMNS = {"elbowToKnee": 36, "jumpingJack": 34}
N_FRAMES = 1073


@pytest.fixture(scope="module")
def authors(golden):
    """Hits by class, with frames and columns counted from 0 and half-open."""
    table = json.loads((golden / "hits_HDM_mm_3-5_c.json").read_text(encoding="utf-8"))
    return {
        name: [
            (np.array(hit["path"]) - 1, (hit["first"] - 1, hit["last"], hit["cost"]))
            for hit in hits
        ]
        for name, hits in table["hits"].items()
    }


@pytest.fixture(params=sorted(N_COLUMNS))
def hits_of_class(request, authors):
    return N_COLUMNS[request.param], authors[request.param]


def test_paths_run_through_the_whole_template_in_the_three_steps(hits_of_class):
    n_columns, hits = hits_of_class
    for path, (start, stop, _) in hits:
        assert path[0].tolist() == [0, start]
        assert path[-1].tolist() == [n_columns - 1, stop - 1]
        assert {tuple(step) for step in np.diff(path, axis=0).tolist()} <= set(oracle.STEPS)


def test_counted_twice_after_a_double_step_every_path_counts_each_column_once(hits_of_class):
    # So dividing by the number of columns makes Delta a mean; counted once, it would not.
    n_columns, hits = hits_of_class
    for path, _ in hits:
        doubles = int((np.diff(path[:, 0]) == 2).sum())
        assert doubles > 0
        assert len(path) + doubles == n_columns
        assert len(path) < n_columns


def test_hits_stand_in_the_order_of_their_costs(hits_of_class):
    costs = [hit[2] for _, hit in hits_of_class[1]]
    assert costs == sorted(costs)


def test_no_hit_excludes_a_later_one(hits_of_class):
    hits = [hit for _, hit in hits_of_class[1]]
    for i, (start, stop, _) in enumerate(hits):
        assert not any(oracle.is_excluded(start, stop - 1, earlier) for earlier in hits[:i])


@pytest.fixture
def followed(hits_of_class):
    """A pattern, and a document that agrees with it along the authors' paths only."""
    n_columns, hits = hits_of_class
    rng = np.random.default_rng(35)
    values = rng.random((n_columns, 200)) < 0.5
    frames = rng.random((N_FRAMES, 200)) < 0.5
    # Later hits agree a little less, to be found later; two share a frame, the better gets it.
    for number, (path, _) in reversed(list(enumerate(hits))):
        frames[path[:, 1]] = values[path[:, 0]]
        frames[path[:, 1], : 2 * number] ^= True
    return Pattern(pack(values), full_mask(n_columns, 200), np.ones(n_columns)), pack(frames)


def test_a_document_that_follows_the_paths_is_matched_along_them(followed, hits_of_class):
    pattern, packed = followed
    taken: set[int] = set()
    for path, (start, stop, _) in hits_of_class[1]:
        found = align(pattern, packed, None, [stop - 1])[0]
        own = [tuple(cell) for cell in path.tolist() if cell[1] not in taken]
        assert len(own) >= len(path) - 1
        assert set(own) <= {tuple(cell) for cell in found.path.tolist()}
        assert found.start == start
        taken |= set(path[:, 1].tolist())


def test_a_document_that_follows_the_paths_has_the_authors_hits(followed, hits_of_class):
    pattern, packed = followed
    distance = distance_function(pattern, packed)
    found = find_hits(distance, pattern, packed, threshold=0.3)
    expected = [hit[:2] for _, hit in hits_of_class[1]]
    # The frame that two hits share is the last of the worse one, which may end beside it.
    np.testing.assert_allclose([hit[:2] for hit in found], expected, atol=1)
    assert [hit[:2] for hit in found[:-1]] == expected[:-1]
