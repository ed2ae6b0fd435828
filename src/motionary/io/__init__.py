"""Readers and writers, one module per file format."""

from motionary.io.finding import (
    FileState,
    find_recordings,
    match_recording,
    name_recordings,
    recording_name,
    scan_folder,
)
from motionary.io.labels.table import read_labels, write_labels
from motionary.io.reading import MOTION_SUFFIXES, options_of, read
from motionary.io.sidecars import Sidecars, has_sidecar
from motionary.io.suffixes import format_suffix, stem_of
from motionary.io.writing import WRITTEN_SUFFIXES, what_is_lost, write

__all__ = [
    "MOTION_SUFFIXES",
    "WRITTEN_SUFFIXES",
    "FileState",
    "Sidecars",
    "find_recordings",
    "format_suffix",
    "has_sidecar",
    "match_recording",
    "name_recordings",
    "options_of",
    "read",
    "read_labels",
    "recording_name",
    "scan_folder",
    "stem_of",
    "what_is_lost",
    "write",
    "write_labels",
]
