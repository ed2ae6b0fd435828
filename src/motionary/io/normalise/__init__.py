"""Normalising: what readers return becomes metres with y up, sides and gaps as they should be.

Once for all formats. What the caller gives counts before what the file says, that before what the
body tells, that before what the format usually has; it is noted which. Where the caller or the
file clearly contradict the body, neither is taken: that is an error with both readings.
"""

from dataclasses import replace

from motionary.io.normalise.axes import find_axis, find_stance, turn
from motionary.io.normalise.units import FileMetadata, doubt_of, find_unit, measure_body, rescale
from motionary.motion import Motion

__all__ = ["FileMetadata", "normalise"]

# Frames that suffice to see how a body stands.
_LOOKED_AT = 1000


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
    metres, unit_note = find_unit(motion.source, metadata, unit, length)
    if unit is None and length is not None:
        unit_note += doubt_of(length, metres)
    stance = None if body is None else find_stance(body)
    found = find_axis(motion, metadata, up, stance)
    notes = [unit_note] if unit is not None or "unit" in metadata.noted else []
    if up is not None or "up" in metadata.noted or found.is_doubtful:
        notes.append(found.note)
    turned = turn(rescale(motion, metres), found.axis)
    return replace(turned, notes=(*notes, *motion.notes))
