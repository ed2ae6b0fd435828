"""Words of a piece of text, and the numbers that they are: the NumPy kernels of `numbers`.

Digits of equal place are converted together, for thousands of words in one operation. Up to 15
digits are exact in a float, and so are the powers of ten they are divided by: the result is
that of `float()`. Other words (`1e-15`, names) are NaN here.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Places = NDArray[np.intp]

BLANK, NEWLINE = b" \n"
_DOT, _MINUS, _PLUS, _ZERO = b".-+0"
_MAX_WIDTH = 17
_MAX_DIGITS = 15
_POWERS: Floats = np.power(10.0, np.arange(_MAX_WIDTH))

#: Blanks before and after a piece of text.
MARGIN = _MAX_WIDTH


class Words(NamedTuple):
    """Text that begins and ends with blanks, its bytes, where words begin and end.

    `values` are their numbers, NaN for those that are no plain decimals; None before they are
    computed.
    """

    text: bytes
    buffer: Bytes
    starts: Places
    ends: Places
    values: Floats | None = None

    def chosen(self, which: Any) -> "Words":
        """Some of the words."""
        values = None if self.values is None else self.values[which]
        return self._replace(starts=self.starts[which], ends=self.ends[which], values=values)


def pad(piece: bytes) -> Words:
    """A piece of text between blanks, without its words."""
    text = b"".join((b" " * MARGIN, piece, b" " * MARGIN))
    none = np.empty(0, dtype=np.intp)
    return Words(text, np.frombuffer(text, dtype=np.uint8), none, none)


def find_words(piece: bytes, separator: int = BLANK) -> Words:
    """Words of a piece of text; blanks and the separator lie between them."""
    padded = pad(piece)
    between = padded.buffer <= BLANK
    if separator > BLANK:
        between |= padded.buffer == separator
    edges = np.flatnonzero(between[1:] != between[:-1]) + 1
    return padded._replace(starts=edges[::2], ends=edges[1::2])


def to_floats(words: Words) -> Floats:
    """The words as numbers, NaN for what is no plain decimal."""
    lengths = words.ends - words.starts
    width = int(min(lengths.max(initial=1), _MAX_WIDTH))
    # Row k holds the k-th last letter of every word.
    letters = np.empty((width, len(lengths)), dtype=np.uint8)
    for k in range(width):
        np.take(words.buffer, words.ends - (k + 1), out=letters[k])
    place = np.arange(width, dtype=np.uint8)[:, None]
    inside = place < np.minimum(lengths, 255).astype(np.uint8)
    digits = letters - _ZERO
    is_digit = (digits < 10) & inside
    is_dot = (letters == _DOT) & inside
    n_digits = is_digit.sum(axis=0, dtype=np.uint8)
    n_dots = is_dot.sum(axis=0, dtype=np.uint8)
    first = words.buffer[words.starts]
    n_signs = (first == _MINUS) | (first == _PLUS)
    # Of several dots the places add up; such a word is no plain number.
    decimals = np.minimum((is_dot * place).sum(axis=0, dtype=np.uint16), len(_POWERS) - 1)
    decimals = decimals.astype(np.uint8)
    plain = (n_digits > 0) & (n_digits <= _MAX_DIGITS) & (n_dots <= 1)
    plain &= n_digits + n_dots + n_signs == lengths
    values = _mantissas(np.where(is_digit, digits, 0), n_dots, decimals)
    values /= _POWERS[decimals]
    np.negative(values, where=first == _MINUS, out=values)
    values[~plain] = np.nan
    return values


def _mantissas(digits: Bytes, n_dots: Bytes, decimals: Bytes) -> Floats:
    """Whole numbers of the digits once the dot, `decimals` places from the end, is gone."""
    place = np.arange(len(digits), dtype=np.uint8)[:, None]
    beyond = place >= np.where(n_dots > 0, decimals, 255)
    closed = np.where(beyond, 0, digits)
    np.copyto(closed[:-1], digits[1:], where=beyond[:-1])
    result: Floats = _POWERS[: len(digits)] @ closed.astype(np.float64)
    return result
