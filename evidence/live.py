"""Labels while a motion goes on, beside those of the whole recording; how late and how dear."""

import pickle
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from recipes.sources import EXERCISES, person_of, read_rows

from evidence.common.recordings import Recordings, Results
from motionary.errors import MotionaryError
from motionary.features import compute_features
from motionary.io import read
from motionary.labels import Label
from motionary.live import LiveAnnotator, LiveEvent
from motionary.live.poses import EvenTimes
from motionary.models.library import ClassLibrary, load_everyday
from motionary.motion import resample
from motionary.retrieval.annotation import annotate

TITLE = "Labels while a motion goes on"
SPLIT = "nothing is learned or chosen; labels are compared with those of `annotate`"
SEED = 26
DATA = (
    "cmu",
    "hdm05_takes",
    (
        "UI-PRMD (Vakanski and others 2018, PDDL 1.0), correct repetitions of s01 to s04",
        (39, 16.22),
    ),
)
#: Further folders of which recordings are read.
FOLDERS = ("cmu_everyday", "accad", "hdm05_takes")
SIZES = (1, 3, 7, 100, 0)
RATES = (24.0, 30.0, 60.0, 120.0)
LIVE_HZ = 60.0
N_CLOSE, CLOSE_S = 6, 6.0
JITTER = 0.3
MEMORY_MIN = 30
N_DELAYS = 40
#: People whose repetitions are streams with true ends; the library learned from some of them.
REPEATING = ("s01", "s02", "s03", "s04")

Floats = NDArray[np.float64]


def measure(recordings: Recordings) -> Results:
    """Equality for chunks, rates and uneven times; delays, cost and memory."""
    library, rng = load_everyday(), np.random.default_rng(SEED)
    takes = dict(_takes(recordings.folder))
    whole = {name: _run(library, x, LIVE_HZ, 0, rng) for name, x in takes.items()}
    same = {
        name: _final(events) == _labels(annotate(compute_features(x, rate_hz=LIVE_HZ), library))
        for (name, x), (_, events) in zip(takes.items(), whole.values(), strict=True)
    }
    close = sorted(takes)[:: max(1, len(takes) // N_CLOSE)][:N_CLOSE]
    return {
        "recordings": len(takes),
        "minutes": sum(map(len, takes.values())) / LIVE_HZ / 60,
        "labels": sum(len(_final(events)) for _, events in whole.values()),
        "same": sum(same.values()),
        "close": _compare_closely(library, [takes[name] for name in close], rng),
        "delays": _measure_delays(library, _with_events(library, takes, whole)),
        "repeated": _measure_delays(library, *_repetitions(recordings.folder)),
        "memory": _measure_memory(library, list(takes.values())),
    }


def _with_events(
    library: ClassLibrary,
    takes: Mapping[str, Floats],
    whole: Mapping[str, tuple[LiveAnnotator, list[tuple[float, LiveEvent]]]],
) -> list[Floats]:
    """The first recordings in which a class is labelled that is an event."""
    kinds = {one.name: one.kind for one in library}
    names = [
        name
        for name, (_, events) in sorted(whole.items())
        if any(kinds[e.label.name] == "event" for _, e in events if e.status == "final")
    ]
    return [takes[name] for name in names[:N_DELAYS]]


def _takes(folder: Path) -> Iterator[tuple[str, Floats]]:
    """Positions of all recordings that can be read, at 60 Hz, by their names."""
    for source in FOLDERS:
        for path in sorted((folder / source).rglob("*")):
            if path.suffix not in (".amc", ".bvh"):
                continue
            try:
                motion = read(path)
                positions = motion.generic_positions()
            except MotionaryError:
                continue
            even = resample(positions, rate_hz=motion.rate_hz, to_hz=LIVE_HZ)
            yield str(path.relative_to(folder)), even


def _repetitions(folder: Path) -> tuple[list[Floats], list[list[Label]]]:
    """Positions of recordings of repetitions, at 60 Hz, and the true labels of each."""
    takes, truths = [], []
    for path in sorted((folder / "ui_prmd" / "correct").glob("*.c3d")):
        if person_of("ui_prmd", path.name) not in REPEATING:
            continue
        motion = read(path)
        rows = read_rows(folder / "ui_prmd" / "repetitions.csv")
        takes.append(resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=LIVE_HZ))
        truths.append(
            [
                Label(EXERCISES[row["label"]], float(row["start_s"]), float(row["end_s"]))
                for row in rows
                if row["recording"] == f"correct/{path.name}" and row["label"] in EXERCISES
            ]
        )
    return takes, truths


def _run(
    library: ClassLibrary,
    positions: Floats,
    rate_hz: float,
    size: int,
    rng: np.random.Generator,
    times: Floats | None = None,
) -> tuple[LiveAnnotator, list[tuple[float, LiveEvent]]]:
    """Events, each with the time that had been seen; chunks of random sizes where `size` is 0."""
    annotator = LiveAnnotator(library, rate_hz=rate_hz)
    events, start = [], 0
    while start < len(positions):
        stop = start + (size or int(rng.integers(1, 60)))
        own = None if times is None else times[start:stop]
        found = annotator.push(positions[start:stop], own)
        events += [(annotator.duration_s, event) for event in found]
        start = stop
    events += [(annotator.duration_s, event) for event in annotator.finish()]
    return annotator, events


def _final(events: Sequence[tuple[float, LiveEvent]]) -> list[tuple[object, ...]]:
    return _labels(event.label for _, event in events if event.status == "final")


def _labels(labels: Iterable[Label]) -> list[tuple[object, ...]]:
    return sorted(
        (x.name, x.start_s, x.end_s, x.start_frame, x.end_frame, x.cost, x.score, x.probability)
        for x in labels
    )


def _compare_closely(
    library: ClassLibrary, takes: Sequence[Floats], rng: np.random.Generator
) -> Results:
    """Whether final labels are those of the whole, by rate and chunks, and at uneven times."""
    same = dict.fromkeys([f"{rate:g}" for rate in RATES], 0)
    uneven = gaps = n = 0
    for take in takes:
        for rate in RATES:
            positions = resample(take[: int(CLOSE_S * LIVE_HZ)], rate_hz=LIVE_HZ, to_hz=rate)
            expected = _labels(annotate(compute_features(positions, rate_hz=rate), library))
            for size in SIZES:
                found = _final(_run(library, positions, rate, size, rng)[1])
                same[f"{rate:g}"] += found == expected
            times = (
                np.arange(len(positions)) + rng.uniform(-JITTER, JITTER, len(positions))
            ) / rate
            even = EvenTimes(rate).push(positions, times)
            expected = _labels(annotate(compute_features(even, rate_hz=rate), library))
            uneven += _final(_run(library, positions, rate, 0, rng, times)[1]) == expected
            holed = positions.copy()
            holed[len(holed) // 3 : len(holed) // 3 + int(rate / 2)] = np.nan
            expected = _labels(annotate(compute_features(holed, rate_hz=rate), library))
            gaps += _final(_run(library, holed, rate, 0, rng)[1]) == expected
            n += 1
    return {"same": same, "runs": len(takes) * len(SIZES), "uneven": uneven, "gaps": gaps, "n": n}


def _measure_delays(
    library: ClassLibrary, takes: Sequence[Floats], truths: Sequence[Sequence[Label]] = ()
) -> Results:
    """How late labels are foreseen and final, what is withdrawn, and what a pose costs."""
    kinds = {one.name: one.kind for one in library}
    foreseen, final, costs, minutes = [], [], [], 0.0
    true_ends = []
    counts: Counter[str] = Counter()
    look_ahead_s = 0.0
    for number, take in enumerate(takes):
        annotator, first = LiveAnnotator(library, rate_hz=LIVE_HZ), dict[int, float]()
        look_ahead_s = annotator.look_ahead_s
        for pose in [*take, None]:
            begin = time.process_time()
            events = annotator.finish() if pose is None else annotator.push(pose)
            if pose is not None:
                costs.append(time.process_time() - begin)
            now = annotator.duration_s
            for event in events:
                counts[event.status] += 1
                if event.status == "provisional":
                    first[event.id] = now
                if event.status != "final" or kinds[event.label.name] != "event":
                    continue
                seen_s = first.get(event.id, now)
                if pose is not None:
                    final.append(now - event.label.end_s - look_ahead_s)
                foreseen.append(seen_s - event.label.end_s)
                if truths:
                    true_ends += _after(seen_s, event.label, truths[number])
        minutes += len(take) / LIVE_HZ / 60
    return {
        "recordings": len(takes),
        "minutes": minutes,
        "events": len(foreseen),
        "final": len(final),
        "look_ahead_s": look_ahead_s,
        "foreseen_s": _quantiles(foreseen, (50, 90)),
        "true": len(true_ends),
        "after_truth_s": _quantiles(true_ends, (50, 90)),
        "final_s": _quantiles(final, (50, 100)),
        "ms": _quantiles([1e3 * cost for cost in costs], (50, 99)),
        "provisional_per_min": counts["provisional"] / minutes,
        "withdrawn_per_min": counts["withdrawn"] / minutes,
    }


def _after(seen_s: float, label: Label, truth: Iterable[Label]) -> list[float]:
    """How long after the true end a label was foreseen, if it is right by half."""
    found = [
        seen_s - one.end_s
        for one in truth
        if one.name == label.name
        and min(one.end_s, label.end_s) - max(one.start_s, label.start_s)
        >= 0.5 * (max(one.end_s, label.end_s) - min(one.start_s, label.start_s))
    ]
    return found[:1]


def _measure_memory(library: ClassLibrary, takes: Sequence[Floats]) -> Results:
    """What an annotator holds after a third of a stream, and at its end."""
    annotator, n = LiveAnnotator(library, rate_hz=LIVE_HZ), int(MEMORY_MIN * 60 * LIVE_HZ)
    seen, kept = 0, list[float]()
    while seen < n:
        for take in takes:
            for start in range(0, len(take), 6):
                annotator.push(take[start : start + 6])
            seen += len(take)
            if seen >= n * (1 + 2 * len(kept)) // 3:
                kept.append(_size_mb(annotator))
            if seen >= n:
                break
    return {"minutes": seen / LIVE_HZ / 60, "early_mb": kept[0], "late_mb": kept[-1]}


def _size_mb(annotator: LiveAnnotator) -> float:
    """Bytes of a copy of the annotator, its library included."""
    return len(pickle.dumps(annotator)) / 1e6


def _quantiles(values: Sequence[float], percents: Sequence[int]) -> list[float]:
    return np.percentile(values, percents).tolist() if len(values) else [float("nan")] * 2
