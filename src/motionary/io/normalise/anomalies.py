"""Signs that something is wrong with a recording: it stands still, repeats itself, or jumps.

What no body and no camera does, told in words, with where: a pose that is exactly the same for a
while, a point that stays in the air while its neighbours move on, a segment that comes again, a
step or a change of a bone many times as large as those around it, points that exchange places.
Thresholds are those that stay silent on recordings at hand; see `evidence/variants.py`.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.motion import Motion

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]

_CHUNK = 4096
_MOST_POINTS = 300
_MOST_PLACES = 3
_LOOKED_AT, _FEW = 200, 50
# Exactly the same for so long is no body's doing.
_HELD_S, _HELD_FRAMES = 0.2, 5
# Films of poses, and files of fewer frames a second than they say, stand still again and again.
_KEYFRAMED = 0.5
# Metres that a partner of a point goes while the point stays, and by which the point's distances
# from its partners change meanwhile.
_MOVES_M = 0.02
_STRETCHES_M = 0.008
# A repetition has at least so many seconds and frames, and moves.
_REPEATS_S, _REPEATS_FRAMES = 0.3, 10
_STEP_M = 1e-4
_KEY_POINTS, _KEY_FACTOR = 6, np.uint64(0x9E3779B97F4A7C15)
# A jump: metres, and times the median step of the frames around it.
_JUMPS_M = 0.08
_JUMPS = 6.0
_AROUND = 4
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


def find_anomalies(motion: Motion, *, first_frame: int = 0) -> list[str]:
    """Notes on what is not as a body moves.

    Parameters
    ----------
    motion : in metres
    first_frame : a rest pose before it is passed over
    """
    if motion.n_frames - first_frame < 3:
        return []
    track = _track(motion, first_frame)
    if not len(track.names):
        return []
    if not (track.steps > 0).any():
        if np.isnan(track.steps).all():
            return []
        return [f"the pose is constant: exactly the same in all {motion.n_frames} frames"]
    still, notes = _find_frozen(track)
    partners = _partners(track)
    held, jumps = _find_held(track, still, partners), _find_jumps(track, partners)
    return [*notes, *held, *_find_repeated(track), *jumps]


def _track(motion: Motion, first_frame: int) -> Track:
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
    for start in range(0, len(steps), _CHUNK):
        ways = np.diff(whole[start : start + _CHUNK + 1, columns], axis=0)
        steps[start : start + _CHUNK] = np.sqrt(np.einsum("fpi,fpi->fp", ways, ways))
    return Track(names, whole, columns, steps, motion.rate_hz, is_rig, _above(motion, names))


def _above(motion: Motion, names: Sequence[str]) -> tuple[int, ...]:
    """Of each point of a rig, which of the points is the nearest joint above; -1 for none."""
    if motion.skeleton is None:
        return ()
    parents, place = motion.skeleton.parents.tolist(), {n: i for i, n in enumerate(names)}
    index = {name: i for i, name in enumerate(motion.skeleton.names)}
    return tuple(
        place.get(motion.skeleton.names[parents[index[name]]], -1) if name in index else -1
        for name in names
    )


def _runs(mask: Mask) -> list[tuple[int, int]]:
    """Starts and stops of the runs of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _longest(track: Track) -> int:
    return max(_HELD_FRAMES, round(_HELD_S * track.rate_hz))


def _find_frozen(track: Track) -> tuple[Mask, list[str]]:
    """Steps in which nothing that is seen moves, and a note on long ones amid a motion."""
    still: Mask = np.logical_not(np.any(track.steps > 0, axis=1))
    still[still] = ~np.isnan(track.steps[still]).all(axis=1)
    held = [run for run in _runs(still) if run[1] - run[0] >= _longest(track)]
    # Before a motion begins and after it ends a body may well be kept.
    held = [(a, b) for a, b in held if a > 0 and b < len(still)]
    n_still = sum(b - a for a, b in _runs(still))
    if not held or (len(_runs(still)) > _MOST_PLACES and n_still > _KEYFRAMED * len(still)):
        return still, []
    return still, [_say("the pose is frozen", track, [(a, b + 1) for a, b in held])]


def _say(what: str, track: Track, runs: Sequence[tuple[int, int]]) -> str:
    places = ", ".join(track.at(*run) for run in runs[:_MOST_PLACES])
    more = f" and {len(runs) - _MOST_PLACES} times more" if len(runs) > _MOST_PLACES else ""
    return f"{what} from {places}{more}"


def _find_held(track: Track, still: Mask, partners: Indices) -> list[str]:
    """Points that stay in exactly the same place while the body moves on."""
    if not len(partners):
        return []
    found = []
    for point, name in enumerate(track.names):
        runs = [
            (a, b + 1)
            for a, b in _runs((track.steps[:, point] == 0) & ~still)
            if b - a >= _longest(track) and _is_left_behind(track, point, partners[point], a, b + 1)
        ]
        if runs:
            found.append(_say(f"{name} is held in the same place", track, runs))
    return _few(found, "points are held in the same place")


def _is_left_behind(track: Track, point: int, partners: Indices, start: int, stop: int) -> bool:
    """Whether a point's partners move away from where it stays."""
    ways = np.nan_to_num(track.steps[start : stop - 1, partners]).sum(axis=0)
    if ways.max() < _MOVES_M:
        return False
    outside = np.r_[0:start, stop : len(track.whole)]
    usual = _apart(track, point, outside[:: 1 + len(outside) // _LOOKED_AT])[:, partners]
    held = _apart(track, point, np.arange(start, stop))[:, partners]
    if ((~np.isnan(usual)).sum(axis=0) < 2).any() or np.isnan(held).all(axis=0).any():
        return False
    middle, spread = np.nanmedian(usual, axis=0), np.nanstd(usual, axis=0)
    changes = np.nanmax(np.abs(held - middle), axis=0)
    return bool((changes > np.maximum(_STRETCHES_M, 6 * spread)).all())


def _apart(track: Track, point: int, frames: Indices) -> Floats:
    """Distances of all points from one, shape (frames, points)."""
    positions = track.places(frames)
    ways = positions - positions[:, point : point + 1]
    distances: Floats = np.sqrt(np.einsum("fpi,fpi->fp", ways, ways))
    return distances


def _few(found: list[str], what: str) -> list[str]:
    if len(found) <= _MOST_PLACES:
        return found
    return [*found[:_MOST_PLACES], f"{len(found) - _MOST_PLACES} more {what}"]


def _find_repeated(track: Track) -> list[str]:
    """Segments of a motion that come again, exactly."""
    moves = np.concatenate(([True], (track.steps > _STEP_M).any(axis=1)))
    frames = np.flatnonzero(moves)
    places, keys = track.places, _keys(track, frames)
    order = np.argsort(keys, kind="stable")
    follows = np.zeros(len(keys), dtype=np.intp)
    same = keys[order[1:]] == keys[order[:-1]]
    follows[order[1:][same]] = (order[1:] - order[:-1])[same]
    length = max(_REPEATS_FRAMES, round(_REPEATS_S * track.rate_hz))
    runs = []
    starts = np.flatnonzero(np.diff(np.concatenate(([0], follows, [0]))))
    for a, b in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        if follows[a] > 0 and b - a >= length:
            before, after = frames[a - follows[a] : b - follows[a]], frames[a:b]
            if all(
                np.allclose(places(before[part]), places(after[part]), atol=1e-5, equal_nan=True)
                for part in (slice(i, i + _CHUNK) for i in range(0, b - a, _CHUNK))
            ):
                first = int(frames[a - follows[a]])
                runs.append((int(frames[a]), int(frames[b - 1]) + 1, first))
    if not runs:
        return []
    start, stop, first = runs[0]
    more = f"; {len(runs) - 1} more segments repeat" if len(runs) > 1 else ""
    return [
        f"{track.at(start, stop)} repeats exactly what is at {first / track.rate_hz:.2f} s "
        f"(frame {first}){more}"
    ]


def _keys(track: Track, frames: Indices) -> NDArray[np.uint64]:
    """A number for each frame, the same for the same places (to 0.01 mm) of some points."""
    some = np.unique(np.linspace(0, len(track.columns) - 1, _KEY_POINTS).astype(np.intp))
    # Powers of an odd number, modulo 2^64.
    factors = np.cumprod(np.full(len(some) * 3, _KEY_FACTOR))
    keys = np.empty(len(frames), dtype=np.uint64)
    for start in range(0, len(frames), _CHUNK):
        part = track.whole[np.ix_(frames[start : start + _CHUNK], track.columns[some])]
        rounded = np.round(part.reshape(len(part), -1) * 1e5)
        whole = np.nan_to_num(rounded, nan=1e12).astype(np.int64).astype(np.uint64)
        keys[start : start + _CHUNK] = (whole * factors).sum(axis=1, dtype=np.uint64)
    return keys


def _find_jumps(track: Track, partners: Indices) -> list[str]:
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
    return [*notes, *_few(swaps, "pairs exchange places"), *_few(leaps, "points jump")]


def _times(track: Track, frames: Sequence[int]) -> str:
    said = ", ".join(
        f"{(t + 1) / track.rate_hz:.2f} s (frame {t + 1})" for t in frames[:_MOST_PLACES]
    )
    more = len(frames) - _MOST_PLACES
    return said + (f" and {more} times more" if more > 0 else "")


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
    for offset in (*range(-_AROUND, 0), *range(1, _AROUND + 1)):
        beside = at + offset
        inside = (beside >= 0) & (beside < n_steps)
        others = sizes(np.where(inside, beside, 0))
        inside &= ~np.isnan(others)
        known += inside
        small += inside & (others < values / _JUMPS)
    # The median of the sizes around is small.
    result: Mask = (known > _AROUND // 2) & (2 * small > known)
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


def _partners(track: Track) -> Indices:
    """Of each point the two others that keep their distance best, near ones first.

    Shape (points, 2), of a rig (0, 2). Where little moves, only near ones are bones.
    """
    if track.is_rig or len(track.names) < 3:
        return np.empty((0, 2), dtype=np.intp)
    some = track.places(slice(None, None, 1 + len(track.whole) // _FEW))
    half, result = len(some) // 2, np.empty((len(track.names), 2), dtype=np.intp)
    for point in range(len(result)):
        ways = some - some[:, point : point + 1]
        lengths = np.sqrt(np.einsum("fpi,fpi->fp", ways, ways))
        # Seen half of the time at least.
        lengths[np.isnan(lengths)] = np.inf
        middle = np.partition(lengths, half, axis=0)[half]
        middle[np.isinf(middle)] = 1 / _NEAR**2
        score = np.partition(np.abs(lengths - middle), half, axis=0)[half] + _NEAR * middle
        score[point] = np.inf
        result[point] = np.argsort(score, kind="stable")[:2]
    return result


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
