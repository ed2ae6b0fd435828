"""How does one example rank recordings, whatever it is compared by?

A recording's cost is the smallest along it; it counts once.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.baselines import BASELINES, match_costs
from evidence.common.ranking import clip_costs, corpus_of
from evidence.common.recordings import Clip
from motionary.evaluation import compute_average_precision, compute_r_precision
from motionary.features import FeatureSequence
from motionary.matching import Corpus, Pattern
from motionary.retrieval.index import Collection
from motionary.retrieval.search import QueryExpansion, RelevanceFeedback, SearchResult, search

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

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
        """As one stretch of words."""
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
        """Cost of every recording for what is sought."""
        return np.asarray(clip_costs({"": pattern}, self.pool.corpus)[:, 0], dtype=np.float64)

    def hits(
        self,
        expansion: QueryExpansion | None,
        *,
        feedback: RelevanceFeedback | None = None,
        limit: int,
    ) -> SearchResult:
        """The first hits."""
        return search(
            feedback or self.example, self.pool.collection, limit=limit, expansion=expansion
        )

    def judge(self, hits: SearchResult) -> tuple[RelevanceFeedback, Bools]:
        """What a person who knows the truth says of hits, and which recordings are left."""
        numbers = {id(s): i for i, s in enumerate(self.pool.collection.sequences)}
        at = [numbers[id(hit.evidence.sequence)] for hit in hits]
        good = tuple(hit for hit, i in zip(hits, at, strict=True) if self.relevant[i])
        bad = tuple(hit for hit, i in zip(hits, at, strict=True) if not self.relevant[i])
        left = np.ones(len(self.relevant), dtype=np.bool_)
        left[at] = False
        return RelevanceFeedback(self.example, good, bad), left


def score_judged(
    queries: Sequence[Query], settings: Mapping[str, QueryExpansion], *, n_hits: int
) -> dict[str, Any]:
    """Answers before and after the first hits are judged.

    Measured on all recordings, and on those left that were not judged, if any of them is
    right. With a negative `prior`, wrong hits are not told.
    """
    scores: dict[str, dict[str, list[tuple[float, float]]]] = {
        part: {name: [] for name in ("before", *settings)} for part in ("all", "left")
    }
    n_good = []
    for query in queries:
        hits = query.hits(QueryExpansion(), limit=n_hits)
        feedback, left = query.judge(hits)
        n_good.append(len(feedback.relevant))
        answers = {"before": query.costs_of(hits[0].evidence.pattern)}
        for name, expansion in settings.items():
            told = replace(feedback, irrelevant=()) if expansion.prior < 0 else feedback
            answers[name] = query.costs(expansion, feedback=told)
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
        "good": float(np.mean(n_good)),
    }


def others_of(clips: Sequence[Clip], queries: Sequence[Clip]) -> list[Query]:
    """Each clip, sought among those of the other actors."""
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
    example: Floats, documents: Sequence[Floats], *, baseline: str = "positions"
) -> Floats:
    """Smallest cost of an example's joint positions in each document, shape (documents,).

    All documents are compared at once, as words are.
    """
    gap = np.full((_BREAK, *example.shape[1:]), np.nan)
    joined = np.concatenate([part for document in documents for part in (document, gap)])
    distance = match_costs(BASELINES[baseline].costs(example, joined)).distance
    starts = np.cumsum([0, *(len(document) + _BREAK for document in documents[:-1])])
    return np.asarray(np.minimum.reduceat(distance, starts))


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """A result, and the seconds of processor time that it took."""
    began = time.process_time()
    return call(), time.process_time() - began


def rows_of(
    queries: Sequence[Query], ways: Mapping[str, Sequence[tuple[float, float]]]
) -> list[dict[str, Any]]:
    """Per query, what each way scored."""
    return [
        {"query": query.name, "relevant": int(query.relevant.sum())}
        | {way: list(scores[i]) for way, scores in ways.items()}
        for i, query in enumerate(queries)
    ]
