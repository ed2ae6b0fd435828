"""Signs that something is wrong with a recording: it stands still, repeats itself, or jumps.

What no body and no camera does, told in words, with where: a pose that is exactly the same for a
while, a point that stays in the air while its neighbours move on, a segment that comes again, a
step or a change of a bone many times as large as those around it, points that exchange places.
Thresholds are those that stay silent on recordings at hand; see `evidence/variants.py`.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motionary.io.normalise.jumps import (
    AROUND,
    MOST_PLACES,
    Floats,
    Indices,
    Mask,
    Track,
    find_jumps,
    find_partners,
    name_few,
    track_points,
)
from motionary.motion import Motion
from motionary.recording import find_runs

_CHUNK = 4096
_LOOKED_AT = 200
# Exactly the same for so long is no body's doing.
_HELD_S, _HELD_FRAMES = 0.2, 5
# A point in rounded places rests, too, and then moves by few of the smallest steps.
_ROUNDED, _SNAPS_M = 3.0, 0.002
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


def find_anomalies(motion: Motion, *, first_frame: int = 0) -> list[str]:
    """Notes on what is not as a body moves.

    Parameters
    ----------
    motion : in metres
    first_frame : a rest pose before it is passed over
    """
    if np.isnan(motion.positions[0]).all() and np.isnan(motion.positions).all():
        return ["no point is seen in any frame"]
    if motion.n_frames - first_frame < 3:
        return []
    track = track_points(motion, first_frame)
    if not len(track.names):
        return []
    if not (track.steps > 0).any():
        if np.isnan(track.steps).all():
            return []
        return [f"the pose is constant: exactly the same in all {motion.n_frames} frames"]
    still, notes = _find_frozen(track)
    partners = find_partners(track)
    held, jumps = _find_held(track, still, partners), find_jumps(track, partners)
    return [*notes, *held, *_find_repeated(track), *jumps]


def _longest(track: Track) -> int:
    return max(_HELD_FRAMES, round(_HELD_S * track.rate_hz))


def _find_frozen(track: Track) -> tuple[Mask, list[str]]:
    """Steps in which nothing that is seen moves, and a note on long ones amid a motion."""
    still: Mask = np.logical_not(np.any(track.steps > 0, axis=1))
    still[still] = ~np.isnan(track.steps[still]).all(axis=1)
    runs, longest = find_runs(still).tolist(), _longest(track)
    # Before a motion begins and after it ends a body may well be kept.
    held = [(a, b) for a, b in runs if b - a >= longest and a > 0 and b < len(still)]
    if not held or (len(runs) > MOST_PLACES and still.sum() > _KEYFRAMED * len(still)):
        return still, []
    return still, [_say("the pose is frozen", track, [(a, b + 1) for a, b in held])]


def _say(what: str, track: Track, runs: Sequence[tuple[int, int]]) -> str:
    places = ", ".join(track.at(*run) for run in runs[:MOST_PLACES])
    more = f" and {len(runs) - MOST_PLACES} times more" if len(runs) > MOST_PLACES else ""
    return f"{what} from {places}{more}"


def _find_held(track: Track, still: Mask, partners: Indices) -> list[str]:
    """Points that stay in exactly the same place while the body moves on."""
    if not len(partners):
        return []
    found, rests = [], (track.steps == 0) & ~still[:, None]
    least = _longest(track)
    for point in np.flatnonzero(rests.sum(axis=0) >= least).tolist():
        runs = [
            (a, b + 1)
            for a, b in find_runs(rests[:, point]).tolist()
            if b - a >= least
            and (
                _snaps_back(track.steps[:, point], b)
                or _is_left_behind(track, point, partners[point], a, b + 1)
            )
        ]
        if runs:
            what = f"{track.names[point]} is held in the same place"
            found.append(_say(what, track, runs))
    return name_few(found, "points are held in the same place")


def _snaps_back(steps: NDArray[np.float32], at: int) -> bool:
    """Whether the step after a rest is longer than those that follow, and than what is rounded."""
    later = steps[at + 1 : at + 1 + AROUND]
    if at == len(steps) or not (later > 0).any():
        return False
    smallest = float(steps[steps > 0].min())
    return bool(steps[at] > max(_SNAPS_M, _ROUNDED * smallest, float(np.nanmax(later))))


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
