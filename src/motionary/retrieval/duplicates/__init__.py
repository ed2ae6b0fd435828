"""The same motion in different files: across rigs and rates, cut, mirrored."""

from motionary.retrieval.duplicates.finding import (
    Comparing,
    Duplicate,
    DuplicateResult,
    Stretch,
    find_duplicates,
)

__all__ = ["Comparing", "Duplicate", "DuplicateResult", "Stretch", "find_duplicates"]
