"""Labels in tables: of separated values, and in workbooks of Excel (.xlsx), on the first sheet.

Conventions: one label a row, `recording,label,start_s,end_s` and, where known,
`start_frame,end_frame,cost,known,score,probability,false_per_min,side`; times in seconds
from the first frame, or `1:02:03.5`, or in columns `start_ms,end_ms`; frame numbers alone need
a rate. Further columns are kept as text. A row with 1 in the column `unassessed` is no label.
With semicolons or tabs, a decimal comma is understood;
tables with tabs know no quotes. Workbooks need openpyxl, which the extra `xlsx` installs; their
cells are text or numbers, never formulas.
"""

import csv
import io
import itertools
import math
import re
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from motionary.errors import InvalidInput, MotionaryError, UnreadableFile, Where, describe_cause
from motionary.files import open_regular, write_atomically
from motionary.io.finding import match_recording
from motionary.io.formats.numbers import parse_number
from motionary.io.labels.lanes import UNASSESSED, Found
from motionary.io.text import Cell, read_text
from motionary.io.text import write_table as write_rows
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

_REQUIRED = ("recording", "label", "start_s", "end_s")
_OPTIONAL = (
    "start_frame", "end_frame", "cost", "known", "score", "probability", "false_per_min", "side",
)  # fmt: skip
_MEASURED = ("cost", "score", "probability", "false_per_min")

_SEPARATORS = ",;\t"
# Where times may stand, the first that is there counts.
_TIMES = {
    "start_s": ("start_s", "start_ms", "start_frame"),
    "end_s": ("end_s", "end_ms", "end_frame"),
}
_MILLISECONDS = ("start_ms", "end_ms")
_NUMBERS = frozenset({*_REQUIRED[2:], *_OPTIONAL[:-1], *_MILLISECONDS})
_NOTHING = frozenset({"", "-", "na", "n/a"})
_NO = frozenset({*_NOTHING, "0", "false", "no"})

_MOST_BYTES = 1 << 28
_MOST_ROWS = 1 << 20
_LOOKED_AT = 1 << 16
# What XML cannot hold, and what would be read as such: Excel writes both as _x0041_.
_SPECIAL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]|_x[0-9A-Fa-f]{4}_")


@dataclass(frozen=True, kw_only=True)
class FrameTimes:
    """How numbers of frames become times.

    Attributes
    ----------
    rate_hz : frames per second, where the recordings do not say it
    in_frames : whether `start_s` and `end_s` are numbers of frames, too
    recordings : by name, for their rates and the numbers of their first frames
    """

    rate_hz: float | None = None
    in_frames: bool = False
    recordings: Mapping[str, Recording] = field(default_factory=dict)
    # Tables have a row a label, and matching looks through all names.
    _matched: dict[str, str | None] = field(default_factory=dict, init=False, repr=False)

    def to_seconds(self, frame: float, name: str, where: Where, *, is_end: bool) -> float:
        """Seconds at which a frame of a recording begins or, the last one of a label, ends."""
        if name not in self._matched:
            self._matched[name] = match_recording(name, self.recordings)
        found = self._matched[name]
        rate_hz, first = self.rate_hz, 0
        if found is not None:
            recording = self.recordings[found]
            rate_hz, first = recording.rate_hz or rate_hz, recording.first_frame
        if not rate_hz:
            raise UnreadableFile(
                "says frames and no times; expected columns start_s, end_s, or a rate "
                "(--rate HZ, rate_hz=...), from which times follow",
                **where,
            )
        if frame < first:
            raise UnreadableFile(f"frame {frame:g} comes before the first one, {first}", **where)
        return (frame - first + is_end) / rate_hz


def read_any(path: Path, *, frames: FrameTimes) -> dict[str, LabelTrack]:
    """Labels of a table, one of BORIS, or a label track of Audacity; see `read_labels`."""
    from motionary.io.labels.boris import is_boris, read_boris
    from motionary.io.labels.lines import is_audacity, read_audacity

    content = read_text(path)
    # Without labels, such a track is an empty file.
    if is_audacity(content) or (not content and path.suffix.lower() == ".txt"):
        return read_audacity(path)
    if is_boris(content):
        return read_boris(path)
    return _collect(_rows(content, path.name), frames)


def _collect(
    rows: Iterable[tuple[Where, dict[str, str]]], frames: FrameTimes
) -> dict[str, LabelTrack]:
    """Tracks of rows by column, each with its place for errors."""
    found = Found()
    for where, row in rows:
        name = row["recording"]
        if not name:
            raise UnreadableFile("the recording is empty", **where)
        if row.pop(UNASSESSED, "").lower() in _NO:
            found.add_label(name, _to_label(row, where, frames))
        else:
            times = (_time(row, column, where, frames) for column in _TIMES)
            found.add(name, None, Segment(*times), where=where)
    return found.tracks()


def write_table(tracks: Iterable[LabelTrack], path: Path, *, excel: bool = False) -> None:
    """Write tracks as a table; see `write_labels`."""
    write_rows(_list_rows(tracks), path, excel=excel)


def _list_rows(tracks: Iterable[LabelTrack]) -> list[list[Cell]]:
    """Rows of a table of tracks, headings first."""
    tracks = list(tracks)
    rows = [(track.recording.name, label) for track in tracks for label in track]
    extra = list(dict.fromkeys(column for _, label in rows for column in label.extra))
    clash = set(extra) & {*_REQUIRED, *_OPTIONAL, UNASSESSED}
    if clash:
        raise InvalidInput(f"a further column cannot be called {', '.join(sorted(clash))}")
    used = [name for name in _OPTIONAL if any(_says(label, name) for _, label in rows)]
    mark = [UNASSESSED] if any(track.unassessed for track in tracks) else []
    table: list[list[Cell]] = [[*_REQUIRED, *used, *extra, *mark]]
    for track in tracks:
        for label in track:
            own = [_cell(label, name) for name in ("start_s", "end_s", *used)]
            further = [label.extra.get(column, "") for column in extra]
            table.append([track.recording.name, label.name, *own, *further, *[None] * len(mark)])
        for start_s, end_s in track.unassessed:
            times = [float(start_s), float(end_s)]
            blank = [None] * (len(used) + len(extra))
            table.append([track.recording.name, None, *times, *blank, 1])
    return table


def _says(label: Label, column: str) -> bool:
    # By people, everything is known; what was measured says so, lest a table's columns
    # change with its recordings.
    if column == "known":
        return label.known < 1 or label.cost is not None
    if column == "side":
        return bool(label.side)
    return getattr(label, column) is not None


def _cell(label: Label, column: str) -> Cell:
    value = getattr(label, column)
    if value is None or isinstance(value, str):
        return value
    return int(value) if column.endswith("_frame") else float(value)


def _rows(content: str, name: str) -> Iterator[tuple[Where, dict[str, str]]]:
    """Rows by column, each with its place for errors."""
    lines = content.split("\n")
    skipped = 1 if lines[0].lower().startswith("sep=") else 0
    header = next((line for line in lines[skipped:] if line.strip()), "")
    separator = max(_SEPARATORS, key=header.count)
    # With tabs between them, cells need no quotes and have none.
    rest, plain = io.StringIO("\n".join(lines[skipped:])), separator == "\t"
    quoting: Literal[0, 3] = csv.QUOTE_NONE if plain else csv.QUOTE_MINIMAL
    reader = csv.reader(rest, delimiter=separator, strict=True, quoting=quoting)
    columns: list[str] = []
    try:
        for cells in reader:
            where = Where(file=name, place=f"line {reader.line_num + skipped}")
            cells = [cell.strip() for cell in cells]
            if not any(cells):
                continue
            if not columns:
                columns = _check_columns(cells, where)
                continue
            while len(cells) > len(columns) and not cells[-1]:
                cells.pop()
            if len(cells) != len(columns):
                raise UnreadableFile(
                    f"{len(cells)} cells, but the table has {len(columns)} columns", **where
                )
            yield where, _to_row(columns, cells, where, comma=separator != ",")
    except csv.Error as error:
        where = Where(file=name, place=f"line {reader.line_num + skipped}")
        raise UnreadableFile(f"not a table: {error}", **where) from error
    if not columns:
        raise UnreadableFile(f"empty; expected a table with {', '.join(_REQUIRED)}", file=name)


def _to_row(columns: list[str], cells: list[str], where: Where, *, comma: bool) -> dict[str, str]:
    """Cells by column; numbers with a decimal point."""
    row = {}
    for column, cell in zip(columns, cells, strict=True):
        if column:
            row[column] = _with_point(cell) if comma and column in _NUMBERS else cell
        elif cell:
            raise UnreadableFile(f"{cell[:40]!r} stands in a column without a name", **where)
    return row


def _check_columns(cells: list[str], where: Where) -> list[str]:
    """Names of columns, in small letters where they are this table's own."""
    known = {*_REQUIRED, *_OPTIONAL, *_MILLISECONDS, UNASSESSED}
    columns = [cell.lower() if cell.lower() in known else cell for cell in cells]
    missing = [
        name for name in _REQUIRED if not set(_TIMES.get(name, (name,))).intersection(columns)
    ]
    if missing:
        raise UnreadableFile(
            f"column {', '.join(missing)} is missing; "
            f"expected {', '.join(_REQUIRED)}, got {', '.join(cells)[:80]}",
            **where,
        )
    twice = sorted({column for column in columns if column and columns.count(column) > 1})
    if twice:
        raise UnreadableFile(f"column {', '.join(twice)} occurs twice", **where)
    return columns


def _with_point(cell: str) -> str:
    changed = cell.replace(",", ".", 1)
    return cell if all(math.isnan(parse_number(part)) for part in changed.split(":")) else changed


def _to_label(row: dict[str, str], where: Where, frames: FrameTimes) -> Label:
    known = _number(row, "known", where)
    own = {*_REQUIRED, *_OPTIONAL, *_MILLISECONDS}
    measured = {key: _number(row, key, where) for key in _MEASURED}
    whole = frames.in_frames and "start_s" in row
    try:
        return Label(
            name=row["label"],
            start_s=_time(row, "start_s", where, frames),
            end_s=_time(row, "end_s", where, frames),
            known=1.0 if known is None else known,
            start_frame=_whole(row, "start_s" if whole else "start_frame", where),
            end_frame=_whole(row, "end_s" if whole else "end_frame", where),
            side=row.get("side", ""),
            extra={k: v for k, v in row.items() if k not in own},
            **measured,
        )
    except InvalidInput as error:
        raise UnreadableFile(str(error), **where) from error


def _time(row: dict[str, str], column: str, where: Where, frames: FrameTimes) -> float:
    """Seconds of a row's start or end, whichever way it is written."""
    place = next(other for other in _TIMES[column] if other in row)
    cell = row[place]
    if place == column and ":" in cell and not frames.in_frames:
        parts = [parse_number(part) for part in cell.split(":")]
        if len(parts) > 3 or any(math.isnan(part) or part < 0 for part in parts):
            raise UnreadableFile(
                f"{column} must be a time, as 1:02:03.5, got {cell[:40]!r}", **where
            )
        return sum(part * 60.0**i for i, part in enumerate(reversed(parts)))
    value = _number(row, place, where)
    if value is None:
        raise UnreadableFile(f"{place} is empty" + (f" ({cell[:40]!r})" if cell else ""), **where)
    if place in _MILLISECONDS:
        return value / 1000
    if place == column and not frames.in_frames:
        return value
    # The last frame belongs to the label.
    return frames.to_seconds(value, row["recording"], where, is_end=column == "end_s")


def _number(row: dict[str, str], column: str, where: Where) -> float | None:
    cell = row.get(column, "")
    if cell.lower() in _NOTHING:
        return None
    value = parse_number(cell)
    if math.isnan(value):
        raise UnreadableFile(f"{column} must be a number, got {cell[:40]!r}", **where)
    return value


def _whole(row: dict[str, str], column: str, where: Where) -> int | None:
    value = _number(row, column, where)
    if value is not None and value != round(value):
        raise UnreadableFile(f"{column} must be a whole number, got {value}", **where)
    return None if value is None else int(value)


# -- workbooks ----------------------------------------------------------------------------


def _load_openpyxl() -> Any:
    try:
        import openpyxl
    except ImportError:
        raise InvalidInput(
            "workbooks of Excel need openpyxl: pip install 'motionary[xlsx]', or take .csv"
        ) from None
    return openpyxl


def read_spreadsheet(path: Path, *, frames: FrameTimes) -> dict[str, LabelTrack]:
    """Labels of the first sheet of a workbook; see `read_labels`."""
    openpyxl = _load_openpyxl()
    with open_regular(path) as file:
        try:
            _check_parts(zipfile.ZipFile(file), path.name)
            book = openpyxl.load_workbook(file, data_only=True, read_only=True)
            if not book.worksheets:
                raise UnreadableFile("has no sheet with cells", file=path.name)
            rows = list(_read_sheet(book.worksheets[0], path.name))
        except MotionaryError:
            raise
        except Exception as error:
            # What openpyxl raises on damaged parts is of many kinds.
            raise UnreadableFile(
                f"no workbook of Excel (.xlsx), or a damaged one: {describe_cause(error)}",
                file=path.name,
            ) from error
    return _collect(rows, frames)


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


def _read_sheet(sheet: Any, name: str) -> Iterator[tuple[Where, dict[str, str]]]:
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
            columns = _check_columns(cells, where)
            continue
        yield where, dict(itertools.zip_longest(columns, cells[: len(columns)], fillvalue=""))
    if not columns:
        raise UnreadableFile("the first sheet is empty; expected a table of labels", file=name)


def _to_text(value: Any) -> str:
    from openpyxl.utils.escape import unescape

    if isinstance(value, float):
        return repr(value)
    return "" if value is None else unescape(str(value)).strip()


def write_spreadsheet(tracks: Iterable[LabelTrack], path: Path) -> None:
    """Write tracks as a workbook; see `write_labels`."""
    book = _load_openpyxl().Workbook()
    sheet = book.active
    sheet.title = "labels"
    for number, row in enumerate(_list_rows(tracks), start=1):
        for column, value in enumerate(row, start=1):
            _set_cell(sheet.cell(number, column), value)
    sheet.freeze_panes = "A2"
    with write_atomically(path) as beside:
        book.save(beside)


def _set_cell(cell: Any, value: Cell) -> None:
    if isinstance(value, str):
        cell.value = _SPECIAL.sub(lambda found: f"_x{ord(found[0][0]):04X}_{found[0][1:]}", value)
        # What begins with "=" is text as well.
        cell.data_type = "s"
    elif value is not None:
        cell.value = value
