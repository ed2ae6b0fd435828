"""The population by generation, on the examples and on other people.

Thesis, Fig. 4.3: learned from three actors as published, verified on two; beside random
search with as many evaluations.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.queries import lesson_of, problem_of
from evidence.common.recordings import ACTORS, Clip, Recordings, Results
from evidence.common.running import compute_all
from motionary.models.query_learning import PUBLISHED, clip_evaluator, learn_runs

TITLE = "The population of queries by generation, beside figure 4.3 of the thesis"
SPLIT = "the clips of bd, bk and dg train, those of mm and tr verify"
SEED = 0
DATA = ("clips",)

RUNS = 30
FIRST_THREE, LAST_TWO = ACTORS[:3], ACTORS[3:]
MEASURES = ("fitness", "precision", "recall")
CLIPS = ("examples", "verification")


def measure(recordings: Recordings) -> Results:
    """Population by generation, two ways, means over runs and classes."""
    rows = compute_all(partial(_follow, clips=recordings.clips), recordings.classes)
    result: Results = {}
    for way in rows[0]:
        columns = {key: [row[way][key] for row in rows] for key in rows[0][way]}
        result[way] = {clips: np.mean(columns[clips], axis=0) for clips in CLIPS}
        result[way]["best"] = {
            clips: {
                "mean": float(np.mean(columns[f"best, {clips}"])),
                "spread": float(np.mean(np.std(columns[f"best, {clips}"], axis=1))),
            }
            for clips in CLIPS
        }
    return result


def _follow(name: str, *, clips: Sequence[Clip]) -> dict[str, Any]:
    """Mean and spread of fitness, precision and recall by generation, on both sets of clips."""
    problem = problem_of(lesson_of(clips, name, FIRST_THREE), PUBLISHED, seed=SEED)
    unseen = lesson_of(clips, name, LAST_TWO)
    verification = clip_evaluator(unseen.examples, unseen.counterexamples, settings=PUBLISHED)
    result = {}
    for way, by_chance in (("published", False), ("random", True)):
        runs = list(
            learn_runs(problem, range(RUNS), random_search=by_chance, verification=verification)
        )
        result[way] = {
            "examples": np.mean([run.history for run in runs], axis=0),
            "verification": np.mean([run.verified for run in runs], axis=0),
            "best, examples": [run.score.fitness for run in runs],
            "best, verification": [verification(run.best).fitness for run in runs],
        }
    return result


def draw(results: Results) -> dict[str, Any]:
    """Like Fig. 4.3 of the thesis."""
    ways = {"genetic algorithm": "published", "random search": "random"}
    panels = []
    for clips in CLIPS:
        for k, measured in enumerate(MEASURES):
            curves = {name: _curve(results[way][clips], k) for name, way in ways.items()}
            panels.append(Panel(f"{measured}, {clips}", curves, "generation", "", (0.3, 1.02)))

    def without_markers(axes: Any, index: int) -> None:
        for line in axes.get_lines():
            line.set_marker("")

    figure = draw_panels(panels, columns=3, decorate=without_markers)
    return {"query_learning_generations": figure}


def _curve(measured: Sequence[Any], k: int) -> tuple[Any, ...]:
    mean, spread = np.array(measured)[:, k].T
    return np.arange(1, len(mean) + 1), mean, mean - spread, np.minimum(mean + spread, 1.0)
