"""Quality checks of a recording that was read: a rest pose first, a walk on the spot.

Exported clips are often kept in place: the hips stay above one point and the feet slide over
the floor. How fast the body or a foot moves is unknown there.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motionary.io.normalise.anomalies import find_anomalies
from motionary.motion import GENERIC_JOINTS, Motion

Floats = NDArray[np.float64]

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
    if motion.mapping is None or _goes_far(_some(motion)):
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
    return jump + 1 if still and len(after) > 1 and _jumps(steps[jump], after) else 0


def _jumps(step: float, after: Floats) -> bool:
    return bool(step > _REST_POSE_JUMP * after.max())


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


def _some(motion: Motion) -> Floats:
    """A few frames of the generic joints, from all of the motion."""
    return _body(motion, np.arange(0, motion.n_frames, 1 + motion.n_frames // _FEW))


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
    index = {joint: i for i, joint in enumerate(GENERIC_JOINTS)}
    gone = []
    for a, b in _BONES:
        lengths = np.linalg.norm(body[:, index[a]] - body[:, index[b]], axis=1)
        lengths = lengths[np.isfinite(lengths)]
        if len(lengths) and np.median(lengths) < 1e-3:
            gone.append(f"{a} to {b}")
    return [f"bones without length: {', '.join(gone)}"] if gone else []
