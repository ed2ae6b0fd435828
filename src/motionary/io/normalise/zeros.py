"""Points at exactly (0, 0, 0) that stand for points that were not seen.

Networks and exports of gaps write them. A point that is at the origin rightly comes there from
beside it, as the root of a trajectory that starts there does, or always lies amid the body, as
the root of poses without a trajectory does.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

# A step from the origin of more than this fraction of the body is none of a point that is there.
_FAR = 0.2
# The origin is amid a body that reaches to either side of it along each axis but for this
# fraction of its size.
_AMID = 0.15
_LOOKED_AT = 500
_MOST_NAMES = 6


def find_zeros(positions: Floats) -> Mask:
    """Which points count as not seen, shape (frames, joints).

    Parameters
    ----------
    positions : array, shape (frames, joints, 3), in any unit and axes
    """
    at_origin: Mask = positions[:, :, 0] == 0
    if at_origin.any():
        at_origin &= (positions[:, :, 1] == 0) & (positions[:, :, 2] == 0)
    if not at_origin.any():
        return at_origin
    whole: Mask = np.all(at_origin, axis=1)
    result = np.zeros_like(at_origin)
    if whole.all():
        return result
    result[whole] = True
    seen = positions[~whole]
    size = _size(seen[:: 1 + len(seen) // _LOOKED_AT])
    for joint in np.flatnonzero(at_origin[~whole].any(axis=0)).tolist():
        result[:, joint] |= _zeros_of(positions, joint, at_origin[:, joint] & ~whole, whole, size)
    return result


def _zeros_of(
    positions: Floats,
    joint: int,
    at_origin: Mask,
    whole: Mask,
    size: float,
) -> Mask:
    """Frames in which one point counts as not seen."""
    there = ~(at_origin | whole)
    if not there.any():
        others = np.delete(positions[~whole], joint, axis=1)
        is_root = _is_amid(others[:: 1 + len(others) // _LOOKED_AT], size)
        return np.zeros_like(at_origin) if is_root else at_origin
    # The nearest frames before and after that have the point elsewhere.
    frames = np.flatnonzero(there)
    zeros = np.flatnonzero(at_origin)
    after = np.searchsorted(frames, zeros)
    distance = np.linalg.norm(positions[:, joint], axis=1)
    before_m = np.where(after > 0, distance[frames[np.maximum(after - 1, 0)]], np.inf)
    after_m = np.where(
        after < len(frames), distance[frames[np.minimum(after, len(frames) - 1)]], np.inf
    )
    result = np.zeros(len(positions), dtype=bool)
    result[zeros[np.minimum(before_m, after_m) > _FAR * size]] = True
    return result


def _is_amid(others: Floats, size: float) -> bool:
    """Whether the origin is inside of a body."""
    others = np.where(others.any(axis=2, keepdims=True), others, np.nan)
    if not others.shape[1] or np.isnan(others).all():
        return True
    low, high = np.nanmin(others, axis=(0, 1)), np.nanmax(others, axis=(0, 1))
    return bool((low < _AMID * size).all() and (high > -_AMID * size).all())


def _size(positions: Floats) -> float:
    """Largest extent of a body, median over frames."""
    points = np.where(positions.any(axis=2, keepdims=True), positions, np.nan)
    some = ~np.isnan(points).all(axis=(1, 2))
    if not some.any():
        return 0.0
    extents = np.nanmax(points[some], axis=1) - np.nanmin(points[some], axis=1)
    return float(np.nanmedian(np.nanmax(extents, axis=1)))


def unsee_zeros(positions: Floats, names: Sequence[str]) -> tuple[Floats, tuple[str, ...]]:
    """Positions with NaN for points that stand at the origin unseen, and notes on them."""
    zeros = find_zeros(positions)
    if not zeros.any():
        return positions, ()
    positions = np.where(zeros[:, :, None], np.nan, positions)
    return positions, tuple(_notes(zeros, names))


def _notes(zeros: Mask, names: Sequence[str]) -> list[str]:
    whole = zeros.all(axis=1)
    notes = []
    if whole.any():
        frames = "1 frame has" if whole.sum() == 1 else f"{whole.sum()} frames have"
        notes.append(f"{frames} all points at zero, which counts as not seen")
    concerned = [names[i] for i in np.flatnonzero(zeros[~whole].any(axis=0)).tolist()]
    if concerned:
        said = ", ".join(concerned[:_MOST_NAMES])
        said += ", ..." if len(concerned) > _MOST_NAMES else ""
        notes.append(f"points at exactly zero count as not seen: {said}")
    return notes
