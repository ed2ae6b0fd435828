"""How long is a unit of a file that does not say it?

By the legs: hip to knee to ankle is about 0.85 m in a grown person. The candidates lie
more than a factor of two apart, so a child is still told from a giant; a body that is of no
person's size in any of them has a unit of its own. Without legs the arms count, without a
known skeleton the longest way through the body from end to end, taken for 2.2 m.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.normalise.axes import INSISTS
from motionary.motion import GENERIC_JOINTS, Skeleton

Floats = NDArray[np.float64]

METRES: Mapping[str, float] = {
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "inch": 0.0254,
    "1/0.45 inch": 0.0254 / 0.45,
}

#: What files write for these.
NAMES_OF_UNITS: Mapping[str, str] = {
    "m": "m", "meter": "m", "meters": "m", "metre": "m", "metres": "m",
    "cm": "cm", "centimeter": "cm", "centimeters": "cm",
    "mm": "mm", "millimeter": "mm", "millimeters": "mm", "millimetres": "mm",
    "in": "inch", "inch": "inch", "inches": "inch",
}  # fmt: skip

SPAN_M = 2.2

# Limbs of a grown person.
_LIMBS = (
    (("hip", "knee", "ankle"), 0.85, "legs"),
    (("shoulder", "elbow", "wrist"), 0.53, "arms"),
)
# As shares of a grown person: a child and a giant; and what no figure is.
_POSSIBLE = (0.35, 1.65)
_ABSURD = 3.5

# A bone is rigid if its length varies by less than this share.
_RIGID = 0.02


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


def insists(unit: float | str) -> bool:
    """Whether a unit is meant whatever the body says: a number, or with an exclamation mark."""
    return (
        not isinstance(unit, str)
        or unit.removesuffix(INSISTS) not in METRES
        or (unit.endswith(INSISTS))
    )


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
    return Length(span, SPAN_M, "a longest span", sure=False) if 0 < span < np.inf else None


def detect_unit(length: Length, likely: Iterable[str] = METRES) -> str | None:
    """The unit of those likely in which a body is of a person's size, None if it is in none."""
    name = nearest_unit(length, likely)
    least, most = _POSSIBLE
    fits = least < length.units * METRES[name] / length.metres < most
    return name if fits or not length.sure else None


def nearest_unit(length: Length, likely: Iterable[str] = METRES) -> str:
    """The unit of those likely in which a body is nearest to a person's size."""
    return min(likely, key=lambda unit: abs(np.log(length.units * METRES[unit] / length.metres)))


def is_absurd(length: Length, metres: float) -> bool:
    """Whether no person or figure has such a length, if a unit has so many metres."""
    ratio = length.units * metres / length.metres
    return length.sure and not 1 / _ABSURD < ratio < _ABSURD


def _limb(generic: Floats, joints: tuple[str, str, str]) -> float:
    """Median length over frames, mean of the sides that are seen; NaN if neither is."""
    lengths = []
    for side in "lr":
        a, b, c = (generic[:, GENERIC_JOINTS.index(side + joint)] for joint in joints)
        length = np.linalg.norm(a - b, axis=1) + np.linalg.norm(b - c, axis=1)
        length = length[np.isfinite(length)]
        lengths += [float(np.median(length))] if len(length) else []
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
