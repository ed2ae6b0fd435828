"""What a tracker is told, sees and finds, how sure a pose is, and what speaks against an image."""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body, Camera
from motionary.depth.clouds import (
    N_EXTREMA,
    Cloud,
    Graph,
    PreparationSettings,
)
from motionary.depth.fitting import (
    Comparison,
    State,
    Surface,
    SurfaceSettings,
)
from motionary.errors import InvalidInput

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Hypothesis = Literal["local", "lookup", "none"]
Status = Literal["tracked", "unsure", "none"]

#: Fewer points are no person.
LEAST_POINTS = 300
#: A pose that is farther from the image, in metres, is not that of what is seen.
UNSURE_M = 0.058
#: Mean error of each joint where people are tracked well, in metres, by the body's names without
#: sides: HDM05's bd, rendered.
_TYPICAL = {
    "root": 0.016, "belly": 0.014, "chest": 0.038, "head": 0.031, "clavicle": 0.021,
    "upperarm": 0.024, "forearm": 0.042, "hand": 0.049, "thigh": 0.020, "shank": 0.019,
    "foot": 0.030, "toes": 0.032,
}  # fmt: skip
# Expected error: powers of what the image is off by around the joint, and by and large, of the
# joint's usual error, and of how far it moved; fitted to HDM05's bd and dg, rendered.
_AROUND_M = 0.12
_CONSTANT, _BY_AROUND, _BY_COST, _BY_TYPICAL, _BY_STEP = 5.4, 0.20, 0.78, 0.44, 0.125
_FLOOR_M, _STEP_FLOOR_M = 0.003, 0.01
# Confidence halves where the expected error is this.
_HALF_M = 0.06
_SMALLEST_M, _LARGEST_M = 0.7, 2.6


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
    """A hypothesis: its name, pose, the vertices seen, and how far it is from the image."""

    name: Hypothesis
    state: State
    visible: NDArray[np.bool_] | None
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


def judge_pose(
    surface: Surface,
    joints: Floats,
    visible: NDArray[np.bool_] | None,
    comparison: Comparison,
    camera: Camera,
    *,
    moved: Floats,
) -> Floats:
    """How sure each joint is (joints,), in [0, 1], by what the image is off from the pose near it.

    `comparison` and `camera` are of the small image; `visible` vertices come from `fit_pose`, and
    joints with hardly any are less sure; `moved` (joints,) is metres since the last image.
    """
    names = surface.body.names
    typical = np.array([_TYPICAL.get(name, _TYPICAL.get(name[1:], 0.03)) for name in names])
    flat = camera.project(joints)
    z = camera.to_camera(joints)[:, 2]
    reach = np.maximum(_AROUND_M * camera.focal[0] / np.maximum(z, 0.1), 1.5)
    rows, columns = np.nonzero(~np.isnan(comparison.apart))
    apart = comparison.apart[rows, columns]
    away = (columns - flat[:, :1]) ** 2 + (rows - flat[:, 1:]) ** 2
    near = away <= reach[:, None] ** 2
    counts = near.sum(axis=1)
    around = np.where(counts > 0, (near * apart).sum(axis=1) / np.maximum(counts, 1), 0.15)
    cost = float(comparison.costs[0])
    expected = (
        _CONSTANT
        * (around + _FLOOR_M) ** _BY_AROUND
        * (cost + _FLOOR_M) ** _BY_COST
        * typical**_BY_TYPICAL
        * (moved + _STEP_FLOOR_M) ** _BY_STEP
    )
    if visible is not None:
        n = len(names)
        seen = np.bincount(surface.owners, visible, n)
        whole = np.maximum(np.bincount(surface.owners, minlength=n), 1)
        expected = expected * np.where(seen / whole < 0.05, 1.5, 1.0)
    confidence: Floats = 1 / (1 + (expected / _HALF_M) ** 2)
    return confidence


def judge_cloud(cloud: Cloud, graph: Graph, camera: Camera) -> str:
    """What speaks against one whole person being seen, in a sentence; empty if nothing does."""
    height, width = cloud.depth.shape
    rows, columns = cloud.pixels // width, cloud.pixels % width
    n_apart = len(cloud.points) - len(graph.nodes)
    if n_apart > 0.3 * len(graph.nodes) or _stands_apart(graph):
        return "more than one person or thing is in front of the background"
    tall = float(np.ptp(graph.points[:, 1]))
    widest = float(np.linalg.norm(np.ptp(graph.points, axis=0)))
    if widest < _SMALLEST_M or tall > _LARGEST_M:
        return (
            f"no person has this size: what is seen is {widest:.2f} m long; are intrinsics and "
            "unit right?"
        )
    on_edge = ((rows == 0) | (rows == height - 1) | (columns == 0) | (columns == width - 1)).sum()
    if on_edge > 0.16 * np.sqrt(len(rows)):
        return "the person is cut off by the image's edge"
    return ""


def _stands_apart(graph: Graph) -> bool:
    """Whether a component as large as a person hangs on the torso by a joint."""
    others = ~graph.torso
    if others.sum() < 0.5 * graph.torso.sum():
        return False
    one, other = graph.points[graph.torso], graph.points[others]
    apart = np.linalg.norm(one.mean(axis=0)[[0, 2]] - other.mean(axis=0)[[0, 2]])
    return bool(apart > 0.5 and min(np.ptp(one[:, 1]), np.ptp(other[:, 1])) > 0.9)
