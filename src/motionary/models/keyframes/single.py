"""Which single hits lie behind the hit ranges?

A hit is one frame for every keyframe. Their number may explode, so that one asks for a few
of them; hit ranges (see `search`) say where all of them lie.
"""

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.models.keyframes.query import KeyframeQuery
from motionary.models.keyframes.search import check_packed, frames_of_keyframe
from motionary.packing import PackedFeatures


def single_hits(
    query: KeyframeQuery,
    packed: PackedFeatures,
    known: PackedFeatures | None = None,
    *,
    limit: int = 1000,
) -> NDArray[np.int64]:
    """Hits in one document, in lexicographic order.

    Parameters
    ----------
    query : KeyframeQuery
    words, known : arrays, shape (frames, n_words), uint64; known may be left out
    limit : at most so many

    Returns
    -------
    array, shape (hits, K): the frame of each keyframe, from 0

    Raises
    ------
    InvalidInput
        If the words do not have the shape of the query's, or the limit is below 1.
    """
    check_packed(query, packed, known)
    if limit < 1:
        raise InvalidInput(f"limit must be at least 1, got {limit}")
    frames = [
        np.flatnonzero(frames_of_keyframe(value, fixed, packed, known))
        for value, fixed in zip(query.values, query.fixed, strict=True)
    ]
    for k in reversed(range(len(query) - 1)):
        first, last = _successors(query, k, frames[k], frames[k + 1])
        frames[k] = frames[k][first < last]
    hits: list[tuple[int, ...]] = []
    # Every frame that is left has a successor: no path of the search is in vain.
    stack: list[tuple[int, ...]] = [(int(n),) for n in frames[0][:limit][::-1]]
    while stack and len(hits) < limit:
        path = stack.pop()
        if len(path) == len(query):
            hits.append(path)
            continue
        k = len(path) - 1
        first, last = _successors(query, k, np.array(path[-1:]), frames[k + 1])
        following = frames[k + 1][first[0] : last[0]][:limit]
        stack += [(*path, int(n)) for n in following[::-1]]
    return np.array(hits, dtype=np.int64).reshape(-1, len(query))


def _successors(
    query: KeyframeQuery, k: int, frames: NDArray[np.int64], following: NDArray[np.int64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Which of the frames that show keyframe k + 1 lie within the gap after each frame."""
    least, most = query.gaps[k]
    first = np.searchsorted(following, frames + least, side="left")
    if most is None:
        return first, np.full_like(first, len(following))
    return first, np.searchsorted(following, frames + most, side="right")
