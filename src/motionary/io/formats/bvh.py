"""BVH files: reading them; see `bvh_writing` for writing and cutting.

Conventions: a joint turns about its moving axes in the sequence of its channels.
Position channels replace the joint's offset, on whichever joint they stand; those below a root that
are zero throughout do not, as some programs count them from the offset, and say so. An End Site
becomes a joint named "End of" its parent; one without length is a missing joint. Frames
count from 0; a rest pose at the beginning stays.
"""

import math
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from motionary.errors import UnreadableFile
from motionary.io.formats.content import (
    RATE_HINT,
    FileContent,
    name_some,
    names_file,
    number_doubles,
    place_joints,
)
from motionary.io.formats.numbers import check_length, parse_number, read_table
from motionary.io.formats.times import rate_of_frame_time, usual_rate
from motionary.io.normalise.units import FileMetadata
from motionary.io.options import ReadOptions
from motionary.io.text import read_text
from motionary.motion import Skeleton
from motionary.rotations import Floats, euler_to_quaternions

_CHANNELS = {f"{axis}{kind}": axis.upper() for axis in "xyz" for kind in ("position", "rotation")}
# Below this fraction of an offset a translation is none.
_NOTHING = 1e-3
_MOTION = re.compile(r"^[ \t]*MOTION[ \t]*$", re.MULTILINE | re.IGNORECASE)
_FRAMES = re.compile(r"\s*Frames\s*:\s*(\S+)[ \t]*$", re.MULTILINE | re.IGNORECASE)
_FRAME_TIME = re.compile(r"\s*Frame\s+Time\s*:\s*(\S+)[ \t]*$", re.MULTILINE | re.IGNORECASE)


@dataclass(slots=True)
class _Node:
    """A joint as written; `channels` as (kind, axis letter), kind "p" or "r"."""

    name: str
    parent: int
    is_end: bool = False
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    channels: tuple[tuple[str, str], ...] = ()


@names_file
def read_bvh(path: Path, options: ReadOptions) -> FileContent:
    """Content of a BVH file."""
    text = read_text(path)
    start = _MOTION.search(text)
    if start is None:
        problem = "expected a BVH file"
        if text.lstrip().startswith("HIERARCHY"):
            problem = "the file ends amid its joints; get the whole file"
        elif not text.strip():
            problem = "the file is empty; get the whole file"
        raise UnreadableFile(f"no line MOTION found; {problem}")
    nodes, notes = _HierarchyReader().read(text[: start.start()])
    n_frames, frame_time, begins = _read_header(text, start.end())
    n_channels = sum(len(node.channels) for node in nodes)
    if not n_channels:
        raise UnreadableFile("no joint has channels, so nothing moves")
    line = text.count("\n", 0, begins) + 1
    text = text[begins:]
    # Hours of text, all of which a match holds, are let go as soon as they are numbers, and
    # numbers when they are turns.
    del start
    values = read_table(text, n_channels, line=line)
    del text
    if not len(values):
        raise UnreadableFile(f"expected {n_channels} numbers per frame, got 0 in all")
    notes += _compare_length(n_frames, len(values))
    rate, guessed = (options.rate_hz, []) if options.rate_hz else _rate(frame_time)
    rotations, moves, collapsed = _split_channels(nodes, values)
    del values
    names = tuple(node.name for node in nodes)
    parents = np.array([node.parent for node in nodes], dtype=np.intp)
    skeleton = Skeleton(names, parents, np.array([node.offset for node in nodes]))
    origin = np.zeros((len(rotations), 3))
    return FileContent(
        names=names,
        positions=place_joints(skeleton, rotations, origin, translations=moves),
        rate_hz=rate,
        metadata=FileMetadata(),
        skeleton=skeleton,
        rotations=rotations,
        notes=(*notes, *guessed, *collapsed),
    )


class _HierarchyReader:
    """Walks the lines above MOTION and remembers where it is, for the errors."""

    def __init__(self) -> None:
        self.line = 0
        self.nodes: list[_Node] = []
        self.open: list[int] = []

    def fail(self, problem: str) -> NoReturn:
        raise UnreadableFile(problem, place=f"line {self.line}")

    def read(self, text: str) -> tuple[list[_Node], list[str]]:
        """Joints, parents first and End Sites without length left out, and notes."""
        for self.line, line in enumerate(text.split("\n"), start=1):
            for part in re.split(r"([{}])", line):
                words = part.split()
                if words:
                    self.read_statement(words)
        if not self.nodes:
            self.fail("no joints before MOTION; expected HIERARCHY and ROOT")
        if self.open:
            self.fail(f"{self.nodes[self.open[-1]].name!r} is not closed with }} before MOTION")
        return self.without_missing()

    def read_statement(self, words: list[str]) -> None:
        keyword = words[0].upper()
        if keyword in ("ROOT", "JOINT"):
            self.start(" ".join(words[1:]), is_root=keyword == "ROOT")
        elif keyword == "END":
            self.add(_Node(f"End of {self.current().name}", self.open[-1], is_end=True))
        elif keyword == "OFFSET":
            self.current().offset = self.numbers(words[1:])
        elif keyword == "CHANNELS":
            self.current().channels = self.channels(words[1:])
            if self.current().is_end and self.current().channels:
                self.fail("an End Site has no channels")
        elif keyword == "}":
            self.current()
            self.open.pop()
        elif keyword not in ("{", "HIERARCHY"):
            self.fail(f"expected ROOT, JOINT, OFFSET or CHANNELS, got {' '.join(words)[:40]!r}")

    def start(self, name: str, *, is_root: bool) -> None:
        if is_root == bool(self.open):
            self.fail("a ROOT stands outside of joints, JOINT and End Site inside of one")
        if not name:
            self.fail("a joint needs a name")
        self.add(_Node(name, self.open[-1] if self.open else -1))

    def add(self, node: _Node) -> None:
        if node.parent >= 0 and self.nodes[node.parent].is_end:
            self.fail("an End Site has no joints")
        self.open.append(len(self.nodes))
        self.nodes.append(node)

    def current(self) -> _Node:
        if not self.open:
            self.fail("this stands outside of a joint")
        return self.nodes[self.open[-1]]

    def numbers(self, words: list[str]) -> tuple[float, ...]:
        try:
            values = tuple(float(word) for word in words)
        except ValueError:
            values = ()
        if len(values) != 3 or not all(math.isfinite(value) for value in values):
            self.fail(f"OFFSET needs three numbers, got {' '.join(words)[:40]!r}")
        return values

    def channels(self, words: list[str]) -> tuple[tuple[str, str], ...]:
        names = [word.lower() for word in words[1:]]
        if not words or not words[0].isdecimal() or int(words[0][:9]) != len(names):
            self.fail(
                f"CHANNELS needs their number and as many names, got {' '.join(words)[:60]!r}"
            )
        unknown = [name for name in names if name not in _CHANNELS]
        if unknown or len(set(names)) != len(names):
            self.fail(
                "channels are Xposition ... Zrotation, each once a joint, "
                f"got {' '.join(words[1:])[:60]!r}"
            )
        return tuple((name[1], _CHANNELS[name]) for name in names)

    def without_missing(self) -> tuple[list[_Node], list[str]]:
        kept: list[_Node] = []
        place, missing = {-1: -1}, 0
        for i, node in enumerate(self.nodes):
            if node.is_end and not any(node.offset):
                missing += 1
                continue
            place[i] = len(kept)
            node.parent = place[node.parent]
            kept.append(node)
        counts = Counter(node.name for node in kept)
        for node, name in zip(kept, number_doubles([node.name for node in kept]), strict=True):
            node.name = name
        renamed = [name for name, count in counts.items() if count > 1]
        notes = []
        if missing:
            notes.append(f"{missing} End Sites without length count as missing joints")
        if renamed:
            notes.append(f"joint names that occur twice got a number: {', '.join(renamed[:5])}")
        return kept, notes


def _read_header(text: str, start: int) -> tuple[str, str, int]:
    """Number of frames and time of a frame as they are printed, and where frames begin."""
    frames = _FRAMES.match(text, start)
    frame_time = _FRAME_TIME.match(text, frames.end()) if frames else None
    if frames is None or frame_time is None:
        line = text.count("\n", 0, start) + 2
        raise UnreadableFile("expected 'Frames: N' and 'Frame Time: seconds'", place=f"line {line}")
    return frames.group(1), frame_time.group(1), frame_time.end()


def _compare_length(printed: str, n_frames: int) -> list[str]:
    """Notes on a wrong number of frames; a file that was cut off is an error."""
    if not printed.isdecimal():
        raise UnreadableFile(f"'Frames:' needs a whole number, got {printed[:40]!r}")
    check_length(printed, n_frames, key="'Frames:' ")
    promised = int(printed[:20])
    if promised < n_frames:
        return [f"'Frames:' promises {promised} frames, all {n_frames} in the file were read"]
    return []


def _rate(frame_time: str) -> tuple[float, list[str]]:
    """Frames per second, and a note where few digits were printed."""
    time_s = parse_number(frame_time)
    rate = rate_of_frame_time(time_s)
    if math.isnan(rate):
        raise UnreadableFile(
            f"'Frame Time:' is {frame_time[:40]!r}, which gives no rate; {RATE_HINT}"
        )
    usual = usual_rate(frame_time, time_s, rate)
    if usual is None:
        return rate, []
    return usual, [f"{usual:g} Hz, by a frame time of {frame_time} s"]


def _split_channels(
    nodes: list[_Node], values: Floats
) -> tuple[Floats, dict[int, Floats], list[str]]:
    """Local rotations (frames, joints, 4), by joint translations (frames, 3), and a note on
    joints of which the translations would leave nothing.
    """
    collapsed = []
    turns = np.zeros((len(nodes), 4, len(values)))
    turns[:, 0] = 1.0
    translations = {}
    column = 0
    for joint, node in enumerate(nodes):
        order, angles, moved = "", [], {}
        for kind, axis in node.channels:
            if kind == "p":
                moved["XYZ".index(axis)] = values[:, column]
            else:
                order += axis
                angles.append(values[:, column])
            column += 1
        if angles:
            degrees = np.stack(angles).T
            turns[joint] = euler_to_quaternions(np.radians(degrees), order).T
        if moved:
            place = [moved.get(i, np.full(len(values), node.offset[i])) for i in range(3)]
            steps = np.stack(place, axis=1)
            if node.parent >= 0 and np.abs(steps).max() < _NOTHING * np.linalg.norm(node.offset):
                collapsed.append(node.name)
            else:
                translations[joint] = steps
    notes = []
    if collapsed:
        bones = "1 bone" if len(collapsed) == 1 else f"{len(collapsed)} bones"
        notes.append(
            f"position channels of {name_some(collapsed, 6)} are zero, which leaves {bones} "
            "without length: the offsets count there"
        )
    return np.moveaxis(turns, -1, 0), translations, notes
