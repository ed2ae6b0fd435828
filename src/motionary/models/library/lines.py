"""In which line of a table does a value stand that a person got wrong?

TOML readers tell lines of broken syntax only; the line of a key is looked for when there
is something to say about it.
"""

import difflib
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from motionary.errors import UnreadableFile

_HEADER = re.compile(r"\s*\[+\s*([^\]\s]+)\s*\]+")
_PLACE = re.compile(r"(\w+)(?:\[(\d+)\])?\.")


def refuse(path: Path, key: str, problem: str, *, place: str = "") -> UnreadableFile:
    """The error of a value: file, key, what is wrong with it, and line.

    Parameters
    ----------
    path : file
    key : of the value
    problem : what is wrong, in words that follow the key
    place : where in the file it stands ("templates[0].")
    """
    return UnreadableFile(f"{path}: {place}{key} {problem}{tell_line(path, key, place=place)}")


def refuse_missing(path: Path, key: str, others: Iterable[str], *, place: str = "") -> Exception:
    """The error of a key that is not there; others may be what was meant."""
    hint = ""
    for near in difflib.get_close_matches(key, others, n=1, cutoff=0.75):
        hint = f"; is it {near!r}{tell_line(path, near, place=place)}?"
    return UnreadableFile(f"{path}: {place}{key} is missing{hint}")


def tell_line(path: Path, key: str, *, place: str = "") -> str:
    """The end of a message, as " (line 4)"; nothing if the key is not found."""
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError):
        return ""
    found = _PLACE.fullmatch(place)
    table, index = (found[1], int(found[2] or 0)) if found else ("", 0)
    wanted = re.compile(rf"""\s*(["']?){re.escape(key)}\1\s*=""")
    for number, line, inside, count in _lines(text):
        header = _HEADER.match(line)
        if (header and not table and header[1] == key) or (
            (inside, count) == (table, index) and wanted.match(line)
        ):
            return f" (line {number})"
    return ""


def _lines(text: str) -> Iterator[tuple[int, str, str, int]]:
    """Number and words of each line, its table, and how many of that name came before."""
    inside, counts = "", {"": 0}
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _HEADER.match(line):
            inside = header[1]
            counts[inside] = counts.get(inside, -1) + 1
        yield number, line, inside, counts[inside]
