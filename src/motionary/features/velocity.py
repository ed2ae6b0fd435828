"""How fast does a joint move, averaged over a window?

Velocity after the programs of Müller and Röder (2006): forward differences, the last one
repeated, averaged by a boxcar over frames i - ceil(w/2) + 1 ... i + floor(w/2), ends
padded by reflection with the edge repeated.
"""

import math

import numpy as np

from motionary.features.vectors import Floats

# 0.1 s at 120 Hz are 12 frames, whatever rounding makes of the product.
_SLACK = 1e-9


def window_frames(window_s: float, rate_hz: float) -> int:
    """Number of differences in a window; 0 s is one."""
    return max(1, math.ceil(window_s * rate_hz - _SLACK))


def smoothed_velocity(track: Floats, *, width: int, rate_hz: float) -> Floats:
    """Velocity of a track, averaged over `width` forward differences.

    Parameters
    ----------
    track : array, shape (3, frames), metres
    width : differences in the window
    rate_hz : frames per second

    Returns
    -------
    array, shape (3, frames), metres per second; NaN where the window meets a NaN, and of
    a single frame, which shows no movement
    """
    if track.shape[1] == 1:
        return np.full_like(track, np.nan)
    before, after = -(-width // 2) - 1, width // 2
    # Mirroring the differences is turning the track about its end points; a window's sum
    # of differences is then the difference of two positions.
    ahead = 2 * track[:, -1:] - track[:, -2:-1]
    path: Floats = np.pad(
        np.concatenate([track, ahead], axis=1),
        ((0, 0), (before, after)),
        mode="reflect",
        reflect_type="odd",
    )
    result: Floats = path[:, width:] - path[:, :-width]
    result *= rate_hz / width
    missing = np.isnan(path[0])
    if missing.any():
        n_missing = np.concatenate([[0], np.cumsum(missing)])
        result[:, n_missing[width + 1 :] > n_missing[: -width - 1]] = np.nan
    return result
