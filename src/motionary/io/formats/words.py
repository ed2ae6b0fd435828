"""Words of a piece of text, and the numbers that they are: the NumPy kernels of `numbers`.

Digits are converted for thousands of words in one operation. Up to 15
digits are exact in a float, and so are the powers of ten they are divided by: the result is
that of `float()`. Other words (`1e-15`, names) are NaN here.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Places = NDArray[np.intp]
Integers = NDArray[np.uint64]

BLANK, NEWLINE = b" \n"
_DOT, _MINUS, _PLUS, _ZERO = b".-+0"
_MAX_WIDTH = 17
_MAX_DIGITS = 15
_POWERS: Floats = np.power(10.0, np.arange(_MAX_WIDTH))
_WHOLE_POWERS = 10 ** np.arange(8, dtype=np.uint64)
_ONE, _BITS = np.uint64(1), np.uint64(64)
_LAST_BYTES = np.array([2**64 - 2 ** (8 * (8 - n)) for n in range(9)], dtype=np.uint64)
# Digits, pairs and fours of a word, joined to the next by a factor.
_JOINED = [
    (np.uint64(0x0F0F0F0F0F0F0F0F), np.uint64(10 << 8 | 1), np.uint64(8)),
    (np.uint64(0x00FF00FF00FF00FF), np.uint64(100 << 16 | 1), np.uint64(16)),
    (np.uint64(0x0000FFFF0000FFFF), np.uint64(10000 << 32 | 1), np.uint64(32)),
]
# By the number of the eight last letters before the dot; all eight where there is none.
_N_DECIMALS = np.array([7, 6, 5, 4, 3, 2, 1, 0, 0], dtype=np.uint8)
_FROM_DOT = np.array([8, 7, 6, 5, 4, 3, 2, 1, 0], dtype=np.intp)
# The same byte eight times.
_ONES, _DOTS, _ZEROS, _HIGH_BITS, _TO_HIGH_BIT = (
    np.uint64(byte * 0x0101010101010101) for byte in (1, _DOT, _ZERO, 0x80, 0x80 - 10)
)

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
    values = _short_decimals(words)
    others = np.flatnonzero(np.isnan(values))
    if len(others):
        values[others] = _long_decimals(words.chosen(others))
    return values


def _short_decimals(words: Words) -> Floats:
    """Numbers of up to 8 digits before the dot and 7 behind it; NaN for other words.

    Eight letters are one integer, and its digits are joined pair by pair.
    """
    starts, ends = words.starts, words.ends
    first = words.buffer[starts]
    is_negative = first == _MINUS
    letters = np.frombuffer(words.text, dtype="<u8", count=len(words.text) // 8)
    # Of the last eight letters the dot, the one that is zero now; bits up to it are counted.
    is_dot = _load(letters, ends) ^ _DOTS
    is_dot = (is_dot - _ONES) & ~is_dot & _HIGH_BITS
    n_before = np.bitwise_count((is_dot & (~is_dot + _ONE)) - _ONE) >> 3
    n_decimals = _N_DECIMALS.take(n_before)
    dots = ends - _FROM_DOT.take(n_before)
    n_digits = dots - starts - (is_negative | (first == _PLUS))
    whole, is_whole = _digits(_load(letters, dots), n_digits)
    part, is_part = _digits(_load(letters, ends), n_decimals)
    values: Floats = (whole * _WHOLE_POWERS[n_decimals] + part).astype(np.float64)
    values /= _POWERS[n_decimals]
    values *= 1.0 - 2.0 * is_negative
    values[~(is_whole & is_part & (n_digits + n_decimals > 0))] = np.nan
    return values


def _load(letters: Integers, ends: Places) -> Integers:
    """The eight letters before each end, the last one in the highest byte."""
    first = ends - 8
    at, shift = first >> 3, ((first & 7) << 3).astype(np.uint64)
    # A shift by 64 leaves nothing.
    return (letters.take(at) >> shift) | (letters.take(at + 1, mode="clip") << (_BITS - shift))


def _digits(letters: Integers, counts: NDArray[Any]) -> tuple[Integers, NDArray[np.bool_]]:
    """The number of the last `counts` letters, and whether all are digits and no more than 8."""
    digits = (letters ^ _ZEROS) & _LAST_BYTES.take(counts, mode="clip")
    is_number = ((digits + _TO_HIGH_BIT) | digits) & _HIGH_BITS == 0
    for keep, factor, shift in _JOINED:
        digits = ((digits & keep) * factor) >> shift
    return digits, is_number & (counts <= 8)


def _long_decimals(words: Words) -> Floats:
    """Numbers of up to 15 digits; NaN for what is no plain decimal."""
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
