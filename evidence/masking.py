"""Masked cost beside a plain one: figure 7 and table 4 of Müller and Röder (2006)."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.common.ranking import (
    TOLERANCE_2006,
    corpus_of,
    manhattan_distance,
    template_of,
    templates_of,
)
from evidence.common.recordings import (
    Clip,
    Recordings,
    Results,
    clips_of_2006,
    clips_packed,
    join,
    of_class,
)
from motionary.evaluation import compute_average_precision
from motionary.labels import Label, LabelTrack
from motionary.matching import Corpus, corpus_distance
from motionary.models.templates import MotionTemplate, pattern_of, quantise
from motionary.plots import plot_distance
from motionary.recording import Recording

TITLE = "Masked or plain cost, beside figure 7 and table 4 of 2006"
SPLIT = (
    "templates are learned from the authors' training half; up to ten clips a class of the "
    "evaluation half are searched"
)
SEED = 0
DATA = ("clips",)

Floats = NDArray[np.float64]
Distance = Callable[[Corpus], Floats]

RANKS = (5, 10, 20)
#: The stream of the figure: four clips of each, in turns.
STREAM = ("kickLFront1Reps", "elbowToKnee1RepsLelbowStart", "squat1Reps")
PER_CLASS = 4
MOST = 10


def measure(recordings: Recordings) -> Results:
    """Recall of the first hits, separation and average precision by class and way."""
    train, test = map(clips_of_2006, recordings.halves())
    templates = templates_of(train)
    chosen = [clip for name in templates for clip in of_class(test, name)[:MOST]]
    corpus = corpus_of(clips_packed(chosen))
    classes = {}
    for name, template in templates.items():
        relevant = np.array([clip.motion_class == name for clip in chosen])
        ways = _ways(template, of_class(train, name)[0])
        classes[name] = {
            way: _score(distance(corpus), corpus, relevant) for way, distance in ways.items()
        }
    return {
        "classes": classes,
        "clips": len(chosen),
        "of_class": {name: len(of_class(chosen, name)) for name in templates},
        "stream": _stream(templates[STREAM[0]], train, test),
    }


def _ways(template: MotionTemplate, first: Clip) -> dict[str, Distance]:
    pattern = pattern_of(quantise(template, tolerance=TOLERANCE_2006))
    example = template_of([first.packed])
    return {
        "masked": lambda corpus: np.asarray(corpus_distance(pattern, corpus), dtype=np.float64),
        "Manhattan": lambda corpus: manhattan_distance(template, corpus),
        "one example": lambda corpus: manhattan_distance(example, corpus),
    }


def _score(distance: Floats, corpus: Corpus, relevant: NDArray[np.bool_]) -> dict[str, Any]:
    """One hit a clip; separation is the median of the distance over that of right hits."""
    costs = np.array([part.min(initial=np.inf) for part in _split(distance, corpus)])
    order = np.lexsort((relevant, costs))
    right = relevant[order] & np.isfinite(costs[order])
    top = costs[order][:MOST][right[:MOST]]
    median = float(np.median(distance[np.isfinite(distance)]))
    return {
        "average_precision": compute_average_precision(costs, relevant),
        "first": [int(right[:rank].sum()) for rank in RANKS],
        "separation": median / float(np.median(top)) if len(top) and np.median(top) > 0 else None,
    }


def _split(distance: Floats, corpus: Corpus) -> list[Floats]:
    pairs = zip(corpus.starts, corpus.lengths, strict=True)
    return [distance[start : start + length] for start, length in pairs]


def _stream(
    template: MotionTemplate, train: Sequence[Clip], test: Sequence[Clip]
) -> dict[str, Any]:
    """Both distance functions over clips joined to one recording."""
    by_class = [_spread(of_class(test, name)) for name in STREAM]
    clips = [clip for turn in zip(*by_class, strict=True) for clip in turn]
    corpus = corpus_of([join(clips_packed(clips), "stream")])
    ways = _ways(template, of_class(train, STREAM[0])[0])
    ends = np.cumsum([len(clip.packed) for clip in clips])
    labels = [
        {"class": clip.motion_class, "start": int(end - len(clip.packed)), "end": int(end)}
        for clip, end in zip(clips, ends, strict=True)
    ]
    curves = {way: ways[way](corpus) for way in ("masked", "Manhattan")}
    gaps = {way: _gap(curve, labels, template.n_columns) for way, curve in curves.items()}
    return {"labels": labels, "curves": curves, "gap": gaps}


def _spread(clips: Sequence[Clip]) -> list[Clip]:
    """Clips of different actors, as far as there are."""
    at = np.linspace(0, len(clips) - 1, PER_CLASS).astype(int)
    return [clips[i] for i in at]


def _gap(curve: Floats, labels: Sequence[Mapping[str, Any]], n_columns: int) -> dict[str, float]:
    """Highest cost of the clips of the class, and cheapest moment of the others.

    A match may end up to half a template's length after its clip.
    """
    inside = np.zeros(len(curve), dtype=np.bool_)
    costs = []
    for x in labels:
        if x["class"] == STREAM[0]:
            own = slice(x["start"], x["end"] + n_columns // 2)
            inside[own] = True
            costs.append(float(curve[own].min()))
    return {"dearest_right": max(costs), "cheapest_other": float(curve[~inside].min())}


def draw(results: Results) -> dict[str, Any]:
    """Figure 7."""
    stream = results["stream"]
    own = [x for x in stream["labels"] if x["class"] == STREAM[0]]
    names = {"masked": "masked cost", "Manhattan": "Manhattan distance, not quantised"}
    labels = [Label(name, x["start"] / 30, x["end"] / 30) for name in names.values() for x in own]
    curves = {
        name: np.array([np.inf if v is None else v for v in stream["curves"][way]])
        for way, name in names.items()
    }
    title = "kickLFront1Reps, searched for in kicks, elbow to knee and squats"
    return {
        "masking": plot_distance(curves, truth=LabelTrack(Recording(), tuple(labels)), title=title)
    }
