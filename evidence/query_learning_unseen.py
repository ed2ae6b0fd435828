"""How do queries do on people that they were not learned from?"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from evidence.common.ranking import template_of
from evidence.common.recordings import ACTORS, Clip, Recordings
from evidence.query_learning_tasks import (
    Committee,
    Rows,
    Trial,
    compute_all,
    learn_from,
    mean_of,
    split,
)
from motionary.models.keyframes import KeyframeQuery, choose_query
from motionary.models.query_learning import (
    PUBLISHED,
    RUNS,
    GeneticSettings,
    LearnedQueries,
    RunResult,
    combine_runs,
    default_votes,
    learn_runs,
    to_query,
)

#: Runs of the evolution as published, and of random search, for each class and actor.
PUBLISHED_RUNS = 5
USUAL = Committee(RUNS, default_votes(RUNS))
BINS = 20

Chosen = Mapping[str, Committee]
Queries = Mapping[str, KeyframeQuery]


def leave_actors_out(
    recordings: Recordings, chosen: Chosen, manual: Queries, *, seed: int, jobs: int
) -> Rows:
    """Each class and actor: queries of the other four, with the committee chosen for it."""
    one = partial(_leave_one_out, clips=recordings.clips, chosen=chosen, manual=manual, seed=seed)
    todo = [(name, actor) for actor in ACTORS for name in recordings.classes]
    return compute_all(one, todo, jobs=jobs)


def _leave_one_out(
    todo: tuple[str, str],
    *,
    clips: Sequence[Clip],
    chosen: Chosen,
    manual: Queries,
    seed: int,
) -> dict[str, Any]:
    name, actor = todo
    committee = chosen[actor]
    examples = split(clips, name, set(ACTORS) - {actor})
    unseen = split(clips, name, [actor])
    template = template_of(examples.positives)
    trial = Trial(template, unseen)
    single = partial(trial.measure, votes=1)
    plain = learn_from(examples, PUBLISHED, PUBLISHED_RUNS, seed=seed)
    runs = max(USUAL.queries, committee.queries)
    bred = learn_from(examples, GeneticSettings(), runs, seed=seed)
    by_chance = learn_runs(plain.problem, range(PUBLISHED_RUNS), random_search=True)
    picked = choose_query(template, examples.positives, examples.negatives).query
    return {
        "class": name,
        "unseen": actor,
        "clips": len(unseen.positives),
        "committee": str(committee),
        "ways": {
            "random": mean_of([single([_query(plain, run)]) for run in by_chance]),
            "published": mean_of([single([query]) for query in plain.queries]),
            "combined": single([_query(plain, combine_runs(plain))]),
            "one run": mean_of([single([query]) for query in bred.queries]),
            "usual": trial.ask(bred.queries, USUAL),
            "committee": trial.ask(bred.queries, committee),
            "picked": single([picked]),
            "manual": single([manual[name]]),
        },
        "entries": {
            name: float(np.mean([run.best.n_fixed for run in learned.runs]))
            for name, learned in (("published", plain), ("simplified", bred))
        },
        "stiffness": {"published": _histogram(plain), "simplified": _histogram(bred)},
    }


def _query(learned: LearnedQueries, run: RunResult) -> KeyframeQuery:
    features = learned.problem.feature_set
    return to_query(run.best, features.name, features.ids)


def _histogram(learned: LearnedQueries) -> list[int]:
    """Stiffness of all gaps, in bins from 0 to 1 (Baak 2012, Fig. 4.4)."""
    values = [spring.stiffness for query in learned.queries for spring in query.springs]
    counts: list[int] = np.histogram(values, bins=BINS, range=(0.0, 1.0))[0].tolist()
    return counts
