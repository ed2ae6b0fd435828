"""Keyframes chosen automatically and by hand: what they keep, and what they leave.

Table 3 of Müller and Röder (2006), for two actors that nothing was learned from. Settings are
chosen on the other three alone: two train, the third is tested.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from evidence.common.drawing import BLACK, BLUE, ORANGE, RULE, VERMILLION, house_style, new_figure
from evidence.common.pages import called, means
from evidence.common.queries import (
    ANNOTATION_2009,
    RETRIEVAL_2008,
    Committee,
    Heuristic,
    Lesson,
    Tested,
    Trial,
    by_choosing,
    by_heuristic,
    by_learning,
    index_of,
    lessons_of,
    manual,
)
from evidence.common.recordings import ACTORS, EVERYTHING, Recordings, Results
from evidence.common.streams import PAIRS
from motionary.models.keyframes import ChoiceSettings, KeyframeQuery, PostingIndex, select_in_index

TITLE = "Keyframes chosen automatically and by hand, beside table 3 of 2006"
SPLIT = (
    "each of the ten pairs of actors is unseen in turn, the other three train; settings are "
    "chosen on these three alone, two training and one tested in turn"
)
SEED = 0
DATA = EVERYTHING

LEAST_RECALL = 0.9

HEURISTIC, CHOSEN = "rule of thumb, 2006", "choose_query"
#: Of the publication of 2006, and a looser one.
THRESHOLDS = (0.06, 0.1)
MOST_FRAMES = 0.15
SETTINGS: dict[str, dict[str, Any]] = {
    HEURISTIC: {
        f"{count} keyframes, stiffness {stiffness}": Heuristic(count, stiffness)
        for count in (2, 3)
        for stiffness in (0.4, 0.6, 0.8)
    },
    CHOSEN: {
        "as by default": ChoiceSettings(),
        "less left": ChoiceSettings(frames_left=0.01),
        "more left": ChoiceSettings(frames_left=0.05),
        "softer": ChoiceSettings(stiffness=0.4),
        "stiffer": ChoiceSettings(stiffness=0.8),
        "steadier": ChoiceSettings(tolerance=3),
        "no dissenters": ChoiceSettings(exceptions=0.0),
        "more left and softer": ChoiceSettings(frames_left=0.05, stiffness=0.4),
    },
}
Row = dict[str, float]
#: By two actors who train and a third, what each setting does.
Trials = dict[tuple[str, ...], dict[str, Row]]

MANUAL = {"by hand, 2008": RETRIEVAL_2008, "by hand, 2009": ANNOTATION_2009}
LEARNED = "bred, 3 of 5 agree"
WAYS = (HEURISTIC, CHOSEN, LEARNED, *MANUAL)


def measure(recordings: Recordings) -> Results:
    """Settings on a third actor; and per pair of unseen ones, what the others' choice does."""
    trials = try_settings(recordings)
    elsewhere = index_of(list(recordings.others.values()))
    by_hand = {way: manual(recordings, name) for way, name in MANUAL.items()}
    pairs: list[dict[str, Any]] = []
    classes: dict[str, dict[str, list[Row]]] = {
        way: {name: [] for name in recordings.classes} for way in WAYS
    }
    for pair in PAIRS:
        known = [actor for actor in ACTORS if actor not in pair]
        chosen = {kind: best_setting(rows, known) for kind, rows in trials.items()}
        tested = Tested.of(recordings.of(actors=pair))
        for name, lesson in lessons_of(recordings.of(actors=known)).items():
            trial = Trial(name, lesson.template, tested)
            for way, committee in _committees(lesson, name, chosen, by_hand).items():
                row = trial.kept(committee, THRESHOLDS)
                classes[way][name].append(row | _beyond(lesson, committee, elsewhere))
        ways = {way: summarize([rows[-1] for rows in classes[way].values()]) for way in WAYS}
        pairs.append({"unseen": list(pair), "settings": chosen, "ways": ways})
    return {
        "settings": {
            kind: {s: means(row[s] for row in rows.values()) for s in SETTINGS[kind]}
            for kind, rows in trials.items()
        },
        "pairs": pairs,
        "classes": {
            way: {name: means(rows) for name, rows in by_name.items()}
            for way, by_name in classes.items()
        },
        "shares": _fractions(recordings),
    }


def try_settings(recordings: Recordings) -> dict[str, Trials]:
    """What each setting keeps of a third actor when two have trained."""
    trials: dict[str, Trials] = {HEURISTIC: {}, CHOSEN: {}}
    makers: dict[str, Callable[[Lesson, Any], Committee]] = {
        HEURISTIC: by_heuristic, CHOSEN: by_choosing
    }  # fmt: skip
    for trainers in PAIRS:
        lessons = lessons_of(recordings.of(actors=trainers))
        made = {
            (kind, setting): {name: make(lesson, of) for name, lesson in lessons.items()}
            for kind, make in makers.items()
            for setting, of in SETTINGS[kind].items()
        }
        for third in (actor for actor in ACTORS if actor not in trainers):
            tested = Tested.of(recordings.of(actors=[third]))
            trial = {name: Trial(name, one.template, tested) for name, one in lessons.items()}
            for (kind, setting), committees in made.items():
                rows = [trial[name].kept(own, THRESHOLDS) for name, own in committees.items()]
                trials[kind].setdefault((*trainers, third), {})[setting] = summarize(rows)
    return trials


def best_setting(trials: Trials, known: Sequence[str]) -> str:
    """Setting that keeps most recall among those that leave few enough frames."""
    inner = [rows for key, rows in trials.items() if set(key) == set(known)]

    def merit(setting: str) -> tuple[bool, float, float]:
        row = means(rows[setting] for rows in inner)
        return row["frames"] <= MOST_FRAMES, round(row["kept"], 6), -row["frames"]

    return max(inner[0], key=merit)


def summarize(rows: Sequence[Row]) -> Row:
    """Means over classes, and the fraction of the recall that is kept at either threshold."""
    mean = means(rows)
    kept = {f"kept {t}": mean[f"recall kept {t}"] / mean[f"recall all {t}"] for t in THRESHOLDS}
    return mean | kept | {"kept": min(kept.values())}


def _committees(
    lesson: Lesson,
    name: str,
    chosen: Mapping[str, str],
    by_hand: Mapping[str, Mapping[str, KeyframeQuery]],
) -> dict[str, Committee]:
    return {
        HEURISTIC: by_heuristic(lesson, SETTINGS[HEURISTIC][chosen[HEURISTIC]]),
        CHOSEN: by_choosing(lesson, SETTINGS[CHOSEN][chosen[CHOSEN]]),
        LEARNED: by_learning(lesson, seed=SEED),
        **{way: Committee((queries[name],)) for way, queries in by_hand.items()},
    }


def _beyond(lesson: Lesson, committee: Committee, elsewhere: PostingIndex) -> Row:
    """Fraction of the frames of other recordings that keyframes leave; their number."""
    windows = select_in_index(
        committee.queries, lesson.template.n_columns, elsewhere, votes=committee.votes
    )
    return {
        "elsewhere": windows.n_frames / elsewhere.n_frames,
        "keyframes": float(np.mean([len(query) for query in committee.queries])),
    }


def _fractions(recordings: Recordings) -> dict[str, float]:
    """Fraction of the clips' frames that each class has."""
    total = sum(len(clip.packed) for clip in recordings.clips)
    return {
        name: sum(len(c.packed) for c in recordings.of(motion_class=name)) / total
        for name in recordings.classes
    }


@house_style()
def draw(results: Results) -> dict[str, Any]:
    """Recall kept against frames left."""
    shown = (HEURISTIC, CHOSEN, LEARNED, "by hand, 2009")
    figure, axes = new_figure(1, len(shown), (8.4, 2.6), sharey=True, sharex=True)
    for ax, way, color in zip(axes, shown, (VERMILLION, BLUE, ORANGE, BLACK), strict=True):
        rows = results["classes"][way].values()
        kept = [row["recall kept 0.1"] / row["recall all 0.1"] for row in rows]
        ax.plot([100 * row["frames"] for row in rows], kept, "o", markersize=4, color=color)
        ax.axhline(LEAST_RECALL, color=RULE, linewidth=0.8, linestyle="--", zorder=0)
        ax.axvline(100 * MOST_FRAMES, color=RULE, linewidth=0.8, linestyle="--", zorder=0)
        ax.set_title(called(way), loc="left", pad=3)
        ax.set(xlabel="frames left, %", xlim=(0, 26), ylim=(0, 1.04))
    axes[0].set_ylabel("recall kept")
    return {"keyframe_choice": figure}
