"""A whole recording of a depth camera, image by image through a tracker."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body, Camera
from motionary.depth.poses import PoseDatabase
from motionary.depth.preparation import learn_background
from motionary.depth.tracked import TrackedPose, TrackerSettings, to_motion
from motionary.depth.tracking import MEAN_STATURE_M, DepthTracker
from motionary.errors import InvalidInput
from motionary.io.depth_images import DepthRecording
from motionary.matching.distance import Engine
from motionary.motion import Motion

Floats = NDArray[np.float64]


class Tracking(NamedTuple):
    """What a recording gives.

    `motion` of the person, `poses` image by image, `body` and `camera` that they belong to.
    """

    motion: Motion
    poses: list[TrackedPose]
    body: Body
    camera: Camera


def camera_of(recording: DepthRecording) -> Camera:
    """The camera of a recording; level, looking along -z from one metre high, if none is told."""
    turn, place = recording.world_from_camera, recording.position
    return Camera(
        recording.width, recording.height, recording.focal, recording.centre,
        np.diag([1.0, -1.0, -1.0]) if turn is None else turn,
        np.array([0.0, 1.0, 0.0]) if place is None else place,
    )  # fmt: skip


def track_recording(
    recording: DepthRecording,
    database: PoseDatabase | None = None,
    *,
    settings: TrackerSettings | None = None,
    stature_m: float = MEAN_STATURE_M,
    background: Floats | int | None = None,
    least_confidence: float = 0.0,
    progress: Callable[[Iterable[Floats]], Iterable[Floats]] = iter,
    engine: Engine = "auto",
) -> Tracking:
    """The motion of a person before a depth camera.

    Parameters
    ----------
    recording : as from `motionary.io.depth_images.read_depth`
    database : of poses; the one that ships if None
    settings : how it is tracked
    stature_m : of the person, as far as known
    background : depth of the empty scene, or how many of the first images show it empty
    least_confidence : joints that are less sure are unknown
    progress : wraps the images on their way
    engine : which twins compute

    Raises
    ------
    InvalidInput
        If no person is tracked in any image.
    """
    images, empty = recording.images(), None
    if isinstance(background, int):
        first = list(islice(images, background))
        if len(first) == len(recording):
            raise InvalidInput(
                f"{background} images of the empty scene leave none of the person",
                file=recording.name,
            )
        empty = learn_background(np.stack(first)) if first else None
    elif background is not None:
        empty = background
    tracker = DepthTracker(
        camera_of(recording), database, stature_m=stature_m, settings=settings, background=empty,
        engine=engine,
    )  # fmt: skip
    skipped = background if isinstance(background, int) else 0
    poses = []
    for number, image in enumerate(progress(images), start=skipped):
        if number in recording.gaps:
            tracker.forget()
        poses.append(tracker.track(image))
    if all(pose.status == "none" for pose in poses):
        raise InvalidInput(f"no person is tracked: {poses[-1].reason}", file=recording.name)
    motion = to_motion(
        poses, tracker.body, rate_hz=recording.rate_hz, name=recording.name,
        least_confidence=least_confidence,
    )  # fmt: skip
    motion = replace(
        motion,
        notes=(*recording.notes, *motion.notes),
        recording=replace(motion.recording, first_frame=skipped),
    )
    return Tracking(motion, poses, tracker.body, tracker.camera)
