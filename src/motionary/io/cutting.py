"""Which lines of a motion file are a clip?

A clip is the file's own text: everything above the frames, then the lines of its frames as
they stand there, so that rig, channels and every digit stay. Only what counts the frames
changes: BVH states their number; AMC numbers them, in a clip from 1 on.

Conventions: frames as the file counts them, both ends included: BVH from 0, AMC as written.
"""

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from motionary.batch import write_atomically
from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.io.suffixes import PACKED, format_suffix, stem_of
from motionary.io.text import read_text, write_text

_CHANNELS = re.compile(r"^\s*CHANNELS\s+(\d+)", re.MULTILINE | re.IGNORECASE)
_COUNT = re.compile(r"(Frames\s*:\s*)\d+", re.IGNORECASE)
_MARKS = (b"\xff\xfe", b"\xfe\xff")


class _Text(NamedTuple):
    """Lines of a file with their ends, and whether letters stand for bytes."""

    lines: list[str]
    is_raw: bool


def can_cut(path: str | Path) -> bool:
    """Whether clips can be cut out of a file, by its name."""
    return _suffix(path) in _CUTTERS


def cut_file(path: str | Path, first_frame: int, last_frame: int, out: str | Path) -> None:
    """Write some frames of a motion file as a file of the same format.

    Parameters
    ----------
    path : BVH or AMC, packed or not
    first_frame, last_frame : as the file counts its frames, both included
    out : file to write; packed where its name ends in .gz

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
    if not can_cut(path):
        raise UnreadableFile(
            f"{path}: clips can be cut out of {', '.join(_CUTTERS)}, not out of {path.suffix!r}"
        )
    if out.exists() and out.samefile(path):
        raise UnwritableFile(f"{out}: would replace the recording; write to another folder")
    text = _read(path)
    lines = _CUTTERS[_suffix(path)](text.lines, first_frame, last_frame, path.name)
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
    if _suffix(path) != ".amc":
        return
    from motionary.io.formats.acclaim import find_asf

    source = find_asf(path) if asf is None else Path(asf)
    stem = stem_of(path)
    leads_to_it = stem == source.stem or stem.startswith(f"{source.stem}_")
    target = folder / (source.name if leads_to_it else f"{stem}.asf")
    if not target.exists():
        with write_atomically(target) as beside:
            shutil.copyfile(source, beside)


def _cut_bvh(lines: list[str], first: int, last: int, name: str) -> list[str]:
    motion = _find(lines, r"MOTION")
    count = _find(lines, r"Frames\s*:\s*\d+", motion + 1)
    time = _find(lines, r"Frame\s+Time\s*:\s*\S+", count + 1)
    if len(lines) in (motion, count, time):
        raise UnreadableFile(f"{name}: no MOTION with 'Frames:' and 'Frame Time:' found")
    frames = [line for line in lines[time + 1 :] if line.strip()]
    _check_range(first, last, 0, len(frames), name)
    chosen = frames[first : last + 1]
    n_channels = sum(map(int, _CHANNELS.findall("".join(lines[:motion]))))
    if any(len(line.split()) != n_channels for line in chosen):
        raise UnreadableFile(
            f"{name}: a frame does not stand on one line of {n_channels} numbers, so that it "
            "cannot be cut out"
        )
    header = lines[: time + 1]
    header[count] = _COUNT.sub(rf"\g<1>{len(chosen)}", header[count])
    return header + _ended(chosen, lines[time])


def _cut_amc(lines: list[str], first: int, last: int, name: str) -> list[str]:
    starts = [i for i, line in enumerate(lines) if line.strip().isdecimal()]
    if not starts:
        raise UnreadableFile(f"{name}: no frame number found; expected an Acclaim motion (AMC)")
    first_number = int(lines[starts[0]])
    _check_range(first, last, first_number, len(starts), name)
    starts.append(len(lines))
    clip = lines[: starts[0]]
    for number, place in enumerate(range(first - first_number, last - first_number + 1), start=1):
        start, stop = starts[place], starts[place + 1]
        if int(lines[start]) != first_number + place:
            raise UnreadableFile(f"{name}: frame {first_number + place} is missing")
        clip.append(re.sub(r"\d+", str(number), lines[start], count=1))
        clip += lines[start + 1 : stop]
    return _ended(clip, lines[starts[0]])


_CUTTERS: dict[str, Callable[[list[str], int, int, str], list[str]]] = {
    ".amc": _cut_amc,
    ".bvh": _cut_bvh,
}


def _suffix(path: str | Path) -> str:
    return format_suffix(path).removesuffix(PACKED)


def _read(path: Path) -> _Text:
    """Lines of a file; of a plain one byte for byte, whatever its encoding."""
    if path.suffix.lower() == PACKED:
        return _Text(_split(read_text(path)), is_raw=False)
    try:
        content = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise UnreadableFile(f"{path}: cannot be read: {reason}") from error
    if content.startswith(_MARKS):
        return _Text(_split(read_text(path)), is_raw=False)
    return _Text(_split(content.decode("latin-1")), is_raw=True)


def _split(text: str) -> list[str]:
    # Not `splitlines`: in Latin-1 some letters would end a line.
    return re.findall(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+$", text)


def _ended(lines: list[str], model: str) -> list[str]:
    """Lines of which the last one ends as another does."""
    end = model[len(model.rstrip("\r\n")) :]
    return [*lines[:-1], lines[-1].rstrip("\r\n") + end]


def _find(lines: list[str], pattern: str, start: int = 0) -> int:
    """Number of the first line that is like a pattern; of lines if there is none."""
    wanted = re.compile(rf"\s*{pattern}\s*", re.IGNORECASE)
    numbers = range(start, len(lines))
    return next((i for i in numbers if wanted.fullmatch(lines[i])), len(lines))


def _check_range(first: int, last: int, first_number: int, n_frames: int, name: str) -> None:
    last_number = first_number + n_frames - 1
    if not first_number <= first <= last <= last_number:
        raise InvalidInput(
            f"{name}: has frames {first_number} to {last_number}, asked for are {first} to {last}"
        )
