"""How does a stick figure of 24 joints stand on the floor, given the angles of its joints?

Conventions: metres, y up, facing +z, its left side at +x. The figure is symmetric. What
touches the floor stays where it is; so a step carries the figure on.
"""

from dataclasses import dataclass

import numpy as np

from motionary.motion import GENERIC_JOINTS, Motion, Skeleton, forward_kinematics
from motionary.recording import Recording
from motionary.rotations import euler_to_quaternions, quaternions_to_matrices
from motionary.samples.phrases import Floats
from motionary.skeletons import named_mapping

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

# Which angles turn a joint, the first axis outermost: channel and share of its angle.
_LIMBS = (("hip", -1.0), ("shoulder", -1.0))
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


def figure_skeleton(proportions: Proportions) -> Skeleton:
    """The figure's joints: names and order of the 24 generic joints."""
    names = list(GENERIC_JOINTS)
    parents, offsets = [], []
    for name in names:
        left = "l" + name[1:] if name.startswith("r") and name != "root" else name
        parent, place = _BONES[left]
        offset = np.array(place) * _factor(left, proportions) * proportions.size
        if left != name:
            parent = "r" + parent[1:] if parent.startswith("l") else parent
            offset[0] *= -1
        parents.append(names.index(parent) if parent else -1)
        offsets.append(offset)
    return Skeleton(GENERIC_JOINTS, np.array(parents, dtype=np.intp), np.array(offsets))


def _factor(joint: str, proportions: Proportions) -> float:
    if joint[1:] in _LEGS:
        return proportions.legs
    return proportions.arms if joint[1:] in _ARMS else proportions.trunk


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
        "root": ("YXZ", _ROOT),
        "belly": ("XZY", _SPINE),
        "chest": ("XZY", _SPINE),
        "neck": ("XY", _NECK),
    }
    for side, outward in (("l", 1.0), ("r", -1.0)):
        for part, forward in _LIMBS:
            limb = f"{side}{part}"
            result[limb] = (
                "XZY",
                ((f"{limb} bend", forward), (f"{limb} aside", outward), (f"{limb} twist", outward)),
            )
        for part, sign in _HINGES:
            result[f"{side}{part}"] = ("X", ((f"{side}{part} bend", sign),))
    return result


def _root_path(still: Floats, angles: dict[str, Floats]) -> Floats:
    """Where the root must be so that the figure stands, walks or flies, (frames, 3)."""
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
    """How far the joints on the floor move over it from frame to frame, (frames - 1, 2)."""
    above = still[:, :, 1] - still[:, :, 1].min(axis=1, keepdims=True)
    bearing = np.exp(-np.maximum(above[1:], above[:-1]) / _CONTACT)
    moved = np.diff(still[:, :, ::2], axis=0)
    total: Floats = np.einsum("fj,fjc->fc", bearing, moved) / bearing.sum(axis=1)[:, None]
    return total
