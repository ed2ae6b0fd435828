"""Searches in archives of 10^6 to 10^9 frames: time, memory, bytes, and what grows with what.

An archive is made of sequences of real recordings, cut, played faster and slower, with single
features that turn on sooner or later, and packed one behind the other to recordings of 100 s.
That is no archive of 10 000 hours of motion, and is called so: it has the size of one, and poses
as real ones follow each other.

`MOTIONARY_ARCHIVE` names the folder in which the archives are kept, by default a temporary one;
`MOTIONARY_ARCHIVE_FRAMES` how large the largest is (18 bytes a frame).
"""

import os
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from evidence.common.drawing import RULE, STYLES, house_style, new_figure
from evidence.common.recordings import EVERYTHING, Recordings, Results
from motionary.batch import Failure, map_ordered
from motionary.features import FULL_BODY, FeatureSequence, compute_features
from motionary.io import ReadOptions, read
from motionary.models.keyframes import parse_queries
from motionary.packing import PackedFeatures, full_mask, pack
from motionary.recording import Recording
from motionary.retrieval.index import Index
from motionary.retrieval.index.shard import make_shard
from motionary.retrieval.index.shard_files import write_shard
from motionary.retrieval.index.storage import Manifest, Recipe, write_manifest
from motionary.retrieval.search import search

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "Large archives on one machine"
SPLIT = "nothing is learned or chosen; no archive holds the recordings of the examples"
SEED = 26
DATA = EVERYTHING

FRAMES = int(os.environ.get("MOTIONARY_ARCHIVE_FRAMES", "1000000000"))
SIZES = [size for size in (10**6, 10**7, 10**8) if size < FRAMES] + [FRAMES]
LENGTH = 3000
EXAMPLE = 60
#: Frames of a shard; those of the smallest archive have one.
SHARD = 4_000_000
TEMPI = (0.7, 1.4)
MOST_SHIFT = 3
GROUPS = 4
JOBS = 2

_GAP = ", then within 0.1 s "
_UP, _DOWN = "right hand above neck", "not right hand above neck"
_BENT = ("right hand above neck, right knee bent", "not right hand above neck, not right knee bent")
KEYFRAMES = {
    "frequent": "right hand fast, then within 0.5 s right hand low",
    "seldom": _GAP.join([*_BENT, _BENT[0]]),
    "hardly ever": _GAP.join([_UP, _DOWN] * 3),
}
#: Two seconds from the middle of recordings that no archive is made of.
EXAMPLES = {"jump": "02_04", "dance": "05_06", "climb": "01_09"}
AGAIN = 5


class Source(NamedTuple):
    """Features of real recordings one behind the other."""

    packed: PackedFeatures
    starts: Any
    lengths: Any


def source_of(recordings: Recordings) -> Source:
    sequences = [c.packed for c in recordings.clips] + list(recordings.others.values())
    lengths = np.array([len(s) for s in sequences])
    packed = np.concatenate([s.packed for s in sequences])
    return Source(packed, np.cumsum(lengths) - lengths, lengths)


# -- archives -----------------------------------------------------------------------------


def make_archives(place: Path, source: Source, sizes: Sequence[int]) -> float:
    """Write shards and an index of each size, what is not there yet; seconds of one core."""
    shards = place / "shards"
    borders: list[int] = []
    frames: list[int] = []
    for size in sizes:
        left = size - sum(frames)
        frames += [min(SHARD, left - at) for at in range(0, left, SHARD)]
        borders.append(len(frames))
    known = place / "shards.txt"
    lines = known.read_text().splitlines() if known.exists() else []
    names = [line.split()[0] for line in lines]
    seconds = sum(float(line.split()[1]) for line in lines)
    todo = list(enumerate(frames))[len(names) :]
    with known.open("a") as log:
        for done in map_ordered(partial(_write, source=source, place=shards), todo, jobs=JOBS):
            if isinstance(done, Failure):
                raise done.error
            names.append(done[0])
            seconds += done[1]
            log.write(f"{done[0]} {done[1]:.3f}\n")
            log.flush()
    for size, border in zip(sizes, borders, strict=True):
        index = index_of(place, size)
        recipe = Recipe.of(FULL_BODY, ReadOptions())
        write_manifest(Manifest(recipe, tuple(names[:border])), index)
        for name in names[:border]:
            if not (index / name).is_symlink():
                (index / name).symlink_to(shards / name)
    return seconds


def index_of(place: Path, size: int) -> Path:
    return place / f"{size:,} frames"


def _write(shard: tuple[int, int], *, source: Source, place: Path) -> tuple[str, float]:
    """A shard of varied sequences; the time is that of what an index does, not of varying."""
    number, n_frames = shard
    rng = np.random.default_rng([SEED, number])
    lengths = [min(LENGTH, n_frames - at) for at in range(0, n_frames, LENGTH)]
    sequences = [_vary(source, rng, f"{number:03}/{i:04}", n) for i, n in enumerate(lengths)]
    began = time.process_time()
    name = write_shard(make_shard(sequences, FULL_BODY), place)
    return name, time.process_time() - began


def _vary(source: Source, rng: np.random.Generator, name: str, n: int) -> FeatureSequence:
    frames: list[Any] = []
    while sum(map(len, frames)) < n:
        one = int(rng.integers(len(source.lengths)))
        tempo = rng.uniform(*TEMPI)
        at = (np.arange(int(source.lengths[one] / tempo)) * tempo).astype(np.int64)
        frames.append(source.starts[one] + at)
    order = np.concatenate(frames)[:n]
    groups = rng.integers(0, GROUPS, len(FULL_BODY))
    packed = np.zeros(n, dtype=np.uint64)
    for mask in pack(groups == np.arange(GROUPS)[:, np.newaxis])[:, 0]:
        shifted = order + rng.integers(-MOST_SHIFT, MOST_SHIFT + 1)
        packed |= source.packed[np.clip(shifted, 0, len(source.packed) - 1), 0] & mask
    known = np.broadcast_to(full_mask(1, len(FULL_BODY)), (n, 1))
    recording = Recording(name, rate_hz=30.0, n_frames=n)
    return FeatureSequence(packed[:, np.newaxis], known, FULL_BODY, recording)


# -- searches -----------------------------------------------------------------------------


class Memory:
    """Most anonymous memory that this process had, MB; what is mapped from files is not in it."""

    def __enter__(self) -> "Memory":
        self.most_mb = 0.0
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._ends.wait(0.02):
            for line in Path("/proc/self/status").read_text().splitlines():
                if line.startswith("RssAnon"):
                    self.most_mb = max(self.most_mb, int(line.split()[1]) / 1024)


def drop_cache(folder: Path) -> None:
    """Let the system forget what it holds of the files of a folder."""
    for file in folder.glob("*/*"):
        handle = os.open(file, os.O_RDONLY)
        os.fsync(handle)
        os.posix_fadvise(handle, 0, 0, os.POSIX_FADV_DONTNEED)
        os.close(handle)


def timed(work: Callable[[], Any]) -> tuple[Any, dict[str, float]]:
    wall, core = time.perf_counter(), time.process_time()
    result = work()
    return result, {"s": time.perf_counter() - wall, "core_s": time.process_time() - core}


def _search_all(size: int, *, place: Path, examples: dict[str, FeatureSequence]) -> Results:
    """Times of opening and of each query, first and again, in a process of its own."""
    drop_cache(index_of(place, size))
    queries: dict[str, tuple[Any, Any]] = {
        name: (parse_queries(text), None) for name, text in KEYFRAMES.items()
    }
    queries |= {name: (example, True) for name, example in examples.items()}
    with Memory() as memory:
        collection, opened = timed(lambda: open_archive(place, size))
        rows = {}
        for name, (query, preselect) in queries.items():
            ask = partial(search, query, collection, preselect=preselect)
            result, first = timed(ask)
            again = [timed(ask)[1] for _ in range(AGAIN)]
            rows[name] = {
                "first": first,
                "again": min(again, key=lambda one: one["s"]),
                "hits": len(result),
                "best": result[0].cost if result else None,
                "worst": result[-1].cost if result else None,
                "fraction": result.fraction_matched,
                "keyframes": len(result.queries),
            }
    return {
        "open": opened,
        "load": os.getloadavg()[0],
        "queries": rows,
        "most_mb": memory.most_mb,
        "shards": len(collection.parts),
    }


def _example(folder: Path, name: str) -> FeatureSequence:
    features = compute_features(read(folder / "cmu_everyday" / f"{name}.amc"))
    middle = len(features) // 2
    return features.part(max(middle - EXAMPLE // 2, 0), middle + EXAMPLE // 2)


def open_archive(place: Path, size: int) -> Any:
    index = Index.open(place, at=index_of(place, size), feature_set=FULL_BODY)
    collection = index.collection()
    _ = collection.parts
    return collection


# -- the page -----------------------------------------------------------------------------


def measure(recordings: Recordings) -> Results:
    named = os.environ.get("MOTIONARY_ARCHIVE")
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(named or temporary)
        place.mkdir(parents=True, exist_ok=True)
        source = source_of(recordings)
        core_s = make_archives(place, source, SIZES)
        examples = {name: _example(recordings.folder, file) for name, file in EXAMPLES.items()}
        work = partial(_search_all, place=place, examples=examples)
        sizes = {}
        for size in SIZES:
            (found,) = map_ordered(work, [size], jobs=2)
            if isinstance(found, Failure):
                raise found.error
            sizes[str(size)] = found
        n_bytes = sum(f.stat().st_size for f in index_of(place, SIZES[-1]).glob("*/*"))
    return {
        "frames": SIZES[-1],
        "source_frames": len(source.packed),
        "bytes_per_frame": n_bytes / SIZES[-1],
        "frames_per_core_s": SIZES[-1] / core_s,
        "sizes": sizes,
        "keyframes": KEYFRAMES,
    }


def draw(results: Results) -> "dict[str, Figure]":
    return {"archives": _draw(results["sizes"])}


@house_style()
def _draw(sizes: Results) -> "Figure":
    figure, axes = new_figure(1, 2, (6.6, 2.9))
    frames = [int(size) for size in sizes]
    for ax, title, names in (
        (axes[0], "Keyframes", list(KEYFRAMES)),
        (axes[1], "Examples", list(EXAMPLES)),
    ):
        most = 0.0
        for number, name in enumerate(names):
            core_s = [sizes[str(size)]["queries"][name]["again"]["core_s"] for size in frames]
            style = STYLES[number % len(STYLES)]
            ax.plot(frames, core_s, markersize=3, linewidth=1.1, label=name, **style)
            most = max(most, core_s[-1])
        line = [most * size / frames[-1] for size in frames]
        ax.plot(frames, line, color=RULE, linestyle="--", linewidth=0.8, zorder=0)
        ax.set(xscale="log", yscale="log", xlabel="million frames", ylim=(0.001, 10.0))
        ax.set_xticks(frames, [f"{size / 1e6:g}" for size in frames], minor=False)
        ax.set_yticks([0.001, 0.01, 0.1, 1.0, 10.0], ["0.001", "0.01", "0.1", "1", "10"])
        ax.minorticks_off()
        ax.set_title(title, loc="left", pad=3)
        ax.legend(frameon=False, fontsize=6)
    axes[0].set_ylabel("seconds of one core, warm")
    return figure
