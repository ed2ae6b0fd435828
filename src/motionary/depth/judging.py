"""How sure a pose is, and what speaks against an image."""

import numpy as np
from numpy.typing import NDArray

from motionary.body import Camera
from motionary.depth.fitting import Support, Surface
from motionary.depth.graph import Graph
from motionary.depth.lookup import Comparison
from motionary.depth.preparation import Cloud

Floats = NDArray[np.float64]

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


def judge_pose(
    surface: Surface,
    joints: Floats,
    support: Support | None,
    comparison: Comparison,
    camera: Camera,
    *,
    moved: Floats,
) -> Floats:
    """How sure each joint is (joints,), in [0, 1], by what the image is off from the pose near it.

    Parameters
    ----------
    surface : of the body
    joints : array, shape (joints, 3), metres
    support : of the fit; joints without a visible vertex below them are less sure
    comparison : of the rendered pose and the image of `camera`
    camera : of the small image
    moved : array, shape (joints,), metres from the last image to this one
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
    if support is not None:
        n = len(names)
        seen = np.bincount(surface.owners, support.visible, n)
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
