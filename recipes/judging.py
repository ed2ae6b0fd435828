"""Labels of people who taught nothing, judged: what the library that ships promises.

People are dealt into folds; each fold is labelled by a library learned without it. What a
recording shows is known by its class, its exercise or CMU's description; every other label
is false. Recordings of other motion (swords, washing, dance, climbing) are among them.
"""

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from motionary.batch import Failure, map_ordered
from motionary.features import SEQUENCE_HZ, FeatureSequence
from motionary.models.library import (
    Candidates,
    ClassLibrary,
    JudgedLabel,
    choose_candidates,
    find_candidates,
    join_matches,
    lowest_scores,
)
from recipes.sources import (
    CLIPS,
    EXERCISES,
    FOLDERS,
    GAITS,
    SIT_TO_STAND,
    Sources,
    person_of,
    read_rows,
)

N_FOLDS = 5
#: What recordings show besides what they are called after, or by CMU's descriptions.
SHOWN: Mapping[str, tuple[str, ...]] = {
    "walk": ("walk",),
    "run/jog": ("run",),
    "jump, balance": ("jump", "hop"),
    "dance - cartwheel-like start, pirouettes, jete": ("cartwheel", "turn around", "jump"),
    "dance - small jetes, attitude/arabesque, shifted-axis pirouette, turn": (
        "turn around", "jump",
    ),
    "playground - climb, sit, dangle legs, descend": ("sit down",),
    "playground - climb, hang, hold self up with arms straight, swing, drop, sit, dangle legs, "
    "go under": ("sit down", "crouch"),
    "bend over, scoop up, rise, lift arm": (
        "pick up", "put down", "crouch", "rise from crouch", "reach up",
    ),
    "playground - climb, go under, jump down": ("jump", "crouch"),
    SIT_TO_STAND: ("sit down", "stand up"),
    "sneak": ("sneak", "walk"),
    "put down": ("put down", "pick up", "crouch", "rise from crouch"),
    "lie down": ("lie down", "sit down", "crouch", "lie"),
    "squat": ("squat", "crouch", "rise from crouch"),
    "elbow to knee": ("elbow to knee", "knee raise"),
}  # fmt: skip


class Judged(NamedTuple):
    """A recording of a person who taught nothing, and its labels.

    Attributes
    ----------
    part : folder that it is from
    person : who moves
    shows : what it is of
    asked : class that it shows; empty where it has none of the library's
    minutes : its length
    free_minutes : what of it no right label covers
    labels : from the lowest scores on
    """

    part: str
    person: str
    shows: str
    asked: str
    minutes: float
    free_minutes: float
    labels: tuple[JudgedLabel, ...]


class Held(NamedTuple):
    """A recording to be judged."""

    part: str
    person: str
    shows: str
    sequence: FeatureSequence


def judge_people(
    sources: Sources,
    build: partial[ClassLibrary],
    *,
    without: Collection[str] = (),
    jobs: int = 1,
) -> list[Judged]:
    """Every recording of the people that are learned from, labelled without them.

    Parameters
    ----------
    build : library of the sources, called with `without`
    without : people who are left out of everything
    """
    held = [one for one in list_held(sources) if one.person not in without]
    folds = deal_people(held)
    work = partial(_judge_fold, held=held, build=build, without=tuple(without))
    found: list[Judged] = []
    for judged in map_ordered(work, folds, jobs=jobs):
        if isinstance(judged, Failure):
            raise judged.error
        found += judged
    return found


def deal_people(held: Sequence[Held]) -> list[tuple[str, ...]]:
    """Folds of people, those of each folder spread evenly."""
    folds: list[list[str]] = [[] for _ in range(N_FOLDS)]
    at = 0
    for part in FOLDERS:
        for person in sorted({one.person for one in held if one.part == part}):
            folds[at % N_FOLDS].append(person)
            at += 1
    return [tuple(fold) for fold in folds if fold]


def list_held(sources: Sources) -> list[Held]:
    """All recordings, and what each shows."""
    rows = read_rows(sources.folder / "ui_prmd" / "repetitions.csv")
    exercise = {row["recording"]: row["label"] for row in rows}
    takes = read_rows(sources.folder / "cmu_everyday" / "descriptions.csv")
    described = {f"{row['trial']}.amc": row["description"] for row in takes}
    found = []
    for part in FOLDERS:
        for name, sequence in sorted(sources.sequences[part].items()):
            if part == "hdm05":
                clip = name.split("/")[0]
                shows = CLIPS.get(clip) or GAITS[clip][0]
            elif part == "ui_prmd":
                shows = EXERCISES.get(exercise[name], exercise[name])
            else:
                shows = described[name]
            found.append(Held(part, person_of(part, name), shows, sequence))
    return found


def judge(
    found: Candidates,
    library: ClassLibrary,
    allowed: Collection[str],
    *,
    least: ArrayLike,
    n_frames: int,
) -> tuple[list[JudgedLabel], float]:
    """Labels of some least scores on, and minutes that no right one covers.

    Those of other classes than the allowed are false.
    """
    chosen = choose_candidates(found, library, threshold=least)
    judged, free = [], np.ones(n_frames, dtype=np.bool_)
    for members in join_matches(found, library, chosen, threshold=least):
        matches = chosen[members]
        name = library.names[int(found.classes[matches[0]])]
        judged.append(JudgedLabel(name, float(found.paths.scores[matches].max()), name in allowed))
        if name in allowed:
            free[found.paths.starts[matches].min() : found.paths.stops[matches].max()] = False
    return judged, float(free.sum()) / SEQUENCE_HZ / 60


def _judge_fold(
    fold: tuple[str, ...],
    *,
    held: Sequence[Held],
    build: partial[ClassLibrary],
    without: tuple[str, ...],
) -> list[Judged]:
    library = build(without=(*without, *fold))
    found = []
    for one in held:
        if one.person in fold:
            allowed = SHOWN.get(one.shows, (one.shows,))
            asked = allowed[0] if allowed[0] in library.names else ""
            matches = find_candidates(one.sequence, library)
            labels, free = judge(
                matches, library, allowed,
                least=lowest_scores(library), n_frames=len(one.sequence),
            )  # fmt: skip
            minutes = len(one.sequence) / SEQUENCE_HZ / 60
            found.append(
                Judged(one.part, one.person, one.shows, asked, minutes, free, tuple(labels))
            )
    return found
