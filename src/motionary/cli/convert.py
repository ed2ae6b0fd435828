"""`motionary convert`: how does a recording get into another format?"""

from functools import partial
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motionary.cli import screen
from motionary.cli.inputs import check_target, find_files, read_as_told, warn_of_all
from motionary.cli.options import AsJson, Jobs, ReadingOptions

if TYPE_CHECKING:
    from motionary.features import NamedFile
    from motionary.io import ReadOptions

_COLUMNS = ("recording", "written", ">joints", ">frames", ">rate_hz", "not kept")


def convert(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE", help="Files, folders or patterns to convert.")
    ],
    output: Annotated[
        str,
        typer.Option(
            "--output", "-o", metavar="OUT", help="A file with its suffix, or a folder with --to."
        ),
    ],
    to: Annotated[
        str | None,
        typer.Option(
            metavar="SUFFIX", help=".bvh, .amc, .c3d, .trc or .npz; .gz after it packs texts."
        ),
    ] = None,
    as_json: AsJson = False,
    *,
    jobs: Jobs,
    reading: ReadingOptions,
) -> int:
    """Write recordings in another format.

    In a folder the results have the names of the recordings. What a format cannot hold, such
    as the rig of a BVH in a C3D, is told.

    motionary convert take.c3d -o take.npz
    motionary convert recordings/ -o converted --to .trc
    """
    from motionary.batch import Failure, map_ordered

    found = find_files(files)
    targets = _targets(list(found.files), output, to)
    told = reading.reading()
    work = partial(convert_file, targets=targets, reading=told)
    rows: list[dict[str, Any]] = []
    failures = []
    with screen.progress("converting", len(found.files)) as done:
        for row in map_ordered(work, found.files.items(), jobs=jobs, on_done=done):
            if isinstance(row, Failure):
                failures.append(row)
                name, path = row.item
                row = {"recording": name, "error": screen.name_error(name, path, row.error)}
            rows.append(row)
            if as_json:
                screen.print_json(row)
    if not as_json and len(rows) > len(failures):
        screen.print_table(_COLUMNS, [_cells(row) for row in rows if "error" not in row])
    failed = warn_of_all(found.missing.values(), failures, given=files)
    return 1 if failed else 0


def convert_file(
    file: "NamedFile", *, targets: dict[str, Path], reading: "ReadOptions"
) -> dict[str, Any]:
    """Read and write one recording; what was written, for JSON.

    Raises
    ------
    UnreadableFile, UnwritableFile, InvalidInput
        If it cannot be read, written, or held by the format.
    """
    from motionary.io import what_is_lost, write

    name, path = file
    target = targets[name]
    motion = read_as_told(path, reading)
    write(motion, target, asf=reading.asf)
    return {
        "recording": name,
        "written": str(target),
        "joints": len(motion.names),
        "frames": motion.n_frames,
        "rate_hz": motion.rate_hz,
        "not_kept": list(what_is_lost(motion, target)),
    }


def _targets(names: list[str], output: str, to: str | None) -> dict[str, Path]:
    """Where each recording goes, before anything is read."""
    from motionary.io import WRITTEN_SUFFIXES, format_suffix, stem_of

    known = ", ".join(WRITTEN_SUFFIXES)
    if to is None:
        if format_suffix(output) not in WRITTEN_SUFFIXES:
            raise typer.BadParameter(
                f"must end in {known}, or be a folder with --to SUFFIX, got {output}",
                param_hint="--output",
            )
        if len(names) > 1:
            raise typer.BadParameter(
                f"{len(names)} recordings need a folder with --to SUFFIX, got the file {output}",
                param_hint="--output",
            )
        check_target(output)
        return {name: Path(output) for name in names}
    suffix = to if to.startswith(".") else f".{to}"
    if suffix not in WRITTEN_SUFFIXES:
        raise typer.BadParameter(f"must be one of {known}, got {to}", param_hint="--to")
    check_target(f"{output}/x")
    targets: dict[str, Path] = {}
    for name in names:
        place = PurePosixPath(name)
        target = Path(output) / place.with_name(stem_of(place) + suffix)
        if target in targets.values():
            # Two formats of one take, side by side: both keep their names whole.
            target = Path(output) / place.with_name(place.name + suffix)
        targets[name] = target
    return targets


def _cells(row: dict[str, Any]) -> list[str]:
    return [
        row["recording"],
        row["written"],
        str(row["joints"]),
        str(row["frames"]),
        f"{row['rate_hz']:g}",
        ", ".join(row["not_kept"]),
    ]
