"""How do points of a file become a motion in metres with y up?

Shared by the formats that hold points without a tree of joints. What the caller says
counts before what the file says, that before what the body tells, and it is noted which.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.motion.axes import check_up, detect_up, turn_up
from motionary.io.motion.units import LEG_M, METRES, metres_per_unit
from motionary.motion import GENERIC_JOINTS, Event, JointMapping, Motion
from motionary.skeletons import find_mapping

Floats = NDArray[np.float64]

# Frames that suffice to see which way a body stands.
_LOOKED_AT = 2000
#: No unit is so small that a person is this many of them away.
FARTHEST = 1e9
# Units that formats of points are in.
_LIKELY = ("m", "cm", "mm", "inch")


@dataclass(frozen=True, slots=True)
class Points:
    """Content of a file, in its own unit and axes.

    Attributes
    ----------
    names : one unique name per point
    positions : array, shape (frames, points, 3); NaN = not seen; given away: it is changed
    rate_hz, source, first_frame, events, notes : as in `Motion`
    unit, up : what the file says; None where it does not
    usual_unit, usual_up : what the format usually is, where the body does not tell either
    mapping : None where the names decide
    """

    names: list[str]
    positions: Floats
    rate_hz: float
    source: str
    first_frame: int = 0
    unit: str | None = None
    up: str | None = None
    usual_unit: str = "mm"
    usual_up: str = "z"
    events: tuple[Event, ...] = ()
    notes: tuple[str, ...] = ()
    mapping: JointMapping | None = field(default=None)


def to_motion(points: Points, *, unit: float | str | None, up: str | None) -> Motion:
    """The motion that the points are.

    Parameters
    ----------
    points : content of the file; its positions are changed
    unit, up : what the caller says, as in `read`

    Raises
    ------
    InvalidInput
        If the caller contradicts himself, or file and body contradict each other.
    UnreadableFile
        If there is no frame, or numbers are so large that no body can be meant.
    """
    positions = points.positions
    if not len(positions):
        raise UnreadableFile(f"{points.source}: holds no frames")
    # Comparing with NaN is False: what is not seen is not too far away.
    if (np.abs(positions) > FARTHEST).any():
        raise UnreadableFile(f"{points.source}: has impossibly large numbers")
    names = tuple(points.names)
    mapping = points.mapping or find_mapping(names)
    some = positions[:: 1 + len(positions) // _LOOKED_AT]
    body = Motion(names, some, 1.0, mapping).generic_positions() if mapping else None
    metres, unit_note = _settle_unit(points, unit, body)
    axis, up_note = _settle_up(points, up, body)
    positions *= metres
    return Motion(
        names=names,
        positions=turn_up(positions, axis),
        rate_hz=points.rate_hz,
        mapping=mapping,
        source=points.source,
        first_frame=points.first_frame,
        events=points.events,
        notes=(unit_note, up_note, *points.notes),
    )


def number_doubles(names: list[str]) -> list[str]:
    """Names, the second and further of a kind with a number."""
    taken, result = set(names), []
    counts: dict[str, int] = {}
    for name in names:
        counts[name] = counts.get(name, 0) + 1
        if counts[name] > 1:
            while f"{name} ({counts[name]})" in taken:
                counts[name] += 1
            name = f"{name} ({counts[name]})"
            taken.add(name)
        result.append(name)
    return result


def _settle_unit(
    points: Points, unit: float | str | None, body: Floats | None
) -> tuple[float, str]:
    if unit is not None:
        return metres_per_unit(unit), f"unit {unit}, as told"
    if points.unit is not None:
        return METRES[points.unit], f"unit {points.unit}, as the file says"
    leg = _leg(body) if body is not None else np.nan
    if leg > 0:
        name = min(_LIKELY, key=lambda u: abs(np.log(leg * METRES[u] / LEG_M)))
        return METRES[name], f"unit {name}, by legs of {leg * METRES[name]:.2f} m"
    return METRES[points.usual_unit], f"unit {points.usual_unit}, assumed"


def _leg(body: Floats) -> float:
    """Length of a leg in file units: median over frames, mean of both sides."""
    lengths = []
    for side in "lr":
        hip, knee, ankle = (
            body[:, GENERIC_JOINTS.index(side + joint)] for joint in ("hip", "knee", "ankle")
        )
        length = np.linalg.norm(hip - knee, axis=1) + np.linalg.norm(knee - ankle, axis=1)
        lengths += (
            [float(np.median(length[~np.isnan(length)]))] if np.isfinite(length).any() else []
        )
    return float(np.mean(lengths)) if lengths else np.nan


def _settle_up(points: Points, up: str | None, body: Floats | None) -> tuple[str, str]:
    if up is not None:
        axis = check_up(up)
        return axis, f"{axis} up, as told"
    usual = points.up or points.usual_up
    seen = detect_up(body, usual=usual) if body is not None else None
    if points.up is not None and seen not in (None, points.up):
        raise InvalidInput(
            f"{points.source}: says that {points.up} points up, but its head is above its "
            f"feet along {seen}; say which with --up {points.up} or --up {seen} (up=...)"
        )
    told_by = "as the file says" if points.up else "by the body" if seen else "assumed"
    return seen or usual, f"{seen or usual} up, {told_by}"
