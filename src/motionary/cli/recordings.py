"""Recordings that a command works on: found by path, read and measured, and by whom."""

import logging
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from motionary.cli import screen
from motionary.cli.options import LIBRARY_FILE, LibraryDefault, option, wrong
from motionary.errors import NotAFile, NotAMotion, NotHuman, UnreadableFile
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.batch import Failure, Workers
    from motionary.features import FeatureSequence, FeatureSet, NamedFile
    from motionary.models.library import ClassLibrary
    from motionary.motion import Motion

Result = TypeVar("Result")


# -- libraries --------------------------------------------------------------------------


def open_library(folder: str) -> "ClassLibrary":
    """A library by its folder, or the one that ships; says where a folder hides that one."""
    from motionary.models.library import EVERYDAY
    from motionary.models.library import open_library as open_named

    if folder == EVERYDAY and Path(folder, LIBRARY_FILE).exists():
        screen.warn(f"the folder ./{EVERYDAY} is used, not the library of that name that ships")
    return open_named(folder)


# -- files ------------------------------------------------------------------------------


class Found(NamedTuple):
    """Recordings by name, what was given, and for each path that means none the reason."""

    files: dict[str, Path]
    missing: dict[str, UnreadableFile]
    given: tuple[str, ...]

    def warn(self, failures: "Iterable[Failure[NamedFile]]" = ()) -> int:
        """Say what is missing and what could not be read; the code that a command ends with."""
        return int(warn_of_all(self.missing.values(), failures, given=self.given))


def find_files(paths: Iterable[str], reading: ReadOptions | None = None) -> Found:
    """Recordings of files, folders and patterns; one wrong path does not stop the others.

    Of files with several recordings each is one, unless `reading` names a take.
    """
    from motionary.io import name_recordings

    missing: dict[str, UnreadableFile] = {}
    given = tuple(paths)
    files = name_recordings(
        given,
        on_skip=screen.warn,
        on_missing=lambda path, error: missing.update({str(path): error}),
        split=reading is None or reading.take is None,
    )
    return Found(files, missing, given)


def read_recording(path: Path, reading: ReadOptions) -> "Motion":
    """A motion, read as its features were: options that other formats take are left out."""
    from motionary.io import read

    return read(path, reading.for_file(path))


def read_motions(
    files: Mapping[str, Path], reading: ReadOptions
) -> "Iterator[Motion | Failure[NamedFile]]":
    """Motions under the names of their files, with a bar."""
    return map_files(partial(_read_named, reading=reading), files, "reading", jobs=1)


def _read_named(file: "NamedFile", *, reading: ReadOptions) -> "Motion":
    return read_recording(file[1], reading).renamed(file[0])


def map_files(
    work: "Callable[[NamedFile], Result]", files: Mapping[str, Path], what: str, *, jobs: int
) -> "Iterator[Result | Failure[NamedFile]]":
    """Results of a function for each file, with a bar that says `what` is done."""
    from motionary.batch import map_ordered

    with screen.progress(what, len(files)) as done:
        yield from map_ordered(work, files.items(), jobs=jobs, on_done=done)


def measure_files(
    files: Mapping[str, Path],
    what: str,
    *,
    reading: ReadOptions,
    feature_set: "FeatureSet",
    jobs: "Workers",
) -> "Iterator[FeatureSequence | Failure[NamedFile]]":
    """Features of each file, with a bar that says `what` is done."""
    from motionary.features import read_features

    with screen.progress(what, len(files)) as done:
        yield from read_features(
            files.items(), options=reading, feature_set=feature_set, jobs=jobs, on_done=done
        )


def measure_all(
    found: Found, what: str, *, reading: ReadOptions, feature_set: "FeatureSet", jobs: "Workers"
) -> "tuple[list[FeatureSequence], list[Failure[NamedFile]]]":
    """Features of all files that can be read, and those that cannot."""
    return split_failures(
        measure_files(found.files, what, reading=reading, feature_set=feature_set, jobs=jobs)
    )


def split_failures(
    items: "Iterable[Result | Failure[NamedFile]]",
) -> "tuple[list[Result], list[Failure[NamedFile]]]":
    """What was done, and what could not be."""
    from motionary.batch import Failure

    done: list[Result] = []
    failures: list[Failure[NamedFile]] = []
    for item in items:
        if isinstance(item, Failure):
            failures.append(item)
        else:
            done.append(item)
    return done, failures


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
    something else, an animal) is reported and passed over
    """
    failed = False
    named = set(given)
    for error in missing:
        screen.warn(str(error))
        failed = True
    for failure in failures:
        passed = is_passed_over(failure, named)
        screen.warn(describe_failure(failure) + ("; passed over" if passed else ""))
        failed = failed or not passed
    return failed


def is_passed_over(failure: "Failure[NamedFile]", given: Collection[str]) -> bool:
    """Whether a file is no motion of a person, and was not named but found."""
    is_other = isinstance(failure.error, (NotAFile, NotAMotion, NotHuman))
    named = {Path(path).absolute() for path in given}
    return is_other and not {path.absolute() for path in _paths_of(failure)} & named


def describe_failure(failure: "Failure[NamedFile]") -> str:
    """Why a recording could not be read, under its name whatever the error calls its file."""
    return failure.item[0] + failure.error.text_after(*_paths_of(failure))


def _paths_of(failure: "Failure[NamedFile]") -> tuple[Path, Path]:
    """The path of a recording, and that of its file, which may hold several."""
    from motionary.io import file_of

    path = failure.item[1]
    return path, file_of(path)


# -- who does the work ------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class WorkOptions:
    """How many processes, or whose."""

    jobs: int = option(
        "--jobs --workers N",
        "Processes that read files; the answer is the same.",
        LibraryDefault("motionary.batch:map_ordered", "jobs"),
        min=1,
    )
    scheduler: str | None = option(
        "--scheduler ADDRESS",
        "Dask scheduler whose workers do it instead, as tcp://host:8786; they see files and index "
        "under the same paths.",
    )

    @contextmanager
    def open(self) -> "Iterator[Workers]":
        """What `map_ordered` takes; of a cluster only as long as it is needed.

        Raises
        ------
        BadParameter
            If processes are asked for as well.
        Unreachable
            If the scheduler does not answer, or has no workers that can do it.
        """
        if self.scheduler is None:
            yield self.jobs
            return
        if self.jobs > 1:
            raise wrong("--scheduler", "its workers do the work; leave out --jobs")
        from motionary.batch import Cluster

        # It reports by itself what is told in one line here.
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        with Cluster(self.scheduler) as cluster:
            yield cluster

    def searching(self, workers: "Workers") -> "Workers":
        """Who searches: a cluster where there is one; processes start more slowly than they pay."""
        return 1 if self.scheduler is None else workers
