"""`motionary count`: how often each class occurs, how long and how regularly."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.annotate import LabelOptions
from motionary.cli.annotate import annotate as annotate_files
from motionary.cli.options import AsJson, Jobs, TableFile
from motionary.files import is_stdout
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.labels import LabelTrack
    from motionary.retrieval.counting import ClassCount

_COLUMNS = (
    "recording", "label", "side", ">number", ">mean_s", ">total_s", ">per_min", ">unassessed_s",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class CountOptions(LabelOptions):
    """Options of labels whose counts are wanted."""

    output: TableFile = None
    count: Annotated[bool, typer.Option("--count", hidden=True)] = True


def count(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE", help="Files, folders or patterns to count in.")
    ],
    options: CountOptions,
    as_json: AsJson = False,
    *,
    jobs: Jobs,
    reading: ReadOptions,
) -> int:
    """Count repetitions by recording, class and side; options are those of annotate.

    "per_min" is the number of repetitions a minute by the usual time from one start to the
    next, "unassessed_s" the seconds of which too little was seen to judge.

    motionary count training.c3d --library exercises -o counts.csv
    """
    return annotate_files(files, options, as_json, jobs=jobs, reading=reading)


def show_counts(
    tracks: "Sequence[LabelTrack]", *, output: str | None, excel: bool, as_json: bool
) -> None:
    """Counts as a table or JSON, and as a file if one is named."""
    from pathlib import Path

    from motionary.io.text import write_table
    from motionary.retrieval.counting import count as count_labels

    counts = count_labels(tracks)
    rows = [_to_row(one) for one in counts]
    if output:
        columns = [name.lstrip(">") for name in _COLUMNS]
        table = [[row[name] for name in columns] for row in rows]
        write_table([columns, *table], Path(output), excel=excel)
    if output and is_stdout(output):
        return
    if as_json:
        for one, row in zip(counts, rows, strict=True):
            times = {"starts_s": list(one.starts_s), "durations_s": list(one.durations_s)}
            screen.print_json(row | times)
        return
    shown = [tuple(_format(cell) for cell in row.values()) for row in rows]
    counted = {one.recording for one in counts}
    for track in tracks:
        if track.recording.name not in counted:
            shown.append((track.recording.name, "(none)", *[""] * (len(_COLUMNS) - 2)))
    if shown:
        screen.print_table(_COLUMNS, shown)


def _to_row(one: "ClassCount") -> dict[str, Any]:
    return {
        "recording": one.recording,
        "label": one.name,
        "side": one.side,
        "number": one.number,
        "mean_s": one.mean_s,
        "total_s": one.total_s,
        "per_min": one.per_min,
        "unassessed_s": one.unassessed_s,
    }


def _format(cell: Any) -> str:
    if cell is None:
        return ""
    return f"{cell:.2f}" if isinstance(cell, float) else str(cell)
