"""How does an answer get onto the screen, or into a pipe?

Results go to stdout: a table of aligned columns, the same on a terminal and in a pipe, or
JSON, one object a line. Messages and bars go to stderr, bars on a terminal only.
"""

import json
import sys
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import PurePath
from typing import Any

_BETWEEN = "  "
_WIDE = ("W", "F")


def prepare_streams() -> None:
    """Let no letter that the terminal cannot show end a command."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def warn(text: str) -> None:
    """A message, one line on stderr."""
    line = " ".join(printable(line) for line in text.splitlines())
    sys.stderr.write(f"motionary: {line}\n")


def name_error(recording: str, path: PurePath, error: Exception) -> str:
    """The words of an error, under the recording's name whatever they call its file."""
    text = str(error)
    for name in (str(path), path.name):
        if text.startswith(name):
            return recording + text.removeprefix(name)
    return f"{recording}: {text}"


def say(*lines: str) -> None:
    """Lines of a result, on stdout."""
    sys.stdout.write("".join(f"{printable(line)}\n" for line in lines))


def print_json(content: Mapping[str, Any]) -> None:
    """One object, one line, on stdout; ASCII, whatever the encoding of the pipe."""
    sys.stdout.write(json.dumps(content, allow_nan=False) + "\n")


def print_table(
    columns: Sequence[str], rows: Sequence[Sequence[str]], *, below: Mapping[int, str] | None = None
) -> None:
    """A table on stdout.

    Parameters
    ----------
    columns : headings; one that starts with ">" is set to the right
    rows : texts of the cells
    below : by row, a line that stands below it
    """
    names = [column.removeprefix(">") for column in columns]
    table = [names, *([printable(cell) for cell in row] for row in rows)]
    widths = [max(_width(row[i]) for row in table) for i in range(len(columns))]
    for number, row in enumerate(table, start=-1):
        cells = []
        for cell, column, width in zip(row, columns, widths, strict=True):
            space = " " * (width - _width(cell))
            cells.append(space + cell if column.startswith(">") else cell + space)
        sys.stdout.write(_BETWEEN.join(cells).rstrip() + "\n")
        if below and number in below:
            sys.stdout.write(f"{_BETWEEN}{printable(below[number])}\n")


def printable(text: str) -> str:
    """Text without what would move the cursor or change the terminal."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


def _width(text: str) -> int:
    """Columns of a terminal that a text takes."""
    wide = sum(unicodedata.east_asian_width(letter) in _WIDE for letter in text)
    return len(text) + wide - sum(unicodedata.combining(letter) != 0 for letter in text)


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[..., None]]:
    """A bar on stderr while many things are done; call what it yields after each.

    There is none where stderr is no terminal, or for a single thing.
    """
    if not sys.stderr.isatty() or total < 2:
        yield lambda *_: None
        return
    from rich.console import Console
    from rich.progress import Progress

    # What is printed meanwhile belongs to stdout, not to the bar.
    with Progress(
        console=Console(stderr=True), transient=True, redirect_stdout=False, redirect_stderr=True
    ) as bar:
        task = bar.add_task(what, total=total)
        yield lambda *_: bar.advance(task)
