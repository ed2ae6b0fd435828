"""Points that were not seen: zeros that stand for them, and gaps to fill.

A point at exactly (0, 0, 0), as networks and exports of gaps write it, counts as not seen. One
that is at the origin rightly comes there from beside it, as the root of a trajectory that starts
there does, or always lies amid the body, as the root of poses without a trajectory does.

A gap is a run of frames in which a point is not seen, between frames in which it is. Cubic:
the point leaves and arrives with the velocity that it has in a few frames on either side.
Linear: it takes the straight way. Gaps at the ends, and longer ones, stay.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, check_choice
from motionary.motion import Motion
from motionary.recording import find_runs

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

Filling = Literal["cubic", "linear"]
FILLINGS: tuple[str, ...] = get_args(Filling)

# Velocities are those of a line through what is seen within this time of a gap.
_AROUND_S = 0.05


class _Gap(NamedTuple):
    """Frames `start` to `stop` (half-open) of a point, seen before and after."""

    point: int
    start: int
    stop: int


def check_filling(fill_by: str, longest_s: float | None = None) -> None:
    """Refuse what is none of `FILLINGS`, and a length that is not above 0.

    Raises
    ------
    InvalidInput
    """
    check_choice(fill_by, FILLINGS, name="fill_by")
    if longest_s is not None and not 0 < longest_s < np.inf:
        raise InvalidInput(f"fill_gaps_s must be a number of seconds above 0, got {longest_s}")


def fill_gaps(motion: Motion, *, longest_s: float, fill_by: str = "cubic") -> Motion:
    """The motion with its short gaps filled, and a note that counts them.

    Parameters
    ----------
    motion : NaN = not seen
    longest_s : gaps up to this many seconds are filled
    fill_by : one of `FILLINGS`

    Raises
    ------
    InvalidInput
        If `longest_s` is not above 0, or there is no such way to fill.
    """
    check_filling(fill_by, longest_s)
    gaps, n_open = _find_gaps(motion.positions)
    # Frames of a gap as long as the limit, whatever the rounding of the rate.
    most = int(longest_s * motion.rate_hz + 1e-6)
    short = [gap for gap in gaps if gap.stop - gap.start <= most]
    kept = len(gaps) - len(short) + n_open
    positions = motion.positions.copy() if short else motion.positions
    around = max(1, round(_AROUND_S * motion.rate_hz))
    for point, start, stop in short:
        track = motion.positions[:, point]
        if fill_by == "cubic":
            positions[start:stop, point] = _fill_cubic(track, start, stop, around)
        else:
            positions[start:stop, point] = _fill_linearly(track, start, stop)
    note = _describe(short, kept, longest_s, fill_by)
    return replace(motion, positions=positions, notes=(*motion.notes, note))


def _find_gaps(positions: Floats) -> tuple[list[_Gap], int]:
    """Gaps between seen frames, and how many there are at the ends of points ever seen."""
    gaps = []
    n_open = 0
    unseen: Mask = np.asarray(np.isnan(positions).any(axis=2))
    for point in np.flatnonzero(unseen.any(axis=0) & ~unseen.all(axis=0)).tolist():
        for start, stop in find_runs(unseen[:, point]).tolist():
            if start == 0 or stop == len(positions):
                n_open += 1
            else:
                gaps.append(_Gap(point, start, stop))
    return gaps, n_open


def _fill_linearly(track: Floats, start: int, stop: int) -> Floats:
    """Places in the gap on the straight way, shape (frames of the gap, 3)."""
    before, after = track[start - 1], track[stop]
    u = np.arange(1, stop - start + 1)[:, None] / (stop - start + 1)
    line: Floats = before + u * (after - before)
    return line


def _fill_cubic(track: Floats, start: int, stop: int, around: int) -> Floats:
    """Places in the gap on a Hermite cubic, shape (frames of the gap, 3)."""
    before, after = track[start - 1], track[stop]
    length = stop - start + 1
    leaves = _velocity(track[max(0, start - 1 - around) : start][::-1])
    arrives = _velocity(track[stop : stop + 1 + around])
    chord = (after - before) / length
    first = chord if leaves is None else -leaves
    last = chord if arrives is None else arrives
    u = np.arange(1, length)[:, None] / length
    cubic: Floats = (
        (1 + 2 * u) * (1 - u) ** 2 * before
        + u * (1 - u) ** 2 * length * first
        + u**2 * (3 - 2 * u) * after
        + u**2 * (u - 1) * length * last
    )
    return cubic


def _velocity(places: Floats) -> Floats | None:
    """Steps per frame away from the gap over the frames seen next to it; None of one frame."""
    unseen = np.flatnonzero(np.isnan(places).any(axis=1))
    seen = places[: unseen[0]] if len(unseen) else places
    if len(seen) < 2:
        return None
    at = np.arange(len(seen)) - (len(seen) - 1) / 2
    slope: Floats = (at[:, None] * seen).sum(axis=0) / (at**2).sum()
    return slope


def _describe(short: list[_Gap], n_kept: int, longest_s: float, fill_by: str) -> str:
    if not short:
        return f"no gaps up to {longest_s:g} s to fill; {n_kept} longer or at the ends are kept"
    n_frames = sum(gap.stop - gap.start for gap in short)
    n_points = len({gap.point for gap in short})
    gaps = "1 gap" if len(short) == 1 else f"{len(short)} gaps"
    frames = "1 frame" if n_frames == 1 else f"{n_frames} frames"
    points = "1 point" if n_points == 1 else f"{n_points} points"
    return (
        f"{gaps} up to {longest_s:g} s filled ({fill_by}), {frames} of {points}; {n_kept} longer "
        "or at the ends are kept"
    )


# -- points at zero -----------------------------------------------------------------------


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


def _zeros_of(positions: Floats, joint: int, at_origin: Mask, whole: Mask, size: float) -> Mask:
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
