"""Tables as text: aligned in pipes, fitted to the width of a terminal.

Conventions: a heading that starts with ">" is set to the right, with its column. Widths are
those of a terminal, where some letters take two places.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

__all__ = ["BETWEEN", "align", "print_fitted"]

#: Between two columns.
BETWEEN = "  "
# A text in a narrower column is not read.
_LEAST_WIDTH = 10


def align(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Lines of a table, the headings first."""
    from rich.cells import cell_len

    widths = _natural_widths(columns, rows)
    heads = [column.removeprefix(">") for column in columns]
    for row in (heads, *rows):
        cells = []
        for cell, column, width in zip(row, columns, widths, strict=True):
            space = " " * (width - cell_len(cell))
            cells.append(space + cell if column.startswith(">") else cell + space)
        yield BETWEEN.join(cells).rstrip()


def print_fitted(
    columns: Sequence[str], rows: Sequence[Sequence[str]], below: Mapping[int, str]
) -> None:
    """Print a table on a terminal: long texts are folded, others keep their width.

    Parameters
    ----------
    columns : headings; one that starts with ">" is set to the right
    rows : texts of the cells
    below : by row, a line that stands below it
    """
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
            console.print(table, Padding(Text(below[number]), (0, 0, 0, len(BETWEEN))), sep="")
            table = _fitted_table(columns, widths, has_header=False)
    if table.rows or not rows:
        console.print(table)


def _fit(columns: Sequence[str], widths: Sequence[int], most: int) -> list[int] | None:
    """Widths that a terminal holds, the longest texts made narrower; None if it is too narrow."""
    left = most - len(BETWEEN) * (len(widths) - 1)
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
            console.print(Padding(Text(line), (0, 0, 0, len(BETWEEN))))


def _fitted_table(columns: Sequence[str], widths: Sequence[int], *, has_header: bool) -> "Table":
    """A table without rows, its columns as wide as in every other part of the same table."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=has_header, pad_edge=False, padding=(0, len(BETWEEN), 0, 0))
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
