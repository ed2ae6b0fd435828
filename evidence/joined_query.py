"""A query joined of two finds a sequence of actions, and only it.

After Baak, Müller and Seidel (2008), section 4.2 and Fig. 9: elbow to knee, a pause, a squat.
Real clips are joined; beside every sequence stand what must not be found.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from evidence.common.queries import RETRIEVAL_2008, by_choosing, index_of, lesson_of, manual
from evidence.common.recordings import ACTORS, Recordings, Results, clips_packed, join
from motionary.features import FeatureSequence
from motionary.models.keyframes import KeyframeQuery, join_queries, search_query

FIRST, SECOND = "elbowToKnee1RepsLelbowStart", "squat1Reps"
TITLE = "A joined query: elbow to knee, a pause, a squat"
SPLIT = "chosen queries: each actor is unseen in turn, the clips of the other four train; defaults"
SEED = 0
DATA = ("clips",)

#: From the last keyframe of the first query to the first of the second.
MOST_PAUSE_S = 2.0
#: What stands between, cut from other clips of the actor.
PAUSE_S, LONG_PAUSE_S = 0.5, 4.0
SEQUENCES = ("at once", "short pause")
DECOYS = ("first alone", "second alone", "wrong order", "pause too long")
BY_HAND, CHOSEN = "by hand, 2008", "choose_query, actor unseen"


class Joined(NamedTuple):
    """Joined clips, and what they are."""

    what: str
    packed: FeatureSequence


def measure(recordings: Recordings) -> Results:
    """Recordings that the joined query finds, by actor and by what they are."""
    by_hand = manual(recordings, RETRIEVAL_2008)
    rows = []
    for actor in ACTORS:
        searched = _join_clips(recordings, actor)
        others = recordings.of(actors=[a for a in ACTORS if a != actor])
        chosen = {n: by_choosing(lesson_of(others, n)).queries[0] for n in (FIRST, SECOND)}
        for way, queries in ((BY_HAND, by_hand), (CHOSEN, chosen)):
            found = _found(queries[FIRST], queries[SECOND], searched)
            rows.append({"actor": actor, "way": way, **found})
    return {"rows": rows}


def _join_clips(recordings: Recordings, actor: str) -> list[Joined]:
    """Every sequence and every decoy of the actor's clips, each with other motion around."""
    rng = np.random.default_rng([SEED, ACTORS.index(actor)])
    first, second = (
        clips_packed(recordings.of(motion_class=name, actors=[actor])) for name in (FIRST, SECOND)
    )
    mine = recordings.of(actors=[actor])
    others = clips_packed(clip for clip in mine if clip.motion_class not in (FIRST, SECOND))

    def other(seconds: float) -> FeatureSequence:
        parts, n = [], 0
        while n < 30 * seconds:
            parts.append(others[rng.integers(len(others))])
            n += len(parts[-1])
        return join(parts).part(0, round(30 * seconds))

    result = []
    for a, b in zip(first, second, strict=False):
        middles = {
            "at once": [a, b],
            "short pause": [a, other(PAUSE_S), b],
            "first alone": [a, other(LONG_PAUSE_S)],
            "second alone": [other(LONG_PAUSE_S), b],
            "wrong order": [b, other(PAUSE_S), a],
            "pause too long": [a, other(LONG_PAUSE_S), b],
        }
        for what, parts in middles.items():
            around = [other(LONG_PAUSE_S), *parts, other(LONG_PAUSE_S)]
            result.append(Joined(what, join(around)))
    return result


def _found(
    first: KeyframeQuery, second: KeyframeQuery, searched: Sequence[Joined]
) -> dict[str, Any]:
    """Recordings by what they are, and how many of them have a hit."""
    query = join_queries(first, second, least_s=0.0, most_s=MOST_PAUSE_S)
    index = index_of([one.packed for one in searched])
    ranges = search_query(query, index)
    hit = set(ranges.hit_sequences.tolist())
    counts = {}
    for what in (*SEQUENCES, *DECOYS):
        of_kind = [i for i, one in enumerate(searched) if one.what == what]
        counts[what] = [len(hit.intersection(of_kind)), len(of_kind)]
    return {"keyframes": len(query), "frames": ranges.n_frames / index.n_frames, "found": counts}


def totals_of(rows: Sequence[dict[str, Any]]) -> dict[str, tuple[int, int]]:
    """Recordings with a hit, and all, by what they are."""
    return {
        what: (
            sum(row["found"][what][0] for row in rows),
            sum(row["found"][what][1] for row in rows),
        )
        for what in (*SEQUENCES, *DECOYS)
    }


def found_of(totals: dict[str, tuple[int, int]]) -> tuple[int, ...]:
    """Sequences with a hit, and all of them; then decoys."""
    return tuple(
        sum(totals[what][i] for what in own) for own in (SEQUENCES, DECOYS) for i in (0, 1)
    )
