"""Clips of files that are no text: C3D and npz, cut without being read as a motion.

A clip of C3D is bytes of the file itself, so that analog signals and parameters stay; only what
counts frames changes, and events keep their times in the recording, as its frames keep their
numbers. A clip of npz has the file's arrays, those with a row per frame cut: parameters of bodies
stay parameters, and what else a program keeps beside them stays too.
"""

import io
from pathlib import Path

import numpy as np

from motionary.errors import UnreadableFile
from motionary.files import open_regular
from motionary.io.formats.array_layouts import split_array
from motionary.io.formats.arrays import NAMES, POSITIONS
from motionary.io.formats.c3d_head import BLOCK, parse_head, recount
from motionary.io.formats.c3d_layout import find_layout
from motionary.io.formats.npz import Array, is_own, read_npz
from motionary.io.formats.numbers import check_frames
from motionary.io.formats.smpl import find_source
from motionary.io.formats.takes import choose_take

# As in reading: a parameter section has at most 255 blocks.
_LONGEST_HEAD = 600 * BLOCK
# Arrays whose rows are no frames, however many they are; of files of our own, those that are.
_NOT_BY_FRAME = (*NAMES, "betas", "gender")
_OWN_BY_FRAME = ("positions", "rotations")


def cut_c3d(path: Path, first: int, last: int, take: str | int | None = None) -> bytes:
    """A clip of a C3D file; frames as the file counts them, both included.

    Raises
    ------
    UnreadableFile
        If the file is missing or damaged, or has rotations, which lie behind its frames.
    InvalidInput
        If these frames are not in the file.
    """
    with open_regular(path) as file:
        head = parse_head(file.read(_LONGEST_HEAD), path.name)
        if head.count("ROTATION", "USED", 0):
            raise UnreadableFile(
                "holds rotations, which clips cannot be cut out of; convert it to .npz first",
                file=path.name,
            )
        layout, _ = find_layout(file, head, path.name)
        check_frames(
            first, last, first_number=layout.first_frame, n_frames=layout.n_frames, name=path.name
        )
        file.seek(0)
        before = recount(file.read(layout.start), head.machine, first_frame=first, last_frame=last)
        file.seek(layout.start + (first - layout.first_frame) * layout.frame)
        return before + file.read((last - first + 1) * layout.frame)


def cut_npz(path: Path, first: int, last: int, take: str | int | None = None) -> bytes:
    """A clip of a .npz file; frames as the file counts them, both included.

    Files of others count from 0. Of a batch the clip holds the recording that is named.

    Raises
    ------
    UnreadableFile
        If the file is missing or damaged, or keeps its motion in objects of Python.
    InvalidInput
        If these frames are not in the file, or it holds several recordings and none is named.
    """
    arrays = dict(read_npz(path))
    own = is_own(arrays)
    key = next((key for key in POSITIONS if key in arrays), None)
    if key is not None and not own:
        layout = split_array(arrays[key], path.name)
        arrays[key] = layout.motions[choose_take(len(layout.motions), take, path.name)]
    elif key is None:
        source = find_source(arrays)
        key = source.turns[0] if source else None
    if key is None:
        raise UnreadableFile(
            "no clips can be cut out of it; convert it to a .npz of motionary first", file=path.name
        )
    n_frames = len(arrays[key])
    number = int(arrays["first_frame"]) if own else 0
    check_frames(first, last, first_number=number, n_frames=n_frames, name=path.name)
    for name, array in arrays.items():
        by_frame = name in _OWN_BY_FRAME if own else name not in _NOT_BY_FRAME
        if by_frame and array.ndim and len(array) == n_frames:
            arrays[name] = array[first - number : last - number + 1]
    if own:
        arrays |= _cut_events(arrays, first - number, last - number + 1)
        arrays["first_frame"] = np.array(first)
    written = io.BytesIO()
    np.savez_compressed(written, **arrays)  # type: ignore[arg-type]
    return written.getvalue()


def _cut_events(arrays: dict[str, Array], start: int, stop: int) -> dict[str, Array]:
    """Events within frames, their times from the first of these."""
    if "event_times_s" not in arrays:
        return {}
    rate, times = float(arrays["rate_hz"]), arrays["event_times_s"]
    inside = (start <= times * rate) & (times * rate < stop)
    kept = {name: arrays[name][inside] for name in ("event_names", "event_sides")}
    return {**kept, "event_times_s": times[inside] - start / rate}
