"""Positions at even times, of positions that arrive when they like.

Conventions: times in seconds of the sender's clock; even times count from the first one.
"""

import math

import numpy as np

from motionary.errors import InvalidInput
from motionary.features.body import Floats

#: Positions that are farther apart in time leave a gap between them.
MOST_GAP_S = 0.25
#: Two poses of one recording are not farther apart: a gap fills memory, and time.
MOST_JUMP_S = 60.0
# A time so near to an even one is that one: clocks round to microseconds, and seconds since
# 1970 have no more digits.
_SLACK_S = 1e-6


class EvenTimes:
    """Positions at an even rate, a straight line between neighbours in time.

    Parameters
    ----------
    rate_hz : of the positions that come out
    """

    REMEMBERED = ("_first_s", "_last_s", "_last", "_n_given")

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self._first_s: float | None = None
        self._last_s = -math.inf
        self._last: Floats = np.empty(0)
        self._n_given = 0

    def push(self, positions: Floats, times_s: Floats) -> Floats:
        """Positions at the even times up to the last of these, shape (new frames, ...).

        Parameters
        ----------
        positions : array, shape (frames, joints, 3), NaN = not seen
        times_s : array, shape (frames,)

        Raises
        ------
        InvalidInput
            If a time is not a number, not later than the one before, or so much later that
            it is another recording's; nothing is kept then.
        """
        before = np.concatenate([[self._last_s], times_s[:-1]])
        if not np.isfinite(times_s).all() or not (times_s > before).all():
            wrong = np.flatnonzero(~(np.isfinite(times_s) & (times_s > before)))[0]
            raise InvalidInput(
                f"times must grow, got {times_s[wrong]} s after {before[wrong]} s: is the sender's "
                "clock going backwards? A new recording needs a new annotator"
            )
        if len(times_s) == 0:
            return positions
        jumps = np.diff(times_s, prepend=times_s[0] if self._first_s is None else self._last_s)
        if jumps.max() > MOST_JUMP_S:
            raise InvalidInput(
                f"times must be seconds, at most {MOST_JUMP_S:g} s apart, got poses that are "
                f"{jumps.max():g} s apart; a new recording needs a new annotator"
            )
        if self._first_s is None:
            self._first_s = float(times_s[0])
        else:
            positions = np.concatenate([self._last[np.newaxis], positions])
            times_s = np.concatenate([[self._last_s], times_s])
        self._last, self._last_s = positions[-1], float(times_s[-1])
        elapsed = (times_s - self._first_s) * self.rate_hz
        slack = _SLACK_S * self.rate_hz
        numbers = np.arange(self._n_given, math.floor(elapsed[-1] + slack) + 1)
        self._n_given += len(numbers)
        if len(times_s) == 1:
            return positions[: len(numbers)]
        right = np.clip(np.searchsorted(elapsed, numbers - slack), 1, len(elapsed) - 1)
        span = (elapsed[right] - elapsed[right - 1])[:, np.newaxis, np.newaxis]
        along = (numbers - elapsed[right - 1])[:, np.newaxis, np.newaxis] / span
        is_right = (numbers > elapsed[right - 1]) & (elapsed[right] - numbers <= slack)
        along[is_right] = 1.0
        along = np.clip(along, 0.0, 1.0)
        low, high = positions[right - 1], positions[right]
        between = np.where(span > MOST_GAP_S * self.rate_hz, np.nan, low + along * (high - low))
        return np.where(along <= 0, low, np.where(along >= 1, high, between))
