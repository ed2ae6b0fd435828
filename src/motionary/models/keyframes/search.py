"""Which frames of many documents does a keyframe query find?

The result of Algorithm 1 of Baak, Müller and Seidel (2008), see `algorithm`, without a step
per segment: keyframes are ANDs of bitmaps, whole stretches are ruled out first, the
remaining runs are joined as interval sets. `search_words` reads the words of one document
instead, for recordings that no index knows.

A relation that is unknown does not hold and does not fail: a keyframe that fixes it is not
seen there. No hit crosses the border of a document.
"""

import sys
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.models.keyframes.intervals import FAR, Documents, Intervals, join
from motionary.models.keyframes.lists import Plan, plan_query, read_lists, reading_order, to_word
from motionary.models.keyframes.query import KeyframeQuery, check_features
from motionary.models.keyframes.ranges import HitRanges
from motionary.models.keyframes.word_index import PostingIndex
from motionary.packing import PackedFeatures

Engine = Literal["auto", "numpy", "compiled"]


def search_query(
    query: KeyframeQuery, index: PostingIndex, *, engine: Engine = "auto"
) -> HitRanges:
    """Where a query has hits in the documents of an index.

    Parameters
    ----------
    query : KeyframeQuery
    index : PostingIndex over the same features
    engine : which twin computes, with the same result; a single query ends before a
        compiler is loaded, so "auto" takes the compiled one only where numba is at work
        already

    Returns
    -------
    HitRanges, the union of all stretches from first to last keyframe of a hit

    Raises
    ------
    InvalidInput
        If query and index are over different features.
    """
    check_features(query, index.feature_set, index.feature_ids)
    kernel = _compiled_kernel(engine)
    plan = plan_query(query)
    if plan is None:
        return HitRanges.none()
    rows = [index.rows(*keyframe) for keyframe in zip(plan.values, plan.fixed, strict=True)]
    if kernel is not None:
        return _search_compiled(kernel, index, rows, plan)
    lists = read_lists(index, rows, plan.gaps)
    return HitRanges.none() if lists is None else _join(lists, plan, index.documents)


def search_packed(
    query: KeyframeQuery, packed: PackedFeatures, known: PackedFeatures | None = None
) -> HitRanges:
    """Where a query has hits in one document.

    Parameters
    ----------
    query : KeyframeQuery
    words : array, shape (frames, n_words), uint64, over the features of the query
    known : mask of the same shape: which relations are known; all if left out

    Returns
    -------
    HitRanges, of document 0

    Raises
    ------
    InvalidInput
        If the words do not have the shape of the query's.
    """
    check_packed(query, packed, known)
    plan = plan_query(query)
    if plan is None:
        return HitRanges.none()
    lists = []
    for value, fixed in zip(plan.values, plan.fixed, strict=True):
        keyframe = to_word(value, packed.shape[1]), to_word(fixed, packed.shape[1])
        shown = frames_of_keyframe(*keyframe, packed, known)
        edges = np.flatnonzero(np.diff(shown, prepend=False, append=False))
        lists.append(Intervals(edges[::2], edges[1::2]))
    return _join(lists, plan, Documents.lay_out(np.array([len(packed)], dtype=np.int64)))


def frames_of_keyframe(
    value: PackedFeatures,
    fixed: PackedFeatures,
    packed: PackedFeatures,
    known: PackedFeatures | None,
) -> NDArray[np.bool_]:
    """Which frames show a keyframe: all of its fixed relations known and as it says.

    Parameters
    ----------
    value, fixed : arrays, shape (n_words,)
    words, known : arrays, shape (frames, n_words); known may be None

    Returns
    -------
    array, shape (frames,), bool
    """
    # Few arrays between: a search reads the words once per keyframe and does little else.
    shown = (packed & fixed) == (value & fixed)
    if known is not None:
        shown &= (known & fixed) == fixed
    return np.asarray(shown.all(axis=1))


def check_packed(
    query: KeyframeQuery, packed: PackedFeatures, known: PackedFeatures | None
) -> None:
    """Refuse words that cannot be of the query's features.

    Raises
    ------
    InvalidInput
    """
    if packed.ndim != 2 or packed.shape[1] != query.values.shape[1]:
        raise InvalidInput(
            f"the query has {query.values.shape[1]} integers a frame, the document has shape "
            f"{packed.shape}; both must come from one feature set"
        )
    if known is not None and known.shape != packed.shape:
        raise InvalidInput(f"known needs the shape of words {packed.shape}, got {known.shape}")


def _join(lists: Sequence[Intervals], plan: Plan, documents: Documents) -> HitRanges:
    found, number = join(lists, plan.gaps, documents)
    return _in_documents(found.starts, found.stops, number, documents)


def _search_compiled(
    kernel: Callable[..., Any], index: PostingIndex, rows: list[list[int]], plan: Plan
) -> HitRanges:
    rarity = [index.counts[row[0]] for row in rows]
    gaps = [(least, FAR if most is None else most) for least, most in plan.gaps]
    documents = index.documents
    found = kernel(
        index.planes,
        np.array([row for keyframe in rows for row in keyframe]),
        np.cumsum([len(keyframe) for keyframe in rows]),
        np.array(rarity),
        np.array(reading_order(rarity)),
        np.array(gaps, dtype=np.int64).reshape(-1, 2),
        (documents.starts, documents.stops, documents.of_byte),
    )
    return _in_documents(found[:, 0], found[:, 1], documents.number(found[:, 0]), documents)


def _in_documents(
    starts: NDArray[np.int64],
    stops: NDArray[np.int64],
    number: NDArray[np.int32],
    documents: Documents,
) -> HitRanges:
    begin = documents.starts[number]
    return HitRanges(number.astype(np.int64), starts - begin, stops - begin)


def _compiled_kernel(engine: Engine) -> Callable[..., Any] | None:
    if engine == "numpy" or (engine == "auto" and "numba" not in sys.modules):
        return None
    try:
        from motionary.models.keyframes._compiled import search_planes
    except ImportError:
        if engine == "compiled":
            raise InvalidInput(
                "the compiled engine needs numba; pip install 'motionary[fast]'"
            ) from None
        return None
    kernel: Callable[..., Any] = search_planes
    return kernel
