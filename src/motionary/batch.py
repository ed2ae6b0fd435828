"""The same work for many files, in order, and results written whole or not at all.

Results come in the order of the items, whatever the number of processes. One broken
file is a result among others, so that a batch finishes the rest.
"""

import os
import signal
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from motionary.errors import InvalidInput, MotionaryError, UnwritableFile

if TYPE_CHECKING:
    from concurrent.futures import Future

Item = TypeVar("Item")
Result = TypeVar("Result")

# Items handed out per process ahead of the one whose result is awaited.
_AHEAD = 4


@dataclass(frozen=True, slots=True)
class Failure(Generic[Item]):
    """An item that could not be done, and why.

    Attributes
    ----------
    item : the item
    error : the error that it raised
    """

    item: Item
    error: MotionaryError


def map_ordered(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    *,
    jobs: int = 1,
    on_done: Callable[[Item], None] | None = None,
) -> Iterator[Result | Failure[Item]]:
    """Results of a function for each item, in the order of the items.

    Parameters
    ----------
    function : with `jobs` above 1 it, items and results must be picklable, so a function
        of a module, or `functools.partial` of one
    items : taken one after the other as they are needed
    jobs : number of processes; with 1 everything runs in this one
    on_done : called with an item before its result is handed out

    Yields
    ------
    The result, or a `Failure` if the function raised a `MotionaryError`. Any other
    exception is a fault of the program and is raised.

    Raises
    ------
    InvalidInput
        If `jobs` is below 1.
    """
    if jobs < 1:
        raise InvalidInput(f"jobs must be 1 or more, got {jobs}")
    pairs = _map_here(function, items) if jobs == 1 else _map_in_pool(function, items, jobs)
    return _report(pairs, on_done)


def _report(
    pairs: Iterator[tuple[Item, Result | Failure[Item]]], on_done: Callable[[Item], None] | None
) -> Iterator[Result | Failure[Item]]:
    for item, result in pairs:
        if on_done is not None:
            on_done(item)
        yield result


def _map_here(
    function: Callable[[Item], Result], items: Iterable[Item]
) -> Iterator[tuple[Item, Result | Failure[Item]]]:
    for item in items:
        yield item, _attempt(function, item)


def _map_in_pool(
    function: Callable[[Item], Result], items: Iterable[Item], jobs: int
) -> Iterator[tuple[Item, Result | Failure[Item]]]:
    # Imported late: most runs need no pool, and it costs a fifth of their start.
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    # Spawned everywhere, so that what works on one system works on the others.
    context = get_context("spawn")
    with ProcessPoolExecutor(jobs, context, _follow_parent) as pool:
        waiting: deque[tuple[Item, Future[Result | Failure[Item]]]] = deque()
        try:
            for item in items:
                waiting.append((item, pool.submit(_attempt, function, item)))
                if len(waiting) >= _AHEAD * jobs:
                    yield _await(waiting)
            while waiting:
                yield _await(waiting)
        finally:
            for _, future in waiting:
                future.cancel()


def _follow_parent() -> None:
    # Ctrl-C reaches every process of a terminal; one of them is enough to say so.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _await(
    waiting: "deque[tuple[Item, Future[Result | Failure[Item]]]]",
) -> tuple[Item, Result | Failure[Item]]:
    item, future = waiting.popleft()
    return item, future.result()


def _attempt(function: Callable[[Item], Result], item: Item) -> Result | Failure[Item]:
    try:
        return function(item)
    except MotionaryError as error:
        return Failure(item, error)


@contextmanager
def write_atomically(path: str | Path) -> Iterator[Path]:
    """A path beside `path` to write to; on success it takes the place of `path`.

    After an exception, or if the program is killed, `path` is what it was before. The
    path beside has the same suffix. Folders above `path` are made.

    Raises
    ------
    UnwritableFile
        If the folder or the file cannot be written.
    """
    path = Path(path)
    with _as_unwritable(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            raise IsADirectoryError("a folder of this name exists")
        handle, name = tempfile.mkstemp(
            dir=path.parent, prefix=f".{path.stem[:40]}-", suffix=path.suffix
        )
        os.close(handle)
    beside = Path(name)
    try:
        with _as_unwritable(path):
            _give_usual_rights(beside)
            yield beside
            beside.replace(path)
    except BaseException:
        with suppress(OSError):
            beside.unlink()
        raise


@contextmanager
def _as_unwritable(path: Path) -> Iterator[None]:
    try:
        yield
    except MotionaryError:
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise UnwritableFile(
            f"{path}: cannot be written: {reason}; choose a folder that you may write to"
        ) from error


def _give_usual_rights(path: Path) -> None:
    # Temporary files are for their owner only; results are made like any other file.
    mask = os.umask(0)
    os.umask(mask)
    path.chmod(0o666 & ~mask)
