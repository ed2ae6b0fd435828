"""Small random motions, as what they are and as the text of a file."""

import itertools

import numpy as np

ORDERS = ["".join(order) for order in itertools.permutations("XYZ")]


def random_acclaim(rng, n_bones=6):
    """Bones and children as `kinematics.acclaim_frame` takes them."""
    bones = {
        "root": {
            "order": ORDERS[rng.integers(6)],
            "axis": rng.uniform(-180, 180, 3).round(3).tolist(),
            "dof": rng.permutation(["tx", "ty", "tz", "rx", "ry", "rz"]).tolist(),
        }
    }
    children = {}
    for i in range(n_bones):
        parent = list(bones)[rng.integers(len(bones))]
        name = f"bone{i}"
        children.setdefault(parent, []).append(name)
        bones[name] = {
            "direction": rng.normal(size=3).round(6).tolist(),
            "length": round(rng.uniform(0.5, 9), 5),
            "order": ORDERS[rng.integers(6)],
            "axis": rng.uniform(-180, 180, 3).round(3).tolist(),
            "dof": rng.permutation(["rx", "ry", "rz"])[: rng.integers(4)].tolist(),
        }
    return bones, children


def random_values(rng, bones, n_frames):
    """Per frame and bone the value of each degree of freedom."""
    return [
        {
            name: {dof: round(rng.uniform(-180, 180), 4) for dof in bone["dof"]}
            for name, bone in bones.items()
        }
        for _ in range(n_frames)
    ]


def asf_text(bones, children, *, length=0.45, radians=False):
    unit = np.pi / 180 if radians else 1.0
    root = bones["root"]
    lines = ["# a comment", ":version 1.10", ":units", "  mass 1.0", f"  length {length}"]
    lines += ["  angle rad" if radians else "  angle deg", ":documentation", "  free text", ":root"]
    lines += [
        f"   order {' '.join(dof.upper() for dof in root['dof'])}",
        f"   axis {root['order']}",
    ]
    lines += ["   position 0 0 0", f"   orientation {_numbers(root['axis'], unit)}", ":bonedata"]
    for i, (name, bone) in enumerate(bones.items()):
        if name == "root":
            continue
        lines += ["  begin", f"     id {i}", f"     name {name}"]
        lines += [f"     direction {_numbers(bone['direction'])}", f"     length {bone['length']}"]
        lines += [f"     axis {_numbers(bone['axis'], unit)}  {bone['order']}"]
        if bone["dof"]:
            lines += [f"    dof {' '.join(bone['dof'])}", "    limits (-160.0 20.0)"]
            lines += ["           (-70.0 70.0)"] * (len(bone["dof"]) - 1)
        lines += ["  end"]
    lines += [":hierarchy", "  begin"]
    lines += [f"    {parent} {' '.join(below)}" for parent, below in children.items()]
    return "\n".join([*lines, "  end", ""])


def amc_text(bones, values, *, first=1, radians=False, keyword=True):
    unit = np.pi / 180 if radians else 1.0
    lines = ["#!OML:ASF X:\\für Bonn\\a.ASF", ":FULLY-SPECIFIED"]
    lines += [":RADIANS" if radians else ":DEGREES"] if keyword else []
    for number, frame in enumerate(values, start=first):
        lines.append(str(number))
        for name, bone in bones.items():
            if bone["dof"]:
                turned = [
                    value * (unit if dof[0] == "r" else 1.0) for dof, value in frame[name].items()
                ]
                lines.append(f"{name} {_numbers(turned)}")
    return "\n".join([*lines, ""])


def random_bvh(rng, n_joints=6):
    """Nodes as `kinematics.bvh_frame` takes them, in the file's depth-first sequence."""
    below = {}
    for i in range(1, n_joints):
        below.setdefault(int(rng.integers(-1, i)), []).append(i)
    roots = [0, *below.pop(-1, [])]
    nodes, places = [], {}

    def visit(joint, parent):
        kinds = rng.permutation(["X", "Y", "Z"]).tolist()
        moves = rng.permutation(["X", "Y", "Z"])[: rng.integers(4)].tolist()
        channels = [f"{axis}rotation" for axis in kinds[: rng.integers(1, 4)]]
        channels += [f"{axis}position" for axis in moves]
        channels = rng.permutation(channels).tolist()
        places[joint] = len(nodes)
        nodes.append((f"joint {joint}", parent, rng.normal(size=3).round(5).tolist(), channels))
        for child in below.get(joint, []):
            visit(child, places[joint])
        if joint not in below:
            end = (f"End of joint {joint}", places[joint], rng.normal(size=3).round(5).tolist(), [])
            nodes.append(end)

    for root in roots:
        visit(root, -1)
    return nodes


def bvh_text(nodes, rows, *, frame_time="0.0083333", n_frames=None):
    lines = ["HIERARCHY"]

    def write(place, depth):
        name, parent, offset, channels = nodes[place]
        indent = "\t" * depth
        if name.startswith("End of"):
            lines.append(f"{indent}End Site")
        else:
            lines.append(f"{indent}{'ROOT' if parent < 0 else 'JOINT'} {name}")
        lines.append(f"{indent}{{")
        lines.append(f"{indent}\tOFFSET {_numbers(offset)}")
        if channels:
            lines.append(f"{indent}\tCHANNELS {len(channels)} {' '.join(channels)}")
        for child, node in enumerate(nodes):
            if node[1] == place:
                write(child, depth + 1)
        lines.append(f"{indent}}}")

    for place, node in enumerate(nodes):
        if node[1] < 0:
            write(place, 0)
    count = len(rows) if n_frames is None else n_frames
    lines += ["MOTION", f"Frames: {count}", f"Frame Time: {frame_time}"]
    lines += [_numbers(row) for row in rows]
    return "\n".join([*lines, ""])


def _numbers(values, unit=1.0):
    return " ".join(repr(float(value) * unit) for value in values)
