"""One example as the query, whatever it is compared by.

A recording's cost is the smallest along it; it counts once.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.baselines import BASELINES, match_costs
from evidence.common.ranking import clip_costs, corpus_of
from evidence.common.recordings import Clip, Recordings
from motionary.evaluation import compute_average_precision, compute_r_precision
from motionary.features import FeatureSequence
from motionary.matching import Corpus, Pattern, self_information
from motionary.models.templates import QuantisedTemplate, pattern_of
from motionary.recording import Recording
from motionary.retrieval.index import Collection
from motionary.retrieval.search import QueryExpansion, RelevanceFeedback, SearchResult, search

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
SearchHits = tuple[Any, ...]

#: No path leads over so many frames that nothing was seen in.
_BREAK = 2
SHUFFLES = 200


@dataclass(frozen=True, eq=False)
class Pool:
    """Recordings that are searched."""

    sequences: tuple[FeatureSequence, ...]

    @cached_property
    def collection(self) -> Collection:
        """As `search` takes them."""
        return Collection(self.sequences)

    @cached_property
    def corpus(self) -> Corpus:
        """As one padded sequence."""
        return corpus_of(self.sequences)


@dataclass(frozen=True, eq=False)
class Query:
    """An example, what is searched, and which recordings are of its kind."""

    name: str
    example: FeatureSequence
    pool: Pool
    relevant: Bools

    def costs(
        self, expansion: QueryExpansion | None, *, feedback: RelevanceFeedback | None = None
    ) -> Floats:
        """Cost of every recording."""
        result = self.hits(expansion, feedback=feedback, limit=1)
        return self.costs_of(result[0].evidence.pattern)

    def costs_of(self, pattern: Pattern) -> Floats:
        """Cost of every recording for a pattern."""
        return np.asarray(clip_costs({"": pattern}, self.pool.corpus)[:, 0], dtype=np.float64)

    def hits(
        self,
        expansion: QueryExpansion | None,
        *,
        feedback: RelevanceFeedback | None = None,
        limit: int,
    ) -> SearchResult:
        """The first hits."""
        pattern = feedback or self.example
        return search(pattern, self.pool.collection, limit=limit, expansion=expansion)

    def marked(self, hits: SearchResult) -> tuple[SearchHits, SearchHits, Bools]:
        """Relevant and irrelevant hits by the truth, and which recordings are left."""
        numbers = {id(s): i for i, s in enumerate(self.pool.collection.sequences)}
        at = [numbers[id(hit.evidence.sequence)] for hit in hits]
        relevant = tuple(hit for hit, i in zip(hits, at, strict=True) if self.relevant[i])
        irrelevant = tuple(hit for hit, i in zip(hits, at, strict=True) if not self.relevant[i])
        left = np.ones(len(self.relevant), dtype=np.bool_)
        left[at] = False
        return relevant, irrelevant, left


def score_feedback(
    queries: Sequence[Query], settings: Mapping[str, QueryExpansion], *, n_hits: int
) -> dict[str, Any]:
    """Answers before and after the first hits are marked as relevant or irrelevant.

    Measured on all recordings, and on those left that were not marked, if any of them is
    right. With a negative `prior`, irrelevant hits are not given.
    """
    scores: dict[str, dict[str, list[tuple[float, float]]]] = {
        part: {name: [] for name in ("before", *settings)} for part in ("all", "left")
    }
    n_relevant = []
    for query in queries:
        hits = query.hits(QueryExpansion(), limit=n_hits)
        relevant, irrelevant, left = query.marked(hits)
        n_relevant.append(len(relevant))
        answers = {"before": query.costs_of(hits[0].evidence.pattern)}
        for name, expansion in settings.items():
            given = irrelevant if expansion.prior >= 0 else ()
            feedback = RelevanceFeedback(query.example, relevant, given)
            answers[name] = query.costs(expansion, feedback=feedback)
        for name, costs in answers.items():
            scores["all"][name].append(score(costs, query.relevant))
            if query.relevant[left].any():
                scores["left"][name].append(score(costs[left], query.relevant[left]))
    return {
        part: {name: mean(pairs) for name, pairs in by_name.items()}
        for part, by_name in scores.items()
    } | {
        "queries": len(scores["left"]["before"]),
        "of": len(queries),
        "good": float(np.mean(n_relevant)),
    }


def others_of(clips: Sequence[Clip], queries: Sequence[Clip]) -> list[Query]:
    """Each clip, searched for among those of the other actors."""
    pools = {
        actor: [clip for clip in clips if clip.actor != actor]
        for actor in {query.actor for query in queries}
    }
    made = {actor: Pool(tuple(c.packed for c in pool)) for actor, pool in pools.items()}
    return [
        Query(
            query.name.split("/")[-1],
            query.packed,
            made[query.actor],
            np.array([c.motion_class == query.motion_class for c in pools[query.actor]]),
        )
        for query in queries
    ]


def score(costs: Floats, relevant: Bools) -> tuple[float, float]:
    """Average precision and R-precision."""
    return compute_average_precision(costs, relevant), compute_r_precision(costs, relevant)


def score_all(queries: Sequence[Query], expansion: QueryExpansion) -> list[tuple[float, float]]:
    """Both of each query."""
    return [score(query.costs(expansion), query.relevant) for query in queries]


def mean(scores: Sequence[tuple[float, float]]) -> dict[str, float]:
    """Means of both; queries without anything relevant do not count."""
    average, first = np.nanmean(np.array(scores), axis=0)
    return {"average_precision": float(average), "r_precision": float(first)}


def chance(relevant: Bools, *, seed: int) -> tuple[float, float]:
    """Both of recordings in random order, the mean of many."""
    rng = np.random.default_rng(seed)
    shuffled = [score(rng.random(len(relevant)), relevant) for _ in range(SHUFFLES)]
    return float(np.mean([s[0] for s in shuffled])), float(np.mean([s[1] for s in shuffled]))


def position_costs_of(
    example: Floats, recordings: Sequence[Floats], *, baseline: str = "positions"
) -> Floats:
    """Smallest cost of an example's joint positions in each recording, shape (recordings,).

    All are compared at once, as packed features are.
    """
    gap = np.full((_BREAK, *example.shape[1:]), np.nan)
    joined = np.concatenate([part for one in recordings for part in (one, gap)])
    distance = match_costs(BASELINES[baseline].costs(example, joined)).distance
    starts = np.cumsum([0, *(len(one) + _BREAK for one in recordings[:-1])])
    return np.asarray(np.minimum.reduceat(distance, starts))


def rows_of(
    queries: Sequence[Query], ways: Mapping[str, Sequence[tuple[float, float]]]
) -> list[dict[str, Any]]:
    """Per query, what each way scored."""
    return [
        {"query": query.name, "relevant": int(query.relevant.sum())}
        | {way: list(scores[i]) for way, scores in ways.items()}
        for i, query in enumerate(queries)
    ]


Joined = tuple[Floats, NDArray[np.bool_]]

#: Ways of the publication, by the names of the baselines.
BASELINE = {"RF": "relations", "Q": "quaternions", "3D": "positions-upright",
            "3D heading": "positions"}  # fmt: skip
RANKS = (5, 10, 20)
MOST = 10
INFINITE = "inf"


class Frames:
    """Frames of clips, measured once, one behind the other with two empty ones between."""

    def __init__(self, recordings: Recordings, clips: Sequence[Clip], way: str) -> None:
        self._way = BASELINES[BASELINE[way]]
        measured = [self._way.measure(recordings.motion(clip.name)) for clip in clips]
        if way == "RF":
            measured = [frames[:, :39] for frames in measured]
        self.by_name = {c.name: frames for c, frames in zip(clips, measured, strict=True)}

    def join(self, clips: Sequence[Clip]) -> Joined:
        """All frames, and which of them lie between the clips."""
        parts, between = [], []
        for clip in clips:
            frames = self.by_name[clip.name]
            empty = np.zeros((2, *frames.shape[1:]))
            parts += [frames, empty]
            between += [np.zeros(len(frames), np.bool_), np.ones(2, np.bool_)]
        return np.concatenate(parts), np.concatenate(between)

    def distance(self, query: Clip, among: Joined) -> Floats:
        """The distance function of one example over joined clips."""
        costs = self._way.costs(self.by_name[query.name], among[0])
        costs[:, among[1]] = np.inf
        return match_costs(costs).distance

    def distances(self, queries: Sequence[Clip], among: Joined) -> list[Floats]:
        """Those of several examples."""
        return [self.distance(query, among) for query in queries]


def as_joined(distance: Any) -> Floats:
    """A distance function of a corpus as `Frames.join` lays it out: the last clip ends alike."""
    return np.append(np.asarray(distance, dtype=np.float64), [np.inf, np.inf])


def score_distance(
    distance: Floats, clips: Sequence[Clip], relevant: NDArray[np.bool_]
) -> dict[str, Any]:
    """One hit a clip; separation: median of the distance by that of the right first ten."""
    costs = smallest(distance, clips)
    order = np.lexsort((relevant, costs))
    right = relevant[order] & np.isfinite(costs[order])
    top = costs[order][:MOST][right[:MOST]]
    middle = float(np.median(distance[np.isfinite(distance)]))
    separation: float | str | None = None
    if len(top):
        found = float(np.median(top))
        separation = middle / found if found > 0 else INFINITE
    return {
        "average_precision": compute_average_precision(costs, relevant),
        "first": [int(right[:rank].sum()) for rank in RANKS],
        "separation": separation,
    }


def smallest(distance: Floats, clips: Sequence[Clip]) -> Floats:
    lengths = np.array([len(clip.packed) + 2 for clip in clips])
    ends = np.cumsum(lengths)
    return np.array([distance[end - n : end].min() for end, n in zip(ends, lengths, strict=True)])


#: A part that fits nowhere costs as much as one that is wrong throughout.
_MOST = 1.0


class Parts(NamedTuple):
    """Settings: columns of a part, and the tempos at which it is searched for."""

    width: int
    tempos: tuple[float, ...]


def part_costs(example: FeatureSequence, corpus: Corpus, prior: Floats, parts: Parts) -> Floats:
    """Cost of every recording part by part, whatever the tempo of each, shape (recordings,).

    The example is cut into parts that overlap by half; each is searched for by itself, at
    several tempos. A recording costs the mean of what its parts cost there, each weighed by
    the self-information of its features, so that standing still counts little.
    """
    costs, weights = [], []
    for part in _cut(example, parts.width):
        patterns = {
            str(tempo): pattern_of(_template_of(at_tempo(part, tempo)), ones=prior)
            for tempo in parts.tempos
        }
        costs.append(np.minimum(clip_costs(patterns, corpus).min(axis=1), _MOST))
        weight = self_information(part.features.astype(np.bool_), prior) * part.known_features
        weights.append(weight.sum() / len(part))
    return np.asarray(np.average(costs, axis=0, weights=weights), dtype=np.float64)


def at_tempo(sequence: FeatureSequence, tempo: float) -> FeatureSequence:
    """Features as if the motion went so many times as fast."""
    n_frames = max(2, round(len(sequence) / tempo))
    at = np.minimum(((np.arange(n_frames) + 0.5) * tempo).astype(np.intp), len(sequence) - 1)
    return FeatureSequence(
        sequence.packed[at], sequence.known[at], sequence.feature_set, Recording(sequence.source)
    )


def _cut(example: FeatureSequence, width: int) -> Iterator[FeatureSequence]:
    last = max(len(example) - width, 0)
    starts: Sequence[int] = sorted({*range(0, last, max(width // 2, 1)), last})
    for start in starts:
        yield example.part(start, min(start + width, len(example)))


def _template_of(part: FeatureSequence) -> QuantisedTemplate:
    known = part.known_features.astype(np.bool_)
    return QuantisedTemplate(
        part.features.astype(np.bool_) & known,
        known,
        np.ones(len(part)),
        part.feature_set.ids,
        part.feature_set.name,
    )
