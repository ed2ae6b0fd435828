"""How do queries do on people that they were not learned from?"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from evidence.common.ranking import template_of
from evidence.common.recordings import ACTORS, Clip, Recordings
from evidence.query_learning_choice import breeding_of
from evidence.query_learning_tasks import (
    Committee,
    Measures,
    Split,
    Task,
    Trial,
    mean_of,
    problem_of,
    split,
    tasks,
)
from motionary.batch import Failure, map_ordered
from motionary.keyframes import KeyframeQuery, choose_query
from motionary.query_learning import (
    PUBLISHED,
    RUNS,
    Breeding,
    Evolved,
    LearnedQueries,
    breed_runs,
    combine_runs,
    default_votes,
    judge_clips,
)
from motionary.query_learning.individuals import to_query

#: Runs of the evolution as published, and of random search, for each class and actor.
PUBLISHED_RUNS = 5
GENERATION_RUNS = 30
FIRST_THREE, LAST_TWO = ACTORS[:3], ACTORS[3:]
USUAL = Committee(RUNS, default_votes(RUNS))
BINS = 20

Rows = list[dict[str, Any]]
Settings = dict[str, dict[str, int]]


def leave_actors_out(
    recordings: Recordings,
    chosen: Settings,
    manual: dict[str, KeyframeQuery],
    *,
    seed: int,
    jobs: int,
) -> Rows:
    """Each class and actor: queries of the other four, with the settings chosen for it."""
    one = partial(_leave_one_out, clips=recordings.clips, chosen=chosen, manual=manual, seed=seed)
    return _all(one, tasks(recordings.classes, n_learn=len(ACTORS) - 1), jobs)


def follow_generations(recordings: Recordings, *, seed: int, jobs: int) -> dict[str, Any]:
    """Learned from three actors, verified on two: population by generation, two ways."""
    follow = partial(_follow, clips=recordings.clips, seed=seed)
    rows = _all(follow, recordings.classes, jobs)
    result: dict[str, Any] = {}
    for way in rows[0]:
        tables = {clips: [row[way][clips] for row in rows] for clips in rows[0][way]}
        result[way] = {
            "examples": np.mean(tables["examples"], axis=0),
            "verification": np.mean(tables["verification"], axis=0),
            "best": {
                clips: {
                    "mean": float(np.mean(tables[f"best, {clips}"])),
                    "spread": float(np.mean(np.std(tables[f"best, {clips}"], axis=1))),
                }
                for clips in ("examples", "verification")
            },
        }
    return result


def _leave_one_out(
    task: Task,
    *,
    clips: Sequence[Clip],
    chosen: Settings,
    manual: dict[str, KeyframeQuery],
    seed: int,
) -> dict[str, Any]:
    examples = split(clips, task.name, task.learn)
    unseen = split(clips, task.name, [task.unseen])
    setting = chosen[task.unseen]
    committee = Committee(setting["queries"], setting["votes"])
    template = template_of(examples.positives)
    trial = Trial(template, unseen)
    single = partial(trial.measure, votes=1)

    def many(queries: Sequence[KeyframeQuery], committee: Committee) -> Measures:
        return trial.measure(queries[: committee.queries], votes=committee.votes)

    plain = _learn(examples, PUBLISHED, PUBLISHED_RUNS, seed=seed)
    usual = _learn(examples, breeding_of(0), max(USUAL.queries, committee.queries), seed=seed)
    best = (
        usual
        if setting["copies"] == 0
        else _learn(examples, breeding_of(setting["copies"]), committee.queries, seed=seed)
    )
    by_chance = breed_runs(plain.problem, range(PUBLISHED_RUNS), by_chance=True)
    picked = choose_query(template, examples.positives, examples.negatives).query
    return {
        "class": task.name,
        "unseen": task.unseen,
        "clips": len(unseen.positives),
        "setting": setting,
        "ways": {
            "random": mean_of([single([_query(plain, run)]) for run in by_chance]),
            "published": mean_of([single([query]) for query in plain.queries]),
            "combined": single([_query(plain, combine_runs(plain))]),
            "one run": mean_of([single([query]) for query in best.queries]),
            "committee": many(best.queries, committee),
            "usual": many(usual.queries, USUAL),
            "picked": single([picked]),
            "manual": single([manual[task.name]]),
        },
        "entries": {
            name: float(np.mean([run.best.n_fixed for run in learned.runs]))
            for name, learned in (("published", plain), ("simplified", best))
        },
        "stiffness": {"published": _histogram(plain), "simplified": _histogram(best)},
    }


def _learn(examples: Split, breeding: Breeding, runs: int, *, seed: int) -> LearnedQueries:
    problem = problem_of(examples, breeding, seed=seed)
    return LearnedQueries(problem, tuple(breed_runs(problem, range(runs))), votes=1)


def _query(learned: LearnedQueries, run: Evolved) -> KeyframeQuery:
    features = learned.problem.feature_set
    return to_query(run.best, features.name, features.ids)


def _histogram(learned: LearnedQueries) -> list[int]:
    """Stiffness of all gaps, in bins from 0 to 1 (Baak 2012, Fig. 4.4)."""
    values = [spring.stiffness for query in learned.queries for spring in query.springs]
    counts: list[int] = np.histogram(values, bins=BINS, range=(0.0, 1.0))[0].tolist()
    return counts


def _follow(name: str, *, clips: Sequence[Clip], seed: int) -> dict[str, Any]:
    """Mean and spread of fitness, precision and recall by generation, on both sets of clips."""
    problem = problem_of(split(clips, name, FIRST_THREE), PUBLISHED, seed=seed)
    unseen = split(clips, name, LAST_TWO)
    verification = judge_clips(unseen.positives, unseen.negatives, breeding=PUBLISHED)
    result = {}
    for way, by_chance in (("published", False), ("random", True)):
        runs = list(
            breed_runs(
                problem, range(GENERATION_RUNS), by_chance=by_chance, verification=verification
            )
        )
        result[way] = {
            "examples": np.mean([run.history for run in runs], axis=0),
            "verification": np.mean([run.verified for run in runs], axis=0),
            "best, examples": [run.score.fitness for run in runs],
            "best, verification": [verification(run.best).fitness for run in runs],
        }
    return result


def _all(function: Callable[[Any], Any], items: Sequence[Any], jobs: int) -> Rows:
    results = []
    for result in map_ordered(function, items, jobs=jobs):
        if isinstance(result, Failure):
            raise result.error
        results.append(result)
    return results
