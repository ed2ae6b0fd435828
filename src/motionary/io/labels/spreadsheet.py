"""Labels in workbooks of Excel (.xlsx): the rows of a table, on the first sheet.

Needs openpyxl, which the extra `xlsx` installs. Cells are text or numbers, never formulas.
"""

import itertools
import re
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from motionary.errors import InvalidInput, MotionaryError, UnreadableFile, Where, describe_cause
from motionary.files import open_regular, write_atomically
from motionary.io.labels.table import FrameTimes, check_columns, collect_rows, list_rows
from motionary.io.text import Cell
from motionary.labels import LabelTrack

_MOST_BYTES = 1 << 28
_MOST_ROWS = 1 << 20
_LOOKED_AT = 1 << 16
# What XML cannot hold, and what would be read as such: Excel writes both as _x0041_.
_SPECIAL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]|_x[0-9A-Fa-f]{4}_")


def _load() -> Any:
    try:
        import openpyxl
    except ImportError:
        raise InvalidInput(
            "workbooks of Excel need openpyxl: pip install 'motionary[xlsx]', or take .csv"
        ) from None
    return openpyxl


def read_spreadsheet(
    path: Path, *, rate_hz: float | None = None, frames: FrameTimes | None = None
) -> dict[str, LabelTrack]:
    """Labels of the first sheet of a workbook; see `read_labels`."""
    openpyxl = _load()
    with open_regular(path) as file:
        try:
            _check_parts(zipfile.ZipFile(file), path.name)
            book = openpyxl.load_workbook(file, data_only=True, read_only=True)
            if not book.worksheets:
                raise UnreadableFile("has no sheet with cells", file=path.name)
            rows = list(_rows(book.worksheets[0], path.name))
        except MotionaryError:
            raise
        except Exception as error:
            # What openpyxl raises on damaged parts is of many kinds.
            raise UnreadableFile(
                f"no workbook of Excel (.xlsx), or a damaged one: {describe_cause(error)}",
                file=path.name,
            ) from error
    return collect_rows(rows, frames or FrameTimes(rate_hz=rate_hz))


def _check_parts(archive: zipfile.ZipFile, name: str) -> None:
    """Refuse what unpacks to more than a table, or defines entities."""
    if sum(part.file_size for part in archive.infolist()) > _MOST_BYTES:
        raise UnreadableFile(
            f"unpacks to more than {_MOST_BYTES >> 20} MB; save the table of labels alone",
            file=name,
        )
    for part in archive.infolist():
        with archive.open(part) as file:
            if b"<!DOCTYPE" in file.read(_LOOKED_AT):
                raise UnreadableFile(
                    f"{part.filename} has a document type; save it anew", file=name
                )


def _rows(sheet: Any, name: str) -> Iterator[tuple[Where, dict[str, str]]]:
    columns: list[str] = []
    # A sheet may say that it is larger than its rows; without this all its cells are made.
    sheet.reset_dimensions()
    for number, values in enumerate(sheet.iter_rows(values_only=True), start=1):
        where = Where(file=name, place=f"row {number}")
        if number > _MOST_ROWS:
            raise UnreadableFile(f"Excel has {_MOST_ROWS} rows at most; save it anew", **where)
        cells = [_to_text(value) for value in values]
        if not any(cells):
            continue
        if not columns:
            while cells and not cells[-1]:
                cells.pop()
            columns = check_columns(cells, where)
            continue
        yield where, dict(itertools.zip_longest(columns, cells[: len(columns)], fillvalue=""))
    if not columns:
        raise UnreadableFile("the first sheet is empty; expected a table of labels", file=name)


def _to_text(value: Any) -> str:
    from openpyxl.utils.escape import unescape

    if isinstance(value, float):
        return repr(value)
    return "" if value is None else unescape(str(value)).strip()


def write_spreadsheet(tracks: Iterable[LabelTrack], path: Path, *, excel: bool = False) -> None:
    """Write tracks as a workbook; see `write_labels`."""
    book = _load().Workbook()
    sheet = book.active
    sheet.title = "labels"
    for number, row in enumerate(list_rows(tracks), start=1):
        for column, value in enumerate(row, start=1):
            _set(sheet.cell(number, column), value)
    sheet.freeze_panes = "A2"
    with write_atomically(path) as beside:
        book.save(beside)


def _set(cell: Any, value: Cell) -> None:
    if isinstance(value, str):
        cell.value = _SPECIAL.sub(lambda found: f"_x{ord(found[0][0]):04X}_{found[0][1:]}", value)
        # What begins with "=" is text as well.
        cell.data_type = "s"
    elif value is not None:
        cell.value = value
