"""Acclaim skeletons (ASF): finding and reading them.

Conventions: `length` of the units divides bone lengths and root translation alike, the
result is inches. A bone turns by C R C^-1, with C from its `axis` and R from the values
of its `dof`. Axes are fixed: order `XYZ` means Rz Ry Rx; the three numbers of `axis`
are x, y, z whatever the order, and the sequence of `dof` says only which value is which.
A joint of the skeleton is the *end* of the bone of that name; `root` is where the body
starts.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from motionary.errors import UnreadableFile
from motionary.io.formats.content import names_file
from motionary.io.text import read_text, stem_of
from motionary.motion import Skeleton
from motionary.rotations import Floats, euler_to_quaternions

METRES_PER_INCH = 0.0254
ROOT = "root"

# The skeleton lies beside the motion or in one of this many folders above it.
_FOLDERS_ABOVE = 2

_ROTATIONS = ("rx", "ry", "rz")
_TRANSLATIONS = ("tx", "ty", "tz")


@dataclass(slots=True)
class Bone:
    """A bone as written.

    Attributes
    ----------
    name : name
    direction : unit vector in the world at rest
    length : in file units
    axis : three angles of C, in the file's angle unit
    order : order of the axes, of C and of the movement
    dof : which values the motion file gives, in its sequence
    """

    name: str
    direction: tuple[float, ...] = (0.0, 0.0, 0.0)
    length: float = 0.0
    axis: tuple[float, ...] = (0.0, 0.0, 0.0)
    order: str = "XYZ"
    dof: tuple[str, ...] = ()


@dataclass(slots=True)
class AcclaimSkeleton:
    """Content of an ASF file.

    Attributes
    ----------
    name : name of the file
    metres : per file unit
    degrees : whether angles are degrees
    root : the root as a bone without length; `axis` is its orientation
    position : of the root, file units
    bones : by name, root excluded
    children : by name of the parent
    """

    name: str
    metres: float = METRES_PER_INCH
    degrees: bool = True
    root: Bone = field(default_factory=lambda: Bone(ROOT, dof=(*_TRANSLATIONS, *_ROTATIONS)))
    position: tuple[float, ...] = (0.0, 0.0, 0.0)
    bones: dict[str, Bone] = field(default_factory=dict)
    children: dict[str, list[str]] = field(default_factory=dict)

    @property
    def radians(self) -> float:
        """Radians per unit of angle."""
        return math.pi / 180 if self.degrees else 1.0

    def in_order(self) -> list[tuple[Bone, int]]:
        """Root and bones, parents first, each with its parent's place in the list."""
        found = [(self.root, -1)]
        for place, (bone, _) in enumerate(found):
            found.extend((self.bones[child], place) for child in self.children.get(bone.name, ()))
        return found

    def to_skeleton(self) -> Skeleton:
        """The tree of bone ends, offsets in metres in the bone's own turned frame."""
        order = self.in_order()
        offsets = [np.multiply(bone.direction, bone.length * self.metres) for bone, _ in order]
        offsets[0] = np.multiply(self.position, self.metres)
        return Skeleton(
            names=tuple(bone.name for bone, _ in order),
            parents=np.array([parent for _, parent in order], dtype=np.intp),
            offsets=np.array(offsets, dtype=np.float64),
            ends=True,
        )

    def axis_quaternion(self, bone: Bone) -> Floats:
        """C of a bone (orientation of the root), quaternion wxyz."""
        angles = np.array([bone.axis["XYZ".index(letter)] for letter in reversed(bone.order)])
        return euler_to_quaternions(angles * self.radians, bone.order[::-1])


@names_file
def read_asf(path: Path) -> AcclaimSkeleton:
    """Read an Acclaim skeleton."""
    return _Reader(path.name).read(read_text(path))


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
    for beside the motion and up to two folders above. For many motions, `listing` says which
    skeletons a folder holds, and remembers.
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
        f"no skeleton found; looked for {', '.join(stem + '.asf' for stem in stems)} "
        "in its folder and two above; name the skeleton with --asf FILE (asf=...)",
        file=path,
    )


class _Reader:
    """Walks the lines of an ASF file and remembers where it is, for the errors."""

    def __init__(self, name: str) -> None:
        self.skeleton = AcclaimSkeleton(name)
        self.line = 0

    def fail(self, problem: str) -> NoReturn:
        raise UnreadableFile(problem, place=f"line {self.line}")

    def read(self, text: str) -> AcclaimSkeleton:
        section = ""
        readers = {
            "units": self.read_unit,
            "root": self.read_root,
            "bonedata": self.read_bone,
            "hierarchy": self.read_children,
        }
        for self.line, line in enumerate(text.split("\n"), start=1):
            words = line.partition("#")[0].split()
            if words and words[0].startswith(":"):
                section = words[0][1:].lower()
            elif words and section in readers:
                readers[section](words[0].lower(), words)
        self.check()
        return self.skeleton

    def numbers(self, words: list[str], count: int) -> tuple[float, ...]:
        try:
            values = tuple(float(word) for word in words[1 : 1 + count])
        except ValueError:
            self.fail(f"{words[0]!r} needs numbers, got {' '.join(words[1:])!r}")
        if len(values) != count or not all(math.isfinite(v) for v in values):
            self.fail(f"{words[0]!r} needs {count} numbers, got {' '.join(words[1:])!r}")
        return values

    def read_unit(self, key: str, words: list[str]) -> None:
        if key == "length":
            (length,) = self.numbers(words, 1)
            if not 1e-6 < length < 1e6:
                self.fail(f"the unit of length must be positive, such as 0.45, got {words[1]}")
            self.skeleton.metres = METRES_PER_INCH / length
        elif key == "angle":
            self.skeleton.degrees = not words[-1].lower().startswith("rad")

    def read_root(self, key: str, words: list[str]) -> None:
        root = self.skeleton.root
        if key == "order":
            root.dof = self.dof(words[1:], (*_TRANSLATIONS, *_ROTATIONS))
        elif key == "axis":
            root.order = self.order(words[-1])
        elif key == "position":
            self.skeleton.position = self.numbers(words, 3)
        elif key == "orientation":
            root.axis = self.numbers(words, 3)

    def read_bone(self, key: str, words: list[str]) -> None:
        bones = self.skeleton.bones
        if key == "name":
            name = " ".join(words[1:])
            if not name or name == ROOT or name in bones:
                self.fail(f"a bone needs a name of its own, got {name!r}")
            bones[name] = Bone(name)
            return
        if key not in ("direction", "length", "axis", "dof"):
            return
        if not bones:
            self.fail(f"{words[0]!r} comes before the name of a bone")
        bone = bones[next(reversed(bones))]
        if key == "direction":
            bone.direction = self.numbers(words, 3)
        elif key == "length":
            (bone.length,) = self.numbers(words, 1)
        elif key == "axis":
            bone.axis = self.numbers(words, 3)
            bone.order = self.order(words[4]) if len(words) > 4 else "XYZ"
        else:
            bone.dof = self.dof(words[1:], _ROTATIONS)

    def dof(self, words: list[str], known: tuple[str, ...]) -> tuple[str, ...]:
        dof = tuple(word.lower() for word in words)
        if len(set(dof)) != len(dof) or not set(dof) <= set(known):
            self.fail(f"degrees of freedom here are {', '.join(known)}, got {' '.join(words)!r}")
        return dof

    def order(self, word: str) -> str:
        if sorted(word.upper()) != ["X", "Y", "Z"]:
            self.fail(f"an axis order is three letters such as XYZ, got {word!r}")
        return word.upper()

    def read_children(self, key: str, words: list[str]) -> None:
        if key in ("begin", "end"):
            return
        skeleton = self.skeleton
        for name in words:
            if name != ROOT and name not in skeleton.bones:
                self.fail(f"the hierarchy names {name!r}, which is no bone")
        skeleton.children.setdefault(words[0], []).extend(words[1:])

    def check(self) -> None:
        skeleton = self.skeleton
        if not skeleton.bones:
            raise UnreadableFile("no bones; expected an Acclaim skeleton (ASF)")
        placed = [child for children in skeleton.children.values() for child in children]
        if len(set(placed)) != len(placed) or ROOT in placed:
            raise UnreadableFile("a bone occurs twice in the hierarchy")
        missing = set(skeleton.bones) - {bone.name for bone, _ in skeleton.in_order()}
        if missing:
            names = ", ".join(sorted(missing))
            raise UnreadableFile(f"the hierarchy does not reach {names}")
