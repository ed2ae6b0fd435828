"""Rotations of segments in C3D files (group ROTATION), as Theia writes them.

After points and analog values stand, frame after frame, matrices of 4 x 4 numbers, column after
column, each with its reliability. The last column is where a segment begins: of a thigh the hip,
of a shank the knee. These places are read; turns are not.
"""

from typing import BinaryIO

import numpy as np

from motionary.errors import UnreadableFile
from motionary.io.formats.c3d_head import BLOCK, Floats, Head
from motionary.io.formats.content import number_doubles

_MATRIX = 17
_NAME_END = "_4X4"
_TOLERANCE = 1e-2


def read_segments(
    file: BinaryIO, head: Head, name: str
) -> tuple[list[str], Floats, int, tuple[str, ...]]:
    """Names of segments, where they begin in file units, the first frame, and notes.

    Raises
    ------
    UnreadableFile
        If the file ends before the last frame, or no matrix is a rotation.
    """
    labels = head.texts("ROTATION", "LABELS", "LABELS2")
    n_used, ratio = head.count("ROTATION", "USED", 0), head.count("ROTATION", "RATIO", 1) or 1
    labels = (*labels, *(f"segment {i + 1}" for i in range(len(labels), n_used)))[:n_used]
    shown = f"{', '.join(labels[:3])}{', ...' if n_used > 3 else ''}"
    about = f"{name}: holds no points, but rotations of {n_used} segments ({shown})"
    n_frames = head.count("POINT", "FRAMES", 0) or max(
        0, head.header.last_frame - head.header.first_frame + 1
    )
    size = 4 * _MATRIX * n_used * ratio * n_frames
    end = file.seek(0, 2)
    blocks = (head.count("ROTATION", "DATA_START", 0), head.header.data_block, head.end_block)
    starts = [(block - 1) * BLOCK for block in blocks if block > 1]
    start = next((place for place in starts if 0 < size <= end - place), None)
    if start is None:
        raise UnreadableFile(f"{about} of {n_frames} frames, and ends before the last one")
    file.seek(start)
    numbers = head.machine.floats(file.read(size)).reshape(n_frames, ratio, n_used, _MATRIX)
    matrices = numbers[:, 0, :, :16].reshape(n_frames, n_used, 4, 4).swapaxes(2, 3)
    turns = matrices[..., :3, :3]
    with np.errstate(all="ignore"):
        away = np.abs(turns @ turns.swapaxes(2, 3) - np.eye(3)).max(axis=(2, 3))
    positions = np.where((away < _TOLERANCE)[..., None], matrices[..., :3, 3], np.nan)
    if np.isnan(positions).all():
        raise UnreadableFile(f"{about}, and none of its matrices is a rotation")
    names = number_doubles([_bare(label) for label in labels])
    note = f"no points: places where {n_used} segments begin, of their rotations ({shown})"
    return names, positions, head.header.first_frame, (note,)


def _bare(label: str) -> str:
    is_matrix = label.upper().endswith(_NAME_END)
    return label[: -len(_NAME_END)] if is_matrix else label
