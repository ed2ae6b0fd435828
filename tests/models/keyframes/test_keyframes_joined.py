"""Two queries with a pause find a sequence of real clips, and only it."""

import numpy as np
import pytest

from motionary.features import FULL_BODY, FeatureSequence, read_features
from motionary.io import read_query_collections
from motionary.models.keyframes import from_patterns, index_packed, join_queries, search_query

FIRST, SECOND, OTHER = "elbowToKnee1RepsLelbowStart", "squat1Reps", "throwBasketball"
#: Actors of whom clips are joined.
ACTORS = ("bd", "mm")


@pytest.fixture(scope="module")
def clips(data):
    """Words of a clip of each class by actor."""
    paths = {
        (name, actor): min((data / "hdm05" / name).glob(f"HDM_{actor}_*.[aA][mM][cC]"))
        for name in (FIRST, SECOND, OTHER)
        for actor in ACTORS
    }
    packed = read_features([(path.name, path) for path in paths.values()])
    return dict(zip(paths, packed, strict=True))


@pytest.fixture(scope="module")
def query(golden):
    records = read_query_collections(golden / "manual_keyframes.json")["retrieval_2008"]
    first, second = (
        from_patterns(
            record.keyframes, record.groups, distances=record.distances,
            stiffness=record.stiffness, positions=record.positions,
        )
        for record in (records[FIRST], records[SECOND])
    )  # fmt: skip
    return join_queries(first, second, least_s=0.0, most_s=2.0)


def joined(*parts: FeatureSequence) -> FeatureSequence:
    return FeatureSequence(
        np.concatenate([part.packed for part in parts]),
        np.concatenate([part.known for part in parts]),
        FULL_BODY,
    )


@pytest.mark.parametrize("actor", ACTORS)
def test_a_joined_query_finds_the_sequence_and_only_it(clips, query, actor):
    first, second, other = (clips[name, actor] for name in (FIRST, SECOND, OTHER))
    assert len(other) > 60
    documents = {
        "at once": joined(other, first, second, other),
        "short pause": joined(other, first, other.part(0, 15), second, other),
        "first alone": joined(other, first, other),
        "second alone": joined(other, second, other),
        "wrong order": joined(other, second, other.part(0, 15), first, other),
        "pause too long": joined(other, first, other, other, second, other),
    }
    index = index_packed(
        [document.packed for document in documents.values()],
        [document.known for document in documents.values()],
        feature_set=FULL_BODY.name, feature_ids=FULL_BODY.ids,
    )  # fmt: skip
    found = search_query(query, index)
    assert found.hit_sequences.tolist() == [0, 1]
    before = len(other)
    for document, start, stop in found:
        pause = 15 * document
        assert before <= start < before + len(first)
        assert stop <= before + len(first) + pause + len(second)
        assert stop > before + len(first) + pause
