"""TRC files: reading and writing markers.

Conventions: cells are separated by tabs; an empty one, or a point whose coordinates are all
zero, was not seen. Tables with commas or blanks for the tabs, with decimal commas, and with a
name over each column are read too. OpenSim has y up, most laboratories z: the body tells.
"""

import itertools
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.formats.content import (
    POINT_UNITS,
    FileContent,
    hide_unseen,
    names_file,
    number_doubles,
)
from motionary.io.formats.numbers import (
    UNKNOWN_NUMBERS,
    check_frames,
    check_length,
    end_alike,
    parse_number,
    read_table,
)
from motionary.io.formats.times import timed_content
from motionary.io.normalise.units import NAMES_OF_UNITS, FileMetadata
from motionary.io.options import ReadOptions
from motionary.io.text import PACKED, read_text, write_text
from motionary.motion import Motion
from motionary.rotations import Floats

_TITLE = "PathFileType"
_COLUMNS_BEFORE = 2
# A name over each of a point's three columns says which coordinate it is, or nothing.
_COORDINATE = re.compile(r"[:._ -]?[xyz]$", re.IGNORECASE)
_SUB_HEADER = re.compile(r"[XYZ]\d+", re.IGNORECASE)
_DECIMALS = 6
_MM = 1000.0


class _Head(NamedTuple):
    """Header values by name, names of the points ("" for none), separator of cells (None for
    blanks), and the line at which frames begin, from 0.
    """

    values: dict[str, str]
    names: list[str]
    separator: str | None
    line: int


@names_file
def read_trc(path: Path, options: ReadOptions) -> FileContent:
    """Content of a TRC file."""
    text = read_text(path)
    head = _read_head(text)
    table, notes = _read_table(text, head)
    kept = [
        i
        for i, name in enumerate(head.names)
        if name and not name.rpartition(":")[2].startswith("*")
    ]
    if not kept:
        raise UnreadableFile("no marker has a name")
    names = number_doubles([head.names[i] for i in kept])
    places = table[:, _COLUMNS_BEFORE:].reshape(len(table), -1, 3)[:, kept]
    n_left = len(head.names) - len(kept)
    if n_left:
        notes.append(f"{n_left} markers have no label and are left out")
    notes.extend(hide_unseen(places, names))
    return timed_content(
        names,
        places,
        table[:, 1],
        options,
        metadata=FileMetadata(
            unit=NAMES_OF_UNITS.get(head.values.get("Units", "").lower()),
            usual_unit="mm",
            likely=POINT_UNITS,
        ),
        stated_hz=parse_number(head.values.get("DataRate", "").replace(",", ".")),
        first_frame=table[0, 0],
        notes=notes,
    )


def _read_head(text: str) -> _Head:
    lines = text.split("\n", 8)
    if len(lines) < 5 or not lines[0].strip().startswith(_TITLE):
        raise UnreadableFile(f"expected a TRC file, which begins with {_TITLE}")
    separator = next((mark for mark in "\t," if mark in lines[3]), None)
    keys, cells = lines[1].split(separator), lines[2].split(separator)
    if len(keys) < 2:
        keys, cells = lines[1].split(), lines[2].split()
    values = {k.strip(): c.strip() for k, c in zip(keys, cells, strict=False)}
    titles = [cell.strip() for cell in lines[3].split(separator)]
    if len(titles) < 3 or not titles[0].lower().startswith("frame"):
        raise UnreadableFile("expected Frame#, Time and names of markers", place="line 4")
    # Some programs leave out the line that numbers the columns.
    begins = 4 if math.isfinite(parse_number(lines[4].split(separator)[0] or "-")) else 5
    counted = sum(bool(_SUB_HEADER.fullmatch(c.strip())) for c in lines[4].split(separator))
    rows = text.split("\n")[begins:]
    first = next((row for row in rows if row.strip()), "").rstrip()
    # Rounded up: the last cells of a row may be missing.
    n_points = (counted or len(first.split(separator)) - _COLUMNS_BEFORE + 2) // 3
    if separator is not None:
        # Points without a name may be there in some frames only.
        most = max((row.rstrip().count(separator) for row in rows), default=0) + 1
        most -= _COLUMNS_BEFORE
        n_points = max(n_points, most // 3 if most % 3 == 0 else 0)
    names = _name_points(titles[_COLUMNS_BEFORE:], n_points)
    if not any(names):
        raise UnreadableFile("names no markers", place="line 4")
    return _Head(values, names, separator, begins)


def _name_points(titles: list[str], n_points: int) -> list[str]:
    """A name per point from the cells over their columns, "" where none stands."""
    while titles and not titles[-1]:
        titles = titles[:-1]
    stems = [_COORDINATE.sub("", title) for title in titles]
    groups = [stems[i : i + 3] for i in range(0, len(stems), 3)]
    if len(titles) == 3 * n_points and all(len(set(group)) == 1 for group in groups):
        return [
            group[0] if len(set(titles[3 * i : 3 * i + 3])) > 1 else titles[3 * i]
            for i, group in enumerate(groups)
        ]
    # Each name stands above the first of its three columns; where cells are shifted, in order.
    if any(title for i, title in enumerate(titles) if i % 3):
        names = [title for title in titles if title]
    else:
        names = titles[::3]
    return names + [""] * (n_points - len(names))


def _read_table(text: str, head: _Head) -> tuple[Floats, list[str]]:
    """Frame number, time and coordinates, (frames, 2 + 3 points), NaN in empty cells; notes."""
    body = text.split("\n", head.line)[head.line :]
    content = body[0] if body else ""
    notes = []
    if head.separator == "\t" and "," in content:
        content = content.replace(",", ".")
        notes.append("numbers have decimal commas")
    table = read_table(
        content,
        _COLUMNS_BEFORE + 3 * len(head.names),
        line=head.line + 1,
        separator=head.separator,
        gaps=UNKNOWN_NUMBERS if head.separator is None else ("", *UNKNOWN_NUMBERS),
    )
    if not len(table):
        raise UnreadableFile("holds no frames")
    check_length(head.values.get("NumFrames", ""), len(table))
    return table, notes


def cut_trc(lines: list[str], first: int, last: int) -> list[str]:
    """Lines of a clip; frames count as the file numbers them, both are included."""
    head = _read_head("".join(lines))
    frames = [line for line in lines[head.line :] if line.strip()]
    if not frames:
        raise UnreadableFile("holds no frames")
    number = parse_number(frames[0].split(head.separator)[0] or "-")
    first_number = int(number) if math.isfinite(number) and abs(number) < 1e15 else 0
    check_frames(first, last, first_number=first_number, n_frames=len(frames))
    chosen = frames[first - first_number : last - first_number + 1]
    header = [line for line in lines[: head.line] if line.strip()]
    keys = [key.strip() for key in header[1].split(head.separator)]
    cells = header[2].split(head.separator)
    if "NumFrames" in keys[: len(cells)]:
        cells[keys.index("NumFrames")] = str(len(chosen))
        header[2] = (head.separator or " ").join(cells)
        header[2] = end_alike([header[2]], header[1])[0]
    return header + end_alike(chosen, header[-1])


def write_trc(motion: Motion, path: str | Path) -> None:
    """Write positions as TRC: millimetres, y up, empty cells where a point was not seen."""
    bad = [n for n in motion.names if not n.strip() or n != n.strip() or set(n) & set("\t\n\r")]
    if bad:
        raise InvalidInput(f"names of TRC markers are without tabs and blank ends, got {bad[0]!r}")
    name = Path(path).name.removesuffix(PACKED)
    n_frames, n_points = motion.positions.shape[:2]
    rate = repr(float(motion.rate_hz))
    head = [
        f"{_TITLE}\t4\t(X/Y/Z)\t{name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame"
        "\tOrigNumFrames",
        f"{rate}\t{rate}\t{n_frames}\t{n_points}\tmm\t{rate}\t{motion.first_frame}\t{n_frames}",
        "Frame#\tTime\t" + "\t\t\t".join(motion.names) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{i}" for i in range(1, 1 + n_points) for axis in "XYZ"),
    ]
    write_text(path, itertools.chain(("\n".join(head),), _format_rows(motion)))


def _format_rows(motion: Motion) -> Iterator[str]:
    for i, frame in enumerate(motion.positions):
        cells = []
        for point in (frame * _MM).tolist():
            if any(math.isnan(value) for value in point):
                cells += ["", "", ""]
                continue
            texts = [f"{value:.{_DECIMALS}f}" for value in point]
            # All zeros would read as not seen.
            if not any(float(text) for text in texts):
                texts[0] = f"{10.0**-_DECIMALS:.{_DECIMALS}f}"
            cells += texts
        time = f"{i / motion.rate_hz:.9f}"
        yield "\n" + "\t".join([str(motion.first_frame + i), time, *cells])
    yield "\n"
