"""What some minutes of corrected labels teach, tried on people whom nobody corrected.

Repetitions of ten exercises (UI-PRMD) stand in any order between walking and other everyday
motion (CMU), a stream of six to eight minutes a person. A library labels the stream of one
person, its labels are replaced by the true ones, as a person would correct them, and it learns
from that. It then labels the streams of the other people. A label is right if it overlaps one
of its class by half, one to one.
"""

import csv
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from evidence.common.recordings import Recordings, Results, join
from motionary.batch import Failure
from motionary.evaluation import Counts, LabelledSegment, compute_rates, pool_counts
from motionary.evaluation.segments import count_matches
from motionary.features import FeatureSequence, read_features
from motionary.io import name_recordings
from motionary.labels import Label, LabelTrack, compare_labels
from motionary.models.library import ClassLibrary, learn
from motionary.retrieval.annotation import annotate
from motionary.retrieval.corrections import Corrected, learn_corrections

TITLE = "What corrections teach"
SPLIT = (
    "how corrections are learned was chosen on s01 to s04 of UI-PRMD; libraries are learned from "
    "s01, or from s01 to s04; of s05 to s08 each is corrected once, the other three are labelled"
)
SEED = 22

TEACHERS = {"one person": ("s01",), "four people": ("s01", "s02", "s03", "s04")}
REPORTED = ("s05", "s06", "s07", "s08")
#: Repetitions of each exercise that a library of several people learns of each of them.
_REPETITIONS = 5
#: CMU's people whose motion may be looked at while choosing.
_CHOSEN_ON = ("02", "05", "07", "16", "35")
_PIECE = 150
_HZ = 30.0
_IOU = 0.5

UI_PRMD = (
    "UI-PRMD, Vakanski et al., A Data Set of Human Body Movements for Physical Rehabilitation "
    "Exercises, Data 3(1):2, 2018 (PDDL 1.0): ten exercises of eight people"
)
CMU = (
    "CMU Graphics Lab Motion Capture Database, mocap.cs.cmu.edu, funded by NSF EIA-0196217: "
    "everyday motion of people that nothing was chosen on"
)


def _repetitions_of(recordings: Recordings) -> list[FeatureSequence]:
    return list(_read_exercises(recordings.folder).values())


def _others_of(recordings: Recordings) -> list[FeatureSequence]:
    return _read_others(recordings.folder)


DATA = ((UI_PRMD, _repetitions_of), (CMU, _others_of))


@cache
def _read_exercises(folder: Path) -> dict[str, FeatureSequence]:
    names = sorted({row["recording"] for row in _rows(folder)})
    return _read(folder / "ui_prmd", names)


@cache
def _read_others(folder: Path) -> list[FeatureSequence]:
    everyday = folder / "cmu_everyday"
    names = [name for name in name_recordings(everyday) if Path(name).name[:2] not in _CHOSEN_ON]
    return list(_read(everyday, names).values())


def _read(folder: Path, names: Sequence[str]) -> dict[str, FeatureSequence]:
    found = {}
    for name, item in zip(names, read_features([(n, folder / n) for n in names]), strict=True):
        if isinstance(item, Failure):
            raise item.error
        found[name] = item
    return found


def _rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "ui_prmd" / "repetitions.csv").open(encoding="utf-8", newline="") as file:
        return [row for row in csv.DictReader(file) if row["recording"].startswith("correct/")]


def repetitions(folder: Path, person: str) -> list[tuple[str, FeatureSequence]]:
    """Repetitions of a person with their exercises, in the sequence of the table."""
    sequences = _read_exercises(folder)
    found = []
    for row in _rows(folder):
        sequence = sequences[row["recording"]]
        if f"_{person}." in row["recording"]:
            start, stop = (round(float(row[key]) * _HZ) for key in ("start_s", "end_s"))
            found.append((row["label"], sequence.part(start, min(stop, len(sequence)))))
    return found


def make_stream(folder: Path, person: str) -> Corrected:
    """A person's repetitions between other motion, and where they are."""
    rng = np.random.default_rng([SEED, int(person[1:])])
    own = repetitions(folder, person)
    pieces = [
        one.part(start, min(start + _PIECE, len(one)))
        for one in _read_others(folder)
        for start in range(0, len(one) - _PIECE // 2, _PIECE)
    ]
    others = iter([pieces[i] for i in rng.permutation(len(pieces))])
    labels, parts, at, between = [], [], 0, 0
    for i in rng.permutation(len(own)):
        name, part = own[i]
        labels.append(Label(name, at / _HZ, (at + len(part)) / _HZ))
        parts.append(part)
        at += len(part)
        while between < at / 2 and (piece := next(others, None)) is not None:
            parts.append(piece)
            at, between = at + len(piece), between + len(piece)
    sequence = join(parts, person)
    return LabelTrack(sequence.recording, tuple(labels)), sequence


def teach(folder: Path, people: Sequence[str]) -> ClassLibrary:
    """A library of the exercises of some people, with mirror images."""
    examples: dict[str, list[FeatureSequence]] = {}
    for person in people:
        taken: dict[str, int] = {}
        for name, part in repetitions(folder, person):
            taken[name] = taken.get(name, 0) + 1
            if len(people) == 1 or taken[name] <= _REPETITIONS:
                examples.setdefault(name, []).append(part)
    return learn(examples, mirror=True)


def measure(recordings: Recordings) -> Results:
    """Each library before, and after the corrections of each person."""
    folder = recordings.folder
    streams = {person: make_stream(folder, person) for person in REPORTED}
    rows: list[dict[str, Any]] = []
    for taught, people in TEACHERS.items():
        library = teach(folder, people)
        before = {person: annotate(stream[1], library) for person, stream in streams.items()}
        for person, stream in streams.items():
            came = learn_corrections(library, [stream], estimate=False).library
            others = [other for other in REPORTED if other != person]
            own = compare_labels(before[person], stream[0])
            row = {
                "taught": taught,
                "corrected": person,
                "minutes": round(len(stream[1]) / _HZ / 60, 1),
                "changed": sum(change.kind != "kept" for change in own),
                "before": _rates([(before[one], streams[one][0]) for one in others]),
                "after": _rates(
                    [(annotate(streams[one][1], came), streams[one][0]) for one in others]
                ),
            }
            rows.append(row)
    return {"rows": rows, "means": {name: _mean(rows, name) for name in TEACHERS}}


def _rates(pairs: Sequence[tuple[LabelTrack, LabelTrack]]) -> list[float]:
    """Precision, recall and F over several streams."""
    counts: list[Counts] = []
    for found, true in pairs:
        segments = [
            [LabelledSegment(x.name, x.start_s, x.end_s) for x in one] for one in (found, true)
        ]
        counts += count_matches(*segments, iou=_IOU).values()
    return [round(x, 4) for x in compute_rates(pool_counts(counts))]


def _mean(rows: Sequence[dict[str, Any]], taught: str) -> dict[str, list[float]]:
    own = [row for row in rows if row["taught"] == taught]
    return {
        when: [round(float(x), 4) for x in np.mean([row[when] for row in own], axis=0)]
        for when in ("before", "after")
    }
