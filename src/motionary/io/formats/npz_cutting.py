"""Clips of .npz files: the file's arrays, those with a row per frame cut.

Parameters of bodies stay parameters, and what else a program keeps beside them stays too.
"""

import io
from pathlib import Path

import numpy as np

from motionary.errors import UnreadableFile
from motionary.io.formats.array_layouts import split_array
from motionary.io.formats.arrays import NAMES, POSITIONS
from motionary.io.formats.content import choose_take
from motionary.io.formats.npz import Array, is_own, read_npz
from motionary.io.formats.numbers import check_frames
from motionary.io.formats.smpl import find_source

# Arrays whose rows are no frames, however many they are; of files of our own, those that are.
_NOT_BY_FRAME = (*NAMES, "betas", "gender")
_OWN_BY_FRAME = ("positions", "rotations")


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
        numbers = [str(i + 1) for i in range(len(layout.motions))]
        arrays[key] = layout.motions[choose_take(numbers, take, path.name)]
    elif key is None:
        source = find_source(arrays)
        key = source.turns[0] if source else None
    if key is None:
        raise UnreadableFile(
            f"{path.name}: no clips can be cut out of it; convert it to a .npz of motionary first"
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
