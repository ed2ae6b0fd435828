"""The identity of a recording, and segments of its time in seconds and in frames.

A `Recording` travels unchanged from the file that was read to the hit or label that was
found in it.

Conventions: segments are half-open; times in seconds count from the recording's first
frame; `first_frame` is the number that the file gives that frame.
"""

import math
from dataclasses import KW_ONLY, dataclass, replace
from itertools import pairwise
from numbers import Real
from typing import TYPE_CHECKING, NamedTuple

from motionary.errors import InvalidInput, check_kind

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# A time that was computed from a frame number must find that frame again.
_SLACK = 1e-6


class Segment(NamedTuple):
    """A segment of time: from `start_s` up to and without `end_s`, seconds."""

    start_s: float
    end_s: float

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return self.end_s - self.start_s

    def overlaps(self, other: "Segment") -> bool:
        """Whether the two have time in common."""
        return self.intersection(other) is not None

    def intersection(self, other: "Segment") -> "Segment | None":
        """The time that both have in common; None without any."""
        start_s, end_s = max(self.start_s, other.start_s), min(self.end_s, other.end_s)
        return Segment(start_s, end_s) if start_s < end_s else None


class FrameRange(NamedTuple):
    """A range of frames: from `start` up to and without `stop`, counted from 0."""

    start: int
    stop: int

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return self.stop - self.start


@dataclass(frozen=True, slots=True)
class Recording:
    """Identity of a recording: its name, and how its frames lie in time.

    Attributes
    ----------
    name : name of the recording, as a rule its file's, without the folder
    person : who moves; empty if unknown
    rate_hz : the file's frames per second; 0 if unknown
    n_frames : the file's number of frames; 0 if unknown
    first_frame : number that the file gives its first frame
    """

    name: str = ""
    _: KW_ONLY
    person: str = ""
    rate_hz: float = 0.0
    n_frames: int = 0
    first_frame: int = 0

    def __post_init__(self) -> None:
        check_kind(self.rate_hz, (Real,), name="rate_hz", remedy="give frames per second")
        if not (math.isfinite(self.rate_hz) and self.rate_hz >= 0):
            raise InvalidInput(f"rate_hz must be a positive number, got {self.rate_hz}")
        if self.n_frames < 0:
            raise InvalidInput(f"n_frames must be at least 0, got {self.n_frames}")

    def __str__(self) -> str:
        return self.name

    @property
    def duration_s(self) -> float:
        """Length in seconds: frames / rate; 0 if unknown."""
        return self.n_frames / self.rate_hz if self.rate_hz else 0.0

    def frame_at(self, time_s: float) -> int:
        """The file's number of the frame shown at a time, within the recording."""
        return self._number(math.floor(time_s * self.rate_hz + _SLACK))

    def last_frame_before(self, end_s: float) -> int:
        """The file's number of the last frame before a time, within the recording."""
        return self._number(math.ceil(end_s * self.rate_hz - _SLACK) - 1)

    def renamed(self, name: str) -> "Recording":
        """The recording under another name."""
        return replace(self, name=name)

    def part(self, start: int, stop: int) -> "Recording":
        """Frames `start` to `stop` (half-open, counted from 0) as a recording of their own."""
        return replace(self, n_frames=stop - start, first_frame=self.first_frame + start)

    def _number(self, index: int) -> int:
        return self.first_frame + min(max(index, 0), max(self.n_frames - 1, 0))


def find_runs(mask: "NDArray[np.bool_]") -> "NDArray[np.intp]":
    """Start and stop, half-open, of each run of True, shape (runs, 2)."""
    # Imported late: recordings are named where nothing is computed yet.
    import numpy as np

    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    return edges.reshape(-1, 2)


def split_runs(values: "NDArray[np.generic]") -> list[FrameRange]:
    """Ranges of equal neighbours along the first axis; together they cover all of it."""
    import numpy as np

    if not len(values):
        return []
    rows = values.reshape(len(values), -1)
    changes = np.flatnonzero((rows[1:] != rows[:-1]).any(axis=1)) + 1
    return [FrameRange(*ends) for ends in pairwise([0, *changes.tolist(), len(values)])]
