"""Which hits of a query are the shortest, if none may overlap another?

The frame of an earlier keyframe may always be the latest that its successor allows: of two
hits, the later frame of each keyframe is a hit, too, since gaps bound differences only.
"""

import numpy as np
from numpy.typing import NDArray

from motionary.keyframes.query import KeyframeQuery
from motionary.keyframes.search import check_words, frames_of_keyframe
from motionary.words import Words


def shortest_hits(
    query: KeyframeQuery, words: Words, known: Words | None = None
) -> NDArray[np.int64]:
    """Hits in one document of which no two overlap, short ones first taken.

    Parameters
    ----------
    query : KeyframeQuery
    words, known : arrays, shape (frames, n_words), uint64; known may be left out

    Returns
    -------
    array, shape (hits, K): the frame of each keyframe, from 0, in the order of time

    Raises
    ------
    InvalidInput
        If the words do not have the shape of the query's.
    """
    check_words(query, words, known)
    hits = _latest_hits(query, words, known)
    taken = np.zeros(len(words), dtype=np.bool_)
    kept = []
    for i in np.lexsort((hits[:, 0], hits[:, -1] - hits[:, 0])).tolist():
        inside = slice(hits[i, 0], hits[i, -1] + 1)
        if not taken[inside].any():
            taken[inside] = True
            kept.append(i)
    return hits[sorted(kept)]


def _latest_hits(query: KeyframeQuery, words: Words, known: Words | None) -> NDArray[np.int64]:
    """The shortest hit for each frame of the last keyframe at which one ends."""
    hits = np.empty((0, 0), dtype=np.int64)
    for k, keyframe in enumerate(zip(query.values, query.fixed, strict=True)):
        frames = np.flatnonzero(frames_of_keyframe(*keyframe, words, known))
        if k == 0:
            hits = frames[:, np.newaxis]
            continue
        least, most = query.gaps[k - 1]
        before = np.searchsorted(hits[:, -1], frames - least, side="right") - 1
        valid = before >= 0
        if most is not None and len(hits):
            valid &= hits[before, -1] >= frames - most
        hits = np.column_stack([hits[before[valid]], frames[valid]])
    return hits
