"""Times to read and search a folder of 10^6 frames (9 h 15 min, as long as all of CMU's).

Features of the HDM05 clips at hand under other names: one after the other in recordings of
400 frames, as long as CMU's are in the mean, and each clip a recording. Their
files are empty; the index knows their state, as it does of real ones. Measured are whole
commands in processes of their own, beside the same command on a folder of one file (which
is what starting costs), and the building of the index: files read, and features kept.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np

from motionary.features import FeatureSequence, load_everyday_set
from motionary.recording import Recording
from motionary.retrieval.index import Index, building, collect

N_TOTAL = 1_000_000
LENGTH = 400
ROUNDS = 5
READ = 40
QUERY = "right hand fast, right hand above neck, then within 0.1 to 0.5 s right elbow bent"


def main() -> None:
    folder = os.environ.get("MOTIONARY_DATA", "")
    if not folder:
        print("  skipped: MOTIONARY_DATA is not set, there are no recordings")
        return
    clips = collect(Path(folder) / "hdm05", feature_set=load_everyday_set()).sequences
    example = next(Path(folder, "hdm05").rglob("*squat1Reps_001*"))
    with tempfile.TemporaryDirectory() as place:
        report_reading(Path(folder) / "hdm05", Path(place))
        for name, sequences in (
            ("takes", list(joined(clips, N_TOTAL))),
            ("clips", list(repeated(clips, N_TOTAL))),
            ("one", [clips[0]]),
        ):
            build(sequences, Path(place), name)
        report_commands(Path(place), example)


def repeated(clips: Sequence[FeatureSequence], n_frames: int) -> Iterator[FeatureSequence]:
    """Clips over and over until there are so many frames."""
    total = number = 0
    while total < n_frames:
        clip = clips[number % len(clips)]
        yield clip
        total, number = total + len(clip), number + 1


def joined(clips: Sequence[FeatureSequence], n_frames: int) -> Iterator[FeatureSequence]:
    """The same, several clips a recording."""
    parts: list[FeatureSequence] = []
    for clip in repeated(clips, n_frames):
        parts.append(clip)
        if sum(map(len, parts)) >= LENGTH:
            packed = np.concatenate([part.packed for part in parts])
            known = np.concatenate([part.known for part in parts])
            yield FeatureSequence(packed, known, clips[0].feature_set, Recording(rate_hz=120.0))
            parts = []


def build(sequences: Sequence[FeatureSequence], place: Path, name: str) -> None:
    """A folder of empty files with an index of these recordings."""
    recordings = place / name
    recordings.mkdir()
    for number in range(len(sequences)):
        (recordings / f"take {number:05d}.bvh").touch()
    index = Index.open(recordings, at=place / f"{name} index")
    changes = index.changes()
    known = {file: one.renamed(file) for file, one in zip(changes.to_read, sequences, strict=True)}
    # Features are there already: only what the index does with them is measured.
    with patch.object(
        building, "read_features", lambda files, **_: [known[name] for name, _ in files]
    ):
        start = time.perf_counter()
        index.update(changes)
    seconds = time.perf_counter() - start
    print(
        f"  {name}: {index.n_frames} frames of {len(index)} recordings kept in {seconds:.2f} s "
        f"({index.n_frames / seconds / 1e6:.2f} million frames/s), "
        f"{index.n_bytes / index.n_frames:.1f} bytes a frame"
    )


def report_reading(folder: Path, place: Path) -> None:
    """Reading, measuring and keeping real files, one process."""
    sample = place / "sample"
    files = sorted(folder.rglob("*.amc"))[::7][:READ]
    for file in [*files, *folder.glob("*.asf")]:
        (sample / file.name).parent.mkdir(exist_ok=True)
        (sample / file.name).symlink_to(file)
    index = Index.open(sample, at=place / "sample index")
    start, busy = time.perf_counter(), time.process_time()
    index.update()
    seconds, busy = time.perf_counter() - start, time.process_time() - busy
    n_frames = sum(sequence.recording.n_frames for sequence in index.collection().sequences)
    print(
        f"  real files: {len(index)} AMC, {n_frames} frames at 120 Hz in {seconds:.2f} s "
        f"({busy:.2f} s of processor): {n_frames / seconds:.0f} frames/s"
    )


def report_commands(place: Path, example: Path) -> None:
    """Medians of whole commands, and what they take beyond a folder of one file."""
    ways = {
        "keyframes": ["--query", QUERY],
        "example, fast": ["--like", str(example), "--fast"],
        "example, published": ["--like", str(example), "--published"],
        "example": ["--like", str(example)],
    }
    for way, arguments in ways.items():
        seconds: dict[str, list[tuple[float, float]]] = {}
        for _ in range(ROUNDS):
            for name in ("one", "takes", "clips"):
                seconds.setdefault(name, []).append(run(place, name, arguments))
        wall, busy = (
            {name: statistics.median(times[i] for times in all_) for name, all_ in seconds.items()}
            for i in (0, 1)
        )
        beyond = ", ".join(
            f"{name} {wall[name]:.2f} s ({wall[name] / wall['one']:.2f} x a folder of one file; "
            f"{wall[name] - wall['one']:+.2f} s, processor {busy[name] - busy['one']:+.2f} s)"
            for name in ("takes", "clips")
        )
        print(f"  search by {way}: start {wall['one']:.2f} s; {beyond}")


def run(place: Path, name: str, arguments: list[str]) -> tuple[float, float]:
    """Seconds of one command, by the clock and of the processor."""
    command = [sys.executable, "-m", "motionary", "search", str(place / name), *arguments]
    command += ["--index", str(place / f"{name} index"), "--json"]
    before = os.times()
    start = time.perf_counter()
    subprocess.run(command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    seconds = time.perf_counter() - start
    after = os.times()
    busy = after.children_user + after.children_system
    return seconds, busy - before.children_user - before.children_system


if __name__ == "__main__":
    main()
