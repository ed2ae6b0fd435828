"""Reading and writing: recordings, labels, tables, collections of keyframe queries.

A module is imported when one of its names is first used (PEP 562): options are declared without
NumPy.
"""

from typing import TYPE_CHECKING

from motionary.lazy import lazy_names

if TYPE_CHECKING:
    from motionary.io.cutting import can_cut, copy_skeleton, cut_clips, cut_file, plan_clips
    from motionary.io.finding import (
        FileState,
        Sidecars,
        explain_unmatched,
        find_recordings,
        has_sidecar,
        match_recording,
        name_recordings,
        recording_name,
        scan_folder,
        split_files,
    )
    from motionary.io.formats import MOTION_SUFFIXES, WRITTEN_SUFFIXES, file_of, options_of
    from motionary.io.keyframe_collections import (
        QueryRecord,
        read_query_collections,
        read_query_record,
    )
    from motionary.io.labels import read_labels, write_labels
    from motionary.io.options import ReadOptions, find_skeleton, save_skeleton
    from motionary.io.recordings import read, read_all, read_poses, what_is_lost, write
    from motionary.io.text import (
        TAKE_MARK,
        Cell,
        format_suffix,
        read_text,
        stem_of,
        write_table,
        write_text,
    )

__all__ = [
    "MOTION_SUFFIXES", "TAKE_MARK", "WRITTEN_SUFFIXES", "Cell", "FileState", "QueryRecord",
    "ReadOptions",
    "Sidecars", "can_cut", "copy_skeleton", "cut_clips", "cut_file", "explain_unmatched", "file_of",
    "find_recordings", "find_skeleton", "format_suffix", "has_sidecar", "match_recording",
    "name_recordings", "options_of", "plan_clips", "read", "read_all", "read_labels", "read_poses",
    "read_query_collections", "read_query_record", "read_text", "recording_name", "save_skeleton",
    "scan_folder", "split_files", "stem_of", "what_is_lost", "write", "write_labels", "write_table",
    "write_text",
]  # fmt: skip

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "cutting": "can_cut copy_skeleton cut_clips cut_file plan_clips",
        "finding": (
            "FileState Sidecars explain_unmatched find_recordings has_sidecar match_recording "
            "name_recordings recording_name scan_folder split_files"
        ),
        "formats": "MOTION_SUFFIXES WRITTEN_SUFFIXES file_of options_of",
        "keyframe_collections": "QueryRecord read_query_collections read_query_record",
        "labels": "read_labels write_labels",
        "options": "ReadOptions find_skeleton save_skeleton",
        "recordings": "read read_all read_poses what_is_lost write",
        "text": "TAKE_MARK Cell format_suffix read_text stem_of write_table write_text",
    },
)
