"""Keypoints whose exchanged sides are put right, before anything is tracked."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.io.cameras import CalibratedCamera
from motionary.io.keypoints import Views
from motionary.labels import Label, LabelTrack
from motionary.multiview.exchange import Exchange, exchange_sources, find_exchanges
from motionary.multiview.views import move_frames, open_views, shift
from motionary.recording import Recording, find_runs


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
    own = in_own_frames(find_exchanges(fitted.sight), fitted.offsets)
    sources = exchange_sources(shift(fitted.sight, -fitted.offsets), own)
    track = label_exchanges(own, views.cameras, recording)
    return Untangled(views, sources, own, track, (*views.notes, *fitted.notes))


def in_own_frames(exchanges: Sequence[Exchange], offsets: NDArray[np.intp]) -> tuple[Exchange, ...]:
    """Exchanges of images that were moved, by the frames of each camera's own images."""
    return tuple(
        Exchange(
            one.limb,
            move_frames(one.exchanged, -offsets),
            move_frames(one.margin, -offsets, empty=np.inf),
        )
        for one in exchanges
    )


def label_exchanges(
    exchanges: Sequence[Exchange], cameras: Sequence[str], recording: Recording
) -> LabelTrack:
    """Labels "legs exchanged" and "legs unsure", each with its camera, of all segments."""
    labels = []
    for one in exchanges:
        for what, mask in (("exchanged", one.exchanged), ("unsure", one.unsure)):
            for camera, own in zip(cameras, mask, strict=True):
                labels += [
                    Label(
                        f"{one.limb} {what}",
                        first / recording.rate_hz,
                        stop / recording.rate_hz,
                        start_frame=recording.first_frame + first,
                        end_frame=recording.first_frame + stop - 1,
                        extra={"camera": camera},
                    )
                    for first, stop in find_runs(own).tolist()
                ]
    return LabelTrack(recording, tuple(labels))
