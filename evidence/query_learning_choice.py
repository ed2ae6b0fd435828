"""Which settings make queries hold for actors never seen?

For each actor, the settings are chosen among the other four alone: each three of them
teach, the fourth is unseen. What is chosen for an actor has not seen that actor.
"""

import itertools
from functools import partial
from typing import Any

from evidence.common.pages import fraction, table
from evidence.common.ranking import template_of
from evidence.common.recordings import ACTORS, HDM05, Clip, Recordings, data_entry
from evidence.common.running import JOBS, Evidence, Results, main
from evidence.query_learning_tasks import (
    Actors,
    Committee,
    Rows,
    Trial,
    compute_all,
    head,
    learn_from,
    mean_of,
    split,
)
from motionary.models.query_learning import GeneticSettings

#: What is tried.
COMMITTEES = tuple(
    Committee(*pair)
    for pair in ((3, 2), (5, 2), (5, 3), (5, 4), (10, 4), (10, 5), (10, 6), (10, 7), (10, 8))
)
RUNS = max(committee.queries for committee in COMMITTEES)

#: A setting may leave so many frames, and so many wrong documents among those found.
MOST_LEFT, LEAST_PRECISION = 0.15, 0.9
#: Recall lost counts as equal within this; then F2 decides.
EQUAL = 0.01

SEED = 0
WITHOUT = {actor: f"without {actor}" for actor in ACTORS} | {"nobody": "with all five actors"}


def choose(recordings: Recordings, *, seed: int = SEED, jobs: int = JOBS) -> Results:
    """All tries, and the committee chosen for each actor."""
    todo = [
        (name, learn)
        for learn in itertools.combinations(ACTORS, len(ACTORS) - 2)
        for name in recordings.classes
    ]
    attempt = partial(_attempt, clips=recordings.clips, seed=seed)
    tried = [row for rows in compute_all(attempt, todo, jobs=jobs) for row in rows]
    tables = {actor: _table([r for r in tried if actor not in r["actors"]]) for actor in ACTORS}
    tables["nobody"] = _table(tried)
    return {
        "tries": tables,
        "chosen": {actor: best_of(table) for actor, table in tables.items()},
    }


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


def _attempt(todo: tuple[str, Actors], *, clips: tuple[Clip, ...], seed: int) -> Rows:
    """All committees of a class, learned from some actors, on each of the others."""
    name, learn = todo
    examples = split(clips, name, learn)
    queries = learn_from(examples, GeneticSettings(), RUNS, seed=seed).queries
    rows = []
    for unseen in ACTORS:
        if unseen in learn:
            continue
        trial = Trial(template_of(examples.positives), split(clips, name, [unseen]))
        measured = {committee: trial.ask(queries, committee) for committee in COMMITTEES}
        rows.append({"actors": {*learn, unseen}, "measured": measured})
    return rows


def _table(tried: Rows) -> Rows:
    """Means over classes and splits, a row for each committee."""
    return [
        committee._asdict() | mean_of([row["measured"][committee] for row in tried])
        for committee in COMMITTEES
    ]


def write(results: Results) -> str:
    """Body of the page."""
    parts = [
        "Settings that the [page on learned queries](query_learning.md) reports. For each "
        "actor they are chosen among the other four alone: each three teach, the fourth is "
        f"unseen ({len(COMMITTEES)} committees, 44 classes and splits). Chosen is, "
        f"of the committees that leave at most {fraction(MOST_LEFT)} of the frames and whose "
        f"template is right in at least {fraction(LEAST_PRECISION)} of what it then finds below "
        f".1, and that lose the least recall at .06 (within {fraction(EQUAL)}), the one with the "
        "highest F2 of the clips that are found.\n\n"
        "*Agree*: queries that must agree, of all."
    ]
    for actor, title in WITHOUT.items():
        parts.append(f"## Chosen {title}\n\n{_told(results, actor)}")
    return "\n\n".join(parts)


def _told(results: Results, actor: str) -> str:
    chosen = results["chosen"][actor]
    rows = []
    for row in results["tries"][actor]:
        mine = all(row[key] == value for key, value in chosen.items())
        name = f"{row['votes']} of {row['queries']}"
        cells = [fraction(row[key], 3) for key in _SHOWN]
        rows.append([f"**{name}**" if mine else name, *cells])
    return table(["agree", *map(head, _SHOWN)], rows)


_SHOWN = ("f2", "precision", "recall", "frames left", "recall lost", "precision left")


def describe_data(recordings: Recordings) -> list[dict[str, Any]]:
    """Entries of the record."""
    return [data_entry(HDM05, [clip.packed for clip in recordings.clips])]


EVIDENCE = Evidence(
    name="query_learning_choice",
    title="How the settings of learned queries were chosen",
    split="for each actor, three of the other four teach and the fourth is unseen",
    seed=SEED,
    describe_data=describe_data,
    measure=choose,
    write=write,
    draw=lambda results: {},
)

if __name__ == "__main__":
    main(EVIDENCE)
