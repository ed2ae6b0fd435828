"""Annotation in pictures: figures 2, 3, 6 and 7 of Müller, Baak and Seidel (2009)."""

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from evidence.common.recordings import (
    ACTORS,
    LABELLED,
    NAMES,
    UNSEEN,
    Recordings,
    Results,
    clips_packed,
)
from motionary.evaluation import evaluate
from motionary.features import SEQUENCE_HZ, FeatureSequence
from motionary.io import read_labels
from motionary.labels import Label, LabelTrack
from motionary.matching import distance_function
from motionary.models.library import ClassLibrary, TrainingOptions, learn_classes, learn_queries
from motionary.plots import plot_annotation, plot_distance
from motionary.recording import Recording
from motionary.retrieval.annotation import annotate
from motionary.retrieval.labelling import class_distance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "Annotation in pictures, beside figures of 2009"
SPLIT = (
    f"learned from all actors but {UNSEEN}; thresholds by cross-validation; four labelled "
    "recordings, three of them from another collection"
)
SEED = 0
DATA = (
    ("{clips}", lambda r: clips_packed(r.of(actors=set(ACTORS) - {UNSEEN}))),
    ("{cmu}; one take of HDM05; {truth}", lambda r: [r.others[name] for name in LABELLED]),
)

WAYS = {"templates": False, "with keyframes": True}
#: What is shown of a distance function: a recording, a class of it, and a template.
SHOWN = ("cmu/86_01.amc", "kick", "kickLFront1RepsMirrored")
#: One for all classes, and so large that labels to look at remain.
THRESHOLD = 0.09
#: Drawn: recordings in which trained classes occur.
DRAWN = ("cmu/86_01.amc", "cmu/01_01.amc", "hdm05_takes/HDM_bd_03-03_01_120.amc")


class Seen(NamedTuple):
    """One recording as both ways label it."""

    tracks: dict[str, LabelTrack]
    modified: dict[str, dict[str, Any]]


def measure(recordings: Recordings) -> Results:
    """Labels and modified distance functions of four recordings, both ways."""
    library = _learn(recordings)
    seen = {name: _see(recordings.others[name], library) for name in LABELLED}
    truth = _truth(recordings)
    return {
        "scores": {way: _score(seen, truth, way) for way in WAYS},
        "by_recording": {
            name: {way: _score({name: one}, truth, way) for way in WAYS}
            for name, one in seen.items()
            if truth[name]
        },
        "labels": {
            name: {way: [_row(label) for label in track] for way, track in one.tracks.items()}
            for name, one in seen.items()
        },
        "truth": {name: [_row(label) for label in labels] for name, labels in truth.items()},
        "modified": {
            name: {
                way: {one: _runs(curve) for one, curve in curves.items()}
                for way, curves in seen[name].modified.items()
            }
            for name in DRAWN
        },
        "seconds": {name: len(recordings.others[name]) / 30 for name in LABELLED},
        "distance": _distance(recordings, library),
    }


def _learn(recordings: Recordings) -> ClassLibrary:
    """Classes by the names of the truth, from the actors that no recording shows."""
    examples: dict[str, dict[str, list[FeatureSequence]]] = {}
    for clip in recordings.of(actors=set(ACTORS) - {UNSEEN}):
        prototypes = examples.setdefault(NAMES[clip.motion_class], {})
        prototypes.setdefault(clip.motion_class, []).append(clip.packed)
    library = learn_classes(examples, training=TrainingOptions(mirror=True, threshold=THRESHOLD))
    return learn_queries(library, examples).library


def _truth(recordings: Recordings) -> dict[str, list[Any]]:
    tables = read_labels(recordings.folder / "truth" / "annotation_2009.csv")
    return {
        name: [label for label in tables[row] if label.name in set(NAMES.values())]
        for name, row in LABELLED.items()
    }


def _see(packed: FeatureSequence, library: ClassLibrary) -> Seen:
    tracks = {
        way: annotate(packed, library, assignment="published", preselect=on)
        for way, on in WAYS.items()
    }
    modified = {
        way: {one.name: class_distance(packed, one, preselect=on).modified for one in library}
        for way, on in WAYS.items()
    }
    return Seen(tracks, modified)


def _runs(curve: Any) -> list[tuple[int, int, float]]:
    """Segments of one finite value: start, stop, value."""
    edges = [0, *(np.flatnonzero(curve[1:] != curve[:-1]) + 1).tolist(), len(curve)]
    runs = [(start, stop, float(curve[start])) for start, stop in itertools.pairwise(edges)]
    return [run for run in runs if np.isfinite(run[2])]


def _curve(runs: list[Any], seconds: float) -> Any:
    curve = np.full(round(seconds * 30), np.inf)
    for start, stop, value in runs:
        curve[start:stop] = value
    return curve


def _row(label: Any) -> dict[str, Any]:
    return {"name": label.name, "start_s": label.start_s, "end_s": label.end_s}


def _score(
    seen: Mapping[str, Seen], truth: Mapping[str, list[Any]], way: str
) -> dict[str, float | None]:
    predicted = {name: one.tracks[way] for name, one in seen.items()}
    scores = evaluate(predicted, {name: truth[name] for name in seen}).concatenated.as_dict()
    return {
        "f1": scores["frames"]["f"], "f2": scores["segments"]["f"],
        "p1": scores["frames"]["precision"], "r1": scores["frames"]["recall"],
        "p2": scores["segments"]["precision"], "r2": scores["segments"]["recall"],
    }  # fmt: skip


def _distance(recordings: Recordings, library: ClassLibrary) -> dict[str, Any]:
    """Figure 2: a distance function, and the modified one."""
    name, class_name, prototype = SHOWN
    packed = recordings.others[name]
    one = library[class_name]
    pattern = {s.name: p for s, (_, p) in zip(one.prototypes, one.patterns, strict=True)}[prototype]
    return {
        "plain": distance_function(pattern, packed.packed, packed.known),
        "modified": class_distance(packed, one, preselect=False).modified,
        "threshold": one.threshold,
    }


def picture_of(name: str, way: str) -> str:
    """Name of the picture of a recording."""
    short = Path(name).stem.replace("-", "_").lower()
    return f"figures_2009_{short}_{way.split()[-1]}"


def draw(results: Results) -> "dict[str, Figure]":
    """Distance functions, labels of recordings both ways."""
    figures = {"figures_2009_distance": _draw_distance(results)}
    for name in DRAWN:
        ways = results["labels"][name]
        truth = _track(name, results["truth"][name], results["seconds"][name])
        for way, labels in ways.items():
            curves = {
                one: _curve(runs, results["seconds"][name])
                for one, runs in results["modified"][name][way].items()
            }
            figures[picture_of(name, way)] = plot_annotation(
                _track(f"{Path(name).stem}, {way}", labels, results["seconds"][name]),
                truth,
                distances=curves,
            )
    return figures


def _track(name: str, rows: list[dict[str, Any]], seconds: float) -> LabelTrack:
    labels = tuple(Label(row["name"], row["start_s"], row["end_s"]) for row in rows)
    return LabelTrack(
        Recording(name, rate_hz=SEQUENCE_HZ, n_frames=round(seconds * SEQUENCE_HZ)), labels
    )


def _draw_distance(results: Results) -> "Figure":
    name, class_name, prototype = SHOWN
    distance = results["distance"]
    names = {"plain": f"{prototype}: distance", "modified": f"{class_name}: modified distance"}
    kicks = [row for row in results["truth"][name] if row["name"] == class_name]
    labels = tuple(
        Label(title, row["start_s"], row["end_s"]) for title in names.values() for row in kicks
    )
    curves = {
        title: np.array([np.inf if v is None else v for v in distance[key]])
        for key, title in names.items()
    }
    return plot_distance(
        curves, truth=LabelTrack(Recording(), labels), threshold=distance["threshold"], title=name
    )
