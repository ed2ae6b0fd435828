"""Time of one run of the genetic algorithm.

All HDM05 clips at hand, repeated to 42 586 frames (24 min), the size of the authors'
training set; population 50, 5 parents, 100 generations. Baak (2012), section 4.5: roughly
10 s on an Athlon X2 5000+. Then a hundred runs on one process and on two.
"""

import os
import time
from collections.abc import Callable
from pathlib import Path

from motionary.features import FULL_BODY, FeatureSequence, read_features
from motionary.models.keyframes import index_packed, search_query
from motionary.models.query_learning import (
    PUBLISHED,
    GeneticSettings,
    Problem,
    clip_evaluator,
    learn_runs,
    state_problem,
    to_query,
)
from timing import compare, print_ratios

FRAMES = 42_586
ACTORS = ("bd", "bk", "dg")
NAMES = ("depositFloorR", "hopBothLegs", "squat", "throwBasketball")
MANY = 100
AUTHORS_S = 10.0


def main() -> None:
    folder = os.environ.get("MOTIONARY_DATA", "")
    if not folder:
        print("  skipped: MOTIONARY_DATA is not set, there are no recordings")
        return
    clips = read_clips(Path(folder) / "hdm05")
    problems = {name: problem_of(name, clips) for name in NAMES}
    for name, problem in problems.items():
        n_frames = sum(map(len, (*problem.positives, *problem.negatives)))
        print(f"  {name}: {n_frames} frames, {len(problem.pool)} columns")
        time_runs(problem)
        time_evaluations(problem)
    time_processes(with_settings(problems["squat"], GeneticSettings()))


def read_clips(folder: Path) -> list[tuple[str, FeatureSequence]]:
    paths = sorted(folder.rglob("HDM_*_*.[aA][mM][cC]"))
    packed = read_features([(path.stem, path) for path in paths])
    return [(path.stem, clip) for path, clip in zip(paths, packed, strict=True)]


def problem_of(name: str, clips: list[tuple[str, FeatureSequence]]) -> Problem:
    """Positives of three actors; negatives over and over until there are enough frames."""
    positives = [clip for stem, clip in clips if name in stem and stem.split("_")[1] in ACTORS]
    others = [clip for stem, clip in clips if name not in stem]
    negatives, total = [], sum(map(len, positives))
    while total < FRAMES:
        negatives.append(others[len(negatives) % len(others)])
        total += len(negatives[-1])
    return state_problem(positives, negatives, settings=PUBLISHED)


def with_settings(problem: Problem, settings: GeneticSettings) -> Problem:
    return Problem(problem.positives, problem.negatives, problem.pool, settings, seed=0)


def time_runs(problem: Problem) -> None:
    usual = with_settings(problem, GeneticSettings())
    ways = {
        "a run as published": lambda: list(learn_runs(problem, [0])),
        "a run, simplified": lambda: list(learn_runs(usual, [0])),
    }
    for name, call in ways.items():
        seconds = cpu_seconds(call)
        ratio = AUTHORS_S / seconds
        print(f"  {name:<20} {seconds:6.3f} s of one processor  {ratio:6.1f} x thesis (10 s)")


def cpu_seconds(call: Callable[[], object], rounds: int = 3) -> float:
    """Least processor time: what others do on the machine does not count."""
    call()
    seconds = []
    for _ in range(rounds):
        start = time.process_time()
        call()
        seconds.append(time.process_time() - start)
    return min(seconds)


def time_evaluations(problem: Problem) -> None:
    """Fitness of one individual: by the general search, and by the bitmaps of clips."""
    clips = [*problem.positives, *problem.negatives]
    index = index_packed(
        [clip.packed for clip in clips], feature_set=FULL_BODY.name, feature_ids=FULL_BODY.ids
    )
    evaluator = clip_evaluator(problem.positives, problem.negatives, settings=PUBLISHED)
    bests = [run.best for run in learn_runs(problem, range(5))]
    queries = [to_query(best, FULL_BODY.name, FULL_BODY.ids) for best in bests]
    ways = {
        f"search_query, {engine}, 5 queries": lambda engine=engine: [
            search_query(query, index, engine=engine).hit_sequences for query in queries
        ]
        for engine in ("numpy", "compiled")
    }
    ways["bitmaps of clips, 5 individuals"] = lambda: [evaluator.clips.retrieved(b) for b in bests]
    print_ratios(compare(ways), reference="search_query, numpy, 5 queries")


def time_processes(problem: Problem) -> None:
    """Rate of many runs; and what two free processors would make of the processor time."""
    elapsed, used = {}, {}
    for jobs in (1, 2):
        start, before = time.perf_counter(), processor_seconds()
        runs = list(learn_runs(problem, range(MANY), jobs=jobs))
        elapsed[jobs] = time.perf_counter() - start
        used[jobs] = processor_seconds() - before
        print(
            f"  {len(runs)} runs, {jobs} processes: {len(runs) / elapsed[jobs]:.2f} runs/s, "
            f"{used[jobs]:.1f} s of processors"
        )
    print(f"  two processes: {elapsed[1] / elapsed[2]:.2f} x the rate of one")
    print(f"  by processor time: {2 * used[1] / used[2]:.2f} x, if both processors were free")


def processor_seconds() -> float:
    """Of this process and of those it has started and seen end."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
