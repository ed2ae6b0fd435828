"""Skeletons: how the names of a file, and the shape of its tree, give the 24 generic joints."""

from motionary.skeletons.guessing import without_guess
from motionary.skeletons.mapping import (
    find_mapping,
    known_mappings,
    map_joints,
    named_mapping,
    named_table,
)
from motionary.skeletons.table_files import SkeletonTable, format_table, parse_table

__all__ = [
    "SkeletonTable", "find_mapping", "format_table", "known_mappings", "map_joints",
    "named_mapping", "named_table", "parse_table", "without_guess",
]  # fmt: skip
