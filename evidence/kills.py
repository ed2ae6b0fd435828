"""Commands that write are killed at random moments: nothing lost, nothing blocked.

A process that has loaded the package runs each command in a fork of itself, with small synthetic
recordings: half of the moments are drawn over the time that the command takes, half over what it
does to files (opens for writing, renames, removals, new folders), where a fork kills itself as
`kill -9` does. Then sources must be as they were, each output the former one or the whole new
one, and the same command must succeed and give what it gives without a kill.
"""

import contextlib
import hashlib
import io
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from evidence.common.recordings import Recordings, Results
from motionary.cli.app import run_app
from motionary.errors import MotionaryError
from motionary.features import compute_features
from motionary.io import write, write_labels
from motionary.labels import Label, LabelTrack
from motionary.models.library import ClassLibrary
from motionary.retrieval.index import Index
from motionary.retrieval.search import search
from motionary.samples import synthetic_motion

TITLE = "Commands killed while they write"
SPLIT = "nothing is learned or chosen"
SEED = 20
SYNTHETIC = True
DATA = (("synthetic recordings of the package, copied anew for each kill", (4, 0.1)),)

#: Kills of each command: by time and by what is done to files, over nothing and over old results.
KILLS = 38

_CHANGES = {
    "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.chmod", "os.truncate", "os.link",
    "os.utime", "shutil.copyfile", "shutil.move", "shutil.rmtree", "tempfile.mkstemp",
    "tempfile.mkdtemp",
}  # fmt: skip

State = dict[str, str]


class Command(NamedTuple):
    """Arguments, what it writes, what makes an older result there, and what a result is."""

    arguments: tuple[str, ...]
    output: str
    before: tuple[str, ...]
    state: Callable[[Path], State]


# -- what an output is --------------------------------------------------------------------


def files_of(path: Path) -> State:
    """Digests of the files of an output; what an ended process left over is none of it."""
    paths = [path] if path.is_file() else sorted(path.rglob("*"))
    return {
        one.relative_to(path.parent).as_posix(): hashlib.sha256(one.read_bytes()).hexdigest()
        for one in paths
        if one.is_file() and not _is_left(one.relative_to(path.parent))
    }


def _is_left(path: Path) -> bool:
    """Whether it lies in or is what is written beside a result; names of ours begin with a dot."""
    return any(part.startswith(".") for part in path.parts)


def _classes_of(path: Path) -> State:
    """Classes of a library as it is loaded."""
    if not path.is_dir():
        return {}
    try:
        library = ClassLibrary.load(path)
    except MotionaryError as error:
        return {"broken": str(error)}
    return {
        one.name: repr([p.template.values.tobytes() for p in one.prototypes]) for one in library
    }


def _sequences_of(path: Path) -> State:
    """Features of each recording of an index, and hits of a search in them."""
    if not path.is_dir():
        return {}
    try:
        index = Index.open(path.parent.parent / "recordings", at=path)
        found = {one.source: hashlib.sha256(one.packed.tobytes()).hexdigest()
                 for one in index.collection().sequences}  # fmt: skip
        if found:
            search(_example(), index.collection())
    except MotionaryError as error:
        return {"broken": str(error)}
    return found


def _example() -> Any:
    return compute_features(synthetic_motion("squat", seed=9, rate_hz=30))


_ONE = ("recordings/squat 0.bvh",)
COMMANDS: dict[str, Command] = {
    "index": Command(
        ("index", "recordings", "--index", "out/index"), "out/index", (), _sequences_of
    ),
    "learn": Command(
        ("learn", "examples", "-o", "out/lib", "--mirror", "--force"), "out/lib",
        ("learn", "examples", "-o", "out/lib"), _classes_of,
    ),
    "library add": Command(
        ("library", "add", "out/lib", "squat", *_ONE), "out/lib",
        ("learn", "examples", "-o", "out/lib"), _classes_of,
    ),
    "convert": Command(
        ("convert", "recordings", "-o", "out/made", "--to", ".npz", "--force"), "out/made",
        ("convert", "recordings", "-o", "out/made", "--to", ".npz", "--rate", "30"), files_of,
    ),
    "annotate": Command(
        ("annotate", "recordings", "--library", "library", "-o", "out/a.csv", "--force"),
        "out/a.csv", ("annotate", *_ONE, "--library", "library", "-o", "out/a.csv"), files_of,
    ),
    "report": Command(
        ("report", *_ONE, "--labels", "labels.csv", "-o", "out/a.html", "--force"), "out/a.html",
        ("report", *_ONE, "-o", "out/a.html"), files_of,
    ),
    "cut": Command(
        ("cut", "labels.csv", "recordings", "-o", "out/clips", "--force"), "out/clips",
        ("cut", "other.csv", "recordings", "-o", "out/clips"), files_of,
    ),
    "labels convert": Command(
        ("labels", "convert", "labels.csv", "-o", "out/a.eaf", "--force"), "out/a.eaf",
        ("labels", "convert", "other.csv", "-o", "out/a.eaf"), files_of,
    ),
}  # fmt: skip


def make_sources(folder: Path) -> None:
    """Recordings, examples by class, a library and tables of labels."""
    for kind in ("squat", "kick_left"):
        for seed in range(2):
            motion = synthetic_motion(kind, seed=seed, rate_hz=30)
            for place in ("recordings", f"examples/{kind}"):
                (folder / place).mkdir(parents=True, exist_ok=True)
                write(motion, folder / place / f"{kind} {seed}.bvh")
    if run(folder, ("learn", "examples", "-o", "library")):
        raise RuntimeError("no library was learned")
    recording = synthetic_motion("squat", seed=0, rate_hz=30).recording
    for name, times in (("labels.csv", (0.0, 0.5, 1.0)), ("other.csv", (0.2,))):
        labels = tuple(Label("squat", at, at + 0.4) for at in times)
        track = LabelTrack(replace(recording, name="squat 0.bvh"), labels)
        write_labels(track, folder / name)


# -- forks --------------------------------------------------------------------------------


def run(folder: Path, arguments: Sequence[str], *, after_s: float = 0.0, at_change: int = 0) -> int:
    """Exit code of a command in a fork; it is killed after a time, or at a change of files."""
    child = os.fork()
    if not child:
        _be_command(folder, arguments, at_change)
    if after_s:
        time.sleep(after_s)
        os.kill(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _load_all(place: Path, sources: Path) -> None:
    """Run each command once in this process, so that forks need not load what it needs."""
    shutil.copytree(sources, place / "warm")
    for command in COMMANDS.values():
        _prepare(place / "warm", sources, command, over_old=_needs_old(command))
        with contextlib.chdir(place / "warm"), contextlib.suppress(SystemExit):
            sys.argv = ["motionary", *command.arguments]
            with (
                contextlib.redirect_stdout(io.StringIO()),
                contextlib.redirect_stderr(io.StringIO()),
            ):
                run_app()


def _be_command(folder: Path, arguments: Sequence[str], at_change: int) -> None:
    code = 99
    try:
        os.chdir(folder)
        silence = os.open(os.devnull, os.O_RDWR)
        log = os.open(folder.parent / "log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for stream, target in ((0, silence), (1, log), (2, log)):
            os.dup2(target, stream)
        sys.argv = ["motionary", *arguments]
        _count_changes(folder.parent / "changes", at_change)
        run_app()
    except SystemExit as end:
        code = int(end.code or 0)
    finally:
        os._exit(code)


def _count_changes(log: Path, at_change: int) -> None:
    """Kill this process at a change of files; without one, tell how many there were."""
    count = 0
    target = None if at_change else os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)

    def hook(event: str, details: tuple[Any, ...]) -> None:
        nonlocal count
        flags = details[2] if event == "open" and isinstance(details[2], int) else 0
        if event in _CHANGES or flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            count += 1
            if target is not None:
                os.pwrite(target, b"%d" % count, 0)
            elif count == at_change:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)


# -- the page -----------------------------------------------------------------------------


def measure(_: Recordings) -> Results:
    """What each command left when it was killed, and whether it worked again."""
    rows: list[Results] = []
    with tempfile.TemporaryDirectory() as place:
        sources = Path(place) / "sources"
        sources.mkdir()
        make_sources(sources)
        _load_all(Path(place), sources)
        for name, command in COMMANDS.items():
            rows.append({"command": name, **_try(Path(place), sources, command, name)})
            sys.stderr.write(f"{rows[-1]}\n")
    return {"kills": sum(row["kills"] for row in rows), "rows": rows}


def _try(place: Path, sources: Path, command: Command, name: str) -> Results:
    rng = Random(f"{SEED} {name}")
    found = {key: 0 for key in ("kills", "ended", "old", "new", "part", "lost", "blocked", "left")}
    wrong: list[str] = []
    for over_old in (False, True):
        if over_old or not _needs_old(command):
            _prepare(place / "whole", sources, command, over_old=over_old)
            old = command.state(place / "whole" / command.output)
            began = time.monotonic()
            code = run(place / "whole", command.arguments)
            seconds = time.monotonic() - began
            whole = command.state(place / "whole" / command.output)
            if code or not whole:
                raise RuntimeError(f"{name}: {(place / 'log').read_text()}")
            n_changes = int((place / "changes").read_text())
            # Once more: a library learns twice from what it is given twice.
            run(place / "whole", command.arguments)
            twice = command.state(place / "whole" / command.output)
            halves = 2 if _needs_old(command) else 1
            for number in range(halves * KILLS // 2):
                _prepare(place / "killed", sources, command, over_old=over_old)
                moment = (
                    {"at_change": rng.randrange(1, n_changes + 1)}
                    if number % 2
                    else {"after_s": rng.uniform(0.0, seconds)}
                )
                ended = run(place / "killed", command.arguments, **moment)
                found["kills"] += 1
                found["ended"] += ended >= 0
                wrong += _judge(place / "killed", sources, command, (old, whole, twice), found)
    return {**found, "wrong": wrong[:5]}


def _needs_old(command: Command) -> bool:
    return command.arguments[:2] == ("library", "add")


def _prepare(folder: Path, sources: Path, command: Command, *, over_old: bool) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(sources, folder)
    (folder / "out").mkdir()
    if over_old and command.arguments[0] == "index":
        # An index of fewer recordings.
        shutil.move(folder / "recordings" / "squat 1.bvh", folder / "squat 1.bvh")
        run(folder, command.arguments)
        shutil.move(folder / "squat 1.bvh", folder / "recordings" / "squat 1.bvh")
    elif over_old and run(folder, command.before):
        raise RuntimeError(f"{command.before}: {(folder.parent / 'log').read_text()}")


def _judge(
    folder: Path, sources: Path, command: Command, states: tuple[State, ...], found: Results
) -> list[str]:
    """Count what a killed command left; what is wrong in words."""
    old, whole, twice = states
    wrong = []
    for top in sources.iterdir():
        if files_of(folder / top.name) != files_of(top):
            wrong.append(f"{top.name} is not as it was")
    state = command.state(folder / command.output)
    is_old, is_new = state == old, state == whole
    found["old"] += is_old
    found["new"] += is_new and not is_old
    found["part"] += not is_old and not is_new
    # Of several files each is the former one or the whole new one.
    strange = [key for key, value in state.items() if value not in (old.get(key), whole.get(key))]
    if not old and "broken" in strange:
        # A first write that has hardly begun is no result yet, and lost nothing.
        strange.remove("broken")
    gone = [key for key in old if key not in state]
    wrong += [f"{key} is neither" for key in strange] + [f"{key} is gone" for key in gone]
    found["lost"] += bool(wrong)
    found["left"] += any(_is_left(p.relative_to(folder)) for p in folder.rglob("*"))
    code = run(folder, command.arguments)
    again = command.state(folder / command.output)
    if code or again != (twice if is_new else whole):
        wrong.append(f"again: {code}, {(folder.parent / 'log').read_text()[-200:]}")
        found["blocked"] += 1
    return wrong
