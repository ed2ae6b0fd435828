"""Tracks of the joints of one recording, the lengths of its bones, and velocities.

Velocities are those of the programs of Müller and Röder (2006): forward differences, the
last one repeated, averaged by a boxcar over frames i - ceil(w/2) + 1 ... i + floor(w/2), ends
padded by reflection with the edge repeated.

Conventions: a track is an array (3, frames), so that arithmetic runs along frames; metres,
y up; NaN where a joint is not seen or a direction has no length.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motionary.motion import GENERIC_JOINTS, Motion

Floats = NDArray[np.float64]


def _chain(*joints: str) -> tuple[tuple[str, str], ...]:
    return tuple(pairwise(joints))


#: What thresholds are measured in: sums of segments from joint to joint.
LENGTHS: dict[str, tuple[tuple[str, str], ...]] = {
    "humerus": _chain("rshoulder", "relbow"),
    "left humerus": _chain("lshoulder", "lelbow"),
    "shoulder width": _chain("lshoulder", "rshoulder"),
    "hip width": _chain("lhip", "rhip"),
    "chest to neck": _chain("chest", "neck"),
    "body height": _chain("rankle", "rknee", "rhip")
    + _chain("root", "belly", "chest", "neck", "head", "headtop"),
}

#: What is measured instead where a length is never seen, best first: chain and factor.
#: Upper arm by thigh is .71 (.64 to .79) in twelve people of HDM05 and CMU.
SUBSTITUTES: dict[str, tuple[tuple[str, tuple[str, str], float], ...]] = {
    "humerus": (
        ("the left upper arm", ("lshoulder", "lelbow"), 1.0),
        (".71 of the thigh", ("rhip", "rknee"), 0.71),
        (".71 of the thigh", ("lhip", "lknee"), 0.71),
    ),
    "left humerus": (
        ("the right upper arm", ("rshoulder", "relbow"), 1.0),
        (".71 of the thigh", ("lhip", "lknee"), 0.71),
        (".71 of the thigh", ("rhip", "rknee"), 0.71),
    ),
}

#: Lengths are measured within so many seconds of the first frame in which a joint is seen.
REFERENCE_S = 1.0

# 0.1 s at 120 Hz are 12 frames, whatever rounding makes of the product.
_SLACK = 1e-9
# Frames whose coordinates are sorted by joint at once: few enough to stay in the cache.
_BLOCK = 1024


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Joint tracks of one recording.

    Directions, velocities and heights are kept, as several features share them.

    Attributes
    ----------
    tracks : array (3, frames) of each generic joint, metres
    rate_hz : frames per second
    reference : the beginning of the recording, where the tracks are of a later part; its
        lengths are those of the body
    """

    tracks: dict[str, Floats]
    rate_hz: float
    reference: "Body | None" = None
    _kept: dict[tuple[object, ...], Floats] = field(default_factory=dict, repr=False)

    @classmethod
    def from_positions(
        cls, positions: Floats, *, rate_hz: float, reference: "Body | None" = None
    ) -> "Body":
        """Body of generic positions, shape (frames, 24, 3)."""
        n_frames = positions.shape[0]
        tracks = np.empty((len(GENERIC_JOINTS), 3, n_frames))
        for start in range(0, n_frames, _BLOCK):
            block = slice(start, start + _BLOCK)
            tracks[:, :, block] = positions[block].transpose(1, 2, 0)
        return cls(dict(zip(GENERIC_JOINTS, tracks, strict=True)), rate_hz, reference)

    def __getitem__(self, joint: str) -> Floats:
        return self.tracks[joint]

    def height(self, joint: str) -> Floats:
        """Height of a joint, shape (frames,), metres."""
        y: Floats = self.tracks[joint][1]
        return y

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return int(self.tracks["root"].shape[1])

    def kept(self, key: tuple[object, ...], compute: Callable[[], Floats]) -> Floats:
        """Result of `compute`, remembered under `key`; not to be written to."""
        if key not in self._kept:
            self._kept[key] = compute()
        return self._kept[key]

    def direction(self, a: str, b: str) -> Floats:
        """Unit vector from joint a to joint b, shape (3, frames)."""
        return self.kept(("direction", a, b), lambda: unit(self[b] - self[a]))

    def normal(self, a: str, b: str, c: str) -> Floats:
        """Unit normal (a - c) x (b - c) of the plane through three joints."""
        return self.kept(
            ("normal", a, b, c), lambda: unit(cross(self[a] - self[c], self[b] - self[c]))
        )

    def heading(self, axis: str) -> Floats:
        """Unit vector of the body's own frame on the floor: "left" by its hips, or "ahead"."""

        def compute() -> Floats:
            line = self["lhip"] - self["rhip"]
            x, z = (line[0], line[2]) if axis == "left" else (-line[2], line[0])
            return unit(np.stack([x, np.zeros_like(x), z]))

        return self.kept(("heading", axis), compute)

    def velocity(self, joint: str, *, relative_to: str | None, window_s: float) -> Floats:
        """Velocity averaged over a window, shape (3, frames), metres per second."""

        def compute() -> Floats:
            track = self[joint] if relative_to is None else self[joint] - self[relative_to]
            width = window_frames(window_s, self.rate_hz)
            return smoothed_velocity(track, width=width, rate_hz=self.rate_hz)

        return self.kept(("velocity", joint, relative_to, window_s), compute)

    def length(self, name: str) -> float:
        """A length of the body in metres; NaN if it is unseen or zero.

        A segment counts as in the first frame in which any joint is seen; where an end is
        unseen there, with its median over the second that begins there. Where an upper arm
        is unseen in all of it, see `SUBSTITUTES`.

        Parameters
        ----------
        name : one of `LENGTHS`
        """
        if self.reference is not None:
            return self.reference.length(name)
        return float(self.kept(("length", name), lambda: np.array(self._length(name))))

    def _length(self, name: str) -> float:
        total = sum(self._segment(a, b) for a, b in LENGTHS[name])
        if total > 0:
            return total
        return self._substitute(name)[1]

    def reference_length(self, name: str) -> str:
        """Substitute of a length that is never seen; empty if it is seen, or nothing is."""
        seen = sum(self._segment(a, b) for a, b in LENGTHS[name]) > 0
        return "" if seen else self._substitute(name)[0]

    def _substitute(self, name: str) -> tuple[str, float]:
        for substitute, (a, b), factor in SUBSTITUTES.get(name, ()):
            length = self._segment(a, b)
            if length > 0:
                return substitute, factor * length
        return "", float("nan")

    def _segment(self, a: str, b: str) -> float:
        begin = self.first_seen
        block = slice(begin, begin + max(1, round(REFERENCE_S * self.rate_hz)))
        lengths = norm(self[b][:, block] - self[a][:, block])
        seen = lengths[np.isfinite(lengths)]
        if not len(seen):
            return float("nan")
        return float(seen[0] if np.isfinite(lengths[0]) else np.median(seen))

    @property
    def first_seen(self) -> int:
        """First frame in which any joint is seen; 0 if none is."""

        def compute() -> Floats:
            seen = np.isfinite([self.height(joint) for joint in self.tracks]).any(axis=0)
            return np.array(float(seen.argmax()))

        return int(self.kept(("first seen",), compute))


def describe_reference_lengths(motion: Motion) -> tuple[str, ...]:
    """Lengths of a partial body that are measured by others, a sentence each.

    Parameters
    ----------
    motion : whose joints are mapped
    """
    body = Body.from_positions(motion.generic_positions(), rate_hz=motion.rate_hz)
    sides = {
        "right": body.reference_length("humerus"),
        "left": body.reference_length("left humerus"),
    }
    if sides["right"] and sides["right"] == sides["left"]:
        sides = {"": sides["right"]}
    return tuple(
        f"no {f'{side} ' if side else ''}upper arm: {substitute} takes its place as the measure "
        "of distances and speeds"
        for side, substitute in sides.items()
        if substitute
    )


def dot(a: Floats, b: Floats) -> Floats:
    """Scalar product of two tracks, shape (frames,)."""
    result: Floats = a[0] * b[0]
    result += a[1] * b[1]
    result += a[2] * b[2]
    return result


def norm(a: Floats) -> Floats:
    """Length of a track's vectors, shape (frames,)."""
    result = dot(a, a)
    return np.sqrt(result, out=result)


def cross(a: Floats, b: Floats) -> Floats:
    """Vector product of two tracks, shape (3, frames)."""
    result = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[j], b[k], out=result[i])
        result[i] -= a[k] * b[j]
    return result


def unit(a: Floats) -> Floats:
    """Unit vectors, shape (3, frames); NaN where the length is zero."""
    length = norm(a)
    # Lengths below 1e-162 have squares of zero.
    length[length == 0] = np.nan
    result: Floats = a / length
    return result


def angle_between(a: Floats, b: Floats) -> Floats:
    """Angle in degrees, shape (frames,); NaN where a vector has no length."""
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = dot(a, b) / (norm(a) * norm(b))
    result: Floats = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return result


def window_frames(window_s: float, rate_hz: float) -> int:
    """Number of differences in a window; 0 s is one."""
    return max(1, math.ceil(window_s * rate_hz - _SLACK))


def smoothed_velocity(track: Floats, *, width: int, rate_hz: float) -> Floats:
    """Velocity of a track, averaged over `width` forward differences.

    Parameters
    ----------
    track : array, shape (3, frames), metres
    width : differences in the window
    rate_hz : frames per second

    Returns
    -------
    array, shape (3, frames), metres per second; NaN where the window meets a NaN, and of
    a single frame, which shows no movement
    """
    if track.shape[1] == 1:
        return np.full_like(track, np.nan)
    before, after = -(-width // 2) - 1, width // 2
    # Mirroring the differences is turning the track about its end points; a window's sum
    # of differences is then the difference of two positions.
    ahead = 2 * track[:, -1:] - track[:, -2:-1]
    path = _pad_by_turning(np.concatenate([track, ahead], axis=1), before, after)
    result: Floats = path[:, width:] - path[:, :-width]
    result *= rate_hz / width
    missing = np.isnan(path[0])
    if missing.any():
        n_missing = np.concatenate([[0], np.cumsum(missing)])
        result[:, n_missing[width + 1 :] > n_missing[: -width - 1]] = np.nan
    return result


def _pad_by_turning(track: Floats, before: int, after: int) -> Floats:
    """A track with so many frames more at its ends: itself, turned about its end points."""
    n = track.shape[1]
    if max(before, after) >= n:
        padding = ((0, 0), (before, after))
        turned: Floats = np.pad(track, padding, mode="reflect", reflect_type="odd")
        return turned
    # The same, ten times as fast for short tracks.
    path = np.empty((3, before + n + after))
    path[:, before : before + n] = track
    path[:, :before] = 2 * track[:, :1] - track[:, before:0:-1]
    path[:, before + n :] = 2 * track[:, -1:] - track[:, n - 2 :: -1][:, :after]
    return path
