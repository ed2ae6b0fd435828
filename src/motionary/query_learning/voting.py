"""What do several queries of one class find together?

Each of many runs rests on other details of the examples. A frame counts where enough of
their queries agree: what a single one overlooks in another person, others see, and what a
single one mistakes, others do not.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.keyframes import HitRanges

Integers = NDArray[np.int64]


def agreed_ranges(found: Sequence[HitRanges], *, votes: int, lengths: ArrayLike) -> HitRanges:
    """Frames that lie in the ranges of at least `votes` searches.

    Parameters
    ----------
    found : ranges of each query, over the same documents
    votes : from 1 to the number of searches
    lengths : array, shape (documents,), frames of each document

    Raises
    ------
    InvalidInput
        If so many votes are impossible.
    """
    check_votes(votes, n_queries=len(found))
    ends = np.cumsum(np.asarray(lengths, dtype=np.int64) + 1)
    offsets = ends - np.asarray(lengths, dtype=np.int64) - 1
    documents = np.concatenate([ranges.documents for ranges in found])
    starts = np.concatenate([ranges.starts for ranges in found]) + offsets[documents]
    stops = np.concatenate([ranges.stops for ranges in found]) + offsets[documents]
    places, at = np.unique(np.concatenate([starts, stops]), return_inverse=True)
    changes = np.bincount(at[: len(starts)], minlength=len(places))
    changes -= np.bincount(at[len(starts) :], minlength=len(places))
    edges = np.flatnonzero(np.diff(np.cumsum(changes) >= votes, prepend=False))
    first, last = places[edges[::2]], places[edges[1::2]]
    document = np.searchsorted(ends, first, side="right")
    return HitRanges(document, first - offsets[document], last - offsets[document])


def agreed_documents(found: Sequence[HitRanges], *, votes: int, n_documents: int) -> Integers:
    """Documents in which at least `votes` searches have a hit, ascending.

    Raises
    ------
    InvalidInput
        If so many votes are impossible.
    """
    check_votes(votes, n_queries=len(found))
    hits = np.zeros(n_documents, dtype=np.int64)
    for ranges in found:
        hits[ranges.hit_documents] += 1
    return np.flatnonzero(hits >= votes)


def check_votes(votes: int, *, n_queries: int) -> None:
    """Refuse a number of votes that is none of these queries'.

    Raises
    ------
    InvalidInput
    """
    if not 1 <= votes <= n_queries:
        raise InvalidInput(f"{n_queries} queries have 1 to {n_queries} votes, got {votes}")
