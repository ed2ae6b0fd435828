"""Labels in tables of separated values.

Conventions: one label a row, `recording,label,start_s,end_s` and, where known,
`start_frame,end_frame,cost,known,score,probability,false_per_min,side`; times in seconds
from the first frame. Further columns are kept as text. With semicolons or tabs, a decimal
comma is understood.
"""

import csv
import io
import math
from collections.abc import Iterable, Iterator
from pathlib import Path

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io import text
from motionary.io.formats.numbers import parse_number
from motionary.io.text import Cell, read_text
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording

REQUIRED = ("recording", "label", "start_s", "end_s")
OPTIONAL = (
    "start_frame", "end_frame", "cost", "known", "score", "probability", "false_per_min", "side",
)  # fmt: skip

_SEPARATORS = ",;\t"


def read_table(path: Path) -> dict[str, LabelTrack]:
    """Labels of a table; see `read_labels`."""
    labels: dict[str, list[Label]] = {}
    for where, row in _rows(read_text(path), path.name):
        if not row["recording"]:
            raise UnreadableFile(f"{where}: the recording is empty")
        labels.setdefault(row["recording"], []).append(_to_label(row, where))
    return {name: LabelTrack(Recording(name), tuple(labels[name])) for name in sorted(labels)}


def write_table(tracks: Iterable[LabelTrack], path: Path, *, excel: bool = False) -> None:
    """Write tracks as a table; see `write_labels`."""
    rows = [(track.recording.name, label) for track in tracks for label in track]
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
    text.write_table(table, path, excel=excel)


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


def _rows(content: str, name: str) -> Iterator[tuple[str, dict[str, str]]]:
    """Rows by column, each with its place for errors."""
    lines = content.split("\n")
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
    return cell if math.isnan(parse_number(changed)) else changed


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
            score=_number(row, "score", where),
            probability=_number(row, "probability", where),
            false_per_min=_number(row, "false_per_min", where),
            side=row.get("side", ""),
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
    value = parse_number(cell)
    if math.isnan(value):
        raise UnreadableFile(f"{where}: {column} must be a number, got {cell[:40]!r}")
    return value


def _whole(row: dict[str, str], column: str, where: str) -> int | None:
    value = _number(row, column, where)
    if value is None:
        return None
    if value != round(value):
        raise UnreadableFile(f"{where}: {column} must be a whole number, got {value}")
    return int(value)
