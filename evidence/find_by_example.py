"""What does one example find, among classes and across styles?"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.baselines import position_frames
from evidence.common.drawing import Panel, draw_panels
from evidence.common.examples import (
    Pool,
    Query,
    chance,
    mean,
    others_of,
    position_costs_of,
    rows_of,
    score,
    score_judged,
    timed,
)
from evidence.common.pages import claim, fraction, number, picture, table
from evidence.common.parts import Parts, at_tempo, part_costs
from evidence.common.recordings import BANDAI, HDM05, Recordings, data_entry
from evidence.common.running import Evidence, Results, main
from evidence.growing_choice import choose_queries
from motionary.features import FeatureSequence
from motionary.retrieval.search import QueryExpansion

Floats = NDArray[np.float64]

SEED = 2
JUDGED = 10
AS_IT_IS = QueryExpansion(hits=0, by_self_information=False)
BY_SURPRISE = QueryExpansion(hits=0)
#: Orientation: a prototype before the package; settings chosen on the queries reported.
PROTOTYPE = {
    "hdm05": {"chance": (0.09, None), "positions": (0.870, 0.818), "as it is": (0.897, 0.845),
              "by surprise": (0.908, 0.862), "grown": (0.963, 0.945)},
    "bandai": {"chance": (0.06, None), "positions": (0.32, 0.23), "as it is": (0.34, 0.24)},
}  # fmt: skip
AIM = (0.98, 0.97)
WAYS = {
    "chance": "recordings in random order",
    "positions": "joint positions, root, heading and size normalised, subsequence DTW",
    "as it is": "the example's words, all relations alike",
    "by surprise": "the same, what is rare weighs more",
    "grown": "template grown from the nearest hits, by surprise: the default",
    "parts": "the example in parts, each at three tempos, by surprise",
}
TRIED_PARTS = tuple(
    Parts(width, tempos) for width in (15, 30, 60) for tempos in ((1.0,), (0.6, 1.0, 1.6))
)
#: How much faster or slower recordings are made to choose parts for what style changes.
CHANGE = 2.5
NAMES = {"hdm05": "HDM05", "bandai": "Bandai Namco"}


def measure(recordings: Recordings) -> Results:
    """Parts are chosen on other clips; then everything is measured once."""
    tries = _try_parts(recordings)
    chosen = TRIED_PARTS[max(range(len(tries)), key=lambda i: float(tries[i]["mean"]))]
    wanted = recordings.golden("example_queries.json")
    by_stem = {Path(clip.name).stem: clip for clip in recordings.clips}
    clips = others_of(recordings.clips, [by_stem[stem] for stem in wanted])
    names = {id(clip.packed): clip.name for clip in recordings.clips}
    files = {n: w for n, w in recordings.others.items() if n.startswith("bandai/")}
    names |= {id(packed): name for name, packed in files.items()}
    frames = {key: position_frames(recordings.motion(name)) for key, name in names.items()}
    sets = {
        "hdm05": clips,
        "bandai": _contents(files, lambda _query, _file: True),
        "styles": _contents(files, lambda query, file: _style(query) != _style(file)),
    }
    return {
        "parts": {"tries": tries, "chosen": chosen._asdict()},
        "sets": {name: _measure_set(queries, frames, chosen) for name, queries in sets.items()},
        "judged": {
            name: score_judged(sets[name], {"after": QueryExpansion()}, n_hits=JUDGED)
            for name in ("hdm05", "bandai")
        },
    }


def _contents(
    files: Mapping[str, FeatureSequence], is_searched: Callable[[str, str], bool]
) -> list[Query]:
    """Files of the first data set with at least two others of their content."""
    counts = [_content(name) for name in files if "dataset-2" not in name]
    queries = []
    for name, packed in files.items():
        if "dataset-2" in name or counts.count(_content(name)) < 3:
            continue
        pool = [other for other in files if other != name and is_searched(name, other)]
        relevant = np.array([_content(other) == _content(name) for other in pool])
        searched = Pool(tuple(files[other] for other in pool))
        queries.append(Query(Path(name).stem, packed, searched, relevant))
    return queries


def _content(name: str) -> str:
    return Path(name).stem.removeprefix("dataset-2_").rsplit("_", 2)[0]


def _style(name: str) -> str:
    return Path(name).stem.rsplit("_", 2)[1]


def _try_parts(recordings: Recordings) -> list[dict[str, Any]]:
    """Parts on clips that are not reported, as recorded and with their tempo changed."""
    queries = others_of(recordings.clips, choose_queries(recordings))
    rng = np.random.default_rng(SEED)
    rates = np.exp(rng.uniform(-np.log(CHANGE), np.log(CHANGE), len(recordings.clips)))
    slowed = {
        id(clip.packed): at_tempo(clip.packed, float(rate))
        for clip, rate in zip(recordings.clips, rates, strict=True)
    }
    pools: dict[int, Pool] = {}
    changed = []
    for query in queries:
        key = id(query.pool)
        if key not in pools:
            pools[key] = Pool(tuple(slowed[id(packed)] for packed in query.pool.sequences))
        changed.append(Query(query.name, query.example, pools[key], query.relevant))
    tries = []
    for parts in TRIED_PARTS:
        scores = {
            "as recorded": mean([_score_parts(query, parts) for query in queries]),
            "tempo changed": mean([_score_parts(query, parts) for query in changed]),
        }
        values = [value for pair in scores.values() for value in pair.values()]
        tries.append(parts._asdict() | {"worlds": scores, "mean": float(np.mean(values))})
    return tries


def _score_parts(query: Query, parts: Parts) -> tuple[float, float]:
    ones = query.pool.collection.feature_prior
    return score(part_costs(query.example, query.pool.corpus, ones, parts), query.relevant)


def _measure_set(
    queries: Sequence[Query], frames: Mapping[int, Floats], parts: Parts
) -> dict[str, Any]:
    """Every way on every query."""
    scores: dict[str, list[tuple[float, float]]] = {way: [] for way in WAYS}
    seconds: dict[str, list[float]] = {way: [] for way in WAYS}
    for i, query in enumerate(queries):
        scores["chance"].append(chance(query.relevant, seed=SEED + i))
        for way, call in _ways(query, frames, parts).items():
            costs, taken = timed(call)
            scores[way].append(score(costs, query.relevant))
            seconds[way].append(taken)
    return {
        "ways": {
            way: mean(both) | {"seconds": float(np.median(seconds[way])) if seconds[way] else None}
            for way, both in scores.items()
        },
        "rows": rows_of(queries, scores),
        "searched": int(np.median([len(query.relevant) for query in queries])),
        "minutes": float(np.median([len(query.pool.corpus.packed) for query in queries]) / 30 / 60),
    }


def _ways(
    query: Query, frames: Mapping[int, Floats], parts: Parts
) -> dict[str, Callable[[], Floats]]:
    documents = [frames[id(packed)] for packed in query.pool.sequences]
    ones = query.pool.collection.feature_prior
    corpus = query.pool.corpus
    return {
        "positions": lambda: position_costs_of(frames[id(query.example)], documents),
        "as it is": lambda: query.costs(AS_IT_IS),
        "by surprise": lambda: query.costs(BY_SURPRISE),
        "grown": lambda: query.costs(QueryExpansion()),
        "parts": lambda: part_costs(query.example, corpus, ones, parts),
    }


def write(results: Results) -> str:
    """Body of the page."""
    sets, parts = results["sets"], results["parts"]
    ways = "\n".join(f"- *{way}*: {text}" for way, text in WAYS.items())
    tempos = ", ".join(f"{tempo:g}" for tempo in parts["chosen"]["tempos"])
    return f"""
One clip is the example; every other recording is ranked by its smallest cost and counts once.
mAP is the mean over the queries of average precision, R-precision the precision among the first
R, R being how many are right.

{ways}

[How far an example grows](growing_choice.md) and [how much a wrong hit tells](judging_choice.md)
were chosen on other clips of HDM05; nothing was chosen on Bandai Namco's recordings. It is not all
unseen: the way of growing, in steps, was developed on the 33 queries of HDM05 reported here,
several earlier defaults were measured on both sets, and a first run in which wrong hits told more
took .03 from Bandai Namco's files not judged before that choice was made. *Prototype* is a plain
one before the package, for orientation: its chance is the share of right recordings, it grew by
three hits at once, and how it grouped and ranked Bandai Namco's files is not written down.

## Classes of HDM05

{len(sets["hdm05"]["rows"])} clips, three of each class, each among the
{sets["hdm05"]["searched"]} clips or so of the other four actors
({number(sets["hdm05"]["minutes"])} minutes).

{_ways_table("hdm05", sets)}
{_against_aim(sets["hdm05"])}

## Contents of Bandai Namco across styles

{len(sets["bandai"]["rows"])} files as they are, each with at least two others of its content (bow,
walk to the left, …) that the same motion is played in another style (normal, active, old), each
among the {sets["bandai"]["searched"]} other files ({number(sets["bandai"]["minutes"])} minutes):

{_ways_table("bandai", sets)}
The same among the files of the two other styles alone:

{_ways_table("styles", sets)}
{_about_styles(sets)} {_against_positions(sets)}

*Parts* are {parts["chosen"]["width"]} columns long, sought at tempos {tempos}; chosen on the clips
of [the other page](growing_choice.md), as recorded and with the tempo of each recording changed by
up to {CHANGE:g} times (synthetic):

{_parts_table(parts)}
## A person's yes and no

The first {JUDGED} hits are judged by the truth, as `--good` and `--bad` take it; both answers are
measured on the recordings that were not judged, where there are right ones among them, and over
all recordings.

{_judged_table(results["judged"])}
{_judged_finding(results["judged"])}

{
        picture(
            "find_by_example",
            "Average precision of each query, sorted, of four ways: HDM05, and Bandai Namco",
        )
    }
## By query

Average precision and R-precision.

{_query_table(sets["hdm05"], ("positions", "as it is", "grown"))}
{_query_table(sets["bandai"], ("positions", "as it is", "grown", "parts"))}"""


def _ways_table(name: str, sets: Mapping[str, Any]) -> str:
    known = PROTOTYPE.get(name, {})
    rows = [
        [way, fraction(row["average_precision"], 3), fraction(row["r_precision"], 3),
         number(row["seconds"], 3), *(fraction(value, 3) for value in known.get(way, (None, None)))]
        for way, row in sets[name]["ways"].items()
    ]  # fmt: skip
    head = ["", "mAP", "R-precision", "s a query", "prototype: mAP", "R-precision"]
    return table(head, rows) + (
        "\nSeconds of processor time, median, without reading files.\n" if name == "hdm05" else ""
    )


def _against_positions(sets: Mapping[str, Any]) -> str:
    """Who wins across styles, by the numbers."""
    told = []
    for name, where in (("bandai", "among all files"), ("styles", "among other styles")):
        ways = sets[name]["ways"]
        order = sorted(
            ("positions", "as it is", "grown", "parts"),
            key=lambda way: -float(ways[way]["average_precision"]),
        )
        told.append(f"{where} {', '.join(order)}")
    return f"By mAP, from best to worst: {'; '.join(told)}. None is good."


def _against_aim(of: Mapping[str, Any]) -> str:
    ways = of["ways"]
    expanded, plain, positions = ways["grown"], ways["as it is"], ways["positions"]
    missed = [
        f"{name} {fraction(expanded[key], 3)}, aim {fraction(aim)}"
        for name, key, aim in zip(
            ("mAP", "R-precision"), ("average_precision", "r_precision"), AIM, strict=True
        )
        if expanded[key] < aim
    ]
    low = sorted(of["rows"], key=lambda row: float(row["grown"][0]))[:3]
    worst = ", ".join(f"{_short(row['query'])} ({fraction(row['grown'][0])})" for row in low)
    told = claim(
        expanded["average_precision"] > plain["average_precision"] > positions["average_precision"],
        "Growing finds more than the example as it is, and that more than positions do, in "
        f"{number(positions['seconds'] / expanded['seconds'])} and "
        f"{number(positions['seconds'] / plain['seconds'])} times less time. Lowest: {worst}.",
    )
    return f"{told} Short of what was aimed at: {'; '.join(missed)}." if missed else told


def _about_styles(sets: Mapping[str, Any]) -> str:
    whole, styles = sets["bandai"], sets["styles"]
    expanded, plain = (whole["ways"][way]["average_precision"] for way in ("grown", "by surprise"))
    gain = styles["ways"]["by surprise"]["average_precision"] - plain
    relevant = int(np.median([row["relevant"] for row in whole["rows"]]))
    return claim(
        gain > 0,
        f"Growing changes mAP by {expanded - plain:+.3f} among all files. Most queries have "
        f"{relevant} right files; the nearest file is often another content in the same style, "
        "which teaches what is wrong; and what is played at less than half the tempo has no "
        f"finite cost. Without the files of the query's style, mAP is higher by {gain:.3f} as the "
        "example is.",
    )


def _parts_table(parts: Mapping[str, Any]) -> str:
    rows = [
        [f"{item['width']}, {', '.join(f'{t:g}' for t in item['tempos'])}",
         *(fraction(pair[key], 3) for pair in item["worlds"].values() for key in pair),
         fraction(item["mean"], 3)]
        for item in parts["tries"]
    ]  # fmt: skip
    head = ["columns, tempos", "as recorded: mAP", "R-precision", "tempo changed: mAP",
            "R-precision", "mean"]  # fmt: skip
    return table(head, rows)


def _judged_table(feedback: Mapping[str, Any]) -> str:
    rows = [
        [NAMES[name], f"{row['queries']} of {row['of']}", number(row["good"]),
         *(fraction(row[part][when][key], 3) for part in ("left", "all")
           for key in ("average_precision", "r_precision") for when in ("before", "after"))]
        for name, row in feedback.items()
    ]  # fmt: skip
    head = ["", "queries", f"right of {JUDGED}", "mAP before", "after", "R-precision before",
            "after", "over all: mAP before", "after", "R-precision before", "after"]  # fmt: skip
    return table(head, rows)


def _judged_finding(feedback: Mapping[str, Any]) -> str:
    told = []
    for name, row in feedback.items():
        before, after = (row["left"][w]["average_precision"] for w in ("before", "after"))
        told.append(f"{after - before:+.3f} for {NAMES[name]}")
    few = feedback["bandai"]["good"]
    return (
        f"Among recordings not judged, a round changes mAP by {' and '.join(told)}. Where only "
        f"{number(few)} of {JUDGED} hits are right, there is hardly anything to learn from, and "
        "what is left of the kind is what is least like the example."
    )


def _query_table(of: Mapping[str, Any], ways: Sequence[str]) -> str:
    rows = [
        [_short(row["query"]), row["relevant"],
         *(f"{fraction(row[way][0])}, {fraction(row[way][1])}" for way in ways)]
        for row in of["rows"]
    ]  # fmt: skip
    return table(["query", "right", *ways], rows)


def _short(name: str) -> str:
    return Path(name).stem.removeprefix("HDM_").removesuffix("_120")


def draw(results: Results) -> dict[str, Any]:
    """Average precision of each query, sorted within each way."""
    panels = []
    for name in ("hdm05", "bandai"):
        rows = results["sets"][name]["rows"]
        curves = {}
        for way in ("grown", "positions", "as it is", "parts"):
            values = sorted((float(row[way][0]) for row in rows), reverse=True)
            curves[way] = (list(range(1, len(rows) + 1)), values)
        panels.append(Panel(NAMES[name], curves, "query", "average precision", (0, 1.04)))
    return {"find_by_example": draw_panels(panels, columns=2, size=(3.4, 2.2))}


def describe_data(recordings: Recordings) -> list[dict[str, Any]]:
    """Entries of the record."""
    bandai = [w for n, w in recordings.others.items() if n.startswith("bandai/")]
    return [
        data_entry(HDM05, [clip.packed for clip in recordings.clips]),
        data_entry(BANDAI, bandai),
    ]


EVIDENCE = Evidence(
    name="find_by_example",
    title="Found by one example",
    split="HDM05: an example is sought among the clips of the other actors; Bandai Namco: among "
    "all other files; settings chosen on other clips of HDM05",
    seed=SEED,
    describe_data=describe_data,
    measure=measure,
    write=write,
    draw=draw,
)

if __name__ == "__main__":
    main(EVIDENCE)
