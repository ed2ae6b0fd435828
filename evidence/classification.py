"""Which class is a clip? Two ways of asking the same templates."""

from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.draws import Draw, from_half, from_others, spread
from evidence.common.pages import claim, fraction, picture, table
from evidence.common.ranking import (
    TOLERANCE_2006,
    background_of,
    clip_costs,
    corpus_of,
    patterns_of,
    templates_of,
)
from evidence.common.recordings import ACTORS, HDM05, Recordings, data_entry
from evidence.common.running import Evidence, Results, main
from evidence.common.whole import whole_costs
from motionary.evaluation import score_classification
from motionary.models.library import TOLERANCE

SEED = 2
SIZES = (1, 2, 3, 5, 7, 9)
WAYS = ("smallest distance", "whole clip")
SETTINGS = {"as published": (TOLERANCE_2006, False), "by surprise": (TOLERANCE, True)}
#: An earlier prototype, whole clip, one actor left out.
PROTOTYPE = 0.99


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
    templates, ones = templates_of(draw.train), background_of(draw.train)
    clips = [clip.packed for clip in draw.test]
    result = {}
    for setting, (tolerance, by_self_information) in SETTINGS.items():
        patterns = patterns_of(
            templates, tolerance=tolerance, ones=ones if by_self_information else None
        )
        result[f"{WAYS[0]}, {setting}"] = clip_costs(patterns, corpus_of(clips))
        result[f"{WAYS[1]}, {setting}"] = whole_costs(patterns, clips)
    return result


def write(results: Results) -> str:
    """Body of the page."""
    keys = list(results["few"]["new person"])
    full = [
        [key, *(fraction(results["all"][split][key]["accuracy"], 3) for split in results["all"])]
        for key in keys
    ]
    curves = [
        [pool, key, *(_cell(cells[str(size)]) for size in SIZES)]
        for pool, by_key in results["few"].items()
        for key, cells in by_key.items()
    ]
    return f"""
A clip gets the class whose template costs least.

- *Smallest distance*: the smallest value of the class's distance function within the clip, as
  in retrieval. A clip shorter than half a template has none.
- *Whole clip*: classical DTW with boundary conditions. The first column meets the first frame,
  the last column the last; steps (1,0), (0,1), (1,1); the cost of a cell is the same masked one;
  the sum is divided by columns plus frames.

## All examples of a split

{table(["", *results["all"]], full)}
{_findings(results)}

{_wrong(results)}

## One to nine examples

{
        picture(
            "classification",
            "Share of clips that get the right class by the number of examples "
            "per class; left the same people, right a person never seen",
        )
    }
Mean ± standard deviation over seeded draws; with a new person each actor is tested in turn.

{table(["examples come from", "", *(str(size) for size in SIZES)], curves)}
{_few_findings(results)}
"""


def _cell(cell: dict[str, float]) -> str:
    return f"{fraction(cell['mean'])} ± {fraction(cell['deviation'])}"


def _findings(results: Results) -> str:
    split = results["all"]["one actor left out"]
    whole, within = (split[f"{way}, as published"]["accuracy"] for way in WAYS[::-1])
    return claim(
        whole >= within,
        "Where the clip is known to be one motion, comparing it as a whole is better: with one "
        f"actor left out {fraction(whole, 3)} against {fraction(within, 3)} (an earlier prototype of "
        f"the whole clip: {fraction(PROTOTYPE)}). It uses what the smallest distance ignores: that "
        "nothing else happens in the clip. Weights by surprise are made for telling a motion "
        "from other motion; here, where every clip is one of the classes, they gain nothing.",
    )


def _wrong(results: Results) -> str:
    lines = []
    for key, cells in results["all"]["one actor left out"].items():
        told = ", ".join(
            f"{item['clip'].split('/')[1].removeprefix('HDM_').removesuffix('_120.amc')} → "
            f"{item['taken_for']}"
            for item in cells["wrong"]
        )
        lines.append(f"- {key}: {told or 'none'}")
    return "Wrong, one actor left out:\n\n" + "\n".join(lines)


def _few_findings(results: Results) -> str:
    few = results["few"]["new person"]
    whole, within = few[f"{WAYS[1]}, as published"], few[f"{WAYS[0]}, as published"]
    return claim(
        all(whole[size]["mean"] > within[size]["mean"] for size in ("1", "2", "3")),
        "The fewer the examples, the more it gains: on a new person "
        f"{fraction(whole['1']['mean'])} instead of {fraction(within['1']['mean'])} from one example, "
        f"{fraction(whole['3']['mean'])} instead of {fraction(within['3']['mean'])} from three, "
        f"{fraction(whole['9']['mean'])} and {fraction(within['9']['mean'])} from nine.",
    )


def draw(results: Results) -> dict[str, Any]:
    """Accuracy over the number of examples."""
    panels = []
    for pool, by_key in results["few"].items():
        curves = {}
        for key, cells in by_key.items():
            means = [cells[str(size)]["mean"] for size in SIZES]
            curves[key] = (list(SIZES), means)
        panels.append(Panel(pool, curves, "examples per class", "right class", (0.7, 1.01)))
    return {"classification": draw_panels(panels, columns=2, size=(4.2, 2.4))}


def describe_data(recordings: Recordings) -> list[dict[str, Any]]:
    """Entries of the record."""
    return [data_entry(HDM05, [clip.packed for clip in recordings.clips])]


EVIDENCE = Evidence(
    name="classification",
    title="Naming a clip: smallest distance or the whole clip",
    split="the authors' halves; each actor left out in turn; one to nine clips drawn from either",
    seed=SEED,
    describe_data=describe_data,
    measure=measure,
    write=write,
    draw=draw,
)

if __name__ == "__main__":
    main(EVIDENCE)
