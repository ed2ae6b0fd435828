"""Words of a piece of text and their numbers in one pass: the compiled twin of `words`.

A number of up to 15 digits times or through a power of ten up to 22 is rounded once, so that it
is the same as `float()`'s.
"""

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Places = NDArray[np.intp]

_BLANK, _DOT, _MINUS, _PLUS, _ZERO, _NINE, _E, _CAPITAL_E = b" .-+09eE"
_MAX_DIGITS = 15
_MAX_POWER = 22
_POWERS: Floats = np.power(10.0, np.arange(_MAX_POWER + 1))


@numba.njit(cache=True, nogil=True)
def scan(buffer: Bytes, separator: int, starts: Places, ends: Places, values: Floats) -> int:
    """Number of words; where each starts and ends and its value are written to arrays.

    What is no decimal of 15 digits or fewer is NaN. The text ends with a blank.
    """
    n = i = 0
    size = len(buffer)
    while i < size:
        letter = buffer[i]
        if letter <= _BLANK or letter == separator:
            i += 1
            continue
        starts[n] = i
        negative = letter == _MINUS
        if negative or letter == _PLUS:
            i += 1
        mantissa, power, n_digits, dotted = np.int64(0), 0, 0, False
        while True:
            letter = buffer[i]
            if _ZERO <= letter <= _NINE:
                mantissa = 10 * mantissa + (letter - _ZERO)
                n_digits += 1
                power -= dotted
            elif letter == _DOT and not dotted:
                dotted = True
            else:
                break
            i += 1
        if n_digits and letter in (_E, _CAPITAL_E):
            i, exponent = _read_exponent(buffer, i)
            power += exponent
            letter = buffer[i]
        plain = 0 < n_digits <= _MAX_DIGITS and abs(power) <= _MAX_POWER
        while letter > _BLANK and letter != separator:
            plain = False
            i += 1
            letter = buffer[i]
        value = np.nan
        if plain:
            value = float(mantissa)
            value = value / _POWERS[-power] if power < 0 else value * _POWERS[power]
        ends[n], values[n] = i, -value if negative else value
        n += 1
    return n


@numba.njit(cache=True, nogil=True)
def _read_exponent(buffer: Bytes, start: int) -> tuple[int, int]:
    """Where an exponent ends and its value; where there is none, its start and 0."""
    i = start + 1
    negative = buffer[i] == _MINUS
    if negative or buffer[i] == _PLUS:
        i += 1
    first, exponent = i, 0
    while _ZERO <= buffer[i] <= _NINE:
        # No larger one is computed here.
        exponent = min(10 * exponent + (buffer[i] - _ZERO), 1000)
        i += 1
    if i == first:
        return start, 0
    return i, -exponent if negative else exponent
