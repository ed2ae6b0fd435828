"""How surprising is it that two recordings change together?

Along one offset, every change of a relation in one recording either has its like in the
other, within a frame, or has not. Changes that are rare tell much when they meet: the sum of
log-likelihood ratios, copy against chance, in bits. Where nothing changes there is nothing to
tell: two bodies that stand still share no bits.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Signs = NDArray[np.int8]

#: Share of the changes that a copy on another rig shows within a frame, by measurement.
_SHARED = 0.65
_WITHIN = 1


class Evidence(NamedTuple):
    """What speaks for a copy.

    Attributes
    ----------
    bits : of the stretch for which most speaks
    start, stop : that stretch in frames of the left recording, half-open
    shared : share of the changes in it that both show
    """

    bits: float
    start: int
    stop: int
    shared: float


def rates_of(n_changes: NDArray[np.int64], n_frames: int) -> Floats:
    """Changes per frame of each symbol; none is impossible (Laplace)."""
    return np.asarray((n_changes + 1) / (n_frames + 2), dtype=np.float64)


def weigh(left: Signs, right: Signs, offset: int, rates: Floats) -> Evidence:
    """Evidence that two recordings are copies at an offset.

    Parameters
    ----------
    left, right : arrays, shape (frames, relations): 1 where a relation begins to hold, -1
        where it ends, 0 where it does not change or is not known to
    offset : frame of the left recording at which the right one begins
    rates : array, shape (2 * relations,), changes per frame of each symbol
    """
    first, last = max(0, offset), min(len(left), len(right) + offset)
    a, b = left[first:last], right[first - offset : last - offset]
    met_a, met_b = _met(a, b), _met(b, a)
    gain = (_gain(a, met_a, rates) + _gain(b, met_b, rates)) / 2
    total = np.concatenate([[0.0], np.cumsum(gain)])
    lowest = np.minimum.accumulate(total)
    stop = int(np.argmax(total - lowest))
    # The last of equal ones: what is still before the first shared change says nothing.
    start = stop - int(np.argmin(total[stop::-1]))
    inside = slice(start, stop)
    n_changes = int(np.count_nonzero(a[inside]) + np.count_nonzero(b[inside]))
    n_met = int(np.count_nonzero(met_a[inside]) + np.count_nonzero(met_b[inside]))
    bits = float(total[stop] - total[start])
    return Evidence(bits, first + start, first + stop, n_met / max(n_changes, 1))


def _met(a: Signs, b: Signs) -> NDArray[np.bool_]:
    """Which changes of `a` have their like in `b`."""
    padded = np.pad(b, ((_WITHIN, _WITHIN), (0, 0)))
    met = np.zeros(a.shape, dtype=np.bool_)
    for step in range(2 * _WITHIN + 1):
        met |= padded[step : step + len(a)] == a
    return np.asarray(met & (a != 0))


def _gain(a: Signs, met: NDArray[np.bool_], rates: Floats) -> Floats:
    """Bits of every frame."""
    by_chance = np.minimum((2 * _WITHIN + 1) * rates, 0.5)
    if_met = np.log2(_SHARED / by_chance)
    if_not = np.log2((1 - _SHARED) / (1 - by_chance))
    bits = np.zeros(a.shape)
    for sign, symbols in ((-1, slice(0, None, 2)), (1, slice(1, None, 2))):
        here = a == sign
        bits += np.where(here, np.where(met, if_met[symbols], if_not[symbols]), 0.0)
    return np.asarray(bits.sum(axis=1))
