"""Learned keyframe queries on people that they were not learned from.

Baak (2012), chapter 4. Committees are those of the record `query_learning_choice`.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from evidence.common.drawing import BLUE, VERMILLION, house_style, new_figure
from evidence.common.pages import means
from evidence.common.queries import (
    RETRIEVAL_2008,
    Committee,
    Tested,
    Trial,
    by_choosing,
    learn_from,
    lesson_of,
    manual,
)
from evidence.common.recordings import ACTORS, Clip, Recordings, Results
from evidence.common.running import compute_all, read_record
from evidence.query_learning_choice import Rows, Size
from motionary.models.keyframes import KeyframeQuery
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

TITLE = "Queries that are learned, and people never seen"
SPLIT = "each actor in turn is unseen, the committee is chosen among the other four"
SEED = 0
DATA = ("clips",)

#: Runs of the genetic algorithm as published, and of random search, for each class and actor.
PUBLISHED_RUNS = 5
USUAL = Size(RUNS, default_votes(RUNS))
BINS = 20
STIFF = 0.8

GROUPS = {"mm, tr": ("mm", "tr"), "bd, bk, dg": ("bd", "bk", "dg"), "all five": ACTORS}


def measure(recordings: Recordings) -> Results:
    """Each actor in turn is unseen: queries of the other four, and the committee for the actor."""
    chosen = read_record("query_learning_choice")["results"]["chosen"]
    one = partial(
        _leave_one_out,
        clips=recordings.clips,
        sizes={actor: Size(**size) for actor, size in chosen.items()},
        by_hand=manual(recordings, RETRIEVAL_2008),
    )
    todo = [(name, actor) for actor in ACTORS for name in recordings.classes]
    return {"left_out": compute_all(one, todo)}


def _leave_one_out(
    todo: tuple[str, str],
    *,
    clips: Sequence[Clip],
    sizes: Mapping[str, Size],
    by_hand: Mapping[str, KeyframeQuery],
) -> dict[str, Any]:
    name, actor = todo
    size = sizes[actor]
    lesson = lesson_of(clips, name, set(ACTORS) - {actor})
    tested = Tested.of([clip for clip in clips if clip.actor == actor])
    trial = Trial(name, lesson.template, tested)
    plain = learn_from(lesson, PUBLISHED, PUBLISHED_RUNS, seed=SEED)
    learned = learn_from(lesson, GeneticSettings(), max(USUAL.queries, size.queries), seed=SEED)
    random = learn_runs(plain.problem, range(PUBLISHED_RUNS), random_search=True)

    def single(query: KeyframeQuery) -> dict[str, float]:
        return trial.measure(Committee((query,)))

    return {
        "class": name,
        "unseen": actor,
        "clips": int(tested.relevant(name).sum()),
        "committee": str(size),
        "ways": {
            "random": means(single(_query(plain, run)) for run in random),
            "published": means(map(single, plain.queries)),
            "combined": single(_query(plain, combine_runs(plain))),
            "one run": means(map(single, learned.queries)),
            "usual": trial.measure(USUAL.of(learned.queries)),
            "committee": trial.measure(size.of(learned.queries)),
            "picked": trial.measure(by_choosing(lesson)),
            "manual": single(by_hand[name]),
        },
        "entries": {
            "published": float(np.mean([run.best.n_fixed for run in plain.runs])),
            "simplified": float(np.mean([run.best.n_fixed for run in learned.runs])),
        },
        "stiffness": {"published": _histogram(plain), "simplified": _histogram(learned)},
    }


def _query(learned: LearnedQueries, run: RunResult) -> KeyframeQuery:
    features = learned.problem.feature_set
    return to_query(run.best, features.name, features.ids)


def _histogram(learned: LearnedQueries) -> list[int]:
    """Stiffness of all gaps, in bins from 0 to 1 (Baak 2012, Fig. 4.4)."""
    values = [spring.stiffness for query in learned.queries for spring in query.springs]
    counts: list[int] = np.histogram(values, bins=BINS, range=(0.0, 1.0))[0].tolist()
    return counts


def head(key: str) -> str:
    """Name of a measure as the head of a column."""
    return key.upper() if key in ("f1", "f2") else key


def of_actors(rows: Rows, actors: Sequence[str]) -> Rows:
    """Rows of some unseen actors."""
    return [row for row in rows if row["unseen"] in actors]


def mean_of_way(rows: Rows, way: str, key: str) -> float:
    """Mean of a measure."""
    return float(np.mean([row["ways"][way][key] for row in rows]))


def committees_of(rows: Rows) -> list[str]:
    """Committee of each actor."""
    return sorted({f"{row['unseen']}: {row['committee']}" for row in rows})


def fraction_at_most(rows: Rows, name: str) -> float:
    """Fraction of gaps that are no stiffer than `STIFF`."""
    counts = _counts(rows, name)
    return float(counts[: round(STIFF * BINS)].sum() / counts.sum())


def _counts(rows: Rows, name: str) -> Any:
    return np.sum([row["stiffness"][name] for row in rows], axis=0)


@house_style()
def draw(results: Results) -> dict[str, Any]:
    """Like Fig. 4.4 of the thesis."""
    figure, both = new_figure(1, 2, (7.6, 2.3))
    for axes, name, colour in zip(
        both, ("published", "simplified"), (BLUE, VERMILLION), strict=True
    ):
        counts = _counts(results["left_out"], name)
        axes.bar((np.arange(BINS) + 0.5) / BINS, counts, 0.85 / BINS, color=colour)
        axes.axvline(STIFF, color="black", linewidth=0.8, linestyle=(0, (4, 2)))
        axes.set_title(f"{name} ({counts.sum()} gaps)", loc="left", pad=3)
        axes.set(xlabel="stiffness", ylabel="gaps", xlim=(0, 1))
    return {"query_learning_stiffness": figure}
