"""Reading and writing labels: one table of their formats, one module per format.

A new format is a module here and a row in `FORMATS`; names of functions are "module:function".
"""

import importlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from motionary.io.text import format_suffix
from motionary.labels import LabelTrack

__all__ = ["FORMATS", "LabelFormat", "read_labels", "write_labels"]


class LabelFormat(NamedTuple):
    """How files of labels are handled: `read` (path, rate_hz=), `write` (tracks, path, excel=)."""

    suffixes: tuple[str, ...]
    read: str
    write: str


#: The first one also takes files of other suffixes.
FORMATS = (LabelFormat((".csv", ".tsv", ".txt"), "table:read_table", "table:write_table"),)


def read_labels(path: str | Path, *, rate_hz: float | None = None) -> dict[str, LabelTrack]:
    """Labels of a file, one track per recording, sorted by recording.

    Parameters
    ----------
    path : the file
    rate_hz : frames per second of the recordings, for tables that say frames, from 0, and no
        times

    Raises
    ------
    UnreadableFile
        If the file is missing, lacks a column, or a row makes no sense; the message
        names the line.
    """
    tracks: dict[str, LabelTrack] = _load(_find(path).read)(Path(path), rate_hz=rate_hz)
    return tracks


def write_labels(
    tracks: LabelTrack | Iterable[LabelTrack] | Mapping[str, LabelTrack],
    path: str | Path,
    *,
    excel: bool = False,
) -> None:
    """Write tracks as a file that `read_labels` reads.

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
    if isinstance(tracks, LabelTrack):
        tracks = [tracks]
    elif isinstance(tracks, Mapping):
        tracks = tracks.values()
    _load(_find(path).write)(tracks, Path(path), excel=excel)


def _find(path: str | Path) -> LabelFormat:
    suffix = format_suffix(path)
    return next((form for form in FORMATS if suffix in form.suffixes), FORMATS[0])


def _load(place: str) -> Callable[..., Any]:
    module, _, name = place.partition(":")
    function: Callable[..., Any] = getattr(
        importlib.import_module(f"motionary.io.labels.{module}"), name
    )
    return function
