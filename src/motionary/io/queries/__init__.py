"""Readers of keyframe queries, one module per file format."""

from motionary.io.queries.keyframe_collections import QueryRecord, read_query_collections

__all__ = ["QueryRecord", "read_query_collections"]
