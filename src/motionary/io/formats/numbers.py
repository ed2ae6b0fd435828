"""Numbers of many frames, read from text at once; wrong ones are refused with their place.

One parser for all formats of text. A frame is a fixed sequence of words: numbers, and names that
must stand where they stand; or the cells of a line, of which some may be empty. Text is read by
pieces, each converted in a few operations (`words`), or by a compiled twin where it pays; the
result is the same as `float()`'s.
"""

import math
import re
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile, Where
from motionary.io.formats import words as numpy_words
from motionary.io.formats.words import BLANK, MARGIN, NEWLINE, Bytes, Floats, Places, Words

#: Words that programs write where a number is not known, in lower case, without their sign.
UNKNOWN_NUMBERS = ("nan", "nan(ind)", "nan(snan)", "1.#qnan", "1.#ind")

_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(e[-+]?\d+)?", re.IGNORECASE)

# A piece of text and its arrays stay in the processor's cache.
PIECE = 1 << 17

# Loading the compiled twin takes half a second, in which NumPy reads as many bytes.
_COMPILED_PAYS_AT = 40_000_000
_COMPILED = "motionary.io.formats._compiled_words"


class NotAlike(Exception):
    """Text that is not frame after frame of the same words."""


def read_table(
    text: str,
    width: int,
    *,
    line: int,
    source: str = "",
    separator: str | None = None,
    gaps: Collection[str] = (),
) -> Floats:
    """Numbers of all frames, shape (frames, width), one frame on a line.

    Parameters
    ----------
    text : the frames
    width : numbers of a frame
    line, source : the line at which the text starts, and name of the file, for errors
    separator : between cells; by default blanks
    gaps : words in lower case that become NaN; with "" among them also cells that are missing
    """
    if separator is None:
        values = _read_blocks(text, width, gaps)
    else:
        values = _read_cells(text.encode(), width, ord(separator), gaps)
    return _read_lines(text, width, source, line, separator, gaps) if values is None else values


def _read_blocks(text: str, width: int, gaps: Collection[str]) -> Floats | None:
    """Numbers of all frames, none of them held twice; None if the text is not that."""
    pieces = (text[start : start + PIECE].encode() for start in range(0, len(text), PIECE))
    # Each frame begins on a line of its own, and a number takes two letters.
    most = min(text.count("\n"), len(text) // (2 * width)) + 1
    values = np.empty((most, width))
    n_frames = 0
    try:
        for block in iterate_frames(pieces, [None] * width, gaps=gaps):
            values[n_frames : n_frames + len(block)] = block
            n_frames += len(block)
    except NotAlike:
        return None
    return values[:n_frames] if n_frames else None


def _read_lines(
    text: str, width: int, source: str, line: int, separator: str | None, gaps: Collection[str]
) -> Floats:
    """The same line by line, which finds out where something else stands."""
    rows = []
    for number, content in enumerate(text.split("\n"), start=line):
        if not content.strip():
            continue
        cells = content.split(separator)
        while len(cells) > width and not cells[-1].strip():
            cells.pop()
        where = Where(file=source, place=f"line {number}")
        row = _to_row(cells, where, gaps)
        if len(row) > width or (len(row) < width and "" not in gaps):
            raise UnreadableFile(f"a frame has {width} numbers, this one {len(row)}", **where)
        rows.append(row + [math.nan] * (width - len(row)))
    return np.array(rows).reshape(-1, width)


def _to_row(cells: list[str], where: Where, gaps: Collection[str]) -> list[float]:
    try:
        # Most cells that are no numbers are empty.
        row = [float(cell) if cell else math.nan for cell in cells]
    except ValueError:
        row = [math.nan]
    n_empty = cells.count("") if "" in gaps else 0
    if sum(map(math.isfinite, row)) + n_empty == len(cells) and "_" not in "".join(cells):
        return row
    return [to_number(cell, where, gaps=gaps) for cell in cells]


def to_number(word: str, where: Where, *, gaps: Collection[str] = ()) -> float:
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
        raise UnreadableFile(f"expected a number, got {word[:40]!r}{why}", **where)
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


def read_frames(
    text: bytes, names: Sequence[bytes | None], *, gaps: Collection[str] = ()
) -> Floats | None:
    """Numbers of all frames, as of `iterate_frames`; None if the text is none."""
    try:
        blocks = list(iterate_frames([text], names, gaps=gaps))
    except NotAlike:
        return None
    return np.concatenate(blocks) if blocks else None


def iterate_frames(
    texts: Iterable[bytes], names: Sequence[bytes | None], *, gaps: Collection[str] = ()
) -> Iterator[Floats]:
    """Numbers of frames, some frames at a time, (frames, numbers per frame).

    Parameters
    ----------
    texts : parts of the text, cut anywhere; each frame begins on a line of its own
    names : per word of a frame the name that stands there, or None for a number
    gaps : words in lower case, without their sign, that become NaN

    Raises
    ------
    NotAlike
        If the text is not frame after frame like that.
    """
    is_number = np.array([name is None for name in names])
    rest, least, is_first = b"", 0, True
    for piece, at_end in _pieces(texts):
        rest += piece
        if len(rest) < least and not at_end:
            continue
        words = _scan(rest, BLANK)
        # The last word may be cut in two by the end of the piece.
        n_frames = max(0, len(words.starts) - (not at_end)) // len(names)
        used = n_frames * len(names)
        if at_end and used != len(words.starts):
            raise NotAlike
        if not n_frames:
            least = 2 * len(rest)
            continue
        if not is_first and NEWLINE not in words.buffer[: words.starts[0]]:
            raise NotAlike
        yield _read_words(words, n_frames, names, is_number, gaps)
        rest = rest[int(words.ends[used - 1]) - MARGIN :]
        least, is_first = 0, False


def _pieces(texts: Iterable[bytes]) -> Iterator[tuple[bytes, bool]]:
    """Pieces of a text that are short, and whether each is the last one."""
    last = b""
    for text in texts:
        for start in range(0, len(text), PIECE):
            if last:
                yield last, False
            last = text[start : start + PIECE]
    yield last, True


def _scan(piece: bytes, separator: int) -> Words:
    """The words of a piece of text, by the twin that pays."""
    kernels = _COUNTER.twin(len(piece))
    if kernels is None:
        return numpy_words.find_words(piece, separator)
    found = numpy_words.pad(piece)
    n_most = len(piece) // 2 + 1
    starts, ends = np.empty(n_most, dtype=np.intp), np.empty(n_most, dtype=np.intp)
    values = np.empty(n_most)
    n = kernels.scan(found.buffer, separator, starts, ends, values)
    return found._replace(starts=starts[:n], ends=ends[:n], values=values[:n])


class _Counter:
    """How much text was read so far: many short files are worth the twin, too."""

    def __init__(self) -> None:
        self.n_bytes = 0

    def twin(self, n_bytes: int) -> Any:
        """The compiled kernels, or None."""
        self.n_bytes += n_bytes
        if self.n_bytes < _COMPILED_PAYS_AT and "numba" not in sys.modules:
            return None
        # Imported late: most files are short.
        from motionary.matching import load_twin

        return load_twin(_COMPILED, "auto", pays=True)


_COUNTER = _Counter()


def _read_words(
    words: Words,
    n_frames: int,
    names: Sequence[bytes | None],
    is_number: NDArray[np.bool_],
    gaps: Collection[str],
) -> Floats:
    n_words = n_frames * len(names)
    starts = words.starts[:n_words].reshape(n_frames, -1)
    ends = words.ends[:n_words].reshape(n_frames, -1)
    if not _begin_lines(words.buffer, starts[1:, 0], ends[:-1, -1]):
        raise NotAlike
    expected = [name for name in names if name is not None]
    if expected and not _have_names(words.buffer, starts[:, ~is_number], expected):
        raise NotAlike
    numbers = words.chosen(slice(n_words))
    if expected:
        numbers = numbers.chosen(np.tile(is_number, n_frames))
    return _to_numbers(numbers, gaps).reshape(n_frames, -1)


def _to_numbers(words: Words, gaps: Collection[str]) -> Floats:
    """The words as numbers, NaN for what may be missing."""
    values = numpy_words.to_floats(words) if words.values is None else words.values
    odd = np.flatnonzero(np.isnan(values))
    # What is no plain decimal, one by one.
    places = zip(odd.tolist(), words.starts[odd].tolist(), words.ends[odd].tolist(), strict=True)
    for i, start, end in places:
        word = words.text[start:end]
        value = parse_number(word)
        if value != value and word.decode("latin-1").lower().lstrip("+-") not in gaps:
            raise NotAlike
        values[i] = value
    return values


def _begin_lines(buffer: Bytes, starts: Places, ends_before: Places) -> bool:
    newlines = np.flatnonzero(buffer == NEWLINE)
    return bool(np.all(np.searchsorted(newlines, starts) > np.searchsorted(newlines, ends_before)))


def _have_names(buffer: Bytes, starts: Places, names: Sequence[bytes]) -> bool:
    """Whether the words that start at (frames, names) are these, each with a blank after it."""
    width = 1 + max(len(name) for name in names)
    letters = np.array([list(name.ljust(width)) for name in names], dtype=np.uint8)
    if int(starts[-1, -1]) + width > len(buffer):
        buffer = np.concatenate((buffer, np.full(width, BLANK, dtype=np.uint8)))
    for i in range(width):
        here = np.array([i <= len(name) for name in names])
        if not np.all((np.maximum(buffer[starts + i], BLANK) == letters[:, i]) | ~here):
            return False
    return True


def _read_cells(text: bytes, width: int, separator: int, gaps: Collection[str]) -> Floats | None:
    """Numbers of the cells of all lines that are not empty; None if one holds something else."""
    blocks, start = [], 0
    while start < len(text):
        end = text.find(b"\n", min(start + PIECE, len(text)) - 1)
        end = len(text) if end < 0 else end + 1
        try:
            blocks.append(_read_rows(_scan(text[start:end], separator), width, separator, gaps))
        except NotAlike:
            return None
        start = end
    return np.concatenate(blocks) if blocks else np.empty((0, width))


def _read_rows(words: Words, width: int, separator: int, gaps: Collection[str]) -> Floats:
    """The cells of whole lines, shape (lines, width)."""
    newlines = np.flatnonzero(words.buffer == NEWLINE)
    lines = np.searchsorted(newlines, words.starts)
    is_separator = words.buffer == separator
    is_row = np.zeros(len(newlines) + 1, dtype=bool)
    is_row[lines] = True
    if separator > BLANK:
        is_row[np.searchsorted(newlines, np.flatnonzero(is_separator))] = True
    rows = (np.cumsum(is_row) - 1)[lines]
    # How many separators come before, in all and up to the newline before a line.
    counts = np.cumsum(is_separator)
    columns = counts[words.starts] - np.concatenate(([0], counts[newlines]))[lines]
    at = rows * width + columns
    if (columns >= width).any() or (np.diff(at) <= 0).any():
        raise NotAlike
    n_rows = int(is_row.sum())
    if "" not in gaps and len(at) != n_rows * width:
        raise NotAlike
    result = np.full(n_rows * width, np.nan)
    result[at] = _to_numbers(words, gaps)
    return result.reshape(n_rows, width)


# ---- frames that are promised, and lines of clips


def check_length(promised: str, n: int, *, what: str = "frames", key: str = "") -> None:
    """Refuse a table of `n` rows that is shorter than its file says, under `key`.

    What is no whole number promises nothing.
    """
    if promised.isdecimal() and int(promised[:20]) > n:
        raise UnreadableFile(
            f"{key}promises {promised[:20]} {what}, the file ends after {n}; get the whole file, "
            "or correct the number to read what is there"
        )


def find_line(lines: list[str], pattern: str, start: int = 0) -> int:
    """Number of the first line that matches a pattern; of lines if there is none."""
    wanted = re.compile(rf"\s*{pattern}\s*", re.IGNORECASE)
    numbers = range(start, len(lines))
    return next((i for i in numbers if wanted.fullmatch(lines[i])), len(lines))


def check_frames(first: int, last: int, *, first_number: int, n_frames: int) -> None:
    """Refuse frames that are not in a file."""
    last_number = first_number + n_frames - 1
    if not first_number <= first <= last <= last_number:
        raise InvalidInput(
            f"has frames {first_number} to {last_number}, asked for are {first} to {last}"
        )


def end_alike(lines: list[str], model: str) -> list[str]:
    """Lines of which the last one ends as another does."""
    end = model[len(model.rstrip("\r\n")) :]
    return [*lines[:-1], lines[-1].rstrip("\r\n") + end]
