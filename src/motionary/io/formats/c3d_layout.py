"""Where the frames of a C3D file lie, decided by the size of the file.

Header, parameters and file often disagree: on the number of points, on analog values per frame
(the header should count samples, and some programs count channels, or nothing), on the block
where frames begin, on how many there are. Of all layouts that these statements allow, those
count that end where the file ends; of several, the one in which points move smoothly.

Files without points may hold rotations of segments (group ROTATION), as Theia writes them: after
points and analog values stand, frame after frame, matrices of 4 x 4 numbers, column after column,
each with its reliability. The last column is where a segment begins: of a thigh the hip, of a
shank the knee. These places are read; turns are not.
"""

import re
from collections.abc import Iterator
from itertools import product
from typing import BinaryIO, NamedTuple

import numpy as np

from motionary.errors import UnreadableFile
from motionary.io.formats.c3d_head import BLOCK, MOST_COUNTED, Head
from motionary.io.formats.content import name_some, number_doubles
from motionary.rotations import Floats

# Frames that are looked at where several layouts fit.
_LOOKED_AT = 50
# A wrong layout mixes points with each other: they jump many times as far.
_CLEARLY = 0.5


class Layout(NamedTuple):
    """How frames lie in the file."""

    n_points: int
    n_analog: int
    start: int
    scale: float
    first_frame: int
    n_frames: int

    @property
    def item(self) -> int:
        """Bytes of a number."""
        return 4 if self.scale < 0 else 2

    @property
    def frame(self) -> int:
        """Bytes of a frame."""
        return self.item * (4 * self.n_points + self.n_analog)


class Points(NamedTuple):
    """Points of all frames in file units, (frames, points, 3); NaN = not seen."""

    names: list[str]
    positions: Floats
    first_frame: int
    notes: tuple[str, ...]


def find_layout(file: BinaryIO, head: Head) -> tuple[Layout, list[str]]:
    """Where frames lie, and notes."""
    size = _end_of_points(head, file.seek(0, 2))
    scale = head.number("POINT", "SCALE", head.header.scale)
    first = head.header.first_frame
    if len(head.numbers("TRIAL", "ACTUAL_START_FIELD")):
        first = head.count("TRIAL", "ACTUAL_START_FIELD", first)
    if not np.isfinite(scale) or scale == 0:
        raise UnreadableFile("the header says no scale of the points")
    stated = [Layout(*counts, scale, first, 0) for counts in _statements(head)]
    if not stated:
        raise UnreadableFile("the header says no place of the frames")
    usual = stated[0]
    fitting = list(_fitting(stated, head, size))
    chosen = _smoothest(file, head, fitting, usual) if fitting else None
    if chosen is not None:
        return chosen, _differences(chosen, usual, head)
    there = max(0, size - usual.start) // usual.frame
    n_frames, notes = _count_frames(head, there, usual.frame)
    if not 0 < n_frames <= there:
        raise UnreadableFile(
            f"promises {n_frames} frames, the file ends after {there} (by POINT:USED of "
            f"{usual.n_points} points and {usual.n_analog} analog values a frame); get the whole "
            "file"
        )
    return usual._replace(n_frames=n_frames), notes


def _end_of_points(head: Head, size: int) -> int:
    """Where points and analog values end: rotations lie behind them."""
    start = (head.count("ROTATION", "DATA_START", 0) - 1) * BLOCK
    has_rotations = head.count("ROTATION", "USED", 0) > 0
    return start if has_rotations and head.header.data_block * BLOCK < start < size else size


def _statements(head: Head) -> Iterator[tuple[int, int, int]]:
    """Points and analog values of a frame, and where frames start: the usual statements first."""
    header = head.header
    n_labels = len(head.texts("POINT", "LABELS", "LABELS2", "LABELS3"))
    points = [head.count("POINT", "USED", header.n_points), header.n_points, n_labels]
    n_channels = head.count("ANALOG", "USED", 0)
    point_rate = head.number("POINT", "RATE", header.rate_hz)
    ratio = head.number("ANALOG", "RATE", 0.0) / point_rate if point_rate > 0 else 0.0
    samples = round(ratio) if 0 < ratio < MOST_COUNTED else 0
    analog = [
        header.n_analog,
        n_channels * samples,
        n_channels * header.analog_samples,
        header.n_analog * header.analog_samples,
        header.n_analog * samples,
        0,
    ]
    blocks = [header.data_block, head.count("POINT", "DATA_START", 0), head.end_block]
    starts = [(block - 1) * BLOCK for block in blocks if block > 1]
    # Labels beyond the points in use are common; they count only where nothing else does.
    return product(
        dict.fromkeys(n for n in points if n > 0),
        dict.fromkeys(n for n in analog if n <= MOST_COUNTED),
        dict.fromkeys(starts),
    )


def _fitting(stated: list[Layout], head: Head, size: int) -> Iterator[Layout]:
    """Layouts with which the frames end where the file ends."""
    counts = [n for n in dict.fromkeys(_counts(head)) if n > 0]
    for layout, n_frames in product(stated, counts):
        left = size - layout.start - n_frames * layout.frame
        # Some programs fill the last block, and one more where it is full.
        if left == 0 or (size % BLOCK == 0 and 0 < left <= BLOCK):
            yield layout._replace(n_frames=n_frames)


def _smoothest(file: BinaryIO, head: Head, fitting: list[Layout], usual: Layout) -> Layout | None:
    """The first layout, unless points move clearly more smoothly with another one.

    None where the usual one does not fit and is smoother than all that do: then the file is cut
    off, and fits by accident.
    """
    if len(fitting) == 1 and fitting[0]._replace(n_frames=0) == usual:
        return fitting[0]
    jumps = [_jumps(file, head, layout) for layout in fitting]
    best = int(np.argmin(jumps))
    chosen = fitting[best] if jumps[best] < _CLEARLY * jumps[0] else fitting[0]
    if any(layout._replace(n_frames=0) == usual for layout in fitting):
        return chosen
    there = _jumps(file, head, usual._replace(n_frames=_LOOKED_AT))
    return None if there < min(jumps) * _CLEARLY else chosen


def _jumps(file: BinaryIO, head: Head, layout: Layout) -> float:
    """How far points move from frame to frame, in their own extent; infinite for no points."""
    file.seek(layout.start)
    table = read_table(file, head, layout, min(layout.n_frames, _LOOKED_AT))
    places = table[..., :3]
    with np.errstate(all="ignore"):
        steps = np.nanmean(np.abs(np.diff(places, axis=0))) if len(places) > 1 else 0.0
        size = np.nanmean(np.abs(places)) if places.size else np.nan
        # A residual is -1 or a small number.
        odd = np.mean(~((table[..., 3] >= -1) & (table[..., 3] < 1e5))) if table.size else 1.0
        jumps = float(steps / size + odd)
    return jumps if np.isfinite(jumps) else np.inf


def read_table(file: BinaryIO, head: Head, layout: Layout, n_frames: int) -> Floats:
    """The next frames: four numbers per point, (frames, points, 4), as they stand."""
    content = file.read(n_frames * layout.frame)
    content = content[: len(content) // layout.frame * layout.frame]
    machine = head.machine
    numbers = machine.floats(content) if layout.scale < 0 else machine.integers(content)
    width = 4 * layout.n_points
    table = numbers.reshape(-1, width + layout.n_analog)[:, :width]
    return table.reshape(-1, layout.n_points, 4).astype(np.float64, copy=False)


def _differences(chosen: Layout, usual: Layout, head: Head) -> list[str]:
    """Notes on statements that the size of the file overrules."""
    notes = []
    if chosen.n_points != usual.n_points:
        notes.append(
            f"POINT:USED says {usual.n_points} points, the size of the file {chosen.n_points}"
        )
    if chosen.n_analog != usual.n_analog:
        notes.append(
            f"the header says {usual.n_analog} analog values a frame, the size of the file "
            f"{chosen.n_analog}"
        )
    if chosen.start != (head.header.data_block - 1) * BLOCK:
        notes.append(
            f"the header says that frames begin in block {head.header.data_block}, the size of "
            f"the file {1 + chosen.start // BLOCK}"
        )
    counts = [n for n in _counts(head) if n > 0]
    if chosen.n_frames != counts[0]:
        notes.append(f"the file's counts of frames differ; {chosen.n_frames} are there")
    return notes


def _counts(head: Head) -> Iterator[int]:
    """Numbers of frames that a file gives, the most trusted one first."""
    if len(head.numbers("TRIAL", "ACTUAL_END_FIELD")):
        last = head.count("TRIAL", "ACTUAL_END_FIELD", 0)
        yield last - head.count("TRIAL", "ACTUAL_START_FIELD", 1) + 1
    yield head.header.last_frame - head.header.first_frame + 1
    yield from (head.count("POINT", name, 0) for name in ("LONG_FRAMES", "FRAMES"))


def _count_frames(head: Head, there: int, frame_bytes: int) -> tuple[int, list[str]]:
    """Number of frames where none of the counts ends with the file."""
    counted = [n for n in _counts(head) if n > 0]
    promised = counted[0] if counted else there
    # What fills the last block is no frame.
    full = {there - i for i in range(1 + BLOCK // frame_bytes)}
    if promised in full:
        return promised, []
    fitting = [n for n in counted if n in full]
    if fitting:
        return fitting[0], [f"the file's counts of frames differ; {fitting[0]} are there"]
    if there > promised and head.header.last_frame >= MOST_COUNTED:
        return there, [f"the header stops counting at {MOST_COUNTED} frames; {there} are there"]
    beyond = (there - promised) * frame_bytes
    notes = [f"{beyond} bytes after the last frame are not read"] if there > promised else []
    return promised, notes


# -- rotations of segments ----------------------------------------------------------------


_MATRIX = 17
_NAME_END = re.compile(r"_4X4\Z", re.IGNORECASE)
_TOLERANCE = 1e-2


def read_segments(file: BinaryIO, head: Head) -> Points:
    """Where segments begin, as points."""
    labels = head.texts("ROTATION", "LABELS", "LABELS2")
    n_used, ratio = head.count("ROTATION", "USED", 0), head.count("ROTATION", "RATIO", 1) or 1
    labels = (*labels, *(f"segment {i + 1}" for i in range(len(labels), n_used)))[:n_used]
    shown = name_some(labels)
    about = f"holds no points, but rotations of {n_used} segments ({shown})"
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
    names = number_doubles([_NAME_END.sub("", label) for label in labels])
    note = f"no points: places where {n_used} segments begin, of their rotations ({shown})"
    return Points(names, positions, head.header.first_frame, (note,))
