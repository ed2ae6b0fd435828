"""Settings that make learned queries hold for actors never seen.

For each actor, the settings are chosen among the other four alone: the clips of each three of
them train, the fourth is unseen. What is chosen for an actor has not seen that actor.
"""

import itertools
from functools import partial
from typing import Any, NamedTuple

from evidence.common.pages import means
from evidence.common.queries import Committee, Tested, Trial, learn_from, lesson_of
from evidence.common.recordings import ACTORS, Clip, Recordings, Results
from evidence.common.running import compute_all
from motionary.models.query_learning import GeneticSettings

TITLE = "How the settings of learned queries were chosen"
SPLIT = "for each actor, three of the other four train and the fourth is unseen"
SEED = 0
DATA = ("clips",)

Rows = list[dict[str, Any]]


class Size(NamedTuple):
    """So many queries, of which so many must agree."""

    queries: int
    votes: int

    def __str__(self) -> str:
        return "{self.votes} of {self.queries}"

    def of(self, queries: tuple[Any, ...]) -> Committee:
        """The committee of the first of these queries."""
        return Committee(queries[: self.queries], self.votes)


#: What is tried.
COMMITTEES = tuple(
    Size(*pair)
    for pair in ((3, 2), (5, 2), (5, 3), (5, 4), (10, 4), (10, 5), (10, 6), (10, 7), (10, 8))
)
RUNS = max(size.queries for size in COMMITTEES)

#: A setting may leave so many frames, and so many wrong clips among those found.
MOST_LEFT, LEAST_PRECISION = 0.15, 0.9
#: Recall lost counts as equal within this; then F2 decides.
EQUAL = 0.01

WITHOUT = {actor: f"without {actor}" for actor in ACTORS} | {"nobody": "with all five actors"}


def measure(recordings: Recordings) -> Results:
    """All tries, and the committee chosen for each actor."""
    todo = [
        (name, trainers)
        for trainers in itertools.combinations(ACTORS, len(ACTORS) - 2)
        for name in recordings.classes
    ]
    tried = [row for rows in compute_all(partial(_try, recordings.clips), todo) for row in rows]
    tables = {actor: _table([r for r in tried if actor not in r["actors"]]) for actor in ACTORS}
    tables["nobody"] = _table(tried)
    return {"tries": tables, "chosen": {actor: best_of(table) for actor, table in tables.items()}}


def best_of(table: Rows) -> dict[str, Any]:
    """Of the settings that lose least recall, the one with the highest F2."""
    fit = [
        row
        for row in table
        if row["frames left"] <= MOST_LEFT and row["precision left"] >= LEAST_PRECISION
    ]
    least = min(row["recall lost"] for row in fit or table)
    equal = [row for row in fit or table if row["recall lost"] <= least + EQUAL]
    best = max(equal, key=lambda row: float(row["f2"]))
    return {key: best[key] for key in ("queries", "votes")}


def _try(clips: tuple[Clip, ...], todo: tuple[str, tuple[str, ...]]) -> Rows:
    """All committees of a class, learned from some actors, on each of the others."""
    name, trainers = todo
    lesson = lesson_of(clips, name, trainers)
    queries = learn_from(lesson, GeneticSettings(), RUNS, seed=SEED).queries
    rows = []
    for unseen in (actor for actor in ACTORS if actor not in trainers):
        tested = Tested.of([clip for clip in clips if clip.actor == unseen])
        trial = Trial(name, lesson.template, tested)
        measured = {size: trial.measure(size.of(queries)) for size in COMMITTEES}
        rows.append({"actors": {*trainers, unseen}, "measured": measured})
    return rows


def _table(tried: Rows) -> Rows:
    """Means over classes and splits, a row for each committee."""
    return [size._asdict() | means(row["measured"][size] for row in tried) for size in COMMITTEES]
