"""`motionary info`: what recordings hold, what is missing and what was assumed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from motionary.cli import screen
from motionary.cli.options import (
    AsJson,
    Jobs,
    TableOptions,
    argument,
    check_picture,
    check_target,
    option,
)
from motionary.cli.recordings import (
    describe_failure,
    find_files,
    is_passed_over,
    map_files,
    read_recording,
)
from motionary.errors import InvalidInput
from motionary.io.options import ReadOptions
from motionary.tables import enumerate_names

if TYPE_CHECKING:
    from motionary.features import NamedFile
    from motionary.io import Cell
    from motionary.motion import Motion

_COLUMNS = (
    "recording", ">joints", ">frames", ">rate_hz", ">seconds", "skeleton", "features", ">known",
)  # fmt: skip
_WRITTEN = (
    "recording", "format", "joints", "frames", "rate_hz", "duration_s", "skeleton", "facing",
    "relations_known", "known", "missing", "notes",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class InfoOptions(TableOptions):
    """Where else to write what is said."""

    save_mapping: str | None = option(
        "--save-mapping TOML",
        "Write which joint is which, to be corrected and given back with --skeleton.",
    )
    plot: str | None = option("--plot PNG", "Draw the first pose of each recording in its axes.")


def info(
    files: Annotated[list[str], argument("FILE", "Files, folders or patterns.")],
    options: InfoOptions,
    as_json: AsJson = False,
    *,
    jobs: Jobs,
    reading: ReadOptions,
) -> int:
    """Say what is in recordings, what is missing and what was assumed.

    motionary info recordings/
    motionary info take.amc --asf actor.asf
    motionary info take.bvh --save-mapping rig.toml --plot first-pose.png
    """
    from motionary.batch import Failure

    check_target(options.save_mapping, replace=options.force)
    check_picture("--plot", options.plot)
    options.check(as_json=as_json)
    found = find_files(files, reading)
    rows: list[dict[str, Any]] = []
    failed = bool(found.missing)
    for row in map_files(
        partial(describe_file, reading=reading), found.files, "reading", jobs=jobs
    ):
        if isinstance(row, Failure):
            failed = failed or not is_passed_over(row, files)
            row = _unreadable(row.item[0], describe_failure(row))
        rows.append(row)
    rows += [_unreadable(path, str(error)) for path, error in found.missing.items()]
    if options.save_mapping:
        _save_mapping(found.files, options.save_mapping, reading)
    if options.plot:
        _draw(found.files, options.plot, reading)
    if options.output:
        _write(rows, options.output, excel=options.excel)
    if as_json:
        screen.print_json(*rows)
    elif rows and not options.takes_stdout:
        screen.print_table(_COLUMNS, [_cells(row) for row in rows])
        screen.say(*_notes(rows))
    return 1 if failed else 0


def _unreadable(name: str, error: str) -> dict[str, Any]:
    return {"recording": name, "format": _format(name), "error": error}


def describe_file(file: "NamedFile", *, reading: ReadOptions) -> dict[str, Any]:
    """What a file holds, for JSON.

    Raises
    ------
    UnreadableFile, InvalidInput
        If it cannot be read, or not as the options say.
    """
    import numpy as np

    from motionary.features import FULL_BODY, describe_reference_lengths
    from motionary.motion import GENERIC_JOINTS
    from motionary.plots import describe_facing

    name, path = file
    motion = read_recording(path, reading)
    mapping = motion.mapping
    features, known, problem = _features(motion)
    missing: list[str] = []
    notes = [*motion.notes, *([problem] if problem and problem not in motion.notes else [])]
    if mapping is not None:
        unseen = np.isnan(motion.generic_positions()).any(axis=2).all(axis=0)
        missing = [GENERIC_JOINTS[i] for i in np.flatnonzero(unseen)]
        notes += [mapping.note] if mapping.note else []
        notes += describe_reference_lengths(motion)
    return {
        "recording": name,
        "format": _format(path.name),
        "joints": len(motion.names),
        "frames": motion.n_frames,
        "rate_hz": motion.rate_hz,
        "duration_s": motion.duration_s,
        "skeleton": mapping.name if mapping else None,
        "facing": describe_facing(motion).removeprefix("faces ") or None,
        "missing": missing,
        "relations_known": features,
        "relations": len(FULL_BODY),
        "known": known,
        "notes": notes,
    }


def _features(motion: "Motion") -> tuple[int, float, str]:
    """How many features are ever known, the fraction of all that is known, and what hinders."""
    from motionary.features import compute_features

    try:
        known = compute_features(motion).known_features
    except InvalidInput as error:
        return 0, 0.0, error.problem
    return int(known.any(axis=0).sum()), float(known.mean()), ""


def _save_mapping(files: Mapping[str, Path], path: str, reading: ReadOptions) -> None:
    """Write the mapping of the joints of the files; it must be one for all."""
    from motionary.io import save_skeleton

    first: Motion | None = None
    for name, motion in _readable(files, reading):
        first = first or motion
        if motion.names != first.names:
            raise InvalidInput(
                f"a mapping is written of recordings of one rig, and {name} has another "
                "one; name one recording",
                file=path,
            )
    if first is None:
        raise InvalidInput("no recording whose joints could be written down", file=path)
    save_skeleton(first, path)


def _readable(files: Mapping[str, Path], reading: ReadOptions) -> "Iterator[tuple[str, Motion]]":
    """Recordings that can be read, with their names; of the others the table says why."""
    for name, file in files.items():
        try:
            motion = read_recording(file, reading)
        except Exception:
            # Whatever a damaged file makes of its reader, it is no reason to leave out the others.
            continue
        yield name, motion


def _draw(files: Mapping[str, Path], path: str, reading: ReadOptions) -> None:
    """The first poses of the recordings that can be read, in pages of as many as one holds."""
    from motionary.plots import MOST_RECORDINGS, plot_recordings, save_pages

    motions = (motion.renamed(name) for name, motion in _readable(files, reading))
    pages = iter(lambda: list(islice(motions, MOST_RECORDINGS)), [])
    screen.warn_of_pages(path, save_pages(map(plot_recordings, pages), path))


def _write(rows: Sequence[dict[str, Any]], path: str, *, excel: bool) -> None:
    from motionary.io import write_table

    table: list[list[Cell]] = [list(_WRITTEN)]
    for row in rows:
        notes = "; ".join([*row.get("notes", ()), *([row["error"]] if "error" in row else [])])
        cells = [row.get(key) for key in _WRITTEN[:-2]]
        table.append([*cells, ", ".join(row.get("missing", ())), notes])
    write_table(table, path, excel=excel)


def _format(name: str) -> str:
    from motionary.io import format_suffix

    return format_suffix(name).removesuffix(".gz").lstrip(".").upper()


def _cells(row: dict[str, Any]) -> list[str]:
    if "error" in row:
        return [row["recording"], "", "", "", "", "unreadable"]
    return [
        row["recording"],
        str(row["joints"]),
        str(row["frames"]),
        f"{row['rate_hz']:g}",
        f"{row['duration_s']:.2f}",
        row["skeleton"] or "unknown",
        f"{row['relations_known']} of {row['relations']}",
        screen.percent(row["known"]),
    ]


def _notes(rows: Sequence[dict[str, Any]]) -> list[str]:
    """What was noticed, each once, and of which recordings."""
    where: dict[str, list[str]] = {}
    for row in rows:
        said = list(row.get("notes", ()))
        if row.get("missing"):
            said.append(f"not there: {', '.join(row['missing'])}")
        for note in said:
            where.setdefault(note, []).append(row["recording"])
    lines = [f"{_where(names, len(rows))}: {note}" for note, names in where.items()]
    lines += [row["error"] for row in rows if "error" in row]
    return ["", *lines] if lines else []


def _where(names: Sequence[str], n_all: int) -> str:
    if len(names) == n_all and n_all > 1:
        return f"all {n_all}"
    # Two names tell as much as one and "1 more".
    return enumerate_names(names, most=2 if len(names) <= 2 else 1)
