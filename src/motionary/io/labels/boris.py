"""Labels in tables of BORIS, the Behavioral Observation Research Interactive Software.

Two layouts are exported there: *aggregated events*, a row a label with start and stop, and
*tabular events*, a row for each start and each stop. Both are read by the names of their
columns, with commas, semicolons or tabs.

Conventions: an observation is a recording, a behaviour a label, a subject a track; overlaps of
the same behaviour go to a further subject. What was not assessed is a behaviour of the category
`unassessed`. A point event is a label without duration.
"""

import csv
import io
import math
from collections.abc import Iterable
from pathlib import Path

from motionary.errors import UnreadableFile, Where
from motionary.io.formats.numbers import parse_number
from motionary.io.labels.lanes import (
    UNASSESSED,
    Found,
    list_unassessed,
    plain_line,
    split_lanes,
    track_of_lane,
    with_track,
)
from motionary.io.text import Cell, read_text, stem_of, write_table
from motionary.labels import Label, LabelTrack
from motionary.recording import Recording, Segment

_BEFORE = (
    "Observation id", "Observation date", "Description", "Observation type", "Source",
    "Time offset (s)", "Coding duration", "Media duration (s)", "FPS (frame/s)", "Subject",
    "Observation duration by subject by observation", "Behavior", "Behavioral category",
    "Behavior type",
)  # fmt: skip
_AGGREGATED = (
    *_BEFORE, "Start (s)", "Stop (s)", "Duration (s)", "Media file name", "Image index start",
    "Image index stop", "Image file path start", "Image file path stop", "Comment start",
    "Comment stop",
)  # fmt: skip
_TABULAR = (
    "Observation id", "Observation date", "Description", "Observation duration",
    "Observation type", "Source", "Time offset (s)", "Media duration (s)", "FPS", "Subject",
    "Behavior", "Behavioral category", "Behavior type", "Time", "Media file name", "Image index",
    "Image file path", "Comment",
)  # fmt: skip
_START, _STOP, _POINT, _STATE = "START", "STOP", "POINT", "STATE"
_NOBODY = "No focal subject"
_FOLLOWING = ("Behavior", "Subject")

Row = dict[str, str]
#: Place, row, subject and time of labels.
Events = list[tuple[Where, Row, str, Segment]]


def is_boris(content: str) -> bool:
    """Whether the text of a table is one of BORIS."""
    return _find_header(_cells(content)) is not None


def read_boris(path: Path) -> dict[str, LabelTrack]:
    """Labels of a table of BORIS, of either layout; see `read_labels`."""
    cells = _cells(read_text(path))
    header = _find_header(cells)
    if header is None:
        raise UnreadableFile(
            "expected a table of BORIS with the columns Behavior, Subject and "
            "Start (s), Stop (s) or Time",
            file=path.name,
        )
    # Older versions say above the table which observation it is.
    above = {row[0]: row[1] for row in cells[:header] if len(row) > 1}
    rows = []
    for number, line in enumerate(cells[header + 1 :], start=header + 2):
        if any(line):
            row = dict(zip(cells[header], line, strict=False))
            row.setdefault("Observation id", above.get("Observation id") or stem_of(path))
            rows.append((Where(file=path.name, place=f"row {number}"), row))
    is_aggregated = "Start (s)" in cells[header]
    events = _read_aggregated(rows) if is_aggregated else _pair_events(rows)
    subjects = {subject for _, _, subject, _ in events}
    found = Found(*_recordings(row for _, row in rows))
    for where, row, subject, segment in events:
        name = None if row.get("Behavioral category") == UNASSESSED else row["Behavior"]
        track = track_of_lane(subject, subjects)
        found.add(row["Observation id"], name, segment, where=where, track=track)
    return found.tracks()


def _cells(content: str) -> list[list[str]]:
    first = next((line for line in content.split("\n") if "Behavior" in line), "")
    separator = max(",;\t", key=first.count)
    try:
        return [
            [cell.strip() for cell in row]
            for row in csv.reader(io.StringIO(content), delimiter=separator)
        ]
    except csv.Error:
        return []


def _find_header(cells: list[list[str]]) -> int | None:
    for i, row in enumerate(cells[:200]):
        has_times = {"Start (s)", "Stop (s)"} <= set(row) or "Time" in row
        if has_times and all(name in row for name in _FOLLOWING):
            return i
    return None


def _read_aggregated(rows: Iterable[tuple[Where, Row]]) -> Events:
    events = []
    for where, row in rows:
        start = _seconds(row, "Start (s)", where)
        # Points may be without one.
        has_end = row.get("Stop (s)", "").lower() not in ("", "na", "nan")
        end = _seconds(row, "Stop (s)", where) if has_end else start
        events.append((where, row, _subject(row), Segment(start, end)))
    return events


def _pair_events(rows: Iterable[tuple[Where, Row]]) -> Events:
    """Each start with the next stop of its subject and behaviour."""
    events: Events = []
    running: dict[tuple[str, ...], tuple[Where, Row, float]] = {}
    for where, row in rows:
        kind = (row.get("Behavior type") or row.get("Status") or _POINT).upper()
        time = _seconds(row, "Time", where)
        subject = _subject(row)
        key = (row["Observation id"], subject, row["Behavior"])
        if kind == _START and key not in running:
            running[key] = (where, row, time)
        elif kind == _STOP and key in running:
            _, begun, start = running.pop(key)
            events.append((where, begun, subject, Segment(start, time)))
        elif kind == _POINT:
            events.append((where, row, subject, Segment(time, time)))
        else:
            raise UnreadableFile(
                f"{row['Behavior'][:40]!r} of {subject or _NOBODY!r} "
                f"{'starts twice' if kind == _START else 'stops and never started'}; correct it "
                "in BORIS (Observations, Check state events)",
                **where,
            )
    for where, row, _ in running.values():
        raise UnreadableFile(
            f"{row['Behavior'][:40]!r} starts and never stops; correct it in BORIS "
            "(Observations, Fix unpaired events)",
            **where,
        )
    return events


def _subject(row: Row) -> str:
    subject = row.get("Subject", "")
    return "" if subject == _NOBODY else subject


def _seconds(row: Row, column: str, where: Where) -> float:
    cell = row.get(column, "")
    value = parse_number(cell.replace(",", "."))
    if math.isnan(value):
        raise UnreadableFile(f"{column} must be a number of seconds, got {cell[:40]!r}", **where)
    return value


def _recordings(rows: Iterable[Row]) -> Iterable[Recording]:
    found: dict[str, Recording] = {}
    for row in rows:
        name = row["Observation id"]
        rate = parse_number(row.get("FPS (frame/s)") or row.get("FPS") or "")
        length = parse_number(row.get("Media duration (s)", ""))
        if name not in found and 0 < rate < math.inf:
            n_frames = round(length * rate) if 0 < length < math.inf else 0
            found[name] = Recording(name, rate_hz=rate, n_frames=n_frames)
    return found.values()


def write_aggregated(tracks: Iterable[LabelTrack], path: Path, *, excel: bool = False) -> None:
    """Write tracks as aggregated events; see `write_labels`."""
    table: list[list[Cell]] = [list(_AGGREGATED)]
    for track in tracks:
        for label, row in _state_rows(track):
            row |= {
                "Start (s)": float(label.start_s), "Stop (s)": float(label.end_s),
                "Duration (s)": float(label.end_s - label.start_s),
                "Image index start": _index(track, label.start_s),
                "Image index stop": _index(track, label.end_s),
            }  # fmt: skip
            table.append([row.get(column) for column in _AGGREGATED])
    write_table(table, path, excel=excel)


def write_tabular(tracks: Iterable[LabelTrack], path: Path, *, excel: bool = False) -> None:
    """Write tracks as tabular events; see `write_labels`."""
    table: list[list[Cell]] = [list(_TABULAR)]
    for track in tracks:
        events = []
        for number, (label, row) in enumerate(_state_rows(track)):
            if label.start_s == label.end_s:
                events.append((label.start_s, 1, number, row))
                continue
            # What stops makes room for what starts at the same time.
            events.append((label.start_s, 2, number, row | {"Behavior type": _START}))
            events.append((label.end_s, 0, number, row | {"Behavior type": _STOP}))
        for time, _, _, row in sorted(events, key=lambda event: event[:3]):
            row = row | {"Time": float(time), "Image index": _index(track, time)}
            table.append([row.get(column) for column in _TABULAR])
    write_table(table, path, excel=excel)


def _state_rows(track: LabelTrack) -> list[tuple[Label, dict[str, Cell]]]:
    """What both layouts say of each label, and of what was not assessed."""
    recording = track.recording
    length = recording.duration_s or None
    rate = float(recording.rate_hz) or None
    shared: dict[str, Cell] = {
        "Observation id": recording.name, "Observation type": "Media file(s)",
        "Media file name": recording.name, "Source": recording.name, "Time offset (s)": 0.0,
        "Media duration (s)": length, "Observation duration": length,
        "FPS (frame/s)": rate, "FPS": rate,
    }  # fmt: skip
    lanes = split_lanes(track.labels, by_name=True)
    rows = [
        (label, shared | _behaviour(label, _NOBODY if not with_track(lane) else lane))
        for lane, labels in lanes.items()
        for label in labels
    ]
    rows += [
        (label, shared | _behaviour(label, _NOBODY) | {"Behavioral category": UNASSESSED})
        for label in list_unassessed(track)
    ]
    return sorted(rows, key=lambda pair: (pair[0].start_s, pair[0].end_s))


def _behaviour(label: Label, subject: str) -> dict[str, Cell]:
    kind = _POINT if label.start_s == label.end_s else _STATE
    return {
        "Subject": plain_line(subject), "Behavior": plain_line(label.name), "Behavior type": kind,
    }  # fmt: skip


def _index(track: LabelTrack, time_s: float) -> Cell:
    rate = track.recording.rate_hz
    return round(time_s * rate) if rate else None
