"""Retrieval by class, after table 2 of Müller and Röder (2006)."""

import statistics
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.ranking import (
    TOLERANCE_2006,
    by_class,
    clip_costs,
    corpus_of,
    hits_of,
    patterns_of,
    summarize,
    templates_of,
)
from evidence.common.recordings import (
    ACTORS,
    Clip,
    Recordings,
    Results,
    clips_of_2006,
    clips_packed,
)
from motionary.matching import Corpus, Pattern, corpus_distance

TITLE = "Retrieval by class, beside table 2 of 2006"
SPLIT = "the authors' training and evaluation half; and each actor left out in turn"
SEED = 0
DATA = ("clips",)

#: Rows of the authors' complete table for the classes that are at hand.
ROWS = {
    "depositFloorR": "DepositFloorR",
    "elbowToKnee1RepsLelbowStart": "elbowToKnee1RepsLelbowStart",
    "grabHighR": "GrabHighRHand",
    "hopBothLegs1hops": "HopBothLegs",
    "jogLeftCircle4StepsRstart": "JogLeftCircleRFootStart4",
    "kickLFront1Reps": "KickFrontLFoot",
    "lieDownFloor": "LieDownFloor",
    "rotateArmsBothBackward1Reps": "RotateBothArmsBwd1",
}
#: Only in print (table 2).
SQUAT = {
    "relevant": 26, "hits": [23, 24, 26, 26, 26, 27], "relevant_hits": [23, 24, 26, 26, 26, 26],
    "template_length": 48, "seconds": 5.69,
}  # fmt: skip
#: Orientation: a plain prototype, before the package; (mAP, precision, recall, right class).
PROTOTYPE = {
    "halves, step counts once": (0.974, 0.65, 0.98, 0.951),
    "halves, step counts twice": (0.992, 0.93, 0.93, 0.986),
    "one actor left out, step counts once": (0.957, 0.65, 0.99, 0.972),
    "one actor left out, step counts twice": (0.971, 0.92, 0.91, 0.983),
}
STEPS = {"once": 1.0, "twice": 2.0}
DATABASE_FRAMES = 24 * 60 * 30
RUNS = 9


def measure(recordings: Recordings) -> Results:
    """Both splits, both step weights, and the table."""
    train, test = map(clips_of_2006, recordings.halves())
    thresholds = recordings.golden("retrieval_table_complete.json")["thresholds"]
    patterns = patterns_of(templates_of(train), tolerance=TOLERANCE_2006)
    corpus = corpus_of(clips_packed(test))
    splits = {}
    for name, weight in STEPS.items():
        costs = clip_costs(patterns, corpus, skip_weight=weight)
        splits[f"halves, step counts {name}"] = _summary(costs, test, list(patterns))
    for name, weight in STEPS.items():
        splits[f"one actor left out, step counts {name}"] = _leave_one_out(recordings, weight)
    return {
        "thresholds": thresholds,
        "splits": splits,
        "table": {
            name: _row(pattern, test, name, thresholds) | {"seconds": _seconds(pattern, corpus)}
            for name, pattern in patterns.items()
        },
        "published": _published(recordings),
        "evaluation_minutes": sum(len(clip.packed) for clip in test) / 30 / 60,
        "evaluation_clips": len(test),
    }


def _leave_one_out(recordings: Recordings, skip_weight: float) -> dict[str, Any]:
    costs: list[Any] = []
    tested: list[Clip] = []
    for actor in ACTORS:
        train = clips_of_2006(recordings.of(actors=set(ACTORS) - {actor}))
        test = clips_of_2006(recordings.of(actors=[actor]))
        patterns = patterns_of(templates_of(train), tolerance=TOLERANCE_2006)
        corpus = corpus_of(clips_packed(test))
        costs.append(clip_costs(patterns, corpus, skip_weight=skip_weight))
        tested += test
    return _summary(np.concatenate(costs), tested, recordings.classes)


def _summary(costs: Any, clips: Sequence[Clip], names: Sequence[str]) -> dict[str, Any]:
    truth = [clip.motion_class for clip in clips]
    return summarize(costs, truth, names) | {"classes": by_class(costs, truth, names)}


def _row(
    pattern: Pattern, test: Sequence[Clip], name: str, thresholds: Sequence[float]
) -> dict[str, Any]:
    """Hits at each threshold; of several hits in one clip of the class one is relevant."""
    hits = hits_of(pattern, clips_packed(test), threshold=thresholds[-1])
    of_class = {i for i, clip in enumerate(test) if clip.motion_class == name}
    found = [[i for i, hit in hits if hit.cost <= tau] for tau in thresholds]
    return {
        "relevant": len(of_class),
        "hits": [len(one) for one in found],
        "relevant_hits": [len(of_class & set(one)) for one in found],
        "template_length": len(pattern),
    }


def _seconds(pattern: Pattern, corpus: Corpus) -> float:
    """Median time of a distance function over as many frames as the paper's database."""
    repeats = -(-DATABASE_FRAMES // len(corpus.packed))
    packed = np.tile(corpus.packed, (repeats, 1))[:DATABASE_FRAMES]
    known = np.tile(corpus.known, (repeats, 1))[:DATABASE_FRAMES]
    inside = corpus.blocked[corpus.blocked < DATABASE_FRAMES]
    long = Corpus(packed, known, corpus.starts, corpus.lengths, inside)
    taken = []
    for _ in range(RUNS):
        began = time.perf_counter()
        corpus_distance(pattern, long, engine="numpy")
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)


def _published(recordings: Recordings) -> dict[str, Any]:
    table = recordings.golden("retrieval_table_complete.json")["rows"]
    rows = {row["motion_class"]: row for row in table}
    keys = ("relevant", "hits", "relevant_hits", "template_length", "seconds")
    found = {ours: {key: rows[theirs][key] for key in keys} for ours, theirs in ROWS.items()}
    return found | {"squat1Reps": SQUAT}


def beside_published(results: Results) -> dict[str, Any]:
    """How far relevant hits, lengths and the prototype are from ours, in numbers."""
    both = [(results["table"][name], row) for name, row in results["published"].items()]
    cells = np.array([(a["relevant_hits"], b["relevant_hits"]) for a, b in both])
    at = results["thresholds"].index(0.06)
    ours, theirs = cells[:, 0], cells[:, 1]
    return {
        "cells": ours.size,
        "more": (ours > theirs).sum(),
        "less": (ours < theirs).sum(),
        "found": ours[:, at].sum(),
        "published": theirs[:, at].sum(),
        "total": sum(a["relevant"] for a, _ in both),
        "length": max(abs(a["template_length"] - b["template_length"]) for a, b in both),
        "prototype": max(
            abs(results["splits"][name]["mean_average_precision"] - values[0])
            for name, values in PROTOTYPE.items()
        ),
    }


def draw(results: Results) -> dict[str, Any]:
    """Recall over the threshold, beside the published."""
    panels, taus = [], results["thresholds"]
    for name, ours in results["table"].items():
        rows = {"ours": ours}
        if name in results["published"]:
            rows["Müller and Röder (2006)"] = results["published"][name]
        curves = {
            whose: (taus, [hits / row["relevant"] for hits in row["relevant_hits"]])
            for whose, row in rows.items()
        }
        panels.append(Panel(name, curves, "threshold τ", "found", (0, 1.04)))
    return {"retrieval_2006": draw_panels(panels, columns=4, size=(2.3, 1.6))}
