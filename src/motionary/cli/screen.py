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
from typing import Any

from motionary.tables import printable
from motionary.text_tables import BETWEEN, align, print_fitted

_LONGEST = 420
_CUT = " ... "
_SILENT_S = 30.0


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
        print_fitted(columns, shown, lines)
        return
    for number, line in enumerate(align(columns, shown), start=-1):
        say(line)
        if number in lines:
            say(BETWEEN + lines[number])


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
