"""Hours of poses, and senders that go wrong: memory, what is lost, and what is told."""

import contextlib
import json
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from websockets.sync.client import connect

from evidence.common.recordings import Recordings, Results
from motionary.features import FULL_BODY, FeatureSet, compute_features
from motionary.labels import Label
from motionary.live import LiveAnnotator, OscSender, write_lines, write_messages
from motionary.models.library import ClassLibrary, learn
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.retrieval.annotation import annotate
from motionary.samples import synthetic_motion, synthetic_stream

TITLE = "Hours of poses, and senders that go wrong"
SPLIT = "nothing is chosen; classes are learned from synthetic examples"
SEED = 27
SYNTHETIC = True
DATA = (("synthetic streams of the package", (2, 1.5)),)

HOURS = 24
DAY_HZ, LIVE_HZ, CHUNK = 5.0, 30.0, 25
#: Features of the day: a few, so that hours take minutes.
FEATURES = ("F3", "F4", "F20", "F21", "F31")
ACTIONS = ("bow", "squat", "wave_right", "squat", "kick_left")
GARBAGE = ('{"positions": [[1, 2]]}', "x" * 100_001, "[1", '{"time_s": "now", "positions": [[]]}')
N_CUTS = 10
_WAIT_S, _MORE_S = 60.0, 2.0

Found = list[tuple[str, int, int]]


def measure(recordings: Recordings) -> Results:
    """The day; and each way of going wrong, with what the command told."""
    return {"day": _measure_day(), **_measure_senders()}


def _library(feature_set: FeatureSet = FULL_BODY) -> ClassLibrary:
    examples = {
        name: [synthetic_motion(name, seed=seed) for seed in range(4)]
        for name in ("squat", "wave_right")
    }
    # The corpus that ships is of all features; of few, classes are told from other actions.
    others = [
        compute_features(synthetic_motion(name, seed=seed), feature_set=feature_set)
        for name in ("bow", "kick_left", "walk")
        for seed in range(4)
    ]
    return learn(examples, feature_set=feature_set, negatives=others, by_self_information=False)


# -- the day ---------------------------------------------------------------------------------


def _measure_day() -> Results:
    """Memory by the hour, and whether each round of the same motion has the same labels."""
    few = FeatureSet("few", tuple(one for one in FULL_BODY.features if one.id in FEATURES))
    stream, _ = synthetic_stream(ACTIONS, seed=SEED, rate_hz=DAY_HZ)
    annotator = LiveAnnotator(_library(few), rate_hz=DAY_HZ, skeleton=stream.names)
    n = len(stream.positions) // CHUNK * CHUNK
    chunks = np.split(stream.positions[:n], n // CHUNK)
    n_chunks = int(HOURS * 3600 * DAY_HZ) // n * len(chunks)
    memory, labels, rounds = [_memory_mb()], dict[int, Found](), Counter[tuple[Any, ...]]()
    begin, hour = time.process_time(), 1
    for number in range(n_chunks):
        first = number * CHUNK
        times = (first + np.arange(CHUNK)) / DAY_HZ
        for event in annotator.push(chunks[number % len(chunks)], times):
            if event.status == "final":
                label = event.label
                own = int(label.start_s * DAY_HZ) // n
                name, start, end = _row_of(label)
                row = (name, start - own * n, end - own * n)
                labels.setdefault(own, []).append(row)
        # What was two rounds ago has become final; at its beginning a stream has no past.
        over = first // n - 3
        if over > 0 and first % n == 0:
            rounds[tuple(labels.pop(over, []))] += 1
        if first >= hour * 3600 * DAY_HZ:
            hour += 1
            memory.append(_memory_mb())
    memory.append(_memory_mb())
    [(usual, n_usual)] = rounds.most_common(1)
    return {
        "hours": n_chunks * CHUNK / DAY_HZ / 3600,
        "poses": n_chunks * CHUNK,
        "seen_s": annotator.duration_s,
        "features": len(few),
        "minutes": (time.process_time() - begin) / 60,
        "memory_mb": memory,
        "rounds": rounds.total(),
        "same": n_usual,
        "labels": len(usual),
    }


def _memory_mb() -> float:
    """Anonymous memory of this process."""
    status = Path("/proc/self/status").read_text("ascii")
    return int(status.partition("RssAnon:")[2].split()[0]) / 1e3


# -- senders that go wrong -------------------------------------------------------------------


class _Live:
    """`motionary live` as a process, its events and what it tells."""

    def __init__(self, folder: Path, *options: str) -> None:
        command = [sys.executable, "-m", "motionary", "live", "--library", str(folder), *options]
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.events: list[dict[str, Any]] = []
        self.told: list[str] = []
        for pipe, take in (
            (self.process.stdout, lambda line: self.events.append(json.loads(line))),
            (self.process.stderr, lambda line: self.told.append(line.rstrip("\n"))),
        ):
            threading.Thread(target=_drain, args=(pipe, take), daemon=True).start()
        self.wait(lambda: any("listening" in line for line in self.told))
        self.port = int(self.told[0].partition(";")[0].rpartition(":")[2])

    def wait(self, is_so: Any) -> bool:
        """Whether something became so in time."""
        deadline = time.monotonic() + _WAIT_S
        while not is_so() and time.monotonic() < deadline:
            time.sleep(0.02)
        return bool(is_so())

    def connect(self) -> Any:
        return connect(f"ws://127.0.0.1:{self.port}", max_queue=None)

    def final(self, sender: str) -> Found:
        """Final labels of a sender."""
        return sorted(
            (one["label"], one["start_frame"], one["end_frame"])
            for one in self.events
            if one["event"] == "final" and one["sender"] == sender
        )

    def send(self, lines: Iterable[str], expected: Found) -> str:
        """The number of a sender of these lines, which then goes."""
        n = self.count("is connected")
        with self.connect() as connection:
            for line in lines:
                connection.send(line)
        self.wait(lambda: self.count(f"sender {n + 1} is gone"))
        self.settle([n + 1], len(expected))
        return str(n + 1)

    def settle(self, senders: Sequence[object], n_labels: int) -> None:
        """Wait for so many final labels, and whether further ones come."""
        self.wait(lambda: sum(len(self.final(str(one))) for one in senders) >= n_labels)
        time.sleep(_MORE_S)

    def count(self, text: str) -> int:
        return sum(text in line for line in self.told)

    def close(self) -> None:
        self.process.terminate()
        self.process.wait()


def _drain(pipe: Any, take: Any) -> None:
    for line in pipe:
        with contextlib.suppress(ValueError):
            take(line)


def _measure_senders() -> Results:
    rng = np.random.default_rng(SEED)
    library = _library()
    stream, _ = synthetic_stream(ACTIONS, seed=SEED, rate_hz=LIVE_HZ)
    with tempfile.TemporaryDirectory() as folder:
        library.save(Path(folder) / "classes")
        place = Path(folder) / "classes"
        return {
            "senders": [*_by_websocket(place, library, stream, rng)],
            "osc": [*_by_osc(place, library, stream)],
        }


def _labels(library: ClassLibrary, positions: Any, rate_hz: float = LIVE_HZ) -> Found:
    track = annotate(compute_features(positions, rate_hz=rate_hz), library)
    return sorted(map(_row_of, track))


def _row_of(label: Label) -> tuple[str, int, int]:
    return label.name, int(label.start_frame or 0), int(label.end_frame or 0)


def _row(what: str, found: Found, expected: Found, told: str) -> Results:
    return {
        "what": what, "labels": len(expected), "same": found == expected, "told": told,
    }  # fmt: skip


def _by_websocket(
    folder: Path, library: ClassLibrary, stream: Motion, rng: np.random.Generator
) -> Iterator[Results]:
    """Each way of going wrong: labels beside those of `annotate`, and what was told."""
    positions = np.round(stream.generic_positions(), 5)
    expected = _labels(library, positions)
    lines = list(write_lines(stream))
    live = _Live(folder, "--port", "0")
    found = live.final(live.send(lines, expected))
    told = "waits" if live.count("faster than they can be labelled") else "never waited"
    yield _row("as fast as it goes", found, expected, told)

    mixed = [part for line in lines for part in (line, GARBAGE[rng.integers(len(GARBAGE))])]
    sender = live.send(mixed, expected)
    found = live.final(sender)
    told = f"{live.count(f'sender {sender}: ')} of {len(lines)} lines told, the others counted"
    yield _row("garbage between all lines", found, expected, told)

    holed = positions.copy()
    holed[rng.random(holed.shape[:2]) < 0.05] = np.nan
    holed[200:230] = np.nan
    own = [lines[0], *map(_as_nan, lines[1:], holed)]
    whole = _labels(library, holed)
    found = live.final(live.send(own, whole))
    yield _row("NaN: a joint of twenty, all for a second", found, whole, "")

    swapped = [lines[0]]
    for i in range(1, len(lines)):
        swapped.append(lines[i])
        if i % 50 == 0:
            swapped.append(lines[i - 10])
    found = live.final(live.send(swapped, expected))
    told = f"{live.count('clock going backwards')} times told"
    yield _row("a clock that goes back by .3 s, again and again", found, expected, told)

    parts = np.array_split(np.arange(len(positions)), N_CUTS)
    cut_expected: Found = []
    cut_found: Found = []
    for part in parts:
        whole = _labels(library, positions[part])
        cut_expected += whole
        cut_found += live.final(live.send([lines[0], *(lines[1 + i] for i in part)], whole))
    yield _row(f"connects anew {N_CUTS} times", cut_found, cut_expected, "each comes and goes")

    yield from _two_at_once(live, lines, expected)
    yield _silent(live, lines, expected)
    found = live.final(live.send(lines, expected))
    yield _row("after all that", found, expected, "")
    live.close()


def _as_nan(line: str, pose: Any) -> str:
    content = json.loads(line) | {"positions": pose.tolist()}
    return json.dumps(content)


def _two_at_once(live: _Live, lines: Sequence[str], expected: Found) -> Iterator[Results]:
    n = live.count("is connected")
    with live.connect() as one, live.connect() as other:
        for line in lines:
            one.send(line)
            other.send(line)
    live.settle([n + 1, n + 2], 2 * len(expected))
    found = sorted(live.final(str(n + 1)) + live.final(str(n + 2)))
    yield _row("two senders in turn", found, sorted(expected * 2), "")


def _silent(live: _Live, lines: Sequence[str], expected: Found) -> Results:
    n = live.count("is connected") + 1
    with live.connect() as connection:
        for line in lines:
            connection.send(line)
        begin = time.monotonic()
        live.wait(lambda: live.final(str(n)) == expected)
        told = f"final {time.monotonic() - begin:.0f} s after the last pose"
    return _row("silent, but connected", live.final(str(n)), expected, told)


def _by_osc(folder: Path, library: ClassLibrary, stream: Motion) -> Iterator[Results]:
    """Two senders of VMC at once, one of whose messages are damaged now and then."""
    positions = stream.generic_positions()
    positions[:, GENERIC_JOINTS.index("headtop")] = np.nan
    expected = _labels(library, positions)
    live = _Live(folder, "--osc", "0", "--rate", f"{LIVE_HZ:g}")
    told: list[str] = []
    senders = [OscSender(live.port, tell=told.append) for _ in range(2)]
    begin = time.monotonic()
    for i, messages in enumerate(write_messages(stream)):
        time.sleep(max(0.0, begin + 2 * i / LIVE_HZ - time.monotonic()))
        for sender in senders:
            sender.send(messages)
        if i % 10 == 0:
            senders[0].send([("/VMC/Ext/Bone/Pos", ["Hips", "x"])])
            senders[0].send([("/VMC/Ext/Bone/Pos", ["Spine", 0.0])])
    live.wait(lambda: sum(e["event"] == "final" for e in live.events) >= 2 * len(expected))
    time.sleep(_MORE_S)
    names = {one["sender"] for one in live.events}
    found = sorted(row for name in names for row in live.final(name))
    text = f"{live.count('needs 7 numbers')} messages told, {live.count('are lost')} losses"
    yield _row(
        "VMC: two at once, at half their speed, damaged messages between",
        found,
        sorted(expected * 2),
        text,
    )
    for sender in senders:
        sender.close()
    live.close()
