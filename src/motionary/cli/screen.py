"""Answers on the screen and in pipes: tables, JSON, messages and progress bars.

Results go to stdout: a table, or JSON, one object a line. Messages and bars go to stderr, bars
on a terminal only. A table on a terminal fits its width; in a pipe its columns are aligned and
as wide as their widest cell, so that each row stays one line.
"""

import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from motionary.tables import printable

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

_BETWEEN = "  "
_LONGEST = 420
_CUT = " ... "
_SILENT_S = 30.0
# A text in a narrower column is not read.
_LEAST_WIDTH = 10


def prepare_streams() -> None:
    """Let no letter that the terminal cannot show end a command, and no closed stream."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            # Its number must not become that of the next file that is opened.
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
            warn(f"{name} is closed: what would be shown there is lost")
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def warn(text: str) -> None:
    """A message, one line on stderr."""
    line = " ".join(printable(line) for line in text.splitlines())
    sys.stderr.write(f"motionary: {shorten(line)}\n")


def say(*lines: str) -> None:
    """Lines of a result, on stdout."""
    sys.stdout.write("".join(f"{printable(line)}\n" for line in lines))


def say_size(path: str) -> None:
    """What was written, and how large it is."""
    say(f"{path}: {Path(path).stat().st_size / 1e6:.1f} MB")


def warn_of_pages(path: str, pages: Sequence[Path]) -> None:
    """Where a picture went that needed more than the one page that was named."""
    if len(pages) > 1:
        warn(f"{path}: {len(pages)} pages, the last one {pages[-1].name}")


def print_json(*contents: Mapping[str, Any]) -> None:
    """Objects, each a line, on stdout; ASCII, whatever the encoding of the pipe."""
    for content in contents:
        sys.stdout.write(json.dumps(content, allow_nan=False) + "\n")


def print_table(
    columns: Sequence[str], rows: Sequence[Sequence[str]], *, below: Mapping[int, str] | None = None
) -> None:
    """A table on stdout.

    Parameters
    ----------
    columns : headings; one that starts with ">" is set to the right
    rows : texts of the cells; those that are missing at its end are empty
    below : by row, a line that stands below it
    """
    shown = [[*map(printable, row), *[""] * (len(columns) - len(row))] for row in rows]
    lines = {row: printable(line) for row, line in (below or {}).items()}
    if sys.stdout.isatty():
        _print_fitted(columns, shown, lines)
    else:
        for number, line in enumerate(align(columns, shown), start=-1):
            sys.stdout.write(line + "\n")
            if number in lines:
                sys.stdout.write(f"{_BETWEEN}{lines[number]}\n")


def align(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Lines of a table, the headings first; columns as in `print_table`."""
    from rich.cells import cell_len

    widths = _natural_widths(columns, rows)
    heads = [column.removeprefix(">") for column in columns]
    for row in (heads, *rows):
        cells = []
        for cell, column, width in zip(row, columns, widths, strict=True):
            space = " " * (width - cell_len(cell))
            cells.append(space + cell if column.startswith(">") else cell + space)
        yield _BETWEEN.join(cells).rstrip()


def _print_fitted(
    columns: Sequence[str], rows: Sequence[Sequence[str]], below: Mapping[int, str]
) -> None:
    """A table on a terminal: long texts are folded, numbers and short texts keep their width."""
    from rich.console import Console
    from rich.padding import Padding
    from rich.text import Text

    console = Console(highlight=False)
    widths = _fit(columns, _natural_widths(columns, rows), console.width)
    if widths is None:
        _print_blocks(console, columns, rows, below)
        return
    table = _fitted_table(columns, widths, has_header=True)
    for number, row in enumerate(rows):
        table.add_row(*map(Text, row))
        if number in below:
            console.print(table, Padding(Text(below[number]), (0, 0, 0, len(_BETWEEN))), sep="")
            table = _fitted_table(columns, widths, has_header=False)
    if table.rows or not rows:
        console.print(table)


def _fit(columns: Sequence[str], widths: Sequence[int], most: int) -> list[int] | None:
    """Widths that a terminal holds, the longest texts made narrower; None if it is too narrow."""
    left = most - len(_BETWEEN) * (len(widths) - 1)
    is_text = [not column.startswith(">") for column in columns]
    for longest in range(max(widths, default=0), _LEAST_WIDTH - 1, -1):
        fitted = [
            min(width, longest) if text else width
            for width, text in zip(widths, is_text, strict=True)
        ]
        if sum(fitted) <= left:
            return fitted
    return None


def _print_blocks(
    console: "Console",
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    below: Mapping[int, str],
) -> None:
    """Each row as a few lines, where a table would not fit."""
    from rich.padding import Padding
    from rich.text import Text

    heads = [column.removeprefix(">") for column in columns]
    for number, row in enumerate(rows):
        cells = [f"{head} {cell}" for head, cell in zip(heads, row, strict=True) if cell]
        console.print(Text(cells[0]) if cells else "")
        rest = [", ".join(cells[1:]), below.get(number, "")]
        for line in filter(None, rest):
            console.print(Padding(Text(line), (0, 0, 0, len(_BETWEEN))))


def _fitted_table(columns: Sequence[str], widths: Sequence[int], *, has_header: bool) -> "Table":
    """A table without rows, its columns as wide as in every other part of the same table."""
    from rich.table import Table
    from rich.text import Text

    table = Table(
        box=None, show_header=has_header, pad_edge=False, padding=(0, len(_BETWEEN), 0, 0)
    )
    for column, width in zip(columns, widths, strict=True):
        justify: Literal["left", "right"] = "right" if column.startswith(">") else "left"
        title = Text(column.removeprefix(">"))
        table.add_column(title, justify=justify, overflow="fold", width=width)
    return table


def _natural_widths(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[int]:
    """Columns of a terminal that the widest cell of each column takes."""
    from rich.cells import cell_len

    heads = [column.removeprefix(">") for column in columns]
    return [max(map(cell_len, cells)) for cells in zip(heads, *rows, strict=True)]


def shorten(text: str) -> str:
    """A message with its middle left out where it is long: place and remedy stay."""
    if len(text) <= _LONGEST:
        return text
    half = (_LONGEST - len(_CUT)) // 2
    return text[:half] + _CUT + text[-half:]


def cell(value: Any, *, digits: int, unknown: str = "") -> str:
    """A value as it stands in a table; what is None or no number is unknown."""
    if value is None or value != value:
        return unknown
    return f"{value:.{digits}f}" if isinstance(value, float) else str(value)


def count(number: int, one: str, many: str = "") -> str:
    """So many things; `many` is their plural where an s does not make it."""
    return f"{number} {one if number == 1 else many or f'{one}s'}"


def percent(fraction: float | None) -> str:
    """A fraction in whole percent; nothing for None."""
    return "" if fraction is None else f"{100 * fraction:.0f} %"


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[..., None]]:
    """A bar on stderr while many things are done; call what it yields after each.

    Where stderr is no terminal, a line every half a minute; for a single thing, nothing.
    """
    if total < 2:
        yield lambda *_: None
        return
    if not sys.stderr.isatty():
        yield _count_in_lines(what, total)
        return
    from rich.console import Console
    from rich.progress import Progress

    # What is printed meanwhile belongs to stdout, not to the bar.
    with Progress(
        console=Console(stderr=True), transient=True, redirect_stdout=False, redirect_stderr=True
    ) as bar:
        task = bar.add_task(what, total=total)
        yield lambda *_: bar.advance(task)


def _count_in_lines(what: str, total: int) -> Callable[..., None]:
    """Counts its calls, and says now and then how far it is."""
    done, said = 0, time.monotonic()

    def count(*_: Any) -> None:
        nonlocal done, said
        done += 1
        if time.monotonic() - said >= _SILENT_S:
            said = time.monotonic()
            warn(f"{what}: {done} of {total}")

    return count
