"""Ranked hits of motion templates in a collection, and the result of a search.

Hits below a threshold (Müller and Röder 2006, section 5.4). A template with keyframe queries
(Müller, Baak and Seidel 2009, section 5) is matched only around their hits: no path leaves
such a window, and the cost is infinite outside of it.

Conventions: a window belongs to a sequence; sequences are numbered as in the collection.
"""

import heapq
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.batch import Failure
from motionary.features import FeatureSequence, NamedFile
from motionary.matching import Alignment, Corpus, Pattern, align_hits, corpus_distance
from motionary.models.keyframes import HitRanges, KeyframeQuery, PostingIndex, select_in_index
from motionary.models.templates import MotionTemplate, QuantisedTemplate
from motionary.motion import Floats, Motion
from motionary.packing import PackedFeatures
from motionary.recording import Recording
from motionary.retrieval.explanation import Comparison, Evidence
from motionary.retrieval.index import Collection, Part
from motionary.tables import Table, Tabular

Integers = NDArray[np.int64]
Single = NDArray[np.float32]

#: Costs of the distance function are single, those of paths double.
ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Hit:
    """A segment of a recording that matches.

    Attributes
    ----------
    recording : what it is a segment of
    start_s, end_s : seconds, half-open
    start_frame, end_frame : the file's own frame numbers, inclusive
    cost : 0 fits in every feature
    known : fraction of the cells of the pattern that were seen, in [0, 1]
    evidence : what `explain` needs
    comparison : with the example by ranked quantities, where it was found so
    """

    recording: Recording
    start_s: float
    end_s: float
    start_frame: int
    end_frame: int
    cost: float
    known: float
    evidence: Evidence = field(compare=False, repr=False)
    comparison: Comparison | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult(Sequence[Hit], Tabular):
    """Hits, best first, and what they were found with.

    Attributes
    ----------
    hits : best first
    templates : of the query; expanded from the example where one was given
    failures : files that could not be read, and why
    nearest : without hits, a sentence on what came closest
    queries : keyframes that chose where to match; none if everything was matched
    fraction_matched : fraction of all frames that was matched; without shards that cannot win
    query, searched : what was searched for, and where, as they were given
    """

    hits: tuple[Hit, ...]
    templates: tuple[MotionTemplate, ...]
    failures: tuple[Failure[NamedFile], ...] = ()
    nearest: str = ""
    queries: tuple[KeyframeQuery, ...] = ()
    fraction_matched: float = 1.0
    query: Any = None
    searched: Any = None

    def show(self, recordings: Any = None) -> Any:
        """A page that plays the hits side by side, in step; notebooks show it in the cell.

        Parameters
        ----------
        recordings : motions, folders or files; by default those that were searched

        Returns
        -------
        motionary.reporting.Page

        Raises
        ------
        InvalidInput
            If features were searched, which have no positions, and no recordings are given.
        """
        # Late, through the front door: pages know hits, not the other way round.
        from motionary import Motion, report_hits

        query = self.query if isinstance(self.query, Motion) else None
        return report_hits(self, self.searched if recordings is None else recordings, query=query)

    def __repr__(self) -> str:
        best = f", best {self.hits[0].recording.name!r}" if self.hits else ""
        return (
            f"SearchResult({len(self)} hits{best}, {len(self.templates)} templates, "
            f"{len(self.failures)} failures)"
        )

    def list_rows(self) -> Table:
        """A row for each hit, best first."""
        columns = ("start_s", "end_s", "start_frame", "end_frame", "cost", "known")
        rows = [
            (rank, hit.recording.name, *(getattr(hit, column) for column in columns))
            for rank, hit in enumerate(self, start=1)
        ]
        return Table(("rank", "recording", *columns), rows)

    def __len__(self) -> int:
        return len(self.hits)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        return self.hits[index]

    def __iter__(self) -> Iterator[Hit]:
        return iter(self.hits)


@dataclass(frozen=True, slots=True, eq=False)
class SearchPattern:
    """A template as it is searched for, under the name that its hits get.

    Attributes
    ----------
    name : of the class, or where the template comes from
    template, pattern : cell by cell, and as the matcher takes it
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
    """A segment of a sequence in which a template was matched.

    Attributes
    ----------
    start : its first frame in the sequence
    packed, known, distance : of the segment
    """

    start: int
    packed: PackedFeatures
    known: PackedFeatures
    distance: Single


@dataclass(frozen=True, slots=True, eq=False)
class MatchedPart:
    """Costs of a template in the windows of one part of a collection.

    Attributes
    ----------
    part : the part
    corpus : the windows
    sequences, starts : arrays, shape (windows,): number in the part, and its first frame
    distance : array, shape (frames of the corpus,)
    """

    part: Part
    corpus: Corpus
    sequences: Integers
    starts: Integers
    distance: Single

    def least(self) -> Single:
        """Smallest cost of every window, shape (windows,)."""
        # Sequences without frames begin past the end.
        padded = np.append(self.distance, np.float32(np.inf))
        return np.minimum.reduceat(padded, self.corpus.starts)

    def windows(self, place: int) -> Iterator[Window]:
        """Windows of one sequence of the part."""
        first, stop = np.searchsorted(self.sequences, [place, place + 1])
        for i in range(first, stop):
            inside = slice(self.corpus.starts[i], self.corpus.starts[i] + self.corpus.lengths[i])
            packed, known = self.corpus.sequence(i)
            yield Window(int(self.starts[i]), packed, known, self.distance[inside])


@dataclass(frozen=True, eq=False)
class Matches:
    """Costs of templates in a collection, computed once for any ranking.

    Attributes
    ----------
    patterns : what was matched
    collection : where
    parts : for each pattern its costs, by the number of the part
    """

    patterns: Sequence[SearchPattern]
    collection: Collection
    parts: Sequence[Mapping[int, MatchedPart]]

    @property
    def n_matched(self) -> int:
        """Frames in which templates were matched, the sum over them."""
        return sum(int(m.corpus.lengths.sum()) for ms in self.parts for m in ms.values())

    @cached_property
    def smallest(self) -> NDArray[np.float64]:
        """Smallest cost of every recording over all templates, shape (recordings,)."""
        smallest = np.full(len(self.collection), np.inf)
        for matched in self.parts:
            for found in matched.values():
                np.minimum.at(smallest, found.part.numbers[found.sequences], found.least())
        return smallest

    def rank(self, *, threshold: float, limit: int | None) -> list[Hit]:
        """Hits over all recordings, best first; of equal ones the earlier recording's first."""
        return [row[3] for row in self.rank_numbered(threshold=threshold, limit=limit)]

    def rank_numbered(
        self, *, threshold: float, limit: int | None
    ) -> list[tuple[float, int, int, Hit]]:
        """The same, each with its cost, the number of its recording, and its first frame."""
        least = np.sort(self.smallest[np.isfinite(self.smallest)])
        if limit is not None and limit <= len(least):
            # So many recordings have a hit of at most this cost, unless too little was seen.
            bound = min(threshold, float(least[limit - 1]) * (1 + ROUNDING) + ROUNDING)
            hits = self._collect(bound, limit)
            if len(hits) == limit or bound == threshold:
                return hits
        return self._collect(threshold, limit)

    def _collect(self, threshold: float, limit: int | None) -> list[tuple[float, int, int, Hit]]:
        """Hits of the recordings by their smallest cost, until no other can count."""
        found: list[tuple[float, int, int, Hit]] = []
        for number in np.argsort(self.smallest, kind="stable").tolist():
            least = self.smallest[number]
            if not np.isfinite(least) or least > threshold:
                break
            if limit is not None and len(found) >= limit:
                last = heapq.nsmallest(limit, (f[:2] for f in found))[-1]
                if (least * (1 - ROUNDING), number) > last:
                    break
            for hit in self._hits_in(number, threshold, limit):
                found.append((hit.cost, number, hit.evidence.alignment.start, hit))
        found.sort(key=lambda f: f[:3])
        return found[:limit]

    def _hits_in(self, number: int, threshold: float, limit: int | None) -> list[Hit]:
        """Hits in one recording; where templates of one class overlap the cheaper one stays."""
        part, place = self.collection.locate(number)
        sequence = self.collection.sequences[number]
        candidates: list[Evidence] = []
        for pattern, parts in zip(self.patterns, self.parts, strict=True):
            for window in parts[part].windows(place) if part in parts else ():
                candidates += _find_matches(pattern, window, sequence, threshold, limit)
        taken: list[Evidence] = []
        for match in sorted(candidates, key=lambda e: (e.alignment.cost, e.alignment.start)):
            if not any(_repeats(match.alignment, other.alignment) for other in taken):
                taken.append(match)
        return [hit_of(match) for match in taken]


def match(patterns: Sequence[SearchPattern], collection: Collection) -> Matches:
    """Costs of templates in a collection; around their keyframes where they have some."""
    return Matches(patterns, collection, [_match_one(p, collection) for p in patterns])


def hit_of(evidence: Evidence) -> Hit:
    """The hit that stands on some evidence."""
    sequence, alignment = evidence.sequence, evidence.alignment
    start_s, end_s = sequence.segment(alignment.start, alignment.end + 1)
    return Hit(
        recording=sequence.recording,
        start_s=start_s,
        end_s=end_s,
        start_frame=sequence.recording.frame_at(start_s),
        end_frame=sequence.recording.last_frame_before(end_s),
        cost=alignment.cost,
        known=evidence.known,
        evidence=evidence,
    )


def _match_one(pattern: SearchPattern, collection: Collection) -> dict[int, MatchedPart]:
    matched = {}
    for number, part in enumerate(collection.parts):
        if not pattern.queries:
            corpus, sequences = part.shard.corpus, np.arange(len(part.shard))
            starts = np.zeros_like(sequences)
        else:
            ranges = pattern.windows(part.shard.posting_index)
            if not len(ranges):
                continue
            corpus = part.shard.cut(ranges)
            sequences, starts = ranges.sequences, ranges.starts
        distance = corpus_distance(pattern.pattern, corpus)
        matched[number] = MatchedPart(part, corpus, sequences, starts, distance)
    return matched


def _find_matches(
    item: SearchPattern,
    window: Window,
    sequence: FeatureSequence,
    threshold: float,
    limit: int | None,
) -> list[Evidence]:
    """Hits of one template in one window of which enough was seen."""
    _, packed, known, distance = window
    paths = align_hits(distance, item.pattern, packed, known, threshold=threshold, limit=limit)
    found = (
        Evidence(item.name, item.template, item.pattern, sequence, path.shifted(window.start))
        for path in paths
    )
    return [evidence for evidence in found if evidence.is_assessed]


def _repeats(match: Alignment, other: Alignment) -> bool:
    """Whether more than half of a match lies within another."""
    shared = min(match.end, other.end) - max(match.start, other.start) + 1
    return 2 * shared > match.end - match.start + 1


def cut_frames(motion: Motion, first: int, last: int) -> tuple[Floats, Floats]:
    """Generic joints of frames as the file numbers them, both ends included, and their times."""
    start = max(first - motion.first_frame, 0)
    stop = min(max(last + 1 - motion.first_frame, start + 1), motion.n_frames)
    return motion.cut(start, stop).generic_positions(), np.arange(start, stop) / motion.rate_hz
