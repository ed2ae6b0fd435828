"""Cutting clips out of recordings, and naming them.

A clip of BVH, AMC and TRC is the file's own text: everything above the frames, then the lines of
its frames as they stand there, so that rig, channels and every digit stay. Only what counts the
frames changes: BVH and TRC state their number; AMC numbers them, in a clip from 1 on. C3D and npz
are read, cut and written: positions in metres, y up.

A clip is called after its recording, its label and its seconds, in letters that every file
system takes: `take_squat_1.20-3.40s.bvh`.

Conventions: frames as the file counts them, both ends included: BVH from 0, AMC as written.
"""

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
from motionary.io.finding import match_recording
from motionary.io.formats import WRITTEN_SUFFIXES, find_format, load_function
from motionary.io.formats.numbers import check_frames
from motionary.io.options import ReadOptions
from motionary.io.recordings import read, write
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
    pairs = [(track.recording.name, label) for track in tracks for label in track]
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
    options: ReadOptions | None = None,
    jobs: int = 1,
    on_done: Callable[[Clip], None] | None = None,
) -> Iterator[Clip | Failure[Clip]]:
    """Write clips, each whole or not at all; what cannot be cut does not stop the others.

    Acclaim clips get a copy of their skeleton beside them.

    Parameters
    ----------
    clips : from `plan_clips`; one that ends beyond its recording is renamed
    options : skeleton and rate, where files do not say them; labels that know their frames
        need no rate
    jobs : processes
    on_done : called after each clip
    """
    work = partial(_cut, options=options or ReadOptions())
    return map_ordered(work, clips, jobs=jobs, on_done=on_done)


class _Text(NamedTuple):
    """Lines of a file with their ends, and whether letters stand for bytes."""

    lines: list[str]
    is_raw: bool


def can_cut(path: str | Path) -> bool:
    """Whether clips can be cut out of a file, by its name."""
    form = find_format(path)
    return form is not None and bool(form.write)


def cut_file(
    path: str | Path,
    first_frame: int,
    last_frame: int,
    out: str | Path,
    *,
    options: ReadOptions | None = None,
) -> None:
    """Write some frames of a motion file as a file of the same format.

    Parameters
    ----------
    path : a recording in a format that is written; texts packed or not
    first_frame, last_frame : as the file counts its frames, both included
    out : file to write; packed where its name ends in .gz
    options : what C3D and npz do not say

    Raises
    ------
    UnreadableFile
        If the file is missing or broken, or of a format that clips cannot be cut out of.
    InvalidInput
        If these frames are not in the file.
    UnwritableFile
        If the clip cannot be written.
    """
    path, out = Path(path), Path(out)
    form = find_format(path)
    if form is None or not form.write:
        known = ", ".join(WRITTEN_SUFFIXES)
        raise UnreadableFile(f"{path}: clips can be cut out of {known}, not out of {path.suffix!r}")
    if out.exists() and out.samefile(path):
        raise UnwritableFile(f"{out}: would replace the recording; write to another folder")
    if not form.cut:
        motion = read(path, (options or ReadOptions()).for_file(path))
        start, stop = first_frame - motion.first_frame, last_frame - motion.first_frame + 1
        check_frames(
            first_frame,
            last_frame,
            first_number=motion.first_frame,
            n_frames=motion.n_frames,
            name=path.name,
        )
        write(motion.cut(start, stop), out)
        return
    text = _read(path)
    lines = load_function(form.cut)(text.lines, first_frame, last_frame, path.name)
    content = "".join(lines)
    if out.suffix.lower() == PACKED or not text.is_raw:
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


def _cut(clip: Clip, *, options: ReadOptions) -> Clip:
    source = clip.source
    if source is None:
        raise UnreadableFile(f"{clip.recording}: there is no recording of this name, or not one")
    label = clip.label
    if label.start_frame is None or label.end_frame is None:
        first, last, end_s = _frames(source, label, options)
        clip = _named_by_end(clip, end_s)
    else:
        first, last = label.start_frame, label.end_frame
    cut_file(source, first, last, clip.target, options=options)
    copy_skeleton(source, clip.target.parent, asf=options.acclaim_skeleton)
    return clip


def _named_by_end(clip: Clip, end_s: float) -> Clip:
    """The clip, called after the end of the recording where its label goes beyond."""
    said = f"-{clip.label.end_s:.2f}s"
    target = clip.target.with_name(clip.target.name.replace(said, f"-{end_s:.2f}s"))
    return clip._replace(target=clip.target if target.exists() else target)


def _frames(path: Path, label: Label, options: ReadOptions) -> tuple[int, int, float]:
    """Frames of a label that was made in seconds, and its end, both inside the recording."""
    # Frames and their rate alone count here.
    plain = ReadOptions(asf=options.acclaim_skeleton, rate_hz=options.rate_hz)
    motion = read(path, plain.for_file(path))
    first = max(round(label.start_s * motion.rate_hz), 0)
    stop = min(round(label.end_s * motion.rate_hz), motion.n_frames)
    if first >= stop:
        raise InvalidInput(
            f"{path.name}: lasts {motion.duration_s:.2f} s, asked for is {label.start_s:.2f} to "
            f"{label.end_s:.2f} s"
        )
    end_s = min(label.end_s, motion.duration_s)
    return motion.first_frame + first, motion.first_frame + stop - 1, end_s


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


def _read(path: Path) -> _Text:
    """Lines of a file; of a plain one byte for byte, whatever its encoding."""
    if path.suffix.lower() == PACKED:
        return _Text(_split(read_text(path)), is_raw=False)
    content = read_bytes(path)
    if content.startswith(_MARKS):
        return _Text(_split(read_text(path)), is_raw=False)
    return _Text(_split(content.decode("latin-1")), is_raw=True)


def _split(text: str) -> list[str]:
    # Not `splitlines`: in Latin-1 some letters would end a line.
    return re.findall(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+$", text)
