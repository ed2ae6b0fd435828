"""Tracks of the joints of a recording, the lengths of its bones, and velocities.

Velocities are those of the programs of Müller and Röder (2006): forward differences, the
last one repeated, averaged by a boxcar over frames i - ceil(w/2) + 1 ... i + floor(w/2), ends
padded by reflection with the edge repeated.

Conventions: a track is an array (3, frames), so that arithmetic runs along frames; metres,
y up; NaN where a joint is not seen or a direction has no length. Short recordings may lie one
after the other in one body, as arithmetic along few frames takes no less time.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import reduce
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
    """Joint tracks of a recording, or of several one after the other.

    Directions, velocities and lengths of segments are kept, as several features share them.

    Attributes
    ----------
    tracks : array (3, frames) of each generic joint, metres
    rate_hz : frames per second
    reference : the beginning of the recording, where the tracks are of a later part; its
        lengths are those of the body
    starts : first frame of each recording
    """

    tracks: dict[str, Floats]
    rate_hz: float
    reference: "Body | None" = None
    _kept: dict[tuple[object, ...], Floats] = field(default_factory=dict, repr=False)
    starts: tuple[int, ...] = field(default=(0,), init=False)

    @classmethod
    def from_positions(
        cls, positions: Floats, *, rate_hz: float, reference: "Body | None" = None
    ) -> "Body":
        """Body of generic positions, shape (frames, 24, 3)."""
        tracks = np.empty((len(GENERIC_JOINTS), 3, len(positions)))
        _fill(tracks, positions)
        return cls(dict(zip(GENERIC_JOINTS, tracks, strict=True)), rate_hz, reference)

    @classmethod
    def from_recordings(cls, recordings: Sequence[Floats], *, rate_hz: float) -> "Body":
        """Body of the generic positions of recordings, one after the other."""
        stops = np.cumsum([len(positions) for positions in recordings]).tolist()
        starts = (0, *stops[:-1])
        tracks = np.empty((len(GENERIC_JOINTS), 3, stops[-1]))
        for start, stop, positions in zip(starts, stops, recordings, strict=True):
            _fill(tracks[:, :, start:stop], positions)
        body = cls(dict(zip(GENERIC_JOINTS, tracks, strict=True)), rate_hz)
        object.__setattr__(body, "starts", starts)
        return body

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

    @property
    def parts(self) -> list[slice]:
        """Frames of each recording."""
        return [slice(*ends) for ends in pairwise((*self.starts, self.n_frames))]

    def kept(self, key: tuple[object, ...], compute: Callable[[], Floats]) -> Floats:
        """Result of `compute`, remembered under `key`; not to be written to."""
        if key not in self._kept:
            self._kept[key] = compute()
        return self._kept[key]

    def direction(self, a: str, b: str) -> Floats:
        """Unit vector from joint a to joint b, shape (3, frames)."""
        return self.kept(("direction", a, b), lambda: unit(self[b] - self[a]))

    def distance(self, a: str, b: str) -> Floats:
        """Distance between two joints, shape (frames,), metres."""
        return self.kept(("distance", *sorted((a, b))), lambda: norm(self[a] - self[b]))

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
            return smoothed_velocity(track, width=width, rate_hz=self.rate_hz, starts=self.starts)

        return self.kept(("velocity", joint, relative_to, window_s), compute)

    def in_units(self, value: Floats, name: str) -> Floats:
        """Metres, shape (frames,), in units of a length of the body."""
        lengths = self.lengths(name)
        if len(lengths) == 1:
            return value / float(lengths[0])
        counts = [part.stop - part.start for part in self.parts]
        return value / self.kept(("unit", name), lambda: np.repeat(lengths, counts))

    def lengths(self, name: str) -> Floats:
        """A length of the body of each recording, metres; NaN where it is unseen or zero.

        A segment counts as in the first frame in which any joint is seen; where an end is
        unseen there, with its median over the second that begins there. Where an upper arm
        is unseen in all of it, see `SUBSTITUTES`.

        Parameters
        ----------
        name : one of `LENGTHS`
        """
        if self.reference is not None:
            return self.reference.lengths(name)
        return self.kept(("lengths", name), lambda: self._lengths(name))

    def _lengths(self, name: str) -> Floats:
        total = self._chain_lengths(name)
        for i in np.flatnonzero(~(total > 0)).tolist():
            total[i] = self._substitute(name, i)[1]
        return total

    def _chain_lengths(self, name: str) -> Floats:
        return reduce(np.add, [self._segments(a, b) for a, b in LENGTHS[name]])

    def reference_length(self, name: str) -> str:
        """Substitute of a length that is never seen; empty if it is seen, or nothing is."""
        return "" if self._chain_lengths(name)[0] > 0 else self._substitute(name, 0)[0]

    def _substitute(self, name: str, recording: int) -> tuple[str, float]:
        for substitute, (a, b), factor in SUBSTITUTES.get(name, ()):
            length = float(self._segments(a, b)[recording])
            if length > 0:
                return substitute, factor * length
        return "", float("nan")

    def _segments(self, a: str, b: str) -> Floats:
        """Length of a segment in each recording, shape (recordings,)."""
        begins = self.kept(("first seen of each",), self._first_seen).astype(np.intp)
        lengths = norm(self[b][:, begins] - self[a][:, begins])
        for i in np.flatnonzero(~np.isfinite(lengths)):
            stop = min(begins[i] + max(1, round(REFERENCE_S * self.rate_hz)), self.parts[i].stop)
            second = norm(self[b][:, begins[i] : stop] - self[a][:, begins[i] : stop])
            seen = second[np.isfinite(second)]
            lengths[i] = np.median(seen) if len(seen) else np.nan
        return lengths

    def _first_seen(self) -> Floats:
        """First frame of each recording in which any joint is seen; its first if none is."""
        first = np.array(self.starts)
        heights = [self.height(joint) for joint in self.tracks]
        unseen = ~np.isfinite([height[first] for height in heights]).any(axis=0)
        for i in np.flatnonzero(unseen):
            seen = np.isfinite([height[self.parts[i]] for height in heights]).any(axis=0)
            first[i] += seen.argmax()
        return first.astype(np.float64)


def _fill(tracks: Floats, positions: Floats) -> None:
    """Positions, shape (frames, 24, 3), as tracks (24, 3, frames)."""
    for start in range(0, len(positions), _BLOCK):
        block = slice(start, start + _BLOCK)
        tracks[:, :, block] = positions[block].transpose(1, 2, 0)


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
    products = a * b
    result: Floats = products[0]
    result += products[1]
    result += products[2]
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


def angle_of(product: Floats, lengths: Floats) -> Floats:
    """Angle in degrees, shape (frames,); NaN where a vector has no length.

    Parameters
    ----------
    product, lengths : scalar product of two tracks, and the product of their lengths
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = product / lengths
    np.clip(cosine, -1.0, 1.0, out=cosine)
    result: Floats = np.degrees(np.arccos(cosine, out=cosine), out=cosine)
    return result


def window_frames(window_s: float, rate_hz: float) -> int:
    """Number of differences in a window; 0 s is one."""
    return max(1, math.ceil(window_s * rate_hz - _SLACK))


def smoothed_velocity(
    track: Floats, *, width: int, rate_hz: float, starts: tuple[int, ...] = (0,)
) -> Floats:
    """Velocity of a track, averaged over `width` forward differences.

    Parameters
    ----------
    track : array, shape (3, frames), metres
    width : differences in the window
    rate_hz : frames per second
    starts : first frame of each recording that the track is of

    Returns
    -------
    array, shape (3, frames), metres per second; NaN where the window meets a NaN, and of
    a single frame, which shows no movement
    """
    counts = np.diff(starts, append=track.shape[1])
    if len(starts) > 1 and counts.min() <= max(1, width // 2):
        apart = np.split(track, starts[1:], axis=1)
        alone = [smoothed_velocity(one, width=width, rate_hz=rate_hz) for one in apart]
        return np.concatenate(alone, axis=1)
    if track.shape[1] == 1:
        return np.full_like(track, np.nan)
    path = _pad_by_turning(track, starts, counts, width)
    result: Floats = path[:, width:] - path[:, :-width]
    result *= rate_hz / width
    missing = np.isnan(path[0])
    if missing.any():
        n_missing = np.concatenate([[0], np.cumsum(missing)])
        result[:, n_missing[width + 1 :] > n_missing[: -width - 1]] = np.nan
    if len(starts) == 1:
        return result
    # Between recordings lie windows that reach from one into the next.
    firsts = np.array(starts) + width * np.arange(len(starts))
    own = [result[:, i : i + n] for i, n in zip(firsts.tolist(), counts.tolist(), strict=True)]
    return np.concatenate(own, axis=1)


def _pad_by_turning(
    track: Floats, starts: tuple[int, ...], counts: NDArray[np.intp], width: int
) -> Floats:
    """Each recording's track with `width` frames more, which its windows reach.

    Mirroring the differences is turning the track about its end points; a window's sum of
    differences is then the difference of two positions.
    """
    before, after = -(-width // 2) - 1, width // 2
    if after > track.shape[1]:
        ahead = 2 * track[:, -1:] - track[:, -2:-1]
        path = np.concatenate([track, ahead], axis=1)
        padding = ((0, 0), (before, after))
        turned: Floats = np.pad(path, padding, mode="reflect", reflect_type="odd")
        return turned
    # The same, ten times as fast for short tracks.
    path = np.empty((3, track.shape[1] + width * len(starts)))
    firsts = np.array(starts) + before + width * np.arange(len(starts))
    for first, start, n in zip(firsts.tolist(), starts, counts.tolist(), strict=True):
        path[:, first : first + n] = track[:, start : start + n]
    # The last difference is repeated once more before the track is turned.
    lasts = firsts + counts
    path[:, lasts] = 2 * path[:, lasts - 1] - path[:, lasts - 2]
    for about, aside in ((firsts, -np.arange(1, before + 1)), (lasts, np.arange(1, after + 1))):
        centre = about[:, None]
        path[:, centre + aside] = 2 * path[:, centre] - path[:, centre - aside]
    return path
