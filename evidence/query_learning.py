"""Do learned keyframe queries hold for people that they were not learned from?

HDM05, eleven classes, 288 clips, five actors; words of 40 relations. Four experiments:

left-out   each actor in turn is unseen: 20 runs a class on the other four
generations  learned from bd, bk, dg, verified on mm, tr: 30 runs a class, evolution beside
           random search (Baak 2012, Fig. 4.3)

preselection  mm and tr unseen: recall lost, precision, frames left and processor time when
           queries choose where a template is matched, ten runs a class

annotation  the clips of tr, one behind the other, labelled with classes of the other four,
           with and without queries: processor time and frames labelled

Settings were chosen with bd, bk and dg alone (two learn, the third is unseen); mm and tr
took no part. Seeds: run numbers below seed 0.

    MOTIONARY_DATA=... python evidence/query_learning.py [NAME ...] [--jobs 2]

writes one JSON per experiment beside this file; `query_learning.md` is read from them.
"""

import argparse
import json
import os
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from motionary.annotation import annotate
from motionary.batch import map_ordered
from motionary.features import FULL_BODY, WORD_HZ, FeatureSequence, read_features
from motionary.keyframes import WordIndex, index_words, search_query
from motionary.library import Teaching, learn_classes, learn_queries
from motionary.matching import Pattern, distance_function
from motionary.query_learning import (
    PUBLISHED,
    Evolved,
    LearnedQueries,
    breed_runs,
    combine_runs,
    judge_clips,
    state_problem,
)
from motionary.query_learning.fitness import weighted_f
from motionary.query_learning.individuals import to_query
from motionary.templates import learn_template, pattern_of, quantise
from motionary.words import Words

FOLDER = Path(__file__).resolve().parent / "query_learning"
ACTORS = ("bd", "bk", "dg", "mm", "tr")
UNSEEN = "tr"
FIRST_THREE, LAST_TWO = ACTORS[:3], ACTORS[3:]
RUNS = 20
PUBLISHED_RUNS = 10
GENERATION_RUNS = 30
TIMED_FRAMES = (42_586, 1_000_000)
#: Queries, and how many of them must agree, before a template is matched.
COMMITTEES = ((3, 2), (5, 2), (5, 3), (10, 5), (10, 7))


class Clip(NamedTuple):
    """A clip of one class by one actor."""

    actor: str
    name: str
    words: FeatureSequence


class Task(NamedTuple):
    """A class learned from some actors and verified on others."""

    name: str
    learn: tuple[str, ...]
    verify: tuple[str, ...]


def main() -> None:
    experiments: dict[str, Callable[[list[Clip], int], Any]] = {
        "left-out": leave_actors_out,
        "generations": follow_generations,
        "preselection": preselect_all,
        "annotation": annotate_stream,
    }
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=list(experiments))
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    clips = read_clips(Path(os.environ["MOTIONARY_DATA"]) / "hdm05", options.jobs)
    FOLDER.mkdir(exist_ok=True)
    for name in options.names:
        result = experiments[name](clips, options.jobs)
        (FOLDER / f"{name}.json").write_text(json.dumps(result) + "\n", "utf-8")
        print(f"{name}: done", flush=True)


def read_clips(folder: Path, jobs: int) -> list[Clip]:
    paths = sorted(folder.rglob("HDM_*_*.[aA][mM][cC]"))
    words = read_features([(path.stem, path) for path in paths], jobs=jobs)
    names = [path.stem.split("_") for path in paths]
    return [Clip(n[1], n[2], w) for n, w in zip(names, words, strict=True)]


def one_left_out(clips: list[Clip]) -> list[Task]:
    names = sorted({clip.name for clip in clips})
    return [
        Task(name, tuple(a for a in ACTORS if a != actor), (actor,))
        for actor in ACTORS
        for name in names
    ]


def choose(clips: list[Clip], task: Task, actors: tuple[str, ...]) -> tuple[list, list]:
    """Positives and negatives of some actors."""
    mine = [clip for clip in clips if clip.actor in actors]
    positives = [clip.words for clip in mine if clip.name == task.name]
    return positives, [clip.words for clip in mine if clip.name != task.name]


def index_of(clips: list[FeatureSequence]) -> WordIndex:
    return index_words(
        [clip.words for clip in clips],
        [clip.known for clip in clips],
        feature_set=FULL_BODY.name,
        feature_ids=FULL_BODY.ids,
    )


def measure(documents: np.ndarray, n_positives: int) -> dict[str, float]:
    """Precision, recall and F of retrieved documents, the positives being the first."""
    right = int(np.count_nonzero(documents < n_positives))
    precision, recall = right / max(len(documents), 1), right / n_positives
    return {
        "f2": weighted_f(precision, recall, beta=2.0),
        "f1": weighted_f(precision, recall, beta=1.0),
        "precision": precision,
        "recall": recall,
    }


def mean_of(rows: list[dict[str, float]]) -> dict[str, float]:
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}


def leave_actors_out(clips: list[Clip], jobs: int) -> list[dict[str, Any]]:
    return list(map_ordered(partial(leave_one_out, clips=clips), one_left_out(clips), jobs=jobs))


def leave_one_out(task: Task, *, clips: list[Clip]) -> dict[str, Any]:
    """Queries as published and as they are, on the actor that is left out."""
    positives, negatives = choose(clips, task, task.learn)
    seen, unseen = choose(clips, task, task.verify)
    index = index_of([*seen, *unseen])

    def single(run: Evolved) -> dict[str, float]:
        query = to_query(run.best, FULL_BODY.name, FULL_BODY.ids)
        row = measure(search_query(query, index).hit_documents, len(seen))
        entries = float(run.best.n_fixed)
        return row | {"on_examples": run.score.fitness, "entries": entries}

    template = learn_template(
        [clip.features for clip in positives],
        feature_names=FULL_BODY.ids,
        feature_set=FULL_BODY.name,
    )
    state = partial(state_problem, positives, negatives, template=template)
    problem, printed = state(), state(breeding=PUBLISHED)
    runs = tuple(breed_runs(problem, range(RUNS)))
    plain = LearnedQueries(printed, tuple(breed_runs(printed, range(PUBLISHED_RUNS))), votes=1)
    learned = LearnedQueries(problem, runs, votes=1)
    return {
        "class": task.name,
        "unseen": task.verify[0],
        "n_positives": len(seen),
        "published": mean_of([single(run) for run in plain.runs]),
        "published, combined": single(combine_runs(plain)),
        "one run": mean_of([single(run) for run in runs]),
        "one run, worst": min(single(run)["f2"] for run in runs),
        "found": [search_query(q, index).hit_documents.tolist() for q in learned.queries],
        "stiffness": {"published": histogram(plain), "default": histogram(learned)},
    }


def histogram(learned: LearnedQueries) -> list[int]:
    """Stiffness of all gaps, in twenty bins from 0 to 1 (Baak 2012, Fig. 4.4)."""
    values = [spring.stiffness for query in learned.queries for spring in query.springs]
    counts: list[int] = np.histogram(values, bins=20, range=(0.0, 1.0))[0].tolist()
    return counts


def preselect_all(clips: list[Clip], jobs: int) -> list[dict[str, Any]]:
    tasks = [task for task in one_left_out(clips) if task.verify[0] in LAST_TWO]
    return list(map_ordered(partial(preselect, clips=clips), tasks, jobs=jobs))


def preselect(task: Task, *, clips: list[Clip]) -> dict[str, Any]:
    """Retrieval of clips of the unseen actor by template, with and without queries before."""
    positives, negatives = choose(clips, task, task.learn)
    seen, unseen = choose(clips, task, task.verify)
    documents = [*seen, *unseen]
    template = learn_template(
        [clip.features for clip in positives],
        feature_names=FULL_BODY.ids,
        feature_set=FULL_BODY.name,
    )
    problem = state_problem(positives, negatives, template=template)
    runs = tuple(breed_runs(problem, range(COMMITTEES[-1][0])))
    pattern = pattern_of(quantise(template, tolerance=0.1))
    words = [clip.words for clip in documents]
    everything = smallest(pattern, words)
    timed = {n_frames: repeat(documents, n_frames) for n_frames in TIMED_FRAMES}
    result: dict[str, Any] = {"class": task.name, "unseen": task.verify[0]}
    for number, votes in COMMITTEES:
        learned = LearnedQueries(problem, runs[:number], votes)
        ranges = learned.search(index_of(documents))
        left = np.full(len(documents), np.inf)
        parts = smallest(pattern, [words[d][a:b] for d, a, b in ranges])
        np.minimum.at(left, ranges.documents, parts)
        row: dict[str, Any] = {"frames left": ranges.n_frames / sum(map(len, documents))}
        for threshold in (0.06, 0.1):
            for name, costs in (("all", everything), ("preselected", left)):
                found = measure(np.flatnonzero(costs <= threshold), len(seen))
                row |= {f"{name}, {key}, {threshold}": value for key, value in found.items()}
        row["seconds"] = {
            n_frames: time_preselection(learned, pattern, *many) for n_frames, many in timed.items()
        }
        result[f"{votes}/{number}"] = row
    return result


def annotate_stream(clips: list[Clip], jobs: int) -> dict[str, Any]:
    """Labels of clips one behind the other, with and without learned queries."""
    examples: dict[str, dict[str, list[FeatureSequence]]] = {}
    for clip in clips:
        if clip.actor != UNSEEN:
            examples.setdefault(clip.name, {}).setdefault(clip.name, []).append(clip.words)
    queried = learn_queries(learn_classes(examples, teaching=Teaching()), examples, jobs=jobs)
    mine = [clip for clip in clips if clip.actor == UNSEEN]
    mine *= TIMED_FRAMES[0] // sum(len(clip.words) for clip in mine) + 1
    words = np.concatenate([clip.words.words for clip in mine])
    known = np.concatenate([clip.words.known for clip in mine])
    stream = FeatureSequence(words, known, FULL_BODY)
    truth = np.repeat([clip.name for clip in mine], [len(clip.words) for clip in mine])
    result: dict[str, Any] = {"frames": len(stream)}
    for name, preselected in (("template", False), ("queries", True)):
        call = partial(annotate, stream, queried.library, preselect=preselected)
        right = labelled = 0
        hit = np.zeros(len(stream), dtype=np.bool_)
        for label in call():
            span = slice(round(label.start_s * WORD_HZ), round(label.end_s * WORD_HZ))
            right += int(np.count_nonzero(truth[span] == label.name))
            labelled += len(truth[span])
            hit[span] |= truth[span] == label.name
        covered = int(np.count_nonzero(hit))
        precision, recall = right / labelled, covered / len(stream)
        result[name] = {
            "precision": precision,
            "recall": recall,
            "f1": weighted_f(precision, recall, beta=1.0),
            "seconds": shortest(call),
        }
    return result


def repeat(documents: list[FeatureSequence], n_frames: int) -> tuple[WordIndex, Words]:
    """Index and words of the documents, over and over until there are enough frames."""
    many = documents * (n_frames // sum(map(len, documents)) + 1)
    return index_of(many), np.concatenate([clip.words for clip in many])


def smallest(pattern: Pattern, words: list[Words]) -> np.ndarray:
    """Least cost of the pattern in each document."""
    return np.array([distance_function(pattern, part).min(initial=np.inf) for part in words])


def follow_generations(clips: list[Clip], jobs: int) -> list[dict[str, Any]]:
    names = sorted({clip.name for clip in clips})
    tasks = [Task(name, FIRST_THREE, LAST_TWO) for name in names]
    return list(map_ordered(partial(follow, clips=clips), tasks, jobs=jobs))


def follow(task: Task, *, clips: list[Clip]) -> dict[str, Any]:
    """Mean and spread of fitness, precision and recall by generation, both sets of clips."""
    positives, negatives = choose(clips, task, task.learn)
    seen, unseen = choose(clips, task, task.verify)
    ways = {
        "published": (PUBLISHED, False),
        "random": (PUBLISHED, True),
    }
    result: dict[str, Any] = {"class": task.name}
    for name, (breeding, by_chance) in ways.items():
        problem = state_problem(positives, negatives, breeding=breeding)
        verification = judge_clips(seen, unseen, breeding=breeding)
        runs = list(
            breed_runs(
                problem, range(GENERATION_RUNS), by_chance=by_chance, verification=verification
            )
        )
        result[name] = {
            "examples": np.mean([run.history for run in runs], axis=0).round(4).tolist(),
            "verification": np.mean([run.verified for run in runs], axis=0).round(4).tolist(),
            "best on examples": [run.score.fitness for run in runs],
            "best on verification": [verification(run.best).fitness for run in runs],
        }
    return result


def time_preselection(
    learned: LearnedQueries, pattern: Pattern, index: WordIndex, words: Words
) -> dict[str, float]:
    """Processor seconds: the template alone, the queries, and the template around their hits."""
    offsets = np.cumsum(index.lengths) - index.lengths

    def match_left() -> None:
        ranges = learned.search(index)
        starts = offsets[ranges.documents] + ranges.starts
        stops = offsets[ranges.documents] + ranges.stops
        parts = [words[a:b] for a, b in zip(starts.tolist(), stops.tolist(), strict=True)]
        if parts:
            distance_function(pattern, np.concatenate(parts))

    return {
        "all": shortest(lambda: distance_function(pattern, words)),
        "search": shortest(lambda: learned.search(index)),
        "preselected": shortest(match_left),
    }


def shortest(call: Callable[[], object], rounds: int = 3) -> float:
    seconds = []
    for _ in range(rounds):
        start = time.process_time()
        call()
        seconds.append(time.process_time() - start)
    return min(seconds)


if __name__ == "__main__":
    main()
