"""MVNX and glTF files of a rig, element by element after their published layouts.

MVNX: the user manual of Xsens MVN, section on the MVNX format; glTF 2.0: the specification
of Khronos. A rig is given by names, parents, offsets, and turns and places of each frame in the
world, as matrices.
"""

import base64
import json
import struct

import numpy as np

#: Segments of Xsens MVN by joints of the synthetic figure, in the sequence of MVN.
XSENS = {
    "root": "Pelvis", "belly": "L5", "chest": "T8", "neck": "Neck", "head": "Head",
    "rclavicle": "RightShoulder", "rshoulder": "RightUpperArm", "relbow": "RightForeArm",
    "rwrist": "RightHand", "lclavicle": "LeftShoulder", "lshoulder": "LeftUpperArm",
    "lelbow": "LeftForeArm", "lwrist": "LeftHand", "rhip": "RightUpperLeg",
    "rknee": "RightLowerLeg", "rankle": "RightFoot", "rtoes": "RightToe",
    "lhip": "LeftUpperLeg", "lknee": "LeftLowerLeg", "lankle": "LeftFoot", "ltoes": "LeftToe",
}  # fmt: skip
_TIPS = {
    "headtop": ("Head", "pTopOfHead"),
    "rfingers": ("RightHand", "pRightTopOfHand"),
    "lfingers": ("LeftHand", "pLeftTopOfHand"),
}
#: From y up to z up: x stays.
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def matrices(quaternions):
    """Matrices of unit quaternions wxyz."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def quaternion(matrix):
    """Quaternion wxyz of a matrix, by its largest component."""
    m = matrix
    squares = np.array(
        [1 + m[0, 0] + m[1, 1] + m[2, 2], 1 + m[0, 0] - m[1, 1] - m[2, 2],
         1 - m[0, 0] + m[1, 1] - m[2, 2], 1 - m[0, 0] - m[1, 1] + m[2, 2]]
    )  # fmt: skip
    wx, wy, wz = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    xy, xz, yz = m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1]
    table = np.array(
        [[squares[0], wx, wy, wz], [wx, squares[1], xy, xz],
         [wy, xy, squares[2], yz], [wz, xz, yz, squares[3]]]
    )  # fmt: skip
    row = table[int(squares.argmax())]
    return row / np.linalg.norm(row)


def world_turns(parents, local):
    """Matrices from joint to world, (frames, joints, 3, 3), of quaternions local to parents."""
    turns = matrices(local)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            turns[:, joint] = turns[:, parent] @ turns[:, joint]
    return turns


def mvnx_text(
    motion, *, first=0, sensors=("Pelvis", "RightHand"), acceleration="sensorFreeAcceleration"
):
    """An MVNX file of a synthetic figure, and what its sensors say."""
    names, parents = list(motion.names), motion.skeleton.parents.tolist()
    turns = world_turns(parents, motion.rotations)
    order = [names.index(joint) for joint in XSENS]
    places = motion.positions @ Z_UP.T
    world = Z_UP @ turns
    points = {segment: [("jOrigin", np.zeros(3))] for segment in XSENS.values()}
    joints = []
    for joint, segment in XSENS.items():
        parent = parents[names.index(joint)]
        if parent < 0:
            continue
        above = XSENS[names[parent]]
        points[above].append((f"j{segment}", motion.skeleton.offsets[names.index(joint)]))
        joints.append((f"j{segment}", f"{above}/j{segment}", f"{segment}/jOrigin"))
    for joint, (segment, point) in _TIPS.items():
        points[segment].append((point, motion.skeleton.offsets[names.index(joint)]))
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">',
        '<mvn version="2019.0" build="x"/>',
        f'<subject label="P1" frameRate="{motion.rate_hz:g}" segmentCount="{len(order)}">',
        "<segments>",
    ]
    for i, segment in enumerate(XSENS.values(), start=1):
        lines.append(f'<segment label="{segment}" id="{i}"><points>')
        for point, place in points[segment]:
            lines.append(f'<point label="{point}"><pos_b>{_row(place)}</pos_b></point>')
        lines.append("</points></segment>")
    lines.append("</segments><sensors>")
    lines += [f'<sensor label="{sensor}"/>' for sensor in sensors]
    lines.append("</sensors><joints>")
    for label, one, two in joints:
        lines.append(
            f'<joint label="{label}"><connector1>{one}</connector1>'
            f"<connector2>{two}</connector2></joint>"
        )
    lines.append(f'</joints><frames segmentCount="{len(order)}">')
    values = np.random.default_rng(5).normal(size=(motion.n_frames, len(sensors), 3)).round(4)
    for i in range(-1, motion.n_frames):
        at = max(i, 0)
        head = (
            'time="0" index="" type="tpose"'
            if i < 0
            else f'time="{round(i / motion.rate_hz * 1000)}" index="{first + i}" type="normal"'
        )
        quats = np.array([quaternion(world[at, j]) for j in order])
        lines.append(f"<frame {head}><orientation>{_row(quats)}</orientation>")
        lines.append(f"<position>{_row(places[at, order])}</position>")
        own = [quats[list(XSENS.values()).index(sensor)] for sensor in sensors]
        lines.append(f"<sensorOrientation>{_row(own)}</sensorOrientation>")
        lines.append(f"<{acceleration}>{_row(values[at])}</{acceleration}></frame>")
    lines.append("</frames></subject></mvnx>")
    return "\n".join(lines), values


def _row(numbers):
    return " ".join(f"{x:.9f}" for x in np.ravel(numbers))


#: Bones of VRM by joints of the synthetic figure.
VRM = {
    "root": "hips", "belly": "spine", "chest": "chest", "neck": "neck", "head": "head",
    **{f"{s}{joint}": f"{side}{bone}" for s, side in (("l", "left"), ("r", "right"))
       for joint, bone in (
           ("hip", "UpperLeg"), ("knee", "LowerLeg"), ("ankle", "Foot"), ("toes", "Toes"),
           ("clavicle", "Shoulder"), ("shoulder", "UpperArm"), ("elbow", "LowerArm"),
           ("wrist", "Hand"), ("fingers", "MiddleDistal"))},
}  # fmt: skip

_COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class Gltf:
    """A glTF document that grows: arrays go into one buffer, an accessor each."""

    def __init__(self, nodes):
        self.root = {"asset": {"version": "2.0"}, "nodes": nodes, "accessors": [],
                     "bufferViews": [], "buffers": []}  # fmt: skip
        self.binary = b""

    def view(self, array, *, stride=0):
        """Number of a view of an array (elements, numbers), each element padded to a stride."""
        rows = [row.tobytes().ljust(stride, b"\0") for row in array]
        self.binary += b"\0" * (-len(self.binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(b"".join(rows))}
        self.binary += b"".join(rows)
        self.root["bufferViews"].append(view | ({"byteStride": stride} if stride else {}))
        return len(self.root["bufferViews"]) - 1

    def accessor(self, values, kind="f4", *, stride=0, normalized=False, sparse=None):
        """Number of an accessor; `sparse` lists the elements that are not zero."""
        array = np.asarray(values, dtype=f"<{kind}")
        array = array.reshape(len(array), -1)
        accessor = {"componentType": _COMPONENTS[kind], "count": len(array),
                    "type": _SHAPES[array.shape[1]]}  # fmt: skip
        if sparse is None:
            accessor["bufferView"] = self.view(array, stride=stride)
        else:
            at = np.asarray(sparse, dtype="<u2")
            accessor["sparse"] = {
                "count": len(at),
                "indices": {"bufferView": self.view(at.reshape(-1, 1)), "componentType": 5123},
                "values": {"bufferView": self.view(array[at])},
            }
        if normalized:
            accessor["normalized"] = True
        self.root["accessors"].append(accessor)
        return len(self.root["accessors"]) - 1

    def animate(self, name, channels, **options):
        """Add an animation of channels (node, path, times, values, interpolation)."""
        inputs, animation = {}, {"name": name, "channels": [], "samplers": []}
        for node, path, times, values, interpolation in channels:
            key = np.asarray(times, dtype="<f4").tobytes()
            if key not in inputs:
                inputs[key] = self.accessor(times)
            animation["samplers"].append(
                {"input": inputs[key], "output": self.accessor(values, **options),
                 "interpolation": interpolation}
            )  # fmt: skip
            animation["channels"].append(
                {"sampler": len(animation["samplers"]) - 1, "target": {"node": node, "path": path}}
            )
        self.root.setdefault("animations", []).append(animation)

    def pack(self, how="glb", stem="a"):
        """Contents of files by their names: "glb", "data" (a URI) or "beside" (a .bin)."""
        buffer = {"byteLength": len(self.binary)}
        if how == "data":
            content = base64.b64encode(self.binary).decode()
            buffer["uri"] = f"data:application/octet-stream;base64,{content}"
        elif how == "beside":
            buffer["uri"] = f"{stem}%20x.bin"
        text = json.dumps(self.root | {"buffers": [buffer]}).encode()
        if how != "glb":
            files = {f"{stem}.gltf": text}
            return files | ({f"{stem} x.bin": self.binary} if how == "beside" else {})
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
        return {f"{stem}.glb": b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks}


def gltf_of(motion, *, names=None, humanoid="", matrix=False, unit_m=1.0, start_s=0.0):
    """A figure's glTF: a root that scales, a skinned mesh, joints of other names, an animation.

    `humanoid` is "vrm0", "vrm1" or "vrma"; with `matrix` joints rest in matrices.
    """
    joints, parents = list(motion.names), motion.skeleton.parents.tolist()
    names = names or {}
    nodes = [{"name": "Armature", "scale": [unit_m] * 3, "children": []},
             {"name": "Body", "mesh": 0, "skin": 0}]  # fmt: skip
    for i, joint in enumerate(joints):
        place = motion.skeleton.offsets[i] / unit_m
        node = {"name": names.get(joint, joint)}
        if matrix and parents[i] >= 0:
            columns = np.eye(4)
            columns[3, :3] = place
            node["matrix"] = columns.ravel().tolist()
        else:
            node["translation"] = place.tolist()
        nodes.append(node)
        nodes[0 if parents[i] < 0 else 2 + parents[i]].setdefault("children", []).append(2 + i)
    gltf = Gltf(nodes)
    gltf.root["meshes"] = [{"primitives": []}]
    gltf.root["skins"] = [{"joints": [2 + i for i in range(len(joints))]}]
    times = start_s + np.arange(motion.n_frames) / motion.rate_hz
    gltf.animate("take", [
        *([(2, "translation", times, motion.positions[:, 0] / unit_m, "LINEAR")]),
        *((2 + i, "rotation", times, np.roll(motion.rotations[:, i], -1, axis=1), "LINEAR")
          for i in range(len(joints)) if not (matrix and parents[i] >= 0)),
    ])  # fmt: skip
    bones = {VRM[joint]: {"node": 2 + i} for i, joint in enumerate(joints) if joint in VRM}
    extension = {
        "vrm0": {"VRM": {"humanoid": {"humanBones": [
            {"bone": bone, "useDefaultValues": True, **node} for bone, node in bones.items()]}}},
        "vrm1": {"VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}},
        "vrma": {"VRMC_vrm_animation": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}},
    }  # fmt: skip
    if humanoid:
        gltf.root["extensions"] = extension[humanoid]
    return gltf
