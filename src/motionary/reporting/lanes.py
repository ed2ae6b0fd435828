"""Lanes below a player: labels of several tracks, why they are there, curves, features.

Conventions: curves and features at 30 Hz, as sequences have them; times in seconds.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.features import FeatureSequence, FeatureSet
from motionary.labels import Label, LabelTrack
from motionary.models.library import Candidates, ClassLibrary, thresholds_for
from motionary.motion import GENERIC_JOINTS
from motionary.reporting.html import Block, encode_json, encode_series, encode_states
from motionary.retrieval.annotation import Annotation
from motionary.retrieval.explanation import Evidence, Explanation, Finding, explain

#: A curve's unit: costs and scores are kept to a thousandth.
CURVE_UNIT = 0.001
#: A page has curves of so many classes: those with most labels, then those that came nearest.
MOST_CURVES = 24
#: Costs above say no more than that nothing fits.
_HIGHEST_COST = 0.6

_NO, _YES, _UNKNOWN = 0, 1, 2


class Lane(NamedTuple):
    """Labels under one name: of a library, of a table, or true ones.

    Attributes
    ----------
    name : shown beside the lane
    track : its labels
    is_truth : whether others are compared with it
    """

    name: str
    track: LabelTrack
    is_truth: bool = False


def describe_features(feature_set: FeatureSet) -> list[dict[str, Any]]:
    """Phrases, group and joints of each feature."""
    return [
        {
            "id": one.id,
            "yes": one.phrase(True),
            "no": one.phrase(False),
            "group": one.group,
            "joints": [GENERIC_JOINTS.index(joint) for joint in one.joints],
        }
        for one in feature_set.features
    ]


def make_lanes(lanes: Iterable[Lane], *, key: str) -> tuple[list[dict[str, Any]], list[Block]]:
    """Labels of lanes for the page's JSON, and the reasons of those that have some."""
    contents, blocks = [], []
    for number, lane in enumerate(lanes):
        whys: list[Any] = []
        rows = []
        for label in lane.track:
            reason = None
            if isinstance(label.evidence, Evidence):
                reason = len(whys)
                whys.append(describe_why(label.evidence))
            rows.append(_row(label, reason))
        content: dict[str, Any] = {
            "name": lane.name,
            "truth": lane.is_truth,
            "labels": rows,
            "unassessed": [[_round(a), _round(b)] for a, b in lane.track.unassessed],
            "nearest": "" if len(lane.track) else lane.track.nearest,
        }
        if whys:
            content["why"] = f"{key}-why-{number}"
            blocks.append(Block(content["why"], encode_json(whys)))
        contents.append(content)
    return contents, blocks


def describe_why(evidence: Evidence) -> dict[str, Any]:
    """What held and failed, as the page shows it beside the body."""
    why = explain(evidence)
    number = {name: i for i, name in enumerate(evidence.sequence.feature_set.ids)}
    phrases = {name: i for i, name in enumerate(evidence.sequence.feature_set.names)}
    return {
        "text": str(why),
        "cost": _round(why.cost),
        "score": None if why.score is None else _round(why.score),
        "fraction": _round(why.fraction_held),
        "held": [_finding(one, number, evidence) for one in _ranked(why.held)],
        "failed": [_finding(one, number, evidence) for one in _ranked(why.failed)],
        "unknown": [phrases[name] for name in why.unknown],
        "gains": _gains(why, number),
    }


def make_strip(sequence: FeatureSequence, *, key: str) -> tuple[dict[str, Any], Block]:
    """All features over time: no, yes, or unknown."""
    states = np.where(sequence.known_features != 0, sequence.features, _UNKNOWN)
    block = Block(f"{key}-features", encode_states(states.T.astype(np.int64)))
    return {"block": block.name, "n_frames": len(sequence)}, block


def make_curves(
    found: Annotation, library: ClassLibrary, *, n_frames: int, key: str
) -> tuple[dict[str, Any], Block]:
    """Curves of the classes that have most labels, or came nearest, with their thresholds.

    Scores where the labels were assigned by them, otherwise distance functions.

    Parameters
    ----------
    found : labels of a recording, and what they were assigned by
    library : of its classes
    n_frames : of the recording, at 30 Hz
    """
    by_scores = found.candidates is not None
    if found.candidates is not None:
        curves = _score_curves(found.candidates, library, n_frames)
        limits = dict(zip(library.names, thresholds_for(library).tolist(), strict=True))
        best = {name: -float(curve.max(initial=0.0)) for name, curve in curves.items()}
    else:
        curves = {
            name: np.minimum(one.unmodified, _HIGHEST_COST) for name, one in found.distances.items()
        }
        limits = {one.name: one.threshold for one in library}
        best = {name: float(curve.min(initial=np.inf)) for name, curve in curves.items()}
    counts = Counter(label.name for label in found.track)
    chosen = sorted(curves, key=lambda name: (-counts[name], best[name]))[:MOST_CURVES]
    rows = np.rint(np.array([curves[name] for name in chosen]) / CURVE_UNIT).astype(np.int64)
    block = Block(f"{key}-curves", encode_series(rows))
    content = {
        "kind": "score" if by_scores else "cost",
        "unit": CURVE_UNIT,
        "block": block.name,
        "n_frames": n_frames,
        "classes": [{"name": name, "threshold": _round(limits[name])} for name in chosen],
    }
    return content, block


def _row(label: Label, reason: int | None) -> list[Any]:
    """Name, start, end, cost, score, known fraction, and the number of its reason."""
    values = (label.cost, label.score, label.known)
    rounded = [None if value is None else _round(value) for value in values]
    return [label.name, _round(label.start_s), _round(label.end_s), *rounded, reason]


def _round(value: float) -> float:
    return round(float(value), 4)


def _ranked(findings: Sequence[Finding]) -> list[Finding]:
    return sorted(findings, key=lambda one: -one.weight)


def _finding(one: Finding, number: Mapping[str, int], evidence: Evidence) -> list[Any]:
    """Feature, whether it is asked for to hold, start, end and weight."""
    index = number[one.feature]
    feature = evidence.sequence.feature_set.features[index]
    holds = int(one.phrase == feature.phrase(True))
    return [index, holds, _round(one.start_s), _round(one.end_s), _round(one.weight)]


def _gains(why: Explanation, number: Mapping[str, int]) -> list[list[Any]]:
    ranked = sorted(why.gains, key=lambda gain: -abs(gain.part))
    return [[number[gain.feature], _round(gain.part)] for gain in ranked if gain.part]


def _score_curves(
    found: Candidates, library: ClassLibrary, n_frames: int
) -> dict[str, NDArray[np.floating]]:
    """Highest score of the matches that cover each frame; 0 without one."""
    curves: dict[str, NDArray[np.floating]] = {name: np.zeros(n_frames) for name in library.names}
    paths = found.paths
    for index, class_index in enumerate(found.classes.tolist()):
        part = curves[library.names[class_index]][paths.starts[index] : paths.stops[index]]
        np.maximum(part, float(paths.scores[index]), out=part)
    return curves
