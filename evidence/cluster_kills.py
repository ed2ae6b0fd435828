"""An index made by a cluster, of which a process is killed: it is the same in the end.

Scheduler, two workers and the command are forks of this process, which has loaded what they need;
one of them is ended as `kill -9` does at a moment drawn over the time that the command takes. Then
the same command runs again, and the index must equal that of one process, byte for byte.
"""

import asyncio
import contextlib
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from evidence.common.recordings import Recordings, Results
from motionary.batch import Failure, map_ordered
from motionary.cli.app import run_app
from motionary.errors import MotionaryError
from motionary.io import write
from motionary.retrieval.index import Index, building
from motionary.retrieval.index.shard_files import FILE
from motionary.retrieval.index.storage import read_manifest
from motionary.samples import synthetic_motion

TITLE = "Indexing by a cluster, of which a process is killed"
SPLIT = "nothing is learned or chosen"
SEED = 26
SYNTHETIC = True
DATA = (("synthetic recordings of the package, and one file that is broken", (40, 0.9)),)

VICTIMS = ("worker", "scheduler", "client")
KILLS = 30
FILES = 40
#: Files of a portion; so few, that a small collection has more portions than may stay unjoined.
PORTION = 4
WORKERS = 2
LONGEST_S = 60.0

State = dict[str, bytes]


class Place(NamedTuple):
    """Where recordings are, the index that one process makes, and how many there are."""

    folder: Path
    whole: State
    n_files: int

    @property
    def log(self) -> Path:
        """What its processes say."""
        return self.folder / "log"


# -- forks --------------------------------------------------------------------------------


def _fork(work: Callable[[], int], log: Path) -> int:
    """Process that does some work, and ends with its code."""
    child = os.fork()
    if child:
        return child
    code = 99
    try:
        target = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        for stream in (1, 2):
            os.dup2(target, stream)
        code = work()
    finally:
        os._exit(code)


def _kill(child: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(child, signal.SIGKILL)
    with contextlib.suppress(ChildProcessError):
        os.waitpid(child, 0)


def _wait(child: int, seconds: float) -> int | None:
    """Exit code of a process; None if it still runs after some seconds."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.01)
    return None


class Processes:
    """A scheduler and its workers, each a fork."""

    def __init__(self, log: Path) -> None:
        import distributed

        reads, writes = os.pipe()

        async def schedule() -> None:
            async with distributed.Scheduler(host="127.0.0.1", dashboard=False) as scheduler:
                os.write(writes, f"{scheduler.address}\n".encode())
                await scheduler.finished()

        self.scheduler = _fork(lambda: _serve(schedule()), log)
        os.close(writes)
        with os.fdopen(reads) as told:
            self.address = told.readline().strip()

        async def do_work() -> None:
            place = tempfile.mkdtemp(dir=log.parent)
            async with distributed.Worker(
                self.address, nthreads=1, dashboard=False, local_directory=place
            ) as worker:
                await worker.finished()

        self.workers = [_fork(lambda: _serve(do_work()), log) for _ in range(WORKERS)]

    def __enter__(self) -> "Processes":
        return self

    def __exit__(self, *_: object) -> None:
        for child in (*self.workers, self.scheduler):
            _kill(child)


def _serve(server: Any) -> int:
    asyncio.run(server)
    return 0


def _index(place: Path, log: Path, address: str | None = None) -> int:
    """Process of the command; by the workers of a scheduler, or alone."""

    def work() -> int:
        by = [] if address is None else ["--scheduler", address]
        target = str(place / "index")
        sys.argv = ["motionary", "index", str(place.parent / "recordings"), "--index", target, *by]
        try:
            run_app()
        except SystemExit as end:
            return int(end.code or 0)
        return 0

    return _fork(work, log)


# -- rounds -------------------------------------------------------------------------------


def prepare(folder: Path, *, n_files: int = FILES) -> Place:
    """Make recordings, one of them broken, and the index of one process; load what forks need."""
    import distributed  # noqa: F401

    building._FILES = PORTION
    recordings = folder / "recordings"
    recordings.mkdir()
    for i in range(n_files - 1):
        motion = synthetic_motion(("squat", "kick_left")[i % 2], seed=i, rate_hz=30)
        write(motion, recordings / f"{i:02}.bvh")
    (recordings / f"{n_files - 1}.bvh").write_text("HIERARCHY")
    Index.open(recordings, at=folder / "alone" / "index").update()
    return Place(folder, state_of(folder / "alone"), n_files)


def _time_whole(place: Place) -> float:
    """Seconds of the command by a cluster that nobody ends."""
    folder = place.folder / "whole"
    shutil.rmtree(folder, ignore_errors=True)
    with Processes(place.log) as processes:
        began = time.monotonic()
        wrong = finish(place, folder, processes)
    if wrong:
        raise RuntimeError(f"a cluster makes another index than one process: {wrong}")
    return time.monotonic() - began


def state_of(place: Path) -> State:
    """Bytes of the manifest and of the shards that it names; nothing without a manifest."""
    manifest = read_manifest(place / "index")
    files = [place / "index" / FILE] if manifest else []
    for name in manifest.shards if manifest else ():
        files += sorted((place / "index" / name).iterdir())
    return {path.relative_to(place).as_posix(): path.read_bytes() for path in files}


def index_killed(
    place: Place,
    folder: Path,
    processes: Processes,
    *,
    victim: str,
    after_s: float = 0.0,
    at_shards: int = 0,
) -> Results:
    """How the command ended of which a process was ended, after a time or so many shards."""
    client = _index(folder, place.log, processes.address)
    began = time.monotonic()
    code = _wait(client, after_s) if after_s else None
    while at_shards and code is None and time.monotonic() - began < LONGEST_S:
        with contextlib.suppress(FileNotFoundError):
            names = [path.name for path in (folder / "index").iterdir()]
            if sum(not name.startswith(".") and name != FILE for name in names) >= at_shards:
                break
        code = _wait(client, 0.01)
    targets = {"client": client, "scheduler": processes.scheduler, "worker": processes.workers[0]}
    is_over = code is not None
    if not is_over:
        os.kill(targets[victim], signal.SIGKILL)
        began = time.monotonic()
        code = _wait(client, LONGEST_S)
    if code is None:
        _kill(client)
    return {
        "victim": victim,
        "over": is_over,
        "seconds": time.monotonic() - began,
        "wrong": [] if code is not None else ["the command did not end"],
    }


def kill_one(place: Place, victim: str, number: int, whole_s: float) -> Results:
    """What a kill left, and whether the same command made of it what one process makes."""
    rng = Random(f"{SEED} {victim} {number}")
    moment = (
        {"at_shards": rng.randint(1, place.n_files // PORTION)}
        if number % 2
        else {"after_s": rng.uniform(0.0, whole_s)}
    )
    folder = place.folder / "killed"
    shutil.rmtree(folder, ignore_errors=True)
    again: list[str] | None = None
    with Processes(place.log) as processes:
        found = index_killed(place, folder, processes, victim=victim, **moment)
        left = _judge_left(folder, found["wrong"])
        if victim == "client":
            again = finish(place, folder, processes)
    if again is None:
        with Processes(place.log) as processes:
            again = finish(place, folder, processes)
    return {**found, **moment, "ready": left, "again": again}


def kill_each(folder: Path, n_files: int) -> list[str]:
    """What is wrong with an index of which each kind of process was ended, one after the other."""
    place = prepare(folder, n_files=n_files)
    at = folder / "killed"
    wrong: list[str] = []
    for victims in (("client", "scheduler"), ("worker",)):
        with Processes(place.log) as processes:
            for victim in victims:
                found = index_killed(place, at, processes, victim=victim, at_shards=1)
                wrong += found["wrong"]
                wrong += [f"{victim} was not ended in time"] * found["over"]
                _judge_left(at, wrong)
            if victims == ("worker",):
                wrong += compare(place, at)
    return wrong


def _judge_left(folder: Path, wrong: list[str]) -> int:
    """How many recordings a killed command left ready; what is no index is wrong."""
    try:
        index = Index.open(folder.parent / "recordings", at=folder / "index")
    except MotionaryError as error:
        wrong.append(str(error))
        return 0
    wrong += index.damage
    names = [one.source for one in index.collection().sequences]
    if len(names) != len(set(names)):
        wrong.append("a recording is there twice")
    return len(names)


def finish(place: Place, folder: Path, processes: Processes) -> list[str]:
    """What is wrong with the index after the command, of which nobody ends anything."""
    client = _index(folder, place.log, processes.address)
    code = _wait(client, LONGEST_S)
    if code is None:
        _kill(client)
    # 1: there is a file that could not be read.
    if code != 1:
        return [f"it ended with {code}: {place.log.read_text()[-300:]}"]
    return compare(place, folder)


def compare(place: Place, folder: Path) -> list[str]:
    """Files that differ from those of one process."""
    found = state_of(folder)
    names = sorted({*found, *place.whole})
    return [f"{name} differs" for name in names if found.get(name) != place.whole.get(name)]


# -- the page -----------------------------------------------------------------------------


def measure(_: Recordings) -> Results:
    """Kills of each kind of process, the kinds at the same time."""
    rows = []
    for row in map_ordered(try_often, VICTIMS, jobs=len(VICTIMS)):
        if isinstance(row, Failure):
            raise row.error
        rows.append(row)
    return {"rows": rows, "files": FILES, "portion": PORTION}


def try_often(victim: str) -> Results:
    """Kills of one kind of process."""
    with tempfile.TemporaryDirectory() as temporary:
        place = prepare(Path(temporary))
        # The first is slower than those that follow.
        whole_s = min(_time_whole(place) for _ in range(2))
        rounds = []
        for number in range(KILLS):
            rounds.append(kill_one(place, victim, number, whole_s))
            sys.stderr.write(f"{rounds[-1]}\n")
        return {"victim": victim, "whole_s": whole_s, **_count(rounds, place.n_files - 1)}


def _count(rounds: list[Results], n_whole: int) -> Results:
    waited = sorted(one["seconds"] for one in rounds)
    return {
        "kills": len(rounds),
        "over": sum(one["over"] for one in rounds),
        "none": sum(one["ready"] == 0 for one in rounds),
        "part": sum(0 < one["ready"] < n_whole for one in rounds),
        "all": sum(one["ready"] == n_whole for one in rounds),
        "median_s": waited[len(waited) // 2],
        "longest_s": waited[-1],
        "damaged": sum(bool(one["wrong"]) for one in rounds),
        "other": sum(bool(one["again"]) for one in rounds),
        "wrong": [text for one in rounds for text in one["wrong"] + one["again"]][:5],
    }
