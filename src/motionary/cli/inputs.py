"""Which files does a command work on, and can its results be written?"""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import typer

from motionary.cli.screen import complain, name_error
from motionary.errors import UnreadableFile, UnwritableFile

if TYPE_CHECKING:
    from motionary.batch import Failure
    from motionary.features import NamedFile, Reading
    from motionary.motion import Motion


class Found(NamedTuple):
    """Recordings by name, and for each path that means none the reason."""

    files: dict[str, Path]
    missing: dict[str, UnreadableFile]


def find_files(paths: Iterable[str]) -> Found:
    """Recordings of files, folders and patterns; one wrong path does not stop the others."""
    from motionary.io import name_recordings

    good: list[str] = []
    missing: dict[str, UnreadableFile] = {}
    for path in paths:
        try:
            name_recordings(path)
        except UnreadableFile as error:
            missing[path] = error
        else:
            good.append(path)
    return Found(name_recordings(good), missing)


def read_as_told(path: Path, reading: "Reading") -> "Motion":
    """A motion, read as its words were: what only one format needs is kept from others."""
    from motionary.io import read

    return read(path, **reading.of(path))


def complain_of_all(
    missing: Iterable[UnreadableFile], failures: "Iterable[Failure[NamedFile]]"
) -> None:
    """Say on stderr which paths mean nothing and which recordings could not be read."""
    for error in missing:
        complain(str(error))
    for failure in failures:
        complain(name_error(*failure.item, failure.error))


def check_picture(option: str, path: str | None) -> None:
    """Fail before the work where a picture cannot be written, or not in that format."""
    if path is not None:
        kinds = (".png", ".svg", ".pdf")
        if not path.lower().endswith(kinds):
            raise typer.BadParameter(
                f"pictures are written as {', '.join(kinds)}, got {path}", param_hint=option
            )
        check_target(path)


def check_target(path: str | None, *, is_folder: bool = False) -> None:
    """Fail before the work, not after it, where a file or folder cannot be made.

    Raises
    ------
    UnwritableFile
        If something above `path` is a file or may not be written to, or `path` is a folder
        where it should be a file, or the other way round.
    """
    if path is None:
        return
    place = Path(path).absolute()
    above = next(p for p in place.parents if p.exists())
    problem = ""
    if not above.is_dir():
        problem = f"{above.name} is a file, not a folder"
    elif place.exists() and place.is_dir() != is_folder:
        problem = "it is a file, not a folder" if is_folder else "it is a folder, not a file"
    elif not os.access(above, os.W_OK):
        problem = f"{above} is read-only"
    if problem:
        raise UnwritableFile(f"{path}: cannot be written: {problem}; choose another place")
