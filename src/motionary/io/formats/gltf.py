"""glTF 2.0 files, text and binary, with VRM and VRMA: joints, and the animation that moves them.

Joints are the nodes that a skin or a humanoid names, with what hangs on them and what they hang
on; without either, animated nodes and those that show nothing. Poses are sampled at an even
rate: glTF has times of keys and no rate. The humanoid of VRM 0.x, VRM 1.0 and VRMA says which
node is which bone, and is the mapping.

Conventions: metres, y up, as the specification has them; quaternions in files are xyzw.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import NotAMotion
from motionary.io.formats.content import (
    FileContent,
    choose_take,
    names_file,
    note_take,
    number_doubles,
    rest_offsets,
)
from motionary.io.formats.gltf_document import (
    Channel,
    Document,
    Object,
    find_rate,
    find_targets,
    read_channels,
    sample_channel,
)
from motionary.io.normalise.units import FileMetadata
from motionary.io.options import ReadOptions
from motionary.motion import JointMapping, Skeleton
from motionary.rotations import Floats, matrices_to_quaternions, quaternions_to_matrices
from motionary.skeletons import named_table

# No body has more; what a file says of so many costs time.
_MOST_JOINTS = 3000
# The last key may be a rounding error before its frame, in steps.
_EVEN = 0.02
_STILL = 1e-6
_FARTHEST_M = 1e6


class _Joints(NamedTuple):
    """Nodes that are joints, parents before children."""

    nodes: list[int]
    names: list[str]
    parents: NDArray[np.intp]
    numbers: dict[int, int]


@names_file
def read_gltf(path: Path, options: ReadOptions) -> FileContent:
    """Joints of a glTF file, in metres with y up by definition."""
    document = Document(path)
    humanoid = _read_humanoid(document)
    animations = document.items("animations")
    joints = _find_joints(document, humanoid, animations)
    takes = [_text(a.get("name")) or f"animation {i}" for i, a in enumerate(animations, start=1)]
    takes = number_doubles(takes)
    number, channels = _choose_animation(document, joints, animations, takes, options)
    is_given = options.unit is not None or options.up is not None
    notes = [] if is_given else ["axes and unit as glTF has them"]
    if not takes:
        notes.append("holds no animation: one frame, the pose that the joints have")
    notes += note_take(takes, number, is_given=options.take is not None, called="animation")
    rate_hz, rate_note = find_rate(channels, options.rate_hz)
    at_s = _frame_times(document, channels, rate_hz, len(joints.nodes))
    positions, turns, is_mirrored = _pose(document, joints, channels, at_s, rate_hz)
    if is_mirrored:
        notes.append("joints are mirrored by their scale: turns are left out")
    skeleton = Skeleton(
        tuple(joints.names),
        joints.parents,
        rest_offsets(positions[0], turns[0], joints.parents),
    )
    return FileContent(
        names=joints.names,
        positions=positions,
        rate_hz=rate_hz,
        metadata=FileMetadata("m", "y", noted=()),
        skeleton=skeleton,
        rotations=None if is_mirrored else turns,
        mapping=_map_humanoid(humanoid, joints),
        notes=(*notes, *rate_note),
    )


def _text(value: object) -> str:
    """A name in one line, as far as people read it."""
    return " ".join(value.split())[:200] if isinstance(value, str) else ""


# ---- which nodes are joints


def _find_joints(
    document: Document, humanoid: dict[str, int], animations: Sequence[Object]
) -> _Joints:
    nodes = document.items("nodes")
    parents = _find_parents(document, nodes)
    order = _parents_first(document, parents)
    skins = document.items("skins")
    wanted = set(humanoid.values())
    for skin in skins:
        listed = skin.get("joints")
        for node in listed if isinstance(listed, list) else []:
            wanted.add(document.index(node, len(nodes), "nodes"))
    shown = [
        bool({"mesh", "camera"} & node.keys())
        or "KHR_lights_punctual" in document.part(node, "extensions")
        for node in nodes
    ]
    if not wanted:
        targets = (find_targets(document, one, len(nodes)) for one in animations)
        wanted = {node for found in targets for node, _, _ in found}
        wanted |= {i for i, is_shown in enumerate(shown) if wanted and not is_shown}
    if not wanted:
        raise NotAMotion("holds no motion; expected a skin or an animation")
    for node in order:
        if parents[node] in wanted and not shown[node]:
            wanted.add(node)
    for node in reversed(order):
        if node in wanted and parents[node] >= 0:
            wanted.add(parents[node])
    if len(wanted) > _MOST_JOINTS:
        document.fail(f"has {len(wanted)} joints, more than any body")
    kept = [node for node in order if node in wanted]
    numbers = {node: joint for joint, node in enumerate(kept)}
    return _Joints(
        kept,
        number_doubles([_text(nodes[i].get("name")) or f"node {i}" for i in kept]),
        np.array([numbers.get(parents[node], -1) for node in kept], dtype=np.intp),
        numbers,
    )


def _find_parents(document: Document, nodes: Sequence[Object]) -> list[int]:
    parents = [-1] * len(nodes)
    for number, node in enumerate(nodes):
        children = node.get("children", [])
        for child in children if isinstance(children, list) else []:
            child = document.index(child, len(nodes), "nodes")
            if parents[child] >= 0:
                document.fail(f"node {child} has two parents")
            parents[child] = number
    return parents


def _parents_first(document: Document, parents: list[int]) -> list[int]:
    """Nodes by depth, those of one depth as in the file."""
    children: dict[int, list[int]] = {}
    for node, parent in enumerate(parents):
        children.setdefault(parent, []).append(node)
    order = list(children.get(-1, ()))
    # The list grows while it is walked.
    for node in order:
        order.extend(children.get(node, ()))
    if len(order) < len(parents):
        document.fail("a node is its own ancestor")
    return order


# ---- animations


def _choose_animation(
    document: Document,
    joints: _Joints,
    animations: Sequence[Object],
    takes: list[str],
    options: ReadOptions,
) -> tuple[int, list[Channel]]:
    """Number and channels of the animation that is given, or of the first in which joints move."""
    if options.take is not None:
        number = choose_take(takes, options.take, document.name)
        return number, read_channels(document, animations[number], joints.numbers)
    for number, animation in enumerate(animations):
        channels = read_channels(document, animation, joints.numbers)
        if any((np.ptp(channel.values, axis=0) > _STILL).any() for channel in channels):
            return number, channels
    return 0, read_channels(document, animations[0], joints.numbers) if animations else []


def _frame_times(
    document: Document, channels: Sequence[Channel], rate_hz: float, n_joints: int
) -> Floats:
    """Times of the frames, from the first key to the last."""
    if not channels:
        return np.zeros(1)
    start = min(float(channel.times[0]) for channel in channels)
    end = max(float(channel.times[-1]) for channel in channels)
    n_frames = 1 + int((end - start) * rate_hz + _EVEN)
    if not document.allows(24 * n_frames * n_joints):
        document.fail(f"says that it has {n_frames} frames of {n_joints} joints in so few bytes")
    times: Floats = start + np.arange(n_frames) / rate_hz
    return times


# ---- poses


def _pose(
    document: Document, joints: _Joints, channels: Sequence[Channel], at_s: Floats, rate_hz: float
) -> tuple[Floats, Floats, bool]:
    """Joints of all frames in the world, their turns in their parents, wxyz, and whether mirrored.

    What does not move is computed once.
    """
    nodes = document.items("nodes")
    positions = np.empty((len(at_s), len(joints.nodes), 3))
    turns = np.empty((len(at_s), len(joints.nodes), 4))
    # In the world, (frames, 3, 3) or of one frame: turns and scales of all joints above.
    linear: list[Floats] = []
    is_mirrored = False
    of_joint: dict[int, list[Channel]] = {}
    for channel in channels:
        of_joint.setdefault(channel.joint, []).append(channel)
    for joint, node in enumerate(joints.nodes):
        moved = {c.path: sample_channel(c, at_s, rate_hz) for c in of_joint.get(joint, ())}
        place, turn, local = _local(document, nodes[node], moved)
        turns[:, joint] = turn
        is_mirrored = is_mirrored or bool((np.linalg.det(local) < 0).any())
        parent = int(joints.parents[joint])
        if parent < 0:
            positions[:, joint] = place
        else:
            away = (linear[parent] @ place[..., None])[..., 0]
            positions[:, joint] = positions[:, parent] + away
            local = linear[parent] @ local
        linear.append(local)
    if not (np.abs(positions) < _FARTHEST_M).all():
        document.fail("has impossibly large numbers")
    if not np.isfinite(turns).all():
        document.fail("its joints have impossible turns")
    return positions, turns, is_mirrored


def _local(
    document: Document, node: Object, moved: dict[str, Floats]
) -> tuple[Floats, Floats, Floats]:
    """Place (frames, 3), turn (frames, 4), turn and scale (frames, 3, 3) in the parent.

    What does not move has one frame.
    """
    if "matrix" in node and not moved:
        columns = document.vector(node, "matrix", tuple(np.eye(4).ravel().tolist()))
        matrix = columns.reshape(4, 4).T
        return matrix[None, :3, 3], _turn_of(matrix[:3, :3])[None], matrix[None, :3, :3]
    place, scale = (
        moved.get(key, document.vector(node, key, default)[None])
        for key, default in (("translation", (0.0, 0.0, 0.0)), ("scale", (1.0, 1.0, 1.0)))
    )
    turn = moved.get("rotation", document.vector(node, "rotation", (0.0, 0.0, 0.0, 1.0))[None])
    turn = np.roll(turn, 1, axis=-1)
    with np.errstate(all="ignore"):
        turn = turn / np.linalg.norm(turn, axis=-1, keepdims=True)
    return place, turn, quaternions_to_matrices(turn) * scale[..., None, :]


def _turn_of(linear: Floats) -> Floats:
    """The turn that is nearest to a matrix, as a quaternion."""
    left, _, right = np.linalg.svd(linear)
    if np.linalg.det(left @ right) < 0:
        left[:, -1] *= -1
    return matrices_to_quaternions(left @ right)


# ---- the humanoid of VRM


def _read_humanoid(document: Document) -> dict[str, int]:
    """Nodes by the bones that VRM calls them; empty where the file has no humanoid."""
    extensions = document.part(document.root, "extensions")
    old = document.part(extensions, "VRM", "humanoid")
    bones = {str(b.get("bone")): b.get("node") for b in document.items("humanBones", old)}
    for key in ("VRMC_vrm", "VRMC_vrm_animation"):
        new = document.part(extensions, key, "humanoid", "humanBones")
        bones |= {name: document.part(new, name).get("node") for name in new}
    n_nodes = len(document.items("nodes"))
    # Version 0 writes -1 for a bone that the figure does not have.
    given = {bone: node for bone, node in bones.items() if node not in (None, -1)}
    return {bone: document.index(node, n_nodes, "nodes") for bone, node in given.items()}


def _map_humanoid(humanoid: dict[str, int], joints: _Joints) -> JointMapping | None:
    if not humanoid:
        return None
    named = {bone: joints.names[joints.numbers[node]] for bone, node in humanoid.items()}
    mapping = named_table("vrm").resolve(tuple(named))
    weights = {
        joint: {named[bone]: weight for bone, weight in source.items()}
        for joint, source in mapping.weights.items()
        if named.keys() >= source.keys()
    }
    return replace(mapping, weights=weights)
