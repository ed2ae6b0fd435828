"""Whole recordings of several cameras: a person tracked, or only exchanged sides put right."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.io.cameras import CalibratedCamera
from motionary.io.keypoints import Views
from motionary.labels import LabelTrack, label_frames
from motionary.models.library import ClassLibrary
from motionary.motion import Motion
from motionary.multiview.chain import to_skeleton
from motionary.multiview.exchange import Exchange, exchange_sources, find_exchanges
from motionary.multiview.poses import PoseMemory
from motionary.multiview.priors import AllocatedPrior, PriorTable
from motionary.multiview.tracking import (
    TABLE,
    Steadiness,
    TrackedPoints,
    find_upright,
    floor_of,
    in_sequence_of,
    measure_steadiness,
    stances,
    steady,
    track_points,
)
from motionary.multiview.views import move_frames, open_views, shift
from motionary.recording import Recording, find_runs
from motionary.skeletons import named_mapping

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Tracking:
    """What was tracked.

    Attributes
    ----------
    motion : keypoints of all frames, y up, metres
    rig : the chain with its turns, for formats that hold rigs; bones of constant length
    confidence : array, shape (frames, points): 1 where two views or more agree, 0 where none tells
    exchanges : exchanged sides as labels
    cameras : in metres, in the axes of the motion
    offsets : by how many frames each camera's images are late
    before, after : steadiness of triangulated and of tracked points
    floor_m : height of the floor; None if no foot is seen
    labels : what was recognised, with a library; None without
    priors : what the recognised motion told, and whether it was taken
    notes : what was assumed and noticed, a sentence each
    """

    motion: Motion
    rig: Motion
    confidence: Floats
    exchanges: LabelTrack
    cameras: tuple[CalibratedCamera, ...]
    offsets: tuple[int, ...]
    before: Steadiness
    after: Steadiness
    floor_m: float | None
    labels: LabelTrack | None
    priors: tuple[AllocatedPrior, ...]
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """What is said of it, in plain values; None where there is nothing to measure."""
        taken = Counter((prior.name, prior.kept) for prior in self.priors)
        return {
            "recording": self.motion.source,
            "rate_hz": self.motion.rate_hz,
            "frames": len(self.motion.positions),
            "before": _plain(self.before),
            "after": _plain(self.after),
            "floor_m": self.floor_m,
            "offsets": list(self.offsets),
            "exchanges": _segments(self.exchanges),
            "labels": None if self.labels is None else _segments(self.labels),
            "priors": [
                {"name": name, "taken": taken[name, True], "not_taken": taken[name, False]}
                for name in dict.fromkeys(prior.name for prior in self.priors)
            ],
            "notes": list(self.notes),
        }


def _plain(measures: Steadiness) -> dict[str, float | None]:
    keys = ("sliding_m_s", "below_floor", "unknown", "jitter_m_s2")
    return {k: None if np.isnan(v) else float(v) for k, v in zip(keys, measures, strict=True)}


def _segments(track: LabelTrack) -> list[dict[str, Any]]:
    return [
        {"label": one.name, "start_s": float(one.start_s), "end_s": float(one.end_s)}
        for one in track
    ]


def track(
    keypoints: str | Path | Views,
    cameras: str | Path | Sequence[CalibratedCamera],
    *,
    rate_hz: float,
    library: ClassLibrary | None = None,
    memory: PoseMemory | None = None,
    named: PriorTable | None = None,
    unit: str | None = None,
    synchronise: bool = False,
) -> Tracking:
    """A person tracked by keypoints of several calibrated cameras.

    Parameters
    ----------
    keypoints : a folder with a folder for each camera, or what `read_keypoints` gives
    cameras : a calibration, or what `read_cameras` gives
    rate_hz : images a second
    library : classes of motion; what is recognised holds resting feet, and lends poses to limbs
        that no view tells
    memory : poses of people, from `remember_poses`; without it the recording's own are lent
    named : what templates mark by name, from `read_priors`; None takes what they mark themselves
    unit : of the calibration: m, dm, cm, mm; found by the length of the legs, if None
    synchronise : move images of cameras that are late or early, instead of refusing them

    Raises
    ------
    InvalidInput
        If cameras and images do not fit; says what would.
    """
    views, fitted, recording = open_views(
        keypoints, cameras, rate_hz=rate_hz, unit=unit, synchronise=synchronise
    )
    upright, said = find_upright(fitted.sight)
    sight = fitted.sight.turned(upright)
    # Points that the layout has and the detector never gives would be made up in every frame.
    sight = sight.of_points(np.flatnonzero(sight.weights.any(axis=(0, 1))).tolist())
    found = track_points(sight, rate_hz=rate_hz)
    labels: LabelTrack | None = None
    priors: tuple[AllocatedPrior, ...] = ()
    if library is not None:
        steadied = steady(found, library, recording, memory=memory, named=named)
        found, labels, priors = steadied.found, steadied.labels[-1], steadied.priors
    names = found.chain.points
    floor = floor_of(names, found.points)
    tracked = in_sequence_of(sight.names, names, found.points)
    standing = stances(sight.names, tracked, rate_hz)
    before, after = (
        measure_steadiness(sight.names, points, rate_hz, standing=standing, floor=floor)
        for points in (found.triangulated.points, tracked)
    )
    skeleton, rotations, joints = to_skeleton(found.chain, found.pose)
    exchanges = _in_own_frames(found.exchanges, fitted.offsets)
    return Tracking(
        Motion(names, found.points, recording, mapping=named_mapping(TABLE, names)),
        Motion(skeleton.names, joints, recording, None, skeleton, rotations),
        found.confidence,
        _label_exchanges(exchanges, views.cameras, recording),
        fitted.place_cameras(views.cameras, upright),
        tuple(fitted.offsets.tolist()),
        before,
        after,
        floor,
        labels,
        priors,
        (*views.notes, *fitted.notes, said, *_note_certainty(found)),
    )


def _note_certainty(found: TrackedPoints) -> list[str]:
    notes = [f"rays at the person are certain to {1000 * found.settings.noise_m:.0f} mm"]
    alone = float((found.confidence <= 0.05).mean())
    if alone > 0:
        notes.append(f"{100 * alone:.1f} % of points are told by no view, but by the chain alone")
    return notes


class Untangled(NamedTuple):
    """What was exchanged.

    Attributes
    ----------
    views : the keypoints as read
    sources : array, shape (cameras, frames, points), which point takes each point's place
    exchanges : of legs and arms
    track : what was exchanged and where it is unsure, as labels
    notes : what was noticed, a sentence each
    """

    views: Views
    sources: NDArray[np.intp]
    exchanges: tuple[Exchange, ...]
    track: LabelTrack
    notes: tuple[str, ...]


def untangle(
    keypoints: str | Path | Views,
    cameras: str | Path | Sequence[CalibratedCamera],
    *,
    rate_hz: float,
    unit: str | None = None,
    synchronise: bool = False,
) -> Untangled:
    """Keypoints of several cameras with left and right legs and arms put right.

    Parameters
    ----------
    keypoints : a folder with a folder for each camera, or what `read_keypoints` gives
    cameras : a calibration, or what `read_cameras` gives
    rate_hz : images a second, for the times of labels
    unit : of the calibration: m, dm, cm, mm; found by the length of the legs, if None
    synchronise : move images of cameras that are late or early, instead of refusing them

    Raises
    ------
    InvalidInput
        If cameras and images do not fit; says what would.
    """
    views, fitted, recording = open_views(
        keypoints, cameras, rate_hz=rate_hz, unit=unit, synchronise=synchronise
    )
    own = _in_own_frames(find_exchanges(fitted.sight), fitted.offsets)
    sources = exchange_sources(shift(fitted.sight, -fitted.offsets), own)
    track = _label_exchanges(own, views.cameras, recording)
    return Untangled(views, sources, own, track, (*views.notes, *fitted.notes))


def _in_own_frames(
    exchanges: Sequence[Exchange], offsets: NDArray[np.intp]
) -> tuple[Exchange, ...]:
    """Exchanges of images that were moved, by the frames of each camera's own images."""
    return tuple(
        Exchange(
            one.limb,
            move_frames(one.exchanged, -offsets),
            move_frames(one.margin, -offsets, empty=np.inf),
        )
        for one in exchanges
    )


def _label_exchanges(
    exchanges: Sequence[Exchange], cameras: Sequence[str], recording: Recording
) -> LabelTrack:
    """Labels "legs exchanged" and "legs unsure", each with its camera, of all segments."""
    labels = [
        label_frames(recording, f"{one.limb} {what}", first, stop, {"camera": camera})
        for one in exchanges
        for what, mask in (("exchanged", one.exchanged), ("unsure", one.unsure))
        for camera, own in zip(cameras, mask, strict=True)
        for first, stop in find_runs(own).tolist()
    ]
    return LabelTrack(recording, tuple(labels))
