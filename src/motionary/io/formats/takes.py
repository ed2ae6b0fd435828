"""Files that hold several recordings: which one is meant, and what was loaded of the last one.

A recording of such a file is called by the file's name, `#`, and the take: `batch.npy#007`.
"""

import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path, PurePath
from typing import Any, TypeVar

from motionary.errors import InvalidInput, SeveralRecordings
from motionary.io.text import TAKE_MARK

Loaded = TypeVar("Loaded")

#: Instead of a take: asks a reader for the names of all.
EVERY = "*"

# Names that are part of a path, and told from a suffix.
_PLAIN = re.compile(r"[\w-]+")
_FEWEST_DIGITS = 3
_TICK_NS = 200_000_000

# What was loaded last of a file with several recordings: they are read one after the other.
_kept: dict[tuple[str, int, int], Any] = {}


def choose_take(takes: Sequence[str] | int, take: str | int | None, source: str) -> int:
    """Which of several recordings in a file is meant: by its name, or by its number from 1.

    Parameters
    ----------
    takes : names of the recordings, or how many there are where they have none
    take : what is asked for
    source : name of the file

    Raises
    ------
    SeveralRecordings
        If there are several and none is named, or every one is asked for.
    InvalidInput
        If none is called so.
    """
    # Names of thousands are not written out for each that is read.
    names: Sequence[object] = range(1, takes + 1) if isinstance(takes, int) else takes
    if take == EVERY or (take is None and len(names) > 1):
        raise SeveralRecordings(source, [str(name) for name in names])
    if take is None:
        return 0
    if str(take) in names:
        return list(names).index(str(take))
    if str(take).isascii() and str(take).isdigit() and 1 <= int(take) <= len(names):
        return int(take) - 1
    some = ", ".join(str(name)[:30] for name in names[:8]) + (", ..." if len(names) > 8 else "")
    raise InvalidInput(
        f"has no take {str(take)[:40]!r}; it has {some} ({len(names)} in all)", file=source
    )


def note_take(names: Sequence[str], number: int, *, is_given: bool, called: str) -> tuple[str, ...]:
    """A note on which of the takes that a file calls `called` is read; none where it has one."""
    if len(names) < 2:
        return ()
    others = ", ".join(names[:10]) + (", ..." if len(names) > 10 else "")
    why = "as given" if is_given else "the first that moves"
    return (
        f"{called} {names[number]}, {why}, of {len(names)} ({others}); --take NAME (take=...) "
        "reads another",
    )


def recall(path: Path, load: Callable[[], Loaded], *, count: Callable[[Loaded], int]) -> Loaded:
    """What `load` gives; kept until another file is loaded, where it holds several recordings."""
    try:
        status = path.stat()
    except OSError:
        # Loading says what is wrong.
        return load()
    # What is written twice within a tick of the clock may have the same time and size.
    is_settled = abs(time.time_ns() - status.st_mtime_ns) > _TICK_NS
    key = str(path.absolute()), status.st_mtime_ns, status.st_size
    if key in _kept:
        kept: Loaded = _kept[key]
        return kept
    _kept.clear()
    loaded = load()
    if is_settled and count(loaded) > 1:
        _kept[key] = loaded
    return loaded


def label_takes(names: Sequence[str]) -> list[str]:
    """What takes are called behind a file's name: their names where plain, else numbers."""
    numbered = list(names) == [str(number) for number in range(1, len(names) + 1)]
    if not numbered and all(_PLAIN.fullmatch(name) for name in names):
        return list(names)
    digits = max(_FEWEST_DIGITS, len(str(len(names))))
    return [f"{number:0{digits}}" for number in range(1, len(names) + 1)]


def file_of(path: str | PurePath) -> Path:
    """The file of a recording, which may hold others, too."""
    return split_take(path)[0]


def split_take(path: str | PurePath) -> tuple[Path, str]:
    """The file and the take of a path; no take where a file is called so itself."""
    path = Path(path)
    name, mark, take = path.name.rpartition(TAKE_MARK)
    if not mark or TAKE_MARK not in path.suffix or path.exists():
        return path, ""
    return path.with_name(name), take
