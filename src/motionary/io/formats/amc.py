"""Acclaim motions (AMC): reading, writing and cutting; for their skeletons see `asf`.

Conventions: a motion file holds no frame rate; 120 Hz is assumed and noted. Its first frame has
the number that stands there, usually 1.

A written file means nothing without its skeleton, and only holds the degrees of freedom that the
skeleton has. So the motion must be one of that skeleton, as cuts and corrections of Acclaim
motions are.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput, UnreadableFile, Where
from motionary.io.formats.asf import AcclaimSkeleton, Bone, find_asf, read_asf
from motionary.io.formats.content import FileContent, at_fault, names_file, place_joints, rig_of
from motionary.io.formats.numbers import check_frames, end_alike, read_frames, to_number
from motionary.io.normalise.units import FileMetadata
from motionary.io.options import ReadOptions
from motionary.io.text import read_text, write_text
from motionary.motion import Motion
from motionary.rotations import (
    Floats,
    conjugate_quaternions,
    euler_to_quaternions,
    multiply_quaternions,
    quaternions_to_euler,
    quaternions_to_matrices,
)

RATE_HZ = 120.0

_NO_FRAME = "no frame number found; expected an Acclaim motion (AMC)"
_NO_BONE = "is not among the bones of the first frame"
_KEYWORDS = {":degrees": True, ":radians": False}

# Lengths are inches or metres by definition; only what the body says is worth a note.
_METADATA = FileMetadata(unit="m", by_definition=True, noted=("up",))

# Bones agree with the skeleton up to this length, turns up to this angle.
_SAME_M = 1e-5
_SAME_RADIANS = 1e-3
_TOGETHER = 1024
_NUMBER = "%.7g"


class _Body(NamedTuple):
    """Frames as text, the line it starts at, and whether angles are degrees."""

    text: str
    line: int
    degrees: bool | None


@names_file
def read_amc(path: Path, options: ReadOptions) -> FileContent:
    """Content of an Acclaim motion: a position per bone (its end) and `root`."""
    body = _find_body(read_text(path))
    acclaim = read_asf(Path(options.acclaim_skeleton or find_asf(path)))
    if options.unit is not None:
        # Lengths stay as they are written; what the skeleton says of them does not count.
        acclaim = replace(acclaim, metres=1.0)
    layout = _read_layout(body)
    values = _read_block(body, layout)
    if values is None:
        values = _read_lines(body, layout)
    return _to_content(acclaim, layout, body, values, options.rate_hz)


def _find_body(text: str) -> _Body:
    """Skip comments and keywords up to the number of the first frame."""
    degrees = None
    place = 0
    for number, line in enumerate(text.split("\n", 1000), start=1):
        word = line.strip()
        if word.isdigit():
            body = text[place:]
            if "#" in body:
                body = re.sub("#[^\n]*", "", body)
            return _Body(body, number, degrees)
        if word and not word.startswith((":", "#")):
            break
        degrees = _KEYWORDS.get(word.lower(), degrees)
        place += len(line) + 1
    raise UnreadableFile(_NO_FRAME)


def _read_layout(body: _Body) -> dict[str, int]:
    """Names of a frame's lines in the file's sequence, and how many values each has."""
    layout: dict[str, int] = {}
    for words in _frame_lines(body.text):
        if len(words) == 1:
            break
        if words[0] in layout:
            raise UnreadableFile(
                "a bone occurs twice in the first frame", place=f"line {body.line}"
            )
        layout[words[0]] = len(words) - 1
    if not layout:
        raise UnreadableFile("the first frame is empty", place=f"line {body.line}")
    return layout


def _frame_lines(text: str) -> Iterator[list[str]]:
    """Words of the lines after the first frame number."""
    end = text.find("\n")
    while end >= 0:
        start, end = end + 1, text.find("\n", end + 1)
        words = text[start : end if end >= 0 else None].split()
        if words:
            yield words


def _read_block(body: _Body, layout: dict[str, int]) -> Floats | None:
    """Frame number and values of all frames, or None if the frames are not alike."""
    words: list[bytes | None] = [None]
    for name, count in layout.items():
        words += [name.encode(), *[None] * count]
    values = read_frames(body.text.encode(), words)
    if values is None:
        return None
    counted = values[0, 0] + np.arange(len(values))
    return values if np.array_equal(values[:, 0], counted) else None


def _read_lines(body: _Body, layout: dict[str, int]) -> Floats:
    """The same line by line: lines in any sequence, errors with their place."""
    ends = dict(zip(layout, (1 + np.cumsum(list(layout.values()))).tolist(), strict=True))
    rows: list[list[float]] = []
    left: set[str] = set()
    for number, line in enumerate(body.text.split("\n"), start=body.line):
        words = line.split()
        where = Where(file="", place=f"line {number}")
        if len(words) == 1:
            rows.append(_start_frame(words[0], rows, left, where, 1 + sum(layout.values())))
            left = set(layout)
        elif words:
            name, values = words[0], words[1:]
            if name not in left:
                known = name in layout
                problem = "occurs twice in this frame" if known else _NO_BONE
                raise UnreadableFile(f"{name if known else repr(name)} {problem}", **where)
            if len(values) != layout[name]:
                raise UnreadableFile(
                    f"{name} has {len(values)} values, {layout[name]} in the first frame", **where
                )
            end = ends[name]
            rows[-1][end - len(values) : end] = [to_number(word, where) for word in values]
            left.remove(name)
    if left:
        raise UnreadableFile(f"the last frame ends without {_some(left)}; cut off?")
    return np.array(rows)


def _start_frame(
    word: str, rows: list[list[float]], left: set[str], where: Where, width: int
) -> list[float]:
    number = to_number(word, where)
    if left:
        raise UnreadableFile(f"frame {rows[-1][0]:.0f} has no values for {_some(left)}", **where)
    if rows and number != rows[-1][0] + 1:
        raise UnreadableFile(
            f"frame {rows[-1][0] + 1:.0f} is missing, the file goes on with {word}", **where
        )
    return [number] + [0.0] * (width - 1)


def _some(names: set[str]) -> str:
    shown = sorted(names)
    return ", ".join(shown[:3]) + (f" and {len(shown) - 3} more" if len(shown) > 3 else "")


def _to_content(
    acclaim: AcclaimSkeleton,
    layout: dict[str, int],
    body: _Body,
    values: Floats,
    rate_hz: float | None,
) -> FileContent:
    first_frame, values = int(values[0, 0]), values[:, 1:]
    radians = acclaim.radians if body.degrees is None else (np.pi / 180 if body.degrees else 1.0)
    columns = _match(layout, acclaim)
    skeleton = acclaim.to_skeleton()
    turns = np.empty((len(skeleton.names), 4, len(values)))
    for joint, (bone, _) in enumerate(acclaim.in_order()):
        turns[joint] = _rotate(acclaim, bone, values, columns[bone.name], radians).T
    rotations = np.moveaxis(turns, -1, 0)
    root = np.zeros((len(values), 3))
    for axis, letter in enumerate("xyz"):
        if f"t{letter}" in columns["root"]:
            root[:, axis] = values[:, columns["root"][f"t{letter}"]] * acclaim.metres
    notes = [f"skeleton {acclaim.name}"]
    if rate_hz is None:
        notes.append("rate assumed 120 Hz")
    still = {bone.name for bone, _ in acclaim.in_order() if bone.dof and not columns[bone.name]}
    if still:
        notes.append(f"no values for {_some(still)}: kept at rest")
    return FileContent(
        names=skeleton.names,
        positions=place_joints(skeleton, rotations, root),
        rate_hz=RATE_HZ if rate_hz is None else rate_hz,
        metadata=_METADATA,
        first_frame=first_frame,
        skeleton=skeleton,
        rotations=rotations,
        notes=tuple(notes),
    )


def _match(layout: dict[str, int], skeleton: AcclaimSkeleton) -> dict[str, dict[str, int]]:
    """Column of each degree of freedom, by bone."""
    columns: dict[str, dict[str, int]] = {bone.name: {} for bone, _ in skeleton.in_order()}
    place = 0
    for bone_name, count in layout.items():
        if bone_name not in columns:
            raise UnreadableFile(f"bone {bone_name!r} is not in {skeleton.name}")
        bone = skeleton.root if bone_name == "root" else skeleton.bones[bone_name]
        if len(bone.dof) != count:
            raise UnreadableFile(
                f"{bone_name} has {count} values, "
                f"{skeleton.name} expects {len(bone.dof)} ({' '.join(bone.dof)})"
            )
        columns[bone_name] = {dof: place + i for i, dof in enumerate(bone.dof)}
        place += count
    return columns


def _rotate(
    skeleton: AcclaimSkeleton, bone: Bone, values: Floats, columns: dict[str, int], radians: float
) -> Floats:
    """Local rotations of a bone, (frames, 4) wxyz: C R C^-1; of the root: C R."""
    order = "".join(letter for letter in reversed(bone.order) if f"r{letter.lower()}" in columns)
    angles = values[:, [columns[f"r{letter.lower()}"] for letter in order]] * radians
    turns = euler_to_quaternions(angles, order)
    axis = skeleton.axis_quaternion(bone)
    if bone is skeleton.root:
        return multiply_quaternions(axis, turns)
    # C R C^-1 turns by the same angle about the axis that C moves it to.
    turns[:, 1:] = turns[:, 1:] @ quaternions_to_matrices(axis).T
    return turns


def write_amc(motion: Motion, path: str | Path, *, asf: str | Path | None = None) -> None:
    """Write the motion of the skeleton `asf`, by default the one that `find_asf` finds by name.

    A path whose name ends in .gz is packed.
    """
    skeleton = read_asf(Path(asf if asf is not None else find_asf(Path(path))))
    with at_fault(motion.source or "motion"):
        rotations = _check(motion, skeleton)
        columns = {
            bone.name: _values(skeleton, bone, rotations[:, joint], motion)
            for joint, (bone, _) in enumerate(skeleton.in_order())
            if bone.dof
        }
    write_text(path, _format_frames(motion, columns, skeleton))


def _check(motion: Motion, skeleton: AcclaimSkeleton) -> Floats:
    """The rotations of a motion that is one of this skeleton."""
    own, rotations = rig_of(motion, "AMC holds the turns of an Acclaim skeleton")
    expected = skeleton.to_skeleton()
    if not own.ends or motion.names != expected.names:
        raise InvalidInput(
            f"has not the bones of {skeleton.name}; name its own skeleton with --asf "
            "(asf=...), or write .bvh"
        )
    if np.abs(own.offsets - expected.offsets).max() > _SAME_M:
        raise InvalidInput(
            f"its bones are not as long as those of {skeleton.name}; name its own "
            "skeleton with --asf (asf=...)"
        )
    return rotations


def _values(skeleton: AcclaimSkeleton, bone: Bone, turns: Floats, motion: Motion) -> Floats:
    """Values of a bone's degrees of freedom, (frames, dof), in their sequence."""
    axis = conjugate_quaternions(skeleton.axis_quaternion(bone))
    is_root = bone is skeleton.root
    inner = multiply_quaternions(axis, turns)
    if not is_root:
        inner = multiply_quaternions(inner, skeleton.axis_quaternion(bone))
    order = bone.order[::-1]
    missing = [i for i, letter in enumerate(order) if f"r{letter.lower()}" not in bone.dof]
    angles = _angles(inner, order, missing)
    if missing and np.abs(angles[:, missing]).max() > _SAME_RADIANS:
        raise InvalidInput(f"{bone.name} turns about an axis that it has not in {skeleton.name}")
    values = {
        f"r{letter.lower()}": angles[:, i] / skeleton.radians for i, letter in enumerate(order)
    }
    if is_root:
        # Which way positions are offset at rest is in the skeleton.
        moved = motion.positions[:, 0] - np.multiply(skeleton.position, skeleton.metres)
        values |= {f"t{x}": moved[:, i] / skeleton.metres for i, x in enumerate("xyz")}
    return np.stack([values[dof] for dof in bone.dof], axis=1)


def _angles(quaternions: Floats, order: str, missing: list[int]) -> Floats:
    """Angles, of the two triples that mean the same the one that needs no missing axis."""
    angles = quaternions_to_euler(quaternions, order)
    if not missing:
        return angles
    other = np.stack((angles[:, 0] + np.pi, np.pi - angles[:, 1], angles[:, 2] + np.pi), axis=1)
    other = (other + np.pi) % (2 * np.pi) - np.pi
    better = np.abs(other[:, missing]).max(axis=1) < np.abs(angles[:, missing]).max(axis=1)
    return np.where(better[:, None], other, angles)


def _format_frames(
    motion: Motion, columns: dict[str, Floats], skeleton: AcclaimSkeleton
) -> Iterator[str]:
    unit = ":DEGREES" if skeleton.degrees else ":RADIANS"
    yield f"#!OML:ASF {skeleton.name}\n:FULLY-SPECIFIED\n{unit}\n"
    lines = ["%d\n"]
    lines += [f"{name} {' '.join([_NUMBER] * c.shape[1])}\n" for name, c in columns.items()]
    frame = "".join(lines)
    first = motion.first_frame
    for start in range(0, motion.n_frames, _TOGETHER):
        stop = min(start + _TOGETHER, motion.n_frames)
        numbers = np.arange(first + start, first + stop, dtype=np.float64)[:, None]
        block = np.concatenate((numbers, *(c[start:stop] for c in columns.values())), axis=1)
        yield "".join(frame % tuple(row) for row in block.tolist())


def cut_amc(lines: list[str], first: int, last: int) -> list[str]:
    """Lines of a clip, numbered from 1; frames as the file counts them, both included."""
    starts = [i for i, line in enumerate(lines) if line.strip().isdecimal()]
    if not starts:
        raise UnreadableFile(_NO_FRAME)
    number = int(lines[starts[0]])
    check_frames(first, last, first_number=number, n_frames=len(starts))
    starts.append(len(lines))
    clip = lines[: starts[0]]
    for count, place in enumerate(range(first - number, last - number + 1), start=1):
        start, stop = starts[place], starts[place + 1]
        if int(lines[start]) != number + place:
            raise UnreadableFile(f"frame {number + place} is missing")
        clip.append(re.sub(r"\d+", str(count), lines[start], count=1))
        clip += lines[start + 1 : stop]
    return end_alike(clip, lines[starts[0]])
