"""One function for many items, in one process or several.

Results come in the order of the items, whatever the number of processes. Whatever goes wrong
with one item is a result among others, so that a batch finishes the rest.
"""

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from motionary.errors import InvalidInput, MotionaryError, ProgramFault

if TYPE_CHECKING:
    from concurrent.futures import Future, ProcessPoolExecutor

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Variable by which Python leaves the current folder out of where it imports from.
SAFE_PATH = "PYTHONSAFEPATH"

_LONGEST_REASON = 200

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
    The result, or a `Failure`. Of an exception that is no `MotionaryError`, or where a
    process was ended, its error is a `ProgramFault`.

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
    workers = _Workers(function, jobs)
    waiting: deque[tuple[Item, Future[Result | Failure[Item]]]] = deque()
    try:
        for item in items:
            waiting.append((item, workers.submit(item)))
            if len(waiting) >= _AHEAD * jobs:
                yield workers.wait_for(*waiting.popleft())
        while waiting:
            yield workers.wait_for(*waiting.popleft())
    finally:
        for _, future in waiting:
            future.cancel()
        workers.end()


class _Workers(Generic[Item, Result]):
    """Processes that do one function; new ones where one was ended from outside."""

    def __init__(self, function: Callable[[Item], Result], jobs: int) -> None:
        self._function, self._jobs = function, jobs
        self._pool = _make_pool(jobs)

    def submit(self, item: Item) -> "Future[Result | Failure[Item]]":
        from concurrent.futures.process import BrokenProcessPool

        with _safe_path():
            try:
                return self._pool.submit(_attempt, self._function, item)
            except BrokenProcessPool:
                self.end()
                self._pool = _make_pool(self._jobs)
                return self._pool.submit(_attempt, self._function, item)

    def wait_for(
        self, item: Item, future: "Future[Result | Failure[Item]]"
    ) -> tuple[Item, Result | Failure[Item]]:
        from concurrent.futures.process import BrokenProcessPool

        try:
            return item, future.result()
        except BrokenProcessPool:
            # Which of the items ended the process is found by doing each alone.
            return item, _do_alone(self._function, item)
        except Exception as error:
            # The result could not be handed over.
            return item, _fault(item, error)

    def end(self) -> None:
        self._pool.shutdown()


def _do_alone(function: Callable[[Item], Result], item: Item) -> Result | Failure[Item]:
    """The result of an item in a process of its own."""
    from concurrent.futures.process import BrokenProcessPool

    with _safe_path(), _make_pool(1) as pool:
        try:
            return pool.submit(_attempt, function, item).result()
        except BrokenProcessPool:
            return Failure(
                item,
                ProgramFault(
                    "its process was ended from outside, or crashed; it may need more memory "
                    "than there is"
                ),
            )


def _make_pool(jobs: int) -> "ProcessPoolExecutor":
    # Imported late: most runs need no pool, and it costs a fifth of their start.
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    # Spawned everywhere, so that what works on one system works on the others.
    with _safe_path():
        return ProcessPoolExecutor(jobs, get_context("spawn"), _follow_parent)


@contextmanager
def _safe_path() -> Iterator[None]:
    """Let processes that are started meanwhile import nothing from the current folder.

    Each begins as `python -c`, with the current folder first on its path: a `pickle.py`
    among the recordings would be run. What the program itself imports from is handed over
    afterwards.
    """
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(SAFE_PATH, None)
        else:
            os.environ[SAFE_PATH] = before


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


def _attempt(function: Callable[[Item], Result], item: Item) -> Result | Failure[Item]:
    try:
        return function(item)
    except MotionaryError as error:
        return Failure(item, error)
    except Exception as error:
        return _fault(item, error)


def _fault(item: Item, error: Exception) -> Failure[Item]:
    """What nobody foresaw, as the failure of one item among others."""
    lines = str(error).splitlines()
    text = (
        f"{type(error).__name__}: {lines[0][:_LONGEST_REASON]}" if lines else type(error).__name__
    )
    fault = ProgramFault(f"could not be done: {text}; please report this with the file")
    fault.__cause__ = error
    return Failure(item, fault)
