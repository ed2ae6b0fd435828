"""Examples of the library that ships: who does what in which recording.

HDM05 has clips of a class each, UI-PRMD recordings with a table of repetitions, CMU whole
takes with a sentence each. Walking and running are cut into gait cycles: from one onset
of "right foot behind left leg" to the next.
"""

import csv
import hashlib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from motionary.batch import Failure
from motionary.errors import InvalidInput
from motionary.features import FeatureSequence, read_features
from motionary.io import name_recordings

#: Folders that may be learned from.
FOLDERS = ("hdm05", "ui_prmd", "cmu_everyday")
#: Classes of clips, by their folders.
CLIPS = {
    "kickLFront1Reps": "kick",
    "throwBasketball": "throw",
    "squat1Reps": "squat",
    "hopBothLegs1hops": "jump",
    "elbowToKnee1RepsLelbowStart": "elbow to knee",
    "grabHighR": "reach up",
    "depositFloorR": "put down",
    "lieDownFloor": "lie down",
    "rotateArmsBothBackward1Reps": "arm circles",
    "sneak2StepsLStart": "sneak",
}
#: Classes of gait by their clips, and shortest and longest cycle in frames.
GAITS = {"jogLeftCircle4StepsRstart": ("run", 14, 40)}
WALKING = ("walk", 18, 60)
#: Classes of repetitions, by the table's names.
EXERCISES = {
    "deep squat": "squat",
    "hurdle step": "knee raise",
    "inline lunge": "lunge",
    "side lunge": "side lunge",
    "standing active straight leg raise": "leg raise",
    "standing shoulder abduction": "arm raise sideways",
    "standing shoulder scaption": "arm raise forward",
    "standing shoulder extension": "arm raise backward",
    "standing shoulder internal-external rotation": "forearm rotation",
}
#: Its repetitions hold two classes: up to the middle of standing, and from there.
SIT_TO_STAND = "sit to stand"
REPETITIONS = (2, 5, 8)
#: Examples of one person and class at most, evenly taken.
MOST_EXAMPLES = 4

_BEHIND, _RIGHT_KNEE, _LEFT_KNEE = 14, 19, 20
_HZ = 30.0


class Example(NamedTuple):
    """One performance of a class by one person."""

    name: str
    person: str
    sequence: FeatureSequence


@dataclass(frozen=True)
class Sources:
    """Features of all recordings that may be learned from.

    Attributes
    ----------
    folder : where the files are
    sequences : by folder and recording
    """

    folder: Path
    sequences: Mapping[str, Mapping[str, FeatureSequence]]


def read_sources(folder: Path, *, jobs: int = 1) -> Sources:
    """Read everything once."""
    read: dict[str, dict[str, FeatureSequence]] = {}
    for part in FOLDERS:
        files = [
            (name, path)
            for name, path in name_recordings(folder / part).items()
            if not name.startswith("incorrect/")
        ]
        read[part] = {}
        for (name, _), item in zip(files, read_features(files, jobs=jobs), strict=True):
            if isinstance(item, Failure):
                raise item.error
            read[part][name] = item
    return Sources(folder, read)


def person_of(part: str, name: str) -> str:
    """Who a recording is of, by its name."""
    file = name.rsplit("/", 1)[-1]
    return file[:2] if part == "cmu_everyday" else file.split("_")[1].split(".")[0]


def hdm05_examples(sources: Sources, without: Collection[str] = ()) -> list[Example]:
    """Clips of HDM05, some of each person and class."""
    found = []
    for name, sequence in sorted(sources.sequences["hdm05"].items()):
        person, kind = person_of("hdm05", name), name.split("/")[0]
        if person in without:
            continue
        if kind in CLIPS:
            found.append(Example(CLIPS[kind], person, sequence))
        else:
            called, shortest, longest = GAITS[kind]
            found += [
                Example(called, person, sequence.part(start, stop))
                for start, stop in find_cycles(sequence, shortest, longest)
            ]
    return thin_out(found)


def exercise_examples(sources: Sources, without: Collection[str] = ()) -> list[Example]:
    """Some repetitions of UI-PRMD by each person."""
    found = []
    for row in read_rows(sources.folder / "ui_prmd" / "repetitions.csv"):
        sequence = sources.sequences["ui_prmd"].get(row["recording"])
        person = person_of("ui_prmd", row["recording"])
        wanted = int(row["repetition"]) - 1 in REPETITIONS and person not in without
        if sequence is None or not wanted:
            continue
        start, stop = (round(float(row[key]) * _HZ) for key in ("start_s", "end_s"))
        part = sequence.part(start, min(stop, len(sequence)))
        if row["label"] in EXERCISES:
            found.append(Example(EXERCISES[row["label"]], person, part))
        elif row["label"] == SIT_TO_STAND:
            middle = middle_of_standing(part)
            found.append(Example("stand up", person, part.part(0, middle)))
            found.append(Example("sit down", person, part.part(middle, len(part))))
    return found


def walk_examples(sources: Sources, without: Collection[str] = ()) -> list[Example]:
    """Gait cycles of CMU's walks."""
    called, shortest, longest = WALKING
    walks = takes_of(sources, "walk", without)
    return thin_out(
        Example(called, person_of("cmu_everyday", one.source), one.part(start, stop))
        for one in walks
        for start, stop in find_cycles(one, shortest, longest)
    )


def run_examples(sources: Sources, without: Collection[str] = ()) -> list[Example]:
    """Gait cycles of CMU's run."""
    called, shortest, longest = GAITS["jogLeftCircle4StepsRstart"]
    return thin_out(
        Example(called, person_of("cmu_everyday", one.source), one.part(start, stop))
        for one in takes_of(sources, "run/jog", without)
        for start, stop in find_cycles(one, shortest, longest)
    )


def takes_of(
    sources: Sources, description: str | None, without: Collection[str] = ()
) -> list[FeatureSequence]:
    """CMU's takes of a description; without one, all that are no walk."""
    rows = read_rows(sources.folder / "cmu_everyday" / "descriptions.csv")
    return [
        sources.sequences["cmu_everyday"][f"{row['trial']}.amc"]
        for row in rows
        if row["subject"] not in without
        and (row["description"] == description if description else row["description"] != WALKING[0])
    ]


def find_cycles(sequence: FeatureSequence, shortest: int, longest: int) -> list[tuple[int, int]]:
    """Gait cycles of plausible length, in frames."""
    behind = sequence.features[:, _BEHIND].astype(bool)
    onsets: list[int] = []
    for frame in (np.flatnonzero(behind[1:] & ~behind[:-1]) + 1).tolist():
        # The feature flickers at its threshold.
        if not onsets or frame - onsets[-1] >= 6:
            onsets.append(frame)
    return [(a, b) for a, b in pairwise(onsets) if shortest <= b - a <= longest]


def middle_of_standing(sequence: FeatureSequence) -> int:
    """Middle of the frames in which both knees are straight; of all frames if there are none."""
    bits = sequence.features
    straight = np.flatnonzero((bits[:, _RIGHT_KNEE] == 0) & (bits[:, _LEFT_KNEE] == 0))
    middle = int(np.median(straight)) if len(straight) else len(sequence) // 2
    return min(max(middle, len(sequence) // 4), 3 * len(sequence) // 4)


def thin_out(examples: Iterable[Example]) -> list[Example]:
    """At most `MOST_EXAMPLES` of a class and person, evenly taken."""
    by_key: dict[tuple[str, str], list[Example]] = {}
    for one in examples:
        by_key.setdefault((one.name, one.person), []).append(one)
    kept = []
    for own in by_key.values():
        places = np.linspace(0, len(own) - 1, min(MOST_EXAMPLES, len(own))).round().astype(int)
        kept += [own[i] for i in np.unique(places)]
    return kept


def read_rows(path: Path) -> list[dict[str, str]]:
    """Rows of a table."""
    with path.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def hash_files(sources: Sources, parts: Collection[str], without: Collection[str]) -> list[str]:
    """Lines "sha256  folder/recording" of everything that is learned from."""
    lines = []
    for part in parts:
        files = name_recordings(sources.folder / part)
        for name in sorted(sources.sequences[part]):
            if person_of(part, name) not in without:
                digest = hashlib.sha256(files[name].read_bytes()).hexdigest()
                lines.append(f"{digest}  {part}/{name}")
    if not lines:
        raise InvalidInput("nothing is left to learn from; name fewer people")
    return lines
