"""Which files does a command work on, and can its results be written?"""

import os
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import typer

from motionary.cli.screen import name_error, progress, warn
from motionary.errors import NO_MOTION, NotAMotion, NotHuman, UnreadableFile, UnwritableFile

if TYPE_CHECKING:
    from motionary.batch import Failure
    from motionary.features import FeatureSequence, FeatureSet, NamedFile
    from motionary.io import ReadOptions
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


def read_words(
    files: "Mapping[str, Path]",
    told: str,
    *,
    reading: "ReadOptions",
    feature_set: "FeatureSet",
    jobs: int,
) -> "tuple[list[FeatureSequence], list[Failure[NamedFile]]]":
    """Words of recordings, and those that could not be read; `told` names what is done."""
    from motionary.batch import Failure
    from motionary.features import read_features

    words, failures = [], []
    with progress(told, len(files)) as done:
        for item in read_features(
            files.items(), options=reading, feature_set=feature_set, jobs=jobs, on_done=done
        ):
            if isinstance(item, Failure):
                failures.append(item)
            else:
                words.append(item)
    return words, failures


def read_as_told(path: Path, reading: "ReadOptions") -> "Motion":
    """A motion, read as its words were: what only one format needs is kept from others."""
    from motionary.io import read

    return read(path, reading.for_file(path))


def warn_of_all(
    missing: Iterable[UnreadableFile],
    failures: "Iterable[Failure[NamedFile]]",
    *,
    given: Iterable[str] = (),
) -> bool:
    """Say on stderr which paths mean nothing and which recordings could not be read.

    Parameters
    ----------
    given : what the person named; the rest was found in folders and by patterns

    Returns
    -------
    whether an input failed; what was found in a folder and is no motion of a person (arrays of
    something else, an animal) is told and passed over
    """
    failed = False
    named = set(given)
    for error in missing:
        warn(str(error))
        failed = True
    for failure in failures:
        name, path = failure.item
        told = name_error(name, path, failure.error)
        passed = is_passed_over(failure, named)
        warn(f"{told}; passed over" if passed else told)
        failed = failed or not passed
    return failed


def is_passed_over(failure: "Failure[NamedFile]", given: Collection[str]) -> bool:
    """Whether a file is no motion of a person, and was not named but found."""
    from motionary.skeletons import AN_ANIMAL

    # Of an index only the words of an error are left.
    text = str(failure.error)
    is_other = isinstance(failure.error, (NotAMotion, NotHuman)) or NO_MOTION in text
    return str(failure.item[1]) not in given and (is_other or AN_ANIMAL in text)


def check_picture(option: str, path: str | None) -> None:
    """Fail before the work where a picture cannot be written, or not in that format."""
    if path is not None:
        kinds = (".png", ".svg", ".pdf")
        if not path.lower().endswith(kinds):
            raise typer.BadParameter(
                f"pictures are written as {', '.join(kinds)}, got {path}", param_hint=option
            )
        check_target(path)


def check_excel(excel: bool, output: str | None) -> None:
    """Fail where there is no table to write as Excel opens it."""
    if excel and output is None:
        raise typer.BadParameter("goes with --output CSV", param_hint="--excel")


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
