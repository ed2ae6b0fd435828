"""The features of many recordings, in memory and kept on disk."""

from motionary.retrieval.index.changes import Changes
from motionary.retrieval.index.collection import (
    LARGE_COLLECTION,
    Collection,
    Part,
    Portion,
    Sources,
    collect,
    join_collections,
    read_collection,
)
from motionary.retrieval.index.folder import Index
from motionary.retrieval.index.shard import Shard, StoredShard
from motionary.retrieval.index.storage import CACHE_VARIABLE

__all__ = [
    "CACHE_VARIABLE",
    "LARGE_COLLECTION",
    "Changes",
    "Collection",
    "Index",
    "Part",
    "Portion",
    "Shard",
    "Sources",
    "StoredShard",
    "collect",
    "join_collections",
    "read_collection",
]
