"""Left and right: names compared with the body.

A body tells: toes lie before the ankles and bent knees before the line from hip to ankle, seen
with the left hip on the left; bent elbows bring the forearms forward, seen with the left
shoulder on the left; shoulders turn with the hips. A file whose names are exchanged, or whose
axes are left-handed, has all of it the wrong way round. A recording that is mirrored, names and
places, is one of a person again: of one who moved the mirror image.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, check_choice
from motionary.motion import GENERIC_JOINTS, JointMapping, Motion, Skeleton

Floats = NDArray[np.float64]

Sides = Literal["named", "swapped", "mirrored"]
SIDES: tuple[str, ...] = get_args(Sides)

# Frames that suffice.
_LOOKED_AT = 500
# How far, in legs, feet and knees must point backward on average to contradict, and forward to
# confirm; of elbows the sine. In all recordings at hand toes are at least .09 before the
# ankles, knees -.01 before the leg, and elbows bend forward by -.42 (squats with arms held out).
_FEET = 0.05
_KNEES = 0.05
_ELBOWS = 0.5
# What is called a thigh or an upper arm keeps its length up to this fraction, or is none.
_RIGID = 0.15
# Cosine between the lines of shoulders and hips; in all recordings at hand at least .69.
_TURNED = -0.3

# Generic joints of one side, and that on the other.
_PAIRS = {
    joint: {"l": "r", "r": "l"}[joint[0]] + joint[1:]
    for joint in GENERIC_JOINTS
    if {"l" + joint[1:], "r" + joint[1:]} <= set(GENERIC_JOINTS)
}


def normalise_sides(motion: Motion, sides: str | None) -> Motion:
    """The motion with left and right as given, else as the names say.

    Parameters
    ----------
    motion : metres, y up
    sides : "named": the names are right; "swapped": they are exchanged; "mirrored": the axes
        are left-handed; None: as named, if the body does not contradict

    Raises
    ------
    InvalidInput
        If nothing is given and the body contradicts the names, or an answer is unknown.
    """
    # Without a mapping no name says left or right; only axes can be changed.
    if motion.mapping is None and sides != "mirrored":
        return motion
    if sides is not None:
        check_choice(sides, SIDES, name="sides")
        change = {"swapped": exchange_names, "mirrored": mirror}.get(sides)
        changed = change(motion) if change else motion
        return replace(changed, notes=(*motion.notes, f"left and right {sides}, as given"))
    wrong = _contradiction(motion)
    if wrong is None:
        note = "left and right as named; the body does not tell"
        return replace(motion, notes=(*motion.notes, note))
    if wrong:
        raise InvalidInput(wrong, file=motion.source or "motion")
    return motion


def _contradiction(motion: Motion) -> str | None:
    """What of the body contradicts the names of left and right, "" if nothing does.

    None if it does not tell.
    """
    some = slice(None, None, 1 + motion.n_frames // _LOOKED_AT)
    sample = replace(motion, positions=motion.positions[some], rotations=None)
    body = sample.generic_positions()
    if not (_is_rigid(body, "hip", "knee") and _is_rigid(body, "shoulder", "elbow")):
        return None
    lines = [_unit(_joint(body, f"l{j}") - _joint(body, f"r{j}")) for j in ("shoulder", "hip")]
    if _mean(_dot(*lines)) < _TURNED:
        return (
            "the shoulders face the other way than the hips, so the names of left and right are "
            "exchanged on arms or legs; rename them, or insist with --sides named (sides=...)"
        )
    measures: tuple[tuple[str, Callable[[], float], float], ...] = (
        ("toes point", lambda: _forward_of_legs(body, _feet(sample, body)), _FEET),
        ("knees bend", lambda: _forward_of_legs(body, None), _KNEES),
        ("elbows bend", lambda: _forward_elbows(body), _ELBOWS),
    )
    for what, measure, least in measures:
        forward = measure()
        if forward < -least:
            return (
                f"{what} backward if left and right are as named: either the names are exchanged "
                "or the axes are left-handed; say which with --sides swapped or --sides mirrored, "
                "or insist with --sides named (sides=...)"
            )
        if forward > least:
            return ""
    return None


def exchange_names(motion: Motion) -> Motion:
    """The motion with the names of left and right joints exchanged."""
    if motion.mapping is None:
        return motion
    other = _twins(motion.mapping)
    names = tuple(other.get(name, name) for name in motion.names)
    skeleton = motion.skeleton
    if skeleton is not None:
        skeleton = Skeleton(names, skeleton.parents, skeleton.offsets, ends=skeleton.ends)
    return replace(motion, names=names, skeleton=skeleton)


def mirror(motion: Motion) -> Motion:
    """The motion in axes of the other hand: x becomes -x; names stay."""
    across = np.array([-1.0, 1.0, 1.0])
    skeleton, rotations = motion.skeleton, motion.rotations
    if skeleton is not None:
        skeleton = replace(skeleton, offsets=skeleton.offsets * across)
    if rotations is not None:
        rotations = rotations * np.array([1.0, 1.0, -1.0, -1.0])
    return replace(
        motion, positions=motion.positions * across, skeleton=skeleton, rotations=rotations
    )


def _twins(mapping: JointMapping) -> dict[str, str]:
    """Per name of a joint on one side the name on the other."""
    result: dict[str, str] = {}
    for joint, source in mapping.weights.items():
        if joint in _PAIRS:
            twin = mapping.weights.get(_PAIRS[joint], {})
            result |= {a: b for a, b in zip(source, twin, strict=False) if a != b}
    return result


def _joint(body: Floats, name: str) -> Floats:
    track: Floats = body[:, GENERIC_JOINTS.index(name)]
    return track


def _feet(motion: Motion, body: Floats) -> dict[str, Floats]:
    """What lies before the ankles: toes, or in a rig without them what hangs below an ankle."""
    result = {side: _joint(body, f"{side}toes") for side in "lr"}
    if motion.skeleton is None or motion.mapping is None or motion.skeleton.ends:
        return result
    parents = motion.skeleton.parents.tolist()
    for side, toes in result.items():
        source = motion.mapping.weights.get(f"{side}ankle", {})
        if np.isnan(toes).all() and len(source) == 1 and next(iter(source)) in motion.names:
            ankle = motion.names.index(next(iter(source)))
            below = [joint for joint, parent in enumerate(parents) if parent == ankle]
            if below:
                result[side] = motion.positions[:, below].mean(axis=1)
    return result


def _forward_of_legs(body: Floats, feet: dict[str, Floats] | None) -> float:
    """How far feet lie before the ankles, or without feet knees before the legs, in legs."""
    across = _joint(body, "lhip") - _joint(body, "rhip")
    values = []
    for side in "lr":
        hip, knee, ankle = (_joint(body, side + joint) for joint in ("hip", "knee", "ankle"))
        leg = np.linalg.norm(hip - knee, axis=1) + np.linalg.norm(knee - ankle, axis=1)
        start, tip, up = hip, knee, hip - ankle
        if feet is not None:
            start, tip, up = ankle, feet[side], knee - ankle
        values.append(_dot(tip - start, _unit(np.cross(across, up))) / np.maximum(leg, 1e-12))
    return _mean(np.concatenate(values))


def _is_rigid(body: Floats, start: str, end: str) -> bool:
    """Whether a bone keeps its length on both sides, as far as it is seen."""
    for side in "lr":
        lengths = np.linalg.norm(_joint(body, side + start) - _joint(body, side + end), axis=1)
        lengths = lengths[np.isfinite(lengths)]
        if len(lengths) and lengths.std() > _RIGID * lengths.mean():
            return False
    return True


def _forward_elbows(body: Floats) -> float:
    """How far elbows turn the forearms forward, about the line of the shoulders; a sine."""
    across = _unit(_joint(body, "lshoulder") - _joint(body, "rshoulder"))
    values = []
    for side in "lr":
        shoulder, elbow, wrist = (_joint(body, side + j) for j in ("shoulder", "elbow", "wrist"))
        upper, lower = elbow - shoulder, wrist - elbow
        lengths = np.linalg.norm(upper, axis=1) * np.linalg.norm(lower, axis=1)
        values.append(-_dot(np.cross(upper, lower), across) / np.maximum(lengths, 1e-12))
    return _mean(np.concatenate(values))


def _unit(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    result: Floats = vectors / np.maximum(lengths, 1e-12)
    return result


def _dot(a: Floats, b: Floats) -> Floats:
    result: Floats = (a * b).sum(axis=-1)
    return result


def _mean(values: Floats) -> float:
    """Mean of what is known; 0 where nothing is."""
    seen = values[np.isfinite(values)]
    return float(seen.mean()) if len(seen) else 0.0
