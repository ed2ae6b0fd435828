"""Labels in tables of separated values.

Conventions: one label a row, `recording,label,start_s,end_s` and, where known,
`start_frame,end_frame,cost,known`; times in seconds from the first frame. Further
columns are kept as text. With semicolons or tabs, a decimal comma is understood.
"""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.text import Cell, read_text, write_table
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording

REQUIRED = ("recording", "label", "start_s", "end_s")
OPTIONAL = ("start_frame", "end_frame", "cost", "known")

_SEPARATORS = ",;\t"


def read_labels(path: str | Path) -> dict[str, LabelTrack]:
    """Labels of a table, one track per recording, sorted by recording.

    Raises
    ------
    UnreadableFile
        If the file is missing, lacks a column, or a row makes no sense; the message
        names the line.
    """
    path = Path(path)
    labels: dict[str, list[Label]] = {}
    for where, row in _rows(read_text(path), path.name):
        if not row["recording"]:
            raise UnreadableFile(f"{where}: the recording is empty")
        labels.setdefault(row["recording"], []).append(_to_label(row, where))
    return {name: LabelTrack(Recording(name), tuple(labels[name])) for name in sorted(labels)}


def write_labels(
    tracks: LabelTrack | Iterable[LabelTrack] | Mapping[str, LabelTrack],
    path: str | Path,
    *,
    excel: bool = False,
) -> None:
    """Write tracks as a table that `read_labels` reads.

    Columns that say nothing are left out: `known` where everything was seen and no label has
    a cost. A track without labels leaves no row.

    Parameters
    ----------
    tracks : one or several
    path : the file
    excel : with semicolons, decimal commas and a mark that says UTF-8, as Excel opens it
        by a double click in most of Europe

    Raises
    ------
    InvalidInput
        If a label's further column has the name of one of this table's own.
    UnwritableFile
        If the file cannot be written; what was there before stays.
    """
    rows = [(track.recording.name, label) for track in _as_tracks(tracks) for label in track]
    extra = list(dict.fromkeys(column for _, label in rows for column in label.extra))
    clash = set(extra) & {*REQUIRED, *OPTIONAL}
    if clash:
        raise InvalidInput(f"a further column cannot be called {', '.join(sorted(clash))}")
    used = [name for name in OPTIONAL if any(_says(label, name) for _, label in rows)]
    table: list[list[Cell]] = [[*REQUIRED, *used, *extra]]
    for recording, label in rows:
        own = [_cell(label, name) for name in ("start_s", "end_s", *used)]
        further = [label.extra.get(column, "") for column in extra]
        table.append([recording, label.name, *own, *further])
    write_table(table, path, excel=excel)


def _as_tracks(
    tracks: LabelTrack | Iterable[LabelTrack] | Mapping[str, LabelTrack],
) -> Iterable[LabelTrack]:
    if isinstance(tracks, LabelTrack):
        return [tracks]
    return tracks.values() if isinstance(tracks, Mapping) else tracks


def _says(label: Label, column: str) -> bool:
    # By people, everything is known; what was measured says so, lest a table's columns
    # change with its recordings.
    if column == "known":
        return label.known < 1 or label.cost is not None
    return getattr(label, column) is not None


def _cell(label: Label, column: str) -> Cell:
    value = getattr(label, column)
    if value is None:
        return None
    return int(value) if column.endswith("_frame") else float(value)


def _rows(text: str, name: str) -> Iterator[tuple[str, dict[str, str]]]:
    """Rows by column, each with its place for errors."""
    lines = text.split("\n")
    skipped = 1 if lines[0].lower().startswith("sep=") else 0
    header = next((line for line in lines[skipped:] if line.strip()), "")
    separator = max(_SEPARATORS, key=header.count)
    rest = io.StringIO("\n".join(lines[skipped:]))
    reader = csv.reader(rest, delimiter=separator, strict=True)
    columns: list[str] = []
    try:
        for cells in reader:
            where = f"{name}, line {reader.line_num + skipped}"
            cells = [cell.strip() for cell in cells]
            if not any(cells):
                continue
            if not columns:
                columns = _check_columns(cells, where)
                continue
            if len(cells) != len(columns):
                raise UnreadableFile(
                    f"{where}: {len(cells)} cells, but the table has {len(columns)} columns"
                )
            if separator != ",":
                cells = [_with_point(cell) for cell in cells]
            yield where, dict(zip(columns, cells, strict=True))
    except csv.Error as error:
        where = f"{name}, line {reader.line_num + skipped}"
        raise UnreadableFile(f"{where}: not a table: {error}") from error
    if not columns:
        raise UnreadableFile(f"{name}: empty; expected a table with {', '.join(REQUIRED)}")


def _check_columns(cells: list[str], where: str) -> list[str]:
    known = {*REQUIRED, *OPTIONAL}
    columns = [cell.lower() if cell.lower() in known else cell for cell in cells]
    missing = [column for column in REQUIRED if column not in columns]
    if missing:
        raise UnreadableFile(
            f"{where}: column {', '.join(missing)} is missing; "
            f"expected {', '.join(REQUIRED)}, got {', '.join(cells)[:80]}"
        )
    twice = sorted({column for column in columns if columns.count(column) > 1})
    if twice:
        raise UnreadableFile(f"{where}: column {', '.join(twice)} occurs twice")
    return columns


def _with_point(cell: str) -> str:
    changed = cell.replace(",", ".", 1)
    return changed if _is_number(changed) else cell


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell)) and "_" not in cell
    except ValueError:
        return False


def _to_label(row: dict[str, str], where: str) -> Label:
    known = _number(row, "known", where)
    try:
        return Label(
            name=row["label"],
            start_s=_needed(row, "start_s", where),
            end_s=_needed(row, "end_s", where),
            cost=_number(row, "cost", where),
            known=1.0 if known is None else known,
            start_frame=_whole(row, "start_frame", where),
            end_frame=_whole(row, "end_frame", where),
            extra={k: v for k, v in row.items() if k not in (*REQUIRED, *OPTIONAL)},
        )
    except InvalidInput as error:
        raise UnreadableFile(f"{where}: {error}") from error


def _needed(row: dict[str, str], column: str, where: str) -> float:
    value = _number(row, column, where)
    if value is None:
        raise UnreadableFile(f"{where}: {column} is empty")
    return value


def _number(row: dict[str, str], column: str, where: str) -> float | None:
    cell = row.get(column, "")
    if not cell:
        return None
    if not _is_number(cell):
        raise UnreadableFile(f"{where}: {column} must be a number, got {cell[:40]!r}")
    return float(cell)


def _whole(row: dict[str, str], column: str, where: str) -> int | None:
    value = _number(row, column, where)
    if value is None:
        return None
    if value != round(value):
        raise UnreadableFile(f"{where}: {column} must be a whole number, got {value}")
    return int(value)
