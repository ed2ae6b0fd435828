"""Retrieval by the number of examples, and by the number of people who show them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.ranking import (
    SETTINGS,
    TAU,
    Draw,
    clip_costs,
    corpus_of,
    from_half,
    from_one,
    from_others,
    mean_f,
    patterns_by_setting,
    spread,
    summarize,
)
from evidence.common.recordings import Recordings, Results, clips_packed

POOLS = {
    "same people": "of the training half, tested on the evaluation half: the same five people",
    "new person": "of four actors, tested on the fifth",
    "one teacher": "of one actor alone, tested on the other four",
}

TITLE = "How many examples, and of how many people"
SPLIT = "; ".join(f"{name}: {text}" for name, text in POOLS.items())
SEED = 1
DATA = ("clips",)

SIZES = (1, 2, 3, 5, 9)
MEASURES = {
    "mean_average_precision": "mAP",
    "precision": "precision",
    "recall": "recall",
    "right_class": "right class",
}
TRIED = tuple(round(0.01 * step, 2) for step in range(1, 41))


def measure(recordings: Recordings) -> Results:
    """Every pool, size and setting."""
    results: Results = {pool: {setting: {} for setting in SETTINGS} for pool in POOLS}
    for size in SIZES:
        for pool, draws in _draws(recordings, size).items():
            scores = [_score(draw) for draw in draws]
            for setting in SETTINGS:
                rows = [score[setting] for score in scores]
                spreads = {key: spread([row[key] for row in rows]) for key in MEASURES}
                results[pool][setting][str(size)] = spreads | _best(rows)
    return results


def _draws(recordings: Recordings, size: int) -> dict[str, list[Draw]]:
    draws = {
        "same people": from_half(recordings, size, repeats=8, seed=SEED),
        "new person": from_others(recordings, size, repeats=2, seed=SEED),
    }
    # One actor shows most classes two to six times: nine would be the same as five.
    if size <= 5:
        draws["one teacher"] = from_one(recordings, size, repeats=2, seed=SEED)
    return draws


def _score(draw: Draw) -> dict[str, dict[str, Any]]:
    corpus = corpus_of(clips_packed(draw.test))
    truth = [clip.motion_class for clip in draw.test]
    result = {}
    for setting, patterns in patterns_by_setting(draw.train).items():
        costs = clip_costs(patterns, corpus)
        result[setting] = summarize(costs, truth, list(patterns))
        result[setting]["f"] = mean_f(costs, truth, list(patterns), thresholds=TRIED)
    return result


def _best(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The threshold that would have been best, and F there and at the usual one."""
    mean = np.mean([row["f"] for row in rows], axis=0)
    best = int(mean.argmax())
    return {"best_threshold": TRIED[best], "best_f": mean[best], "usual_f": mean[TRIED.index(TAU)]}


def draw(results: Results) -> dict[str, Any]:
    """Curves with their spread, by self-information; measures side by side."""
    panels = []
    for key, name in MEASURES.items():
        curves = {}
        for pool in POOLS:
            cells = [cell[key] for cell in results[pool]["by surprise"].values()]
            mean, off = np.array([(cell["mean"], cell["deviation"]) for cell in cells]).T
            curves[pool] = (SIZES[: len(mean)], mean, mean - off, np.minimum(mean + off, 1.0))
        low = 0.0 if key in ("precision", "recall") else 0.7
        panels.append(Panel(name, curves, "examples per class", "", (low, 1.01)))
    return {"learning_curve": draw_panels(panels, columns=4, size=(2.2, 2.2))}
