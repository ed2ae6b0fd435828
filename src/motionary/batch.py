"""One function for many items, in one process or several, or by the workers of a cluster.

Results come in the order of the items, whoever does them. Whatever goes wrong with one item is
a result among others, so that a batch finishes the rest.
"""

import os
import pkgutil
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Self, TypeVar

from motionary.errors import InvalidInput, MotionaryError, ProgramFault, Unreachable

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


class Cluster:
    """Workers of a Dask scheduler; takes the place of a number of processes.

    Parameters
    ----------
    address : of the scheduler, such as tcp://host:8786
    timeout_s : for how long an answer, or a worker, is waited for

    Raises
    ------
    InvalidInput
        If Dask is not installed.
    Unreachable
        If no scheduler answers, it has no worker, or a worker has not this version of motionary.
    """

    def __init__(self, address: str, *, timeout_s: float = 10.0) -> None:
        try:
            import distributed
        except ImportError as error:
            raise InvalidInput(
                "a scheduler needs Dask: pip install 'motionary[cluster]', here and where the "
                "workers run"
            ) from error
        if not address.rpartition(":")[2].isdecimal():
            raise InvalidInput(
                f"a scheduler's address ends in its port, as tcp://host:8786, got {address!r}"
            )
        self.address, self._timeout_s = address, timeout_s
        self._is_gone = False
        try:
            # Half of its functions have no types.
            connect: Any = distributed.Client
            self._client = connect(address, timeout=timeout_s, set_as_default=False)
        except (OSError, ValueError, ImportError) as error:
            raise Unreachable(
                f"no scheduler answers at {address} within {timeout_s:g} s; start one with "
                "`dask scheduler`, and give the address that it prints"
            ) from error
        try:
            self._check_workers()
        except BaseException:
            self.close()
            raise

    def _check_workers(self) -> None:
        from motionary import __version__

        try:
            self._client.wait_for_workers(1, timeout=self._timeout_s)
        except TimeoutError as error:
            raise self._lacks_workers() from error
        # By what Python has: a worker without motionary could not even load a function of ours.
        found = self._client.run(pkgutil.resolve_name, "motionary:__version__", on_error="return")
        for worker, version in found.items():
            if version != __version__:
                what = "no motionary" if isinstance(version, Exception) else f"version {version}"
                raise Unreachable(
                    f"worker {worker} of {self.address} has {what}, here is {__version__}; "
                    "install the same version there"
                )

    def _lacks_workers(self) -> Unreachable:
        return Unreachable(
            f"the scheduler at {self.address} has no workers; start some with "
            f"`dask worker {self.address}`"
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the scheduler, which goes on without us."""
        # A scheduler that is gone cannot be taken leave of.
        with suppress(Exception):
            self._client.close(timeout=self._timeout_s)

    @property
    def n_ahead(self) -> int:
        """Items handed out ahead of the one whose result is awaited."""
        with self._reaching():
            threads: dict[str, int] = self._client.nthreads()
        return _AHEAD * max(sum(threads.values()), 1)

    def submit(self, function: Callable[[Item], Result], item: Item) -> Any:
        """What `wait_for` takes, at once."""
        # The same item may be asked for again after something that it reads has changed.
        with self._reaching():
            return self._client.submit(_attempt, function, item, pure=False)

    def wait_for(self, item: Item, future: Any) -> tuple[Item, Any]:
        """An item and its result."""
        from concurrent.futures import CancelledError

        with self._reaching():
            while True:
                try:
                    return item, future.result(timeout=self._timeout_s)
                except TimeoutError as error:
                    if not self._client.scheduler_info()["workers"]:
                        raise self._lacks_workers() from error
                except (CancelledError, OSError):
                    raise
                except Exception as error:
                    return item, _fault(item, error)

    @contextmanager
    def _reaching(self) -> Iterator[None]:
        """Turn what is raised where the scheduler is gone into an error that says so."""
        from concurrent.futures import CancelledError

        try:
            yield
        except Unreachable:
            raise
        except (CancelledError, OSError) as error:
            self._is_gone = True
            raise Unreachable(
                f"the scheduler at {self.address} is gone; what is ready is kept, start it "
                "again and give the same command"
            ) from error

    def cancel(self, futures: "list[Any]") -> None:
        """Let go of what was handed out."""
        # One that is gone would be waited for.
        if not self._is_gone:
            with suppress(Exception):
                self._client.cancel(futures)


#: Who does the work: so many processes, or a cluster.
Workers = int | Cluster


def map_ordered(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    *,
    jobs: Workers = 1,
    on_done: Callable[[Item], None] | None = None,
) -> Iterator[Result | Failure[Item]]:
    """Results of a function for each item, in the order of the items.

    Parameters
    ----------
    function : with `jobs` above 1 it, items and results must be picklable, so a function
        of a module, or `functools.partial` of one
    items : taken one after the other as they are needed
    jobs : number of processes, with 1 everything runs in this one; or a cluster
    on_done : called with an item before its result is handed out

    Yields
    ------
    The result, or a `Failure`. Of an exception that is no `MotionaryError`, or where a
    process was ended, its error is a `ProgramFault`.

    Raises
    ------
    InvalidInput
        If `jobs` is below 1.
    Unreachable
        If the scheduler of a cluster, or all its workers, are gone.
    """
    if not isinstance(jobs, Cluster) and jobs < 1:
        raise InvalidInput(f"jobs must be 1 or more, got {jobs}")
    pairs = _map_here(function, items) if jobs == 1 else _map_ahead(function, items, jobs)
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


def _map_ahead(
    function: Callable[[Item], Result], items: Iterable[Item], jobs: Workers
) -> Iterator[tuple[Item, Result | Failure[Item]]]:
    """Results by workers, which have a few items ahead of the one that is awaited."""
    workers = jobs if isinstance(jobs, Cluster) else _Processes(jobs)
    function = _Packed(function)
    waiting: deque[tuple[Item, Any]] = deque()
    try:
        for item in items:
            waiting.append((item, workers.submit(function, item)))
            if len(waiting) >= workers.n_ahead:
                yield workers.wait_for(*waiting.popleft())
        while waiting:
            yield workers.wait_for(*waiting.popleft())
    finally:
        workers.cancel([future for _, future in waiting])


class _Packed(Generic[Item, Result]):
    """A function, pickled once: sending what it carries may take longer than an item takes."""

    def __init__(self, function: Callable[[Item], Result]) -> None:
        import pickle

        self._bytes = pickle.dumps(function)

    def __call__(self, item: Item) -> Result:
        result: Result = _unpickle(self._bytes)(item)
        return result


@lru_cache(maxsize=1)
def _unpickle(function: bytes) -> Callable[[Any], Any]:
    import pickle

    loaded: Callable[[Any], Any] = pickle.loads(function)
    return loaded


class _Processes:
    """Processes of this computer; new ones where one was ended from outside."""

    def __init__(self, jobs: int) -> None:
        self._jobs, self.n_ahead = jobs, _AHEAD * jobs
        self._pool = _make_pool(jobs)

    def submit(self, function: Callable[[Item], Result], item: Item) -> "_Pending[Item]":
        from concurrent.futures.process import BrokenProcessPool

        with _safe_path():
            try:
                future = self._pool.submit(_attempt, function, item)
            except BrokenProcessPool:
                self._pool.shutdown()
                self._pool = _make_pool(self._jobs)
                future = self._pool.submit(_attempt, function, item)
        return _Pending(function, future)

    def wait_for(self, item: Item, pending: "_Pending[Item]") -> tuple[Item, Any]:
        from concurrent.futures.process import BrokenProcessPool

        try:
            return item, pending.future.result()
        except BrokenProcessPool:
            # Which of the items ended the process is found by doing each alone.
            return item, _do_alone(pending.function, item)
        except Exception as error:
            # The result could not be handed over.
            return item, _fault(item, error)

    def cancel(self, waiting: "list[_Pending[Item]]") -> None:
        for pending in waiting:
            pending.future.cancel()
        self._pool.shutdown()


class _Pending(NamedTuple, Generic[Item]):
    function: Callable[[Item], Any]
    future: "Future[Any]"


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
