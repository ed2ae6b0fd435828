"""Settings of query expansion, chosen apart from what is reported."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.examples import Pool, Query, mean, others_of, score_all
from evidence.common.pages import fraction
from evidence.common.recordings import Clip, Recordings, Results, clips_packed
from motionary.retrieval.search import QueryExpansion

TITLE = "How far a query is expanded"
SPLIT = "clips that are no queries of the report; each is searched for among other actors' clips"
SEED = 1
DATA = (
    "clips",
    ("of these the examples", lambda recordings: clips_packed(choose_queries(recordings))),
)

#: Unlike these, one at a time, or two where they act together.
BEFORE = QueryExpansion(hits=3, most_cost=0.35, reach=0.6, tolerance=0.1)
TRIES: tuple[dict[str, float], ...] = (
    {},
    {"hits": 0},
    {"hits": 1},
    {"hits": 5},
    {"hits": 8},
    {"reach": 0.4},
    {"reach": float("inf")},
    {"hits": 8, "reach": 0.4},
    {"most_cost": 0.2},
    {"tolerance": 0.26},
)
KEYS = ("hits", "most_cost", "reach", "tolerance")
ACTORS_PER_CLASS = 2
WORLDS = {
    "plenty": "the clips of all other actors",
    "few": "also the actor's own clips of other classes; of the right ones four at random",
    "few and far": "the same; of the right ones two, from the half that costs the example most",
}
RIGHT = {"few": 4, "few and far": 2}


def choose_queries(recordings: Recordings) -> list[Clip]:
    """A clip of each class and some actors, none of those that are reported."""
    reported = set(recordings.golden("example_queries.json"))
    rng = np.random.default_rng(SEED)
    chosen = []
    for name in recordings.classes:
        free = [c for c in recordings.of(motion_class=name) if Path(c.name).stem not in reported]
        actors = sorted({clip.actor for clip in free})
        for actor in sorted(rng.permutation(actors)[:ACTORS_PER_CLASS]):
            clips = [clip for clip in free if clip.actor == actor]
            chosen.append(clips[int(rng.integers(len(clips)))])
    return chosen


def measure(recordings: Recordings) -> Results:
    """Every try in every world."""
    queries = choose_queries(recordings)
    worlds = worlds_of(recordings, queries, RIGHT)
    tries: list[dict[str, Any]] = []
    for changes in TRIES:
        expansion = replace(BEFORE, **changes)  # type: ignore[arg-type]
        scores = {name: mean(score_all(world, expansion)) for name, world in worlds.items()}
        values = [value for score in scores.values() for value in score.values()]
        tries.append(
            {"settings": _settings(expansion), "worlds": scores, "mean": float(np.mean(values))}
        )
    best = max(range(len(tries)), key=lambda i: tries[i]["mean"])
    return {
        "tries": tries,
        "best": best,
        "queries": [query.name for query in queries],
        "relevant": [int(query.relevant.sum()) for query in worlds["plenty"]],
    }


def worlds_of(
    recordings: Recordings, queries: Sequence[Clip], right: dict[str, int]
) -> dict[str, list[Query]]:
    """The queries in each world, of which two have so many right recordings."""
    return {"plenty": others_of(recordings.clips, queries)} | {
        name: [
            _thin(recordings, query, i, most=most, far=name == "few and far")
            for i, query in enumerate(queries)
        ]
        for name, most in right.items()
    }


def _thin(
    recordings: Recordings, query: Clip, number: int, *, most: int, far: bool = False
) -> Query:
    """The query in a world where little is right, and its own actor moves too."""
    clips = [
        c
        for c in recordings.clips
        if (c.actor, c.motion_class) != (query.actor, query.motion_class)
    ]
    right = [i for i, clip in enumerate(clips) if clip.motion_class == query.motion_class]
    if far:
        right = _half_of_highest_cost(query, clips, right)
    kept = np.random.default_rng((SEED, number)).permutation(right)[:most].tolist()
    left = [c for i, c in enumerate(clips) if i in kept or c.motion_class != query.motion_class]
    relevant = np.array([clip.motion_class == query.motion_class for clip in left])
    return Query(query.name, query.packed, Pool(tuple(clips_packed(left))), relevant)


def _half_of_highest_cost(query: Clip, clips: Sequence[Clip], right: Sequence[int]) -> list[int]:
    """Of the right clips those that the example as it is finds last."""
    pool = Pool(tuple(clips_packed(clips)))
    plain = Query(query.name, query.packed, pool, np.zeros(len(clips), dtype=np.bool_))
    costs = plain.costs(QueryExpansion(hits=0))
    return sorted(right, key=lambda i: float(costs[i]))[len(right) // 2 :]


def _settings(expansion: QueryExpansion) -> dict[str, Any]:
    return {key: getattr(expansion, key) for key in KEYS} | {
        "by_surprise": expansion.by_self_information,
        "prior": expansion.prior,
    }


def describe(settings: dict[str, Any]) -> str:
    """Settings in a cell."""
    if not settings["hits"]:
        return "as it is"
    reach = "∞" if settings["reach"] is None else fraction(settings["reach"])
    rest = (fraction(settings[key]) for key in ("most_cost", "tolerance"))
    return f"{settings['hits']}, {reach}, {', '.join(rest)}"


def is_default(settings: dict[str, Any]) -> bool:
    """Whether the package expands so."""
    return all(settings[key] == getattr(QueryExpansion(), key) for key in KEYS)


def draw(results: Results) -> dict[str, Any]:
    """Average precision by the number of hits."""
    kept = [
        item
        for item in results["tries"]
        if not item["settings"]["hits"]
        or all(item["settings"][key] == getattr(BEFORE, key) for key in KEYS[1:])
    ]
    kept.sort(key=lambda item: item["settings"]["hits"])
    numbers = [item["settings"]["hits"] for item in kept]
    measures = {"mean average precision": "average_precision", "R-precision": "r_precision"}
    panels = [
        Panel(
            name,
            {
                title: (numbers, [item["worlds"][name][key] for item in kept])
                for title, key in measures.items()
            },
            "most hits to learn from", "", (0.6, 1.0),
        )
        for name in WORLDS
    ]  # fmt: skip
    return {"growing_choice": draw_panels(panels, columns=3, size=(2.4, 1.8))}
