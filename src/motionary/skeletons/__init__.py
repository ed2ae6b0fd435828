"""Known skeletons: how the names of a file give the 24 generic joints."""

from motionary.skeletons.mapping import find_mapping, known_mappings, named_mapping

__all__ = ["find_mapping", "known_mappings", "named_mapping"]
