"""Points of a recording, their steps, and jumps among these.

A jump is a step, or a change of a bone, many times as large as those around it: of the whole
body, of a point, of two points that exchange places. Thresholds are those that stay silent on
recordings at hand; see `evidence/variants.py`.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.motion import Motion

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]

_CHUNK = 512
AROUND = 4
MOST_PLACES = 3
_MOST_POINTS, _FEW, _POINTS_AT_ONCE = 300, 50, 16
# A jump: metres, and times the median step of the frames around it.
_JUMPS_M = 0.08
_JUMPS = 6.0
_SLOW_M_S = 6.0
# Fraction of the points that jump together.
_WHOLE = 0.6
# Two points exchange places if that explains all but this fraction of their steps.
_EXCHANGED = 0.4
# A bone changes its length by so much within a frame.
_BONE_M = 0.04
# Of two distances that are kept equally well the shorter one is a bone.
_NEAR = 0.02
# A jump changes the distance to the nearest neighbour by this fraction of the step.
_APART = 0.1


class Track(NamedTuple):
    """Points that are looked at: `columns` of `whole`, and their steps (frames - 1, points).

    `is_rig` is whether they are computed from turns: then they move together. `above` is, of a
    tree, which point is the joint right above each; -1 for none.
    """

    names: tuple[str, ...]
    whole: Floats
    columns: Indices
    steps: NDArray[np.float32]
    rate_hz: float
    is_rig: bool
    above: tuple[int, ...] = ()

    def places(self, frames: Any) -> Floats:
        """Places of the points in some frames: of hours of motion no copy is made."""
        return np.asarray(self.whole[frames][..., self.columns, :])

    def at(self, start: int, stop: int) -> str:
        """A segment of frames in words."""
        seconds = f"{start / self.rate_hz:.2f} to {(stop - 1) / self.rate_hz:.2f} s"
        return f"{seconds} (frames {start}-{stop - 1})"


def track_points(motion: Motion, first_frame: int) -> Track:
    """The points that the generic joints stand on, of a rig; else all."""
    is_rig = motion.rotations is not None
    names = motion.names
    if is_rig and motion.mapping is not None:
        used = {name for source in motion.mapping.weights.values() for name in source}
        names = tuple(name for name in names if name in used) or names
    names = names[:_MOST_POINTS]
    index = {name: i for i, name in enumerate(motion.names)}
    columns = np.array([index[name] for name in names], dtype=np.intp)
    whole = motion.positions[first_frame:]
    steps = np.empty((len(whole) - 1, len(names)), dtype=np.float32)
    # In parts that stay in the processor's cache; a slice where nothing is chosen copies nothing.
    chosen = columns if len(names) < len(motion.names) else slice(None)
    for start in range(0, len(steps), _CHUNK):
        places = whole[start : start + _CHUNK + 1, chosen]
        ways = places[1:] - places[:-1]
        ways *= ways
        steps[start : start + _CHUNK] = np.sqrt(ways[..., 0] + ways[..., 1] + ways[..., 2])
    return Track(names, whole, columns, steps, motion.rate_hz, is_rig, _above(motion, names))


def _above(motion: Motion, names: Sequence[str]) -> tuple[int, ...]:
    """Of each point of a rig, which of the points is the nearest joint above; -1 for none."""
    if motion.skeleton is None:
        return ()
    skeleton, place = motion.skeleton, {name: i for i, name in enumerate(names)}
    # A root's parent is -1, which must not count from the end.
    above = {
        name: place.get(skeleton.names[parent], -1)
        for name, parent in zip(skeleton.names, skeleton.parents.tolist(), strict=True)
        if parent >= 0
    }
    return tuple(above.get(name, -1) for name in names)


def find_partners(track: Track) -> Indices:
    """Of each point the two others that keep their distance best, near ones first.

    Shape (points, 2), of a rig (0, 2). Where little moves, only near ones are bones.
    """
    n_points = len(track.names)
    if track.is_rig or n_points < 3:
        return np.empty((0, 2), dtype=np.intp)
    some = track.places(slice(None, None, 1 + len(track.whole) // _FEW)).astype(np.float32)
    half, result = len(some) // 2, np.empty((n_points, 2), dtype=np.intp)
    for first in range(0, n_points, _POINTS_AT_ONCE):
        points = np.arange(first, min(first + _POINTS_AT_ONCE, n_points))
        ways = some[:, None] - some[:, points, None]
        lengths = np.sqrt(np.einsum("fabi,fabi->fab", ways, ways))
        # Seen half of the time at least.
        lengths[np.isnan(lengths)] = np.inf
        middle = np.partition(lengths, half, axis=0)[half]
        middle[np.isinf(middle)] = 1 / _NEAR**2
        score = np.partition(np.abs(lengths - middle), half, axis=0)[half] + _NEAR * middle
        score[points - first, points] = np.inf
        result[points] = np.argsort(score, axis=1, kind="stable")[:, :2]
    return result


def find_jumps(track: Track, partners: Indices) -> list[str]:
    """Steps many times as long as those around them: of the whole body, of points, exchanged."""
    bones = _changing_bones(track, partners)
    jumps = _jumping(track) | bones
    at = np.flatnonzero(jumps.any(axis=1))
    n_seen = (~np.isnan(track.steps[at])).sum(axis=1)
    enough = jumps[at].sum(axis=1) >= _WHOLE * np.maximum(3, n_seen)
    whole = at[enough].tolist()
    notes = []
    if whole:
        step = float(np.nanmedian(track.steps[whole[0]]))
        notes.append(f"the body jumps {step:.2f} m within one frame at {_times(track, whole)}")
    exchanged: dict[tuple[int, int], list[int]] = {}
    single: dict[int, list[int]] = {}
    for t in sorted(set(at.tolist()) - set(whole)):
        points = np.flatnonzero(jumps[t])
        pairs = _exchanges(track, t, points)
        for pair in pairs:
            exchanged.setdefault(pair, []).append(t)
        for point in set(points.tolist()) - {one for pair in pairs for one in pair}:
            if bones[t, point] or _leaves_neighbours(track, t, point):
                single.setdefault(point, []).append(t)
    swaps = [
        f"{track.names[a]} and {track.names[b]} exchange places at {_times(track, times)}: swapped"
        for (a, b), times in exchanged.items()
    ]
    leaps = [
        f"{track.names[point]} jumps {float(track.steps[times[0], point]):.2f} m away from its "
        f"neighbours at {_times(track, times)}: its bones change their length"
        for point, times in single.items()
    ]
    return [*notes, *name_few(swaps, "pairs exchange places"), *name_few(leaps, "points jump")]


def _times(track: Track, frames: Sequence[int]) -> str:
    return list_places([f"{(t + 1) / track.rate_hz:.2f} s (frame {t + 1})" for t in frames])


def _jumping(track: Track) -> Mask:
    """Steps that are jumps, shape (frames - 1, points)."""
    at, points = np.nonzero(track.steps > max(_JUMPS_M, _SLOW_M_S / track.rate_hz))
    # A frame that is shown twice says nothing of how fast a point is.
    moves: Mask = np.any(track.steps > 0, axis=1)
    result = np.zeros(track.steps.shape, dtype=bool)
    result[at, points] = _stands_out(
        track.steps[at, points], at, len(result),
        lambda beside: np.where(moves[beside], track.steps[beside, points], np.nan),
    )  # fmt: skip
    return result


def _stands_out(
    values: NDArray[Any], at: Indices, n_steps: int, sizes: Callable[[Indices], NDArray[Any]]
) -> Mask:
    """Which values are many times the median of the sizes around them."""
    known, small = np.zeros(len(at), dtype=np.int8), np.zeros(len(at), dtype=np.int8)
    for offset in (*range(-AROUND, 0), *range(1, AROUND + 1)):
        beside = at + offset
        inside = (beside >= 0) & (beside < n_steps)
        others = sizes(np.where(inside, beside, 0))
        inside &= ~np.isnan(others)
        known += inside
        small += inside & (others < values / _JUMPS)
    # The median of the sizes around is small.
    result: Mask = (known > AROUND // 2) & (2 * small > known)
    return result


def _changing_bones(track: Track, partners: Indices) -> Mask:
    """Steps that change both distances of a point to its partners, which no fast limb does."""
    result = np.zeros(track.steps.shape, dtype=bool)
    if not len(partners):
        return result
    at, points = np.nonzero(track.steps > _BONE_M)
    values = _bone_changes(track, partners, at, points)
    large = values > _BONE_M
    at, points = at[large], points[large]
    result[at, points] = _stands_out(
        values[large], at, len(result),
        lambda beside: _bone_changes(track, partners, beside, points),
    )  # fmt: skip
    return result


def _bone_changes(track: Track, partners: Indices, at: Indices, points: Indices) -> Floats:
    """The smaller change of a point's two distances by a step, of each step and point."""
    changes = []
    for others in partners[points].T:
        one, other = track.columns[points], track.columns[others]
        before = track.whole[at, one] - track.whole[at, other]
        after = track.whole[at + 1, one] - track.whole[at + 1, other]
        lengths = (np.sqrt(np.einsum("ni,ni->n", ways, ways)) for ways in (before, after))
        changes.append(np.abs(np.subtract(*lengths)))
    smaller: Floats = np.minimum(*changes)
    return smaller


def _exchanges(track: Track, t: int, points: Indices) -> list[tuple[int, int]]:
    """Pairs of points of which each is where the other was."""
    before, now = track.places(t), track.places(t + 1)
    pairs = []
    for i, a in enumerate(points.tolist()):
        for b in points[i + 1 :].tolist():
            crossed = np.linalg.norm(now[a] - before[b]) + np.linalg.norm(now[b] - before[a])
            if crossed < _EXCHANGED * (track.steps[t, a] + track.steps[t, b]):
                pairs.append((a, b))
    return pairs


def _leaves_neighbours(track: Track, t: int, point: int) -> bool:
    """Whether a step changes the distance to the points that are usually nearest."""
    before, now = track.places(t), track.places(t + 1)
    if track.is_rig:
        # Turns may flip, which changes no bone.
        above = track.above[point] if track.above else -1
        bones = [np.linalg.norm(place[point] - place[above]) for place in (before, now)]
        return above >= 0 and bool(abs(bones[1] - bones[0]) > _APART * track.steps[t, point])
    apart = np.linalg.norm(before - before[point], axis=1)
    later = np.linalg.norm(now - now[point], axis=1)
    apart[point] = np.nan
    change = np.abs(later - apart)
    order = np.argsort(np.where(np.isnan(change), np.inf, apart), kind="stable")[:2]
    changes = change[order]
    return bool(len(changes) > 0 and (changes > _APART * track.steps[t, point]).all())


def list_places(places: Sequence[str]) -> str:
    """The first of some places or times, and how many more there are."""
    more = len(places) - MOST_PLACES
    return ", ".join(places[:MOST_PLACES]) + (f" and {more} times more" if more > 0 else "")


def name_few(found: list[str], what: str) -> list[str]:
    """Some notes, and how many more there are."""
    if len(found) <= MOST_PLACES:
        return found
    return [*found[:MOST_PLACES], f"{len(found) - MOST_PLACES} more {what}"]
