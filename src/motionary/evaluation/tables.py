"""What is a label table, and how is one checked?

Every measure compares two tables of `Segment`: what was predicted and what is true. Where
a segment comes from (a `Label`, a row of a file, an array) does not matter here.

Conventions: half-open, `start` belongs to the segment and `end` does not; seconds or
frames, as long as both tables use the same; segments may overlap and come in any order.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput

# Times that differ by less are equal: the rest is rounding.
ROUNDING = 1e-6


class Segment(NamedTuple):
    """A named stretch.

    Attributes
    ----------
    name : class
    start, end : seconds or frames, half-open
    cost : of a prediction, smaller is surer; infinite means never found
    """

    name: str
    start: float
    end: float
    cost: float = 0.0

    @property
    def start_s(self) -> float:
        """Start, where segments are in seconds."""
        return self.start

    @property
    def end_s(self) -> float:
        """End, where segments are in seconds."""
        return self.end


class LabelLike(Protocol):
    """Anything with a name and times in seconds; a `cost` is used where there is one."""

    @property
    def name(self) -> str:
        """Class."""

    @property
    def start_s(self) -> float:
        """Start, seconds."""

    @property
    def end_s(self) -> float:
        """End, seconds, not included."""


Segments: TypeAlias = Sequence[Segment]


def check_segments(segments: Iterable[Segment], *, where: str = "the table") -> list[Segment]:
    """The segments as a list, in the given order.

    Parameters
    ----------
    segments : iterable of Segment
    where : what an error calls the table

    Raises
    ------
    InvalidInput
        For something else than a `Segment`, an empty name, times that are not finite
        numbers, a segment without length, or a cost that is not a number.
    """
    checked = list(segments)
    for number, segment in enumerate(checked, start=1):
        problem = _find_problem(segment)
        if problem:
            raise InvalidInput(f"segment {number} of {where}: {problem}")
    return checked


def to_segments(labels: Iterable[LabelLike], *, where: str) -> list[Segment]:
    """Segments, in seconds, of labels; a label without a cost costs 0.

    Raises
    ------
    InvalidInput
        For labels without name, start and end, and as `check_segments`.
    """
    segments = []
    for number, label in enumerate(labels, start=1):
        try:
            cost = getattr(label, "cost", None)
            segments.append(
                Segment(label.name, label.start_s, label.end_s, 0.0 if cost is None else cost)
            )
        except AttributeError:
            raise InvalidInput(
                f"label {number} of {where}: expected name, start_s and end_s, got {label!r}"
            ) from None
    return check_segments(segments, where=where)


def rename_segments(segments: Iterable[Segment], names: Mapping[str, str]) -> list[Segment]:
    """The segments under other names; a name that is not in `names` stays.

    For tables whose classes differ in words or in depth: {"squat": "exercise"}.
    """
    return [s._replace(name=names.get(s.name, s.name)) for s in segments]


def list_names(*tables: Iterable[Segment]) -> list[str]:
    """Names that occur in any of the tables, sorted."""
    return sorted({segment.name for table in tables for segment in table})


def select_name(segments: Iterable[Segment], name: str) -> list[Segment]:
    """The segments of one name, in the given order."""
    return [segment for segment in segments if segment.name == name]


def to_times(segments: Segments) -> NDArray[np.float64]:
    """Starts and ends, shape (segments, 2)."""
    return np.array([(s.start, s.end) for s in segments], dtype=np.float64).reshape(-1, 2)


def compute_overlap(predicted: Segments, truth: Segments) -> NDArray[np.float64]:
    """Common length of every pair, whatever the names, shape (predicted, true)."""
    a, b = to_times(predicted)[:, None], to_times(truth)[None]
    common = np.minimum(a[..., 1], b[..., 1]) - np.maximum(a[..., 0], b[..., 0])
    return np.where(common > ROUNDING, common, 0.0)


def compute_iou(predicted: Segments, truth: Segments) -> NDArray[np.float64]:
    """Temporal intersection over union of every pair, shape (predicted, true)."""
    common = compute_overlap(predicted, truth)
    lengths = np.diff(to_times(predicted)), np.diff(to_times(truth)).T
    return np.asarray(common / (lengths[0] + lengths[1] - common), dtype=np.float64)


def check_iou(iou: float) -> float:
    """The least overlap asked of a match, in (0, 1]."""
    if not 0 < iou <= 1:
        raise InvalidInput(f"an overlap (IoU) must lie above 0 and up to 1, got {iou}")
    return iou


def _find_problem(segment: object) -> str | None:
    if not isinstance(segment, Segment):
        return f"expected Segment(name, start, end), got {segment!r}"
    if not isinstance(segment.name, str) or not segment.name:
        return f"expected a name, got {segment.name!r}"
    try:
        times_are_finite = math.isfinite(segment.start) and math.isfinite(segment.end)
        cost_is_number = not math.isnan(segment.cost)
    except TypeError:
        return f"expected numbers for start, end and cost, got {tuple(segment)}"
    if not times_are_finite:
        return f"expected finite times, got {segment.start} to {segment.end}"
    if not segment.end - segment.start > ROUNDING:
        return (
            f"{segment.name!r} must end after it starts, got {segment.start} to {segment.end}; "
            "give it a length or drop it"
        )
    return None if cost_is_number else "expected a cost, got NaN; infinite means not found"
