"""The measured quantities behind the features.

The generic features of Müller and Röder (2006), appendix A: signed distances from planes,
angles, and velocities of joints, as functions of the joints they need.

Conventions: each is called as function(body, window_s, *joints) and gives an array
(frames,) in metres, metres per second or degrees; NaN where a joint it needs is not seen.
`window_s` is what a velocity is averaged over; quantities of a pose leave it aside.
"""

from collections.abc import Sequence
from functools import reduce

import numpy as np

from motionary.features.body import Body, Floats, angle_between, dot, norm
from motionary.motion import GENERIC_JOINTS

FEET = ("lankle", "rankle", "ltoes", "rtoes")
EXTREMITIES = ("lankle", "rankle", "lwrist", "rwrist", "headtop", "root")

# -- distances --------------------------------------------------------------------------


def plane(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """Signed distance of q from the plane with normal (a - c) x (b - c) through c."""
    return dot(body.normal(a, b, c), body[q] - body[c])


def plane_difference(body: Body, window_s: float, a: str, b: str, c: str, q: str, r: str) -> Floats:
    """Signed distance of q from a plane less that of r."""
    return dot(body.normal(a, b, c), body[q] - body[r])


def along(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """Distance of q beyond c in the direction from a to b."""
    return dot(body.direction(a, b), body[q] - body[c])


def reach(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """Size of `along`, whatever its sign."""
    size: Floats = np.abs(along(body, window_s, a, b, c, q))
    return size


def above_lowest(body: Body, window_s: float, joint: str, *without: str) -> Floats:
    """Height of a joint above the lowest seen joint, some joints left out."""
    others = tuple(j for j in GENERIC_JOINTS if j not in without)
    return body.height(joint) - _lowest(body, others)


def extent_up(body: Body, window_s: float, needed: str) -> Floats:
    """Height of the highest seen joint above the lowest; needs one joint to be seen."""
    extent: Floats = _highest(body, GENERIC_JOINTS) - _lowest(body, GENERIC_JOINTS)
    extent[np.isnan(body.height(needed))] = np.nan
    return extent


def extent_aside(body: Body, window_s: float, *joints: str) -> Floats:
    """Widest horizontal distance between any two of the joints."""
    widest = np.zeros(body.n_frames)
    for i, a in enumerate(joints):
        for b in joints[:i]:
            across, deep = body[a][0] - body[b][0], body[a][2] - body[b][2]
            np.maximum(widest, across * across + deep * deep, out=widest)
    return np.sqrt(widest)


def _lowest(body: Body, joints: Sequence[str]) -> Floats:
    """Height of the lowest seen joint; unknown while no foot is seen, as feet stand lowest."""

    def compute() -> Floats:
        # Unlike np.minimum, np.fmin passes over what is not seen.
        lowest: Floats = reduce(np.fmin, [body.height(j) for j in joints])
        footless = np.isnan(reduce(np.fmin, [body.height(j) for j in FEET]))
        return np.where(footless, np.nan, lowest)

    return body.kept(("lowest", *joints), compute)


def _highest(body: Body, joints: Sequence[str]) -> Floats:
    return body.kept(
        ("highest", *joints), lambda: reduce(np.fmax, [body.height(j) for j in joints])
    )


# -- angles -----------------------------------------------------------------------------


def angle(body: Body, window_s: float, a: str, b: str, c: str, d: str) -> Floats:
    """Angle between the segments from a to b and from c to d, degrees."""
    return angle_between(body[b] - body[a], body[d] - body[c])


def tilt(body: Body, window_s: float, a: str, b: str) -> Floats:
    """Angle between the segment from a to b and the vertical, degrees."""
    segment = body[b] - body[a]
    up = np.zeros_like(segment)
    up[1] = 1.0
    return angle_between(segment, up)


# -- velocities -------------------------------------------------------------------------


def move_plane(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """Velocity of q relative to c along the normal of the plane a, b, c."""
    return dot(body.normal(a, b, c), body.velocity(q, relative_to=c, window_s=window_s))


def move_along(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """Velocity of q relative to c in the direction from a to b."""
    return dot(body.direction(a, b), body.velocity(q, relative_to=c, window_s=window_s))


def move_against(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """Velocity of q relative to c against the direction from a to b."""
    return -move_along(body, window_s, a, b, c, q)


def speed(body: Body, window_s: float, *joints: str) -> Floats:
    """Absolute speed; of several joints, that of the slowest."""
    speeds = [norm(body.velocity(j, relative_to=None, window_s=window_s)) for j in joints]
    return reduce(np.minimum, speeds)


def turning(body: Body, window_s: float, a: str, b: str) -> Floats:
    """Turn of the direction from a to b on the floor, degrees per second.

    From each frame to the next, unaveraged; 0 in the last frame. A single frame shows no
    turn: NaN.
    """
    line = body[b] - body[a]
    if body.n_frames == 1:
        return np.full(1, np.nan)
    x, z = line[0], line[2]
    crossed = x[:-1] * z[1:] - z[:-1] * x[1:]
    aligned = x[:-1] * x[1:] + z[:-1] * z[1:]
    turns = np.empty(body.n_frames)
    turns[:-1] = np.degrees(np.arctan2(np.abs(crossed), aligned)) * body.rate_hz
    turns[-1] = 0.0 * x[-1]
    return turns
