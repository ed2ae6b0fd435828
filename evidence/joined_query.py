"""Does a query joined of two find a sequence of actions, and only it?

After Baak, Müller and Seidel (2008), section 4.2 and Fig. 9: elbow to knee, a pause, a squat.
Real clips are joined; beside every sequence stand what must not be found.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from evidence.common.pages import claim, fraction, table
from evidence.common.queries import RETRIEVAL_2008, by_choosing, index_of, lessons_of, manual
from evidence.common.recordings import ACTORS, HDM05, Recordings, data_entry
from evidence.common.running import Evidence, Results, main
from motionary.features import FULL_BODY, FeatureSequence
from motionary.models.keyframes import ChoiceSettings, KeyframeQuery, join_queries, search_query

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEED = 0
FIRST, SECOND = "elbowToKnee1RepsLelbowStart", "squat1Reps"
#: From the last keyframe of the first query to the first of the second.
MOST_PAUSE_S = 2.0
#: What stands between, cut from other clips of the actor.
PAUSE_S, LONG_PAUSE_S = 0.5, 4.0
SEQUENCES = ("at once", "short pause")
DECOYS = ("first alone", "second alone", "wrong order", "pause too long")
BY_HAND, CHOSEN = "by hand, 2008", "choose_query, actor unseen"


class Document(NamedTuple):
    """Joined clips, and what they are."""

    what: str
    packed: FeatureSequence


def measure(recordings: Recordings) -> Results:
    """Documents that the joined query finds, by actor and by what they are."""
    by_hand = manual(recordings, RETRIEVAL_2008)
    rows = []
    for actor in ACTORS:
        documents = _documents(recordings, actor)
        lessons = lessons_of(recordings.of(actors=[a for a in ACTORS if a != actor]))
        pairs = {
            BY_HAND: (by_hand[FIRST], by_hand[SECOND]),
            CHOSEN: tuple(
                by_choosing(lessons[n], ChoiceSettings()).queries[0] for n in (FIRST, SECOND)
            ),
        }
        for way, (first, second) in pairs.items():
            rows.append({"actor": actor, "way": way, **_found(first, second, documents)})
    return {"rows": rows}


def _documents(recordings: Recordings, actor: str) -> list[Document]:
    """Every sequence and every decoy of the actor's clips, each with other motion around."""
    rng = np.random.default_rng([SEED, ACTORS.index(actor)])
    first, second = (
        [clip.packed for clip in recordings.of(motion_class=name, actors=[actor])]
        for name in (FIRST, SECOND)
    )
    others = [
        clip.packed
        for clip in recordings.of(actors=[actor])
        if clip.motion_class not in (FIRST, SECOND)
    ]

    def other(seconds: float) -> FeatureSequence:
        parts, n = [], 0
        while n < 30 * seconds:
            parts.append(others[rng.integers(len(others))])
            n += len(parts[-1])
        return _join(parts).part(0, round(30 * seconds))

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
            result.append(Document(what, _join(around)))
    return result


def _join(parts: Sequence[FeatureSequence]) -> FeatureSequence:
    return FeatureSequence(
        np.concatenate([part.packed for part in parts]),
        np.concatenate([part.known for part in parts]),
        FULL_BODY,
    )


def _found(
    first: KeyframeQuery, second: KeyframeQuery, documents: Sequence[Document]
) -> dict[str, Any]:
    """Documents by what they are, and how many of them have a hit."""
    query = join_queries(first, second, least_s=0.0, most_s=MOST_PAUSE_S)
    index = index_of([document.packed for document in documents])
    ranges = search_query(query, index)
    hit = set(ranges.hit_sequences.tolist())
    counts = {
        what: [
            sum(i in hit for i, document in enumerate(documents) if document.what == what),
            sum(document.what == what for document in documents),
        ]
        for what in (*SEQUENCES, *DECOYS)
    }
    return {"keyframes": len(query), "frames": ranges.n_frames / index.n_frames, "found": counts}


def write(results: Results) -> str:
    """Body of the page."""
    return f"""
The query of {FIRST}, at most {MOST_PAUSE_S:g} s, the query of
{SECOND}: `join_queries`. Clips of one actor are joined to documents with {LONG_PAUSE_S:g} s of
the actor's other motions at both ends. To be found are the two motions *at once* or after a
*short pause* ({PAUSE_S:g} s of another motion); not to be found are either alone, both in the
wrong order, and both with a *pause too long* ({LONG_PAUSE_S:g} s). The joins are ours, the clips
real.

{table(_HEAD, _rows(results))}
Documents with a hit, of documents. *{BY_HAND}*: the authors' queries, who knew all actors;
*{CHOSEN}*: chosen from the other four actors' clips.

{_told(results)}
"""


_HEAD = ("queries", "actor", "keyframes", *SEQUENCES, *DECOYS)


def _rows(results: Results) -> list[list[str]]:
    rows = []
    for way in (BY_HAND, CHOSEN):
        own = [row for row in results["rows"] if row["way"] == way]
        for i, row in enumerate(own):
            cells = ["{} of {}".format(*row["found"][what]) for what in (*SEQUENCES, *DECOYS)]
            rows.append(["" if i else way, row["actor"], str(row["keyframes"]), *cells])
        total = [_total(results, way, [what]) for what in (*SEQUENCES, *DECOYS)]
        rows.append(["", "all", "", *(f"{hit} of {n}" for hit, n in total)])
    return rows


def _total(results: Results, way: str, whats: Sequence[str]) -> tuple[int, int]:
    counts = [row["found"][what] for row in results["rows"] if row["way"] == way for what in whats]
    return sum(hit for hit, _ in counts), sum(n for _, n in counts)


def _told(results: Results) -> str:
    hand, mine = (_total(results, way, SEQUENCES) for way in (BY_HAND, CHOSEN))
    hand_false, mine_false = (_total(results, way, DECOYS) for way in (BY_HAND, CHOSEN))
    return claim(
        hand[0] >= 0.95 * hand[1] and hand_false[0] <= 0.02 * hand_false[1],
        f"By hand {hand[0]} of {hand[1]} sequences are found ({fraction(hand[0] / hand[1], 3)}) and "
        f"{hand_false[0]} of {hand_false[1]} decoys; chosen for an unseen actor {mine[0]} of "
        f"{mine[1]} ({fraction(mine[0] / mine[1], 3)}) and {mine_false[0]} of {mine_false[1]}.",
    )


def draw(_: Results) -> "dict[str, Figure]":
    """No picture."""
    return {}


def describe_data(recordings: Recordings) -> list[dict[str, Any]]:
    """Entries of the record."""
    return [data_entry(HDM05, [clip.packed for clip in recordings.clips])]


EVIDENCE = Evidence(
    name="joined_query",
    title="A joined query: elbow to knee, a pause, a squat",
    split="chosen queries: each actor is unseen in turn, the other four teach; defaults",
    seed=SEED,
    describe_data=describe_data,
    measure=measure,
    write=write,
    draw=draw,
)

if __name__ == "__main__":
    main(EVIDENCE)
