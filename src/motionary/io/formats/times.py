"""Rates and times of frames, as files print them: rounded, with gaps, and sometimes wrong."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.formats.content import MOST_RATE_HZ, RATE_HINT, FileContent, number_doubles
from motionary.io.normalise.units import FileMetadata
from motionary.io.options import ReadOptions
from motionary.rotations import Floats

# Times beyond are none that a clock shows, and numbers beyond none of frames.
_LATEST_S = 1e9
_LAST_FRAME = 1e15

# Rates are printed rounded: within this fraction of a whole number they are that number, but
# video's rates lie just as near: 29.97 is 30 / 1.001. A hair above 0.1 %: .0333 is 30.
_ROUNDING = 1.001e-3
_VIDEO_HZ = (24, 30, 48, 60, 120)

# Rates of cameras and programs, where printed digits leave several.
_USUAL_HZ = (24.0, 25.0, 30.0, 50.0, 60.0, 90.0, 100.0, 120.0, 144.0, 150.0, 200.0, 240.0)

# Steps that differ by less than this fraction of one are even.
_EVEN = 0.02
# A rate and the times belong together up to the first; beyond the second one of them is wrong.
_SAME_RATE = 2e-4
_OTHER_RATE = 0.1
# On an even grid: nearer than this to a frame, in steps, it is that frame; between frames that
# are further apart nothing was seen; a grid this many times as long comes from damaged times.
_ON_FRAME = 0.05
_NEIGHBOURS = 2.0
_MOST_FILLED = 1000


class TimedFrames(NamedTuple):
    """Frames at one rate, and what there is to say about their times."""

    positions: Floats
    rate_hz: float
    notes: tuple[str, ...]


def timed_content(
    names: Sequence[str],
    positions: Floats,
    times: Floats | None,
    options: ReadOptions,
    *,
    metadata: FileMetadata,
    stated_hz: float = np.nan,
    first_frame: float = 0,
    notes: Sequence[str] = (),
) -> FileContent:
    """Content of points, at the rate of `time_frames`, or where there are no times as stated.

    The number of the first frame may be NaN.
    """
    if times is None:
        timed = TimedFrames(positions, options.rate_hz or stated_hz, ())
    else:
        timed = time_frames(positions, times, options=options, stated_hz=stated_hz)
    return FileContent(
        names=number_doubles(names),
        positions=timed.positions,
        rate_hz=timed.rate_hz,
        metadata=metadata,
        # Comparing with NaN is False.
        first_frame=int(first_frame) if abs(first_frame) < _LAST_FRAME else 0,
        notes=(*notes, *timed.notes),
    )


def time_frames(
    positions: Floats, times: Floats, *, options: ReadOptions, stated_hz: float = np.nan
) -> TimedFrames:
    """Frames at the rate that their times tell, on an even grid of it where asked for.

    Times that run backward, that give no rate where none is stated, or that contradict the one
    that is stated, are errors.

    Parameters
    ----------
    positions, times : arrays, shape (frames, points, 3) and (frames,), seconds as printed
    options : `rate_hz` goes before all times, `even_times` asks for the grid
    stated_hz : what the file's header says; NaN for nothing
    """
    if options.rate_hz is not None and not options.even_times:
        return TimedFrames(positions, options.rate_hz, ())
    timed, unevenness = rate_of_times(times)
    uneven = unevenness > _EVEN
    notes: tuple[str, ...] = ()
    if uneven:
        _refuse_backward(times)
        timed = _rate_between_gaps(times)
    if options.rate_hz is not None:
        rate = options.rate_hz
    else:
        rate, notes = _agree(stated_hz, timed, times)
    if options.even_times:
        return TimedFrames(_resample(positions, times, rate), rate, notes)
    if uneven:
        notes = (*notes, _say_unevenness(times, rate))
    return TimedFrames(positions, rate, notes)


def _agree(stated_hz: float, timed: float, times: Floats) -> tuple[float, tuple[str, ...]]:
    """The rate of header and times, and a note where they differ a little."""
    if not 0 < stated_hz < MOST_RATE_HZ:
        if not 0 < timed < MOST_RATE_HZ:
            raise UnreadableFile(f"says no rate, and its times give no frame rate; {RATE_HINT}")
        whole = float(round(timed))
        return (whole if abs(whole / timed - 1) < _SAME_RATE else round(timed, 6)), ()
    if np.isnan(timed) or _allow(times, stated_hz, timed):
        return stated_hz, ()
    if abs(timed / stated_hz - 1) > _OTHER_RATE:
        raise InvalidInput(
            f"says {stated_hz:g} frames per second, its times {timed:.4g}; pass the "
            "right one with --rate (rate_hz=...)"
        )
    note = (
        f"the header says {stated_hz:g} frames per second, the times {timed:.5g}: the times count"
    )
    return timed, (note,)


def _allow(times: Floats, stated_hz: float, timed: float) -> bool:
    """Whether times, printed as they are, may be those of a rate."""
    if abs(timed / stated_hz - 1) <= _SAME_RATE:
        return True
    steps = np.diff(times[~np.isnan(times)])
    unit = _printed_unit(times[~np.isnan(times)])
    # Where steps are even, rounding touches the first and the last time only.
    even = len(steps) > 0 and (np.abs(steps - steps.mean()) <= unit + 1e-9).all()
    n = len(steps) if even else 1
    return bool(abs(n / timed - n / stated_hz) <= unit + 1e-9)


def _refuse_backward(times: Floats) -> None:
    back = np.flatnonzero(np.diff(times) < 0)
    if len(back):
        i = int(back[0])
        raise UnreadableFile(
            f"time runs backward after frame {i + 1} of the table, from {times[i]:g} to "
            f"{times[i + 1]:g} s; put its frames in order, or pass --rate (rate_hz=...) to read "
            "them as they stand"
        )


def _rate_between_gaps(times: Floats) -> float:
    """Frames per second where no frame is missing."""
    steps = np.diff(times[~np.isnan(times)])
    steps = steps[steps > 0]
    kept = steps[steps < 1.5 * np.median(steps)]
    return float(len(kept) / kept.sum())


def _say_unevenness(times: Floats, rate: float) -> str:
    steps = np.diff(times) * rate
    gaps = np.flatnonzero(steps > 1.5)
    if not len(gaps):
        low, high = np.nanmin(steps) / rate * 1e3, np.nanmax(steps) / rate * 1e3
        return (
            f"frames are not evenly spaced in time, {low:.3g} to {high:.3g} ms apart, and are read "
            "as if they were; --even-times (even_times=True) resamples them"
        )
    n = int(np.round(steps[gaps] - 1).sum())
    first = int(gaps[0])
    more = f", and in {len(gaps) - 1} further gaps" if len(gaps) > 1 else ""
    return (
        f"the times have a gap: {n} {'frame is' if n == 1 else 'frames are'} missing between "
        f"{times[first]:g} and {times[first + 1]:g} s{more}; --even-times (even_times=True) puts "
        "the others at their own times"
    )


def _resample(positions: Floats, times: Floats, rate: float) -> Floats:
    """Positions at even times; NaN where no frame is near on both sides."""
    if np.isnan(times).any():
        raise UnreadableFile("some frames have no time, so they cannot be put evenly")
    steps, kept = np.unique((times - times[0]) * rate, return_index=True)
    _refuse_backward(times)
    n_frames = int(np.floor(steps[-1] + 0.5)) + 1
    if n_frames > _MOST_FILLED * len(times):
        raise UnreadableFile(
            f"its times reach over {steps[-1] / rate:g} s, {n_frames} frames of which "
            f"{len(times)} are there; correct the times"
        )
    if len(steps) < 2:
        return positions[kept]
    grid = np.arange(n_frames)
    right = np.searchsorted(steps, grid - _ON_FRAME).clip(1, len(steps) - 1)
    left = right - 1
    span = steps[right] - steps[left]
    fraction = (grid - steps[left]) / span
    fraction[np.abs(grid - steps[left]) <= _ON_FRAME] = 0
    fraction[np.abs(grid - steps[right]) <= _ON_FRAME] = 1
    before, after = positions[kept[left]], positions[kept[right]]
    weight = fraction[:, None, None]
    with np.errstate(invalid="ignore"):
        result: Floats = before * (1 - weight) + after * weight
    result = np.where(weight == 0, before, np.where(weight == 1, after, result))
    between = (fraction != 0) & (fraction != 1)
    result[between & ((span > _NEIGHBOURS) | (fraction < 0) | (fraction > 1))] = np.nan
    return result


def rate_of_frame_time(frame_time_s: float) -> float:
    """Frames per second of a printed time per frame; NaN where it gives none."""
    if not frame_time_s > 1 / MOST_RATE_HZ:
        return np.nan
    rate = 1 / frame_time_s
    usual = [float(round(rate)), *(hz / 1.001 for hz in _VIDEO_HZ)]
    nearest = min(usual, key=lambda hz: abs(hz - rate))
    return nearest if abs(frame_time_s * nearest - 1) <= _ROUNDING else rate


def usual_rate(printed: str, time_s: float, rate_hz: float) -> float | None:
    """The usual rate that a frame time of few digits stands for; None if it tells its own."""
    unit = 10.0 ** -len(printed.partition(".")[2])
    if not printed.replace(".", "", 1).isdecimal() or rate_hz == round(rate_hz) or unit >= time_s:
        return None
    fits = [hz for hz in _USUAL_HZ if abs(1 / hz - time_s) <= unit / 2]
    return min(fits, key=lambda hz: abs(hz - rate_hz), default=None)


def rate_of_times(times: Floats) -> tuple[float, float]:
    """Frames per second by the times of frames, and how uneven they are; NaN for no rate.

    Times are printed rounded: steps that differ by no more than that are even.

    Returns
    -------
    rate : frames over the time from first to last where steps are even, a whole number where
        the printed times allow one; else one over the median step
    unevenness : largest difference of a step from the median, as a fraction of it; 0 where
        rounding explains it
    """
    times = times[~np.isnan(times)]
    steps = np.diff(times) if (np.abs(times) < _LATEST_S).all() else np.empty(0)
    step = float(np.median(steps)) if len(steps) else np.nan
    if not 1e-6 < step < 1e6:
        return np.nan, np.nan
    unit = _printed_unit(times)
    span = float(times[-1] - times[0])
    mean = span / len(steps)
    if unit and mean > unit and (np.abs(steps - mean) <= unit + 1e-9).all():
        low, high = len(steps) / (span + unit), len(steps) / (span - unit)
        whole = float(round(1 / mean))
        return whole if low <= whole <= high else 1 / mean, 0.0
    return 1 / step, float(np.abs(steps / step - 1).max())


def _printed_unit(times: Floats) -> float:
    """Unit of the last decimal that times were printed with; 0 if they have many decimals."""
    for decimals in range(1, 6):
        scaled = times * 10.0**decimals
        if (np.abs(scaled - np.round(scaled)) < 1e-6 * np.maximum(1.0, np.abs(scaled))).all():
            return float(10.0**-decimals)
    return 0.0
