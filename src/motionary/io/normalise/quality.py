"""Quality checks of a recording that was read: what no body and no camera does, told in words.

A rest pose comes first; the pose is exactly the same for a while; a point stays in the air while
its neighbours move on; a segment comes again; steps, bones or points jump, see `jumps`.
Exported clips are often kept in place: the hips stay above one point and the feet slide over
the floor. How fast the body or a foot moves is unknown there.
Thresholds are those that stay silent on recordings at hand; see `evidence/variants.py`.
"""

from collections.abc import Sequence
from dataclasses import replace

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
    list_places,
    name_few,
    track_points,
)
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.recording import find_runs

# A step this many times the longest step of the next second is a change of pose.
_REST_POSE_JUMP = 5.0
_REST_POSE_MIN_M = 0.02
_STILL_M = 1e-3

# Hips of people sway more than this fraction of a leg, those of a clip in place may not at all.
_PINNED = 0.005
_ON_THE_SPOT = 0.35
# Legs a second at which the foot on the floor moves: of people who stay on the spot at most
# .22 in all recordings at hand.
_SLIDES = 0.5
_STIRS = 0.1
_FLOOR = 0.06
_LOOKED_AT = 2000
_FEW = 200
_AT_HZ = 30.0
_FEET_NAMES = ("lankle", "rankle", "ltoes", "rtoes")
_HIPS_AND_LEGS = ("root", "lhip", "lknee", "rhip", "rknee", *_FEET_NAMES)
_FEET = list(GENERIC_JOINTS.index(joint) for joint in _FEET_NAMES)

_CHUNK = 4096
_LOOKED_AT_HELD = 200
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


def check_quality(motion: Motion) -> Motion:
    """The motion with notes on what the checks found."""
    notes = list(motion.notes)
    n_rest = count_rest_frames(motion.positions, motion.rate_hz)
    if n_rest:
        which = "first frame looks" if n_rest == 1 else f"first {n_rest} frames look"
        notes.append(f"the {which} like a rest pose")
    notes += find_anomalies(motion, first_frame=n_rest)
    if motion.mapping is not None:
        notes += _find_bones_without_length(_some(motion))
    if motion.in_place:
        notes.append(
            "kept in place: the feet slide under hips that stay; how fast joints move through the "
            "room is unknown"
        )
    return replace(motion, notes=tuple(notes))


def mark_in_place(motion: Motion) -> Motion:
    """The motion, marked if it is kept in place."""
    if motion.mapping is None or _goes_far(_some(motion, _HIPS_AND_LEGS)):
        return motion
    return replace(motion, in_place=True) if is_in_place(motion) else motion


def count_rest_frames(positions: Floats, rate_hz: float) -> int:
    """Frames at the start, within a second, after which the pose jumps; 0 if it does not.

    Parameters
    ----------
    positions : array, shape (frames, joints, 3), metres
    rate_hz : frames per second
    """
    within = max(2, round(rate_hz))
    start = positions[: 2 + 2 * within]
    start = start[:, ~np.isnan(start.sum(axis=0)).any(axis=1)]
    if len(start) < 4 or not start.shape[1]:
        return 0
    pose = start - start[:, :1]
    steps = np.abs(np.diff(pose, axis=0)).reshape(len(pose) - 1, -1).max(axis=1)
    jumps = np.flatnonzero(steps[:within] > _REST_POSE_MIN_M)
    if not len(jumps):
        return 0
    jump = int(jumps[0])
    after = steps[jump + 1 : jump + 1 + within]
    still = not jump or steps[:jump].max() < _STILL_M
    jumps_far = len(after) > 1 and steps[jump] > _REST_POSE_JUMP * after.max()
    return jump + 1 if still and jumps_far else 0


def is_in_place(motion: Motion) -> bool:
    """Whether the hips stay above one point while the feet slide over the floor."""
    step = max(1, round(motion.rate_hz / _AT_HZ))
    if motion.mapping is None or motion.n_frames < 2 * step + 1:
        return False
    first = np.arange(0, motion.n_frames - step, max(1, motion.n_frames // _LOOKED_AT))
    now = _body(motion, first, _HIPS_AND_LEGS)
    leg, root = _leg(now), now[:, GENERIC_JOINTS.index("root")][:, [0, 2]]
    root = root[np.isfinite(root).all(axis=1)]
    if not leg > 0 or not len(root):
        return False
    sways = float(np.ptp(root, axis=0).max()) / leg
    if sways > _ON_THE_SPOT:
        return False
    slides = _sliding(now, _body(motion, first + step, _FEET_NAMES), leg) * motion.rate_hz / step
    if not len(slides):
        return False
    median, most = np.percentile(slides, (50, 95))
    return bool(median > _SLIDES or (sways < _PINNED and most > _STIRS))


def _goes_far(body: Floats) -> bool:
    """Whether the hips clearly leave the spot in some frames: then feet need no look."""
    root = body[:, GENERIC_JOINTS.index("root")][:, [0, 2]]
    root = root[np.isfinite(root).all(axis=1)]
    return bool(len(root) and np.ptp(root, axis=0).max() > 2 * _ON_THE_SPOT * _leg(body))


def _some(motion: Motion, joints: Sequence[str] = GENERIC_JOINTS) -> Floats:
    """A few frames of the generic joints, from all of the motion."""
    return _body(motion, np.arange(0, motion.n_frames, 1 + motion.n_frames // _FEW), joints)


def _body(
    motion: Motion, frames: NDArray[np.intp], joints: Sequence[str] = GENERIC_JOINTS
) -> Floats:
    """Some frames of the generic joints, shape (frames, 24, 3); NaN where none are asked for."""
    mapping = motion.mapping
    if mapping is None:
        return np.full((len(frames), len(GENERIC_JOINTS), 3), np.nan)
    weights = {joint: mapping.weights[joint] for joint in joints if joint in mapping.weights}
    normals = {joint: step for joint, step in mapping.normals.items() if joint in weights}
    used = {name for of in weights.values() for name in of}
    used |= {name for step in normals.values() for name in (step.a, step.b, step.c)}
    columns = np.array([i for i, name in enumerate(motion.names) if name in used], dtype=np.intp)
    some = replace(
        motion,
        names=tuple(motion.names[i] for i in columns),
        positions=motion.positions[np.ix_(frames, columns)],
        mapping=replace(mapping, weights=weights, normals=normals),
        skeleton=None,
        rotations=None,
    )
    return some.generic_positions()


def _sliding(now: Floats, then: Floats, leg: float) -> Floats:
    """How far the lowest foot moves to the next frame while it is on the floor, in legs.

    The whole foot: who squats or kneels turns it about its toes or its ankle.
    """
    now, then = now[:, _FEET], then[:, _FEET]
    seen: NDArray[np.bool_] = np.isfinite((now + then).sum(axis=2))
    some = seen.any(axis=1)
    now, then, seen = now[some], then[some], seen[some]
    if not len(now):
        return np.empty(0)
    heights = np.where(seen, now[:, :, 1], np.inf)
    lowest = heights.min(axis=1)
    on_floor = lowest < np.percentile(lowest, 20) + _FLOOR * leg
    side = heights.argmin(axis=1) % 2
    steps = np.linalg.norm((then - now)[:, :, [0, 2]], axis=2)
    feet = np.fmin(steps[:, :2], steps[:, 2:])
    moved: Floats = feet[np.arange(len(feet)), side][on_floor] / leg
    return moved


def _leg(body: Floats) -> float:
    """Median length from hip to knee to ankle."""
    hip, knee, ankle = (
        body[:, [GENERIC_JOINTS.index(side + joint) for side in "lr"]]
        for joint in ("hip", "knee", "ankle")
    )
    lengths = np.linalg.norm(hip - knee, axis=2) + np.linalg.norm(knee - ankle, axis=2)
    lengths = lengths[np.isfinite(lengths)]
    return float(np.median(lengths)) if len(lengths) else np.nan


# Bones of the generic body that have a length.
_BONES = tuple(
    (side + a, side + b)
    for side in "lr"
    for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
)


def _find_bones_without_length(body: Floats) -> list[str]:
    """A note on limbs whose joints are in one place.

    Parameters
    ----------
    body : array, shape (frames, 24, 3), some frames of the generic joints
    """
    gone = []
    for a, b in _BONES:
        one, other = (body[:, GENERIC_JOINTS.index(joint)] for joint in (a, b))
        lengths = np.linalg.norm(one - other, axis=1)
        lengths = lengths[np.isfinite(lengths)]
        if len(lengths) and np.median(lengths) < 1e-3:
            gone.append(f"{a} to {b}")
    return [f"bones without length: {', '.join(gone)}"] if gone else []


# -- what stands still, or comes again ----------------------------------------------------


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
    return f"{what} from {list_places([track.at(*run) for run in runs])}"


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
    usual = _apart(track, point, outside[:: 1 + len(outside) // _LOOKED_AT_HELD])[:, partners]
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
