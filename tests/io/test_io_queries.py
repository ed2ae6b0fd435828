"""Collections of keyframe queries as files."""

import json

import pytest

from motionary.errors import UnreadableFile
from motionary.io import QueryRecord, read_query_collections

ENTRY = {
    "groups": ["mix", "lower"],
    "keyframes": ["11*1", "0*1"],
    "positions": [4, 12],
    "distances": [8],
    "stiffness": [1],
    "template_length": 20,
}


def written(tmp_path, content):
    path = tmp_path / "queries.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), "utf-8")
    return path


def test_a_collection_is_read(tmp_path):
    path = written(tmp_path, {"mine": {"cartwheel": ENTRY}, "empty": {}})
    record = QueryRecord(("11*1", "0*1"), ("mix", "lower"), (8,), (1.0,), (3, 11), 20)
    assert read_query_collections(path) == {"mine": {"cartwheel": record}, "empty": {}}


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("{", "is no JSON file"),
        ("[" * 100_000, "is no JSON file"),
        ([], "an object of collections"),
        ({"mine": []}, "an object of collections"),
        ({"mine": {"a": 3}}, "query 'mine/a': needs to be an object"),
        ({"mine": {"a": {"groups": []}}}, "query 'mine/a': lacks keyframes, distances"),
        ({"mine": {"a": {**ENTRY, "keyframes": "11"}}}, "keyframes is not what it should be"),
        ({"mine": {"a": {**ENTRY, "keyframes": [1, 0]}}}, "keyframes is not what it should be"),
        ({"mine": {"a": {**ENTRY, "distances": [1.5]}}}, "distances is not what it should be"),
        ({"mine": {"a": {**ENTRY, "stiffness": [True]}}}, "stiffness is not what it should be"),
        ({"mine": {"a": {**ENTRY, "template_length": "20"}}}, "template_length is not what"),
        ({"mine": {"a": {**ENTRY, "distances": []}}}, "2 keyframes do not go with 0 distances"),
        ({"mine": {"a": {**ENTRY, "groups": ["mix"]}}}, "2 keyframes do not go with 1 groups"),
        ({"mine": {"a": {**ENTRY, "positions": [0, 3]}}}, "positions lie outside the template"),
        ({"mine": {"a": {**ENTRY, "positions": [4, 21]}}}, "positions lie outside the template"),
    ],
)
def test_malformed_collections(tmp_path, content, complaint):
    with pytest.raises(UnreadableFile, match=complaint):
        read_query_collections(written(tmp_path, content))


def test_an_empty_query_is_malformed(tmp_path):
    empty = {key: [] for key in ENTRY} | {"template_length": 3}
    with pytest.raises(UnreadableFile, match="0 keyframes do not go with"):
        read_query_collections(written(tmp_path, {"mine": {"a": empty}}))


def test_a_missing_file(tmp_path):
    with pytest.raises(UnreadableFile, match="cannot be read"):
        read_query_collections(tmp_path / "none.json")
