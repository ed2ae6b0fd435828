"""How are sets of frames widened, cut and joined?

A set of frames is an interval set: two arrays, starts and stops, half-open, ascending,
neither overlapping nor touching. Positions run through all documents; `Documents` tells
where each begins and ends.

The join of a query: a frame of the last keyframe is valid; a frame of an earlier one is,
if a valid frame of its successor lies within the gap. Every valid frame of the first
keyframe begins a hit. Where its latest hit ends, follows from always taking the latest
valid frame: frames x and y of two hits can be exchanged for their maxima, since gaps bound
differences only.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.models.keyframes.query import Gap

Integers = NDArray[np.int64]

#: Further than any document is long.
FAR = 1 << 48
_BYTE = 8


class Intervals(NamedTuple):
    """A set of positions, half-open."""

    starts: Integers
    stops: Integers

    def __bool__(self) -> bool:
        return len(self.starts) > 0


EMPTY = Intervals(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class Documents:
    """Where documents begin and end among the positions.

    Attributes
    ----------
    starts, stops : arrays, shape (documents,); every start is a multiple of 8
    of_byte : array, the document of every eight positions
    """

    starts: Integers
    stops: Integers
    of_byte: NDArray[np.int32]

    @classmethod
    def lay_out(cls, lengths: Integers) -> "Documents":
        """Documents one behind the other, with at least one position free after each."""
        n_bytes = lengths // _BYTE + 1
        starts = (np.cumsum(n_bytes) - n_bytes) * _BYTE
        of_byte = np.repeat(np.arange(len(lengths), dtype=np.int32), n_bytes)
        return cls(starts, starts + lengths, of_byte)

    def number(self, positions: Integers) -> NDArray[np.int32]:
        """Document of each position."""
        return np.take(self.of_byte, positions >> 3)


def join(
    lists: Sequence[Intervals], gaps: Sequence[Gap], documents: Documents
) -> tuple[Intervals, NDArray[np.int32]]:
    """Hit ranges of keyframe lists, and the document of each.

    Parameters
    ----------
    lists : the frames of each keyframe; frames that belong to no hit may be missing
    gaps : frames between neighbouring keyframes
    """
    valid = [lists[-1]]
    for keyframe, gap in zip(reversed(lists[:-1]), reversed(gaps), strict=True):
        valid.append(cut(keyframe, _reach_back(valid[-1], gap, documents)))
    valid.reverse()
    if not valid[0]:
        return EMPTY, np.empty(0, dtype=np.int32)
    starts = valid[0].starts
    number = documents.number(starts)
    stops = _latest_ends(valid, gaps, documents.stops[number])
    apart = (starts[1:] > stops[:-1]) | (number[1:] != number[:-1])
    first, last = np.concatenate([[True], apart]), np.concatenate([apart, [True]])
    return Intervals(starts[first], stops[last]), number[first]


def cut(a: Intervals, b: Intervals) -> Intervals:
    """Intersection of two interval sets."""
    if len(a.starts) > len(b.starts):
        a, b = b, a
    first = np.searchsorted(b.stops, a.starts, side="right")
    n = np.searchsorted(b.starts, a.stops, side="left") - first
    ends = np.cumsum(n)
    if not a or ends[-1] == 0:
        return EMPTY
    i = np.repeat(np.arange(len(n)), n)
    j = np.arange(ends[-1]) + np.repeat(first - ends + n, n)
    return Intervals(
        np.maximum(a.starts[i], b.starts[j]),
        np.minimum(a.stops[i], b.stops[j]),
    )


def _reach_back(after: Intervals, gap: Gap, documents: Documents) -> Intervals:
    """Positions with a position of `after` behind them, within the gap and the document."""
    begin = documents.starts[documents.number(after.starts)]
    most = FAR if gap.most is None else gap.most
    starts = np.maximum(after.starts - most, begin)
    stops = after.stops - gap.least
    if gap.least > 0:
        inside = stops > begin
        starts, stops = starts[inside], stops[inside]
    apart = starts[1:] > stops[:-1]
    if not apart.all():
        starts = starts[np.concatenate([[True], apart])]
        stops = stops[np.concatenate([apart, [True]])]
    return Intervals(starts, stops)


def _latest_ends(valid: Sequence[Intervals], gaps: Sequence[Gap], limits: Integers) -> Integers:
    """One past the last frame of the latest hit from the last frame of each first interval."""
    position = valid[0].stops - 1
    for keyframe, gap in zip(valid[1:], gaps, strict=True):
        most = FAR if gap.most is None else gap.most
        position = np.minimum(position + most, limits - 1)
        at = np.searchsorted(keyframe.starts, position, side="right") - 1
        position = np.minimum(position, keyframe.stops[at] - 1)
    return position + 1
