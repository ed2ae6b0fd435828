"""Weight of irrelevant hits in relevance feedback, chosen apart from what is reported."""

from dataclasses import replace
from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.examples import score_feedback
from evidence.common.recordings import Recordings, Results
from evidence.growing_choice import DATA, SEED, SPLIT, choose_queries, worlds_of
from motionary.retrieval.search import QueryExpansion

__all__ = ["DATA", "SEED", "SPLIT", "TITLE"]

TITLE = "How much an irrelevant hit weighs"

#: How much irrelevant hits weigh; by a negative number nothing.
PRIORS = {"right ones alone": -1.0, "3": 3.0, "10": 10.0, "30": 30.0}
JUDGED = 10
RIGHT = {"few": 8, "few and far": 4}


def measure(recordings: Recordings) -> Results:
    """Every prior in every world."""
    settings = {name: replace(QueryExpansion(), prior=prior) for name, prior in PRIORS.items()}
    worlds = worlds_of(recordings, choose_queries(recordings), RIGHT)
    return {name: score_feedback(world, settings, n_hits=JUDGED) for name, world in worlds.items()}


def mean_of(results: Results, part: str, name: str) -> float:
    """Mean of both measures over the worlds."""
    return float(np.mean([list(world[part][name].values()) for world in results.values()]))


def best_prior(results: Results) -> str:
    """The one with the best mean."""
    return max(PRIORS, key=lambda name: mean_of(results, "all", name))


def is_default(name: str) -> bool:
    """Whether the package takes it."""
    return PRIORS[name] == QueryExpansion().prior


def draw(results: Results) -> dict[str, Any]:
    """Average precision by the prior."""
    numbers = [name for name, prior in PRIORS.items() if prior > 0]
    curves = {
        "relevant and irrelevant ones": numbers,
        "relevant ones alone": ["right ones alone"] * len(numbers),
        "before": ["before"] * len(numbers),
    }
    priors = [PRIORS[name] for name in numbers]
    panels = [
        Panel(
            name,
            {
                what: (priors, [world["all"][key]["average_precision"] for key in chosen])
                for what, chosen in curves.items()
            },
            "frames at large", "mean average precision", (0.7, 1.01),
        )
        for name, world in results.items()
    ]  # fmt: skip
    return {"judging_choice": draw_panels(panels, columns=3, size=(2.4, 1.8))}
