"""Clips of hits or labels, for several commands."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from motionary.cli import screen

if TYPE_CHECKING:
    from motionary.io import ReadOptions
    from motionary.labels import LabelTrack


def cut_labels(
    tracks: "Iterable[LabelTrack]",
    files: Mapping[str, Path],
    folder: str,
    *,
    reading: "ReadOptions",
    jobs: int,
) -> bool:
    """Write a clip a label; tells what could not be cut. Whether all could."""
    from motionary.batch import Failure
    from motionary.io import cut_clips, plan_clips

    clips = plan_clips(tracks, files, folder)
    failures = []
    with screen.progress("cutting", len(clips)) as done:
        written = cut_clips(clips, options=reading, jobs=jobs, on_done=done)
        failures = [clip for clip in written if isinstance(clip, Failure)]
    for failure in failures:
        screen.warn(f"{failure.item.target.name}: {failure.error}")
    screen.warn(f"{len(clips) - len(failures)} of {len(clips)} clips written to {folder}")
    return not failures
