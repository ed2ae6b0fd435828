"""The words of a folder of recordings."""

from motionary.index.collection import Collection, collect

__all__ = ["Collection", "collect"]
