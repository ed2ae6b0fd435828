"""The unit of a file by the size of the body in it.

Hip to knee to ankle is about 0.85 m in a grown person. All candidates but 1/0.45 inch and dm lie
more than a factor of two apart, so a child is still distinguished from a giant; a body that is of
no person's size in any of them has a unit of its own. A leg counts if both of its bones have a
length. Without legs the arms count, without a known skeleton the longest way through the body
from end to end, taken for 2.2 m. Legs that no adult has are doubted in the note.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.motion import GENERIC_JOINTS, Motion, Skeleton

Floats = NDArray[np.float64]

#: Ends an axis or unit that holds whatever the body says.
INSISTS = "!"

METRES: Mapping[str, float] = {
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "inch": 0.0254,
    "1/0.45 inch": 0.0254 / 0.45,
    "dm": 0.1,
}

_NEAR_ANOTHER = "dm"

#: What files write for these.
NAMES_OF_UNITS: Mapping[str, str] = {
    "m": "m", "meter": "m", "meters": "m", "metre": "m", "metres": "m",
    "dm": "dm", "decimeter": "dm", "decimeters": "dm", "decimetres": "dm",
    "cm": "cm", "centimeter": "cm", "centimeters": "cm",
    "mm": "mm", "millimeter": "mm", "millimeters": "mm", "millimetres": "mm",
    "in": "inch", "inch": "inch", "inches": "inch",
}  # fmt: skip

_SPAN_M = 2.2

# Limbs of a grown person.
_LIMBS = ((("hip", "knee", "ankle"), 0.85, "legs"), (("shoulder", "elbow", "wrist"), 0.53, "arms"))

# As fractions of a grown person: a child and a giant; and what no figure is.
_POSSIBLE = (0.35, 1.65)

_ABSURD = 3.5

# Legs of adults, hip to knee to ankle, in metres: shorter is a child, or another unit.
_ADULT_M = (0.65, 1.05)

# Of a limb's two bones, one shorter than this fraction of the other has collapsed.
_COLLAPSED = 0.1

# A bone is rigid if its length varies by less than this fraction.
_RIGID = 0.02


@dataclass(frozen=True, slots=True)
class FileMetadata:
    """What a file or its format says of unit and axes.

    Attributes
    ----------
    unit, up : what the file says; None where it does not
    usual_unit, usual_up : what the format usually has, where the body does not tell either;
        without `usual_unit` a body of no person's size is scaled to that of one
    likely : units that files of this format are in
    by_definition : the format has but one axis, so that a body that does not tell is no doubt
    origin : data set whose axis `usual_up` is, for the note
    noted : which of "unit" and "up" are worth a note where nobody gives them
    takes_unit : whether a unit that the caller gives is that of the body; else its reader has
        applied it
    """

    unit: str | None = None
    up: str | None = None
    usual_unit: str = "m"
    usual_up: str = "y"
    likely: tuple[str, ...] = tuple(METRES)
    by_definition: bool = False
    origin: str = ""
    noted: tuple[str, ...] = ("unit", "up")
    takes_unit: bool = True


class Length(NamedTuple):
    """A length of a body in file units, what it is in a grown person, and its name.

    `sure` is whether it is that of a limb; a tree may hold more than a body.
    """

    units: float
    metres: float
    what: str
    sure: bool = True

    def said(self, metres: float) -> str:
        """The length in words, if a unit has so many metres."""
        size = self.units * metres
        return f"{self.what} of {size:.2f} m" if size >= 0.1 else f"{self.what} of {size:.2g} m"


def doubt_of(length: Length, metres: float) -> str:
    """Words of doubt for a note, where legs are none of an adult; else nothing."""
    size = length.units * metres
    if length.what != "legs" or not length.sure or _ADULT_M[0] <= size <= _ADULT_M[1]:
        return ""
    than = "shorter" if size < _ADULT_M[0] else "longer"
    return (
        f"; {length.said(metres)} are {than} than those of adults "
        f"({_ADULT_M[0]} to {_ADULT_M[1]} m): a child, a figure, or another unit, which --unit "
        "(unit=...) says"
    )


def metres_per_unit(unit: float | str) -> float:
    """Metres of a unit given by name or as a number.

    Raises
    ------
    InvalidInput
        If the name is unknown or the number not positive.
    """
    if isinstance(unit, str):
        unit = unit.removesuffix(INSISTS)
        if unit in METRES:
            return METRES[unit]
    try:
        metres = float(unit)
    except ValueError:
        metres = np.nan
    if not 0 < metres < np.inf:
        raise InvalidInput(
            f"unit must be one of {', '.join(METRES)} or metres per unit, got {unit!r}"
        )
    return metres


def measure_body(
    generic: Floats | None, positions: Floats, skeleton: Skeleton | None
) -> Length | None:
    """A length that tells the unit: of the legs, the arms, or through the whole tree.

    Parameters
    ----------
    generic : array, shape (frames, 24, 3), generic joints, file units; None if unknown
    positions : array, shape (frames, joints, 3), file units; some frames suffice
    skeleton : the tree of the joints, where there is one
    """
    if generic is not None:
        for joints, expected, what in _LIMBS:
            length = _limb(generic, joints)
            if 0 < length < np.inf:
                return Length(length, expected, what)
    span = _span(positions, skeleton) if skeleton is not None else 0.0
    return Length(span, _SPAN_M, "a longest span", sure=False) if 0 < span < np.inf else None


def detect_unit(length: Length, likely: Collection[str] = METRES) -> str | None:
    """The unit of those likely in which a body is of a person's size, None if it is in none."""
    name = _nearest_unit(length, likely)
    return name if _is_possible(length, name) or not length.sure else None


def _nearest_unit(length: Length, likely: Collection[str] = METRES) -> str:
    """The unit of those likely in which a body is nearest to a person's size."""
    others = [unit for unit in likely if unit != _NEAR_ANOTHER]
    name = _nearest(length, others)
    if _NEAR_ANOTHER not in likely or not length.sure:
        return name
    # 1/0.45 inch lies so near to dm that a child in the one is a giant in the other.
    most = _ADULT_M[1] / _LIMBS[0][1]
    is_giant = length.units * METRES[_NEAR_ANOTHER] / length.metres > most
    if not is_giant or not _is_possible(length, name):
        return _nearest(length, (name, _NEAR_ANOTHER))
    return name


def _nearest(length: Length, units: Iterable[str]) -> str:
    return min(units, key=lambda unit: abs(np.log(length.units * METRES[unit] / length.metres)))


def _is_possible(length: Length, unit: str) -> bool:
    """Whether a person, of any age, is of the body's size in a unit."""
    least, most = _POSSIBLE
    return least < length.units * METRES[unit] / length.metres < most


def _is_absurd(length: Length, metres: float) -> bool:
    """Whether no person or figure has such a length, if a unit has so many metres."""
    ratio = length.units * metres / length.metres
    return length.sure and not 1 / _ABSURD < ratio < _ABSURD


def find_unit(
    source: str, metadata: FileMetadata, unit: float | str | None, length: Length | None
) -> tuple[float, str]:
    """Metres of a file's unit, and a note on where that is known from.

    Raises
    ------
    InvalidInput
        If the caller or the file contradicts the body.
    """
    given = metadata.unit if unit is None else unit
    if given is not None:
        metres = metres_per_unit(given)
        # A number is meant whatever the body says.
        insists = not isinstance(given, str) or given not in METRES
        if not insists and length is not None and _is_absurd(length, metres):
            claim = "says that it is in {}, which" if unit is None else "unit {} as given"
            raise InvalidInput(
                f"{claim.format(given)} makes {length.said(metres)}; "
                f"{_by_body(length, metres)}; say which with --unit (unit=...), and if "
                f"the body is so large, as a number: {metres:g}",
                file=source,
            )
        by = "as the file says" if unit is None else "as given"
        return metres, f"unit {str(given).removesuffix(INSISTS)}, {by}"
    if length is None:
        return METRES[metadata.usual_unit], f"unit {metadata.usual_unit}, assumed"
    name = detect_unit(length, metadata.likely)
    if name is None:
        metres = length.metres / length.units
        return metres, f"unit {metres:.3g} m, so that the body has {length.said(metres)}"
    return METRES[name], f"unit {name}, by {length.said(METRES[name])}"


def _by_body(length: Length, metres: float) -> str:
    """What the unit is by the body, which refutes one of so many metres."""
    name = _nearest_unit(length)
    if _is_absurd(length, METRES[name]) or METRES[name] == metres:
        return "by the body it is in no unit that is known"
    return f"by the body it is {name}"


def rescale(motion: Motion, metres: float) -> Motion:
    """A motion whose unit has so many metres, in metres; its positions are changed."""
    if metres == 1.0:
        return motion
    positions = motion.positions
    positions *= metres
    skeleton = motion.skeleton
    if skeleton is not None:
        skeleton = replace(skeleton, offsets=skeleton.offsets * metres)
    return replace(motion, positions=positions, skeleton=skeleton)


def _limb(generic: Floats, joints: tuple[str, str, str]) -> float:
    """Median length over frames, mean of the sides that are seen and whole; NaN if neither is."""
    lengths = []
    for side in "lr":
        a, b, c = (generic[:, GENERIC_JOINTS.index(side + joint)] for joint in joints)
        upper, lower = np.linalg.norm(a - b, axis=1), np.linalg.norm(b - c, axis=1)
        seen = np.isfinite(upper + lower)
        if not seen.any():
            continue
        both = np.stack((upper, lower, upper + lower))[:, seen]
        *bones, whole = np.median(both, axis=1).tolist()
        if min(bones) > _COLLAPSED * max(bones):
            lengths.append(whole)
    return float(np.mean(lengths)) if lengths else np.nan


def _span(positions: Floats, skeleton: Skeleton) -> float:
    """Length of the longest way between two joints along rigid bones."""
    below = np.zeros(len(skeleton.names))
    longest = 0.0
    for joint in range(len(skeleton.names) - 1, -1, -1):
        parent = skeleton.parents[joint]
        if parent < 0:
            continue
        lengths = np.linalg.norm(positions[:, joint] - positions[:, parent], axis=-1)
        bone = float(np.median(lengths))
        # Between the origin and a body that walks away from it lies no bone.
        if np.ptp(lengths) > _RIGID * bone:
            longest = max(longest, float(below[joint]))
            continue
        way = below[joint] + bone
        longest = max(longest, float(below[parent] + way))
        below[parent] = max(below[parent], way)
    return longest
