"""MVNX and glTF files of a rig, element by element after their published layouts.

MVNX: the user manual of Xsens MVN, section on the MVNX format; glTF 2.0: the specification
of Khronos. A rig is given by names, parents, offsets, and turns and places of each frame in the
world, as matrices.
"""

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
