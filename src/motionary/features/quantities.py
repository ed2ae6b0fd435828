"""The measured quantities behind the features.

The generic features of Müller and Röder (2006), appendix A: signed distances from planes,
angles, and velocities of joints, as functions of the joints they need. Beside them stand
coordinates in the frame of the body: left is the line of the hips on the floor, ahead at right
angles to it, up the vertical.

Conventions: each is called as function(body, window_s, *joints) and gives an array
(frames,) in metres, metres per second or degrees; NaN where a joint it needs is not seen.
`window_s` is what a velocity is averaged over; quantities of a pose leave it aside.
"""

from collections.abc import Sequence
from functools import reduce

import numpy as np

from motionary.features.body import (
    Body,
    Floats,
    angle_of,
    dot,
    norm,
    smoothed_velocity,
    window_frames,
)
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


def ahead(body: Body, window_s: float, joint: str, origin: str) -> Floats:
    """How far a joint is ahead of another, in the direction that the hips face."""
    return dot(body.heading("ahead"), body[joint] - body[origin])


def to_left(body: Body, window_s: float, joint: str, origin: str) -> Floats:
    """How far a joint is to the left of another, along the line of the hips."""
    return dot(body.heading("left"), body[joint] - body[origin])


def outward(body: Body, window_s: float, joint: str, origin: str) -> Floats:
    """How far a joint of one side is out to that side of another."""
    return to_left(body, window_s, joint, origin) * _outward_sign(joint)


def above(body: Body, window_s: float, joint: str, origin: str) -> Floats:
    """Height of a joint above another."""
    return body.height(joint) - body.height(origin)


def above_feet(body: Body, window_s: float, joint: str) -> Floats:
    """Height of a joint above the lower foot."""
    lowest: Floats = reduce(np.fmin, [body.height(j) for j in FEET])
    return body.height(joint) - lowest


def distance(body: Body, window_s: float, joint: str, other: str) -> Floats:
    """Distance between two joints."""
    return body.distance(joint, other)


# -- angles -----------------------------------------------------------------------------


def angle(body: Body, window_s: float, a: str, b: str, c: str, d: str) -> Floats:
    """Angle between the segments from a to b and from c to d, degrees."""
    product = dot(body[b] - body[a], body[d] - body[c])
    return angle_of(product, body.distance(a, b) * body.distance(c, d))


def tilt(body: Body, window_s: float, a: str, b: str) -> Floats:
    """Angle between the segment from a to b and the vertical, degrees."""
    return angle_of(body.height(b) - body.height(a), body.distance(a, b))


def lean_ahead(body: Body, window_s: float, a: str, b: str) -> Floats:
    """Angle by which the segment from a to b leans ahead, degrees."""
    return _lean(body, "ahead", a, b)


def lean_left(body: Body, window_s: float, a: str, b: str) -> Floats:
    """Angle by which the segment from a to b leans to the left, degrees."""
    return _lean(body, "left", a, b)


def twist(body: Body, window_s: float, a: str, b: str) -> Floats:
    """Turn of the line from b to a against the line of the hips, degrees."""
    line = body.direction(b, a)
    turned = np.arctan2(dot(body.heading("ahead"), line), dot(body.heading("left"), line))
    return np.asarray(np.degrees(turned))


def _lean(body: Body, axis: str, a: str, b: str) -> Floats:
    sine = dot(body.heading(axis), body.direction(a, b))
    return np.asarray(np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))))


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
    x, z = line[0], line[2]
    crossed = x[:-1] * z[1:] - z[:-1] * x[1:]
    aligned = x[:-1] * x[1:] + z[:-1] * z[1:]
    turns = np.empty(body.n_frames)
    turns[:-1] = np.degrees(np.arctan2(np.abs(crossed), aligned)) * body.rate_hz
    for part in body.parts:
        last = part.stop - 1
        turns[last] = 0.0 * x[last] if last > part.start else np.nan
    return turns


def turning_left(body: Body, window_s: float, a: str, b: str) -> Floats:
    """Turn of the direction from a to b on the floor to the left, degrees per second.

    The mean over the window; NaN where the direction is unknown.
    """
    line = body[b] - body[a]
    # Seen from above, with x to the right, z points down.
    angles = np.arctan2(-line[2], line[0])
    width = window_frames(window_s, body.rate_hz)
    return np.concatenate([_turned(angles[part], width, body.rate_hz) for part in body.parts])


def _turned(angles: Floats, width: int, rate_hz: float) -> Floats:
    """Degrees a second by which angles in radians grow, shape (frames,)."""
    seen = np.flatnonzero(np.isfinite(angles))
    if len(seen) < 2:
        return np.full(len(angles), np.nan)
    whole = np.interp(np.arange(len(angles)), seen, np.unwrap(angles[seen]))
    track = np.stack([whole, np.zeros_like(whole), np.zeros_like(whole)])
    turned = smoothed_velocity(track, width=min(width, len(angles)), rate_hz=rate_hz)[0]
    return np.where(np.isfinite(angles), np.degrees(turned), np.nan)


def move_ahead(body: Body, window_s: float, joint: str, *relative_to: str) -> Floats:
    """Velocity of a joint, or relative to another, in the direction that the hips face."""
    return dot(body.heading("ahead"), _velocity(body, window_s, joint, *relative_to))


def move_left(body: Body, window_s: float, joint: str, *relative_to: str) -> Floats:
    """Velocity of a joint, or relative to another, to the left along the line of the hips."""
    return dot(body.heading("left"), _velocity(body, window_s, joint, *relative_to))


def move_outward(body: Body, window_s: float, joint: str, *relative_to: str) -> Floats:
    """Velocity of a joint of one side, or relative to another, out to that side."""
    return move_left(body, window_s, joint, *relative_to) * _outward_sign(joint)


def move_up(body: Body, window_s: float, joint: str, *relative_to: str) -> Floats:
    """Velocity of a joint, or relative to another, upwards."""
    up: Floats = _velocity(body, window_s, joint, *relative_to)[1]
    return up


def relative_speed(body: Body, window_s: float, joint: str, other: str) -> Floats:
    """Size of the velocity of a joint relative to another."""
    return norm(_velocity(body, window_s, joint, other))


def travel(body: Body, window_s: float, joint: str) -> Floats:
    """Speed of a joint along the floor."""
    velocity = _velocity(body, window_s, joint)
    return np.asarray(np.hypot(velocity[0], velocity[2]))


def fastest(body: Body, window_s: float, *joints: str) -> Floats:
    """Absolute speed of the fastest joint that is seen."""
    fast: Floats = reduce(np.fmax, [speed(body, window_s, joint) for joint in joints])
    return fast


def mean_speed(body: Body, window_s: float, *joints: str) -> Floats:
    """Mean of the absolute speeds of joints."""
    speeds = [speed(body, window_s, joint) for joint in joints]
    return np.asarray(np.mean(speeds, axis=0))


def _outward_sign(joint: str) -> float:
    return -1.0 if joint.startswith("r") and joint != "root" else 1.0


def _velocity(body: Body, window_s: float, joint: str, relative_to: str | None = None) -> Floats:
    return body.velocity(joint, relative_to=relative_to, window_s=window_s)
