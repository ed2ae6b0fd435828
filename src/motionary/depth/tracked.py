"""What a tracker is told and what it tells, and tracked poses as a motion."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body, Camera
from motionary.depth.fitting import State, Support, SurfaceSettings
from motionary.depth.graph import N_EXTREMA, Graph
from motionary.depth.lookup import Comparison
from motionary.depth.preparation import Cloud, PreparationSettings
from motionary.errors import InvalidInput
from motionary.motion import GENERIC_JOINTS, Motion, Skeleton, forward_kinematics
from motionary.recording import Recording
from motionary.rotations import matrices_to_quaternions
from motionary.skeletons import named_mapping

Floats = NDArray[np.float64]
Hypothesis = Literal["local", "lookup", "none"]
Status = Literal["tracked", "unsure", "none"]

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


@dataclass(frozen=True, slots=True)
class TrackerSettings:
    """How a pose is tracked.

    Attributes
    ----------
    published : the printed method whole
    hypotheses : "both", or one of them alone
    every : images from one lookup to the next; sooner where the local pose gets worse
    ranked : candidates of the database that the image ranks
    pixels : of the person in images that rank
    lead : by how much better the lookup must be to win, as a fraction of the cost
    shape_after : images after which the body takes the person's shape; 0 keeps it
    duel : images for which a pose that looks the other way is followed beside, from the start, and
        longer until one of them is clearly better
    surface : how poses are fitted
    preparation : what of the image is the person
    """

    published: bool = False
    hypotheses: Literal["both", "local", "lookup"] = "both"
    every: int = 1
    ranked: int = 12
    pixels: int = 500
    lead: float = 0.03
    shape_after: int = 30
    duel: int = 30
    surface: SurfaceSettings = field(default_factory=SurfaceSettings)
    preparation: PreparationSettings = field(default_factory=PreparationSettings)

    def __post_init__(self) -> None:
        if self.every < 1 or (self.every > 1 and (self.published or self.hypotheses == "lookup")):
            raise InvalidInput(
                f"every needs to be 1 or more, and 1 where the lookup is asked in all images "
                f"(published, hypotheses='lookup'), got {self.every}"
            )


class TrackedPose(NamedTuple):
    """The pose in one image.

    Attributes
    ----------
    joints : array, shape (joints, 3), metres; NaN where no person is
    turns : array, shape (joints, 3, 3), relative to the parents
    ends : array, shape (5, 3), of `body.ENDS`
    confidence : array, shape (joints,), in [0, 1]
    hypothesis : which won
    status : "tracked", "unsure" or "none", if no person is seen
    reason : why it is not "tracked", in a sentence
    cost : how far the pose is from the image, metres
    extrema : array, shape (20, 3), in the world; NaN where none were searched
    chosen : array, shape (5, 3), the extrema taken for the ends
    seconds : processor time by part
    """

    joints: Floats
    turns: Floats
    ends: Floats
    confidence: Floats
    hypothesis: Hypothesis
    status: Status
    reason: str
    cost: float
    extrema: Floats
    chosen: Floats
    seconds: dict[str, float]


class Found(NamedTuple):
    """A hypothesis: its name, pose, what holds it, and how far it is from the image."""

    name: Hypothesis
    state: State
    support: Support | None
    comparison: Comparison

    @property
    def cost(self) -> float:
        """How far the pose is from the image, in metres."""
        return float(self.comparison.costs[0])


class Ends(NamedTuple):
    """The graph of an image, its extrema, those chosen for the ends, and the person's middle."""

    graph: Graph
    extrema: Floats
    chosen: Floats
    centre: Floats


class Seen(NamedTuple):
    """What is read off an image before any pose; `ends` only where the lookup is asked."""

    cloud: Cloud
    points: Floats
    small: Floats
    eye: Camera
    ends: Ends | None = None


def nothing_found(body: Body, reason: str, seconds: dict[str, float]) -> TrackedPose:
    """What is told of an image without a person."""
    n = len(body.names)
    return TrackedPose(
        np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full((5, 3), np.nan),
        np.zeros(n), "none", "none", reason, np.inf, np.full((N_EXTREMA, 3), np.nan),
        np.full((5, 3), np.nan), seconds,
    )  # fmt: skip


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
    positions = forward_kinematics(skeleton, turns, roots)
    positions[confidence < least_confidence] = np.nan
    positions[~seen] = np.nan
    return Motion(
        GENERIC_JOINTS, positions, Recording(name, rate_hz=rate_hz), named_mapping("generic"),
        skeleton, matrices_to_quaternions(turns), notes=_list_notes(poses),
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


def _list_notes(poses: Sequence[TrackedPose]) -> tuple[str, ...]:
    """How many images are unsure or without a person, by reason."""
    counts: dict[str, int] = {}
    for pose in poses:
        if pose.reason:
            kind = pose.reason.split(":")[0]
            counts[kind] = counts.get(kind, 0) + 1
    return tuple(f"{n} of {len(poses)} images: {kind}" for kind, n in counts.items())
