"""BVH files: writing a motion in its own rig, and cutting clips.

Joints keep their names, places and turns; angles are written in the order Z X Y, lengths in
centimetres unless given otherwise. A joint that moves against its parent has position
channels. In an Acclaim skeleton a joint is the end of its bone and turns it: there each
joint gets a second one, "start of" it, at the place of its parent, which does the turning.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.formats.content import rig_of
from motionary.io.formats.numbers import check_frames, end_alike, find_line
from motionary.io.normalise.units import metres_per_unit
from motionary.io.text import write_text
from motionary.motion import Motion, Skeleton
from motionary.rotations import (
    Floats,
    conjugate_quaternions,
    multiply_quaternions,
    quaternions_to_euler,
    rotate,
)

_ORDER = "ZXY"
_ROTATIONS = "Zrotation Xrotation Yrotation"
_POSITIONS = "Xposition Yposition Zposition"
# A joint that moves less against its parent keeps its offset.
_STILL_M = 1e-6
_TURNED = 1e-9
_NUMBER = "%.6f"

_CHANNELS = re.compile(r"^\s*CHANNELS\s+(\d+)", re.MULTILINE | re.IGNORECASE)
_COUNT = re.compile(r"(Frames\s*:\s*)\d+", re.IGNORECASE)


@dataclass(slots=True)
class _Node:
    """A joint to write; `turns` is None for an End Site, `places` where the offset stays."""

    name: str
    offset: Floats
    turns: Floats | None
    places: Floats | None
    children: list["_Node"]


def write_bvh(motion: Motion, path: str | Path, *, unit: float | str = "cm") -> None:
    """Write a motion that has a rig and no gaps; a path whose name ends in .gz is packed.

    Lengths are in `unit`, as in `read`.
    """
    metres = metres_per_unit(unit)
    skeleton, rotations = rig_of(motion, "BVH holds the turns of a rig")
    if np.isnan(motion.positions).any():
        raise InvalidInput("BVH holds no gaps; fill or cut them", file=motion.source or "motion")
    bad = [n for n in motion.names if not n or n != " ".join(n.split()) or set(n) & set("{}")]
    if bad:
        raise InvalidInput(f"names of BVH joints are without braces and blank ends, got {bad[0]!r}")
    build = _build_ends if skeleton.ends else _build_starts
    write_text(path, _format(motion, build(motion, skeleton, rotations), metres))


def _build_starts(motion: Motion, skeleton: Skeleton, rotations: Floats) -> list[_Node]:
    """Nodes of a tree whose joints turn what lies below them."""
    world: list[Floats] = []
    nodes: list[_Node] = []
    roots = []
    leaves = set(range(len(motion.names))) - set(skeleton.parents.tolist())
    for joint, (name, parent) in enumerate(zip(motion.names, skeleton.parents, strict=True)):
        place, turns = motion.positions[:, joint], rotations[:, joint]
        if parent < 0:
            world.append(turns)
            nodes.append(_Node(name, skeleton.offsets[joint], turns, place, []))
            roots.append(nodes[-1])
            continue
        away = rotate(conjugate_quaternions(world[parent]), place - motion.positions[:, parent])
        offset = away[0] if np.ptp(away, axis=0).max() < _STILL_M else skeleton.offsets[joint]
        still = np.abs(away - offset).max() < _STILL_M
        ends = joint in leaves and name == f"End of {motion.names[parent]}" and still
        ends = ends and np.abs(offset).max() > 0 and (1 - np.abs(turns[:, 0])).max() < _TURNED
        world.append(multiply_quaternions(world[parent], turns))
        node = _Node(name, offset, None if ends else turns, None if still else away, [])
        nodes[parent].children.append(node)
        nodes.append(node)
    return roots


def _build_ends(motion: Motion, skeleton: Skeleton, rotations: Floats) -> list[_Node]:
    """Nodes of a tree whose joints are the ends of the bones that they turn."""
    at_rest = np.zeros((motion.n_frames, 4))
    at_rest[:, 0] = 1.0
    nodes: list[_Node] = []
    roots = []
    for joint, (name, parent) in enumerate(zip(motion.names, skeleton.parents, strict=True)):
        turns, offset = rotations[:, joint], skeleton.offsets[joint]
        if parent < 0:
            nodes.append(_Node(name, offset, turns, motion.positions[:, joint], []))
            roots.append(nodes[-1])
            continue
        end = _Node(name, offset, at_rest, None, [])
        nodes[parent].children.append(_Node(f"start of {name}", np.zeros(3), turns, None, [end]))
        nodes.append(end)
    return roots


def _format(motion: Motion, roots: list[_Node], metres: float) -> Iterator[str]:
    yield "HIERARCHY\n"
    columns: list[Floats] = []
    for root in roots:
        yield from _format_node(root, 0, metres, columns)
    yield f"MOTION\nFrames: {motion.n_frames}\nFrame Time: {1 / motion.rate_hz!r}\n"
    line = " ".join([_NUMBER] * sum(column.shape[1] for column in columns)) + "\n"
    step = 1024
    for start in range(0, motion.n_frames, step):
        block = np.concatenate([column[start : start + step] for column in columns], axis=1)
        yield "".join(line % tuple(row) for row in block.tolist())


def _format_node(node: _Node, depth: int, metres: float, columns: list[Floats]) -> Iterator[str]:
    """Lines of a joint and those below; its channels are added to the columns."""
    indent = "\t" * depth
    title = "End Site" if node.turns is None else f"{'JOINT' if depth else 'ROOT'} {node.name}"
    yield f"{indent}{title}\n{indent}{{\n"
    yield f"{indent}\tOFFSET {' '.join(_NUMBER % (v / metres) for v in node.offset.tolist())}\n"
    if node.turns is not None:
        channels = _ROTATIONS if node.places is None else f"{_POSITIONS} {_ROTATIONS}"
        yield f"{indent}\tCHANNELS {len(channels.split())} {channels}\n"
        if node.places is not None:
            columns.append(node.places / metres)
        columns.append(np.degrees(quaternions_to_euler(node.turns, _ORDER)))
        if not node.children:
            # Programs expect that a branch ends so; without length it is no joint.
            yield f"{indent}\tEnd Site\n{indent}\t{{\n{indent}\t\tOFFSET 0 0 0\n{indent}\t}}\n"
    for child in node.children:
        yield from _format_node(child, depth + 1, metres, columns)
    yield f"{indent}}}\n"


def cut_bvh(lines: list[str], first: int, last: int) -> list[str]:
    """Lines of a clip; frames count from 0, both are included."""
    motion = find_line(lines, r"MOTION")
    count = find_line(lines, r"Frames\s*:\s*\d+", motion + 1)
    time = find_line(lines, r"Frame\s+Time\s*:\s*\S+", count + 1)
    if len(lines) in (motion, count, time):
        raise UnreadableFile("no MOTION with 'Frames:' and 'Frame Time:' found")
    frames = [line for line in lines[time + 1 :] if line.strip()]
    check_frames(first, last, first_number=0, n_frames=len(frames))
    chosen = frames[first : last + 1]
    n_channels = sum(map(int, _CHANNELS.findall("".join(lines[:motion]))))
    if any(len(line.split()) != n_channels for line in chosen):
        raise UnreadableFile(
            f"a frame does not stand on one line of {n_channels} numbers, so that it "
            "cannot be cut out"
        )
    header = lines[: time + 1]
    header[count] = _COUNT.sub(rf"\g<1>{len(chosen)}", header[count])
    return header + end_alike(chosen, lines[time])
