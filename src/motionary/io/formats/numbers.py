"""Numbers of many frames, read from text at once; wrong ones are refused with their place.

A frame is a fixed sequence of words: numbers, and names that must stand where they
stand. Digits of equal place are converted together, for thousands of words in one
operation; what is not a plain decimal (`1e-15`) is converted on its own. The result is
the same as `float()`'s: up to 15 digits are exact in a float, and so are the powers of
ten they are divided by.
"""

import math
import re
from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Places = NDArray[np.intp]

#: Words that programs write where a number is not known, in lower case, without their sign.
UNKNOWN_NUMBERS = ("nan", "nan(ind)", "nan(snan)", "1.#qnan", "1.#ind")

_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(e[-+]?\d+)?", re.IGNORECASE)

# A piece of text and its arrays stay in the processor's cache.
PIECE = 1 << 17

_BLANK, _NEWLINE, _DOT, _MINUS, _PLUS, _ZERO = b" \n.-+0"
_MAX_WIDTH = 17
_MAX_DIGITS = 15
_POWERS: Floats = np.power(10.0, np.arange(_MAX_WIDTH))


class _Words(NamedTuple):
    """Text that begins and ends with blanks, its bytes, where words begin and end."""

    text: bytes
    buffer: Bytes
    starts: Places
    ends: Places


def read_table(
    text: str,
    width: int,
    *,
    source: str,
    line: int,
    separator: str | None = None,
    gaps: Collection[str] = (),
) -> Floats:
    """Numbers of all frames, shape (frames, width), one frame on a line.

    Parameters
    ----------
    text : the frames
    width : numbers of a frame
    source, line : name of the file and the line at which the text starts, for errors
    separator : between cells; by default blanks
    gaps : words in lower case that become NaN; with "" among them also cells that are missing

    Raises
    ------
    UnreadableFile
        If a line holds something else; the message names it.
    """
    values = read_frames(text.encode(), [None] * width)
    if values is not None:
        return values
    rows = []
    for number, content in enumerate(text.split("\n"), start=line):
        if not content.strip():
            continue
        cells = content.split(separator)
        while len(cells) > width and not cells[-1].strip():
            cells.pop()
        where = f"{source}, line {number}"
        row = _to_row(cells, where, gaps)
        if len(row) > width or (len(row) < width and "" not in gaps):
            raise UnreadableFile(f"{where}: a frame has {width} numbers, this one {len(row)}")
        rows.append(row + [math.nan] * (width - len(row)))
    return np.array(rows).reshape(-1, width)


def _to_row(cells: list[str], where: str, gaps: Collection[str]) -> list[float]:
    try:
        # Most cells that are no numbers are empty.
        row = [float(cell) if cell else math.nan for cell in cells]
    except ValueError:
        row = [math.nan]
    n_empty = cells.count("") if "" in gaps else 0
    if sum(map(math.isfinite, row)) + n_empty == len(cells) and "_" not in "".join(cells):
        return row
    return [to_number(cell, where, gaps=gaps) for cell in cells]


def to_number(word: str, where: str, *, gaps: Collection[str] = ()) -> float:
    """The number that a word is.

    Raises
    ------
    UnreadableFile
        If it is none; `where` says in which file and line.
    """
    value = parse_number(word)
    if math.isnan(value) and word.strip().lower().lstrip("+-") not in gaps:
        comma = _DECIMAL_COMMA.fullmatch(word.strip())
        why = ", which has a decimal comma; export with decimal points" if comma else ""
        raise UnreadableFile(f"{where}: expected a number, got {word[:40]!r}{why}")
    return value


def parse_number(word: str | bytes) -> float:
    """The finite number that a word is, else NaN."""
    try:
        value = float(word)
    except ValueError:
        return math.nan
    # `float` takes 1_000 and inf, which no recording may contain.
    mark = b"_" if isinstance(word, bytes) else "_"
    return value if math.isfinite(value) and mark not in word else math.nan  # type: ignore[operator]


def read_frames(text: bytes, names: Sequence[bytes | None]) -> Floats | None:
    """Numbers of all frames, or None if the text is not frame after frame like that.

    Parameters
    ----------
    text : the frames, each beginning on a line of its own
    names : per word of a frame the name that stands there, or None for a number

    Returns
    -------
    array, shape (frames, numbers per frame), or None
    """
    is_number = np.array([name is None for name in names])
    blocks, start, size = [], 0, PIECE
    while start < len(text):
        words = _find_words(text[start : start + size])
        at_end = start + size >= len(text)
        # The last word may be cut in two by the end of the piece.
        n_frames = (len(words.starts) - (not at_end)) // len(names)
        if n_frames <= 0 and not at_end:
            size *= 2
            continue
        used = n_frames * len(names)
        if at_end and used != len(words.starts):
            return None
        if not used:
            break
        block = _read_words(words, n_frames, names, is_number)
        if block is None:
            return None
        blocks.append(block)
        start = len(text) if at_end else start + int(words.starts[used]) - _MAX_WIDTH
    values = np.concatenate(blocks) if blocks else np.empty((0, 1))
    return values if len(values) else None


def _find_words(piece: bytes) -> _Words:
    margin = b" " * _MAX_WIDTH
    text = margin + piece + margin
    buffer = np.frombuffer(text, dtype=np.uint8)
    blank = buffer <= _BLANK
    edges = np.flatnonzero(blank[1:] != blank[:-1]) + 1
    return _Words(text, buffer, edges[::2], edges[1::2])


def _read_words(
    words: _Words, n_frames: int, names: Sequence[bytes | None], is_number: NDArray[np.bool_]
) -> Floats | None:
    shape = (n_frames, len(names))
    starts = words.starts[: n_frames * len(names)].reshape(shape)
    ends = words.ends[: n_frames * len(names)].reshape(shape)
    if not _begin_lines(words.buffer, starts[1:, 0], ends[:-1, -1]):
        return None
    expected = [name for name in names if name is not None]
    if expected and not _have_names(words.buffer, starts[:, ~is_number], expected):
        return None
    numbers = words._replace(starts=starts[:, is_number].ravel(), ends=ends[:, is_number].ravel())
    values = _to_floats(numbers).reshape(n_frames, -1)
    return values if np.isfinite(values).all() else None


def _begin_lines(buffer: Bytes, starts: Places, ends_before: Places) -> bool:
    newlines = np.flatnonzero(buffer == _NEWLINE)
    return bool(np.all(np.searchsorted(newlines, starts) > np.searchsorted(newlines, ends_before)))


def _have_names(buffer: Bytes, starts: Places, names: Sequence[bytes]) -> bool:
    """Whether the words that start at (frames, names) are these, each with a blank after it."""
    width = 1 + max(len(name) for name in names)
    letters = np.array([list(name.ljust(width)) for name in names], dtype=np.uint8)
    if int(starts[-1, -1]) + width > len(buffer):
        buffer = np.concatenate((buffer, np.full(width, _BLANK, dtype=np.uint8)))
    for i in range(width):
        here = np.array([i <= len(name) for name in names])
        if not np.all((np.maximum(buffer[starts + i], _BLANK) == letters[:, i]) | ~here):
            return False
    return True


def _to_floats(words: _Words) -> Floats:
    """The words as numbers, NaN for what is none."""
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
    for i in np.flatnonzero(~plain).tolist():
        values[i] = parse_number(words.text[words.starts[i] : words.ends[i]])
    return values


def _mantissas(digits: Bytes, n_dots: Bytes, decimals: Bytes) -> Floats:
    """Whole numbers of the digits once the dot, `decimals` places from the end, is gone."""
    place = np.arange(len(digits), dtype=np.uint8)[:, None]
    beyond = place >= np.where(n_dots > 0, decimals, 255)
    closed = np.where(beyond, 0, digits)
    np.copyto(closed[:-1], digits[1:], where=beyond[:-1])
    result: Floats = _POWERS[: len(digits)] @ closed.astype(np.float64)
    return result


# ---- lines of clips


def find_line(lines: list[str], pattern: str, start: int = 0) -> int:
    """Number of the first line that matches a pattern; of lines if there is none."""
    wanted = re.compile(rf"\s*{pattern}\s*", re.IGNORECASE)
    numbers = range(start, len(lines))
    return next((i for i in numbers if wanted.fullmatch(lines[i])), len(lines))


def check_frames(first: int, last: int, *, first_number: int, n_frames: int, name: str) -> None:
    """Refuse frames that are not in a file.

    Raises
    ------
    InvalidInput
    """
    last_number = first_number + n_frames - 1
    if not first_number <= first <= last <= last_number:
        raise InvalidInput(
            f"{name}: has frames {first_number} to {last_number}, asked for are {first} to {last}"
        )


def end_alike(lines: list[str], model: str) -> list[str]:
    """Lines of which the last one ends as another does."""
    end = model[len(model.rstrip("\r\n")) :]
    return [*lines[:-1], lines[-1].rstrip("\r\n") + end]
