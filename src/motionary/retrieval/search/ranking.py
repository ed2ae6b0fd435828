"""Which stretches of a collection match a template best?

Ranked hits below a threshold (Müller and Röder 2006, section 5.4). Where keyframes come
first (Müller, Baak and Seidel 2009, section 5), a template is matched only around the hits
of its query: no path leaves such a window, and the cost is infinite outside of it.

Conventions: a window belongs to a document; documents are numbered as in the collection.
"""

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.features import FeatureSequence
from motionary.matching import (
    Alignment,
    Corpus,
    Pattern,
    align,
    corpus_distance,
    find_hits,
)
from motionary.models.keyframes import HitRanges, KeyframeQuery, PostingIndex, select_in_index
from motionary.models.templates import QuantisedTemplate
from motionary.packing import PackedFeatures
from motionary.retrieval.explanation import Evidence
from motionary.retrieval.index import Collection, Part
from motionary.retrieval.search.results import Hit, hit_of

Single = NDArray[np.float32]

# Costs of the distance function are single, those of paths double.
_ROUNDING = 1e-6
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Sought:
    """A template as it is sought, under the name that its hits get.

    Attributes
    ----------
    name, template, pattern : what is sought
    queries, votes : where given, the template is matched only where so many agree
    """

    name: str
    template: QuantisedTemplate
    pattern: Pattern
    queries: tuple[KeyframeQuery, ...] = ()
    votes: int = 1

    def windows(self, index: PostingIndex) -> HitRanges:
        """Where it is matched, if it has queries."""
        return select_in_index(self.queries, self.template.n_columns, index, votes=self.votes)


class Window(NamedTuple):
    """A stretch of a document in which a template was matched.

    Attributes
    ----------
    start : first frame of the document
    words, known, distance : of the stretch
    """

    start: int
    packed: PackedFeatures
    known: PackedFeatures
    distance: Single


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """Costs of a template in the windows of one part of a collection.

    Attributes
    ----------
    part : the part
    corpus : the windows
    documents, starts : arrays, shape (windows,): document of the part, and its first frame
    distance : array, shape (frames of the corpus,)
    """

    part: Part
    corpus: Corpus
    documents: Integers
    starts: Integers
    distance: Single

    def least(self) -> Single:
        """Smallest cost of every window, shape (windows,)."""
        # Documents without frames begin past the end.
        padded = np.append(self.distance, np.float32(np.inf))
        return np.minimum.reduceat(padded, self.corpus.starts)

    def windows(self, document: int) -> Iterator[Window]:
        """Windows of one document of the part."""
        first, stop = np.searchsorted(self.documents, [document, document + 1])
        for i in range(first, stop):
            inside = slice(self.corpus.starts[i], self.corpus.starts[i] + self.corpus.lengths[i])
            packed, known = self.corpus.document(i)
            yield Window(int(self.starts[i]), packed, known, self.distance[inside])


#: By the number of the part.
Matches = dict[int, Matched]


def rank(
    sought: Sequence[Sought], collection: Collection, *, threshold: float, limit: int | None
) -> list[Hit]:
    """Hits over all documents, best first; of equal ones the earlier document's first."""
    matched = [match(item, collection) for item in sought]
    smallest = _smallest(matched, len(collection))
    least = np.sort(smallest[np.isfinite(smallest)])
    if limit is not None and limit <= len(least):
        # So many documents have a hit at most as dear as this, unless too little was seen.
        bound = min(threshold, float(least[limit - 1]) * (1 + _ROUNDING) + _ROUNDING)
        hits = _collect(sought, matched, collection, smallest, bound, limit)
        if len(hits) == limit or bound == threshold:
            return hits
    return _collect(sought, matched, collection, smallest, threshold, limit)


def _collect(
    sought: Sequence[Sought],
    matched: "Sequence[Matches]",
    collection: Collection,
    smallest: NDArray[np.float64],
    threshold: float,
    limit: int | None,
) -> list[Hit]:
    """Hits of the documents in the order of their smallest cost, until no other can count."""
    found: list[tuple[float, int, int, Hit]] = []
    for number in np.argsort(smallest, kind="stable").tolist():
        least = smallest[number]
        if not np.isfinite(least) or least > threshold:
            break
        if limit is not None and len(found) >= limit:
            last = heapq.nsmallest(limit, (f[:2] for f in found))[-1]
            if (least * (1 - _ROUNDING), number) > last:
                break
        for hit in _hits_in(number, sought, matched, collection, threshold, limit):
            found.append((hit.cost, number, hit.evidence.alignment.start, hit))
    found.sort(key=lambda f: f[:3])
    return [f[3] for f in found[:limit]]


def match(item: Sought, collection: Collection) -> Matches:
    """Costs of a template in a collection; around its keyframes if it has some."""
    matched = {}
    for number, part in enumerate(collection.parts):
        if not item.queries:
            matched[number] = _match_all(item, part)
            continue
        ranges = item.windows(part.shard.word_index)
        if len(ranges):
            corpus = part.shard.cut(ranges)
            distance = corpus_distance(item.pattern, corpus)
            matched[number] = Matched(part, corpus, ranges.sequences, ranges.starts, distance)
    return matched


def fraction_matched(sought: Sequence[Sought], collection: Collection) -> float:
    """Share of the frames in which templates are matched, the mean over the templates."""
    chosen = 0
    for item in sought:
        for part in collection.parts:
            index = part.shard.word_index
            if not item.queries:
                chosen += index.n_frames
            else:
                chosen += item.windows(index).n_frames
    return chosen / max(len(sought) * collection.n_frames, 1)


def _match_all(item: Sought, part: Part) -> Matched:
    corpus, documents = part.shard.corpus, np.arange(len(part.shard))
    distance = corpus_distance(item.pattern, corpus)
    return Matched(part, corpus, documents, np.zeros_like(documents), distance)


def _smallest(matched: Sequence[Matches], n_documents: int) -> NDArray[np.float64]:
    """Smallest cost of every document over all templates, shape (documents,)."""
    smallest = np.full(n_documents, np.inf)
    for parts in matched:
        for found in parts.values():
            np.minimum.at(smallest, found.part.numbers[found.documents], found.least())
    return smallest


def _hits_in(
    number: int,
    sought: Sequence[Sought],
    matched: Sequence[Matches],
    collection: Collection,
    threshold: float,
    limit: int | None,
) -> list[Hit]:
    """Hits in one document; where templates of one class overlap the cheaper one stays."""
    part, document = collection.locate(number)
    sequence = collection.sequences[number]
    candidates: list[Evidence] = []
    for item, parts in zip(sought, matched, strict=True):
        for window in parts[part].windows(document) if part in parts else ():
            candidates += _matches(item, window, sequence, threshold, limit)
    taken: list[Evidence] = []
    for match in sorted(candidates, key=lambda e: (e.alignment.cost, e.alignment.start)):
        if not any(_repeats(match.alignment, other.alignment) for other in taken):
            taken.append(match)
    return [hit_of(match) for match in taken]


def _matches(
    item: Sought, window: Window, sequence: FeatureSequence, threshold: float, limit: int | None
) -> list[Evidence]:
    """Hits of one template in one window of which enough was seen."""
    _, packed, known, distance = window
    hits = find_hits(distance, item.pattern, packed, known, threshold=threshold, limit=limit)
    paths = align(item.pattern, packed, known, [hit.stop - 1 for hit in hits])
    found = (
        Evidence(item.name, item.template, item.pattern, sequence, path.shifted(window.start))
        for path in paths
    )
    return [evidence for evidence in found if evidence.is_assessed]


def _repeats(match: Alignment, other: Alignment) -> bool:
    """Whether more than half of a match lies within another."""
    shared = min(match.end, other.end) - max(match.start, other.start) + 1
    return 2 * shared > match.end - match.start + 1
