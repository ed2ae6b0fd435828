"""How do points of a file become a motion in metres with y up?

Shared by the formats that hold points without a tree of joints.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.errors import UnreadableFile
from motionary.io.normalise.body_frame import FileMetadata, normalise
from motionary.motion import Event, JointMapping, Motion
from motionary.skeletons import SkeletonTable, find_mapping

Floats = NDArray[np.float64]

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
    mapping, skeleton : None where the names decide
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
    mapping: JointMapping | None = None
    skeleton: SkeletonTable | None = None


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
    metadata = FileMetadata(points.unit, points.up, points.usual_unit, points.usual_up, _LIKELY)
    motion = Motion(
        names=names,
        positions=positions,
        rate_hz=points.rate_hz,
        mapping=points.mapping or find_mapping(names, None, positions, told=points.skeleton),
        source=points.source,
        first_frame=points.first_frame,
        events=points.events,
        notes=points.notes,
    )
    return normalise(motion, metadata, unit=unit, up=up)


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
