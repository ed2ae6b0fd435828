"""What did a body do, according to an Acclaim motion (AMC) and its skeleton (ASF)?

Conventions: see `asf`. A motion file holds no frame rate; 120 Hz is assumed and said.
Its first frame has the number that stands there, usually 1.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from motionary.errors import UnreadableFile
from motionary.io.formats.asf import AcclaimSkeleton, Bone, read_asf
from motionary.io.formats.numbers import read_frames
from motionary.io.formats.pose import place_joints
from motionary.io.normalise.body_frame import FileMetadata, rescale, settle_claims, turn
from motionary.io.suffixes import stem_of
from motionary.io.text import read_text
from motionary.motion import Motion
from motionary.rotations import (
    Floats,
    euler_to_quaternions,
    multiply_quaternions,
    quaternions_to_matrices,
)
from motionary.skeletons import SkeletonTable, find_mapping

RATE_HZ = 120.0

# The skeleton lies beside the motion or in one of this many folders above it.
_FOLDERS_ABOVE = 2
_CLAIMS = FileMetadata(unit="m", by_definition=True)
_KEYWORDS = {":degrees": True, ":radians": False}


class _Layout(NamedTuple):
    """Names of a frame's lines in the file's sequence, and how many values each has."""

    names: tuple[str, ...]
    counts: tuple[int, ...]


class _Body(NamedTuple):
    """Frames as text, the line it starts at, and whether angles are degrees."""

    text: str
    line: int
    degrees: bool | None


def read_amc(
    path: str | Path,
    *,
    asf: str | Path | None = None,
    rate_hz: float | None = None,
    skeleton: SkeletonTable | None = None,
    unit: float | str | None = None,
    up: str | None = None,
) -> Motion:
    """Read an Acclaim motion.

    Parameters
    ----------
    path : the AMC file
    asf : its skeleton; by default it is looked for by name, see `find_asf`
    rate_hz : frames per second; by default 120, with a note
    skeleton : what the joints are; by default what their names and tree tell
    unit : of lengths in both files; by default what the skeleton says
    up : axis that points up; by default by the body, y where it does not tell

    Returns
    -------
    Motion with a position per bone (its end) and `root`, metres, y up

    Raises
    ------
    UnreadableFile
        If a file is missing or broken, or the skeleton is not found; the message names
        the line, or the names that were looked for.
    InvalidInput
        If the caller or the skeleton contradicts the body.
    """
    path = Path(path)
    body = _find_body(read_text(path), path.name)
    acclaim = read_asf(asf if asf is not None else find_asf(path))
    layout = _read_layout(body, path.name)
    values = _read_block(body, layout)
    if values is None:
        values = _read_lines(body, layout, path.name)
    numbers = values[:, 0]
    motion = _to_motion(path.name, acclaim, layout, body, values[:, 1:], int(numbers[0]), rate_hz)
    names, tree, positions = motion.names, motion.skeleton, motion.positions
    motion = replace(motion, mapping=find_mapping(names, tree, positions, told=skeleton))
    return _normalise(motion, acclaim.metres, unit, up)


def list_asf(folder: Path) -> dict[str, Path]:
    """Skeletons in a folder by the stem of their names, lower case; none if it is closed."""
    try:
        files = sorted(file for file in folder.iterdir() if file.suffix.lower() == ".asf")
    except OSError:
        return {}
    return {file.stem.lower(): file for file in files}


def places_of_asf(path: Path) -> tuple[Path, ...]:
    """Folders in which the skeleton of a motion is looked for, in this sequence."""
    folder = path.absolute().parent
    return (folder, *folder.parents[:_FOLDERS_ABOVE])


def find_asf(path: Path, *, listing: Callable[[Path], Mapping[str, Path]] = list_asf) -> Path:
    """The skeleton of a motion: same name, a beginning of it, or alone in the folder.

    `HDM_bd_squat_001.amc` goes with `HDM_bd_squat.asf`, `HDM_bd.asf`, `HDM.asf`, looked
    for beside the motion and up to two folders above.

    Parameters
    ----------
    path : the motion
    listing : says which skeletons a folder holds; for many motions, one that remembers

    Raises
    ------
    UnreadableFile
        If there is none; the message says what was looked for.
    """
    parts = stem_of(path).split("_")
    stems = ["_".join(parts[:n]) for n in range(len(parts), 0, -1)]
    places = places_of_asf(path)
    for place in places:
        found = listing(place)
        for stem in stems:
            if stem.lower() in found:
                return found[stem.lower()]
        if place == places[0] and len(found) == 1:
            return next(iter(found.values()))
    raise UnreadableFile(
        f"{path}: no skeleton found; looked for {', '.join(stem + '.asf' for stem in stems)} "
        "in its folder and two above; name the skeleton with --asf FILE (asf=...)"
    )


def _find_body(text: str, name: str) -> _Body:
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
    raise UnreadableFile(f"{name}: no frame number found; expected an Acclaim motion (AMC)")


def _read_layout(body: _Body, name: str) -> _Layout:
    names, counts = [], []
    for words in _frame_lines(body.text):
        if len(words) == 1:
            break
        names.append(words[0])
        counts.append(len(words) - 1)
    if not names:
        raise UnreadableFile(f"{name}, line {body.line}: the first frame is empty")
    if len(set(names)) != len(names):
        raise UnreadableFile(f"{name}, line {body.line}: a bone occurs twice in the first frame")
    return _Layout(tuple(names), tuple(counts))


def _frame_lines(text: str) -> Iterator[list[str]]:
    """Words of the lines after the first frame number."""
    end = text.find("\n")
    while end >= 0:
        start, end = end + 1, text.find("\n", end + 1)
        words = text[start : end if end >= 0 else None].split()
        if words:
            yield words


def _read_block(body: _Body, layout: _Layout) -> Floats | None:
    """Frame number and values of all frames, or None if the frames are not alike."""
    words: list[bytes | None] = [None]
    for name, count in zip(layout.names, layout.counts, strict=True):
        words += [name.encode(), *[None] * count]
    values = read_frames(body.text.encode(), words)
    if values is None:
        return None
    counted = values[0, 0] + np.arange(len(values))
    return values if np.array_equal(values[:, 0], counted) else None


def _read_lines(body: _Body, layout: _Layout, name: str) -> Floats:
    """The same line by line: lines in any sequence, errors with their place."""
    starts = dict(zip(layout.names, np.cumsum((1, *layout.counts[:-1])).tolist(), strict=True))
    counts = dict(zip(layout.names, layout.counts, strict=True))
    rows: list[list[float]] = []
    left: set[str] = set()
    for number, line in enumerate(body.text.split("\n"), start=body.line):
        words = line.split()
        where = f"{name}, line {number}"
        if len(words) == 1:
            rows.append(_start_frame(words[0], rows, left, where, 1 + sum(layout.counts)))
            left = set(layout.names)
        elif words:
            if words[0] not in left:
                raise UnreadableFile(f"{where}: {_why_unexpected(words[0], counts)}")
            if len(words) - 1 != counts[words[0]]:
                raise UnreadableFile(
                    f"{where}: {words[0]} has {len(words) - 1} values, "
                    f"{counts[words[0]]} in the first frame"
                )
            start = starts[words[0]]
            rows[-1][start : start + len(words) - 1] = _numbers(words[1:], where)
            left.remove(words[0])
    if left:
        raise UnreadableFile(f"{name}: the last frame ends without {_some(left)}; cut off?")
    return np.array(rows)


def _start_frame(
    word: str, rows: list[list[float]], left: set[str], where: str, width: int
) -> list[float]:
    (number,) = _numbers([word], where)
    if left:
        raise UnreadableFile(f"{where}: frame {rows[-1][0]:.0f} has no values for {_some(left)}")
    if rows and number != rows[-1][0] + 1:
        raise UnreadableFile(
            f"{where}: frame {rows[-1][0] + 1:.0f} is missing, the file goes on with {word}"
        )
    return [number] + [0.0] * (width - 1)


def _numbers(words: list[str], where: str) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        raise UnreadableFile(f"{where}: expected numbers, got {' '.join(words)!r}") from None
    if not np.isfinite(values).all():
        raise UnreadableFile(f"{where}: expected finite numbers, got {' '.join(words)!r}")
    return values


def _why_unexpected(bone: str, known: dict[str, int]) -> str:
    if bone in known:
        return f"{bone} occurs twice in this frame"
    return f"{bone!r} is not among the bones of the first frame"


def _some(names: set[str]) -> str:
    shown = sorted(names)
    return ", ".join(shown[:3]) + (f" and {len(shown) - 3} more" if len(shown) > 3 else "")


def _to_motion(
    name: str,
    acclaim: AcclaimSkeleton,
    layout: _Layout,
    body: _Body,
    values: Floats,
    first_frame: int,
    rate_hz: float | None,
) -> Motion:
    radians = acclaim.radians if body.degrees is None else (np.pi / 180 if body.degrees else 1.0)
    columns = _match(layout, acclaim, name)
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
    return Motion(
        names=skeleton.names,
        positions=place_joints(skeleton, rotations, root, translations={}, source=name),
        rate_hz=RATE_HZ if rate_hz is None else rate_hz,
        skeleton=skeleton,
        rotations=rotations,
        source=name,
        first_frame=first_frame,
        notes=tuple(notes),
    )


def _normalise(motion: Motion, metres: float, unit: float | str | None, up: str | None) -> Motion:
    """The motion with y up and, if told, in another unit than the skeleton says."""
    if unit is not None:
        motion = rescale(motion, 1 / metres)
    # Lengths are inches or metres by definition; only what is noticed is worth a note.
    normalised = settle_claims(
        motion, _CLAIMS if unit is None else FileMetadata(), unit=unit, up=up
    )
    notes = normalised.notes if unit is not None else normalised.notes[1:]
    motion = turn(rescale(motion, normalised.metres), normalised.up)
    return replace(motion, notes=(*motion.notes, *notes))


def _match(layout: _Layout, skeleton: AcclaimSkeleton, name: str) -> dict[str, dict[str, int]]:
    """Column of each degree of freedom, by bone."""
    columns: dict[str, dict[str, int]] = {bone.name: {} for bone, _ in skeleton.in_order()}
    place = 0
    for bone_name, count in zip(layout.names, layout.counts, strict=True):
        if bone_name not in columns:
            raise UnreadableFile(f"{name}: bone {bone_name!r} is not in {skeleton.name}")
        bone = skeleton.root if bone_name == "root" else skeleton.bones[bone_name]
        if len(bone.dof) != count:
            raise UnreadableFile(
                f"{name}: {bone_name} has {count} values, "
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
