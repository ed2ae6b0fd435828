"""Labels of recordings that people have labelled, and what each false label is."""

from collections.abc import Mapping, Sequence
from typing import Any

from evidence.common.drawing import Panel, draw_panels
from evidence.common.labelling import (
    Found,
    Labelled,
    Setting,
    Task,
    Tasks,
    best_of,
    curve_of,
    find_all,
    label_all,
    label_by_scores,
    learn_all,
    merit,
    tasks_of,
)
from evidence.common.labelling import measure as measure_labels
from evidence.common.recordings import (
    ACTORS,
    LABELLED,
    NAMES,
    UNSEEN,
    Clip,
    Recordings,
    Results,
    examples,
)
from evidence.common.streams import CHOOSING, make_streams, negatives
from motionary.evaluation import LabelledSegment, rename_segments, to_segments
from motionary.io import read_labels
from motionary.models.library import TrainingOptions, calibrate_thresholds
from motionary.plots import plot_sheet

TITLE = "Labels of recordings that people have labelled"
SPLIT = (
    "clips of four actors train, the fifth and CMU are labelled; thresholds are chosen on "
    "streams in which none of the four recordings is"
)
SEED = 12
DATA = (
    "clips",
    ("four recordings of HDM05 and {cmu}, with {truth}", lambda r: [r.others[n] for n in LABELLED]),
)

THRESHOLDS = (0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12, 0.13)
MOST = THRESHOLDS[-1]
SELF_INFORMATION, EQUAL = "by surprise", "all alike"
WAYS = {
    SELF_INFORMATION: Setting(mirrored=True),
    EQUAL: Setting(mirrored=True, by_self_information=False),
}
#: What each false label shows, looked at as stick figures: recording, label, about which
#: second (that in which it begins).
_BOXING, _TAKE = "cmu/86_01.amc", "hdm05_takes/HDM_bd_03-03_01_120.amc"
LOOKED_AT: dict[tuple[str, str, int], str] = {
    (_BOXING, "throwR", 18): "boxes: left, then right fist forward; the truth says punch, "
    "which was not trained",
    (_BOXING, "move", 31): "a kick of the right foot to the front, from a stance with one foot "
    "before the other and back into it: a jog's steps without the way",
    (_BOXING, "throwR", 35): "boxes, as at 18 s; the truth says punch",
    (_TAKE, "throwR", 14): "throws a ball with both hands from above the head: the very motion "
    "of which a clip of throwBasketball was cut. The truth calls throws of the right hand "
    "throwR, and not this one: the mapping is wrong, not the label",
    (_TAKE, "jump", 19): "a leap off one foot, knee raised, in the run-up to a far throw; "
    "the truth has no name for it",
    (_TAKE, "kick", 22): "walks two steps, then stands stooped with the head bowed: noise",
    (_TAKE, "throwR", 23): "straightens up and lifts both arms into a T-pose; the truth says "
    "tpose, which was not trained",
}


def measure(recordings: Recordings) -> Results:
    """Labels of the four recordings, by threshold, and what is false."""
    clips = recordings.of(actors=set(ACTORS) - {UNSEEN})
    tasks, everyone = (_tasks(recordings, own) for own in (clips, recordings.clips))
    chosen = {way: _choose(recordings, setting) for way, setting in WAYS.items()}
    found = {way: find_all(tasks, setting, most=MOST) for way, setting in WAYS.items()}
    by_all = find_all(everyone, WAYS[SELF_INFORMATION], most=MOST)
    longer = {
        way: find_all(tasks, setting._replace(to_plateau_end=True), most=MOST)
        for way, setting in WAYS.items()
    }
    calibrated = {
        "told from each other": _calibrate(clips, []),
        "told from other recordings too": _calibrate(clips, negatives(recordings)),
    }
    curves = {way: {t: _label(tasks, own, t) for t in THRESHOLDS} for way, own in found.items()}
    measured = {
        way: {t: measure_labels(own.values()) for t, own in curve.items()}
        for way, curve in curves.items()
    }
    by_class = {
        name: _label(tasks, found[SELF_INFORMATION], own) for name, own in calibrated.items()
    }
    seen_best = best_of(measured[SELF_INFORMATION])
    scored = _rename(label_by_scores(tasks))
    one = {way: curves[way][chosen[way]] for way in WAYS}
    return {
        "thresholds": THRESHOLDS,
        "chosen": chosen,
        "curves": {way: list(curve.values()) for way, curve in measured.items()},
        "one": {way: measured[way][chosen[way]] for way in WAYS},
        "scores": measure_labels(scored.values()),
        "scores_by_recording": {name: measure_labels([own]) for name, own in scored.items()},
        "everyone": measure_labels(_label(tasks, by_all, chosen[SELF_INFORMATION]).values()),
        "to_plateau_end": {
            way: measure_labels(_label(tasks, longer[way], chosen[way]).values()) for way in WAYS
        },
        "suggested": {name: measure_labels(own.values()) for name, own in by_class.items()},
        "suggested_thresholds": calibrated,
        "trivial": _trivial(tasks),
        "seconds": {name: task.seconds for name, task in tasks.items()},
        "recordings": {
            way: {name: measure_labels([own]) for name, own in labelled.items()}
            for way, labelled in one.items()
        },
        "false": _false(
            {
                **one,
                "per class": by_class["told from other recordings too"],
                f"{SELF_INFORMATION}, τ = {seen_best:g}": curves[SELF_INFORMATION][seen_best],
            }
        ),
        "loosened": seen_best,
        "missed": {way: _missed(labelled) for way, labelled in one.items()},
    }


def _tasks(recordings: Recordings, clips: Sequence[Clip]) -> dict[str, Task]:
    """The recordings, with the labels of the authors that clips' classes belong to."""
    tables = read_labels(recordings.folder / "truth" / "annotation_2009.csv")
    known, learned = set(NAMES.values()), learn_all(clips)
    return {
        name: Task(
            recordings.others[name],
            [s for s in to_segments(tables[row], where=row) if s.name in known],
            clips,
            learned,
        )
        for name, row in LABELLED.items()
    }


def _choose(recordings: Recordings, setting: Setting) -> float:
    """Threshold with the best mean of F1 and F2 on streams that hold none of the recordings."""
    without = tuple(LABELLED)
    streams = {p: make_streams(recordings, p, seed=SEED, without=without) for p in CHOOSING}
    tasks = tasks_of(recordings, streams)
    return best_of(curve_of(tasks, find_all(tasks, setting, most=MOST), THRESHOLDS))


def _calibrate(clips: Sequence[Clip], others: Sequence[Any]) -> dict[str, float]:
    calibrations = calibrate_thresholds(
        examples(clips), negatives=others, training=TrainingOptions(mirror=True, groups="HDM_(..)_")
    )
    return {name: one.threshold for name, one in calibrations.items()}


def _label(
    tasks: Tasks, found: Found, thresholds: float | Mapping[str, float]
) -> dict[str, Labelled]:
    """Labels by costs, under the names of the truth."""
    return _rename(label_all(tasks, found, thresholds))


def _rename(labelled: Mapping[str, Labelled]) -> dict[str, Labelled]:
    return {
        name: own._replace(predicted=rename_segments(own.predicted, NAMES))
        for name, own in labelled.items()
    }


def _trivial(tasks: Tasks) -> Results:
    """No labels at all, and the most frequent class from end to end."""
    lengths: dict[str, float] = {}
    for task in tasks.values():
        for s in task.truth:
            lengths[s.name] = lengths.get(s.name, 0.0) + s.end - s.start
    most = max(sorted(lengths), key=lambda name: lengths[name])
    everywhere = [
        Labelled([LabelledSegment(most, 0.0, one.seconds)], one.truth, one.seconds)
        for one in tasks.values()
    ]
    nothing = [Labelled([], one.truth, one.seconds) for one in tasks.values()]
    return {
        "most": most,
        "everywhere": measure_labels(everywhere),
        "nothing": measure_labels(nothing),
    }


def _overlaps(a: LabelledSegment, b: LabelledSegment) -> bool:
    return min(a.end, b.end) > max(a.start, b.start) + 1e-6


def _false(ways: Mapping[str, Mapping[str, Labelled]]) -> list[Results]:
    """Labels that overlap no true one, in any of some ways to label."""
    rows: list[tuple[LabelledSegment, Results]] = []
    for way, labelled in ways.items():
        for name, own in labelled.items():
            for x in own.predicted:
                there = [t for t in own.truth if _overlaps(t, x)]
                if any(t.name == x.name for t in there):
                    continue
                row: Results = {
                    "recording": name, "label": x.name, "start": x.start, "end": x.end,
                    "cost": x.cost, "truth": sorted({t.name for t in there}), "ways": [],
                }  # fmt: skip
                same = (r for s, r in rows if _same(r, row) and _overlaps(s, x))
                known = next(same, row)
                if known is row:
                    rows.append((x, row))
                known["ways"] += [] if way in known["ways"] else [way]
    return sorted(
        (row for _, row in rows), key=lambda row: (row["recording"], row["start"], row["label"])
    )


def _same(a: Results, b: Results) -> bool:
    return (a["recording"], a["label"]) == (b["recording"], b["label"])


def _missed(labelled: Mapping[str, Labelled]) -> list[list[Any]]:
    """True labels that no label of their class overlaps: class, missed, of how many."""
    counts: dict[str, list[int]] = {}
    for own in labelled.values():
        for t in own.truth:
            row = counts.setdefault(t.name, [0, 0])
            row[0] += not any(x.name == t.name and _overlaps(t, x) for x in own.predicted)
            row[1] += 1
    return [[name, *row] for name, row in sorted(counts.items())]


def looked_at(row: Mapping[str, Any]) -> str | None:
    """What a false label shows, if someone looked."""
    return LOOKED_AT.get((row["recording"], row["label"], int(row["start"])))


def n_looked_at(rows: Sequence[Mapping[str, Any]]) -> int:
    """How many of them someone looked at."""
    return sum(looked_at(row) is not None for row in rows)


def best_of_curve(curve: Sequence[Mapping[str, float]]) -> Mapping[str, float]:
    """Measures at the best threshold."""
    return max(curve, key=merit)


def draw(results: Results) -> dict[str, Any]:
    """F1 and F2 against the threshold."""
    panels = []
    for key, title in (("F1", "F1, frames"), ("F2", "F2, segments")):
        curves = {
            way: (results["thresholds"], [row[key] for row in curve])
            for way, curve in results["curves"].items()
        }
        panels.append(Panel(title, curves, "threshold τ", "", (0.0, 1.0)))
    return {"true_recordings": draw_panels(panels, columns=2, size=(3.2, 2.3))}


def draw_recordings(recordings: Recordings, results: Results) -> dict[str, Any]:
    """A strip of stick figures of every false label."""
    motions = {name: recordings.motion(name) for name in LABELLED}
    strips = []
    for row in results["false"]:
        motion = motions[row["recording"]]
        first, stop = (round(row[key] * motion.rate_hz) for key in ("start", "end"))
        title = f"{row['recording']}  {row['start']:.1f}–{row['end']:.1f} s: {row['label']}"
        strips.append((title, motion.generic_positions()[first:stop]))
    if not strips:
        return {}
    sheet = plot_sheet(None, strips)
    # A sheet calls what it shows hits.
    sheet.texts[0].set_text(f"{len(strips)} false labels")
    return {"true_recordings_false": sheet}
