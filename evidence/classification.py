"""Classes of clips by the same templates, asked in two ways."""

from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.ranking import (
    Draw,
    clip_costs,
    corpus_of,
    from_half,
    from_others,
    patterns_by_setting,
    spread,
    whole_costs,
)
from evidence.common.recordings import ACTORS, Recordings, Results, clips_packed
from motionary.evaluation import score_classification

TITLE = "Naming a clip: smallest distance or the whole clip"
SPLIT = "the authors' halves; each actor left out in turn; one to nine clips drawn from either"
SEED = 2
DATA = ("clips",)

SIZES = (1, 2, 3, 5, 7, 9)


def measure(recordings: Recordings) -> Results:
    """All clips of a split, and few."""
    train, test = recordings.halves()
    left_out = [
        Draw(recordings.of(actors=set(ACTORS) - {actor}), recordings.of(actors=[actor]))
        for actor in ACTORS
    ]
    return {
        "all": {
            "the authors' halves": _whole_split([Draw(train, test)]),
            "one actor left out": _whole_split(left_out),
        },
        "few": {
            "same people": _few(recordings, from_half, repeats=4),
            "new person": _few(recordings, from_others, repeats=1),
        },
    }


def _whole_split(draws: list[Draw]) -> Results:
    """Accuracy over all tested clips, and which clips went wrong."""
    truth = [clip for draw in draws for clip in draw.test]
    names = sorted({clip.motion_class for clip in truth})
    parts = [_costs(draw) for draw in draws]
    result: Results = {}
    for key in parts[0]:
        costs = np.concatenate([part[key] for part in parts])
        chosen = [names[i] for i in costs.argmin(axis=1)]
        result[key] = {
            "accuracy": _accuracy(costs, [clip.motion_class for clip in truth], names),
            "clips": len(truth),
            "wrong": [
                {"clip": clip.name, "taken_for": name}
                for clip, name in zip(truth, chosen, strict=True)
                if name != clip.motion_class
            ],
        }
    return result


def _few(recordings: Recordings, source: Any, *, repeats: int) -> Results:
    result: Results = {}
    for size in SIZES:
        rows: dict[str, list[float]] = {}
        for draw in source(recordings, size, repeats=repeats, seed=SEED):
            truth = [clip.motion_class for clip in draw.test]
            for key, costs in _costs(draw).items():
                rows.setdefault(key, []).append(_accuracy(costs, truth, sorted(set(truth))))
        for key, values in rows.items():
            result.setdefault(key, {})[str(size)] = spread(values)
    return result


def _accuracy(costs: Any, truth: list[str], names: list[str]) -> float:
    return score_classification(costs, truth, names=names).accuracy


def _costs(draw: Draw) -> dict[str, Any]:
    """Costs by way and setting, shape (clips, classes)."""
    clips = clips_packed(draw.test)
    result = {}
    for setting, patterns in patterns_by_setting(draw.train).items():
        result[f"smallest distance, {setting}"] = clip_costs(patterns, corpus_of(clips))
        result[f"whole clip, {setting}"] = whole_costs(patterns, clips)
    return result


def draw(results: Results) -> dict[str, Any]:
    """Accuracy over the number of examples."""
    panels = []
    for pool, by_key in results["few"].items():
        curves = {
            key: (SIZES, [cell["mean"] for cell in cells.values()]) for key, cells in by_key.items()
        }
        panels.append(Panel(pool, curves, "examples per class", "right class", (0.7, 1.01)))
    return {"classification": draw_panels(panels, columns=2, size=(4.2, 2.4))}
