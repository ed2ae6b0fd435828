"""In which unit and along which axis does a file's body stand, and how does it become metres?

Shared by all formats. What the caller says counts before what the file says, that before what
the body tells, that before what the format usually has; it is noted which. Where the caller or
the file clearly contradict the body, neither is taken: that is an error with both readings.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.normalise import axes, units
from motionary.motion import Motion, Skeleton
from motionary.rotations import matrices_to_quaternions, multiply_quaternions

Floats = NDArray[np.float64]

# Frames that suffice to see how a body stands.
_LOOKED_AT = 1000


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
    """

    unit: str | None = None
    up: str | None = None
    usual_unit: str = "m"
    usual_up: str = "y"
    likely: tuple[str, ...] = tuple(units.METRES)
    by_definition: bool = False


class Normalised(NamedTuple):
    """Metres per unit, the axis that is up, and a note on each."""

    metres: float
    up: str
    notes: tuple[str, ...]


def normalise(
    motion: Motion,
    metadata: FileMetadata,
    *,
    unit: float | str | None = None,
    up: str | None = None,
) -> Motion:
    """The motion in metres with y up.

    Parameters
    ----------
    motion : in the file's unit and axes; its positions are changed
    claims : what the file says
    unit, up : what the caller says, as in `read`

    Raises
    ------
    InvalidInput
        If the caller or the file contradicts the body, or it lies or stands, one cannot know.
    """
    normalised = settle_claims(motion, metadata, unit=unit, up=up)
    scaled = rescale(motion, normalised.metres)
    return replace(turn(scaled, normalised.up), notes=(*normalised.notes, *motion.notes))


def settle_claims(
    motion: Motion, metadata: FileMetadata, *, unit: float | str | None, up: str | None
) -> Normalised:
    """What `settle` would do; errors are the same."""
    some = replace(
        motion, positions=motion.positions[:: 1 + motion.n_frames // _LOOKED_AT], rotations=None
    )
    body = some.generic_positions() if some.mapping else None
    length = units.measure_body(body, some.positions, some.skeleton)
    metres, unit_note = _normalise_unit(motion.source, metadata, unit, length)
    stance = None if body is None else axes.find_stance(body)
    axis, up_note = _normalise_up(motion, metadata, up, stance)
    return Normalised(metres, axis, (unit_note, up_note))


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


def turn(motion: Motion, up: str) -> Motion:
    """The motion with y up, of one in which `up` is; of a rig, the roots turn."""
    if axes.check_up(up) == "y":
        return motion
    skeleton, rotations = motion.skeleton, motion.rotations
    if skeleton is not None:
        roots = skeleton.parents < 0
        offsets = skeleton.offsets.copy()
        offsets[roots] = axes.turn_up(offsets[roots], up)
        skeleton = Skeleton(skeleton.names, skeleton.parents, offsets, ends=skeleton.ends)
        if rotations is not None:
            world = matrices_to_quaternions(axes.turn_up(np.eye(3), up).T)
            rotations = rotations.copy()
            rotations[:, roots] = multiply_quaternions(world, rotations[:, roots])
    return replace(
        motion,
        positions=axes.turn_up(motion.positions, up),
        skeleton=skeleton,
        rotations=rotations,
    )


def _normalise_unit(
    source: str, metadata: FileMetadata, unit: float | str | None, length: units.Length | None
) -> tuple[float, str]:
    if unit is not None:
        metres = units.metres_per_unit(unit)
        if not units.insists(unit) and length is not None and units.is_absurd(length, metres):
            raise InvalidInput(
                f"{source}: is told to be in {unit}, which makes {length.said(metres)}; by the "
                f"body it is {units.nearest_unit(length)}; say which with --unit (unit=...), and "
                f"if the body is so large, as a number: {metres:g}"
            )
        return metres, f"unit {str(unit).removesuffix(axes.INSISTS)}, as told"
    if metadata.unit is not None:
        metres = units.METRES[metadata.unit]
        if length is not None and units.is_absurd(length, metres):
            raise InvalidInput(
                f"{source}: says that it is in {metadata.unit}, which makes {length.said(metres)}; "
                f"by the body it is {units.nearest_unit(length)}; say which with --unit "
                f"(unit=...), and if the body is so large, as a number: {metres:g}"
            )
        return metres, f"unit {metadata.unit}, as the file says"
    if length is None:
        return units.METRES[metadata.usual_unit], f"unit {metadata.usual_unit}, assumed"
    name = units.detect_unit(length, metadata.likely)
    if name is None:
        metres = length.metres / length.units
        return metres, f"unit {metres:.3g} m, so that the body has {length.said(metres)}"
    return units.METRES[name], f"unit {name}, by {length.said(units.METRES[name])}"


def _normalise_up(
    motion: Motion, metadata: FileMetadata, up: str | None, stance: axes.Stance | None
) -> tuple[str, str]:
    source = motion.source
    if up is not None:
        axis = axes.check_up(up)
        other = None if stance is None else stance.refutes(axis)
        if other is not None and not up.strip().endswith(axes.INSISTS):
            raise InvalidInput(
                f"{source}: is told that {axis} points up, but its head is above its feet along "
                f"{other}; say which with --up {other} or, to insist, --up '{axis}!' (up=...)"
            )
        return axis, f"{axis} up, as told"
    usual = metadata.up or metadata.usual_up
    seen = axes.detect_up(stance, usual=usual)
    still = (
        stance is not None and seen is not None and axes.is_still(stance, usual=usual, seen=seen)
    )
    if metadata.up is not None and seen not in (None, metadata.up) and not still:
        raise InvalidInput(
            f"{source}: says that {metadata.up} points up, but its head is above its "
            f"feet along {seen}; say which with --up {metadata.up} or --up {seen} (up=...)"
        )
    if still:
        if metadata.up is not None or metadata.by_definition:
            told_by = "as the file says" if metadata.up is not None else "by definition"
            return usual, f"{usual} up, {told_by}; the body lies along {seen}, or stands still"
        if _rest_axis(motion) not in (None, seen):
            raise InvalidInput(
                f"{source}: its body stands along {seen}, or lies still where {usual} points up; "
                f"say which with --up {seen} or --up {usual} (up=...)"
            )
        return str(seen), f"{seen} up, by the body, which stands or lies still"
    if metadata.up is not None:
        told_by = "as the file says"
    elif seen is not None:
        told_by = "by the body"
    else:
        told_by = "by definition" if metadata.by_definition else "assumed"
    return seen or usual, f"{seen or usual} up, {told_by}"


def _rest_axis(motion: Motion) -> str | None:
    """The axis along which a rig stands when nothing is turned."""
    skeleton = motion.skeleton
    if skeleton is None or motion.mapping is None or skeleton.ends:
        return None
    places = np.zeros_like(skeleton.offsets)
    for joint, parent in enumerate(skeleton.parents.tolist()):
        places[joint] = skeleton.offsets[joint] + (places[parent] if parent >= 0 else 0.0)
    rest = Motion(motion.names, places[None], 1.0, motion.mapping)
    stance = axes.find_stance(rest.generic_positions())
    if stance is None:
        return None
    return next((axis for axis in axes.UPS if stance.stands(axis)), None)
