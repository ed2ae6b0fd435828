"""Keypoints whose exchanged sides are put right, before anything is tracked."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.cameras import CalibratedCamera, read_cameras
from motionary.io.keypoints import Views, read_keypoints
from motionary.labels import Label, LabelTrack
from motionary.multiview.exchange import Exchange, exchange_sources, find_exchanges
from motionary.multiview.views import FittedViews, fit_views, shift
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
    if not 0 < rate_hz < np.inf:
        raise InvalidInput(f"rate_hz must be a positive number, got {rate_hz}")
    views = keypoints if isinstance(keypoints, Views) else read_keypoints(keypoints)
    name = "keypoints" if isinstance(keypoints, Views) else Path(keypoints).resolve().name
    given = read_cameras(cameras) if isinstance(cameras, str | Path) else cameras
    fitted = fit_views(views, given, unit=unit, synchronise=synchronise)
    found = find_exchanges(fitted.sight)
    own = tuple(_unshift(one, fitted) for one in found)
    recording = Recording(
        name, rate_hz=rate_hz, n_frames=views.n_frames, first_frame=views.first_frame
    )
    sources = exchange_sources(shift(fitted.sight, -fitted.offsets), own)
    track = label_exchanges(own, views.cameras, recording)
    return Untangled(views, sources, own, track, (*views.notes, *fitted.notes))


def _unshift(one: Exchange, fitted: FittedViews) -> Exchange:
    """The exchange by the frames of each camera's own images."""
    exchanged, margin = np.zeros_like(one.exchanged), np.full_like(one.margin, np.inf)
    n = exchanged.shape[1]
    for camera, offset in enumerate(fitted.offsets.tolist()):
        own = slice(max(0, offset), n - max(0, -offset))
        here = slice(max(0, -offset), n - max(0, offset))
        exchanged[camera, own] = one.exchanged[camera, here]
        margin[camera, own] = one.margin[camera, here]
    return Exchange(one.limb, exchanged, margin)


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
