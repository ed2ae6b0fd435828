"""Units and axes of files: a body becomes metres with y up, once for all formats.

What the caller gives counts before what the file says, that before what the body tells, that
before what the format usually has; it is noted which. Where the caller or the file clearly
contradict the body, neither is taken: that is an error with both readings.

The legs give the unit, see `units`.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.io.normalise import axes
from motionary.io.normalise.units import (
    METRES,
    Length,
    detect_unit,
    doubt_of,
    insists,
    is_absurd,
    measure_body,
    metres_per_unit,
    nearest_unit,
)
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


class _Decision(NamedTuple):
    """An axis, the note on it, and whether the body casts doubt on it."""

    axis: str
    note: str
    is_doubtful: bool = False


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
    metadata : what the file says
    unit, up : what the caller gives, as in `read`

    Raises
    ------
    InvalidInput
        If the caller or the file contradicts the body, or it lies or stands, one cannot know.
    """
    unit = unit if metadata.takes_unit else None
    some = motion.positions[:: 1 + motion.n_frames // _LOOKED_AT]
    sample = replace(motion, positions=some, rotations=None)
    body = sample.generic_positions() if sample.mapping else None
    length = measure_body(body, some, sample.skeleton) if metadata.takes_unit else None
    metres, unit_note = _find_unit(motion.source, metadata, unit, length)
    if unit is None and length is not None:
        unit_note += doubt_of(length, metres)
    stance = None if body is None else axes.find_stance(body)
    found = _find_axis(motion, metadata, up, stance)
    notes = [unit_note] if unit is not None or "unit" in metadata.noted else []
    if up is not None or "up" in metadata.noted or found.is_doubtful:
        notes.append(found.note)
    turned = turn(rescale(motion, metres), found.axis)
    return replace(turned, notes=(*notes, *motion.notes))


def _at_rest(motion: Motion) -> Motion:
    """A rig as it stands when nothing is turned: one frame, by its offsets."""
    skeleton = motion.skeleton
    assert skeleton is not None
    places = np.zeros_like(skeleton.offsets)
    for joint, parent in enumerate(skeleton.parents.tolist()):
        places[joint] = skeleton.offsets[joint] + (places[parent] if parent >= 0 else 0.0)
    return replace(motion, positions=places[None], rotations=None)


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


def _find_unit(
    source: str, metadata: FileMetadata, unit: float | str | None, length: Length | None
) -> tuple[float, str]:
    if unit is not None:
        metres = metres_per_unit(unit)
        if not insists(unit) and length is not None and is_absurd(length, metres):
            raise InvalidInput(
                f"unit {unit} as given makes {length.said(metres)}; "
                f"{_by_body(length, metres)}; say which with --unit (unit=...), and if "
                f"the body is so large, as a number: {metres:g}",
                file=source,
            )
        return metres, f"unit {str(unit).removesuffix(axes.INSISTS)}, as given"
    if metadata.unit is not None:
        metres = METRES[metadata.unit]
        if length is not None and is_absurd(length, metres):
            raise InvalidInput(
                f"says that it is in {metadata.unit}, which makes {length.said(metres)}; "
                f"{_by_body(length, metres)}; say which with --unit (unit=...), and if the body is "
                f"so large, as a number: {metres:g}",
                file=source,
            )
        return metres, f"unit {metadata.unit}, as the file says"
    if length is None:
        return METRES[metadata.usual_unit], f"unit {metadata.usual_unit}, assumed"
    name = detect_unit(length, metadata.likely)
    if name is None:
        metres = length.metres / length.units
        return metres, f"unit {metres:.3g} m, so that the body has {length.said(metres)}"
    return METRES[name], f"unit {name}, by {length.said(METRES[name])}"


def _by_body(length: Length, metres: float) -> str:
    """What the unit is by the body, which refutes one of so many metres."""
    name = nearest_unit(length)
    if is_absurd(length, METRES[name]) or METRES[name] == metres:
        return "by the body it is in no unit that is known"
    return f"by the body it is {name}"


def _find_axis(
    motion: Motion, metadata: FileMetadata, up: str | None, stance: axes.Stance | None
) -> _Decision:
    if up is not None:
        axis = axes.check_up(up)
        other = None if stance is None else stance.refutes(axis)
        if other is not None and not up.strip().endswith(axes.INSISTS):
            raise InvalidInput(
                f"{axis} points up as given, but its head is above its feet along "
                f"{other}; say which with --up {other} or, to insist, --up '{axis}!' (up=...)",
                file=motion.source,
            )
        return _Decision(axis, f"{axis} up, as given")
    usual = metadata.up or metadata.usual_up
    seen = axes.detect_up(stance, usual=usual)
    is_still = (
        stance is not None and seen is not None and axes.is_still(stance, usual=usual, seen=seen)
    )
    found = _find_unstated_axis(motion, metadata, usual, seen, is_still=is_still)
    if metadata.origin and found.axis == usual:
        return _Decision(usual, f"{usual} up, as {metadata.origin} has")
    return found


def _find_unstated_axis(
    motion: Motion, metadata: FileMetadata, usual: str, seen: str | None, *, is_still: bool
) -> _Decision:
    source = motion.source
    if metadata.up is not None and seen not in (None, metadata.up) and not is_still:
        raise InvalidInput(
            f"says that {metadata.up} points up, but its head is above its "
            f"feet along {seen}; say which with --up {metadata.up} or --up {seen} (up=...)",
            file=source,
        )
    if metadata.up is not None:
        stated = "as the file says"
    else:
        stated = "by definition" if metadata.by_definition else "assumed"
    if not is_still:
        by_body = seen is not None and metadata.up is None
        axis = seen or usual
        return _Decision(axis, f"{axis} up, {'by the body' if by_body else stated}")
    if metadata.up is not None or metadata.by_definition:
        note = f"{usual} up, {stated}; the body lies along {seen}, or stands still"
        return _Decision(usual, note, is_doubtful=True)
    if _rest_axis(motion) not in (None, seen):
        raise InvalidInput(
            f"its body stands along {seen}, or lies still where {usual} points up; "
            f"say which with --up {seen} or --up {usual} (up=...)",
            file=source,
        )
    return _Decision(str(seen), f"{seen} up, by the body, which stands or lies still")


def _rest_axis(motion: Motion) -> str | None:
    """The axis along which a rig stands when nothing is turned."""
    skeleton = motion.skeleton
    if skeleton is None or motion.mapping is None or skeleton.ends:
        return None
    stance = axes.find_stance(_at_rest(motion).generic_positions())
    if stance is None:
        return None
    return next((axis for axis in axes.UPS if stance.stands(axis)), None)
