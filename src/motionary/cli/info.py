"""`motionary info`: what is in these files, and what is wrong with them?"""

from collections.abc import Sequence
from functools import partial
from pathlib import PurePath
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.inputs import find_files, read_as_told
from motionary.cli.options import AsJson, Jobs, ReadingOptions
from motionary.errors import InvalidInput

if TYPE_CHECKING:
    from motionary.features import NamedFile, Reading
    from motionary.motion import Motion

_COLUMNS = (
    "recording", "format", ">joints", ">frames", ">rate_hz", ">seconds", "skeleton", "relations",
    ">known",
)  # fmt: skip
_MOST_NAMES = 2


def info(
    files: Annotated[list[str], typer.Argument(metavar="FILE", help="Files, folders or patterns.")],
    as_json: AsJson = False,
    *,
    jobs: Jobs,
    reading: ReadingOptions,
) -> int:
    """Say what is in recordings, what is missing and what was assumed.

    motionary info recordings/
    motionary info take.amc --asf actor.asf
    """
    from motionary.batch import Failure, map_ordered

    found = find_files(files)
    work = partial(describe_file, reading=reading.reading())
    rows: list[dict[str, Any]] = []
    with screen.progress("reading", len(found.files)) as done:
        for row in map_ordered(work, found.files.items(), jobs=jobs, on_done=done):
            if isinstance(row, Failure):
                name, path = row.item
                row = {
                    "recording": name,
                    "format": _format(path.name),
                    "error": screen.name_error(name, path, row.error),
                }
            rows.append(row)
    rows += [
        {"recording": path, "format": _format(path), "error": str(error)}
        for path, error in found.missing.items()
    ]
    if as_json:
        for row in rows:
            screen.say_json(row)
    elif rows:
        screen.say_table(_COLUMNS, [_cells(row) for row in rows])
        screen.say(*_notes(rows))
    return 1 if any("error" in row for row in rows) else 0


def describe_file(file: "NamedFile", *, reading: "Reading") -> dict[str, Any]:
    """What a file holds, for JSON.

    Raises
    ------
    UnreadableFile, InvalidInput
        If it cannot be read, or not as it was told.
    """
    import numpy as np

    from motionary.features import FULL_BODY
    from motionary.motion import GENERIC_JOINTS

    name, path = file
    motion = read_as_told(path, reading)
    mapping = motion.mapping
    relations, known, problem = _relations(motion)
    missing: list[str] = []
    notes = [*motion.notes, *([problem] if problem else [])]
    if mapping is not None:
        unseen = np.isnan(motion.generic_positions()).any(axis=2).all(axis=0)
        missing = [GENERIC_JOINTS[i] for i in np.flatnonzero(unseen)]
        notes += [mapping.note] if mapping.note else []
    return {
        "recording": name,
        "format": _format(path.name),
        "joints": len(motion.names),
        "frames": motion.n_frames,
        "rate_hz": motion.rate_hz,
        "duration_s": motion.duration_s,
        "skeleton": mapping.name if mapping else None,
        "missing": missing,
        "relations_known": relations,
        "relations": len(FULL_BODY),
        "known": known,
        "notes": notes,
    }


def _relations(motion: "Motion") -> tuple[int, float, str]:
    """How many relations are ever known, the share of all that is known, and what hinders."""
    from motionary.features import compute_features

    try:
        known = compute_features(motion).known_features
    except InvalidInput as error:
        return 0, 0.0, str(error).removeprefix(f"{motion.source}: ")
    return int(known.any(axis=0).sum()), float(known.mean()), ""


def _format(name: str) -> str:
    return PurePath(name.removesuffix(".gz")).suffix.lstrip(".").upper()


def _cells(row: dict[str, Any]) -> list[str]:
    if "error" in row:
        return [row["recording"], row["format"], "", "", "", "", "unreadable", "", ""]
    return [
        row["recording"],
        row["format"],
        str(row["joints"]),
        str(row["frames"]),
        f"{row['rate_hz']:g}",
        f"{row['duration_s']:.2f}",
        row["skeleton"] or "unknown",
        f"{row['relations_known']} of {row['relations']}",
        f"{100 * row['known']:.0f} %",
    ]


def _notes(rows: Sequence[dict[str, Any]]) -> list[str]:
    """What was noticed, each once, and of which recordings."""
    where: dict[str, list[str]] = {}
    for row in rows:
        told = list(row.get("notes", ()))
        if row.get("missing"):
            told.append(f"not there: {', '.join(row['missing'])}")
        for note in told:
            where.setdefault(note, []).append(row["recording"])
    lines = [f"{_enumerate(names, len(rows))}: {note}" for note, names in where.items()]
    lines += [row["error"] for row in rows if "error" in row]
    return ["", *lines] if lines else []


def _enumerate(names: Sequence[str], n_all: int) -> str:
    if len(names) == n_all and n_all > 1:
        return f"all {n_all}"
    if len(names) <= _MOST_NAMES:
        return ", ".join(names)
    return f"{names[0]} and {len(names) - 1} more"
