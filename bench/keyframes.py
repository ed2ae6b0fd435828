"""Time of a keyframe query over hours of motion.

The authors' 57 queries (Baak, Müller and Seidel 2008, Table 2) over the features of all HDM05
clips at hand, repeated to 10^6 frames (9 h 15 min) and to 42 586, every clip a recording.
Against a plain NumPy scan: a mask per keyframe, ((Y ^ v) & m) == 0, frames joined over the
gaps; and against the layout of the paper, an inverted list of runs for each distinct integer of
features. All give the same ranges. Indexes are built once and not counted.
"""

import itertools
import json
import os
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from motionary.features import FULL_BODY, compute_features
from motionary.io import read, read_query_collections
from motionary.models.keyframes import KeyframeQuery, from_patterns, index_packed, search_query
from motionary.models.keyframes.posting_lists import EMPTY, Intervals, Layout, join
from motionary.packing import PackedFeatures

SIZES = (1_000_000, 42_586)
ROUNDS = 9


def main() -> None:
    folder = os.environ.get("MOTIONARY_DATA", "")
    if not folder:
        print("  skipped: MOTIONARY_DATA is not set, there are no recordings")
        return
    clips = read_clips(Path(folder) / "hdm05")
    queries = read_queries(Path(folder).resolve().parent / "reference" / "golden")
    for n_frames in SIZES:
        compare_on(repeated(clips, n_frames), queries)


def read_clips(folder: Path) -> list[PackedFeatures]:
    paths = sorted(folder.rglob("HDM_*_*.[aA][mM][cC]"))
    return [compute_features(read(path)).packed for path in paths]


def read_queries(folder: Path) -> list[KeyframeQuery]:
    """The 57 queries of Table 2: those whose results are published."""
    names = json.loads((folder / "keyframe_confusion_recall.json").read_text("utf-8"))["classes"]
    records = read_query_collections(folder / "manual_keyframes.json")["retrieval_2008"]
    return [
        from_patterns(r.keyframes, r.groups, distances=r.distances, stiffness=r.stiffness)
        for r in (records[name] for name in names)
    ]


def repeated(clips: Sequence[PackedFeatures], n_frames: int) -> list[PackedFeatures]:
    """Clips over and over until there are at least so many frames."""
    recordings, total = [], 0
    for clip in itertools.cycle(clips):
        if total >= n_frames:
            return recordings
        recordings.append(clip)
        total += len(clip)
    return recordings


def compare_on(recordings: list[PackedFeatures], queries: list[KeyframeQuery]) -> None:
    start = time.perf_counter()
    index = index_packed(recordings, feature_set=FULL_BODY.name, feature_ids=FULL_BODY.ids)
    seconds = time.perf_counter() - start
    scan, inverted = PlainScan(recordings), InvertedLists(recordings)
    print(
        f"  {index.n_frames} frames in {index.n_sequences} recordings: indexed in {seconds:.2f} s "
        f"({index.n_frames / seconds / 1e6:.1f} million frames/s), "
        f"{index.n_bytes / index.n_frames:.1f} bytes a frame"
    )
    ways: dict[str, Callable[[KeyframeQuery], Iterable[object]]] = {
        "plain scan": scan.search,
        "inverted lists": inverted.search,
        "search_query, NumPy": lambda query: search_query(query, index, engine="numpy"),
        "search_query, compiled": lambda query: search_query(query, index, engine="compiled"),
    }
    for query in queries:
        expected = scan.search(query)
        for name, search in ways.items():
            if list(search(query)) != expected:
                raise RuntimeError(f"{name} differs from the plain scan")
    report(measure(ways, queries))


def measure(
    ways: dict[str, Callable[[KeyframeQuery], Iterable[object]]], queries: list[KeyframeQuery]
) -> dict[str, list[float]]:
    """Seconds of each query by way: the median of interleaved rounds over all queries."""
    seconds: dict[str, list[list[float]]] = {name: [] for name in ways}
    for _ in range(ROUNDS):
        for name, call in ways.items():
            row = []
            for query in queries:
                start = time.perf_counter()
                call(query)
                row.append(time.perf_counter() - start)
            seconds[name].append(row)
    return {name: np.median(rows, axis=0).tolist() for name, rows in seconds.items()}


def report(seconds: dict[str, list[float]]) -> None:
    plain = statistics.median(seconds["plain scan"])
    for name, times in seconds.items():
        median = statistics.median(times)
        print(
            f"    {name:<23} median {median * 1e6:9.0f} µs  mean {np.mean(times) * 1e6:9.0f} µs"
            f"  most {max(times) * 1e6:9.0f} µs  {plain / median:7.1f} x plain scan"
        )


class PlainScan:
    """The same search without an index: a mask per keyframe, frames joined over the gaps."""

    def __init__(self, recordings: list[PackedFeatures]) -> None:
        self.packed = np.concatenate(recordings)[:, 0]
        self.lengths = np.array([len(recording) for recording in recordings])
        self.starts = np.cumsum(self.lengths) - self.lengths

    def search(self, query: KeyframeQuery) -> list[tuple[int, int, int]]:
        """Hit ranges (recording, start, stop)."""
        frames = [
            np.flatnonzero(((self.packed ^ value) & fixed) == 0)
            for value, fixed in zip(query.values[:, 0], query.fixed[:, 0], strict=True)
        ]
        for k in reversed(range(len(query) - 1)):
            gap, after = query.gaps[k], frames[k + 1]
            limit = self.last_frames(frames[k])
            if gap.most is not None:
                limit = np.minimum(limit, frames[k] + gap.most)
            first = np.searchsorted(after, frames[k] + gap.least, side="left")
            frames[k] = frames[k][first < np.searchsorted(after, limit, side="right")]
        ends = frames[0]
        if len(ends) == 0:
            return []
        limit = self.last_frames(ends)
        for gap, after in zip(query.gaps, frames[1:], strict=True):
            reach = limit if gap.most is None else np.minimum(limit, ends + gap.most)
            ends = after[np.searchsorted(after, reach, side="right") - 1]
        return self.ranges(frames[0], ends + 1)

    def last_frames(self, frames: np.ndarray) -> np.ndarray:
        """Last frame of the recording of each frame."""
        recording = np.searchsorted(self.starts, frames, side="right") - 1
        return self.starts[recording] + self.lengths[recording] - 1

    def ranges(self, starts: np.ndarray, stops: np.ndarray) -> list[tuple[int, int, int]]:
        """Ranges merged where they meet, by recording."""
        recording = np.searchsorted(self.starts, starts, side="right") - 1
        apart = (starts[1:] > stops[:-1]) | (recording[1:] != recording[:-1])
        first, last = np.concatenate([[True], apart]), np.concatenate([apart, [True]])
        begin = self.starts[recording[first]]
        columns = (recording[first], starts[first] - begin, stops[last] - begin)
        return list(zip(*(column.tolist() for column in columns), strict=True))


class InvertedLists:
    """The paper's index: the runs of every distinct integer; those of a keyframe are united."""

    def __init__(self, recordings: list[PackedFeatures]) -> None:
        lengths = np.array([len(recording) for recording in recordings])
        self.layout = Layout.of_lengths(lengths)
        packed = np.concatenate(recordings)[:, 0]
        before = np.cumsum(lengths) - lengths
        at = np.repeat(self.layout.starts - before, lengths) + np.arange(len(packed))
        change = (packed[1:] != packed[:-1]) | (at[1:] != at[:-1] + 1)
        first, last = np.concatenate([[True], change]), np.concatenate([change, [True]])
        self.packed, number = np.unique(packed[first], return_inverse=True)
        order = np.argsort(number, kind="stable")
        self.starts, self.stops = at[first][order], at[last][order] + 1
        self.ends = np.cumsum(np.bincount(number))

    def search(self, query: KeyframeQuery) -> list[tuple[int, int, int]]:
        """Hit ranges (recording, start, stop)."""
        keyframes = zip(query.values[:, 0], query.fixed[:, 0], strict=True)
        lists = [self.runs(value, fixed) for value, fixed in keyframes]
        found, number = join(lists, query.gaps, self.layout)
        begin = self.layout.starts[number]
        columns = (number, found.starts - begin, found.stops - begin)
        return list(zip(*(column.tolist() for column in columns), strict=True))

    def runs(self, value: np.uint64, fixed: np.uint64) -> Intervals:
        """Frames that show a keyframe."""
        agree = np.flatnonzero(((self.packed ^ value) & fixed) == 0)
        if len(agree) == 0:
            return EMPTY
        n = np.diff(self.ends, prepend=0)[agree]
        ends = np.cumsum(n)
        runs = np.arange(ends[-1]) + np.repeat(self.ends[agree] - ends, n)
        runs = runs[np.argsort(self.starts[runs])]
        apart = self.starts[runs[1:]] > self.stops[runs[:-1]]
        first, last = np.concatenate([[True], apart]), np.concatenate([apart, [True]])
        return Intervals(self.starts[runs[first]], self.stops[runs[last]])
