"""Cutting clips out of recordings, and naming them.

A clip keeps what stands in the file, so that rig, channels, analog signals and every digit stay:
of texts everything above the frames, then the lines of its frames; of C3D its blocks; of npz its
arrays. Only what counts the frames changes: BVH and TRC state their number; AMC numbers them, in
a clip from 1 on.

A clip is called after its recording, its label and its seconds, in letters that every file
system takes: `take_squat_1.20-3.40s.bvh`. One that ends with its recording is called by that end.

Conventions: frames as the file counts them, both ends included: BVH from 0, others as written.
"""

import dataclasses
import re
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from motionary.batch import Failure, map_ordered
from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.files import read_bytes, write_atomically
from motionary.io.finding import explain_unmatched, match_recording
from motionary.io.formats import FORMATS, find_format, load_function, split_take
from motionary.io.formats.content import at_fault
from motionary.io.options import ReadOptions
from motionary.io.recordings import read
from motionary.io.text import PACKED, format_suffix, read_text, stem_of, write_text
from motionary.labels import Label, LabelTrack

_LONGEST = 80
_MARKS = (b"\xff\xfe", b"\xfe\xff")


class Clip(NamedTuple):
    """A segment of a recording that becomes a file.

    Attributes
    ----------
    recording : name of the recording, as the label has it
    label : what was labelled
    source : the recording's file; None if there is none of its name
    target : file of the clip
    problem : why there is no source
    """

    recording: str
    label: Label
    source: Path | None
    target: Path
    problem: str = ""


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
    tracks = [track for track in tracks if len(track)]
    pairs = [(track.recording.name, label) for track in tracks for label in track]
    names = {track.recording.name: match_recording(track.recording.name, files) for track in tracks}
    problems = {name: explain_unmatched([name], files)[0] for name in names if not names[name]}
    stems = _stems({name for name in names.values() if name is not None})
    clips: list[Clip] = []
    taken: set[str] = set()
    for recording, label in pairs:
        name = names[recording]
        stem = stems[name] if name is not None else _plain(stem_of(recording))
        title = f"{stem}_{_plain(label.name)}_{_seconds(label)}"
        suffix = format_suffix(name or recording)
        target, number = f"{title}{suffix}", 2
        while target.casefold() in taken:
            target, number = f"{title}-{number}{suffix}", number + 1
        taken.add(target.casefold())
        source = None if name is None else files[name]
        problem = problems.get(recording, "")
        clips.append(Clip(recording, label, source, Path(folder, target), problem))
    return clips


def cut_clips(
    clips: Iterable[Clip],
    *,
    options: ReadOptions | None = None,
    replace: bool = False,
    jobs: int = 1,
    on_done: Callable[[Clip], None] | None = None,
) -> Iterator[Clip | Failure[Clip]]:
    """Write clips, each whole or not at all; what cannot be cut does not stop the others.

    Acclaim clips get a copy of their skeleton beside them. A clip whose label reaches beyond its
    recording comes back with the label and the file's name that end with the recording.

    Parameters
    ----------
    clips : from `plan_clips`
    options : skeleton and rate, where files do not say them; labels that know their frames
        need no rate
    replace : whether a clip that is called by the end of its recording may replace a file
    jobs : processes
    on_done : called after each clip
    """
    work = partial(_cut, options=options or ReadOptions(), replace=replace)
    return map_ordered(work, clips, jobs=jobs, on_done=on_done)


def can_cut(path: str | Path) -> bool:
    """Whether clips can be cut out of a file, by its name."""
    form = find_format(path)
    return form is not None and bool(form.cut)


def cut_file(
    path: str | Path,
    first_frame: int,
    last_frame: int,
    out: str | Path,
    *,
    take: str | int | None = None,
) -> None:
    """Write some frames of a motion file as a file of the same format.

    Parameters
    ----------
    path : a recording in a format that is written; texts packed or not
    first_frame, last_frame : as the file counts its frames, both included
    out : file to write; packed where its name ends in .gz
    take : which recording of a batch

    Raises
    ------
    UnreadableFile
        If the file is missing or broken, or of a format that clips cannot be cut out of.
    InvalidInput
        If these frames are not in the file.
    UnwritableFile
        If the clip cannot be written.
    """
    out = Path(out)
    path, named = split_take(path)
    take = take if take is not None else named or None
    form = find_format(path)
    if form is None or not form.cut:
        known = ", ".join(form.suffix for form in FORMATS if form.cut)
        raise UnreadableFile(
            f"clips can be cut out of {known}, not out of {path.suffix!r}; convert it first",
            file=path,
        )
    if out.exists() and out.samefile(path):
        raise UnwritableFile("would replace the recording; write to another folder", file=out)
    if not form.is_text:
        clip: bytes = load_function(form.cut)(path, first_frame, last_frame, take)
        with write_atomically(out) as beside:
            beside.write_bytes(clip)
        return
    lines, is_raw = _read(path)
    with at_fault(path.name):
        content = "".join(load_function(form.cut)(lines, first_frame, last_frame))
    if out.suffix.lower() == PACKED or not is_raw:
        write_text(out, content)
        return
    with write_atomically(out) as beside:
        beside.write_bytes(content.encode("latin-1"))


def copy_skeleton(path: str | Path, folder: str | Path, *, asf: str | Path | None = None) -> None:
    """Copy the skeleton of an Acclaim motion to where its clips are; others need none.

    The copy is called as the skeleton is, or as the motion where that name would not lead
    to it. What is there already stays.

    Raises
    ------
    UnreadableFile
        If the skeleton is not found.
    UnwritableFile
        If it cannot be written.
    """
    path, folder = Path(path), Path(folder)
    if format_suffix(path).removesuffix(PACKED) != ".amc":
        return
    from motionary.io.formats.asf import find_asf

    source = find_asf(path) if asf is None else Path(asf)
    stem = stem_of(path)
    leads_to_it = stem == source.stem or stem.startswith(f"{source.stem}_")
    target = folder / (source.name if leads_to_it else f"{stem}.asf")
    if not target.exists():
        with write_atomically(target) as beside:
            shutil.copyfile(source, beside)


def _cut(clip: Clip, *, options: ReadOptions, replace: bool) -> Clip:
    source = clip.source
    if source is None:
        raise UnreadableFile(clip.problem)
    label = clip.label
    if label.start_frame is None or label.end_frame is None:
        part = _frames(source, label, options)
        first, last = part.first, part.last
        clip = _end_with(clip, part.end_s, replace=replace)
    else:
        first, last = label.start_frame, label.end_frame
    cut_file(source, first, last, clip.target, take=options.take)
    copy_skeleton(source, clip.target.parent, asf=options.acclaim_skeleton)
    return clip


def _end_with(clip: Clip, end_s: float, *, replace: bool) -> Clip:
    """The clip, its label and name cut at the end of its recording."""
    label = dataclasses.replace(clip.label, end_s=min(clip.label.end_s, end_s))
    before, after = _seconds(clip.label), _seconds(label)
    if before == after:
        return clip
    target = clip.target.with_name(clip.target.name.replace(before, after, 1))
    if target.exists() and not replace:
        raise UnwritableFile(
            "exists; say --force to replace it, or name another place", file=target
        )
    return clip._replace(label=label, target=target)


class _Part(NamedTuple):
    """First and last frame of a label in its recording, and where the recording ends."""

    first: int
    last: int
    end_s: float


def _frames(path: Path, label: Label, options: ReadOptions) -> _Part:
    """Frames of a label that was made in seconds, cut at the ends of the recording."""
    # Frames and their rate alone count here.
    plain = ReadOptions(
        asf=options.acclaim_skeleton,
        rate_hz=options.rate_hz,
        trust_points=options.trust_points,
        take=options.take,
    )
    motion = read(path, plain.for_file(path))
    first = max(round(label.start_s * motion.rate_hz), 0)
    stop = min(round(label.end_s * motion.rate_hz), motion.n_frames)
    if first >= stop:
        raise InvalidInput(
            f"lasts {motion.duration_s:.2f} s, asked for is {label.start_s:.2f} to "
            f"{label.end_s:.2f} s",
            file=path.name,
        )
    number = motion.first_frame
    return _Part(number + first, number + stop - 1, motion.duration_s)


def _seconds(label: Label) -> str:
    return f"{label.start_s:.2f}-{label.end_s:.2f}s"


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


def _read(path: Path) -> tuple[list[str], bool]:
    """Lines of a file with their ends, and whether they are its bytes, whatever its encoding."""
    content = b"" if path.suffix.lower() == PACKED else read_bytes(path)
    is_raw = path.suffix.lower() != PACKED and not content.startswith(_MARKS)
    text = content.decode("latin-1") if is_raw else read_text(path)
    # Not `splitlines`: in Latin-1 some letters would end a line.
    return re.findall(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+$", text), is_raw
