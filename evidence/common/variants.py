"""One recording in other files: other rates, axes, units, sides, parts, gaps.

A variant is a recording changed by arithmetic of its own, and not by what reads files, then
written by the writers, and, where a writer knows but one unit or axis, with what the file
says about them changed. What must come out of reading it is known.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.faults import PLANTS, plant, with_gaps
from motionary.io import write
from motionary.motion import GENERIC_JOINTS, Motion, Skeleton, forward_kinematics, resample
from motionary.rotations import (
    matrices_to_quaternions,
    multiply_quaternions,
    quaternions_to_matrices,
)

Floats = NDArray[np.float64]

RIGS = ("amc", "bvh")
POINTS = ("c3d", "trc", "npz")
ALL = (*RIGS, *POINTS)
NO_AMC = ("bvh", *POINTS)

#: The kind that is cut out of recordings of lying down.
LYING = "lying still alone"

# What a reader should say of a variant.
SAME, ERROR, OPEN = "same", "error", "not told by the body"
FAULT = "a note on what was planted"

# x, y, z of the file from x, y, z with y up.
_Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
_Y_DOWN = np.diag([1.0, -1, -1])
_X_UP = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
# Metres, and the unit as a file says it.
_UNITS = {"m": (1.0, "m"), "mm": (0.001, "mm"), "inch": (0.0254, "in"), "odd": (0.0137, "?")}
_ARMS = ("lclavicle", "lshoulder", "lelbow", "lwrist", "lfingers")

_LEGS = ("root", "lhip", "lknee", "lankle", "ltoes", "rhip", "rknee", "rankle", "rtoes")
_UPPER = tuple(j for j in GENERIC_JOINTS if j not in _LEGS or j == "root")


@dataclass(frozen=True)
class Draft:
    """A changed recording on its way into a file.

    Attributes
    ----------
    motion : what the writer gets
    truth : what reading should give
    given : options of reading
    metres : per unit of the numbers in the file; None for what the writer takes
    z_up : whether numbers in a C3D file have z up, as its writer does it
    unit_word, up_word : what the file is made to say
    names : pairs of names that are exchanged in the texts of an AMC file and its skeleton
    rest_frames : frames before the recording that are not part of it
    part : start and end in seconds of what was planted; None for all
    """

    motion: Motion
    truth: Motion
    given: Mapping[str, Any] = field(default_factory=dict)
    metres: float | None = None
    unit_word: str | None = None
    up_word: str | None = None
    names: Mapping[str, str] = field(default_factory=dict)
    rest_frames: int = 0
    part: tuple[float, float] | None = None


class Kind(NamedTuple):
    """A way of changing recordings, the formats it makes sense in, and what should happen."""

    make: Callable[[Motion, str, np.random.Generator], Draft]
    formats: tuple[str, ...]
    expected: str


# -- changes ------------------------------------------------------------------------------


def turned(motion: Motion, turn: Floats, *, whole_rig: bool = False) -> Motion:
    """The motion in turned axes; of a rig the roots turn, or its rest pose with it."""
    skeleton, rotations = motion.skeleton, motion.rotations
    if skeleton is not None and rotations is not None:
        world = matrices_to_quaternions(turn)
        roots = skeleton.parents < 0
        offsets, rotations = skeleton.offsets.copy(), rotations.copy()
        if whole_rig:
            offsets = offsets @ turn.T
            rotations[..., 1:] = rotations[..., 1:] @ turn.T
        else:
            offsets[roots] = offsets[roots] @ turn.T
            rotations[:, roots] = multiply_quaternions(world, rotations[:, roots])
        skeleton = replace(skeleton, offsets=offsets)
    positions = motion.positions @ turn.T
    return replace(motion, positions=positions, skeleton=skeleton, rotations=rotations)


def reflected(motion: Motion) -> Motion:
    """The motion in a mirror that stands along the plane of y and z."""
    skeleton, rotations = motion.skeleton, motion.rotations
    across = np.array([-1.0, 1, 1])
    if skeleton is not None:
        skeleton = replace(skeleton, offsets=skeleton.offsets * across)
    if rotations is not None:
        rotations = rotations * np.array([1.0, 1, -1, -1])
    positions = motion.positions * across
    return replace(motion, positions=positions, skeleton=skeleton, rotations=rotations)


def renamed(motion: Motion, names: Mapping[str, str]) -> Motion:
    """The motion with some names changed."""
    new = tuple(names.get(name, name) for name in motion.names)
    skeleton = motion.skeleton
    if skeleton is not None:
        skeleton = Skeleton(new, skeleton.parents, skeleton.offsets, ends=skeleton.ends)
    return replace(motion, names=new, skeleton=skeleton)


def twins(motion: Motion, joints: tuple[str, ...] = GENERIC_JOINTS) -> dict[str, str]:
    """Names of left and right, each with the other one."""
    weights = _mapping(motion).weights
    pairs: dict[str, str] = {}
    for joint in joints:
        if joint[0] == "l" and "r" + joint[1:] in weights:
            for a, b in zip(weights[joint], weights["r" + joint[1:]], strict=True):
                pairs |= {a: b, b: a} if a != b else {}
    return pairs


def at_rate(motion: Motion, rate_hz: float) -> Motion:
    """The motion at another rate."""
    change = {"rate_hz": motion.rate_hz, "to_hz": rate_hz}
    positions = resample(motion.positions, **change)
    rotations, skeleton = motion.rotations, motion.skeleton
    if rotations is not None and skeleton is not None:
        signs = np.sign((rotations[1:] * rotations[:-1]).sum(axis=-1, keepdims=True))
        steady = rotations.copy()
        steady[1:] *= np.cumprod(np.where(signs == 0, 1, signs), axis=0)
        rotations = resample(steady, **change)
        rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
        if skeleton.ends:
            root = positions[:, 0] - skeleton.offsets[0]
            positions = forward_kinematics(skeleton, quaternions_to_matrices(rotations), root)
    recording = replace(motion.recording, rate_hz=rate_hz)
    return replace(motion, positions=positions, rotations=rotations, recording=recording, events=())


def part_of(motion: Motion, joints: tuple[str, ...]) -> Motion:
    """Some generic joints of a motion, and what they hang on."""
    mapping = _mapping(motion)
    wanted = {name for joint in joints for name in mapping.weights.get(joint, {})}
    for joint, step in mapping.normals.items():
        wanted |= {step.a, step.b, step.c} if joint in joints else set()
    keep = [i for i, name in enumerate(motion.names) if name in wanted]
    skeleton, rotations = motion.skeleton, motion.rotations
    if skeleton is not None and rotations is not None:
        for joint in reversed(range(len(motion.names))):
            parent = int(skeleton.parents[joint])
            if joint in keep and parent >= 0 and parent not in keep:
                keep.append(parent)
        keep.sort()
        places = {old: new for new, old in enumerate(keep)} | {-1: -1}
        parents = np.array([places[int(skeleton.parents[i])] for i in keep], dtype=np.intp)
        names = tuple(motion.names[i] for i in keep)
        skeleton = Skeleton(names, parents, skeleton.offsets[keep], ends=skeleton.ends)
        rotations = rotations[:, keep]
    return replace(
        motion,
        names=tuple(motion.names[i] for i in keep),
        positions=motion.positions[:, keep],
        skeleton=skeleton,
        rotations=rotations,
    )


def on_the_spot(motion: Motion) -> Motion:
    """The motion with its root above the origin."""
    root = motion.generic_positions()[:, :1].copy()
    root[..., 1] = 0
    return replace(motion, positions=motion.positions - root)


def with_rest_pose(motion: Motion, n_frames: int) -> Motion:
    """The motion after frames in which its rig rests, or arms and legs are stretched."""
    skeleton, rotations = motion.skeleton, motion.rotations
    first = motion.positions[:1]
    if skeleton is None or rotations is None:
        raise ValueError("a rest pose needs a rig")
    still = np.zeros((1, *rotations.shape[1:]))
    still[..., 0] = 1.0
    root = first[:, 0] - skeleton.offsets[0]
    rest = forward_kinematics(skeleton, quaternions_to_matrices(still), root)
    return replace(
        motion,
        positions=np.concatenate([np.repeat(rest, n_frames, axis=0), motion.positions]),
        rotations=np.concatenate([np.repeat(still, n_frames, axis=0), rotations]),
        events=(),
    )


def _mapping(motion: Motion) -> Any:
    if motion.mapping is None:
        raise ValueError(f"{motion.source}: has no mapping")
    return motion.mapping


# -- kinds --------------------------------------------------------------------------------

Make = Callable[[Motion, str, np.random.Generator], Draft]


def _of(change: Callable[[Motion], Motion], *, changes_truth: bool = False) -> Make:
    """A change that needs neither format nor chance."""

    def make(motion: Motion, suffix: str, rng: np.random.Generator) -> Draft:
        changed = change(motion)
        return Draft(changed, changed if changes_truth else motion)

    return make


def _rate(rate_hz: float) -> Make:
    def make(motion: Motion, suffix: str, rng: np.random.Generator) -> Draft:
        given = {"rate_hz": rate_hz} if suffix == "amc" else {}
        return Draft(at_rate(motion, rate_hz), motion, given)

    return make


def _axes(turn: Floats, *, whole_rig: bool = False, up_word: str = "?") -> Make:
    def make(motion: Motion, suffix: str, rng: np.random.Generator) -> Draft:
        # The writer of C3D turns z up by itself: take that back first.
        full = _Z_UP.T @ turn if suffix == "c3d" else turn
        word = up_word if suffix == "c3d" else None
        return Draft(turned(motion, full, whole_rig=whole_rig), motion, up_word=word)

    return make


def _unit(name: str, said: str | None = None) -> Make:
    metres, written = _UNITS[name]

    def make(motion: Motion, suffix: str, rng: np.random.Generator) -> Draft:
        return Draft(motion, motion, metres=metres, unit_word=written if said is None else said)

    return make


def _rotated(motion: Motion, suffix: str, rng: np.random.Generator) -> Draft:
    angle = rng.uniform(0, 2 * np.pi)
    c, s = np.cos(angle), np.sin(angle)
    moved = turned(motion, np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]))
    step = rng.uniform(-3, 3, 3) * (1, 0, 1)
    return Draft(replace(moved, positions=moved.positions + step), motion)


def _names_swapped(motion: Motion, suffix: str, rng: np.random.Generator) -> Draft:
    names = twins(motion)
    if suffix == "amc":
        return Draft(motion, motion, names=names)
    return Draft(renamed(motion, names), motion)


def _half(joints: tuple[str, ...], *, swapped: bool = False) -> Make:
    def make(motion: Motion, suffix: str, rng: np.random.Generator) -> Draft:
        half = part_of(motion, joints)
        half = renamed(half, twins(motion)) if swapped else half
        return Draft(half, motion, {"skeleton": _mapping(motion).name})

    return make


def _mirrored(motion: Motion) -> Motion:
    return renamed(reflected(motion), twins(motion))


def _arms_swapped(motion: Motion) -> Motion:
    return renamed(motion, twins(motion, _ARMS))


def _lying(motion: Motion) -> Motion:
    body = motion.generic_positions()
    low, high = (body[:, GENERIC_JOINTS.index(joint), 1] for joint in ("root", "head"))
    first = int(np.flatnonzero(np.abs(high - low) > 0.2)[-1]) + 1
    return motion.cut(min(first, motion.n_frames - 10), motion.n_frames)


def _rest_pose(motion: Motion, suffix: str, rng: np.random.Generator) -> Draft:
    # So many frames are a whole number of feature frames at any rate.
    n_frames = round(motion.rate_hz / 30)
    return Draft(with_rest_pose(motion, n_frames), motion, rest_frames=n_frames)


def _planted(kind: str) -> Make:
    def make(motion: Motion, suffix: str, rng: np.random.Generator) -> Draft:
        points, part = plant(kind, motion, rng)
        return Draft(points, motion, part=part)

    return make


KINDS: dict[str, Kind] = {
    "30 Hz": Kind(_rate(30.0), ALL, SAME),
    "60 Hz": Kind(_rate(60.0), ALL, SAME),
    "100 Hz": Kind(_rate(100.0), NO_AMC, SAME),
    "240 Hz": Kind(_rate(240.0), NO_AMC, SAME),
    "z up": Kind(_axes(_Z_UP), (*RIGS, "trc", "npz"), SAME),
    "z up, and the rig's rest pose": Kind(_axes(_Z_UP, whole_rig=True), ("bvh",), SAME),
    "y down": Kind(_axes(_Y_DOWN), (*RIGS, "trc", "npz"), SAME),
    "x up": Kind(_axes(_X_UP), NO_AMC, SAME),
    "y up, not said": Kind(_axes(np.eye(3)), ("c3d",), SAME),
    "y up, file says z": Kind(_axes(np.eye(3), up_word="+Z"), ("c3d",), ERROR),
    "metres": Kind(_unit("m"), NO_AMC, SAME),
    "millimetres": Kind(_unit("mm"), NO_AMC, SAME),
    "inches": Kind(_unit("inch"), NO_AMC, SAME),
    "an odd unit": Kind(_unit("odd"), NO_AMC, SAME),
    "metres, file says mm": Kind(_unit("m", "mm"), ("c3d", "trc"), ERROR),
    "rotated and moved": Kind(_rotated, ALL, SAME),
    "mirrored": Kind(_of(_mirrored, changes_truth=True), NO_AMC, SAME),
    "names of sides exchanged": Kind(_names_swapped, ALL, ERROR),
    "names of arms exchanged": Kind(_of(_arms_swapped), NO_AMC, ERROR),
    "left-handed axes": Kind(_of(reflected), NO_AMC, ERROR),
    "legs alone": Kind(_half(_LEGS), NO_AMC, SAME),
    "no legs": Kind(_half(_UPPER), NO_AMC, SAME),
    "no legs, sides exchanged": Kind(_half(_UPPER, swapped=True), NO_AMC, OPEN),
    "gaps": Kind(lambda one, _, rng: Draft(with_gaps(one, rng), one), POINTS, SAME),
    "kept in place": Kind(_of(on_the_spot), ALL, SAME),
    LYING: Kind(_of(_lying, changes_truth=True), ALL, SAME),
    "rest pose first": Kind(_rest_pose, RIGS, SAME),
    **{kind: Kind(_planted(kind), POINTS, FAULT) for kind in PLANTS},
}


# -- files --------------------------------------------------------------------------------


def write_draft(draft: Draft, folder: Path, suffix: str, *, asf: Path | None) -> Path:
    """Write a changed recording; returns its file."""
    path = folder / f"variant.{suffix}"
    motion = draft.motion
    if suffix == "bvh":
        write(motion, path, unit=draft.metres or "cm")
    elif suffix == "amc":
        if asf is None:
            raise ValueError("an AMC file needs a skeleton")
        own = folder / "variant.asf"
        own.write_bytes(asf.read_bytes())
        write(motion, path, asf=own)
        for file in (own, path):
            file.write_text(_exchange(file.read_text("latin-1"), draft.names), "latin-1")
    elif suffix == "npz":
        # As others write it: nothing about unit and axes.
        np.savez(
            path,
            positions=motion.positions / (draft.metres or 1.0),
            names=np.array(motion.names),
            fps=motion.rate_hz,
        )
    else:
        # These writers write millimetres.
        scale = 0.001 / draft.metres if draft.metres is not None else 1.0
        write(replace(motion, positions=motion.positions * scale), path)
        _change_texts(path, draft)
    return path


def _exchange(text: str, names: Mapping[str, str]) -> str:
    if not names:
        return text
    pattern = re.compile(r"\b(" + "|".join(map(re.escape, names)) + r")\b")
    return pattern.sub(lambda found: names[found.group()], text)


def _change_texts(path: Path, draft: Draft) -> None:
    """Let a file say another unit or axis than its writer does."""
    content = path.read_bytes()
    if draft.unit_word is not None:
        if path.suffix == ".trc":
            content = content.replace(b"\tmm\t", f"\t{draft.unit_word}\t".encode(), 1)
        else:
            at = content.index(b"mm", content.index(b"UNITS"))
            content = content[:at] + draft.unit_word.ljust(2).encode() + content[at + 2 :]
    if draft.up_word is not None:
        at = content.index(b"+Z", content.index(b"Y_SCREEN"))
        content = content[:at] + draft.up_word.ljust(2).encode() + content[at + 2 :]
    path.write_bytes(content)
