"""Whole recordings of a depth camera: tracked image by image, and the poses as a motion."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body, Camera
from motionary.depth.clouds import learn_background
from motionary.depth.judging import TrackedPose, TrackerSettings
from motionary.depth.poses import PoseDatabase
from motionary.depth.tracking import MEAN_STATURE_M, DepthTracker
from motionary.errors import InvalidInput
from motionary.io.depth_images import DepthRecording
from motionary.matching.distance import Engine
from motionary.motion import GENERIC_JOINTS, Motion, Skeleton, forward_kinematics
from motionary.recording import Recording, find_runs
from motionary.rotations import matrices_to_quaternions
from motionary.skeletons import named_mapping

Floats = NDArray[np.float64]

# Parents of the generic joints, and the body's joint that each lies on and turns with.
_TREE = {
    "root": ("", "root"), "belly": ("root", "belly"), "chest": ("belly", "chest"),
    "neck": ("chest", "head"), "head": ("neck", ""), "headtop": ("head", ""),
    **{
        side + joint: (
            parent if parent in ("root", "chest") else side + parent,
            own and side + own,
        )
        for side in "lr"
        for joint, parent, own in (
            ("hip", "root", "thigh"), ("knee", "hip", "shank"), ("ankle", "knee", "foot"),
            ("toes", "ankle", ""), ("clavicle", "chest", "clavicle"),
            ("shoulder", "clavicle", "upperarm"), ("elbow", "shoulder", "forearm"),
            ("wrist", "elbow", "hand"), ("fingers", "wrist", ""),
        )
    },
}  # fmt: skip
_ENDS = ("headtop", "lfingers", "rfingers", "ltoes", "rtoes")


class Tracking(NamedTuple):
    """What a recording gives.

    `motion` of the person, `poses` image by image, `body` and `camera` that they belong to.
    """

    motion: Motion
    poses: list[TrackedPose]
    body: Body
    camera: Camera

    def cut_to_person(self, *, gapless: bool) -> Motion:
        """The motion from the first to the last image with a person; what is left out is noted.

        `gapless` is its longest run without an image that lacks one, for formats that hold no
        unknown joints.
        """
        seen = np.array([pose.status != "none" for pose in self.poses])
        first, stop = int(seen.argmax()), len(seen) - int(seen[::-1].argmax())
        if not gapless or seen[first:stop].all():
            return self.motion.cut(first, stop)
        first, stop = max(find_runs(seen), key=lambda run: run[1] - run[0])
        kept = f"BVH holds no gaps: images {first} to {stop - 1} are written, the longest run"
        motion = self.motion.cut(first, stop)
        return replace(motion, notes=(*motion.notes, kept))

    def as_dict(self) -> dict[str, Any]:
        """What is said of it, in plain values: counts of images, fit, stature, notes."""
        counts = Counter(pose.status for pose in self.poses)
        seen = [pose for pose in self.poses if pose.status != "none"]
        return {
            "recording": self.motion.source,
            "rate_hz": self.motion.rate_hz,
            "images": len(self.poses),
            "tracked": counts["tracked"],
            "unsure": counts["unsure"],
            "none": counts["none"],
            "lookup": sum(pose.hypothesis == "lookup" for pose in self.poses),
            "cost_m": round(float(np.mean([pose.cost for pose in seen])), 4),
            "confidence": round(float(np.mean([pose.confidence for pose in seen])), 3),
            "stature_m": round(float(np.ptp(self.body.vertices[:, 1])), 3),
            "notes": list(self.motion.notes),
        }


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
    stature_m: float | None = None,
    background: DepthRecording | Floats | int | None = None,
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
    stature_m : of the person; the mean of adults if None
    background : the empty scene: a recording, depth, or how many of the first images show it
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
    elif isinstance(background, DepthRecording):
        empty = learn_background(np.stack(list(background.images())))
    elif background is not None:
        empty = background
    tracker = DepthTracker(
        camera_of(recording), database, settings=settings, background=empty, engine=engine,
        stature_m=MEAN_STATURE_M if stature_m is None else stature_m,
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


def to_motion(
    poses: Sequence[TrackedPose],
    body: Body,
    *,
    rate_hz: float,
    name: str = "",
    least_confidence: float = 0.0,
) -> Motion:
    """Tracked poses as a motion of the 24 generic joints, with their tree and turns.

    Parameters
    ----------
    poses : one after the other
    body : the tracker's, as it is at the end
    rate_hz : images a second
    name : of the recording
    least_confidence : joints with less are unknown (NaN); all are told if 0

    Raises
    ------
    InvalidInput
        If no pose is tracked.
    """
    seen = np.array([pose.status != "none" for pose in poses])
    if not seen.any():
        raise InvalidInput("no person is tracked in any image")
    own = [_TREE[joint][1] for joint in GENERIC_JOINTS]
    turns = np.tile(np.eye(3), (len(poses), len(GENERIC_JOINTS), 1, 1))
    roots = np.full((len(poses), 3), np.nan)
    confidence = np.zeros((len(poses), len(GENERIC_JOINTS)))
    skeleton = _skeleton(body)
    for frame in np.flatnonzero(seen).tolist():
        pose = poses[frame]
        for k, joint in enumerate(own):
            if joint:
                turns[frame, k] = pose.turns[body.index(joint)]
                confidence[frame, k] = pose.confidence[body.index(joint)]
            else:
                confidence[frame, k] = confidence[frame, skeleton.parents[k]]
        roots[frame] = pose.joints[0] - skeleton.offsets[0]
    reasons = Counter(pose.reason.split(":")[0] for pose in poses if pose.reason)
    notes = tuple(f"{n} of {len(poses)} images: {reason}" for reason, n in reasons.items())
    positions = forward_kinematics(skeleton, turns, roots)
    positions[confidence < least_confidence] = np.nan
    positions[~seen] = np.nan
    return Motion(
        GENERIC_JOINTS, positions, Recording(name, rate_hz=rate_hz), named_mapping("generic"),
        skeleton, matrices_to_quaternions(turns), notes=notes,
    )  # fmt: skip


def _skeleton(body: Body) -> Skeleton:
    """The generic joints of a body at rest; a head lies halfway from the neck to its top."""
    places = {
        joint: body.joints[body.index(own)] for joint, (_, own) in _TREE.items() if own
    } | dict(zip(_ENDS, body.vertices[body.ends], strict=True))
    places["head"] = (places["neck"] + places["headtop"]) / 2
    parents = np.array(
        [
            GENERIC_JOINTS.index(_TREE[joint][0]) if _TREE[joint][0] else -1
            for joint in GENERIC_JOINTS
        ]
    )
    offsets = np.array(
        [
            places[joint] - (places[GENERIC_JOINTS[parent]] if parent >= 0 else 0)
            for joint, parent in zip(GENERIC_JOINTS, parents, strict=True)
        ]
    )
    return Skeleton(GENERIC_JOINTS, parents, offsets)
