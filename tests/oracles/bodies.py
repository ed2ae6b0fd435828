"""Skinning and z-buffer by their definitions, one point and one pixel at a time."""

import numpy as np


def skinned(rest, bones, weights, rest_joints, turns, joints):
    """Points (points, 3) of one pose: weighted mean of where each bone carries them."""
    result = np.zeros_like(rest)
    for i in range(len(rest)):
        for bone, weight in zip(bones[i], weights[i], strict=True):
            result[i] += weight * (turns[bone] @ (rest[i] - rest_joints[bone]) + joints[bone])
    return result


def ray_depths(vertices, faces, directions):
    """Smallest t > 0 at which rays t * direction from the origin meet a triangle; inf if none."""
    nearest = np.full(len(directions), np.inf)
    for a, b, c in vertices[faces]:
        u, v = b - a, c - a
        across = np.cross(directions, v)
        determinant = across @ u
        with np.errstate(divide="ignore", invalid="ignore"):
            first = -(across @ a) / determinant
            second = directions @ np.cross(-a, u) / determinant
            t = (v @ np.cross(-a, u)) / determinant
            inside = (first >= 0) & (second >= 0) & (first + second <= 1) & (t > 0)
        nearest = np.where(inside & (t < nearest), t, nearest)
    return nearest
