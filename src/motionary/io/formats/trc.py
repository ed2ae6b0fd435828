"""TRC files: reading and writing markers.

Conventions: cells are separated by tabs; an empty one, or a point whose coordinates are all
zero, was not seen. OpenSim has y up, most laboratories z: the body tells.
"""

import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.formats.content import (
    POINT_UNITS,
    RATE_HINT,
    FileContent,
    number_doubles,
    rate_of_times,
)
from motionary.io.formats.numbers import parse_number, read_table
from motionary.io.normalise.units import NAMES_OF_UNITS
from motionary.io.normalise.units_axes import FileMetadata
from motionary.io.options import ReadOptions
from motionary.io.text import PACKED, read_text, write_text
from motionary.motion import Motion

Floats = NDArray[np.float64]

_TITLE = "PathFileType"
_COLUMNS_BEFORE = 2
# A rate and the times of the frames belong together if they differ by less than this fraction.
_SAME_RATE = 0.02
_DECIMALS = 6
_MM = 1000.0


class _Head(NamedTuple):
    """Header values by name, names of the markers, and the line at which frames begin."""

    values: dict[str, str]
    names: list[str]
    line: int


def read_trc(path: Path, options: ReadOptions) -> FileContent:
    """Content of a TRC file.

    Raises
    ------
    UnreadableFile
        If the file is missing or broken; the message names the line.
    InvalidInput
        If the rate that the file says contradicts the times of its frames.
    """
    text = read_text(path)
    head = _read_head(text, path.name)
    table = _read_table(text, head, path.name)
    kept = [i for i, name in enumerate(head.names) if not name.rpartition(":")[2].startswith("*")]
    if not kept:
        raise UnreadableFile(f"{path.name}: no marker has a name")
    places = table[:, _COLUMNS_BEFORE:].reshape(len(table), -1, 3)[:, kept]
    places[(places == 0).all(axis=2) | np.isnan(places).any(axis=2)] = np.nan
    rate = _rate(head, table[:, 1], path.name) if options.rate_hz is None else options.rate_hz
    first = table[0, 0]
    unit = NAMES_OF_UNITS.get(head.values.get("Units", "").lower())
    notes = [f"{len(head.names) - len(kept)} markers have no label and are left out"]
    return FileContent(
        names=number_doubles([head.names[i] for i in kept]),
        positions=places,
        rate_hz=rate,
        source=path.name,
        metadata=FileMetadata(unit=unit, usual_unit="mm", likely=POINT_UNITS),
        first_frame=int(first) if np.isfinite(first) and abs(first) < 1e15 else 0,
        notes=tuple(notes if len(kept) < len(head.names) else ()),
    )


def _read_head(text: str, name: str) -> _Head:
    lines = text.split("\n", 6)
    if len(lines) < 5 or not lines[0].strip().startswith(_TITLE):
        raise UnreadableFile(f"{name}: expected a TRC file, which begins with {_TITLE}")
    keys, cells = lines[1].split("\t"), lines[2].split("\t")
    if len(keys) < 2:
        keys, cells = lines[1].split(), lines[2].split()
    values = {k.strip(): c.strip() for k, c in zip(keys, cells, strict=False)}
    titles = [cell.strip() for cell in lines[3].split("\t")]
    if len(titles) < 3 or not titles[0].lower().startswith("frame"):
        raise UnreadableFile(f"{name}, line 4: expected Frame#, Time and names of markers")
    # Each name stands above the first of its three columns.
    names = [title for title in titles[_COLUMNS_BEFORE:] if title]
    if not names:
        raise UnreadableFile(f"{name}, line 4: names no markers")
    return _Head(values, names, 5)


def _read_table(text: str, head: _Head, name: str) -> Floats:
    """Frame number, time and coordinates, (frames, 2 + 3 markers); NaN in empty cells."""
    body = text.split("\n", head.line)[head.line :]
    content = body[0] if body else ""
    width = _COLUMNS_BEFORE + 3 * len(head.names)
    table = read_table(
        content, width, source=name, line=head.line + 1, separator="\t", gaps=("", "nan")
    )
    if not len(table):
        raise UnreadableFile(f"{name}: holds no frames")
    promised = head.values.get("NumFrames", "")
    if promised.isdecimal() and int(promised[:20]) > len(table):
        raise UnreadableFile(
            f"{name}: promises {promised[:20]} frames, the file ends after {len(table)}; "
            "get the whole file, or correct the number to read what is there"
        )
    return table


def _rate(head: _Head, times: Floats, name: str) -> float:
    """Frames per second that header and times agree on."""
    stated = parse_number(head.values.get("DataRate", ""))
    timed, _ = rate_of_times(times)
    if not 0 < stated < 1e6:
        stated = float(np.round(timed, 3))
    if not 0 < stated < 1e6:
        raise UnreadableFile(f"{name}: says no frame rate; {RATE_HINT}")
    if abs(timed / stated - 1) > _SAME_RATE:
        raise InvalidInput(
            f"{name}: says {stated:g} frames per second, its times {timed:.4g}; pass the right one "
            "with --rate (rate_hz=...)"
        )
    return stated


def write_trc(motion: Motion, path: str | Path) -> None:
    """Write positions as TRC: millimetres, y up, empty cells where a point was not seen.

    Raises
    ------
    InvalidInput
        If a name holds a tab or a line's end.
    UnwritableFile
        If the file cannot be written.
    """
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
