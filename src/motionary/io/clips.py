"""Which clips do labels make, and what are they called?

A clip is called after its recording, its label and its seconds, in letters that every file
system takes: `take_squat_1.20-3.40s.bvh`.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from motionary.batch import Failure, map_ordered
from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.cutting import copy_skeleton, cut_file
from motionary.io.finding import match_recording
from motionary.io.reading import options_of, read
from motionary.io.suffixes import format_suffix, stem_of
from motionary.labels import Label, LabelTrack

_LONGEST = 80


class Clip(NamedTuple):
    """A stretch of a recording that becomes a file.

    Attributes
    ----------
    recording : name of the recording, as the label has it
    label : what was labelled
    source : the recording's file; None if there is none of its name
    target : file of the clip
    """

    recording: str
    label: Label
    source: Path | None
    target: Path


def plan_clips(
    tracks: Iterable[LabelTrack], files: Mapping[str, Path], folder: str | Path
) -> list[Clip]:
    """Clips of labels, in their order, each with a file of its own.

    Parameters
    ----------
    tracks : labels
    files : recordings by name; a label's recording is matched as in `match_recording`
    folder : where the clips go
    """
    pairs = [(track.recording, label) for track in tracks for label in track]
    names = {recording: match_recording(recording, files) for recording, _ in pairs}
    stems = _stems({name for name in names.values() if name is not None})
    clips: list[Clip] = []
    taken: set[str] = set()
    for recording, label in pairs:
        name = names[recording]
        stem = stems[name] if name is not None else _plain(stem_of(recording))
        title = f"{stem}_{_plain(label.name)}_{label.start_s:.2f}-{label.end_s:.2f}s"
        suffix = format_suffix(name or recording)
        target, number = f"{title}{suffix}", 2
        while target.casefold() in taken:
            target, number = f"{title}-{number}{suffix}", number + 1
        taken.add(target.casefold())
        source = None if name is None else files[name]
        clips.append(Clip(recording, label, source, Path(folder, target)))
    return clips


def cut_clips(
    clips: Iterable[Clip],
    *,
    asf: str | None = None,
    rate_hz: float | None = None,
    jobs: int = 1,
    on_done: Callable[[Clip], None] | None = None,
) -> Iterator[Clip | Failure[Clip]]:
    """Write clips, each whole or not at all; what cannot be cut does not stop the others.

    Acclaim clips get a copy of their skeleton beside them.

    Parameters
    ----------
    clips : from `plan_clips`
    asf : skeleton of Acclaim motions, where it is told
    rate_hz : frames per second, where files do not say it; labels that know their frames
        need none
    jobs : processes
    on_done : called after each clip
    """
    work = partial(_cut, asf=asf, rate_hz=rate_hz)
    return map_ordered(work, clips, jobs=jobs, on_done=on_done)


def _cut(clip: Clip, *, asf: str | None, rate_hz: float | None) -> Clip:
    if clip.source is None:
        raise UnreadableFile(f"{clip.recording}: there is no recording of this name, or not one")
    label = clip.label
    if label.start_frame is None or label.end_frame is None:
        first, last = _frames(clip.source, label, asf, rate_hz)
    else:
        first, last = label.start_frame, label.end_frame
    cut_file(clip.source, first, last, clip.target)
    copy_skeleton(clip.source, clip.target.parent, asf=asf)
    return clip


def _frames(path: Path, label: Label, asf: str | None, rate_hz: float | None) -> tuple[int, int]:
    """Frames of a label that was made in seconds, cut at the ends of the recording."""
    takes = options_of(path)
    motion = read(path, asf=asf if "asf" in takes else None, rate_hz=rate_hz)
    first = max(round(label.start_s * motion.rate_hz), 0)
    stop = min(round(label.end_s * motion.rate_hz), motion.n_frames)
    if first >= stop:
        raise InvalidInput(
            f"{path.name}: lasts {motion.duration_s:.2f} s, asked for is {label.start_s:.2f} to "
            f"{label.end_s:.2f} s"
        )
    return motion.first_frame + first, motion.first_frame + stop - 1


def _stems(names: Iterable[str]) -> dict[str, str]:
    """What clips of each recording begin with: its stem, or its path if that is not one."""
    names = sorted(names)
    counts = Counter(stem_of(name).casefold() for name in names)
    return {
        name: _plain(
            stem_of(name)
            if counts[stem_of(name).casefold()] == 1
            else "_".join([*PurePosixPath(name).parts[:-1], stem_of(name)])
        )
        for name in names
    }


def _plain(text: str) -> str:
    return re.sub(r"[^\w.+-]+", "_", text).strip("._")[:_LONGEST] or "clip"
