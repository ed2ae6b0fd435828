"""Synthetic motions: where no recording is at hand, and said to be synthetic.

A figure of 24 joints stands, walks and jumps on a floor.
A seed draws a figure (its proportions, how it stands and sways) and how it moves: tempo
and amplitudes around those of the phrases. The same seed gives the same motion.

Conventions: metres, y up, facing +z, its left side at +x. The figure is symmetric. What
touches the floor stays where it is; so a step carries the figure on.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from motionary.errors import InvalidInput
from motionary.motion import GENERIC_JOINTS, Motion, Skeleton, forward_kinematics
from motionary.recording import Recording
from motionary.rotations import euler_to_quaternions, quaternions_to_matrices
from motionary.samples.phrases import (
    PHRASES,
    SYNTHETIC_CLASSES,
    Floats,
    Phrase,
    curves,
    end_of,
    parse_phrases,
    shift,
    vary,
)
from motionary.skeletons import named_mapping

__all__ = [
    "PHRASES", "SYNTHETIC_CLASSES", "NamedSegment", "parse_phrases", "synthetic_motion",
    "synthetic_stream",
]  # fmt: skip

_TEMPO_SPREAD, _AMPLITUDE_SPREAD = 0.12, 0.08
# How a figure stands: mean and spread of the angles, degrees.
_STAND = {"shoulder aside": (8.0, 2.0), "elbow bend": (12.0, 3.0), "hip aside": (3.0, 1.0)}
_SWAYING = ("hip", "knee", "ankle", "shoulder", "elbow")
_SWAY_DEGREES = 0.8
_AROUND_S = (0.05, 0.15)
_PAUSE_S = (0.8, 1.6)

#: A segment of a stream: name of the class, start and end in seconds.
NamedSegment = tuple[str, float, float]

# Of the left side and the middle: parent, and place seen from it, metres.
_BONES: dict[str, tuple[str, tuple[float, float, float]]] = {
    "root": ("", (0.0, 0.0, 0.0)),
    "lhip": ("root", (0.09, -0.07, 0.0)),
    "lknee": ("lhip", (0.0, -0.42, 0.0)),
    "lankle": ("lknee", (0.0, -0.41, 0.0)),
    "ltoes": ("lankle", (0.0, -0.06, 0.14)),
    "belly": ("root", (0.0, 0.11, 0.0)),
    "chest": ("belly", (0.0, 0.13, 0.0)),
    "neck": ("chest", (0.0, 0.15, 0.0)),
    "head": ("neck", (0.0, 0.10, 0.02)),
    "headtop": ("head", (0.0, 0.17, 0.0)),
    "lclavicle": ("chest", (0.02, 0.14, 0.0)),
    "lshoulder": ("lclavicle", (0.16, -0.02, 0.0)),
    "lelbow": ("lshoulder", (0.0, -0.29, 0.0)),
    "lwrist": ("lelbow", (0.0, -0.26, 0.0)),
    "lfingers": ("lwrist", (0.0, -0.17, 0.0)),
}
_LEGS = ("knee", "ankle", "toes")
_ARMS = ("elbow", "wrist", "fingers")

# Which angles turn a joint, the first axis outermost: channel and fraction of its angle.
_HINGES = (("knee", 1.0), ("ankle", -1.0), ("elbow", -1.0))
_SPINE = (("spine bend", 0.5), ("spine lean", -0.5), ("spine twist", 0.5))
_NECK = (("neck bend", 1.0), ("neck twist", 1.0))
_ROOT = (("root turn", 1.0), ("root pitch", 1.0), ("root roll", -1.0))

# A joint this far above the lowest one bears a third of what the lowest bears.
_CONTACT = 0.006


@dataclass(frozen=True, slots=True)
class Proportions:
    """Factors of the figure's lengths, alike on both sides."""

    size: float = 1.0
    legs: float = 1.0
    arms: float = 1.0
    trunk: float = 1.0


def synthetic_motion(name: str, *, seed: int, rate_hz: float = 120.0) -> Motion:
    """One motion of a class, from an upright stand back to it.

    Parameters
    ----------
    name : one of `SYNTHETIC_CLASSES`
    seed : whole number, at least 0; another one gives another figure and performance
    rate_hz : frames per second

    Returns
    -------
    Motion of 24 joints that says in source and notes that it is synthetic

    Raises
    ------
    InvalidInput
        If there is no such class, or the seed is negative.
    """
    rng = _generator(seed, name)
    before, after = rng.uniform(*_AROUND_S, 2).tolist()
    phrases = shift(_performance(name, rng), before)
    duration_s = end_of(phrases) + after
    return _perform(phrases, duration_s, rng, rate_hz, f"synthetic {name} {seed}")


def synthetic_stream(
    names: Sequence[str], *, seed: int, rate_hz: float = 120.0
) -> tuple[Motion, list[NamedSegment]]:
    """One figure's motions one after the other, with standing pauses around them.

    Parameters
    ----------
    names : classes in sequence, each one of `SYNTHETIC_CLASSES`
    seed, rate_hz : as in `synthetic_motion`

    Returns
    -------
    motion : Motion
    labels : list of (name, start_s, end_s), in seconds from the first frame
    """
    rng = _generator(seed, " ".join(names))
    time_s = float(rng.uniform(*_PAUSE_S))
    phrases: list[Phrase] = []
    labels: list[NamedSegment] = []
    for name in names:
        motion = shift(_performance(name, rng), time_s)
        labels.append((name, time_s, end_of(motion)))
        phrases += motion
        time_s = end_of(motion) + float(rng.uniform(*_PAUSE_S))
    return _perform(phrases, time_s, rng, rate_hz, f"synthetic stream {seed}"), labels


def figure_skeleton(proportions: Proportions) -> Skeleton:
    """The figure's joints: names and order of the 24 generic joints."""
    names = list(GENERIC_JOINTS)
    parents, offsets = [], []
    for name in names:
        left = "l" + name[1:] if name.startswith("r") and name != "root" else name
        parent, place = _BONES[left]
        factor = proportions.legs if left[1:] in _LEGS else proportions.trunk
        factor = proportions.arms if left[1:] in _ARMS else factor
        offset = np.array(place) * factor * proportions.size
        if left != name:
            parent = "r" + parent[1:] if parent.startswith("l") else parent
            offset[0] *= -1
        parents.append(names.index(parent) if parent else -1)
        offsets.append(offset)
    return Skeleton(GENERIC_JOINTS, np.array(parents, dtype=np.intp), np.array(offsets))


def pose_figure(
    angles: dict[str, Floats], proportions: Proportions, *, rate_hz: float, source: str
) -> Motion:
    """Motion of the figure whose joints have these angles.

    Parameters
    ----------
    angles : dict of channel to array, shape (frames,), degrees or metres; see `phrases`
    """
    skeleton = figure_skeleton(proportions)
    rotations = _rotations(angles)
    n_frames = len(rotations)
    matrices = quaternions_to_matrices(rotations)
    still = forward_kinematics(skeleton, matrices, np.zeros((n_frames, 3)))
    root = _root_path(still, angles)
    return Motion(
        names=GENERIC_JOINTS,
        positions=still + root[:, None, :],
        recording=Recording(source, rate_hz=rate_hz),
        mapping=named_mapping("generic"),
        skeleton=skeleton,
        rotations=rotations,
        notes=("synthetic: made from joint-angle phrases, not recorded",),
    )


def _rotations(angles: dict[str, Floats]) -> Floats:
    """Local rotations, shape (frames, 24, 4), wxyz."""
    n_frames = len(next(iter(angles.values())))
    result = np.zeros((n_frames, len(GENERIC_JOINTS), 4))
    result[..., 0] = 1.0
    for joint, (order, channels) in _turns().items():
        columns = [factor * angles.get(name, np.zeros(n_frames)) for name, factor in channels]
        quaternions = euler_to_quaternions(np.radians(np.stack(columns, axis=-1)), order)
        result[:, GENERIC_JOINTS.index(joint)] = quaternions
    return result


def _turns() -> dict[str, tuple[str, tuple[tuple[str, float], ...]]]:
    """Per joint the order of its axes and the channel of each."""
    result = {
        "root": ("YXZ", _ROOT), "belly": ("XZY", _SPINE), "chest": ("XZY", _SPINE),
        "neck": ("XY", _NECK),
    }  # fmt: skip
    for side, outward in (("l", 1.0), ("r", -1.0)):
        for limb in (f"{side}hip", f"{side}shoulder"):
            turns = (f"{limb} bend", -1.0), (f"{limb} aside", outward), (f"{limb} twist", outward)
            result[limb] = ("XZY", turns)
        for part, sign in _HINGES:
            result[f"{side}{part}"] = ("X", ((f"{side}{part} bend", sign),))
    return result


def _root_path(still: Floats, angles: dict[str, Floats]) -> Floats:
    """Places of the root so that the figure stands, walks or flies, (frames, 3)."""
    n_frames = len(still)
    none = np.zeros(n_frames)
    clearance = np.maximum(angles.get("root up", none), 0.0)
    path = np.zeros((n_frames, 3))
    path[:, 1] = clearance - still[:, :, 1].min(axis=1)
    path[1:, ::2] -= np.cumsum(_sliding(still) * (clearance[1:, None] < 0.01), axis=0)
    heading = np.radians(angles.get("root turn", none))
    steps = np.diff(angles.get("root forward", none))[:, None]
    path[1:, ::2] += np.cumsum(steps * np.stack([np.sin(heading), np.cos(heading)], -1)[1:], axis=0)
    return path


def _sliding(still: Floats) -> Floats:
    """Way of the joints on the floor over it from frame to frame, (frames - 1, 2)."""
    above = still[:, :, 1] - still[:, :, 1].min(axis=1, keepdims=True)
    bearing = np.exp(-np.maximum(above[1:], above[:-1]) / _CONTACT)
    moved = np.diff(still[:, :, ::2], axis=0)
    total: Floats = np.einsum("fj,fjc->fc", bearing, moved) / bearing.sum(axis=1)[:, None]
    return total


def _generator(seed: int, text: str) -> np.random.Generator:
    if seed < 0:
        raise InvalidInput(f"a seed must be a whole number of at least 0, got {seed}")
    return np.random.default_rng([seed, zlib.crc32(text.encode())])


def _performance(name: str, rng: np.random.Generator) -> tuple[Phrase, ...]:
    if name not in PHRASES:
        raise InvalidInput(
            f"no synthetic class {name!r}; choose one of {', '.join(sorted(PHRASES))}"
        )
    phrases = parse_phrases(PHRASES[name])
    return vary(phrases, rng, tempo=_TEMPO_SPREAD, amplitude=_AMPLITUDE_SPREAD)


def _perform(
    phrases: Sequence[Phrase],
    duration_s: float,
    rng: np.random.Generator,
    rate_hz: float,
    source: str,
) -> Motion:
    if not 1.0 <= rate_hz <= 10_000.0:
        raise InvalidInput(f"rate_hz must lie between 1 and 10000, got {rate_hz}")
    size, legs, arms, trunk = 1 + rng.uniform(-1, 1, 4) * (0.1, 0.04, 0.04, 0.04)
    times = np.arange(max(2, round(duration_s * rate_hz))) / rate_hz
    angles = _standing(times, rng)
    for channel, curve in curves(phrases, times).items():
        angles[channel] = angles.get(channel, np.zeros(len(times))) + curve
    return pose_figure(angles, Proportions(size, legs, arms, trunk), rate_hz=rate_hz, source=source)


def _standing(times: Floats, rng: np.random.Generator) -> dict[str, Floats]:
    """Angles of a figure that stands, sways a little and faces anywhere, degrees."""
    angles = {f"{side}{part} bend": _sway(times, rng) for part in _SWAYING for side in "lr"}
    angles |= {f"spine {d}": _sway(times, rng) for d in ("bend", "lean", "twist")}
    for channel, (mean, spread) in _STAND.items():
        habit = rng.normal(mean, spread)
        for side in "lr":
            sway = angles.get(f"{side}{channel}", _sway(times, rng))
            angles[f"{side}{channel}"] = sway + habit + rng.normal(0, spread / 3)
    angles["root turn"] = np.full(len(times), rng.uniform(-180, 180))
    return angles


def _sway(times: Floats, rng: np.random.Generator) -> Floats:
    """A slow, small movement: two waves of 2 to 5 seconds."""
    periods = rng.uniform(2, 5, 2)
    phases = rng.uniform(0, 2 * np.pi, 2)
    waves: Floats = np.sin(2 * np.pi * times[:, None] / periods + phases).sum(axis=1)
    return _SWAY_DEGREES / 2 * waves
