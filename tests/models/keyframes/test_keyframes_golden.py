"""The authors' queries find what they found."""

import json
from pathlib import Path

import numpy as np
import pytest

from motionary.features import FULL_BODY
from motionary.io import QueryRecord, read_query_collections
from motionary.models.keyframes import (
    KeyframeQuery,
    format_query,
    from_patterns,
    index_packed,
    parse_query,
    search_query,
)


def query_of(record: QueryRecord) -> KeyframeQuery:
    return from_patterns(
        record.keyframes, record.groups, distances=record.distances,
        stiffness=record.stiffness, positions=record.positions,
    )  # fmt: skip


@pytest.fixture(scope="module")
def published(golden: Path) -> dict:
    """Table behind Table 2 of Baak, Müller and Seidel (2008), as the authors computed it."""
    return json.loads((golden / "keyframe_confusion_recall.json").read_text())


@pytest.fixture(scope="module")
def collections(golden: Path) -> dict:
    """The authors' queries, by collection and class."""
    return read_query_collections(golden / "manual_keyframes.json")


@pytest.fixture(scope="module")
def evaluation_words(hdm05: dict, golden: Path) -> dict:
    """Words of the evaluation half of the eleven classes that are complete."""
    halves = json.loads((golden / "half_split.json").read_text())
    return {name: [hdm05[clip] for clip in half["test"]] for name, half in halves.items()}


@pytest.mark.parametrize("engine", ["numpy", "compiled"])
def test_627_of_627_recall_values(published, collections, evaluation_words, engine):
    queries = collections["retrieval_2008"]
    agree, n_values = 0, 0
    for name, clips in evaluation_words.items():
        index = index_packed(
            [clip.packed for clip in clips], [clip.known for clip in clips],
            feature_set=FULL_BODY.name, feature_ids=FULL_BODY.ids,
        )  # fmt: skip
        column = published["classes"].index(name)
        for row, query_class in enumerate(published["classes"]):
            found = search_query(query_of(queries[query_class]), index, engine=engine)
            recall = len(found.hit_sequences) / len(clips)
            agree += abs(recall - published["recall"][row][column]) < 1e-9
            n_values += 1
    assert (agree, n_values) == (627, 627)


def test_share_of_stiff_gaps(published, collections):
    queries = collections["retrieval_2008"]
    stiffness = np.concatenate([queries[name].stiffness for name in published["classes"]])
    assert len(stiffness) == 221
    # 32.6 %; thesis 3.6.1: between 0.2 and 1.0, 31 % of them 0.9 or more.
    assert np.count_nonzero(stiffness >= 0.9) == 72
    assert (stiffness.min(), stiffness.max()) == (0.2, 1.0)


def test_all_published_queries_can_be_kept_as_text(collections):
    assert {name: len(queries) for name, queries in collections.items()} == {
        "retrieval_2008": 75,
        "annotation_2009": 127,
    }
    for queries in collections.values():
        for record in queries.values():
            query = query_of(record)
            assert parse_query(format_query(query)) == query
