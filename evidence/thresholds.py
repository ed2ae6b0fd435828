"""Calibrated thresholds: estimated precision and recall beside measured, on unseen actors."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.labelling import (
    Labelled,
    Matches,
    Setting,
    best_of,
    find_matches,
    interval_over_actors,
    labels_at,
    learn_all,
    with_setting,
)
from evidence.common.labelling import measure as measure_labels
from evidence.common.recordings import ACTORS, Clip, Recordings, Results, examples
from evidence.common.streams import (
    CHOOSING,
    KINDS,
    REPORTING,
    Stream,
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

Pair = tuple[str, str]
Streams = Mapping[tuple[Pair, str], Stream]
Found = Mapping[tuple[Pair, str], Matches]

TAUS = (0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.1)
MOST = 0.15
#: Half of a stream holds none of the classes. For as much other motion as estimates assume,
#: a false label stands for so many, as when thresholds are calibrated.
FALSE_WEIGHT = (1 + OTHER_PER_FRAME) / 2
ALONE, OTHERS = "told from each other", "told from other recordings too"


def measure(recordings: Recordings) -> Results:
    """Estimated and measured by class, and what the thresholds do to all labels."""
    given = {ALONE: [], OTHERS: negatives(recordings)}
    one_side = {p: _calibrate(recordings, p, given, mirrored=False) for p in CHOOSING + REPORTING}
    mirrored = {p: _calibrate(recordings, p, given, mirrored=True) for p in CHOOSING}
    streams = {
        (pair, kind): stream
        for pair in CHOOSING + REPORTING
        for kind, stream in make_streams(recordings, pair, seed=SEED).items()
    }
    found = _find(recordings, streams, CHOOSING + REPORTING, mirrored=False)
    both_sides = _find(recordings, streams, CHOOSING, mirrored=True)
    curve = _curve(found, streams, CHOOSING)
    best = best_of(curve)
    return {
        "classes": {
            way: _by_class(found, streams, {p: one_side[p][way] for p in REPORTING})
            for way in given
        },
        "best": best,
        "report": _compare(found, streams, one_side, REPORTING, best),
        "choosing": _compare(found, streams, one_side, CHOOSING, best),
        "mirrored": _compare(
            both_sides, streams, mirrored, CHOOSING, best_of(_curve(both_sides, streams, CHOOSING))
        ),
        "negatives": {
            "files": len(given[OTHERS]),
            "minutes": sum(map(len, given[OTHERS])) / 30 / 60,
        },
    }


def _learned_from(recordings: Recordings, pair: Pair) -> tuple[Clip, ...]:
    return recordings.of(actors=set(ACTORS) - set(pair))


def _calibrate(
    recordings: Recordings,
    unseen: Pair,
    given: Mapping[str, Sequence[FeatureSequence]],
    *,
    mirrored: bool,
) -> dict[str, dict[str, Calibration]]:
    """Calibrations from three actors, each left out in turn."""
    clips = examples(_learned_from(recordings, unseen))
    return {
        way: calibrate_thresholds(
            clips, negatives=others, training=TrainingOptions(mirror=mirrored, groups="HDM_(..)_")
        )
        for way, others in given.items()
    }


def _find(
    recordings: Recordings, streams: Streams, pairs: Sequence[Pair], *, mirrored: bool
) -> dict[tuple[Pair, str], Matches]:
    setting = Setting(mirrored=mirrored)
    found = {}
    for pair in pairs:
        clips = _learned_from(recordings, pair)
        classes = with_setting(learn_all(clips), setting, clips)
        for kind in KINDS:
            packed = streams[pair, kind].packed
            found[pair, kind] = find_matches(packed, classes, most=MOST, setting=setting)
    return found


def _curve(found: Found, streams: Streams, pairs: Sequence[Pair]) -> dict[float, dict[str, float]]:
    return {
        t: measure_labels([_label(found[key], streams[key], t) for key in found if key[0] in pairs])
        for t in TAUS
    }


def _label(found: Matches, stream: Stream, thresholds: float | Mapping[str, float]) -> Labelled:
    return Labelled(labels_at(found, thresholds), stream.truth, stream.seconds)


def _of(calibrations: Mapping[str, Calibration]) -> dict[str, float]:
    return {name: one.threshold for name, one in calibrations.items()}


def _by_class(
    found: Found, streams: Streams, calibrated: Mapping[Pair, Mapping[str, Calibration]]
) -> Results:
    """Estimated (mean over pairs) and measured (all pairs together) of each class."""
    counts: dict[str, list[Counts]] = {}
    for pair, calibrations in calibrated.items():
        for kind in KINDS:
            one = _label(found[pair, kind], streams[pair, kind], _of(calibrations))
            for name, counted in count_overlaps(one.predicted, one.truth).items():
                counts.setdefault(name, []).append(counted)
    rows = {}
    for name in sorted(counts):
        promised = [own[name] for own in calibrated.values()]
        rates = compute_rates(pool_counts(counts[name]))
        rows[name] = {
            "thresholds": [one.threshold for one in promised],
            "promised": [
                np.mean([one.precision for one in promised]),
                np.mean([one.recall for one in promised]),
            ],
            "measured": [rates.precision, rates.recall],
            "clips": pool_counts(counts[name]).true,
        }
    return rows


def _compare(
    found: Found,
    streams: Streams,
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
        own = {
            (pair, kind): _label(found[pair, kind], streams[pair, kind], thresholds[pair])
            for pair in pairs
            for kind in KINDS
        }
        values = {
            key: interval_over_actors(
                {p: [measure_labels([own[p, kind]])[key] for kind in KINDS] for p in pairs}
            )
            for key in ("F1", "F2")
        }
        rows[way] = {**measure_labels(list(own.values())), "intervals": values}
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
