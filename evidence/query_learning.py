"""Do learned keyframe queries hold for people that they were not learned from?

Baak (2012), chapter 4. Committees are those of the record `query_learning_choice`; with
`--choose` they are tried and chosen anew first.
"""

import sys
from typing import Any

from evidence import query_learning_choice
from evidence.common.recordings import HDM05, Recordings, data_entry
from evidence.common.records import read_record
from evidence.common.running import JOBS, Evidence, Results, main
from evidence.query_learning_page import draw, write
from evidence.query_learning_tasks import Committee, manual_queries
from evidence.query_learning_unseen import leave_actors_out

SEED = 0


def measure(recordings: Recordings) -> Results:
    """Each actor in turn is unseen."""
    record = read_record(query_learning_choice.EVIDENCE.name)["results"]["chosen"]
    chosen = {actor: Committee(**committee) for actor, committee in record.items()}
    manual = manual_queries(recordings)
    return {"left_out": leave_actors_out(recordings, chosen, manual, seed=SEED, jobs=JOBS)}


def describe_data(recordings: Recordings) -> list[dict[str, Any]]:
    """Entries of the record."""
    return [data_entry(HDM05, [clip.packed for clip in recordings.clips])]


EVIDENCE = Evidence(
    name="query_learning",
    title="Queries that are learned, and people never seen",
    split="each actor in turn is unseen, the committee is chosen among the other four",
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
