"""Files: only regular ones are opened, and results are written whole or not at all.

A recording may come from anybody. A name that leads to a named pipe or a device is refused
before it is read, as reading it may never end. A result goes where a link leads, and takes
over the rights of the file that it replaces.
"""

import os
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from motionary.errors import InvalidInput, MotionaryError, NotAFile, UnreadableFile, UnwritableFile
from motionary.tables import printable

#: The name of standard output, as commands of POSIX take it.
STDOUT = "-"
_ALSO_STDOUT = ("/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")

#: What is told of whatever is missing.
NO_SUCH_FILE = "no such file or folder"

#: What a table of separated values may be called.
TABLE_SUFFIXES = (".csv", ".tsv", ".txt")

_KINDS = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a folder",
}
#: What is left over and younger may belong to a process that is at work.
LEFT_ALONE_S = 3600.0
# Numbers of a motion are three to ten times as large as they lie in a packed file, a bomb a
# thousand times; small files may hold a body that stands still.
_MOST_RATIO, _ALWAYS_BYTES = 16, 1 << 26
_WRITE_BITS = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


def open_regular(path: str | Path) -> BinaryIO:
    """A regular file, opened to read its bytes.

    Raises
    ------
    NotAFile
        If the path leads to a folder, a named pipe, a device or a socket.
    UnreadableFile
        If the file is missing or may not be read.
    """
    try:
        # Opening alone can change some devices.
        _check_regular(path, Path(path).stat())
        # Without waiting: what was a file may be a pipe by now.
        file = open(path, "rb", opener=_open_at_once)  # noqa: SIM115
    except NotAFile:
        raise
    except OSError as error:
        raise UnreadableFile(describe_opening(error), file=path) from error
    try:
        _check_regular(path, os.fstat(file.fileno()))
    except NotAFile:
        file.close()
        raise
    return file


def describe_opening(error: OSError, tried: str = "cannot be read") -> str:
    """Why something cannot be opened; of what is missing the same on every system."""
    missing = isinstance(error, FileNotFoundError)
    return f"{tried}: {NO_SUCH_FILE if missing else _reason(error)}"


def _reason(error: OSError) -> str:
    return error.strerror or str(error)


def read_bytes(path: str | Path) -> bytes:
    """The content of a regular file; errors as by `open_regular`."""
    with open_regular(path) as file:
        try:
            return file.read()
        except OSError as error:
            raise UnreadableFile(describe_opening(error), file=path) from error


def most_unpacked(n_bytes: int) -> int:
    """Bytes that what is made of a file, or of a part of it, of `n_bytes` may have."""
    return max(_ALWAYS_BYTES, _MOST_RATIO * n_bytes)


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def _check_regular(path: str | Path, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = _KINDS.get(stat.S_IFMT(status.st_mode), "something else")
        remedy = "name a file in it" if kind == "a folder" else "store its content in a file"
        raise NotAFile(f"is no regular file but {kind}; {remedy}", file=path)


def check_table_name(path: str | Path) -> None:
    """Refuse a name that says that a file is no table of separated values.

    Raises
    ------
    InvalidInput
    """
    suffix = Path(path).suffix.lower()
    if suffix and suffix not in TABLE_SUFFIXES:
        raise InvalidInput(
            f"tables are written as {', '.join(TABLE_SUFFIXES)}, got {path}; spreadsheets open "
            "them, in most of Europe those for Excel"
        )


@contextmanager
def write_atomically(path: str | Path) -> Iterator[Path]:
    """A path beside `path` to write to; on success it takes the place of `path`.

    After an exception, or if the program is killed, `path` is what it was before. The
    path beside has the same suffix. Folders above `path` are made. A link stays, and the
    file that it leads to is replaced; a file that is replaced keeps its rights. Devices and
    named pipes are written to; "-" is standard output.

    Raises
    ------
    UnwritableFile
        If the folder or the file cannot be written, or the file is write-protected.
    """
    path = Path(path)
    with _as_unwritable(path):
        place = Path(os.path.realpath(path)) if path.is_symlink() else path
        before = None if is_stdout(path) else _state_of(place)
        is_stream = is_stdout(path) or (before is not None and not stat.S_ISREG(before.st_mode))
        if not is_stream:
            place.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            dir=None if is_stream else place.parent,
            prefix=f".{place.stem[:40]}-",
            suffix=place.suffix,
        )
        os.close(handle)
    beside = Path(name)
    try:
        with _as_unwritable(path):
            _give_rights(beside, before)
            yield beside
            if is_stream:
                _send(beside, None if is_stdout(path) else place)
            else:
                beside.replace(place)
    finally:
        with suppress(OSError):
            beside.unlink()


def _state_of(place: Path) -> os.stat_result | None:
    """The state of what is to be replaced; None where there is nothing yet."""
    try:
        status = place.stat()
    except FileNotFoundError:
        return None
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError("a folder of this name exists")
    if is_protected(place):
        raise PermissionError("it is write-protected")
    return status


def is_protected(place: Path) -> bool:
    """Whether what is there must not be replaced."""
    # By the bits, too: whoever may write everywhere has protected it all the same.
    return not place.stat().st_mode & _WRITE_BITS or not os.access(place, os.W_OK)


def is_stdout(path: str | Path) -> bool:
    """Whether a name means standard output."""
    return str(path) in (STDOUT, *_ALSO_STDOUT)


def _send(written: Path, place: Path | None) -> None:
    """Copy a file to a stream, by default stdout; terminals get letters only."""
    with written.open("rb") as source:
        if place is not None:
            with place.open("wb", buffering=0) as target:
                shutil.copyfileobj(source, target)
            return
        sys.stdout.flush()
        if sys.stdout.isatty():
            for line in source.read().decode("utf-8", "replace").splitlines():
                sys.stdout.write(f"{printable(line)}\n")
            return
        shutil.copyfileobj(source, sys.stdout.buffer)
        sys.stdout.flush()


def is_leftover(path: Path, name: str) -> bool:
    """Whether a path is what a write of a file of this name left that was killed."""
    stem, suffix = re.escape(f".{Path(name).stem[:40]}-"), re.escape(Path(name).suffix)
    return re.fullmatch(rf"{stem}[a-z0-9_]{{8}}{suffix}", path.name) is not None


def holds_others(folder: Path, name: str) -> bool:
    """Whether a folder holds more than what killed writes of a file of this name left."""
    return folder.is_dir() and not all(is_leftover(path, name) for path in folder.iterdir())


def remove_leftovers(folder: Path, files: Collection[Path]) -> None:
    """Remove what writes of these files of a folder left that were killed."""
    latest = time.time() - LEFT_ALONE_S
    hidden = [path for path in folder.iterdir() if path.name.startswith(".")]
    for path in (path for path in hidden if any(is_leftover(path, file.name) for file in files)):
        with suppress(OSError):
            if path.lstat().st_mtime < latest:
                path.unlink()


@contextmanager
def _as_unwritable(path: Path) -> Iterator[None]:
    try:
        yield
    except (MotionaryError, BrokenPipeError):
        raise
    except OSError as error:
        raise UnwritableFile(
            f"cannot be written: {_reason(error)}; choose a folder that you may write to", file=path
        ) from error


def _give_rights(beside: Path, before: os.stat_result | None) -> None:
    """Those of the file that is replaced; else what any new file gets."""
    if before is None or not stat.S_ISREG(before.st_mode):
        # Temporary files are for their owner only.
        mask = os.umask(0)
        os.umask(mask)
        beside.chmod(0o666 & ~mask)
        return
    if hasattr(os, "chown"):
        with suppress(OSError):
            os.chown(beside, before.st_uid, before.st_gid)
    beside.chmod(stat.S_IMODE(before.st_mode))
