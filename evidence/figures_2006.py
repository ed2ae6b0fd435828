"""Further tables and figures of Müller and Röder (2006): 1 and 5; 1 to 4, 6 and 8."""

import statistics
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from evidence.common.ranking import (
    TOLERANCE_2006,
    clip_costs,
    corpus_of,
    patterns_of,
    template_of,
    templates_of,
)
from evidence.common.recordings import (
    Clip,
    Recordings,
    Results,
    clips_of_2006,
    clips_packed,
    of_2006,
    of_class,
)
from motionary.evaluation import compute_rates_at
from motionary.features import FULL_BODY_2006, FeatureSequence, compute_features
from motionary.io import read
from motionary.labels import Label, LabelTrack
from motionary.matching import distance_function
from motionary.models.templates import Learning, MotionTemplate, learn_template
from motionary.plots import plot_distance, plot_features, plot_sheet, plot_template
from motionary.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "Further tables and figures of 2006"
SPLIT = "the authors' training half is learned, their evaluation half is searched"
SEED = 0
DATA = ("clips", ("{cmu}: 13_29", (1, 0.64)))

TAUS = (0.02, 0.06)
#: The class of the figures: a motion of the whole body, in the place of the cartwheel.
SHOWN = "lieDownFloor"
#: Gymnastics, and what is searched for in it: class -> the exercise that its truth names.
GYMNASTICS = "13_29"
SEARCHED = {
    "squat1Reps": "Squat",
    "elbowToKnee1RepsLelbowStart": "KneeRaise",
    "rotateArmsBothBackward1Reps": "ArmCircle",
}
TIMES = 3


def measure(recordings: Recordings) -> Results:
    """Both tables, and the distance functions of figure 8."""
    train, test = map(clips_of_2006, recordings.halves())
    return {
        "learning": {
            name: _learning(clips_packed(of_class(train, name)), recordings, name)
            for name in recordings.classes
        },
        "retrieval": _retrieval(train, test),
        "gymnastics": _gymnastics(recordings, train),
    }


def _learning(
    examples: Sequence[FeatureSequence], recordings: Recordings, name: str
) -> dict[str, Any]:
    """A row of table 1: passes are counted up to the one that changes nothing any more."""
    taken = []
    for _ in range(TIMES):
        began = time.perf_counter()
        template = template_of(examples)
        taken.append(time.perf_counter() - began)
    passes = 1
    while passes < Learning().max_passes:
        if np.array_equal(_after(examples, passes).values, template.values):
            break
        passes += 1
    return {
        "size": len(recordings.of(motion_class=name)),
        "examples": len(examples),
        "mean_length": float(np.mean([len(one) for one in examples])),
        "columns": template.n_columns,
        "passes": passes,
        "seconds": statistics.median(taken),
    }


def _after(examples: Sequence[FeatureSequence], passes: int) -> MotionTemplate:
    return learn_template(
        [one.features for one in examples],
        feature_names=FULL_BODY_2006.ids,
        feature_set=FULL_BODY_2006.name,
        learning=Learning(max_passes=passes),
    )


def _retrieval(train: Sequence[Clip], test: Sequence[Clip]) -> dict[str, Any]:
    """Recall and precision of clips, as table 5 prints them."""
    patterns = patterns_of(templates_of(train), tolerance=TOLERANCE_2006)
    costs = clip_costs(patterns, corpus_of(clips_packed(test)))
    rows = {}
    for i, name in enumerate(patterns):
        relevant = np.array([c.motion_class == name for c in test])
        rates = [compute_rates_at(costs[:, i], relevant, threshold=tau) for tau in TAUS]
        rows[name] = [[rate.recall, rate.precision] for rate in rates]
    return rows


def _gymnastics(recordings: Recordings, train: Sequence[Clip]) -> dict[str, Any]:
    folder = recordings.folder
    motion = read(folder / "cmu" / "exercises" / f"{GYMNASTICS}.amc", asf=folder / "cmu" / "86.asf")
    packed = of_2006(compute_features(motion))
    templates = templates_of([clip for clip in train if clip.motion_class in SEARCHED])
    patterns = patterns_of(templates, tolerance=TOLERANCE_2006)
    truth = _truth(recordings)
    curves = {
        name: np.asarray(distance_function(patterns[name], packed.packed, packed.known), np.float64)
        for name in SEARCHED
    }
    return {
        "truth": truth,
        "curves": curves,
        "told": {
            name: _inside(curves[name], truth, exercise, templates[name].n_columns)
            for name, exercise in SEARCHED.items()
        },
        "squats": _differences(templates["squat1Reps"], packed, truth),
        "seconds": len(packed) / 30,
    }


def _truth(recordings: Recordings) -> list[dict[str, Any]]:
    path = recordings.folder / "truth" / f"exercises_{GYMNASTICS}.csv"
    rows = [line.split(",") for line in path.read_text("utf-8").split()[1:]]
    return [{"label": r[1], "start_s": float(r[2]), "end_s": float(r[3])} for r in rows]


def _inside(
    curve: np.ndarray[Any, Any], truth: Sequence[dict[str, Any]], exercise: str, n_columns: int
) -> dict[str, float]:
    """Least distance in an exercise, where a match may end a little later, and elsewhere."""
    inside = np.zeros(len(curve), dtype=np.bool_)
    for row in truth:
        if row["label"] == exercise:
            inside[round(row["start_s"] * 30) : round(row["end_s"] * 30) + n_columns // 2] = True
    return {"inside": float(curve[inside].min()), "outside": float(curve[~inside].min())}


def _differences(
    template: MotionTemplate, packed: FeatureSequence, truth: Sequence[dict[str, Any]]
) -> list[tuple[str, float, float]]:
    """Features of the recording's squats that differ most from the template, by mean."""
    row = next(row for row in truth if row["label"] == "Squat")
    shown = packed.features[round(row["start_s"] * 30) : round(row["end_s"] * 30)].mean(axis=0)
    learned = template.values.mean(axis=0)
    most = np.argsort(-np.abs(shown - learned), kind="stable")[:4]
    return [(FULL_BODY_2006.names[i], float(shown[i]), float(learned[i])) for i in most]


def draw(results: Results) -> "dict[str, Figure]":
    """Figure 8."""
    gymnastics = results["gymnastics"]
    names = {name: f"{name}; bars: {exercise}" for name, exercise in SEARCHED.items()}
    labels = tuple(
        Label(names[name], row["start_s"], row["end_s"])
        for name, exercise in SEARCHED.items()
        for row in gymnastics["truth"]
        if row["label"] == exercise
    )
    curves = {
        names[name]: np.array([np.inf if v is None else v for v in curve])
        for name, curve in gymnastics["curves"].items()
    }
    return {
        "figures_2006_gymnastics": plot_distance(
            curves, truth=LabelTrack(Recording(), labels), threshold=0.06, title=f"CMU {GYMNASTICS}"
        )
    }


def draw_recordings(recordings: Recordings, results: Results) -> "dict[str, Figure]":
    """Poses, features and template of the class that is shown."""
    train = of_class(clips_of_2006(recordings.halves()[0]), SHOWN)
    actors = {clip.actor: clip for clip in reversed(train)}
    four = [actors[actor] for actor in sorted(actors)][:4]
    strips = [(c.actor, recordings.motion(c.name).generic_positions()) for c in four]
    template = template_of(clips_packed(train))
    named = replace(template, provenance=f"{len(train)} performances of {SHOWN}, HDM05")
    poses = plot_sheet(None, strips)
    next(text for text in poses.texts if "hits" in text.get_text()).set_text(
        f"{SHOWN}, one performance each of four actors"
    )
    return {
        "figures_2006_poses": poses,
        "figures_2006_features": plot_features(four[0].packed),
        "figures_2006_template": plot_template(
            named, tolerance=TOLERANCE_2006, feature_set=FULL_BODY_2006
        ),
    }
