"""How is a table of separated values written, for programs or for a spreadsheet?

For programs: commas, decimal points, UTF-8. For Excel as it opens a file by a double click in
most of Europe: semicolons, decimal commas, a mark that says UTF-8, lines as Windows ends them.
"""

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

from motionary.batch import write_atomically

Cell = str | int | float | None


def write_table(rows: Iterable[Sequence[Cell]], path: str | Path, *, excel: bool = False) -> None:
    """Write rows of cells, headings first; None is an empty cell.

    Parameters
    ----------
    rows : numbers that are whole as int, others as float; text stays as it is
    path : the file
    excel : for Excel instead of for programs

    Raises
    ------
    UnwritableFile
        If the file cannot be written; what was there before stays.
    """
    text = io.StringIO()
    writer = csv.writer(
        text, delimiter=";" if excel else ",", lineterminator="\r\n" if excel else "\n"
    )
    for row in rows:
        writer.writerow([_format(cell, "," if excel else ".") for cell in row])
    encoding = "utf-8-sig" if excel else "utf-8"
    with write_atomically(path) as beside:
        # Names of files may hold bytes that are no text; they are shown as escapes.
        beside.write_text(text.getvalue(), encoding=encoding, errors="backslashreplace", newline="")


def _format(cell: Cell, point: str) -> str:
    if cell is None:
        return ""
    return repr(cell).replace(".", point) if isinstance(cell, float) else str(cell)
