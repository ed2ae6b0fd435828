"""Poses of VMC, the protocol in which avatar programs send motion by Open Sound Control.

After the Virtual Motion Capture protocol 2 (protocol.vmc.info). /VMC/Ext/Bone/Pos has the name of
one of Unity's humanoid bones, its position and its rotation (x, y, z, w) against the bone above
it; /VMC/Ext/Root/Pos those of the whole; /VMC/Ext/T the sender's time in seconds. A bone that a
body does not have is left out: what hangs on it hangs on the next one above.

Conventions: messages are left-handed, y up, metres, bodies face z; lines and motions are
right-handed: x is turned round.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from motionary.errors import InvalidInput
from motionary.features.body import Floats
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.rotations import matrices_to_quaternions, shortest_turn, unit_vectors

#: Where programs that take poses of VMC listen.
VMC_PORT = 39539
#: Poses a second that those of VMC are brought to: it does not tell its own.
VMC_HZ = 60.0
BONE, ROOT, TIME = "/VMC/Ext/Bone/Pos", "/VMC/Ext/Root/Pos", "/VMC/Ext/T"

_LIMBS = {
    "UpperLeg": "Hips", "LowerLeg": "UpperLeg", "Foot": "LowerLeg", "Toes": "Foot",
    "Shoulder": "UpperChest", "UpperArm": "Shoulder", "LowerArm": "UpperArm", "Hand": "LowerArm",
    "MiddleProximal": "Hand", "MiddleIntermediate": "MiddleProximal",
    "MiddleDistal": "MiddleIntermediate",
}  # fmt: skip
# The bone above each, after it in no case; eyes, jaw and other fingers move nothing that counts.
_ABOVE = {
    "Hips": "", "Spine": "Hips", "Chest": "Spine", "UpperChest": "Chest", "Neck": "UpperChest",
    "Head": "Neck",
} | {
    side + bone: above if above in ("Hips", "UpperChest") else side + above
    for side in ("Left", "Right")
    for bone, above in _LIMBS.items()
}  # fmt: skip
# A clock that is a little behind was ahead by guesses between its times.
_BEHIND_S, _LEAST_STEP_S = 0.25, 1e-3
# No bone is so short: programs send such positions of bones that they do not know.
_NO_LENGTH_M = 1e-6

Vector = tuple[float, ...]


class _Placed(NamedTuple):
    """Position, and rotation (w, x, y, z) of a unit quaternion; NaN where not known."""

    position: Vector
    rotation: Vector


_NOWHERE = _Placed((math.nan,) * 3, (math.nan,) * 4)
_ORIGIN = _Placed((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


class VmcReader:
    """Lines of poses, as `PoseLines` reads them, of one sender's messages.

    A pose is over when all bones that the sender has have come, or one comes again.
    """

    def __init__(self) -> None:
        self._bones: tuple[str, ...] = ()
        self._placed: dict[str, _Placed] = {}
        self._root = _ORIGIN
        self._given_s: float | None = None
        # Of the pose that is coming: what its sender's clock said, and when it began to come.
        self._began: tuple[float | None, float] = (None, 0.0)
        self._last_s: float | None = None
        self._last_arrived_s = 0.0
        self._has_lengths = False

    def push(self, address: str, values: Sequence[Any], *, arrived_s: float) -> list[str]:
        """Lines of a pose that is over by this message, none of most messages.

        Parameters
        ----------
        address, values : of the message
        arrived_s : when it came, by a clock that only grows

        Raises
        ------
        InvalidInput
            If a bone or a time is not as the protocol has it, or bones have no length.
        """
        if address == TIME:
            given_s = _numbers(address, values, 1)[0]
            if not math.isfinite(given_s):
                raise InvalidInput(f"{address} needs a time in seconds, got {given_s}")
            self._given_s = given_s
        elif address == ROOT:
            self._root = _placed(address, values)
            if math.isnan(self._root.rotation[0]):
                # Some programs do not turn the whole, and send no rotation.
                self._root = _Placed(self._root.position, _ORIGIN.rotation)
        elif address == BONE and values and str(values[0]) in _ABOVE:
            return self._push_bone(str(values[0]), _placed(address, values), arrived_s)
        return []

    def _push_bone(self, bone: str, placed: _Placed, arrived_s: float) -> list[str]:
        lines = self._end() if bone in self._placed else []
        if not self._placed:
            self._began, self._given_s = (self._given_s, arrived_s), None
        self._placed[bone] = placed
        # Of the first pose it is not known which bones there are.
        if len(self._placed) == len(self._bones):
            lines += self._end()
        return lines

    def _end(self) -> list[str]:
        """The lines of the pose that is over."""
        lines = []
        bones = tuple(bone for bone in _ABOVE if bone in self._placed or bone in self._bones)
        if bones != self._bones:
            self._bones = bones
            joints = [bone[0].lower() + bone[1:] for bone in bones]
            lines.append(json.dumps({"joints": joints}))
        positions = list(_stand(self._bones, self._placed, self._root))
        self._has_lengths = self._has_lengths or any(
            math.hypot(*placed.position) > _NO_LENGTH_M
            for bone, placed in self._placed.items()
            if bone != "Hips"
        )
        self._placed.clear()
        if not self._has_lengths:
            raise InvalidInput(
                "bones have no length: positions of /VMC/Ext/Bone/Pos are all 0, 0, 0; let the "
                "sender send those of its avatar's bones"
            )
        rows = [None if any(map(math.isnan, row)) else row for row in positions]
        return [*lines, json.dumps({"time_s": self._clock(), "positions": rows})]

    def _clock(self) -> float:
        """When the pose was, by the sender's clock as far as it tells it."""
        given_s, arrived_s = self._began
        last_s, self._last_s = self._last_s, 0.0
        guess = 0.0 if last_s is None else last_s + arrived_s - self._last_arrived_s
        time_s = guess if given_s is None else given_s
        if given_s is not None:
            # A float of 32 bits tells no milliseconds after a few hours.
            step = float(np.spacing(np.float32(abs(given_s))))
            if step > _LEAST_STEP_S and last_s is not None:
                time_s = min(max(guess, given_s - step), given_s + step)
        if last_s is not None and last_s - _BEHIND_S < time_s <= last_s:
            time_s = last_s + _LEAST_STEP_S
        self._last_s, self._last_arrived_s = time_s, arrived_s
        return round(time_s, 6)


def _numbers(address: str, values: Sequence[Any], n: int) -> Vector:
    """The last numbers of a message."""
    own = values[len(values) - n :] if len(values) >= n else ()
    if len(own) != n or not all(isinstance(one, int | float) for one in own):
        raise InvalidInput(f"{address} needs {n} numbers, got {str(list(values))[:80]}")
    return tuple(map(float, own))


def _placed(address: str, values: Sequence[Any]) -> _Placed:
    """Position and rotation of a message, right-handed."""
    # What follows is of later versions: scale and offset of the whole.
    x, y, z, qx, qy, qz, qw = _numbers(address, values[1:8], 7)
    length = math.hypot(qx, qy, qz, qw)
    if not all(map(math.isfinite, (x, y, z))):
        return _NOWHERE
    if not (math.isfinite(length) and length > 0):
        return _Placed((-x, y, z), _NOWHERE.rotation)
    return _Placed((-x, y, z), (qw / length, qx / length, -qy / length, -qz / length))


def _stand(bones: Sequence[str], placed: Mapping[str, _Placed], root: _Placed) -> Iterator[Vector]:
    """Positions of bones by forward kinematics; NaN below what did not come."""
    world: dict[str, _Placed] = {"": root}
    for bone in bones:
        above = _ABOVE[bone]
        while above and above not in world:
            above = _ABOVE[above]
        own, base = placed.get(bone, _NOWHERE), world[above]
        moved = _turn(base.rotation, own.position)
        position = tuple(a + b for a, b in zip(base.position, moved, strict=True))
        world[bone] = _Placed(position, _multiply(base.rotation, own.rotation))
        known = bone == "Hips" or math.hypot(*own.position) > _NO_LENGTH_M
        yield position if known else _NOWHERE.position


def _multiply(left: Vector, right: Vector) -> Vector:
    # In plain numbers: of one quaternion NumPy takes ten times as long.
    w, x, y, z = left
    a, b, c, d = right
    return (
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    )


def _turn(rotation: Vector, vector: Vector) -> Vector:
    w, x, y, z = rotation
    return _multiply(_multiply(rotation, (0.0, *vector)), (w, -x, -y, -z))[1:]


# -- a recording as messages ---------------------------------------------------------------

# Where bones point in Unity's T-pose, right-handed: the body faces z, its left is at x.
_JOINT_OF = {
    "Hips": "root", "Spine": "belly", "Chest": "chest", "Neck": "neck", "Head": "head",
} | {
    side + bone: side[0].lower() + joint
    for side in ("Left", "Right")
    for bone, joint in {
        "UpperLeg": "hip", "LowerLeg": "knee", "Foot": "ankle", "Toes": "toes",
        "Shoulder": "clavicle", "UpperArm": "shoulder", "LowerArm": "elbow", "Hand": "wrist",
        "MiddleDistal": "fingers",
    }.items()
}  # fmt: skip
_POINTING = {
    "UpperLeg": (0.7, -0.3, 0.0), "LowerLeg": (0.0, -1.0, 0.0), "Foot": (0.0, -1.0, 0.0),
    "Toes": (0.0, -0.5, 1.0), "Shoulder": (0.3, 1.0, 0.0),
}  # fmt: skip

Message = tuple[str, list[Any]]


def write_messages(motion: Motion) -> Iterator[list[Message]]:
    """Messages of each pose of a recording; forward kinematics gives its joints again.

    Bones turn as their joints tell: about their own length they do not. What is not seen is
    not sent.

    Raises
    ------
    InvalidInput
        If it is not known which joints are those of the body.
    """
    positions = motion.generic_positions()
    seen = np.asarray(np.isfinite(positions).all(axis=2))
    bones = [
        bone for bone, joint in _JOINT_OF.items() if seen[:, GENERIC_JOINTS.index(joint)].any()
    ]
    bones.sort(key=list(_ABOVE).index)
    if "Hips" not in bones:
        raise InvalidInput("by VMC only bodies with hips can be sent, none are seen here")
    at = {bone: positions[:, GENERIC_JOINTS.index(_JOINT_OF[bone])] for bone in bones}
    above = {bone: _next_above(bone, at) for bone in bones}
    turns: dict[str, Floats] = {"": np.tile(np.eye(3), (len(positions), 1, 1))}
    columns = []
    for bone in bones:
        parent = above[bone]
        turns[bone] = _turns_of(bone, at, above, turns[parent])
        back = turns[parent].swapaxes(1, 2)
        step = at[bone] - (at[parent] if parent else 0.0)
        offset = (back @ step[:, :, np.newaxis])[:, :, 0]
        local = matrices_to_quaternions(back @ turns[bone])
        # x is turned round; rotations are sent with w last.
        columns.append(np.hstack([offset * (-1, 1, 1), local[:, 1:] * (1, -1, -1), local[:, :1]]))
    for i in range(len(positions)):
        yield [
            ("/VMC/Ext/OK", [1]),
            (TIME, [i / motion.rate_hz]),
            (ROOT, ["root", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
            *(
                (BONE, [bone, *column[i].tolist()])
                for bone, column in zip(bones, columns, strict=True)
                if np.isfinite(column[i]).all()
            ),
        ]


def _next_above(bone: str, among: Mapping[str, Any]) -> str:
    above = _ABOVE[bone]
    while above and above not in among:
        above = _ABOVE[above]
    return above


def _pointing(bone: str) -> Floats:
    """Where a bone points from the one above it, in the T-pose."""
    side = {"L": 1.0, "R": -1.0}.get(bone[0], 0.0)
    if not side:
        return np.array([0.0, 1.0, 0.0])
    direction = _POINTING.get(bone.removeprefix("Left").removeprefix("Right"), (1.0, 0.0, 0.0))
    return unit_vectors(np.array(direction) * (side, 1.0, 1.0))


def _turns_of(
    bone: str, at: Mapping[str, Floats], above: Mapping[str, str], parent: Floats
) -> Floats:
    """Rotation matrices (frames, 3, 3) of a bone in the world, by the bones that hang on it."""
    ends = [one for one in at if above[one] == bone]
    if not ends:
        return parent
    rest = np.array([_pointing(one) for one in ends])
    now = np.stack([unit_vectors(at[one] - at[bone]) for one in ends], axis=1)
    unseen = np.asarray(~np.isfinite(now).all(axis=(1, 2)))
    if len(ends) == 1:
        carried = parent @ rest[0]
        turned = shortest_turn(carried, np.where(np.isnan(now[:, 0]), carried, now[:, 0])) @ parent
    else:
        # Nearest rotation of several directions: Kabsch.
        now[unseen] = np.eye(3)[0]
        left, _, right = np.linalg.svd(np.einsum("fki,kj->fij", now, rest))
        left[:, :, 2] *= np.linalg.det(left @ right)[:, np.newaxis]
        turned = left @ right
    result: Floats = np.where(unseen[:, np.newaxis, np.newaxis], parent, turned)
    return result
