"""A chain of joints that carries the keypoints: its lengths, its poses, and how points move.

After Baak (2012), eqs. (6.1) and (6.2): a pose is a rigid motion of the root and a turn about
each joint, applied in the sequence of the chain; a point moves by the twists of all joints above.

Conventions: at rest the person stands, y up, facing z, left along x, arms to the sides.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.motion import Skeleton, forward_kinematics
from motionary.rotations import (
    matrices_to_quaternions,
    rotation_vectors_to_matrices,
    unit_vectors,
)

Floats = NDArray[np.float64]

_Row = tuple[str, str, tuple[float, float, float]]

# Joint, parent, place from the parent's joint: of a person of 1.75 m, where nothing is measured.
_TRUNK = (
    ("root", "", (0, 0, 0)),
    ("belly", "root", (0, 0.10, 0)),
    ("chest", "belly", (0, 0.20, 0)),
    ("neck", "chest", (0, 0.22, 0)),
)
_SIDE: tuple[_Row, ...] = (
    ("clavicle", "chest", (0, 0.22, 0)),
    ("shoulder", "clavicle", (0.17, 0, 0)),
    ("elbow", "shoulder", (0.29, 0, 0)),
    ("hip", "root", (0.09, 0, 0)),
    ("knee", "hip", (0, -0.43, 0)),
    ("ankle", "knee", (0, -0.41, 0)),
)
# Point, the joint that it is fixed to, and where.
_MIDDLE_POINTS = (
    ("Hip", "root", (0, 0, 0)),
    ("Neck", "neck", (0, 0, 0)),
    ("Head", "neck", (0, 0.27, 0.02)),
    ("Nose", "neck", (0, 0.14, 0.12)),
)
_SIDE_POINTS: tuple[_Row, ...] = (
    ("Eye", "neck", (0.03, 0.17, 0.10)),
    ("Ear", "neck", (0.07, 0.15, 0.02)),
    ("Shoulder", "shoulder", (0, 0, 0)),
    ("Elbow", "elbow", (0, 0, 0)),
    ("Wrist", "elbow", (0.26, 0, 0)),
    ("Hip", "hip", (0, 0, 0)),
    ("Knee", "knee", (0, 0, 0)),
    ("Ankle", "ankle", (0, 0, 0)),
    ("BigToe", "ankle", (-0.02, -0.07, 0.18)),
    ("SmallToe", "ankle", (0.05, -0.07, 0.15)),
    ("Heel", "ankle", (0, -0.06, -0.05)),
)
_HEAD = ("Head", "Nose", "LEye", "REye", "LEar", "REar")
_FOOT = ("BigToe", "SmallToe", "Heel")
# How far up the trunk its joints are, of the way from the hips to the neck.
_TRUNK_SHARES = {"belly": 0.2, "chest": 0.4, "neck": 0.4}
#: Joints whose turns follow others' where no point of theirs is seen.
_ROUNDS = 3


class Chain(NamedTuple):
    """Joints, and the points that they carry.

    `offsets` (joints, 3) from the parent's joint and `places` (points, 3) from the joint of each
    point, at rest, metres; `carried` (points, joints), which joints move each point.
    """

    joints: tuple[str, ...]
    parents: NDArray[np.intp]
    offsets: Floats
    points: tuple[str, ...]
    holders: NDArray[np.intp]
    places: Floats

    @property
    def carried(self) -> NDArray[np.bool_]:
        """Which joints move each point."""
        above = np.eye(len(self.joints), dtype=bool)
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                above[joint] |= above[parent]
        return above[self.holders]


class ChainPose(NamedTuple):
    """Poses of a chain: turns (frames, joints, 3, 3) in the world, places (frames, joints, 3)."""

    turns: Floats
    centres: Floats


def points_of(chain: Chain, pose: ChainPose) -> Floats:
    """Places of the points, (frames, points, 3)."""
    turned = (pose.turns[:, chain.holders] @ chain.places[:, :, None])[..., 0]
    points: Floats = pose.centres[:, chain.holders] + turned
    return points


def place(chain: Chain, turns: Floats, roots: Floats) -> ChainPose:
    """The pose of turns in the world and places of the root (frames, 3)."""
    centres = np.empty((*turns.shape[:2], 3))
    for joint, parent in enumerate(chain.parents):
        if parent < 0:
            centres[:, joint] = roots
        else:
            centres[:, joint] = centres[:, parent] + turns[:, parent] @ chain.offsets[joint]
    return ChainPose(turns, centres)


def move(chain: Chain, pose: ChainPose, twists: Floats) -> ChainPose:
    """The pose after a twist of each joint.

    `twists` (frames, 3 + 3 joints) are a step of the root, then axis times angle of each joint, in
    the world.
    """
    n = len(chain.joints)
    steps = rotation_vectors_to_matrices(twists[:, 3:].reshape(-1, n, 3))
    turns, whole = np.empty_like(pose.turns), np.empty_like(pose.turns)
    for joint, parent in enumerate(chain.parents):
        # First the joint's own turn, then all that turn it from above.
        whole[:, joint] = steps[:, joint] if parent < 0 else whole[:, parent] @ steps[:, joint]
        turns[:, joint] = whole[:, joint] @ pose.turns[:, joint]
    return place(chain, turns, pose.centres[:, 0] + twists[:, :3])


def linearise(chain: Chain, pose: ChainPose, points: Floats) -> Floats:
    """How points move by small twists, (frames, points, 3, 3 + 3 joints): 1 + θξ̂ of (6.4)."""
    n_frames, n_points, n_joints = len(points), len(chain.points), len(chain.joints)
    away = points[:, :, None] - pose.centres[:, None]
    away = away * chain.carried[:, :, None]
    x, y, z = away[..., 0], away[..., 1], away[..., 2]
    result = np.zeros((n_frames, n_points, 3, 3 + 3 * n_joints))
    result[..., :3] = np.eye(3)
    turning = result[..., 3:].reshape(n_frames, n_points, 3, n_joints, 3)
    # ω × r as a matrix on ω.
    turning[:, :, 0, :, 1], turning[:, :, 0, :, 2] = z, -y
    turning[:, :, 1, :, 0], turning[:, :, 1, :, 2] = -z, x
    turning[:, :, 2, :, 0], turning[:, :, 2, :, 1] = y, -x
    return result


# ---- lengths


def measure_chain(names: tuple[str, ...], points: Floats) -> Chain:
    """The chain of a person, by medians of distances of points (frames, points, 3) where seen."""
    if len(points) < 2 or not {"LHip", "RHip"} <= set(names):
        raise InvalidInput(
            "tracking needs two images or more with both hips, which two cameras see; got "
            f"{len(points)} with {', '.join(names)}"
        )
    joints, fixed = _tables(names)
    at = {name: points[:, k] for k, name in enumerate(names)}
    _add_middles(at)
    offsets = {name: np.array(offset, dtype=np.float64) for name, _, offset in joints}
    places = {name: np.array(where, dtype=np.float64) for name, _, where in fixed}

    def scale(kept: dict[str, Floats], name: str, pairs: list[tuple[str, str]]) -> None:
        far = _median_distance(at, pairs)
        if far is not None:
            kept[name] *= far / np.linalg.norm(kept[name])

    trunk = _median_distance(at, [("root", "Neck")])
    if trunk is not None:
        for name, share in _TRUNK_SHARES.items():
            offsets[name] = np.array([0, share * trunk, 0])
    _measure_pelvis(at, places)
    for side, sign in (("l", 1), ("r", -1)):
        wide = _median_distance(at, [("LHip", "RHip")])
        offsets[f"{side}hip"] = np.array([sign * (wide / 2 if wide else 0.09), 0, 0])
        offsets[f"{side}clavicle"] = offsets["neck"].copy()
        scale(offsets, f"{side}shoulder", [(f"{s}Shoulder", "Neck") for s in "LR"])
        for joint, one, other in (
            ("elbow", "Shoulder", "Elbow"), ("knee", "Hip", "Knee"), ("ankle", "Knee", "Ankle"),
        ):  # fmt: skip
            scale(offsets, f"{side}{joint}", [(f"{s}{one}", f"{s}{other}") for s in "LR"])
        wrist = f"{side.upper()}Wrist"
        if wrist in places:
            scale(places, wrist, [(f"{s}Elbow", f"{s}Wrist") for s in "LR"])
    _measure_clusters(at, places)
    order = [name for name, _, _ in joints]
    return Chain(
        tuple(order),
        np.array([order.index(parent) if parent else -1 for _, parent, _ in joints], dtype=np.intp),
        np.stack([offsets[name] for name in order]),
        tuple(name for name, _, _ in fixed),
        np.array([order.index(holder) for _, holder, _ in fixed], dtype=np.intp),
        np.stack([places[name] for name, _, _ in fixed]),
    )


def _tables(names: tuple[str, ...]) -> tuple[list[_Row], list[_Row]]:
    """Joints and points of a layout; those in the middle are there even if none is detected."""
    fixed: list[_Row] = [row for row in _MIDDLE_POINTS if row[0] in (*names, "Hip", "Neck")]
    joints: list[_Row] = list(_TRUNK)
    central = {name for name, _, _ in _TRUNK}
    holders = {*central, *(name for name, _, _ in _SIDE)}
    for side, sign in (("L", 1), ("R", -1)):
        own = {name: name if name in central else f"{side.lower()}{name}" for name in holders}
        for name, parent, (x, y, z) in _SIDE:
            joints.append((own[name], own[parent], (sign * x, y, z)))
        for name, holder, (x, y, z) in _SIDE_POINTS:
            if f"{side}{name}" in names:
                fixed.append((f"{side}{name}", own[holder], (sign * x, y, z)))
    return joints, fixed


def _add_middles(at: dict[str, Floats]) -> None:
    """The root in the middle of the hips, and the neck where no detector gives it."""
    at["root"] = at["Hip"] if "Hip" in at else np.full_like(next(iter(at.values())), np.nan)
    if {"LHip", "RHip"} <= at.keys():
        at["root"] = (at["LHip"] + at["RHip"]) / 2
    if "Neck" not in at and {"LShoulder", "RShoulder"} <= at.keys():
        at["Neck"] = (at["LShoulder"] + at["RShoulder"]) / 2


def _median_distance(at: dict[str, Floats], pairs: list[tuple[str, str]]) -> float | None:
    """The median over frames, and the mean over pairs; None if none is seen."""
    medians = []
    for one, other in pairs:
        if one in at and other in at:
            far = np.linalg.norm(at[one] - at[other], axis=1)
            far = far[~np.isnan(far)]
            if len(far):
                medians.append(float(np.median(far)))
    return float(np.mean(medians)) if medians else None


def _measure_pelvis(at: dict[str, Floats], places: dict[str, Floats]) -> None:
    """Place of the middle of the hips: some put it above the line between them."""
    if not {"Hip", "Neck", "LHip", "RHip"} <= at.keys():
        return
    frame = _upright(at["LHip"] - at["RHip"], at["Neck"] - at["root"])
    seen = np.einsum("fji,fj->fi", frame, at["Hip"] - at["root"])
    seen = seen[~np.isnan(seen).any(axis=1)]
    if len(seen):
        places["Hip"] = np.median(seen, axis=0)


def _measure_clusters(at: dict[str, Floats], places: dict[str, Floats]) -> None:
    """Places of points that one joint holds together: of the head, of the feet."""
    clusters: list[tuple[str, tuple[str, ...]]] = [("Neck", _HEAD)]
    clusters += [(f"{s}Ankle", tuple(f"{s}{part}" for part in _FOOT)) for s in "LR"]
    for centre, members in clusters:
        own = [name for name in members if name in places and name in at]
        if centre not in at or not own:
            continue
        seen = np.stack([at[name] - at[centre] for name in own], axis=1)
        shape = np.stack([places[name] for name in own])
        far = np.linalg.norm(seen, axis=-1)
        known = ~np.isnan(far).all(axis=0)
        lengths = np.ones(len(own))
        lengths[known] = np.nanmedian(far[:, known], axis=0)
        shape[known] *= (lengths / np.linalg.norm(shape, axis=1))[known, None]
        whole = seen[~np.isnan(far).any(axis=1)]
        for _ in range(_ROUNDS if len(own) > 1 and len(whole) > 4 else 0):
            turns = align(shape, whole)
            shape = np.median(np.einsum("fji,fpj->fpi", turns, whole), axis=0)
        places.update(dict(zip(own, shape, strict=True)))


def align(shape: Floats, seen: Floats) -> Floats:
    """Turns (frames, 3, 3) of a shape (points, 3) onto what is seen of it (frames, points, 3)."""
    seen = np.nan_to_num(seen)
    u, _, vt = np.linalg.svd(np.einsum("fpi,pj->fij", seen, shape))
    sign = np.linalg.det(u @ vt)
    u[..., -1] *= sign[:, None]
    turns: Floats = u @ vt
    return turns


# ---- poses


def pose_points(chain: Chain, names: tuple[str, ...], points: Floats) -> ChainPose:
    """The pose through points of each frame: joint by joint, from the root outwards.

    `points` (frames, points, 3) are NaN where not known; then a joint does not turn.
    """
    at = {name: points[:, k] for k, name in enumerate(names)}
    _add_middles(at)
    n_frames = len(points)
    unknown = np.full((n_frames, 3), np.nan)
    index = {name: k for k, name in enumerate(chain.joints)}
    turns = np.tile(np.eye(3), (n_frames, len(chain.joints), 1, 1))
    up = at.get("Neck", unknown) - at["root"]
    turns[:, index["root"]] = _upright(at.get("LHip", unknown) - at.get("RHip", unknown), up)
    across = at.get("LShoulder", unknown) - at.get("RShoulder", unknown)
    turns[:, index["chest"]] = _upright(across, up)
    turns[:, index["belly"]] = turns[:, index["root"]]
    heads = [k for k, name in enumerate(chain.points) if name in _HEAD]
    turns[:, index["neck"]] = _cluster(chain, heads, at, "Neck", turns[:, index["chest"]])
    ends = {"clavicle": ("Neck", "Shoulder"), "shoulder": ("Shoulder", "Elbow"),
            "elbow": ("Elbow", "Wrist"), "hip": ("Hip", "Knee"),
            "knee": ("Knee", "Ankle")}  # fmt: skip
    for side in "LR":
        for joint, (near, far) in ends.items():
            own = index[f"{side.lower()}{joint}"]
            above = turns[:, chain.parents[own]]
            start = at.get(near if near == "Neck" else f"{side}{near}", unknown)
            goal = at.get(f"{side}{far}", unknown) - start
            turns[:, own] = _shortest(above @ _bone(chain, own), goal) @ above
        feet = [k for k, n in enumerate(chain.points) if n[0] == side and n[1:] in _FOOT]
        own = index[f"{side.lower()}ankle"]
        above = turns[:, chain.parents[own]]
        turns[:, own] = _cluster(chain, feet, at, f"{side}Ankle", above)
    return place(chain, turns, at["root"])


def _bone(chain: Chain, joint: int) -> Floats:
    """Direction of the bone that a joint turns."""
    below = np.flatnonzero(chain.parents == joint)
    far = [k for k in np.flatnonzero(chain.holders == joint) if chain.places[k].any()]
    bone: Floats = np.array([0.0, -1.0, 0.0])
    if len(below):
        bone = chain.offsets[below[0]]
    elif far:
        bone = chain.places[far[0]]
    return bone


def _upright(left: Floats, up: Floats) -> Floats:
    """Turns whose x is to the left and y up, as far as the first allows; where unknown, none."""
    x = unit_vectors(left)
    z = unit_vectors(np.cross(x, up))
    turns = np.stack([x, np.cross(z, x), z], axis=-1)
    lost = np.isnan(turns).any(axis=(1, 2))
    turns[lost] = np.eye(3)
    return turns


def _shortest(one: Floats, other: Floats) -> Floats:
    """The shortest turns of directions onto others; none where one is unknown."""
    a, b = unit_vectors(one), unit_vectors(other)
    axis = np.cross(a, b)
    sine, cosine = np.linalg.norm(axis, axis=1), (a * b).sum(axis=1)
    angle = np.arctan2(sine, cosine)
    vectors = axis * (angle / np.maximum(sine, 1e-9))[:, None]
    vectors[np.isnan(vectors).any(axis=1)] = 0.0
    return rotation_vectors_to_matrices(vectors)


def _cluster(
    chain: Chain, members: list[int], at: dict[str, Floats], centre: str, above: Floats
) -> Floats:
    """Turns of points held together; as the joint above where none of them is known."""
    if not members or centre not in at:
        return above
    seen = np.stack([at[chain.points[k]] - at[centre] for k in members], axis=1)
    shape = chain.places[members]
    rest = np.einsum("fij,pj->fpi", above, shape)
    if len(members) == 1:
        return _shortest(rest[:, 0], seen[:, 0]) @ above
    # What is not seen stays as the joint above has it.
    whole = np.where(np.isnan(seen), rest, seen)
    return align(shape, whole)


def to_skeleton(chain: Chain, pose: ChainPose) -> tuple[Skeleton, Floats, Floats]:
    """The chain as a joint tree with its ends: skeleton, local quaternions, places of joints."""
    ends = [k for k, where in enumerate(chain.places) if np.linalg.norm(where) > 1e-6]
    names = (*chain.joints, *(chain.points[k] for k in ends))
    parents = np.concatenate([chain.parents, chain.holders[ends]]).astype(np.intp)
    skeleton = Skeleton(names, parents, np.concatenate([chain.offsets, chain.places[ends]]))
    above = np.maximum(chain.parents, 0)
    local = np.swapaxes(pose.turns[:, above], -1, -2) @ pose.turns
    local[:, 0] = pose.turns[:, 0]
    still = np.tile(np.eye(3), (len(local), len(ends), 1, 1))
    whole = np.concatenate([local, still], axis=1)
    places = forward_kinematics(skeleton, whole, pose.centres[:, 0] - chain.offsets[0])
    return skeleton, matrices_to_quaternions(whole), places
