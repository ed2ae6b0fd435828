"""Which measured quantities stand behind the relations?

Generic features of Müller and Röder (2006), appendix A: signed distances from planes,
angles, and velocities of joints, as functions of the joints they need.

Conventions: `Body` holds one array (3, frames) per joint, metres, y up, at one rate;
every quantity is an array (frames,) in metres, metres per second or degrees; NaN where a
joint it needs is not seen.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from motionary.motion import GENERIC_JOINTS

Floats = NDArray[np.float64]

HEIGHT_CHAIN = ("root", "belly", "chest", "neck", "head", "headtop")
LEG_CHAIN = ("rankle", "rknee", "rhip")
EXTREMITIES = ("lankle", "rankle", "lwrist", "rwrist", "headtop", "root")


@dataclass(frozen=True, slots=True)
class Body:
    """Joint tracks of one document, one contiguous (3, frames) array per joint.

    Directions, velocities and heights are kept, as several relations share them.
    """

    joints: dict[str, Floats]
    rate_hz: float
    _cache: dict[tuple[object, ...], Floats] = field(default_factory=dict)

    @classmethod
    def from_positions(cls, positions: Floats, *, rate_hz: float) -> "Body":
        """Body of generic positions, shape (frames, 24, 3)."""
        tracks = np.ascontiguousarray(positions.transpose(1, 2, 0))
        return cls(dict(zip(GENERIC_JOINTS, tracks, strict=True)), rate_hz)

    def __getitem__(self, joint: str) -> Floats:
        return self.joints[joint]

    def kept(self, key: tuple[object, ...], compute: Callable[[], Floats]) -> Floats:
        """Result of `compute`, remembered under `key`."""
        if key not in self._cache:
            self._cache[key] = compute()
        return self._cache[key]


# -- vectors ----------------------------------------------------------------------------


def dot(a: Floats, b: Floats) -> Floats:
    """Scalar product of two (3, frames) arrays, shape (frames,)."""
    result = a[0] * b[0]
    result += a[1] * b[1]
    result += a[2] * b[2]
    return result


def norm(a: Floats) -> Floats:
    """Length of (3, frames) vectors, shape (frames,)."""
    result = dot(a, a)
    return np.sqrt(result, out=result)


def unit(a: Floats) -> Floats:
    """Unit vectors; NaN where the length is zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        result: Floats = a / norm(a)
    return result


def cross(a: Floats, b: Floats) -> Floats:
    """Vector product of two (3, frames) arrays."""
    result = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[j], b[k], out=result[i])
        result[i] -= a[k] * b[j]
    return result


def angle_between(a: Floats, b: Floats) -> Floats:
    """Angle in degrees between (3, frames) vectors; NaN where one has no length."""
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = dot(a, b) / (norm(a) * norm(b))
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def direction(body: Body, a: str, b: str) -> Floats:
    """Unit vector from joint a to joint b."""
    return body.kept(("direction", a, b), lambda: unit(body[b] - body[a]))


def normal(body: Body, a: str, b: str, c: str) -> Floats:
    """Unit normal (a - c) x (b - c) of the plane through three joints."""
    return body.kept(
        ("normal", a, b, c),
        lambda: unit(cross(body[a] - body[c], body[b] - body[c])),
    )


# -- velocities -------------------------------------------------------------------------


def smoothed_velocity(track: Floats, *, width: int, rate_hz: float) -> Floats:
    """Velocity of a track, averaged over `width` forward differences.

    The last difference is repeated; the window of frame i is
    i - ceil(width/2) + 1 ... i + floor(width/2); ends are padded by reflection with the
    edge repeated. Inside, the sum of differences is the difference of two positions.

    Parameters
    ----------
    track : array, shape (3, frames), metres
    width : frames
    rate_hz : frames per second

    Returns
    -------
    array, shape (3, frames), metres per second; NaN where the window meets one
    """
    n = track.shape[1]
    before, after = -(-width // 2) - 1, width // 2
    if n <= 3 * width + 1:
        return _direct_average(_differences(track), width) * rate_hz
    result = np.empty_like(track)
    stop = n - 1 - after
    np.subtract(track[:, width : width + stop - before], track[:, : stop - before],
                out=result[:, before:stop])  # fmt: skip
    result[:, before:stop] /= width
    head = _direct_average(_differences(track[:, : 2 * width + 2]), width)
    tail = _direct_average(_differences(track[:, n - 2 * width - 2 :]), width)
    result[:, :before] = head[:, :before]
    result[:, stop:] = tail[:, stop - n :]
    if np.isnan(track).any():
        _spread_gaps(result, np.isnan(_differences(track)).any(axis=0), before, after)
    result *= rate_hz
    return result


def _differences(track: Floats) -> Floats:
    if track.shape[1] == 1:
        # One frame shows no movement: its velocity is not seen.
        return np.full_like(track, np.nan)
    forward = np.diff(track, axis=1)
    return np.concatenate([forward, forward[:, -1:]], axis=1)


def _direct_average(velocity: Floats, width: int) -> Floats:
    n = velocity.shape[1]
    before, after = -(-width // 2) - 1, width // 2
    padded = np.pad(velocity, ((0, 0), (before, after)), mode="symmetric")
    return np.sum([padded[:, i : i + n] for i in range(width)], axis=0) / width


def _spread_gaps(result: Floats, missing: NDArray[np.bool_], before: int, after: int) -> None:
    """Mark frames whose window meets a missing difference."""
    total = np.concatenate([[0], np.cumsum(missing)])
    n = len(missing)
    first = np.maximum(np.arange(n) - before, 0)
    stop = np.minimum(np.arange(n) + after + 1, n)
    result[:, total[stop] > total[first]] = np.nan


def relative_velocity(body: Body, joint: str, to: str | None, window_s: float) -> Floats:
    """Smoothed velocity of a joint, relative to another if one is given."""

    def compute() -> Floats:
        # A window of 0 s is one frame; the slack keeps 0.1 s at 12 frames of 120 Hz.
        width = max(1, int(np.ceil(window_s * body.rate_hz - 1e-9)))
        track = body[joint] if to is None else body[joint] - body[to]
        return smoothed_velocity(track, width=width, rate_hz=body.rate_hz)

    return body.kept(("velocity", joint, to, window_s), compute)


# -- quantities: each is called as function(body, window_s, *joints) ---------------------


def plane(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """Signed distance of q from the plane with normal (a - c) x (b - c) through c."""
    return dot(normal(body, a, b, c), body[q] - body[c])


def plane_difference(body: Body, window_s: float, a: str, b: str, c: str, q: str, r: str) -> Floats:
    """Signed distance of q from a plane less that of r."""
    return dot(normal(body, a, b, c), body[q] - body[r])


def along(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """How far q lies beyond c in the direction from a to b."""
    return dot(direction(body, a, b), body[q] - body[c])


def reach(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """Size of `along`, whatever its sign."""
    return np.abs(along(body, window_s, a, b, c, q))


def move_plane(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """Velocity of q relative to c along the normal of the plane a, b, c."""
    return dot(normal(body, a, b, c), relative_velocity(body, q, c, window_s))


def move_along(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """Velocity of q relative to c in the direction from a to b."""
    return dot(direction(body, a, b), relative_velocity(body, q, c, window_s))


def move_against(body: Body, window_s: float, a: str, b: str, c: str, q: str) -> Floats:
    """Velocity of q relative to c against the direction from a to b."""
    return -move_along(body, window_s, a, b, c, q)


def angle(body: Body, window_s: float, a: str, b: str, c: str, d: str) -> Floats:
    """Angle between the segments from a to b and from c to d, degrees."""
    return angle_between(body[b] - body[a], body[d] - body[c])


def tilt(body: Body, window_s: float, a: str, b: str) -> Floats:
    """Angle between the segment from a to b and the vertical, degrees."""
    segment = body[b] - body[a]
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = segment[1] / norm(segment)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def speed(body: Body, window_s: float, *joints: str) -> Floats:
    """Absolute speed; of several joints, that of the slowest."""
    speeds = [norm(relative_velocity(body, joint, None, window_s)) for joint in joints]
    return speeds[0] if len(speeds) == 1 else np.minimum(speeds[0], speeds[1])


def above_lowest(body: Body, window_s: float, joint: str, *without: str) -> Floats:
    """Height of a joint above the lowest seen joint, some joints left out."""
    others = tuple(j for j in GENERIC_JOINTS if j not in without)
    return body[joint][1] - _lowest(body, others)


def extent_up(body: Body, window_s: float, needed: str) -> Floats:
    """Height of the highest seen joint above the lowest; needs one joint to be seen."""
    extent = _highest(body) - _lowest(body, GENERIC_JOINTS)
    return np.where(np.isnan(body[needed][1]), np.nan, extent)


def extent_aside(body: Body, window_s: float, *joints: str) -> Floats:
    """Widest horizontal distance between any two of the joints."""
    widest = np.zeros_like(body[joints[0]][0])
    for i, a in enumerate(joints):
        for b in joints[:i]:
            across, deep = body[a][0] - body[b][0], body[a][2] - body[b][2]
            np.maximum(widest, across * across + deep * deep, out=widest)
    return np.sqrt(widest)


def turning(body: Body, window_s: float, a: str, b: str) -> Floats:
    """Turn of the direction from a to b on the floor, degrees per second; last frame 0."""
    line = body[b] - body[a]
    x, z = line[0], line[2]
    crossed = x[:-1] * z[1:] - z[:-1] * x[1:]
    aligned = x[:-1] * x[1:] + z[:-1] * z[1:]
    turns = np.zeros_like(x)
    turns[:-1] = np.degrees(np.arctan2(np.abs(crossed), aligned)) * body.rate_hz
    return turns if len(x) > 1 else np.full_like(x, np.nan)


def _lowest(body: Body, joints: Sequence[str]) -> Floats:
    return body.kept(("lowest", *joints), lambda: _extreme(body, joints, np.minimum, np.fmin))


def _highest(body: Body) -> Floats:
    return body.kept(("highest",), lambda: _extreme(body, GENERIC_JOINTS, np.maximum, np.fmax))


def _extreme(body: Body, joints: Sequence[str], plain: np.ufunc, seen: np.ufunc) -> Floats:
    result = body[joints[0]][1].copy()
    for joint in joints[1:]:
        plain(result, body[joint][1], out=result)
    if np.isnan(result).any():
        result = body[joints[0]][1].copy()
        for joint in joints[1:]:
            seen(result, body[joint][1], out=result)
    return result


# -- lengths that thresholds are measured in --------------------------------------------


def _segments(*chain: str) -> tuple[tuple[str, str], ...]:
    return tuple(zip(chain[:-1], chain[1:], strict=True))


LENGTHS: dict[str, tuple[tuple[str, str], ...]] = {
    "humerus": _segments("rshoulder", "relbow"),
    "left humerus": _segments("lshoulder", "lelbow"),
    "shoulder width": _segments("lshoulder", "rshoulder"),
    "hip width": _segments("lhip", "rhip"),
    "chest to neck": _segments("chest", "neck"),
    "body height": _segments(*LEG_CHAIN) + _segments(*HEIGHT_CHAIN),
}


def body_length(body: Body, name: str) -> float:
    """A length of the body, metres: in the first frame, else the median; NaN if unseen.

    Units that are no lengths (degree) give 1.
    """
    if name not in LENGTHS:
        return 1.0
    return float(sum(_segment_length(body[b] - body[a]) for a, b in LENGTHS[name]))


def _segment_length(segment: Floats) -> float:
    first = norm(segment[:, :1])[0]
    if np.isfinite(first):
        return float(first)
    lengths = norm(segment)
    seen = lengths[np.isfinite(lengths)]
    return float(np.median(seen)) if len(seen) else float("nan")
