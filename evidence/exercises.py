"""Repetitions of exercises by strangers: found, told apart and counted."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from recipes.sources import Sources, person_of, read_rows, read_sources

from evidence.common.recordings import Recordings, Results, join
from motionary.evaluation import interval
from motionary.features import FeatureSequence
from motionary.labels import Label
from motionary.models.library import ClassLibrary, learn
from motionary.retrieval.annotation import annotate

TITLE = "Repetitions of exercises by strangers"
SPLIT = (
    "UI-PRMD: three repetitions of each of s01 to s04 (or fewer people) train, all repetitions of "
    "s05 to s08 are tested; other motion between them is of CMU's 01, 06, 10, 32, 38, 49; least "
    "scores were chosen among s01 to s04 by leaving one out"
)
SEED = 0
DATA = (
    ("UI-PRMD (Vakanski and others 2018, PDDL 1.0), correct repetitions", (79, 32.5)),
    ("CMU, motion between them", (15, 2.8)),
)
TEACHERS = ("s01", "s02", "s03", "s04")
TESTED = ("s05", "s06", "s07", "s08")
OTHERS = ("01", "06", "10", "32", "38", "49")
REPETITIONS = (2, 5, 8)
IOU = 0.5
#: Least scores: the default, and the best of 5 to 10 among the people who teach.
DEFAULT, COMMON, PER_PERSON = None, 7.0, 9.0
#: By costs, as published: the default, and a looser one.
COSTS = (0.06, 0.1)
_LONGEST, _SHORTEST = 180, 30
_SHORTEST_S, _LONGEST_S = 1.0, 12.0


class Task(NamedTuple):
    """A recording of one person, and its repetitions."""

    person: str
    sequence: FeatureSequence
    truth: tuple[Label, ...]


def measure(recordings: Recordings) -> Results:
    """Whole recordings and mixed streams, by who teaches and how it is decided."""
    sources = read_sources(recordings.folder, jobs=2)
    whole = {p: _recordings_of(sources, p) for p in TESTED}
    streams = {p: [_stream(sources, p)] for p in TESTED}
    teachers = {
        "four people": TEACHERS, "three people (s01 to s03)": TEACHERS[:3],
        "one person (s01)": TEACHERS[:1], "one person (s04)": TEACHERS[3:],
    }  # fmt: skip
    rows = []
    libraries: dict[str, ClassLibrary] = {}
    for title, people in teachers.items():
        examples = _examples(sources, people)
        libraries[title] = learn(examples, mirror=True, fold_sides=True)
        for score in (DEFAULT, COMMON) if len(people) == len(TEACHERS) else (DEFAULT,):
            how = "default" if score is None else f"least score {score:g}"
            rows.append(_row(title, how, libraries[title], whole, streams, {"threshold": score}))
        if len(people) > 1:
            each = learn(examples, mirror=True, fold_sides=True, groups=r"_(s\d\d)", per_group=True)
            how = f"a template of each person beside, least score {PER_PERSON:g}"
            rows.append(_row(title, how, each, whole, streams, {"threshold": PER_PERSON}))
    for cost in COSTS:
        options = {"assignment": "published", "threshold": cost}
        first = libraries["four people"]
        rows.append(
            _row("four people", f"costs of {cost:g}, as published", first, whole, streams, options)
        )
    rows.append(_cuts(whole))
    return {"rows": rows, "minutes": _minutes(whole), "stream_minutes": _minutes(streams)}


def _examples(sources: Sources, people: Sequence[str]) -> dict[str, list[FeatureSequence]]:
    found: dict[str, list[FeatureSequence]] = {}
    for row, sequence in _repetitions(sources, people):
        if int(row["repetition"]) - 1 in REPETITIONS:
            found.setdefault(row["label"], []).append(sequence)
    return found


def _repetitions(
    sources: Sources, people: Sequence[str]
) -> list[tuple[dict[str, str], FeatureSequence]]:
    found = []
    for row in read_rows(sources.folder / "ui_prmd" / "repetitions.csv"):
        sequence = sources.sequences["ui_prmd"].get(row["recording"])
        if sequence is not None and person_of("ui_prmd", row["recording"]) in people:
            start, stop = (round(float(row[key]) * 30) for key in ("start_s", "end_s"))
            found.append((row, sequence.part(start, min(stop, len(sequence)))))
    return found


def _recordings_of(sources: Sources, person: str) -> list[Task]:
    rows: dict[str, list[Label]] = {}
    for row, _ in _repetitions(sources, [person]):
        label = Label(row["label"], float(row["start_s"]), float(row["end_s"]))
        rows.setdefault(row["recording"], []).append(label)
    own = sources.sequences["ui_prmd"]
    return [Task(person, own[name], tuple(truth)) for name, truth in rows.items()]


def _stream(sources: Sources, person: str) -> Task:
    """All repetitions of a person in any order, between as much other motion."""
    rng = np.random.default_rng(int(person[1:]))
    own = _repetitions(sources, [person])
    takes = sources.sequences["cmu_everyday"].items()
    pieces = [x for name, take in takes if name[:2] in OTHERS for x in _cut(take)]
    need, have, order = sum(len(s) for _, s in own), 0, list[int]()
    gaps: list[list[FeatureSequence]] = [[] for _ in own]
    while have < need:
        order = order or rng.permutation(len(pieces)).tolist()
        piece = pieces[order.pop()]
        gaps[rng.integers(len(gaps))].append(piece)
        have += len(piece)
    parts, truth, at = list[FeatureSequence](), list[Label](), 0
    for gap, index in zip(gaps, rng.permutation(len(own)).tolist(), strict=True):
        row, sequence = own[index]
        truth.append(Label(row["label"], at / 30, (at + len(sequence)) / 30))
        parts += [sequence, *gap]
        at += len(sequence) + sum(map(len, gap))
    return Task(person, join(parts), tuple(truth))


def _cut(sequence: FeatureSequence) -> list[FeatureSequence]:
    n = max(1, -(-len(sequence) // _LONGEST))
    ends = np.linspace(0, len(sequence), n + 1).astype(int).tolist()
    parts = [sequence.part(a, b) for a, b in pairwise(ends)]
    return [part for part in parts if len(part) >= _SHORTEST]


# -- measures ---------------------------------------------------------------------------


def _row(
    taught: str,
    how: str,
    library: ClassLibrary,
    whole: Mapping[str, Sequence[Task]],
    streams: Mapping[str, Sequence[Task]],
    options: dict[str, Any],
) -> Results:
    given = {"assignment": "scores", **options}
    found: Results = {"taught": taught, "how": how}
    for key, tasks in (("whole", whole), ("streams", streams)):
        by_person = {
            person: _rates([(list(annotate(t.sequence, library, **given)), t.truth) for t in own])
            for person, own in tasks.items()
        }
        found[key] = _summary(by_person)
    return found


def _summary(by_person: Mapping[str, Mapping[str, float]]) -> Results:
    summary: Results = {}
    for key in ("right", "precision", "count", "ends_s"):
        values = {person: [own[key]] for person, own in by_person.items()}
        summary[key] = interval(values, seed=SEED)._asdict()
    return summary | {"people": {person: own["right"] for person, own in by_person.items()}}


def _rates(pairs: Sequence[tuple[Sequence[Label], Sequence[Label]]]) -> dict[str, float]:
    """Right, precision, miscounted of ten, and how far ends are off (median, seconds)."""
    n_right = n_true = n_said = 0
    miscounted, ends = list[float](), list[float]()
    for said, truth in pairs:
        matched = _match(said, truth)
        n_right, n_true, n_said = n_right + len(matched), n_true + len(truth), n_said + len(said)
        for name in sorted({x.name for x in truth}):
            n = sum(x.name == name for x in truth)
            miscounted.append(10 * abs(sum(x.name == name for x in said) - n) / n)
        for one, other in matched:
            ends += [abs(one.start_s - other.start_s), abs(one.end_s - other.end_s)]
    return {
        "right": n_right / n_true, "precision": n_right / max(n_said, 1),
        "count": float(np.mean(miscounted)), "ends_s": float(np.median(ends or [np.nan])),
    }  # fmt: skip


def _match(said: Sequence[Label], truth: Sequence[Label]) -> list[tuple[Label, Label]]:
    """Pairs of one class, one to one, the largest overlaps first."""
    pairs = []
    for i, one in enumerate(said):
        for j, other in enumerate(truth):
            shared = min(one.end_s, other.end_s) - max(one.start_s, other.start_s)
            union = max(one.end_s, other.end_s) - min(one.start_s, other.start_s)
            if one.name == other.name and shared / union >= IOU:
                pairs.append((-shared / union, i, j))
    used: tuple[set[int], set[int]] = (set(), set())
    matched = []
    for _, i, j in sorted(pairs):
        if i not in used[0] and j not in used[1]:
            used[0].add(i)
            used[1].add(j)
            matched.append((said[i], truth[j]))
    return matched


def _cuts(whole: Mapping[str, Sequence[Task]]) -> Results:
    """Equal cuts by the recording's period, under the name of the exercise, which is given."""
    by_person = {
        person: _rates([(_equal_cuts(task), task.truth) for task in own])
        for person, own in whole.items()
    }
    return {
        "taught": "nothing; exercises are given", "how": "equal cuts by period",
        "whole": _summary(by_person), "streams": None,
    }  # fmt: skip


def _equal_cuts(task: Task) -> list[Label]:
    """Cuts at the lag at which the features resemble themselves best."""
    features = task.sequence.features.astype(float)
    centred = features - features.mean(axis=0)
    n = len(centred)
    lags = range(round(_SHORTEST_S * 30), min(round(_LONGEST_S * 30), n // 2))
    alike = [float((centred[lag:] * centred[:-lag]).sum()) / (n - lag) for lag in lags]
    period = lags[int(np.argmax(alike))]
    count = max(1, round(n / period))
    edges = np.linspace(0, n / 30, count + 1)
    name = task.truth[0].name
    return [Label(name, a, b) for a, b in pairwise(edges.tolist())]


def _minutes(tasks: Mapping[str, Sequence[Task]]) -> float:
    return sum(len(task.sequence) for own in tasks.values() for task in own) / 1800
