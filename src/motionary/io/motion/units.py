"""How long is a unit of a file that does not say it?

By the legs: hip to knee to ankle is about 0.85 m in a grown person. The candidates lie
more than a factor of two apart, so a child is still told from a giant. Without a known
skeleton, the longest way through the body from end to end is taken for 2.2 m.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.motion import JointMapping, Skeleton

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

LEG_M = 0.85
SPAN_M = 2.2

# A bone is rigid if its length varies by less than this share.
_RIGID = 0.02


def metres_per_unit(unit: float | str) -> float:
    """Metres of a unit given by name or as a number.

    Raises
    ------
    InvalidInput
        If the name is unknown or the number not positive.
    """
    if isinstance(unit, str) and unit in METRES:
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


def detect_unit(
    positions: Floats, names: tuple[str, ...], skeleton: Skeleton, mapping: JointMapping | None
) -> tuple[str, str] | None:
    """Unit of joint positions by the size of the body, and how it was told.

    Parameters
    ----------
    positions : array, shape (frames, joints, 3), file units; some frames suffice
    names, skeleton, mapping : as in a `Motion`

    Returns
    -------
    name of the unit and a phrase such as "legs of 0.86 m", or None without a body
    """
    length, expected, what = _leg(positions, names, mapping), LEG_M, "legs"
    if not length > 0:
        length, expected, what = _span(positions, skeleton), SPAN_M, "a longest span"
    if not 0 < length < np.inf:
        return None
    name = min(METRES, key=lambda unit: abs(np.log(length * METRES[unit] / expected)))
    return name, f"{what} of {length * METRES[name]:.2f} m"


def _leg(positions: Floats, names: tuple[str, ...], mapping: JointMapping | None) -> float:
    """Median length of the legs, 0 if they are not known."""
    if mapping is None:
        return 0.0
    index = {name: i for i, name in enumerate(names)}
    legs = []
    for side in "lr":
        sources = [mapping.weights.get(f"{side}{joint}", {}) for joint in ("hip", "knee", "ankle")]
        joints = [index[name] for source in sources for name in source if name in index]
        if len(joints) == len(sources):
            hip, knee, ankle = (positions[:, joint] for joint in joints)
            legs.append(_distance(hip, knee) + _distance(knee, ankle))
    return float(np.mean(legs)) if legs else 0.0


def _distance(a: Floats, b: Floats) -> float:
    return float(np.median(np.linalg.norm(a - b, axis=-1)))


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
