"""Recordings that files, folders and patterns name, and the sidecar files that they are read with.

A recording found in a folder is called by its path below that folder, with slashes; one
that was named itself, by its file name. Names stay clear of people's home folders.

An Acclaim motion is read with its skeleton; other formats stand alone. Folders are listed
once, so that thousands of recordings can be asked about.
"""

import glob
import hashlib
import itertools
import os
import unicodedata
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import numpy as np

from motionary.errors import SeveralRecordings, UnreadableFile
from motionary.files import NO_SUCH_FILE, describe_opening
from motionary.io.formats import (
    EVERY,
    MOTION_SUFFIXES,
    find_format,
    label_takes,
    load_function,
    split_take,
)
from motionary.io.options import ReadOptions
from motionary.io.text import TAKE_MARK, format_suffix, stem_of
from motionary.tables import enumerate_names

NO_SIDECAR = 0

#: Takes why a folder is passed over, in one line.
OnSkip = Callable[[str], None]

_READ_WITH_SKELETON = (".amc", ".amc.gz")


def find_recordings(
    paths: str | Path | Iterable[str | Path], *, suffixes: Collection[str] = MOTION_SUFFIXES
) -> list[Path]:
    """Recordings that files, folders and patterns mean, sorted, each once.

    Parameters
    ----------
    paths : files, folders (searched to the bottom) and patterns such as "*.bvh"
    suffixes : what counts as a recording in a folder or pattern, lower case

    Raises
    ------
    UnreadableFile
        If a path does not exist, or a folder or pattern holds no recording.
    """
    return sorted(set(name_recordings(paths, suffixes=suffixes, split=False).values()))


def name_recordings(
    paths: str | Path | Iterable[str | Path],
    *,
    suffixes: Collection[str] = MOTION_SUFFIXES,
    on_skip: OnSkip | None = None,
    on_missing: Callable[[str | Path, UnreadableFile], None] | None = None,
    split: bool = True,
) -> dict[str, Path]:
    """The same with their names, sorted by name.

    Two files of one name, from two folders, are called by their folders too. Recordings of one
    file are called by its name and theirs, `batch.npy#001`, which `read` understands as a path.

    Parameters
    ----------
    split : whether files of several recordings are opened and these named one by one
    on_skip : called with the reason where a link leads to a folder that is searched already
    on_missing : called with a path that leads to no recording, and why; then the others are
        found, instead of an error
    """
    given = [paths] if isinstance(paths, str | Path) else list(paths)
    found: dict[Path, tuple[Path, str]] = {}
    for path in given:
        try:
            named = _find(Path(path), suffixes, on_skip)
        except UnreadableFile as error:
            if on_missing is None:
                raise
            on_missing(path, error)
            continue
        for file, name in named:
            found.setdefault(file.absolute(), (file, name))
    files = dict(sorted(_tell_apart(list(found.values())).items()))
    return split_files(files) if split else files


def split_files(files: Mapping[str, Path]) -> dict[str, Path]:
    """Recordings by name, of files by name: of a file with several recordings each one."""
    result: dict[str, Path] = {}
    for name, path in files.items():
        takes = [f"{TAKE_MARK}{take}" for take in list_takes(path)] or [""]
        result |= {name + take: path.with_name(path.name + take) for take in takes}
    return result


def list_takes(path: Path) -> list[str]:
    """What the recordings of a file are called behind its name; empty unless there are several.

    A file that cannot be read has none: reading it says why.
    """
    form = find_format(path)
    if form is None or not form.several or split_take(path)[1]:
        return []
    try:
        with np.errstate(all="ignore"):
            load_function(form.read)(path, ReadOptions(take=EVERY))
    except SeveralRecordings as several:
        return label_takes(several.takes) if len(several.takes) > 1 else []
    except Exception:
        # Whatever a damaged file makes of its reader, reading tells it as an error of this file.
        return []
    return []


class FileState(NamedTuple):
    """When a file was written and how long it is; a name that leads nowhere has size -1."""

    mtime_ns: int
    size: int
    ctime_ns: int


def scan_folder(
    folder: str | Path,
    *,
    suffixes: Collection[str] = MOTION_SUFFIXES,
    on_skip: OnSkip | None = None,
) -> dict[str, FileState]:
    """Recordings below a folder by name, sorted, with the state of their files.

    The same recordings under the same names as `name_recordings` finds, for folders of
    thousands; an empty folder gives none.

    Raises
    ------
    UnreadableFile
        If the folder is missing, or may not be read.
    """
    try:
        with os.scandir(folder):
            pass
    except OSError as error:
        raise UnreadableFile(describe_opening(error, "cannot be searched"), file=folder) from error
    cut = len(str(folder).rstrip(os.sep)) + 1
    found = (
        (entry.path[cut:].replace(os.sep, "/"), entry)
        for entry in _entries(folder, suffixes, on_skip)
    )
    return {name: _state(entry) for name, entry in sorted(found, key=lambda pair: pair[0])}


def recording_name(path: str | Path, *, folder: str | Path | None = None) -> str:
    """Name of a recording: its path below `folder`, with slashes.

    Without a folder, or outside of it, its file name.
    """
    path = Path(path)
    if folder is not None:
        # Not `resolve`: a link below the folder is called by where it stands.
        place, base = path.absolute(), Path(folder).absolute()
        if place != base and place.is_relative_to(base):
            return place.relative_to(base).as_posix()
    return path.name


def match_recording(name: str, names: Iterable[str]) -> str | None:
    """The one of `names` that a table of labels means by `name`; None if none or several.

    An equal name counts before one that differs in the suffix only, and that before one
    that has the same stem in some folder.
    """
    same = _candidates(name, list(names))
    return same[0] if len(same) == 1 else None


def explain_unmatched(wanted: Iterable[str], names: Collection[str]) -> list[str]:
    """Why `match_recording` finds none for names: one text of the absent, and of each other."""
    found = {name: _candidates(name, names) for name in wanted}
    absent = [name for name, same in found.items() if not same]
    texts = [
        f"{name}: several recordings may be meant, {enumerate_names(sorted(same))}; name one of "
        "them with its folder and suffix"
        for name, same in found.items()
        if len(same) > 1
    ]
    if absent:
        texts.insert(
            0,
            f"{enumerate_names(absent)}: there is no recording of this name; there are "
            f"{enumerate_names(sorted(names))}",
        )
    return texts


def _candidates(name: str, names: Collection[str]) -> list[str]:
    if name in names:
        return [name]
    # Systems write letters with accents in one form or the other.
    wanted = PurePosixPath(unicodedata.normalize("NFC", name.replace("\\", "/")))
    paths = {other: PurePosixPath(unicodedata.normalize("NFC", other)) for other in names}
    for key in (lambda path: path, _without_suffix, lambda path: _without_suffix(path).name):
        same = [other for other, path in paths.items() if key(path) == key(wanted)]
        if same:
            return same
    return []


def _without_suffix(path: PurePosixPath) -> PurePosixPath:
    return path.with_name(stem_of(path)) if format_suffix(path) in MOTION_SUFFIXES else path


def _find(path: Path, suffixes: Collection[str], on_skip: OnSkip | None) -> list[tuple[Path, str]]:
    if path.is_dir():
        files = sorted(Path(entry.path) for entry in _entries(path, suffixes, on_skip))
        if not files:
            known = ", ".join(sorted(suffixes))
            raise UnreadableFile(f"no recordings in this folder; looked for {known}", file=path)
        return [(file, recording_name(file, folder=path)) for file in files]
    if split_take(path)[0].exists():
        return [(path, path.name)]
    if not glob.has_magic(str(path)):
        raise UnreadableFile(NO_SUCH_FILE, file=path)
    files = [file for file in _match(path) if file.is_file() and _is_recording(file.name, suffixes)]
    if not files:
        raise UnreadableFile("no recording has a name like this", file=path)
    return [(file, file.name) for file in files]


def _match(pattern: Path) -> list[Path]:
    """Paths like a pattern, hidden folders left out, sorted."""
    plain = list(itertools.takewhile(lambda part: not glob.has_magic(part), pattern.parts))
    folder = Path(*plain)
    found = folder.glob(str(Path(*pattern.parts[len(plain) :])))
    return sorted(
        path
        for path in found
        if not any(part.startswith(".") for part in path.relative_to(folder).parts)
    )


def _entries(
    folder: str | Path, suffixes: Collection[str], on_skip: OnSkip | None = None
) -> Iterator[os.DirEntry[str]]:
    """Recordings below a folder, hidden folders left out; each folder is searched once.

    A link to a folder is followed after all folders that are no links.
    """
    waiting, linked = [str(folder)], deque[str]()
    searched: set[tuple[int, int]] = set()
    while waiting or linked:
        path = waiting.pop() if waiting else linked.popleft()
        try:
            status = Path(path).stat()
            if (status.st_dev, status.st_ino) in searched:
                if on_skip is not None:
                    on_skip(f"{path}: leads to a folder that is searched already; passed over")
                continue
            searched.add((status.st_dev, status.st_ino))
            with os.scandir(path) as entries:
                listed = list(entries)
        except OSError:
            # A folder below that may not be read hides its own files, not the others.
            continue
        for entry in listed:
            if not _is_folder(entry):
                if _is_recording(entry.name, suffixes):
                    yield entry
            elif not entry.name.startswith("."):
                (linked if entry.is_symlink() else waiting).append(entry.path)


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:
        # A link to itself; reading it tells so.
        return False


def _state(entry: os.DirEntry[str]) -> FileState:
    try:
        stat = entry.stat()
    except OSError:
        return FileState(0, -1, 0)
    return FileState(stat.st_mtime_ns, stat.st_size, stat.st_ctime_ns)


def _is_recording(name: str, suffixes: Collection[str]) -> bool:
    return not name.startswith(".") and name.lower().endswith(tuple(suffixes))


def _tell_apart(found: list[tuple[Path, str]]) -> dict[str, Path]:
    """Files by name, with folders before each name that would occur twice."""
    names = [name for _, name in found]
    for depth in itertools.count(1):
        counts = Counter(names)
        twice = [i for i, name in enumerate(names) if counts[name] > 1]
        if not twice:
            break
        for i in twice:
            path, name = found[i]
            used = len(PurePosixPath(name).parts) + depth
            names[i] = PurePosixPath(*path.absolute().parts[-used:]).as_posix()
    return {name: path for name, (path, _) in zip(names, found, strict=True)}


def has_sidecar(name: str) -> bool:
    """Whether a recording of this file name is read with another file."""
    return name.lower().endswith(_READ_WITH_SKELETON)


class Sidecars:
    """Skeletons beside motions; what a folder holds is remembered.

    Parameters
    ----------
    asf : the skeleton of all Acclaim motions, where one is named
    """

    def __init__(self, asf: str | Path | None = None) -> None:
        self._asf = None if asf is None else Path(asf)
        self._listed: dict[Path, dict[str, Path]] = {}

    def state(self, path: Path) -> int:
        """A number that changes when the sidecar of a recording does; `NO_SIDECAR` without one."""
        if not has_sidecar(path.name):
            return NO_SIDECAR
        from motionary.io.formats.asf import find_asf

        try:
            sidecar = self._asf or find_asf(path, listing=self._list)
        except UnreadableFile:
            return _digest(["missing"])
        return _digest([_file_state(sidecar)])

    def dependency_digest(self, folder: Path) -> int:
        """A number that changes when anything does that the sidecars there depend on."""
        if self._asf is not None:
            return _digest([_file_state(self._asf)])
        from motionary.io.formats.asf import places_of_asf

        places = places_of_asf(folder / "any")
        lines = ([*map(_file_state, sorted(self._list(p).values())), ""] for p in places)
        return _digest(line for part in lines for line in part)

    def _list(self, folder: Path) -> dict[str, Path]:
        from motionary.io.formats.asf import list_asf

        if folder not in self._listed:
            self._listed[folder] = list_asf(folder)
        return self._listed[folder]


def _file_state(file: Path) -> str:
    try:
        stat = file.stat()
    except OSError:
        return f"{file.name} gone"
    return f"{file.name} {stat.st_mtime_ns} {stat.st_size}"


def _digest(parts: Iterable[str]) -> int:
    content = "\n".join(parts).encode("utf-8", "surrogateescape")
    return int.from_bytes(hashlib.blake2b(content, digest_size=8).digest(), "little")
