"""How do a class's hits and times change when it is sought around keyframes only?"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from evidence.common.ranking import corpus_of
from evidence.common.streams import Stream
from motionary.features import FeatureSequence
from motionary.matching import Pattern, corpus_distance, find_hits
from motionary.models.keyframes import select_in_sequence
from motionary.models.library import MotionClass, Prototype

Windows = list[tuple[int, int]]
THRESHOLDS = (0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1, 0.13)
EVERYWHERE, RULE_OF_THUMB, CHOSEN = "everywhere", "rule of thumb, 2006", "choose_query"
AGAINST_MORE, BY_HAND = "choose_query against more", "by hand, 2009"
WAYS = (EVERYWHERE, RULE_OF_THUMB, CHOSEN, AGAINST_MORE, BY_HAND)
RETRIEVED_AT = (0.06, 0.1)
TIMED_PAIR = ("mm", "tr")
MEASURES = ("P1", "R1", "F1", "P2", "R2", "F2")
Row = dict[str, Any]


class StreamHits(NamedTuple):
    """Hits of a class in a stream.

    Attributes
    ----------
    hits : all of them
    right : hits whose middle lies in a clip of the class
    found : clips of the class with such a hit
    clips : clips of the class
    """

    hits: int
    right: int
    found: int
    clips: int


def windows_of(prototype: Prototype, packed: FeatureSequence) -> Windows:
    """Where a subclass is sought: everywhere without keyframes."""
    if not prototype.queries:
        return [(0, len(packed))]
    n_columns = prototype.template.n_columns
    ranges = select_in_sequence(
        prototype.queries, n_columns, packed.packed, packed.known, votes=prototype.votes
    )
    return ranges.of(0)


def match(pattern: Pattern, packed: FeatureSequence, windows: Windows) -> list[np.ndarray]:
    """Distance function in every window."""
    if not windows:
        return []
    corpus = corpus_of([packed.part(start, stop) for start, stop in windows])
    return list(corpus.split(corpus_distance(pattern, corpus)))


def hits_in(one: MotionClass, stream: Stream, *, threshold: float) -> StreamHits:
    """Hits of the templates of a class that are not mirrored."""
    ((_, pattern), *_), prototype = one.patterns, one.prototypes[0]
    windows = windows_of(prototype, stream.packed)
    middles = []
    for (start, stop), distance in zip(
        windows, match(pattern, stream.packed, windows), strict=True
    ):
        part = stream.packed.part(start, stop)
        hits = find_hits(distance, pattern, part.packed, part.known, threshold=threshold)
        middles += [start + (hit.start + hit.stop) / 2 for hit in hits]
    clips = [s for s in stream.truth if s.name == one.name]
    inside = [[s.start <= middle / 30 < s.end for middle in middles] for s in clips]
    right = sum(any(row) for row in zip(*inside, strict=True))
    return StreamHits(len(middles), right, sum(map(any, inside)), len(clips))


def share_looked_at(classes: Sequence[MotionClass], packed: FeatureSequence) -> float:
    """Share of the frames in which a template is matched, mean over all templates."""
    return float(
        np.mean(
            [
                sum(b - a for a, b in windows_of(s, packed)) / len(packed)
                for s in _subclasses(classes)
            ]
        )
    )


def search_keyframes(classes: Sequence[MotionClass], packed: FeatureSequence) -> None:
    """Keyframes of all classes in a recording that no index knows, to be timed."""
    for prototype in _subclasses(classes):
        windows_of(prototype, packed)


def match_all(classes: Sequence[MotionClass], packed: FeatureSequence) -> None:
    """The same, and distance functions of all templates in what is left, to be timed."""
    for one in classes:
        for prototype, (_, pattern) in zip(one.prototypes, one.patterns, strict=True):
            match(pattern, packed, windows_of(prototype, packed))


def _subclasses(classes: Sequence[MotionClass]) -> Iterator[Prototype]:
    return (prototype for one in classes for prototype in one.prototypes)
