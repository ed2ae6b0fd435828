"""Positions of joints, frame by frame and joint by joint, as the formats define them."""

import math

import numpy as np


def turn(axis, degrees):
    """Matrix of a right-handed turn about a coordinate axis."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return {
        "X": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "Y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "Z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


def about_fixed_axes(order, degrees):
    """Turn about the first named axis, then about the second one of the room, ..."""
    result = np.eye(3)
    for axis, angle in zip(order, degrees, strict=True):
        result = turn(axis, angle) @ result
    return result


def about_moving_axes(order, degrees):
    """Turn about the first named axis, then about the second as it has moved, ..."""
    result = np.eye(3)
    for axis, angle in zip(order, degrees, strict=True):
        result = result @ turn(axis, angle)
    return result


def place_joints(parents, offsets, rotations, root, ends):
    """Positions of one frame; `ends`: an offset turns with its own joint."""
    worlds, positions = [], []
    for joint, parent in enumerate(parents):
        if parent < 0:
            worlds.append(rotations[joint])
            positions.append(root + offsets[joint])
            continue
        world = worlds[parent] @ rotations[joint]
        turned = (world if ends else worlds[parent]) @ offsets[joint]
        worlds.append(world)
        positions.append(positions[parent] + turned)
    return np.array(positions)


def acclaim_frame(bones, children, values, metres):
    """End of every bone in one frame.

    `bones`: name -> direction, length, axis (degrees), order, dof; the root is "root"
    with axis = orientation; `values`: name -> {dof: number}.
    """
    root = bones["root"]
    orientation = _axis(root)
    turned = _turned(root, values["root"])
    ends = {"root": np.array([values["root"][f"t{c}"] for c in "xyz"]) * metres}
    worlds = {"root": orientation @ turned}
    waiting = [("root", child) for child in children.get("root", [])]
    while waiting:
        parent, name = waiting.pop()
        bone = bones[name]
        c = _axis(bone)
        r = _turned(bone, values.get(name, {}))
        worlds[name] = worlds[parent] @ c @ r @ np.linalg.inv(c)
        along = np.array(bone["direction"]) * bone["length"] * metres
        ends[name] = ends[parent] + worlds[name] @ along
        waiting += [(name, child) for child in children.get(name, [])]
    return ends


def _axis(bone):
    """The three numbers of `axis` are x, y and z, whatever the order of turning."""
    return about_fixed_axes(bone["order"], [bone["axis"]["XYZ".index(a)] for a in bone["order"]])


def _turned(bone, values):
    angles = [values.get(f"r{axis.lower()}", 0.0) for axis in bone["order"]]
    return about_fixed_axes(bone["order"], angles)


def bvh_frame(nodes, row):
    """Positions of one frame; `nodes`: (name, parent, offset, channel names)."""
    row = list(row)
    worlds, positions = [], []
    for _, parent, offset, channels in nodes:
        offset, local = np.array(offset, dtype=float), np.eye(3)
        for channel in channels:
            value = row.pop(0)
            if channel.endswith("position"):
                offset["XYZ".index(channel[0])] = value
            else:
                local = local @ turn(channel[0], value)
        world = np.eye(3) if parent < 0 else worlds[parent]
        start = np.zeros(3) if parent < 0 else positions[parent]
        worlds.append(world @ local)
        positions.append(start + world @ offset)
    return np.array(positions)
