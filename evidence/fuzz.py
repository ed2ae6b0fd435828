"""Damaged files of every kind are opened: each is read, or refused with a line for people.

`python -m evidence.fuzz [--seconds S] [--jobs N] [--kinds A,B]` goes on where the last run ended
and keeps counts and what it found in `.fuzz`; `--again KIND SEED` opens one input once more and
shows the traceback. An input is made of its kind and seed alone.

A fault is an exception that is none of ours, a warning, an invalid result, more than 10 s of
processor time, no end within 60 s, a process that dies, or more than 1 GB of memory.
"""

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[1] / ".fuzz"
LEAST = 20_000
BATCH = 250
SECONDS, PATIENCE_S = 10.0, 60.0
MEMORY = 1 << 30

#: Some damage crashes ufbx, which in a process of its own is an error of that file.
CRASHES = ("fbx",)


@dataclass
class Count:
    """What became of the inputs of a kind."""

    inputs: int = 0
    read: int = 0
    refused: int = 0
    faults: int = 0
    crashes: int = 0
    slowest_s: float = 0.0
    most_mb: float = 0.0
    busy_s: float = 0.0
    found: dict[str, dict[str, Any]] = field(default_factory=dict)


# -- the process that opens ---------------------------------------------------------------


def work(pipe: Connection, clock: Any, folder: Path) -> None:
    """Open inputs as they are asked for; `clock` tells which one since when."""
    from evidence.common.fuzzed import Bench

    warnings.simplefilter("error")
    warnings.simplefilter("ignore", ResourceWarning)
    benches: dict[str, Bench] = {}
    limited = False
    while True:
        kind, first, stop = pipe.recv()
        if kind not in benches:
            try:
                benches[kind] = Bench(kind, folder / kind)
            except Exception:
                pipe.send(("broken", f"{kind}: {traceback.format_exc(limit=-3)}"))
                return
        if not limited:
            limited = _limit_memory()
        for seed in range(first, stop):
            clock[0], clock[1] = seed, time.monotonic()
            pipe.send(_open_one(benches[kind], seed))
        clock[1] = 0.0
        pipe.send(("peak", _peak_mb()))


def _open_one(bench: Any, seed: int) -> tuple[Any, ...]:
    began = time.process_time()
    try:
        outcome: tuple[Any, ...] = ("read",) if bench.try_one(seed) else ("refused",)
    except (Exception, RecursionError, MemoryError) as error:
        outcome = ("fault", *_signature(error))
        name, content = bench.draw(seed)
        (found := bench.folder.parents[1] / "found").mkdir(exist_ok=True)
        (found / f"{bench.name} {seed} {Path(name).name}").write_bytes(content)
    seconds = time.process_time() - began
    if seconds > SECONDS and outcome[0] != "fault":
        outcome = ("fault", "slow", f"{seconds:.0f} s")
    return (*(*outcome, "", "")[:3], seconds)


def _signature(error: BaseException) -> tuple[str, str]:
    frames = [frame for frame in traceback.extract_tb(error.__traceback__)
              if "motionary" in frame.filename or "evidence" in frame.filename]  # fmt: skip
    last = frames[-1]
    place = f"{Path(last.filename).name}:{last.name}"
    return f"{type(error).__name__} in {place}", str(error)[:200]


def _limit_memory() -> bool:
    with suppress(ImportError, OSError, ValueError):
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * os.sysconf("SC_PAGE_SIZE") + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    return True


def _peak_mb() -> float:
    with suppress(ImportError):
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return 0.0


# -- the process that counts --------------------------------------------------------------


class Worker:
    """A process that opens inputs of batches, ended and begun anew where one does not end."""

    def __init__(self, counts: dict[str, Count], folder: Path) -> None:
        self.counts, self.folder = counts, folder
        self.batch: tuple[str, int, int] | None = None
        self.begin()

    def begin(self) -> None:
        """Start the process."""
        context = multiprocessing.get_context("spawn")
        self.place = tempfile.TemporaryDirectory(dir=self.folder)
        self.clock = context.RawArray("d", 2)
        self.pipe, other = context.Pipe()
        self.process = context.Process(
            target=work, args=(other, self.clock, Path(self.place.name)), daemon=True
        )
        self.process.start()
        other.close()
        self.done = 0

    def give(self, kind: str) -> None:
        """Let it open the next inputs of a kind."""
        first = self.counts[kind].inputs
        self.batch = (kind, first, first + BATCH)
        self.counts[kind].inputs += BATCH
        self._send(first)

    def _send(self, first: int) -> None:
        assert self.batch is not None
        kind, _, stop = self.batch
        self.next = first
        self.pipe.send((kind, first, stop))

    def follow(self) -> bool:
        """Take what came in; whether the batch has ended."""
        assert self.batch is not None
        kind, _, stop = self.batch
        count = self.counts[kind]
        try:
            while self.pipe.poll(0.2):
                message = self.pipe.recv()
                if message[0] == "broken":
                    raise RuntimeError(message[1])
                if message[0] == "peak":
                    count.most_mb = max(count.most_mb, message[1])
                    self.done += BATCH
                    return True
                self._take(count, kind, message)
            hangs = self.clock[1] and time.monotonic() - self.clock[1] > PATIENCE_S
            if not hangs and self.process.is_alive():
                return False
        except (EOFError, OSError):
            hangs = False
        return self._replace(count, kind, stop, hangs=bool(hangs))

    def _take(self, count: Count, kind: str, message: tuple[Any, ...]) -> None:
        outcome, what, text, seconds = message
        if outcome == "fault":
            self._fault(count, kind, what, text)
        else:
            setattr(count, outcome, getattr(count, outcome) + 1)
        count.slowest_s = max(count.slowest_s, seconds)
        count.busy_s += seconds
        self.next += 1

    def _fault(self, count: Count, kind: str, what: str, text: str) -> None:
        count.faults += 1
        entry = count.found.setdefault(what, {"seed": self.next, "text": text, "times": 0})
        entry["times"] += 1

    def _replace(self, count: Count, kind: str, stop: int, *, hangs: bool) -> bool:
        """A new process for what is left of the batch; whether nothing is."""
        self.end()
        if kind in CRASHES and not hangs:
            count.crashes += 1
        else:
            self._fault(count, kind, "hang" if hangs else "died", "")
        at = self.next + 1
        self.begin()
        if at < stop:
            self._send(at)
        return at >= stop

    def end(self) -> None:
        """End the process, and remove its folder."""
        self.process.kill()
        self.process.join()
        self.pipe.close()
        self.place.cleanup()


def run(seconds: float, jobs: int, kinds: list[str], folder: Path) -> dict[str, Count]:
    """Open inputs for so long; the counts of all runs."""
    folder.mkdir(exist_ok=True)
    counts = load(folder, kinds)
    workers = [Worker(counts, folder) for _ in range(jobs)]
    stop, saved = time.monotonic() + seconds, time.monotonic()
    for worker in workers:
        worker.give(_next(counts, kinds))
    busy = list(workers)
    while busy:
        for worker in list(busy):
            if worker.follow():
                if time.monotonic() >= stop:
                    busy.remove(worker)
                    continue
                if worker.done > 40 * BATCH:
                    # What leaks in a library, 13 kB a file in ufbx, is no fault of a file.
                    worker.end()
                    worker.begin()
                worker.give(_next(counts, kinds))
        if time.monotonic() - saved > 20:
            save(counts, folder)
            saved = time.monotonic()
    for worker in workers:
        worker.end()
    save(counts, folder)
    return counts


def _next(counts: dict[str, Count], kinds: list[str]) -> str:
    """The kind with the fewest inputs until each has enough, then the one that took least time."""
    few = [kind for kind in kinds if counts[kind].inputs < LEAST]
    if few:
        return min(few, key=lambda kind: counts[kind].inputs)
    return min(kinds, key=lambda kind: counts[kind].busy_s)


def load(folder: Path = FOLDER, kinds: list[str] | None = None) -> dict[str, Count]:
    """Counts of the runs so far."""
    path = folder / "counts.json"
    content = json.loads(path.read_text("utf-8")) if path.exists() else {}
    counts = {kind: Count(**entry) for kind, entry in content.items()}
    return counts | {kind: Count() for kind in kinds or () if kind not in counts}


def save(counts: dict[str, Count], folder: Path) -> None:
    """Keep counts and what was found."""
    from motionary.files import write_atomically

    with write_atomically(folder / "counts.json") as beside:
        beside.write_text(json.dumps({k: vars(c) for k, c in counts.items()}, indent=1), "utf-8")


def report(counts: dict[str, Count]) -> Iterator[str]:
    """Counts by kind, and each fault with how to see it."""
    yield f"{'kind':20} {'inputs':>8} {'read':>7} {'refused':>8} {'faults':>6} {'slowest s':>9}"
    for kind, c in counts.items():
        yield f"{kind:20} {c.inputs:8} {c.read:7} {c.refused:8} {c.faults:6} {c.slowest_s:9.2f}"
    yield f"{sum(c.inputs for c in counts.values())} inputs in all"
    for kind, c in counts.items():
        for what, entry in c.found.items():
            yield f"{kind}: {what}, {entry['times']} times: {entry['text'][:100]}"
            yield f"    python -m evidence.fuzz --again {kind} {entry['seed']}"


def main(arguments: list[str]) -> int:
    """Exit code: 1 where a fault was found."""
    from evidence.common.fuzzed import KINDS, Bench

    parser = argparse.ArgumentParser(prog="python -m evidence.fuzz")
    parser.add_argument("--seconds", type=float, default=600)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--again", nargs=2, metavar=("KIND", "SEED"))
    parser.add_argument("--forget", action="store_true", help="faults found, once mended")
    given = parser.parse_args(arguments)
    if given.again:
        kind, seed = given.again[0], int(given.again[1])
        with tempfile.TemporaryDirectory() as place:
            bench = Bench(kind, Path(place) / kind)
            name, content = bench.draw(seed)
            given.folder.mkdir(exist_ok=True)
            (given.folder / Path(name).name).write_bytes(content)
            warnings.simplefilter("error")
            print("read" if bench.try_one(seed) else "refused")
        return 0
    if given.forget:
        counts = load(given.folder)
        for count in counts.values():
            count.found.clear()
        save(counts, given.folder)
    counts = run(given.seconds, given.jobs, given.kinds.split(","), given.folder)
    print("\n".join(report(counts)))
    return int(any(count.found for count in counts.values()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
