"""How does the population develop by generation, on the examples and on other people?

Thesis, Fig. 4.3: learned from three actors as published, verified on two; beside random
search with as many evaluations.
"""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.pages import fraction, picture, table
from evidence.common.recordings import ACTORS, HDM05, Clip, Recordings, data_entry
from evidence.common.running import JOBS, Evidence, Results, main
from evidence.query_learning_tasks import compute_all, problem_of, split
from motionary.models.query_learning import PUBLISHED, clip_evaluator, learn_runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SEED = 0
RUNS = 30
FIRST_THREE, LAST_TWO = ACTORS[:3], ACTORS[3:]
SHOWN = (1, 10, 20, 40, 60, 80, 100)
MEASURES = ("fitness", "precision", "recall")
CLIPS = ("examples", "verification")
NAME = "query_learning_generations"


def measure(recordings: Recordings) -> Results:
    """Population by generation, two ways, means over runs and classes."""
    follow = partial(_follow, clips=recordings.clips, seed=SEED)
    rows = compute_all(follow, recordings.classes, jobs=JOBS)
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


def _follow(name: str, *, clips: Sequence[Clip], seed: int) -> dict[str, Any]:
    """Mean and spread of fitness, precision and recall by generation, on both sets of clips."""
    problem = problem_of(split(clips, name, FIRST_THREE), PUBLISHED, seed=seed)
    unseen = split(clips, name, LAST_TWO)
    verification = clip_evaluator(unseen.positives, unseen.negatives, settings=PUBLISHED)
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


def write(followed: Results) -> str:
    """Body of the page."""
    body = []
    for generation in SHOWN:
        for way in followed:
            for clips in CLIPS:
                row = followed[way][clips][generation - 1]
                cells = [f"{mean:.2f} ({spread:.2f})" for mean, spread in row]
                body.append([str(generation), way, clips, *cells])
    best = "; ".join(
        f"{way}, {clips} {fraction(one['mean'], 3)} ({fraction(one['spread'], 3)})"
        for way, both in followed.items()
        for clips, one in both["best"].items()
    )
    return f"""Learned from bd, bk, dg as published, verified on mm and tr, {RUNS} runs a class:
mean over the population (and its standard deviation), means over runs and classes; beside
random search with as many evaluations.

{picture(NAME, CAPTION)}
{table(["generation", "way", "clips", *MEASURES], body)}
Fitness of the best of each run (spread over the runs of a class): {best}. What the evolution
gains on the examples over random search, it does not keep on other people."""


CAPTION = (
    "Fitness, precision and recall by generation, mean over the population of all runs and "
    "classes; band: standard deviation within a population (thesis, Fig. 4.3)"
)


def draw(followed: Results) -> "dict[str, Figure]":
    """Like Fig. 4.3 of the thesis."""
    panels = []
    for clips in CLIPS:
        for k, measure in enumerate(MEASURES):
            curves = {
                name: _curve(followed[way][clips], k)
                for way, name in (("published", "evolution"), ("random", "random search"))
            }
            panels.append(
                Panel(f"{measure}, {clips}", curves, x_label="generation", y_limits=(0.3, 1.02))
            )
    return {NAME: draw_panels(panels, columns=3, decorate=_without_markers)}


def _curve(measured: Sequence[Any], k: int) -> tuple[Sequence[float], ...]:
    means = np.array(measured)[:, k, 0]
    spread = np.array(measured)[:, k, 1]
    generations = np.arange(1, len(means) + 1)
    return tuple(
        column.tolist()
        for column in (generations, means, means - spread, np.minimum(means + spread, 1.0))
    )


def _without_markers(axes: "Axes", index: int) -> None:
    for line in axes.get_lines():
        line.set_marker("")


def describe_data(recordings: Recordings) -> list[dict[str, Any]]:
    """Entries of the record."""
    return [data_entry(HDM05, [clip.packed for clip in recordings.clips])]


EVIDENCE = Evidence(
    name=NAME,
    title="The evolution of queries by generation, beside figure 4.3 of the thesis",
    split="bd, bk and dg teach, mm and tr verify",
    seed=SEED,
    describe_data=describe_data,
    measure=measure,
    write=write,
    draw=draw,
)

if __name__ == "__main__":
    main(EVIDENCE)
