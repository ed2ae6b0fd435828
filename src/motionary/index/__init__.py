"""The words of a folder of recordings."""

from motionary.index.collection import Collection, collect, read_collection

__all__ = ["Collection", "collect", "read_collection"]
