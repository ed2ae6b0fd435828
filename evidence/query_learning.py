"""Do learned keyframe queries hold for people that they were not learned from?

Baak (2012), chapter 4, and section 6 of Müller, Baak and Seidel (2009). Settings are those
of the record `query_learning_choice`; with `--choose` they are tried and chosen anew first.
"""

import sys
from typing import Any

from evidence import query_learning_choice
from evidence.common.recordings import BANDAI, CMU, HDM05, Recordings, data_entry
from evidence.common.records import read_record
from evidence.common.running import JOBS, Evidence, Results, main
from evidence.query_learning_page import draw, write
from evidence.query_learning_speed import SOURCES, UNSEEN, measure_speed
from evidence.query_learning_unseen import follow_generations, leave_actors_out
from motionary.io.queries import read_query_collections
from motionary.keyframes import KeyframeQuery, from_patterns

SEED = 0


def measure(recordings: Recordings) -> Results:
    """Unseen actors, generations, time and quality of labels."""
    chosen = read_record(query_learning_choice.EVIDENCE.name)["results"]["chosen"]
    manual = manual_queries(recordings)
    return {
        "left_out": leave_actors_out(recordings, chosen, manual, seed=SEED, jobs=JOBS),
        "generations": follow_generations(recordings, seed=SEED, jobs=JOBS),
        "speed": measure_speed(recordings, chosen[UNSEEN], manual, seed=SEED, jobs=JOBS),
    }


def manual_queries(recordings: Recordings) -> dict[str, KeyframeQuery]:
    """Queries that the authors made by hand, of the classes at hand."""
    path = recordings.folder.resolve().parent / "reference" / "golden" / "manual_keyframes.json"
    records = read_query_collections(path)["retrieval_2008"]
    queries = {}
    for name in recordings.classes:
        record = records[name]
        queries[name] = from_patterns(
            record.keyframes, record.groups, distances=record.distances,
            stiffness=record.stiffness, positions=record.positions,
        )  # fmt: skip
    return queries


def describe_data(recordings: Recordings) -> list[dict[str, Any]]:
    """Entries of the record."""
    others = {
        source: [w for name, w in recordings.others.items() if name.split("/")[0] == source]
        for source in SOURCES["all"]
    }
    return [
        data_entry(HDM05, [clip.words for clip in recordings.clips]),
        data_entry(CMU, others["cmu"]),
        data_entry(BANDAI, others["bandai"]),
    ]


EVIDENCE = Evidence(
    name="query_learning",
    title="Queries that are learned, and people never seen",
    split=(
        "each actor of HDM05 in turn is unseen, with settings chosen among the other four; "
        f"generations: bd, bk, dg teach, mm and tr verify; labels: {UNSEEN} is unseen"
    ),
    seed=SEED,
    describe_data=describe_data,
    measure=measure,
    write=write,
    draw=draw,
)

if __name__ == "__main__":
    if "--choose" in sys.argv[1:]:
        main(query_learning_choice.EVIDENCE)
    main(EVIDENCE)
