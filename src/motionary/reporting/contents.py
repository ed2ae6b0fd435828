"""What pages hold of a recording: its poses, and the lanes below the player.

Poses are the positions and bones. A joint that is not seen for a while is kept where it was on
its bone, and marked as unseen, so that the page can draw it so; joints that are never seen are
named, and bones drawn over them. Lanes have labels of several tracks, why they are there, curves
and features.

Conventions: positions in metres, y up, at the page's rate; frame i stands for i / rate seconds
after the recording's first frame. Curves and features at 30 Hz, as sequences have them; times in
seconds.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.features import FeatureSequence, FeatureSet
from motionary.labels import LabelTrack
from motionary.models.library import Candidates, ClassLibrary, thresholds_for
from motionary.motion import GENERIC_JOINTS, Motion, resample
from motionary.plots.figures import bones_over_missing, side_of
from motionary.recording import Recording, find_runs
from motionary.reporting.html import (
    Block,
    encode_json,
    encode_positions,
    encode_series,
    encode_states,
)
from motionary.retrieval.annotation import Annotation
from motionary.retrieval.explanation import Evidence, Finding, explain

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Frames a second that a page keeps unless asked for others.
PAGE_HZ = 30.0

#: Positions are kept in pieces of so many seconds, each unpacked when it is shown.
_PIECE_S = 60.0
#: Bytes that a coordinate of a frame takes in a page of people who move: measured.
_BYTES_OF_VALUE = 0.8
# Whom one sees crouch first stands up later.
_LEAST_HEIGHT_M = 1.2
#: Shorter gaps are not hatched on the time axis: at its full length they could not be seen.
_LEAST_GAP_S = 0.1

#: A curve's unit: costs and scores are kept to a thousandth.
CURVE_UNIT = 0.001
#: A page has curves of so many classes: those with most labels, then those that came nearest.
MOST_CURVES = 24
#: Costs above say no more than that nothing fits.
_HIGHEST_COST = 0.6

_NO, _YES, _UNKNOWN = 0, 1, 2


class _Body(NamedTuple):
    """Positions (frames, joints, 3), names of the joints, bones (joint, parent), sides."""

    positions: Floats
    names: list[str]
    bones: list[tuple[int, int]]
    sides: list[str]


def make_clip(
    motion: Motion, *, key: str, rate_hz: float = PAGE_HZ, seen: Motion | None = None
) -> tuple[dict[str, Any], list[Block]]:
    """A motion at the page's rate: what stands in the page's JSON, and positions in pieces.

    Parameters
    ----------
    motion : whose joints may be unmapped: then its own are drawn
    key : begins the names of its blocks; unique in the page
    rate_hz : most frames a second that are kept
    seen : the motion without what was not seen, where the motion says where that was
    """
    page_hz = min(rate_hz, motion.rate_hz)
    body = _body_of(motion)
    positions, shown = (
        resample(one.positions, rate_hz=motion.rate_hz, to_hz=page_hz)
        for one in (body, body if seen is None else _body_of(seen))
    )
    known: Bools = np.asarray(~np.isnan(shown).any(axis=2))
    ever: Bools = np.asarray(known.any(axis=0))
    filled = _fill(positions, np.asarray(~np.isnan(positions).any(axis=2)), body.bones)
    piece = max(1, round(_PIECE_S * page_hz))
    blocks = [
        Block(f"{key}-{i}", encode_positions(filled[at : at + piece], known[at : at + piece]))
        for i, at in enumerate(range(0, len(filled), piece))
    ]
    content = describe_recording(motion.recording) | {
        "page_hz": page_hz,
        "page_frames": len(filled),
        "piece": piece,
        "positions": [block.name for block in blocks],
        "joints": body.names,
        "sides": body.sides,
        "bones": body.bones,
        "missing": [name for name, seen in zip(body.names, ever, strict=True) if not seen],
        "height": _height(filled[:, ever]),
        "reach": _reach(filled[:, ever]),
        "floor": _floor(positions),
        "gaps": _gaps(known[:, ever], page_hz),
    }
    return content, blocks


def describe_body(positions: Floats) -> dict[str, Any]:
    """What a live page has of a body of which these poses were seen so far.

    Parameters
    ----------
    positions : array, shape (frames, 24, 3), of the generic joints, NaN = not seen
    """
    ever: Bools = np.asarray(~np.isnan(positions).any(axis=2).all(axis=0))
    seen = positions[:, ever]
    return {
        "joints": list(GENERIC_JOINTS),
        "sides": [side_of(i) for i in range(len(GENERIC_JOINTS))],
        "bones": bones_over_missing(positions),
        "missing": [name for name, one in zip(GENERIC_JOINTS, ever, strict=True) if not one],
        "height": max(_height(np.nan_to_num(seen)), _LEAST_HEIGHT_M),
        "reach": max(_reach(np.nan_to_num(seen)), _LEAST_HEIGHT_M),
        "floor": _floor(seen),
    }


def estimate_bytes(motion: Motion, *, rate_hz: float) -> float:
    """How much a motion will take in a page, before its clip is made."""
    n_joints = len(motion.names) if motion.mapping is None else len(GENERIC_JOINTS)
    n_frames = motion.recording.duration_s * min(rate_hz, motion.rate_hz)
    return 3 * n_joints * n_frames * _BYTES_OF_VALUE


def describe_recording(own: Recording) -> dict[str, Any]:
    """Name, length and frame numbers of a recording."""
    return {
        "name": own.name,
        "rate_hz": own.rate_hz,
        "n_frames": own.n_frames,
        "first_frame": own.first_frame,
        "duration_s": own.duration_s,
    }


def _body_of(motion: Motion) -> _Body:
    """The generic joints, or the file's own where they are unknown."""
    if motion.mapping is not None:
        positions = motion.generic_positions()
        n = len(GENERIC_JOINTS)
        sides = [side_of(i) for i in range(n)]
        return _Body(positions, list(GENERIC_JOINTS), bones_over_missing(positions), sides)
    names = list(motion.names)
    bones: list[tuple[int, int]] = []
    if motion.skeleton is not None:
        place = {name: i for i, name in enumerate(names)}
        own = motion.skeleton.names
        bones = [
            (place[own[joint]], place[own[parent]])
            for joint, parent in enumerate(motion.skeleton.parents.tolist())
            if parent >= 0 and own[joint] in place and own[parent] in place
        ]
    return _Body(motion.positions, names, bones, [""] * len(names))


def _fill(positions: Floats, known: Bools, bones: Iterable[tuple[int, int]]) -> Floats:
    """Positions without NaN: unseen joints keep to the joint that they hang on."""
    filled = positions.copy()
    frames = np.arange(len(filled))
    parents = dict(bones)
    for joint in _from_roots(filled.shape[1], parents):
        seen = known[:, joint]
        if seen.all():
            continue
        if not seen.any():
            filled[:, joint] = 0.0
            continue
        base = filled[:, parents[joint]] if joint in parents else np.zeros_like(filled[:, joint])
        step = filled[:, joint] - base
        for axis in range(3):
            away = np.interp(frames[~seen], frames[seen], step[seen, axis])
            filled[~seen, joint, axis] = base[~seen, axis] + away
    return filled


def _from_roots(n_joints: int, parents: dict[int, int]) -> list[int]:
    """Joints, each after the one that it hangs on."""

    def depth(joint: int) -> int:
        steps = 0
        while joint in parents and steps <= n_joints:
            joint, steps = parents[joint], steps + 1
        return steps

    return sorted(range(n_joints), key=depth)


def _height(positions: Floats) -> float:
    """Median over time of the vertical extent, metres."""
    if not positions.size:
        return 1.0
    return round(float(np.median(np.ptp(positions[..., 1], axis=1))) or 1.0, 3)


def _reach(positions: Floats) -> float:
    """How far joints come above the lowest, metres: what a camera has to see."""
    if not positions.size:
        return 1.0
    heights = positions[..., 1]
    return round(float(np.percentile(heights.max(axis=1), 98) - heights.min()) or 1.0, 3)


def _floor(positions: Floats) -> float:
    """Height of the ground, metres: what the lowest joint seldom goes below."""
    lowest = np.where(np.isnan(positions[..., 1]), np.inf, positions[..., 1]).min(axis=1)
    lowest = lowest[np.isfinite(lowest)]
    return round(float(np.percentile(lowest, 2)), 3) if len(lowest) else 0.0


def _gaps(known: Bools, page_hz: float) -> list[tuple[float, float]]:
    """Segments in which joints that are seen elsewhere are not, seconds."""
    runs = find_runs(np.asarray(~known.all(axis=1))) / page_hz
    return [
        (round(start, 3), round(stop, 3))
        for start, stop in runs.tolist()
        if stop - start >= _LEAST_GAP_S
    ]


# -- lanes ----------------------------------------------------------------------------------


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
            values = (label.cost, label.score, label.known)
            rounded = [None if value is None else _round(value) for value in values]
            times = _round(label.start_s), _round(label.end_s)
            # Name, start, end, cost, score, known fraction, and the number of its reason.
            rows.append([label.name, *times, *rounded, reason])
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
    why, features = explain(evidence), evidence.sequence.feature_set
    number = {name: i for i, name in enumerate(features.ids)}
    phrases = {name: i for i, name in enumerate(features.names)}

    def ranked(findings: Sequence[Finding]) -> list[list[Any]]:
        """Feature, whether it is asked for to hold, start, end and weight of each."""
        rows = []
        for one in sorted(findings, key=lambda one: -one.weight):
            index = number[one.feature]
            holds = int(one.phrase == features.features[index].phrase(True))
            rows.append([index, holds, *map(_round, (one.start_s, one.end_s, one.weight))])
        return rows

    gains = sorted(why.gains, key=lambda gain: -abs(gain.part))
    return {
        "fraction": _round(why.fraction_held),
        "held": ranked(why.held),
        "failed": ranked(why.failed),
        "unknown": [phrases[name] for name in why.unknown],
        "gains": [[number[gain.feature], _round(gain.part)] for gain in gains if gain.part],
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
    """
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
        "kind": "cost" if found.candidates is None else "score",
        "unit": CURVE_UNIT,
        "block": block.name,
        "n_frames": n_frames,
        "classes": [{"name": name, "threshold": _round(limits[name])} for name in chosen],
    }
    return content, block


def _round(value: float) -> float:
    return round(float(value), 4)


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
