"""Poses of the body that follow a motion.

Each bone turns as the motion's bone between the same generic joints; where the file holds no
turns, or the bone's joints are no joints of its tree, only its direction is known: the twist
about it then follows the bending plane, or the parent, and is told as unknown.

Conventions: limbs take the motion's lengths unless the body keeps its own; the body stands where
the middle of the motion's hips is.
"""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body.model import Body, Pose, accumulate, place_joints
from motionary.errors import InvalidInput
from motionary.motion import GENERIC_JOINTS, Motion, forward_kinematics
from motionary.rotations import quaternions_to_matrices, shortest_turn, unit_vectors

Floats = NDArray[np.float64]
Lengths = Literal["adapted", "kept"]

#: The generic joints between which a bone of the body lies; it turns as what lies between them.
BONES = {
    "belly": ("belly", "chest"), "chest": ("chest", "neck"), "head": ("head", "headtop"),
    **{
        side + bone: (side + start, side + end)
        for side in "lr"
        for bone, start, end in (
            ("upperarm", "shoulder", "elbow"), ("forearm", "elbow", "wrist"),
            ("hand", "wrist", "fingers"), ("thigh", "hip", "knee"), ("shank", "knee", "ankle"),
            ("foot", "ankle", "toes"),
        )
    },
}  # fmt: skip
# Bones of the trunk turn with the file's; the mesh's own lengths and directions stay.
_TRUNK = ("root", "belly", "chest", "head")
_STRETCHED = ("upperarm", "forearm", "thigh", "shank", "foot")
#: The joint of the body at which a bone ends.
_NEXT = {
    "upperarm": "forearm", "forearm": "hand", "thigh": "shank", "shank": "foot", "foot": "toes",
}  # fmt: skip
_LIMBS = {"thigh": ("hip", "knee", "ankle"), "upperarm": ("shoulder", "elbow", "wrist")}
# A trunk that leans by less at rest (cosine) is taken for upright.
_UPRIGHT = 0.7
# Below this bend, in radians, three joints have no plane.
_BENT = np.radians(20)


class DrivenPose(NamedTuple):
    """Poses that follow a motion.

    `twist_known` (joints,) tells of which bones the turn about their own axis comes from the
    file; `scale` is by how much the rest of the body was scaled.
    """

    pose: Pose
    twist_known: NDArray[np.bool_]
    scale: float


class BoneTurns(NamedTuple):
    """How the bones of a motion turn, by the body's names of them.

    Attributes
    ----------
    joints : array, shape (frames, 24, 3), the generic joints, metres; NaN = not seen
    turns : of the bones whose turns the file holds, global ones, shape (frames, 3, 3)
    rest : of these the directions at rest, unit vectors; of the root from right to left hip
    up : direction from the hips to the neck at rest, a unit vector; None if unknown
    """

    joints: Floats
    turns: dict[str, Floats]
    rest: dict[str, Floats]
    up: Floats | None = None

    def directions(self) -> dict[str, Floats]:
        """Of all bones between two generic joints the unit directions (frames, 3).

        Those of the turns where they are known: a toe that bends turns no foot.
        """
        return {
            bone: self.turns[bone] @ self.rest[bone]
            if bone in self.turns
            else unit_vectors(self.joints[:, _generic(end)] - self.joints[:, _generic(start)])
            for bone, (start, end) in BONES.items()
        }


def pose_from_motion(body: Body, motion: Motion, *, lengths: Lengths = "adapted") -> DrivenPose:
    """Poses of the body in all frames of a motion.

    Parameters
    ----------
    body : Body
    motion : Motion, of a person
    lengths : "adapted" stretches limbs to the motion's, "kept" keeps the body's

    Raises
    ------
    InvalidInput
        If hips, knees or ankles are not seen in a frame.
    UnknownSkeleton, NotHuman
        If the motion's joints are not known.
    """
    if lengths not in ("adapted", "kept"):
        raise InvalidInput(f"lengths needs to be 'adapted' or 'kept', got {lengths!r}")
    driver = read_turns(motion)
    legs = [_generic(side + joint) for side in "lr" for joint in ("hip", "knee", "ankle")]
    unseen = np.flatnonzero(np.isnan(driver.joints[:, legs]).any(axis=(1, 2)))
    if len(unseen):
        raise InvalidInput(
            "the body needs hips, knees and ankles in every frame; "
            f"frame {unseen[0] + motion.first_frame} and {len(unseen) - 1} more lack one; fill "
            "gaps (fill_gaps_s=) or cut them off",
            file=motion.source or "motion",
        )
    turned, known = _turn_bones(body, driver)
    stretches, scale = None, 1.0
    if lengths == "adapted":
        stretches, scale = _stretches(body, driver)
    pose = place_joints(body, turned, np.zeros((motion.n_frames, 3)), stretches)
    hips = pose.joints[:, [body.index("lthigh"), body.index("rthigh")]].mean(axis=1)
    wanted = driver.joints[:, [_generic("lhip"), _generic("rhip")]].mean(axis=1)
    return DrivenPose(pose._replace(joints=pose.joints + (wanted - hips)[:, None]), known, scale)


def _generic(joint: str) -> int:
    return GENERIC_JOINTS.index(joint)


def read_turns(motion: Motion) -> BoneTurns:
    """How the bones of a motion turn.

    Raises
    ------
    UnknownSkeleton, NotHuman
        If the motion's joints are not known.
    """
    joints = motion.generic_positions()
    if motion.skeleton is None or motion.rotations is None or motion.mapping is None:
        return BoneTurns(joints, {}, {})
    skeleton = motion.skeleton
    identity = np.tile(np.eye(3), (1, len(skeleton.names), 1, 1))
    at_rest = forward_kinematics(skeleton, identity, np.zeros((1, 3)))
    places = dict(zip(skeleton.names, range(len(skeleton.names)), strict=True))
    at_rest_too = Motion(skeleton.names, at_rest, motion.recording, motion.mapping)
    rest = at_rest_too.generic_positions()[0]
    turned = accumulate(skeleton.parents, quaternions_to_matrices(motion.rotations))

    def file_joint(generic: str) -> int | None:
        of = motion.mapping.weights.get(generic, {}) if motion.mapping else {}
        return places.get(next(iter(of))) if len(of) == 1 else None

    turns, directions = {}, {}
    for bone, (start, end) in BONES.items():
        own = file_joint(end if skeleton.ends else start)
        direction = rest[_generic(end)] - rest[_generic(start)]
        if own is not None and np.linalg.norm(direction) > 1e-6:
            turns[bone], directions[bone] = turned[:, own], unit_vectors(direction)
    root = file_joint("root")
    if root is not None:
        turns["root"] = turned[:, root]
        directions["root"] = unit_vectors(rest[_generic("lhip")] - rest[_generic("rhip")])
    up = unit_vectors(rest[_generic("neck")] - rest[_generic("root")])
    return BoneTurns(joints, turns, directions, None if np.isnan(up).any() else up)


def _turn_bones(body: Body, driver: BoneTurns) -> tuple[Floats, NDArray[np.bool_]]:
    """Global turns of all bones (frames, joints, 3, 3), and whose twist is known."""
    n_frames, n = len(driver.joints), len(body.names)
    turned = np.empty((n_frames, n, 3, 3))
    alignments = np.tile(np.eye(3), (n, 1, 1))
    known = np.zeros(n, dtype=bool)
    trunk = _align_trunk(driver)
    for joint, parent in enumerate(body.parents):
        name = body.names[joint]
        inherited = alignments[parent] if parent >= 0 and name not in _TRUNK else trunk
        mesh = _mesh_direction(body, name)
        if name in driver.turns and not np.isnan(driver.rest[name]).any():
            if name == "root":
                inherited = shortest_turn(trunk[:, 0], driver.rest[name]) @ trunk
            elif name not in _TRUNK and mesh is not None:
                inherited = shortest_turn(inherited @ mesh, driver.rest[name]) @ inherited
            alignments[joint], known[joint] = inherited, True
            turned[:, joint] = driver.turns[name] @ inherited
            continue
        alignments[joint] = inherited
        if parent < 0:
            turned[:, joint] = _frame(driver.joints, "lhip", "rhip", ("chest", "neck", "belly"))
        elif name == "chest":
            turned[:, joint] = _frame(
                driver.joints,
                "lshoulder",
                "rshoulder",
                ("neck", "head"),
                "chest",
                turned[:, parent],
            )
        else:
            turned[:, joint] = _follow(body, driver.joints, name, turned[:, parent])
    # What has no joints of its own in the file goes with its parent, whose twist it shares.
    for joint, parent in enumerate(body.parents):
        if parent >= 0 and body.names[joint] not in BONES:
            known[joint] = known[parent]
    return turned, known


def _align_trunk(driver: BoneTurns) -> Floats:
    """How the trunk of the body at rest turns into that of the file, which may lie, (3, 3)."""
    if driver.up is None or "root" not in driver.rest or driver.up[1] > _UPRIGHT:
        return np.eye(3)
    left = driver.rest["root"]
    up = unit_vectors(driver.up - (driver.up @ left) * left)
    return np.stack([left, up, np.cross(left, up)], axis=1)


def _mesh_direction(body: Body, name: str) -> Floats | None:
    following = _NEXT.get(name[1:])
    if following is not None:
        step = body.joints[body.index(name[0] + following)] - body.joints[body.index(name)]
        return unit_vectors(step)
    if name in ("lhand", "rhand"):
        tip = body.vertices[body.ends[1 if name[0] == "l" else 2]]
        return unit_vectors(tip - body.joints[body.index(name)])
    return None


def _frame(
    joints: Floats,
    left: str,
    right: str,
    above: tuple[str, ...],
    below: str = "",
    otherwise: Floats | None = None,
) -> Floats:
    """Turns of the trunk: x to the left, y up along it, where these joints are seen."""
    side = unit_vectors(joints[:, _generic(left)] - joints[:, _generic(right)])
    middle = joints[:, [_generic(left), _generic(right)]].mean(axis=1)
    origin = joints[:, _generic(below)] if below else middle
    up = np.full_like(side, np.nan)
    for name in above:
        up = np.where(np.isnan(up), joints[:, _generic(name)] - origin, up)
    up = unit_vectors(up - (up * side).sum(axis=1)[:, None] * side)
    result: Floats = np.stack([side, up, np.cross(side, up)], axis=-1)
    fallback = np.tile(np.eye(3), (len(result), 1, 1)) if otherwise is None else otherwise
    unseen = np.asarray(np.isnan(result).any(axis=(1, 2)))
    return np.where(unseen[:, None, None], fallback, result)


def _follow(body: Body, joints: Floats, name: str, parent: Floats) -> Floats:
    """Turns of a bone of which only its direction is known: no twist against its parent."""
    mesh = _mesh_direction(body, name)
    if mesh is None or name not in BONES:
        return parent
    start, end = BONES[name]
    direction = unit_vectors(joints[:, _generic(end)] - joints[:, _generic(start)])
    carried = parent @ mesh
    swung = shortest_turn(carried, np.where(np.isnan(direction), carried, direction)) @ parent
    plane = _bending(joints, name)
    if plane is None:
        return swung
    # About the bone, until the mesh's own hinge is the normal of the plane.
    hinge = swung @ _hinge(body, name)
    hinge = unit_vectors(hinge - (hinge * direction).sum(1)[:, None] * direction)
    usable = ~np.isnan(plane).any(axis=1) & ~np.isnan(hinge).any(axis=1)
    twist = np.tile(np.eye(3), (len(swung), 1, 1))
    twist[usable] = shortest_turn(hinge[usable], plane[usable])
    result: Floats = twist @ swung
    return result


def _bending(joints: Floats, name: str) -> Floats | None:
    """Unit normals (frames, 3) of the plane in which a limb bends; NaN where it is straight."""
    if name[1:] not in _LIMBS:
        return None
    first, middle, last = (joints[:, _generic(name[0] + one)] for one in _LIMBS[name[1:]])
    normal = np.cross(unit_vectors(middle - first), unit_vectors(last - middle))
    bent = np.linalg.norm(normal, axis=1) > np.sin(_BENT)
    return np.where(bent[:, None], unit_vectors(normal), np.nan)


def _hinge(body: Body, name: str) -> Floats:
    """The axis of the mesh at rest about which an elbow or a knee bends."""
    if name.endswith("thigh"):
        return np.array([1.0, 0.0, 0.0])
    shoulder, elbow, wrist = (
        body.joints[body.index(name[0] + one)] for one in ("upperarm", "forearm", "hand")
    )
    return unit_vectors(np.cross(elbow - shoulder, wrist - elbow))


def _stretches(body: Body, driver: BoneTurns) -> tuple[Floats, float]:
    """Stretch of each bone (joints, 3, 3) to the motion's lengths, and the scale of the rest."""

    def length(start: str, end: str) -> float:
        steps = driver.joints[:, _generic(end)] - driver.joints[:, _generic(start)]
        steps = steps[~np.isnan(steps).any(axis=1)]
        return float(np.median(np.linalg.norm(steps, axis=1))) if len(steps) else np.nan

    def own(start: str, end: str) -> float:
        return float(np.linalg.norm(body.joints[body.index(end)] - body.joints[body.index(start)]))

    pairs = [(side + bone, side + _NEXT[bone]) for side in "lr" for bone in ("thigh", "shank")]
    scale = sum(length(*BONES[bone]) for bone, _ in pairs) / sum(own(*pair) for pair in pairs)
    result = np.tile(scale * np.eye(3), (len(body.names), 1, 1))
    wanted = {
        side + bone: (length(*BONES[side + bone]), own(side + bone, side + _NEXT[bone]))
        for side in "lr"
        for bone in _STRETCHED
    }
    for bone, (of_motion, of_mesh) in wanted.items():
        along = _mesh_direction(body, bone)
        if along is not None and np.isfinite(of_motion) and of_motion > 0:
            result[body.index(bone)] += (of_motion / of_mesh - scale) * np.outer(along, along)
    across = length("lhip", "rhip") / own("lthigh", "rthigh")
    result[0] += (across - scale) * np.diag([1.0, 0, 0])
    return result, scale
