"""What does a keyframe search return?

Hit ranges: the union of all stretches from the first to the last keyframe of a hit, after
Baak, Müller and Seidel (2008), section 3.2.

Conventions: frames count from 0 within each document; ranges are half-open, `stop` one
past the last frame. Ranges of one document neither overlap nor touch.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.models.keyframes.query import KeyframeQuery

Integers = NDArray[np.int64]


class HitRange(NamedTuple):
    """One stretch of a document that holds hits, half-open."""

    document: int
    start: int
    stop: int


@dataclass(frozen=True, slots=True, eq=False)
class HitRanges:
    """Stretches that hold hits, by document and then by time.

    Attributes
    ----------
    documents, starts, stops : arrays, shape (ranges,)
    """

    documents: Integers
    starts: Integers
    stops: Integers

    @classmethod
    def none(cls) -> "HitRanges":
        """The answer that there is nothing."""
        empty = np.empty(0, dtype=np.int64)
        return cls(empty, empty, empty)

    def __len__(self) -> int:
        return len(self.starts)

    def __iter__(self) -> Iterator[HitRange]:
        columns = (self.documents.tolist(), self.starts.tolist(), self.stops.tolist())
        return (HitRange(*row) for row in zip(*columns, strict=True))

    @property
    def n_frames(self) -> int:
        """Frames in all ranges."""
        return int((self.stops - self.starts).sum())

    @property
    def hit_documents(self) -> Integers:
        """Documents with at least one hit, ascending."""
        return np.unique(self.documents)

    def of(self, document: int) -> list[tuple[int, int]]:
        """Ranges (start, stop) of one document."""
        here = self.documents == document
        return list(zip(self.starts[here].tolist(), self.stops[here].tolist(), strict=True))


def margins(query: KeyframeQuery, n_columns: int) -> tuple[int, int]:
    """Frames to match before and after a hit: twice what the template has around it.

    Parameters
    ----------
    query : with the template positions of its keyframes
    n_columns : columns of that template

    Returns
    -------
    before, after : frames

    Raises
    ------
    InvalidInput
        If the query has no positions, or they lie beyond the template.
    """
    if query.positions is None:
        raise InvalidInput("the query carries no template positions; give the margins instead")
    first, last = query.positions[0], query.positions[-1]
    if last >= n_columns:
        raise InvalidInput(f"the last keyframe stands at column {last} of only {n_columns}")
    return 2 * first, 2 * (n_columns - 1 - last)


def extend(ranges: HitRanges, before: int, after: int, lengths: ArrayLike) -> HitRanges:
    """Ranges that are longer at both ends, cut at the documents, merged where they meet.

    Parameters
    ----------
    ranges : HitRanges
    before, after : frames to add, at least 0
    lengths : array, shape (documents,), frames of each document
    """
    if before < 0 or after < 0:
        raise InvalidInput(f"before and after must be at least 0 frames, got {before}, {after}")
    if len(ranges) == 0:
        return ranges
    length = np.asarray(lengths, dtype=np.int64)
    if length.ndim != 1 or len(length) <= ranges.documents.max():
        raise InvalidInput(
            f"lengths need one number for each document, got shape {length.shape} for a hit in "
            f"document {ranges.documents.max()}"
        )
    starts = np.maximum(ranges.starts - before, 0)
    stops = np.minimum(ranges.stops + after, length[ranges.documents])
    apart = (starts[1:] > stops[:-1]) | (ranges.documents[1:] != ranges.documents[:-1])
    first, last = np.concatenate([[True], apart]), np.concatenate([apart, [True]])
    return HitRanges(ranges.documents[first], starts[first], stops[last])


def agree(several: Sequence[HitRanges], *, votes: int = 1) -> HitRanges:
    """Frames that lie in ranges of at least so many answers over the same documents.

    Raises
    ------
    InvalidInput
        If so many votes are impossible.
    """
    check_votes(votes, n_queries=len(several))
    if len(several) == 1:
        return several[0]
    documents, starts, stops = (
        np.concatenate([getattr(ranges, name) for ranges in several])
        for name in ("documents", "starts", "stops")
    )
    # On one line, on which documents lie apart.
    far = int(stops.max(initial=0)) + 1
    places, at = np.unique(
        np.concatenate([starts, stops]) + far * np.tile(documents, 2), return_inverse=True
    )
    changes = np.bincount(at[: len(starts)], minlength=len(places))
    changes -= np.bincount(at[len(starts) :], minlength=len(places))
    edges = np.flatnonzero(np.diff(np.cumsum(changes) >= votes, prepend=False))
    first, last = places[edges[::2]], places[edges[1::2]]
    document = first // far
    return HitRanges(document, first - document * far, last - document * far)


def check_votes(votes: int, *, n_queries: int) -> None:
    """Refuse a number of votes that is none of these queries'.

    Raises
    ------
    InvalidInput
    """
    if not 1 <= votes <= n_queries:
        raise InvalidInput(f"{n_queries} queries have 1 to {n_queries} votes, got {votes}")
