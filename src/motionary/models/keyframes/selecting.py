"""Where is a template worth matching, if its keyframes are known?

Around the hits of a query (Müller, Baak and Seidel 2009, section 5): each hit is extended by
twice what the template has before its first and after its last keyframe, the slowest tempo
at which the matcher still follows.
"""

from collections.abc import Sequence

from numpy.typing import ArrayLike

from motionary.models.keyframes.query import KeyframeQuery
from motionary.models.keyframes.ranges import HitRanges, agree, extend, margins
from motionary.models.keyframes.search import search_packed, search_query
from motionary.models.keyframes.word_index import PostingIndex
from motionary.packing import PackedFeatures


def select_in_index(
    queries: Sequence[KeyframeQuery], n_columns: int, index: PostingIndex, *, votes: int = 1
) -> HitRanges:
    """Windows of the documents of an index in which a template may lie.

    Parameters
    ----------
    queries : at least one
    n_columns : columns of the template
    index : PostingIndex over the features of the queries
    votes : windows of so many queries must agree

    Raises
    ------
    InvalidInput
        If queries and index are over different features, or so many votes are impossible.
    """
    found = [_windows(search_query(q, index), q, n_columns, index.lengths) for q in queries]
    return agree(found, votes=votes)


def select_in_sequence(
    queries: Sequence[KeyframeQuery],
    n_columns: int,
    packed: PackedFeatures,
    known: PackedFeatures | None = None,
    *,
    votes: int = 1,
) -> HitRanges:
    """The same in one document; see `search_words`."""
    found = [
        _windows(search_packed(q, packed, known), q, n_columns, [len(packed)]) for q in queries
    ]
    return agree(found, votes=votes)


def _windows(
    ranges: HitRanges, query: KeyframeQuery, n_columns: int, lengths: ArrayLike
) -> HitRanges:
    if query.positions is None or query.positions[-1] >= n_columns:
        # Written by hand, or for another template: the whole template may lie on either side.
        return extend(ranges, n_columns, n_columns, lengths)
    return extend(ranges, *margins(query, n_columns), lengths)
