"""Reading and writing labels: one table of their formats, one module per family of formats.

A new format is a module here and a row in `FORMATS`; names of functions are "module:function".
A file's name says its format by its suffix; where several share one, reading looks into the
file, and writing needs the format's name.
"""

import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from motionary.errors import InvalidInput, UnreadableFile, check_kind, check_path, describe_cause
from motionary.files import is_stdout
from motionary.io.text import format_suffix
from motionary.labels import LabelTrack
from motionary.recording import Recording

__all__ = [
    "FORMATS", "LabelFormat", "check_label_file", "find_label_format", "read_labels",
    "write_labels",
]  # fmt: skip


class LabelFormat(NamedTuple):
    """How files of labels are handled.

    Attributes
    ----------
    name : as `to=` takes it
    suffixes : in lower case; the first one is written
    title : what it is, for people
    read : function of (path), of tables also of frames=, of JSON of rate_hz=
    write : function of (tracks, path), where `is_single` of (track, path)
    resolution_s : to which times are rounded; 0 where they are not
    is_single : whether a file holds one recording
    keeps_all : whether costs, scores and further columns are kept
    needs_recording : whether `write` takes recording=, the file of what is labelled
    for_excel : whether `write` takes excel=
    """

    name: str
    suffixes: tuple[str, ...]
    title: str
    read: str
    write: str
    resolution_s: float = 0.0
    is_single: bool = False
    keeps_all: bool = False
    needs_recording: bool = False
    for_excel: bool = False


_TABLES = "table:read_any"
_WORKBOOKS = "table:read_spreadsheet"
_JSON = "json_files:read_json"

#: The first one of a suffix is what writing takes; "" are names without a suffix.
FORMATS = (
    LabelFormat(
        "csv", (".csv", ".txt", ""), "table of separated values", _TABLES, "table:write_table",
        keeps_all=True, for_excel=True,
    ),
    LabelFormat(
        "tsv", (".tsv",), "table with tabs", _TABLES, "table:write_table", keeps_all=True,
        for_excel=True,
    ),
    LabelFormat(
        "xlsx", (".xlsx",), "Excel", _WORKBOOKS, "table:write_spreadsheet", resolution_s=1e-9,
        keeps_all=True,
    ),
    LabelFormat(
        "jsonl", (".jsonl",), "JSON lines", "json_files:read_lines", "json_files:write_lines",
        keeps_all=True,
    ),
    LabelFormat(
        "elan", (".eaf",), "ELAN", "tiers:read_elan", "tiers:write_elan", resolution_s=1e-3,
        is_single=True,
    ),
    LabelFormat(
        "praat", (".textgrid",), "Praat", "tiers:read_text_grid", "tiers:write_text_grid",
        is_single=True,
    ),
    LabelFormat(
        "srt", (".srt",), "SubRip", "lines:read_subtitles", "lines:write_srt",
        resolution_s=1e-3, is_single=True,
    ),
    LabelFormat(
        "vtt", (".vtt",), "WebVTT", "lines:read_subtitles", "lines:write_vtt",
        resolution_s=1e-3, is_single=True,
    ),
    LabelFormat(
        "audacity", (".txt",), "Audacity", _TABLES, "lines:write_audacity",
        resolution_s=1e-6, is_single=True,
    ),
    LabelFormat(
        "boris", (".csv", ".tsv"), "BORIS, aggregated", _TABLES, "boris:write_aggregated",
        for_excel=True,
    ),
    LabelFormat(
        "boris-tabular", (".csv", ".tsv"), "BORIS, tabular", _TABLES, "boris:write_tabular",
        for_excel=True,
    ),
    LabelFormat(
        "label-studio", (".json",), "Label Studio, time series", _JSON, "json_files:write_series"
    ),
    LabelFormat(
        "label-studio-video", (".json",), "Label Studio, video", _JSON, "json_files:write_video"
    ),
    LabelFormat("babel", (".json",), "BABEL", _JSON, "json_files:write_babel"),
    LabelFormat(
        "blender", (".json",), "Blender", _JSON, "lines:write_markers", is_single=True,
        needs_recording=True,
    ),
    LabelFormat(
        "c3d", (".c3d",), "C3D", "lines:read_c3d_events", "lines:write_c3d_events",
        resolution_s=1e-5, is_single=True, needs_recording=True,
    ),
)  # fmt: skip
#: By these names alone a format is written: tables, which any suffix of a table means.
_NEEDS_NAME = frozenset({".json"})
_REMEDY = "labels are of a recording: LabelTrack(Recording(name), labels)"


def read_labels(
    path: str | Path,
    *,
    rate_hz: float | None = None,
    in_frames: bool = False,
    recordings: Mapping[str, Recording] | None = None,
) -> dict[str, LabelTrack]:
    """Labels of a file, one track per recording, sorted by recording.

    The suffix says the format: a table (.csv, .tsv, .txt; also those of BORIS, and label tracks
    of Audacity), .xlsx, .jsonl, .eaf (ELAN), .TextGrid (Praat), .srt, .vtt, .json (Label Studio,
    BABEL, Blender's markers), .c3d (events). Times that a format rounds to milliseconds are put
    back on the frames where the rate is known.

    Parameters
    ----------
    path : the file
    rate_hz : frames per second of the recordings, for files that do not say it
    in_frames : whether the times of tables are numbers of frames as the recordings count them,
        the last one included; those in columns `start_frame`, `end_frame` without times always are
    recordings : by name: what is labelled, for its rate and the number of its first frame, which
        without them is 0

    Raises
    ------
    InvalidInput
        If the times of another format than tables are to be numbers of frames.
    UnreadableFile
        If the file is missing, broken, of an unknown format, lacks a column, or a row makes no
        sense; the message names the line.
    """
    form = _find(check_path(path))
    is_table = form.read in (_TABLES, _WORKBOOKS)
    if in_frames and not is_table:
        raise InvalidInput(f"times of {form.title} are no frames; tables may have them", file=path)
    try:
        further: dict[str, Any] = {"rate_hz": rate_hz} if form.read == _JSON else {}
        if is_table:
            from motionary.io.labels.table import FrameTimes

            frames = FrameTimes(rate_hz=rate_hz, in_frames=in_frames, recordings=recordings or {})
            further["frames"] = frames
        tracks: dict[str, LabelTrack] = _load(form.read)(Path(path), **further)
        return _put_on_frames(tracks, form, rate_hz)
    except InvalidInput as error:
        raise UnreadableFile(str(error), file=Path(path).name) from error
    except (ValueError, OverflowError, LookupError, TypeError, AttributeError) as error:
        # What another program wrote is of other kinds than its layout says.
        raise UnreadableFile(
            f"is damaged, or no {form.title}: {describe_cause(error)}", file=Path(path).name
        ) from error


def _put_on_frames(
    tracks: dict[str, LabelTrack], form: LabelFormat, rate_hz: float | None
) -> dict[str, LabelTrack]:
    same = [x for x in FORMATS if x.read == form.read and set(x.suffixes) & set(form.suffixes)]
    resolution_s = max(x.resolution_s for x in same)
    if not resolution_s:
        return tracks
    from motionary.io.labels.lanes import put_on_frames

    rates = {name: track.rate_hz or rate_hz for name, track in tracks.items()}
    return {
        name: put_on_frames(track, rate, resolution_s) if (rate := rates[name]) else track
        for name, track in tracks.items()
    }


def write_labels(
    tracks: LabelTrack | Iterable[LabelTrack] | Mapping[str, LabelTrack],
    path: str | Path,
    *,
    to: str | None = None,
    excel: bool = False,
    recording: str | Path | None = None,
) -> None:
    """Write tracks as a file that `read_labels` reads.

    Tables leave out columns that say nothing: `known` where everything was seen and no label has
    a cost. What was not assessed is a row without a label and with 1 in the column `unassessed`,
    in other formats a tier or comment of its own. A track with neither leaves no row. A label's
    further column `track` is its tier, where there are some.

    Parameters
    ----------
    tracks : one or several
    path : the file; its suffix says the format
    to : the format by name, where the suffix is that of several: "boris", "boris-tabular",
        "audacity", "label-studio", "label-studio-video", "babel", "blender"
    excel : tables with semicolons, decimal commas and a mark that says UTF-8, as Excel opens
        them by a double click in most of Europe
    recording : the recording's file, of which C3D is a copy with events; for Blender it is
        written as BVH beside the markers

    Raises
    ------
    InvalidInput
        If the suffix is that of no format or of several, the format holds one recording and
        there are several, or a label's further column has the name of one of a table's own.
    UnwritableFile
        If the file cannot be written; what was there before stays.
    """
    if isinstance(tracks, LabelTrack):
        tracks = [tracks]
    elif isinstance(tracks, Mapping):
        tracks = tracks.values()
    check_kind(tracks, (Iterable,), name="tracks", remedy=_REMEDY)
    tracks = list(tracks)
    for track in tracks:
        check_kind(track, (LabelTrack,), name="a track", remedy=_REMEDY)
    form = find_label_format(check_path(path), to=to)
    if form.needs_recording and recording is None:
        raise InvalidInput(
            f"{form.title} needs the recording that is labelled; say recording=... "
            "(--recordings PATH)",
            file=path,
        )
    further: dict[str, Any] = {"excel": excel} if form.for_excel else {}
    if form.needs_recording:
        further["recording"] = Path(str(recording))
    path = Path(path)
    _load(form.write)(_only_one(tracks, path) if form.is_single else tracks, path, **further)


def _only_one(tracks: Sequence[LabelTrack], path: Path) -> LabelTrack:
    """The only track, for formats that hold one recording."""
    if len(tracks) > 1:
        names = [track.recording.name for track in tracks]
        some = ", ".join([*names[:3], *["..."][: len(names) > 3]])
        raise InvalidInput(
            f"holds one recording, got {len(tracks)} ({some}); "
            "write a file of each into a folder: motionary labels convert LABELS -o FOLDER --to "
            f"{path.suffix or 'FORMAT'}",
            file=path.name,
        )
    return tracks[0] if tracks else LabelTrack(Recording(path.stem))


def find_label_format(path: str | Path, *, to: str | None = None) -> LabelFormat:
    """The format that a file is written in.

    Raises
    ------
    InvalidInput
        If there is none of this name or suffix, or several.
    """
    if to is not None:
        wanted = to.lower()
        named = [f for f in FORMATS if wanted == f.name]
        named = named or [f for f in FORMATS if f".{wanted.lstrip('.')}" in f.suffixes]
        if not named:
            raise InvalidInput(f"no format of labels is called {to!r}; there are {_list_formats()}")
        if len(named) > 1 and f".{wanted.lstrip('.')}" in _NEEDS_NAME:
            raise InvalidInput(f"{to} may be {' or '.join(f.name for f in named)}; say which")
        return named[0]
    suffix = "" if is_stdout(path) else format_suffix(path)
    found = [form for form in FORMATS if suffix in form.suffixes]
    if not found:
        raise InvalidInput(
            f"labels are not written as {suffix}, got {path}; formats are {_list_formats()}"
        )
    if suffix in _NEEDS_NAME:
        names = ", ".join(form.name for form in found)
        raise InvalidInput(f"{suffix} is of several formats, got {path}; name one: {names}")
    return found[0]


def check_label_file(path: str | Path, *, excel: bool = False, several: bool = False) -> None:
    """Refuse, before the work, a name by which labels cannot be written.

    Parameters
    ----------
    excel : whether the table is to be for Excel
    several : whether there is more than one recording

    Raises
    ------
    InvalidInput
    """
    form = find_label_format(path)
    if excel and not form.for_excel:
        raise InvalidInput(f"only tables are written for Excel so, got {path}; leave --excel out")
    if form.needs_recording:
        raise InvalidInput(
            f"labels are not written into {form.title} files here; write a table, then `motionary "
            f"labels convert TABLE -o FOLDER --to {form.name} --recordings PATH`"
        )
    if several and form.is_single:
        raise InvalidInput(
            f"{form.title} files hold one recording, and there are several; write a table, then "
            f"`motionary labels convert TABLE -o FOLDER --to {form.name}`"
        )


def _list_formats() -> str:
    return ", ".join(f"{form.name} ({form.suffixes[0]})" for form in FORMATS)


def _find(path: str | Path) -> LabelFormat:
    """The format to read a file in; those of one suffix share a reader."""
    suffix = format_suffix(path)
    found = [form for form in FORMATS if suffix in form.suffixes]
    if not found:
        known = ", ".join(sorted({s for form in FORMATS for s in form.suffixes if s}))
        problem = f"expected a file of labels, got {suffix or 'no suffix'}; known are {known}"
        raise UnreadableFile(problem, file=path)
    return found[0]


def _load(place: str) -> Callable[..., Any]:
    module, _, name = place.partition(":")
    function: Callable[..., Any] = getattr(
        importlib.import_module(f"motionary.io.labels.{module}"), name
    )
    return function
