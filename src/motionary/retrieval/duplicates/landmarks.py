"""Which recordings might share a stretch, and how far apart in time?

What rigs and rates leave alone is when relations change. Two changes that follow each other
and the time between them are a landmark; recordings that share a motion share many at one
offset. After the landmarks by which recordings of music are recognised (Wang 2003).

Conventions: a change belongs to the frame before it; its symbol is 2 * relation, one more
where the relation begins to hold. Kernels: arrays and numbers, nothing is checked.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.packing import PackedFeatures, unpack

Integers = NDArray[np.int64]

#: A change is paired with so many that follow, within so many frames.
_FOLLOWING = 4
_WITHIN = 45
#: A landmark votes for at most so many others of its kind: common ones tell little.
_MOST_PARTNERS = 16
#: Documents whose landmarks are compared at a time.
_PORTION = 256

_OFFSETS = 1 << 24


class Changes(NamedTuple):
    """Changes of relations in documents, by document and time.

    Attributes
    ----------
    documents, frames, symbols : arrays, shape (changes,)
    """

    documents: Integers
    frames: Integers
    symbols: Integers


class Candidates(NamedTuple):
    """Pairs of documents with the offset that most landmarks vote for.

    Attributes
    ----------
    left, right : arrays, shape (pairs,), documents
    offsets : frame of the left document at which the right one begins
    votes : landmarks that agree
    """

    left: Integers
    right: Integers
    offsets: Integers
    votes: Integers


def changes_of(
    packed: Sequence[PackedFeatures], known: Sequence[PackedFeatures], n_features: int
) -> Changes:
    """Changes of known relations in documents."""
    documents, frames, symbols = [], [], []
    for number, (word, mask) in enumerate(zip(packed, known, strict=True)):
        changed = (word[1:] ^ word[:-1]) & mask[1:] & mask[:-1]
        at = np.flatnonzero(changed.any(axis=1))
        frame, feature = np.nonzero(unpack(changed[at], n_features))
        holds = unpack(word[at + 1], n_features)[frame, feature]
        documents.append(np.full(len(frame), number))
        frames.append(at[frame])
        symbols.append(2 * feature + holds)
    return Changes(*(np.concatenate(column) for column in (documents, frames, symbols)))


def mirrored(changes: Changes, mirror_order: NDArray[np.intp]) -> Changes:
    """Changes of the mirrored motions."""
    feature, begins = changes.symbols // 2, changes.symbols % 2
    symbols = 2 * mirror_order[feature] + begins
    order = np.lexsort((symbols, changes.frames, changes.documents))
    return Changes(changes.documents[order], changes.frames[order], symbols[order])


def find_candidates(
    left: Changes, right: Changes, *, n_features: int, n_right: int, least_votes: int
) -> Candidates:
    """Pairs of documents that share landmarks.

    Parameters
    ----------
    left, right : changes of both sides
    n_relations : of the feature set
    n_right : documents of the right side
    least_votes : landmarks that must agree
    """
    kinds, places, owners = _landmarks(left, n_features)
    order = np.argsort(kinds, kind="stable")
    kinds, places, owners = kinds[order], places[order], owners[order]
    their_kinds, their_places, their_owners = _landmarks(right, n_features)
    by_owner = np.argsort(their_owners, kind="stable")
    borders = np.searchsorted(their_owners[by_owner], np.arange(0, n_right + _PORTION, _PORTION))
    found = [np.empty((0, 4), dtype=np.int64)]
    for first, stop in zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True):
        chosen = by_owner[first:stop]
        mine, theirs = _partners(kinds, their_kinds[chosen])
        theirs = chosen[theirs]
        offsets = places[mine] - their_places[theirs]
        found.append(_count(owners[mine], their_owners[theirs], offsets, n_right, least_votes))
    return Candidates(*np.concatenate(found).T)


def _landmarks(changes: Changes, n_features: int) -> tuple[Integers, Integers, Integers]:
    """Kind, frame and document of each landmark."""
    documents, frames, symbols = changes
    kinds, at = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for step in range(1, _FOLLOWING + 1):
        gap = frames[step:] - frames[:-step]
        near = np.flatnonzero((documents[step:] == documents[:-step]) & (gap <= _WITHIN))
        pair = symbols[near] * (2 * n_features) + symbols[near + step]
        kinds.append(pair * (_WITHIN + 1) + gap[near])
        at.append(near)
    places = np.concatenate(at)
    return np.concatenate(kinds), frames[places], documents[places]


def _partners(kinds: Integers, theirs: Integers) -> tuple[Integers, Integers]:
    """Pairs of landmarks of one kind; of common kinds only some."""
    first = np.searchsorted(kinds, theirs, side="left")
    n = np.searchsorted(kinds, theirs, side="right") - first
    # Each starts at another of its partners, so that all of them get votes.
    start = np.arange(len(theirs)) % np.maximum(n, 1)
    mine, indexes = [], []
    for step in range(_MOST_PARTNERS):
        left = np.flatnonzero(step < n)
        mine.append(first[left] + (start[left] + step) % n[left])
        indexes.append(left)
    return np.concatenate(mine), np.concatenate(indexes)


def _count(
    left: Integers, right: Integers, offsets: Integers, n_right: int, least_votes: int
) -> Integers:
    """Rows (left, right, offset, votes): the best offset of each pair with enough votes."""
    keys = (left * n_right + right) * _OFFSETS + (offsets + _OFFSETS // 2)
    keys, counts = np.unique(keys, return_counts=True)
    votes = counts.copy()
    for step in (-1, 1):
        # Changes lie between frames: half of the votes may go to the next offset.
        at = np.minimum(np.searchsorted(keys, keys + step), max(len(keys) - 1, 0))
        votes += np.where(keys[at] == keys + step, counts[at], 0)
    keys, counts, votes = (x[votes >= least_votes] for x in (keys, counts, votes))
    pairs = keys // _OFFSETS
    order = np.lexsort((counts, votes, pairs))
    last = order[np.flatnonzero(np.diff(pairs[order], append=-1))]
    columns = (pairs // n_right, pairs % n_right, keys % _OFFSETS - _OFFSETS // 2, votes)
    return np.stack([column[last] for column in columns], axis=1)
