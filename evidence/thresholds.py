"""Calibrated thresholds: estimated precision and recall beside measured, on unseen actors."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.labelling import (
    Found,
    Labelled,
    Pair,
    Setting,
    Tasks,
    best_of,
    curve_of,
    find_all,
    interval_over_actors,
    label_all,
    tasks_of,
)
from evidence.common.labelling import measure as measure_labels
from evidence.common.recordings import ACTORS, Recordings, Results, examples
from evidence.common.streams import (
    CHOOSING,
    KINDS,
    REPORTING,
    make_streams,
    negatives,
    other_motion,
)
from motionary.evaluation import Counts, compute_rates, count_overlaps, pool_counts
from motionary.features import FeatureSequence
from motionary.models.library import THRESHOLD, Calibration, TrainingOptions, calibrate_thresholds
from motionary.models.library.calibration import OTHER_PER_FRAME

TITLE = "Calibrated thresholds: estimated and measured"
SPLIT = (
    "three actors' clips train and calibrate; streams of the other two are labelled; five pairs of "
    "actors choose the one threshold, the other five are reported"
)
SEED = 12
DATA = (
    "clips",
    ("streams: {cmu}", lambda r: [part.packed for part in other_motion(r, "amc")]),
    ("streams: {bandai}", lambda r: [part.packed for part in other_motion(r, "bvh")]),
    ("to choose thresholds by: {bandai}", negatives),
)


TAUS = (0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.1)
MOST = 0.15
#: Half of a stream holds none of the classes. For as much other motion as estimates assume,
#: a false label stands for so many, as when thresholds are calibrated.
FALSE_WEIGHT = (1 + OTHER_PER_FRAME) / 2
ALONE, OTHERS = "told from each other", "told from other recordings too"


def measure(recordings: Recordings) -> Results:
    """Estimated and measured by class, and what the thresholds do to all labels."""
    given = {ALONE: [], OTHERS: negatives(recordings)}
    one_side = {p: _calibrate(recordings, p, given, mirror=False) for p in CHOOSING + REPORTING}
    mirrored = {p: _calibrate(recordings, p, given, mirror=True) for p in CHOOSING}
    streams = {p: make_streams(recordings, p, seed=SEED) for p in CHOOSING + REPORTING}
    tasks = tasks_of(recordings, streams)
    choosing = {key: task for key, task in tasks.items() if key[0] in CHOOSING}
    found = find_all(tasks, Setting(), most=MOST)
    both_sides = find_all(choosing, Setting(mirrored=True), most=MOST)
    best = best_of(curve_of(tasks, {key: found[key] for key in choosing}, TAUS))
    mirrored_best = best_of(curve_of(tasks, both_sides, TAUS))
    return {
        "classes": {
            way: _by_class(tasks, found, {p: one_side[p][way] for p in REPORTING}) for way in given
        },
        "best": best,
        "report": _compare(tasks, found, one_side, REPORTING, best),
        "choosing": _compare(tasks, found, one_side, CHOOSING, best),
        "mirrored": _compare(tasks, both_sides, mirrored, CHOOSING, mirrored_best),
        "negatives": {
            "files": len(given[OTHERS]), "minutes": sum(map(len, given[OTHERS])) / 30 / 60
        },
    }  # fmt: skip


def _calibrate(
    recordings: Recordings,
    unseen: Pair,
    given: Mapping[str, Sequence[FeatureSequence]],
    *,
    mirror: bool,
) -> dict[str, dict[str, Calibration]]:
    """Calibrations from three actors, each left out in turn."""
    clips = examples(recordings.of(actors=set(ACTORS) - set(unseen)))
    training = TrainingOptions(mirror=mirror, groups="HDM_(..)_")
    return {
        way: calibrate_thresholds(clips, negatives=others, training=training)
        for way, others in given.items()
    }


def _label(
    tasks: Tasks, found: Found, thresholds: Mapping[Pair, float | Mapping[str, float]]
) -> dict[Any, Labelled]:
    """Labels of the streams of some pairs, with the thresholds of each pair."""
    labelled: dict[Any, Labelled] = {}
    for pair, own in thresholds.items():
        of_pair = {(pair, kind): found[pair, kind] for kind in KINDS}
        labelled |= label_all(tasks, of_pair, own)
    return labelled


def _of(calibrations: Mapping[str, Calibration]) -> dict[str, float]:
    return {name: one.threshold for name, one in calibrations.items()}


def _by_class(
    tasks: Tasks, found: Found, calibrated: Mapping[Pair, Mapping[str, Calibration]]
) -> Results:
    """Estimated (mean over pairs) and measured (all pairs together) of each class."""
    counts: dict[str, list[Counts]] = {}
    for one in _label(tasks, found, {p: _of(own) for p, own in calibrated.items()}).values():
        for name, counted in count_overlaps(one.predicted, one.truth).items():
            counts.setdefault(name, []).append(counted)
    rows = {}
    for name in sorted(counts):
        estimated = [own[name] for own in calibrated.values()]
        pooled = pool_counts(counts[name])
        rates = compute_rates(pooled)
        rows[name] = {
            "thresholds": [one.threshold for one in estimated],
            "promised": np.mean([(one.precision, one.recall) for one in estimated], axis=0),
            "measured": [rates.precision, rates.recall],
            "clips": pooled.true,
        }
    return rows


def _compare(
    tasks: Tasks,
    found: Found,
    calibrated: Mapping[Pair, Mapping[str, Mapping[str, Calibration]]],
    pairs: Sequence[Pair],
    best: float,
) -> Results:
    """All labels with one threshold and with one per class."""
    ways: dict[str, dict[Pair, Any]] = {
        f"one, the default τ = {THRESHOLD:g}": dict.fromkeys(pairs, THRESHOLD),
        f"one, chosen: τ = {best:g}": dict.fromkeys(pairs, best),
    }
    for way in (ALONE, OTHERS):
        ways[f"per class, {way}"] = {pair: _of(calibrated[pair][way]) for pair in pairs}
    rows = {}
    for way, thresholds in ways.items():
        own = _label(tasks, found, thresholds)
        scores = {key: measure_labels([one]) for key, one in own.items()}
        intervals = {
            key: interval_over_actors({p: [scores[p, k][key] for k in KINDS] for p in pairs})
            for key in ("F1", "F2")
        }
        rows[way] = {**measure_labels(own.values()), "intervals": intervals}
    return rows


def measured(own: Mapping[str, Any], which: int) -> float:
    """Precision with as much other motion as estimated for (0), or recall (1)."""
    value: float = own["measured"][which]
    return value if which == 1 else value / (value + FALSE_WEIGHT * (1 - value))


def gaps(classes: Mapping[str, Any], which: int) -> list[float]:
    """Measured minus estimated, by class."""
    return [measured(own, which) - own["promised"][which] for own in classes.values()]


def draw(results: Results) -> dict[str, Any]:
    """Estimated against measured."""
    panels = [
        Panel(title, {way: _points(results, way, which) for way in (ALONE, OTHERS)},
              "estimated", "measured", (0.3, 1.03))
        for which, title in ((0, "precision"), (1, "recall"))
    ]  # fmt: skip

    def decorate(axes: Any, index: int) -> None:
        for line in axes.get_lines():
            line.set_linestyle("none")
            line.set_markersize(4.5)
        axes.plot([0.3, 1], [0.3, 1], color="0.6", linewidth=0.8, zorder=0)
        axes.set_xlim(0.3, 1.03)

    return {"thresholds": draw_panels(panels, columns=2, size=(3.2, 3.0), decorate=decorate)}


def _points(results: Results, way: str, which: int) -> tuple[list[float], list[float]]:
    own = results["classes"][way].values()
    return [one["promised"][which] for one in own], [measured(one, which) for one in own]
