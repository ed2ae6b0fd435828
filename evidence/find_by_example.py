"""What one example finds, among classes and across styles."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.baselines import position_frames
from evidence.common.drawing import Panel, draw_panels
from evidence.common.examples import (
    Parts,
    Pool,
    Query,
    at_tempo,
    chance,
    mean,
    others_of,
    part_costs,
    position_costs_of,
    rows_of,
    score,
    score_feedback,
)
from evidence.common.recordings import Recordings, Results
from evidence.common.running import timed
from evidence.growing_choice import choose_queries
from motionary.features import FeatureSequence
from motionary.retrieval.search import QueryExpansion

TITLE = "Found by one example"
SPLIT = (
    "HDM05: an example is searched for among the clips of the other actors; Bandai Namco: among "
    "all other files; settings chosen on other clips of HDM05"
)
SEED = 2
DATA = ("clips", "bandai")

Floats = NDArray[np.float64]

JUDGED = 10
AS_IT_IS = QueryExpansion(hits=0, by_self_information=False)
WEIGHED = QueryExpansion(hits=0)
WAYS = {
    "chance": "recordings in random order",
    "positions": "joint positions, root, heading and size normalised, subsequence DTW",
    "as it is": "the example's features, all alike",
    "by surprise": "the same, what is rare weighs more",
    "grown": "template learned from the nearest hits too, by self-information (`--published`)",
    "parts": "the example in parts, each at three tempos, by self-information",
}
TRIED_PARTS = tuple(
    Parts(width, tempos) for width in (15, 30, 60) for tempos in ((1.0,), (0.6, 1.0, 1.6))
)
#: How much faster or slower recordings are made to choose parts for what style changes.
CHANGE = 2.5
NAMES = {"hdm05": "HDM05", "bandai": "Bandai Namco"}


def measure(recordings: Recordings) -> Results:
    """Parts are chosen on other clips; then everything is measured once."""
    tries = _try_parts(recordings)
    chosen = TRIED_PARTS[max(range(len(tries)), key=lambda i: float(tries[i]["mean"]))]
    stems = recordings.golden("example_queries.json")
    by_stem = {Path(clip.name).stem: clip for clip in recordings.clips}
    clips = others_of(recordings.clips, [by_stem[stem] for stem in stems])
    names = {id(clip.packed): clip.name for clip in recordings.clips}
    files = {n: w for n, w in recordings.others.items() if n.startswith("bandai/")}
    names |= {id(packed): name for name, packed in files.items()}
    frames = {key: position_frames(recordings.motion(name)) for key, name in names.items()}
    sets = {
        "hdm05": clips,
        "bandai": _contents(files, lambda _query, _file: True),
        "styles": _contents(files, lambda query, file: style_of(query) != style_of(file)),
    }
    return {
        "parts": {"tries": tries, "chosen": chosen._asdict()},
        "sets": {name: _measure_set(queries, frames, chosen) for name, queries in sets.items()},
        "judged": {
            name: score_feedback(sets[name], {"after": QueryExpansion()}, n_hits=JUDGED)
            for name in ("hdm05", "bandai")
        },
    }


def _contents(
    files: Mapping[str, FeatureSequence], is_searched: Callable[[str, str], bool]
) -> list[Query]:
    """Files of the first data set with at least two others of their content."""
    counts = [content_of(name) for name in files if "dataset-2" not in name]
    queries = []
    for name, packed in files.items():
        if "dataset-2" in name or counts.count(content_of(name)) < 3:
            continue
        pool = [other for other in files if other != name and is_searched(name, other)]
        relevant = np.array([content_of(other) == content_of(name) for other in pool])
        searched = Pool(tuple(files[other] for other in pool))
        queries.append(Query(Path(name).stem, packed, searched, relevant))
    return queries


def content_of(name: str) -> str:
    return Path(name).stem.removeprefix("dataset-2_").rsplit("_", 2)[0]


def style_of(name: str) -> str:
    return Path(name).stem.rsplit("_", 2)[1]


def _try_parts(recordings: Recordings) -> list[dict[str, Any]]:
    """Parts on clips that are not reported, as recorded and with their tempo changed."""
    queries = others_of(recordings.clips, choose_queries(recordings))
    rng = np.random.default_rng(SEED)
    rates = np.exp(rng.uniform(-np.log(CHANGE), np.log(CHANGE), len(recordings.clips)))
    slowed = {
        id(clip.packed): at_tempo(clip.packed, float(rate))
        for clip, rate in zip(recordings.clips, rates, strict=True)
    }
    pools: dict[int, Pool] = {}
    changed = []
    for query in queries:
        key = id(query.pool)
        if key not in pools:
            pools[key] = Pool(tuple(slowed[id(packed)] for packed in query.pool.sequences))
        changed.append(Query(query.name, query.example, pools[key], query.relevant))
    tries = []
    for parts in TRIED_PARTS:
        scores = {
            "as recorded": mean([_score_parts(query, parts) for query in queries]),
            "tempo changed": mean([_score_parts(query, parts) for query in changed]),
        }
        values = [value for pair in scores.values() for value in pair.values()]
        tries.append(parts._asdict() | {"worlds": scores, "mean": float(np.mean(values))})
    return tries


def _score_parts(query: Query, parts: Parts) -> tuple[float, float]:
    prior = query.pool.collection.feature_prior
    return score(part_costs(query.example, query.pool.corpus, prior, parts), query.relevant)


def _measure_set(
    queries: Sequence[Query], frames: Mapping[int, Floats], parts: Parts
) -> dict[str, Any]:
    """Every way on every query."""
    scores: dict[str, list[tuple[float, float]]] = {way: [] for way in WAYS}
    seconds: dict[str, list[float]] = {way: [] for way in WAYS}
    for i, query in enumerate(queries):
        scores["chance"].append(chance(query.relevant, seed=SEED + i))
        for way, call in _ways(query, frames, parts).items():
            costs, taken = timed(call)
            scores[way].append(score(costs, query.relevant))
            seconds[way].append(taken)
    return {
        "ways": {
            way: mean(both) | {"seconds": float(np.median(seconds[way])) if seconds[way] else None}
            for way, both in scores.items()
        },
        "rows": rows_of(queries, scores),
        "searched": int(np.median([len(query.relevant) for query in queries])),
        "minutes": float(np.median([len(query.pool.corpus.packed) for query in queries]) / 30 / 60),
    }


def _ways(
    query: Query, frames: Mapping[int, Floats], parts: Parts
) -> dict[str, Callable[[], Floats]]:
    searched = [frames[id(packed)] for packed in query.pool.sequences]
    prior = query.pool.collection.feature_prior
    corpus = query.pool.corpus
    return {
        "positions": lambda: position_costs_of(frames[id(query.example)], searched),
        "as it is": lambda: query.costs(AS_IT_IS),
        "by surprise": lambda: query.costs(WEIGHED),
        "grown": lambda: query.costs(QueryExpansion()),
        "parts": lambda: part_costs(query.example, corpus, prior, parts),
    }


def from_best(ways: Mapping[str, Any]) -> list[str]:
    """Ways from the best to the worst."""
    compared = ("positions", "as it is", "grown", "parts")
    return sorted(compared, key=lambda way: -float(ways[way]["average_precision"]))


def draw(results: Results) -> dict[str, Any]:
    """Average precision of each query, sorted within each way."""
    panels = []
    for name in ("hdm05", "bandai"):
        rows = results["sets"][name]["rows"]
        curves = {}
        for way in ("grown", "positions", "as it is", "parts"):
            values = sorted((float(row[way][0]) for row in rows), reverse=True)
            curves[way] = (list(range(1, len(rows) + 1)), values)
        panels.append(Panel(NAMES[name], curves, "query", "average precision", (0, 1.04)))
    return {"find_by_example": draw_panels(panels, columns=2, size=(3.4, 2.2))}
