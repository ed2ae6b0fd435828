"""Where in a collection is a motion like this one?

By class or template: ranked hits below a threshold (Müller and Röder 2006, section 5.4).
By example: the example's words are the first template; a template learned from the example
and its nearest hits shows what may vary, and ranks again.
"""

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motionary.batch import Failure
from motionary.errors import InvalidInput
from motionary.explanation import Evidence, explain
from motionary.features import WORD_HZ, FeatureSequence, NamedFile, Reading, compute_features
from motionary.index import Collection, collect
from motionary.library import MotionClass
from motionary.matching import (
    Pattern,
    align,
    corpus_distance,
    find_hits,
    share_of_ones,
)
from motionary.motion import Motion
from motionary.templates import (
    MotionTemplate,
    QuantisedTemplate,
    learn_template,
    pattern_of,
    quantise,
)

Single = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Growing:
    """How an example becomes a template.

    Attributes
    ----------
    hits : nearest hits that the template is learned from, beside the example; 0 searches
        the example's words as they are
    rounds : how often the nearest hits are found anew
    most_cost : a nearest hit that costs more is too far to learn from
    tolerance : a cell is fixed if at most this share of example and hits differs
    by_surprise : whether what is rare in the collection weighs more
    """

    hits: int = 3
    rounds: int = 1
    most_cost: float = 0.25
    tolerance: float = 0.1
    by_surprise: bool = True


@dataclass(frozen=True, slots=True)
class Hit:
    """A stretch of a recording that matches.

    Attributes
    ----------
    recording : name of the recording
    start_s, end_s : seconds, half-open
    start_frame, end_frame : the file's own frame numbers, inclusive
    cost : 0 fits in every relation
    known : share of the asked-for relations that were seen, in [0, 1]
    evidence : what `explain` needs
    """

    recording: str
    start_s: float
    end_s: float
    start_frame: int
    end_frame: int
    cost: float
    known: float
    evidence: Evidence = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult(Sequence[Hit]):
    """Hits, best first, and what they were found with.

    Attributes
    ----------
    hits : best first
    templates : what was sought; grown from the example where one was given
    failures : files that could not be read, and why
    nearest : without hits, a sentence on what came closest
    """

    hits: tuple[Hit, ...]
    templates: tuple[MotionTemplate, ...]
    failures: tuple[Failure[NamedFile], ...] = ()
    nearest: str = ""

    def __len__(self) -> int:
        return len(self.hits)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        return self.hits[index]

    def __iter__(self) -> Iterator[Hit]:
        return iter(self.hits)


def search(
    query: Motion | FeatureSequence | MotionTemplate | MotionClass,
    recordings: Collection | str | Path | Sequence[str | Path | Motion | FeatureSequence],
    *,
    threshold: float | None = None,
    limit: int | None = 20,
    growing: Growing | None = None,
    reading: Reading | None = None,
    jobs: int = 1,
) -> SearchResult:
    """Ranked hits of an example, a template or a class.

    Parameters
    ----------
    query : an example (a motion or its words, cut to what is sought), a template or a class
    recordings : a folder or files, motions, words, or a collection of them
    threshold : largest cost; by default the class's own, none for an example or template
    limit : most hits; None for all
    growing : how an example becomes a template
    reading, jobs : how files are read

    Raises
    ------
    InvalidInput
        If there is nothing to search, or a template is free everywhere.
    """
    collection = (
        recordings
        if isinstance(recordings, Collection)
        else collect(recordings, reading=reading, jobs=jobs)
    )
    settings = growing or Growing()
    if isinstance(query, Motion):
        query = compute_features(query, feature_set=collection.feature_set)
    if isinstance(query, FeatureSequence):
        return _by_example(query, collection, threshold, limit, settings)
    if isinstance(query, MotionTemplate):
        quantised = quantise(query, tolerance=settings.tolerance)
        sought = [_Sought(query.provenance or "template", quantised, pattern_of(quantised))]
        return _result(sought, (query,), collection, threshold, limit)
    sought = [_Sought(query.name, template, pattern) for template, pattern in query.sought()]
    templates = tuple(s.template for s in query.subclasses)
    limit_cost = query.threshold if threshold is None else threshold
    return _result(sought, templates, collection, limit_cost, limit)


@dataclass(frozen=True, slots=True, eq=False)
class _Sought:
    """A template as it is sought, under the name that its hits get."""

    name: str
    template: QuantisedTemplate
    pattern: Pattern


def _by_example(
    example: FeatureSequence,
    collection: Collection,
    threshold: float | None,
    limit: int | None,
    growing: Growing,
) -> SearchResult:
    if example.feature_set.name != collection.feature_set.name:
        raise InvalidInput(
            f"the example has words of {example.feature_set.name!r}, the collection of "
            f"{collection.feature_set.name!r}"
        )
    ones = None
    if growing.by_surprise:
        ones = share_of_ones(collection.corpus, len(collection.feature_set))
    template = _learn(example, [])
    for _ in range(growing.rounds if growing.hits else 0):
        sought = _seek(example, template, growing, ones)
        nearest = _rank([sought], collection, growing.most_cost, growing.hits + 1)
        others = [hit for hit in nearest if not _is_example(hit, example)][: growing.hits]
        template = _learn(example, others)
    sought = _seek(example, template, growing, ones)
    return _result([sought], (template,), collection, threshold, limit)


def _seek(
    example: FeatureSequence,
    template: MotionTemplate,
    growing: Growing,
    ones: NDArray[np.float64] | None,
) -> _Sought:
    quantised = quantise(template, tolerance=growing.tolerance)
    if quantised.n_fixed == 0:
        raise InvalidInput(
            f"{example.source}: nothing of the example is known and common to its hits; "
            "give a longer stretch or an example in which more joints are seen"
        )
    name = f"like {example.source}" if example.source else "like the example"
    return _Sought(name, quantised, pattern_of(quantised, ones=ones))


def _learn(example: FeatureSequence, hits: Sequence[Hit]) -> MotionTemplate:
    parts = [example]
    for hit in hits:
        found = hit.evidence
        parts.append(found.sequence.part(found.alignment.start, found.alignment.end + 1))
    every = all(bool(p.known_features.all()) for p in parts)
    return learn_template(
        [p.features for p in parts],
        known=None if every else [p.known_features.astype(np.bool_) for p in parts],
        feature_names=example.feature_set.ids,
        feature_set=example.feature_set.name,
        provenance=f"grown from {example.source or 'an example'} and {len(hits)} hits",
    )


def _is_example(hit: Hit, example: FeatureSequence) -> bool:
    """Whether a hit is the example itself, found in the collection: it teaches nothing."""
    found = hit.evidence.sequence
    start = hit.evidence.alignment.start
    stretch = found.words[start : start + len(example)]
    return stretch.shape == example.words.shape and bool((stretch == example.words).all())


def _result(
    sought: Sequence[_Sought],
    templates: tuple[MotionTemplate, ...],
    collection: Collection,
    threshold: float | None,
    limit: int | None,
) -> SearchResult:
    most = np.inf if threshold is None else threshold
    hits = tuple(_rank(sought, collection, most, limit))
    nearest = "" if hits else _nearest(sought, collection, most)
    return SearchResult(hits, templates, collection.failures, nearest)


def _rank(
    sought: Sequence[_Sought], collection: Collection, threshold: float, limit: int | None
) -> list[Hit]:
    """Hits over all documents, best first.

    Documents are taken in the order of their smallest cost, until the next one cannot
    add to the hits that count.
    """
    distances = [_split(s.pattern, collection) for s in sought]
    least = [
        min((float(d[i].min(initial=np.inf)), k) for k, d in enumerate(distances))
        for i in range(len(collection))
    ]
    order = sorted(range(len(collection)), key=lambda i: (least[i][0], i))
    found: list[tuple[float, int, int, Hit]] = []
    for i in order:
        smallest = least[i][0]
        full = limit is not None and len(found) >= limit
        if not np.isfinite(smallest) or smallest > threshold:
            break
        if full and smallest > heapq.nsmallest(limit or 0, (f[0] for f in found))[-1]:
            break
        per_template = [d[i] for d in distances]
        for hit in _hits_in(sought, per_template, collection.sequences[i], threshold, limit):
            found.append((hit.cost, i, hit.evidence.alignment.start, hit))
    found.sort(key=lambda f: f[:3])
    return [f[3] for f in found[:limit]]


def _split(pattern: Pattern, collection: Collection) -> list[Single]:
    return collection.corpus.split(corpus_distance(pattern, collection.corpus))


def _hits_in(
    sought: Sequence[_Sought],
    distances: Sequence[Single],
    sequence: FeatureSequence,
    threshold: float,
    limit: int | None,
) -> list[Hit]:
    """Hits in one document; where templates of one class overlap the cheaper one stays."""
    candidates = []
    for item, distance in zip(sought, distances, strict=True):
        words, known = sequence.words, sequence.known
        for hit in find_hits(
            distance, item.pattern, words, known, threshold=threshold, limit=limit
        ):
            candidates.append((hit.cost, hit.start, item, hit.stop - 1))
    taken: list[Hit] = []
    spans: list[tuple[int, int]] = []
    for _, _, item, end in sorted(candidates, key=lambda c: c[:2]):
        alignment = align(item.pattern, sequence.words, sequence.known, [end])[0]
        span = (alignment.start, alignment.end + 1)
        if any(2 * _overlap(span, other) > span[1] - span[0] for other in spans):
            continue
        spans.append(span)
        taken.append(_hit(Evidence(item.name, item.template, item.pattern, sequence, alignment)))
    return taken


def _overlap(a: tuple[int, int], b: tuple[int, int]) -> int:
    return max(0, min(a[1], b[1]) - max(a[0], b[0]))


def _hit(evidence: Evidence) -> Hit:
    sequence, alignment = evidence.sequence, evidence.alignment
    start_s, end_s = sequence.seconds(alignment.start), sequence.seconds(alignment.end + 1)
    return Hit(
        recording=sequence.source,
        start_s=start_s,
        end_s=end_s,
        start_frame=sequence.file_frame(start_s),
        end_frame=sequence.last_file_frame(end_s),
        cost=alignment.cost,
        known=evidence.known,
        evidence=evidence,
    )


def _nearest(sought: Sequence[_Sought], collection: Collection, threshold: float) -> str:
    """What came closest, for a search without hits."""
    best = _rank(sought, collection, np.inf, 1)
    if not best:
        return "no recording is long enough for what is sought"
    hit = best[0]
    reasons = ", ".join(str(f) for f in explain(hit.evidence).worst())
    return (
        f"nothing below {threshold:g}; nearest: {hit.recording} {hit.cost:.3f} at "
        f"{hit.evidence.alignment.start / WORD_HZ:.1f} s, failed: {reasons}"
    )
