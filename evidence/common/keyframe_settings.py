"""Which settings of choosing keyframes keep most, as people who teach can tell?

Two actors teach, a third is tested; whoever is reported has no part in it.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from evidence.common.queries import (
    Committee,
    Floats,
    Heuristic,
    Lesson,
    Tested,
    by_choosing,
    by_heuristic,
    lessons_of,
    plain_costs,
    preselect,
)
from evidence.common.recordings import ACTORS, Recordings
from evidence.common.streams import PAIRS
from motionary.evaluation import compute_rates_at
from motionary.models.keyframes import ChoiceSettings

Settings = TypeVar("Settings")

HEURISTIC, CHOSEN = "rule of thumb, 2006", "choose_query"
#: Of the publication of 2006, and a looser one.
THRESHOLDS = (0.06, 0.1)
MOST_FRAMES = 0.15
HEURISTICS = {
    f"{count} keyframes, stiffness {stiffness}": Heuristic(count, stiffness)
    for count in (2, 3)
    for stiffness in (0.4, 0.6, 0.8)
}
CHOOSINGS = {
    "as by default": ChoiceSettings(),
    "less left": ChoiceSettings(frames_left=0.01),
    "more left": ChoiceSettings(frames_left=0.05),
    "softer": ChoiceSettings(stiffness=0.4),
    "stiffer": ChoiceSettings(stiffness=0.8),
    "steadier": ChoiceSettings(tolerance=3),
    "no dissenters": ChoiceSettings(exceptions=0.0),
    "more left and softer": ChoiceSettings(frames_left=0.05, stiffness=0.4),
}
Row = dict[str, float]
#: By two actors who teach and a third, what each setting does.
Trials = dict[tuple[str, ...], dict[str, Row]]


def try_settings(recordings: Recordings) -> dict[str, Trials]:
    """What each setting keeps of a third actor when two have taught."""
    trials: dict[str, Trials] = {HEURISTIC: {}, CHOSEN: {}}
    for learners in PAIRS:
        lessons = lessons_of(recordings.of(actors=learners))
        made = {
            HEURISTIC: _make(lessons, by_heuristic, HEURISTICS),
            CHOSEN: _make(lessons, by_choosing, CHOOSINGS),
        }
        for third in (actor for actor in ACTORS if actor not in learners):
            tested = Tested.of(recordings.of(actors=[third]))
            plain = {name: plain_costs(lesson, tested) for name, lesson in lessons.items()}
            for kind, settings in made.items():
                trials[kind][*learners, third] = {
                    setting: summarize_kept(
                        [
                            measure_kept(lessons[name], name, committee, tested, plain[name])
                            for name, committee in committees.items()
                        ]
                    )
                    for setting, committees in settings.items()
                }
    return trials


def _make(
    lessons: Mapping[str, Lesson],
    way: Callable[[Lesson, Settings], Committee],
    settings: Mapping[str, Settings],
) -> dict[str, dict[str, Committee]]:
    """Keyframes of every class by setting."""
    return {
        setting: {name: way(lesson, of) for name, lesson in lessons.items()}
        for setting, of in settings.items()
    }


def best_setting(trials: Trials, known: Sequence[str]) -> str:
    """Setting that keeps most recall among those that leave few enough frames."""
    inner = [rows for key, rows in trials.items() if set(key) == set(known)]

    def merit(setting: str) -> tuple[bool, float, float]:
        row = mean_of([rows[setting] for rows in inner])
        return row["frames"] <= MOST_FRAMES, round(row["kept"], 6), -row["frames"]

    return max(inner[0], key=merit)


def summarize_settings(trials: Trials) -> dict[str, Row]:
    """Means over all who teach and are tested."""
    return {
        setting: mean_of([rows[setting] for rows in trials.values()])
        for setting in next(iter(trials.values()))
    }


def measure_kept(
    lesson: Lesson, name: str, committee: Committee, tested: Tested, plain: Floats
) -> Row:
    """What keyframes leave of the tested clips, and which of them are still found."""
    found = preselect(lesson, committee, tested)
    relevant = np.array([other == name for other in tested.names])
    row: Row = {"frames": found.frames}
    for threshold in THRESHOLDS:
        for key, costs in (("all", plain), ("kept", found.costs)):
            rates = compute_rates_at(costs, relevant, threshold=threshold)
            row[f"recall {key} {threshold}"] = rates.recall
            row[f"precision {key} {threshold}"] = rates.precision
            row[f"f {key} {threshold}"] = rates.f
    return row


def summarize_kept(rows: Sequence[Row]) -> Row:
    """Means over classes, and the share of the recall that is kept at either threshold."""
    mean = mean_of(rows)
    kept = {f"kept {t}": mean[f"recall kept {t}"] / mean[f"recall all {t}"] for t in THRESHOLDS}
    return mean | kept | {"kept": min(kept.values())}


def mean_of(rows: Sequence[Row]) -> Row:
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}
