"""Readers and writers, one module per file format."""

from motionary.io.finding import (
    find_recordings,
    match_recording,
    name_recordings,
    recording_name,
)
from motionary.io.labels.table import read_labels, write_labels
from motionary.io.reading import MOTION_SUFFIXES, read

__all__ = [
    "MOTION_SUFFIXES",
    "find_recordings",
    "match_recording",
    "name_recordings",
    "read",
    "read_labels",
    "recording_name",
    "write_labels",
]
