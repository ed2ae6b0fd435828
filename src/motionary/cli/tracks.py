"""Labels and their counts: printed for people and programs, and written as tables."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motionary.cli import screen
from motionary.files import is_stdout

if TYPE_CHECKING:
    from motionary.labels import ClassCount, Label, LabelTrack

_COLUMNS = ("recording", "label", ">start_s", ">end_s", ">cost", ">known")
_SCORE_COLUMNS = (">score", ">false/min", ">right")
_COUNT_COLUMNS = (
    "recording", "label", "side", ">number", ">mean_s", ">total_s", ">per_min", ">unassessed_s",
)  # fmt: skip


def say_json(track: "LabelTrack", *, explained: bool) -> None:
    """Print the JSON object of a recording."""
    from motionary.retrieval.explanation import explain

    keys = (
        "start_s", "end_s", "start_frame", "end_frame", "cost", "known", "score", "probability",
        "false_per_min", "side",
    )  # fmt: skip
    labels = []
    for label in track:
        shown: dict[str, Any] = {"label": label.name}
        shown |= {key: getattr(label, key) for key in keys}
        if explained:
            shown["explanation"] = str(explain(label))
        labels.append(shown)
    unassessed = [{"start_s": start, "end_s": end} for start, end in track.unassessed]
    screen.print_json(
        {
            "recording": track.recording.name,
            "rate_hz": track.rate_hz,
            "labels": labels,
            "unassessed": unassessed,
            "nearest": track.nearest or None,
        }
    )


def say_tracks(tracks: "Sequence[LabelTrack]", *, explained: bool) -> None:
    """Print the labels of recordings, and what came nearest where there are none."""
    from motionary.retrieval.explanation import explain

    labels = [label for track in tracks for label in track]
    columns: tuple[str, ...] = _COLUMNS
    if any(label.score is not None for label in labels):
        has_rates = any(label.false_per_min is not None for label in labels)
        is_known = any(label.probability is not None for label in labels)
        shown = 3 if is_known else 2 if has_rates else 1
        columns = (*_COLUMNS, *_SCORE_COLUMNS[:shown])
    rows: list[tuple[str, ...]] = []
    below: dict[int, str] = {}
    for track in tracks:
        for label in track:
            if explained:
                below[len(rows)] = str(explain(label))
            rows.append((track.recording.name, *_cells(label))[: len(columns)])
        for start_s, end_s in track.unassessed:
            times = (f"{start_s:.2f}", f"{end_s:.2f}")
            rows.append(_fill((track.recording.name, "(too little seen)", *times), columns))
        if not len(track):
            below[len(rows)] = track.nearest
            rows.append(_fill((track.recording.name, "(none)"), columns))
    if rows:
        screen.print_table(columns, rows, below=below)


def _fill(cells: tuple[str, ...], columns: Sequence[str]) -> tuple[str, ...]:
    """A row with empty cells at its end."""
    return (*cells, *[""] * (len(columns) - len(cells)))


def _cells(label: "Label") -> tuple[str, ...]:
    cost = "" if label.cost is None else f"{label.cost:.3f}"
    times = f"{label.start_s:.2f}", f"{label.end_s:.2f}"
    score = "" if label.score is None else f"{label.score:.1f}"
    rate = "" if label.false_per_min is None else f"{label.false_per_min:.2g}"
    right = "" if label.probability is None else screen.percent(label.probability)
    return (label.name, *times, cost, screen.percent(label.known), score, rate, right)


def show_counts(
    tracks: "Sequence[LabelTrack]", *, output: str | None, excel: bool, as_json: bool
) -> None:
    """Counts as a table or JSON, and as a file if one is named."""
    from motionary.io.text import write_table
    from motionary.labels import count as count_labels

    counts = count_labels(tracks)
    rows = [_to_row(one) for one in counts]
    if output:
        columns = [name.lstrip(">") for name in _COUNT_COLUMNS]
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
            shown.append(_fill((track.recording.name, "(none)"), _COUNT_COLUMNS))
    if shown:
        screen.print_table(_COUNT_COLUMNS, shown)


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
