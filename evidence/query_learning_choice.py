"""Which settings make queries hold for actors never seen?

For each actor, the settings are chosen among the other four alone: each three of them
teach, the fourth is unseen. What is chosen for an actor has not seen that actor.
"""

from functools import partial
from typing import Any

from evidence.common.pages import share, table
from evidence.common.ranking import template_of
from evidence.common.recordings import ACTORS, HDM05, Clip, Recordings, data_entry
from evidence.common.running import JOBS, Evidence, Results, main
from evidence.query_learning_tasks import (
    Committee,
    Measures,
    Task,
    Trial,
    mean_of,
    problem_of,
    split,
    tasks,
)
from motionary.batch import Failure, map_ordered
from motionary.query_learning import Breeding, Copying, LearnedQueries, breed_runs

#: What is tried: copies of each positive when queries are simplified, and committees.
COPIES = (0, 1)
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
WITHOUT = {actor: f"without {actor}" for actor in ACTORS} | {"nobody": "all five actors"}

Rows = list[dict[str, Any]]


def breeding_of(copies: int) -> Breeding:
    """The usual settings with so many copies of each positive."""
    return Breeding(copying=Copying(copies=copies))


def choose(recordings: Recordings, *, seed: int = SEED, jobs: int = JOBS) -> Results:
    """All tries, and the setting chosen for each actor."""
    todo = [(task, copies) for copies in COPIES for task in tasks(recordings.classes, n_learn=3)]
    attempt = partial(_attempt, clips=recordings.clips, seed=seed)
    tried: Rows = []
    for row in map_ordered(attempt, todo, jobs=jobs):
        if isinstance(row, Failure):
            raise row.error
        tried.append(row)
    by_actor = {actor: _table([r for r in tried if actor not in r["actors"]]) for actor in ACTORS}
    everyone = _table(tried)
    return {
        "tries": by_actor | {"nobody": everyone},
        "chosen": {actor: best_of(table) for actor, table in by_actor.items()}
        | {"nobody": best_of(everyone)},
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
    return {key: best[key] for key in ("copies", "queries", "votes")}


def _attempt(todo: tuple[Task, int], *, clips: tuple[Clip, ...], seed: int) -> dict[str, Any]:
    task, copies = todo
    examples = split(clips, task.name, task.learn)
    problem = problem_of(examples, breeding_of(copies), seed=seed)
    learned = LearnedQueries(problem, tuple(breed_runs(problem, range(RUNS))), votes=1)
    trial = Trial(template_of(examples.positives), split(clips, task.name, [task.unseen]))
    measured = {
        committee: trial.measure(learned.queries[: committee.queries], votes=committee.votes)
        for committee in COMMITTEES
    }
    return {"actors": {*task.learn, task.unseen}, "copies": copies, "measured": measured}


def _table(tried: Rows) -> Rows:
    """Means over classes and splits, a row for each setting."""
    table = []
    for copies in COPIES:
        mine = [row["measured"] for row in tried if row["copies"] == copies]
        for committee in COMMITTEES:
            measures: list[Measures] = [measured[committee] for measured in mine]
            table.append({"copies": copies, **committee._asdict(), **mean_of(measures)})
    return table


def write(results: Results) -> str:
    """Body of the page."""
    parts = [
        "Settings that the [page on learned queries](query_learning.md) reports. For each "
        "actor they are chosen among the other four alone: each three teach, the fourth is "
        f"unseen ({len(COMMITTEES) * len(COPIES)} settings, 44 classes and splits). Chosen is, "
        f"of the settings that leave at most {share(MOST_LEFT)} of the frames and whose "
        f"template is right in at least {share(LEAST_PRECISION)} of what it then finds below "
        f".1, and that lose the least recall at .06 (within {share(EQUAL)}), the one with the "
        "highest F2 of the clips that are found.\n\n"
        "*Copies*: varied copies of each positive on which a query is simplified, beside two "
        "of each negative. *Agree*: queries that must agree, of all."
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
        rows.append([f"**{name}**" if mine else name, row["copies"], *map(row.get, _SHOWN)])
    return table(["agree", "copies", *_SHOWN], rows)


_SHOWN = ("f2", "precision", "recall", "frames left", "recall lost", "precision left")


def describe_data(recordings: Recordings) -> list[dict[str, Any]]:
    """Entries of the record."""
    return [data_entry(HDM05, [clip.words for clip in recordings.clips])]


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
