"""The words of many recordings, in memory and kept on disk."""

from motionary.index.changes import Changes
from motionary.index.collection import (
    Collection,
    Part,
    collect,
    join_collections,
    read_collection,
)
from motionary.index.folder import CACHE_VARIABLE, Index
from motionary.index.shard import Shard

__all__ = [
    "CACHE_VARIABLE",
    "Changes",
    "Collection",
    "Index",
    "Part",
    "Shard",
    "collect",
    "join_collections",
    "read_collection",
]
