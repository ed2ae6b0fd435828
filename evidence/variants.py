"""A recording gives the same features and labels whatever file it comes in, or an error."""

import tempfile
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common import variants
from evidence.common.drawing import BLUE, ORANGE, RULE, TRUNK, VERMILLION, house_style
from evidence.common.faults import count_alarms, extent_of_alarms
from evidence.common.recordings import Recordings, Results, clips_packed, examples, extent_of
from evidence.common.running import compute_all
from motionary.errors import MotionaryError
from motionary.features import (
    FULL_BODY,
    FeatureSequence,
    compute_features,
    describe_reference_lengths,
)
from motionary.io import read
from motionary.labels import Label
from motionary.models.library import ClassLibrary, TrainingOptions, learn_classes
from motionary.motion import Motion
from motionary.retrieval.annotation import annotate

UNSEEN = "bd"
TITLE = "2 000 variants of recordings: right features, or an error"
SPLIT = (
    f"classes learned from four actors; recordings of {UNSEEN} and others are changed; thresholds "
    "of checks chosen on HDM05 bd bk dg, UI-PRMD s01-s04, ACCAD Male1, CMU 02 05 07 16 35 and "
    "Bandai normal"
)
SEED = 14

Bools = NDArray[np.bool_]

COUNT = 2000
LONGEST_S = 6.0

#: Parts of notes that leave something open.
_SAID = ("does not tell", "still", "rest pose", "takes its place")
#: Parts of those that tell a fault of a while.
_TOLD = ("is constant", "frozen", "is held", "repeats exactly", "jumps", "exchange places",
         "count as not seen", "counts as not seen")  # fmt: skip

#: Recordings that become variants, beside a clip of each class by the unseen actor.
OTHERS = (
    "hdm05_takes/HDM_bd_03-03_01_120.amc",
    "cmu/86_01.amc",
    "cmu/49_08.amc",
    "cmu/01_01.amc",
    "cmu/07_04.amc",
    "bandai/walk_normal_001.bvh",
    "bandai/kick_normal_001.bvh",
    "cmu/85_02.c3d",
    "hdm05_takes/HDM_mm_01-02_03_120.c3d",
    # People on whom no threshold of the checks was chosen.
    "hdm05/kickLFront1Reps/HDM_mm_kickLFront1Reps_019_120.amc",
    "hdm05/throwBasketball/HDM_tr_throwBasketball_012_120.amc",
    "ui_prmd/correct/m01_s05.c3d",
    "ui_prmd/correct/m03_s07.c3d",
    "ui_prmd/correct/m07_s08.c3d",
    "accad/Male2/Male2_B10_WalkTurnLeft45.bvh",
    "accad/Male2/Male2_G2_FrontKick.bvh",
)
DATA = (
    ("{clips}, trained with", lambda r: [clip.packed for clip in r.clips if clip.actor != UNSEEN]),
    ("{clips}, one clip of each class changed", lambda r: clips_packed(r.of(actors=[UNSEEN]))),
    (
        "further recordings changed, their first 6 s; {cmu}; {bandai}; UI-PRMD, PDDL 1.0; ACCAD "
        "Open Motion Project, CC BY 3.0",
        lambda r: extent_of(source.motion for source in load_sources(r.folder, OTHERS)),
    ),
    (
        "every recording of these and of AnimatedDrawings, MIT, for false alarms",
        lambda r: extent_of_alarms(r.folder),
    ),
)

#: A variant is wrong if more of its known values differ for longer than a flip.
WRONG_FROM = 0.01

SAME, REFUSED, ALARM, WARNED, WRONG = (
    "same", "error, rightly", "false alarm", "read with a warning", "silently wrong",
)  # fmt: skip
#: From good to bad.
VERDICTS = (SAME, REFUSED, WARNED, ALARM, WRONG)
_COLOURS = dict(zip(VERDICTS, (BLUE, TRUNK, RULE, ORANGE, VERMILLION), strict=True))

# Differences that last no longer are threshold flips: a feature that turns a bit earlier.
_FLIP_FRAMES = 3
_SAME_TIME_S = 0.1


class Source(NamedTuple):
    """A recording that becomes variants."""

    name: str
    motion: Motion
    asf: Path | None

    @property
    def formats(self) -> tuple[str, ...]:
        """Formats that hold it."""
        if self.motion.skeleton is None:
            return variants.POINTS
        return variants.ALL if self.motion.skeleton.ends else variants.NO_AMC


class Task(NamedTuple):
    """One variant to make."""

    kind: str
    suffix: str
    source: Source
    seed: int


def load_sources(folder: Path, names: Iterable[str]) -> list[Source]:
    """The recordings, cut to the first seconds."""
    result = []
    for name in names:
        motion = read(folder / name)
        motion = motion.cut(0, min(motion.n_frames, round(LONGEST_S * motion.rate_hz)))
        skeletons = [n.removeprefix("skeleton ") for n in motion.notes if n.endswith(".asf")]
        asf = next((p / s for s in skeletons for p in (folder / name).parents if (p / s).is_file()),
                   None)  # fmt: skip
        result.append(Source(name, motion, asf))
    return result


def plan(sources: list[Source], count: int, *, seed: int) -> list[Task]:
    """Variants in turns of kind and format, over sources in turns; the same for a seed."""
    rng = np.random.default_rng(seed)
    turns = [(kind, suffix) for kind, row in variants.KINDS.items() for suffix in row.formats]
    fitting = {
        turn: [s for s in rng.permutation(len(sources)) if _fits(sources[s], *turn)]
        for turn in turns
    }
    turns = [turn for turn in turns if fitting[turn]]
    tasks = []
    for i in range(count):
        kind, suffix = turn = turns[i % len(turns)]
        chosen = fitting[turn][i // len(turns) % len(fitting[turn])]
        tasks.append(Task(kind, suffix, sources[chosen], seed + i))
    return tasks


def _fits(source: Source, kind: str, suffix: str) -> bool:
    lies = "lieDown" in source.name or kind != variants.LYING
    return suffix in source.formats and lies


class Truth(NamedTuple):
    """Features and labels of a recording as it is."""

    packed: FeatureSequence
    labels: tuple[Label, ...]


class Reviewer:
    """Makes variants and says what became of them; keeps what it knows of the recordings."""

    def __init__(self, library: ClassLibrary | None) -> None:
        self.library = library
        self.truths: dict[str, Truth] = {}

    def review(self, task: Task) -> Results:
        """What became of one variant."""
        kind = variants.KINDS[task.kind]
        draft = kind.make(task.source.motion, task.suffix, np.random.default_rng(task.seed))
        row: Results = {"kind": task.kind, "format": task.suffix, "source": task.source.name}
        with tempfile.TemporaryDirectory() as folder:
            path = variants.write_draft(draft, Path(folder), task.suffix, asf=task.source.asf)
            try:
                motion = read(path, **draft.given)
                packed = compute_features(motion)
            except MotionaryError as error:
                verdict = REFUSED if kind.expected != variants.SAME else ALARM
                return row | {"verdict": verdict, "error": str(error)}
        first = round(draft.rest_frames / motion.rate_hz * 30)
        packed = packed.part(first, len(packed)) if first else packed
        truth = self.truth_of(draft.truth, task.source)
        row |= compare_features(packed, truth.packed, part=draft.part)
        row["notes"] = [*motion.notes, *describe_reference_lengths(motion)]
        is_fault = kind.expected == variants.FAULT
        row |= compare_labels(() if is_fault else self.label(packed),
                              () if is_fault else truth.labels)  # fmt: skip
        row["told"] = any(word in note for note in row["notes"] for word in _TOLD)
        row["verdict"] = _verdict(row, kind.expected)
        return row

    def truth_of(self, motion: Motion, source: Source) -> Truth:
        """Features and labels of what reading should give."""
        is_source = motion is source.motion
        if not is_source or source.name not in self.truths:
            packed = compute_features(motion)
            truth = Truth(packed, self.label(packed))
            if not is_source:
                return truth
            self.truths[source.name] = truth
        return self.truths[source.name]

    def label(self, packed: FeatureSequence) -> tuple[Label, ...]:
        """Labels, none without classes."""
        return (
            tuple(annotate(packed, self.library, assignment="published"))
            if self.library is not None
            else ()
        )


def _verdict(row: Mapping[str, Any], expected: str) -> str:
    said = any(word in note for note in row["notes"] for word in _SAID)
    if expected == variants.FAULT:
        # One that changes no feature, as a wrist held where it hangs, is none.
        said = row["told"]
    if expected in (variants.SAME, variants.FAULT) and row["lasting"] <= WRONG_FROM:
        return WARNED if expected == variants.FAULT and said else SAME
    return WARNED if said else WRONG


def compare_features(
    packed: FeatureSequence, truth: FeatureSequence, *, part: tuple[float, float] | None = None
) -> Results:
    """Fractions of the values known in both that differ, and that differ for longer than a flip.

    Of a part, where something was planted: values elsewhere make no fraction small.
    """
    n = min(len(packed), len(truth))
    known = (packed.known_features[:n] & truth.known_features[:n]).astype(bool)
    differ = (packed.features[:n] != truth.features[:n]) & known
    lasting = _runs_longer(differ, _FLIP_FRAMES)
    if part is not None:
        inside = slice(*(round(30 * at) for at in part))
        known, differ, lasting = known[inside], differ[inside], lasting[inside]
    total = max(1, int(known.sum()))
    worst = lasting.sum(axis=0)
    return {
        "flips": float(differ.sum()) / total,
        "lasting": float(lasting.sum()) / total,
        "known": float(known.mean()),
        "length": len(packed) - len(truth),
        "which": [FULL_BODY.ids[i] for i in np.argsort(-worst, kind="stable")[:3] if worst[i]],
    }


def _runs_longer(flags: Bools, least: int) -> Bools:
    """Flags that belong to runs, along the first axis, of more than `least`."""
    result = np.zeros_like(flags)
    for column in range(flags.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate(([0], flags[:, column].view(np.int8), [0]))))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            result[start:stop, column] = stop - start > least
    return result


def compare_labels(found: Iterable[Label], truth: Sequence[Label]) -> Results:
    """Labels of the truth, how many of them are found at the same time, and how many more are."""
    left = list(found)
    same = 0
    for label in truth:
        match = next((other for other in left if _at_same_time(label, other)), None)
        if match is not None:
            left.remove(match)
            same += 1
    return {
        "labels": len(truth),
        "labels_same": same,
        "labels_more": len(left),
        "more": [label.name for label in left],
    }


def _at_same_time(a: Label, b: Label) -> bool:
    apart = max(abs(a.start_s - b.start_s), abs(a.end_s - b.end_s))
    return a.name == b.name and apart <= _SAME_TIME_S + 1e-9


# -- the page -----------------------------------------------------------------------------


def measure(recordings: Recordings) -> Results:
    """What became of every variant, and of the recordings as they are."""
    trained = [clip for clip in recordings.clips if clip.actor != UNSEEN]
    library = ClassLibrary(
        learn_classes(examples(trained), training=TrainingOptions(mirror=True)).classes
    )
    sources = load_sources(recordings.folder, _names(recordings))
    tasks = plan(sources, COUNT, seed=SEED)
    groups = [[task for task in tasks if task.source is source] for source in sources]
    reviewed = compute_all(partial(_review_all, library), groups)
    rows = [row for group in reviewed for row in group]
    return {
        "variants": len(rows),
        "sources": len(sources),
        "kinds": [_summary(kind, rows) for kind in variants.KINDS],
        "totals": {v: sum(row["verdict"] == v for row in rows) for v in VERDICTS},
        "alarms": [_short(row) for row in rows if row["verdict"] in (ALARM, WRONG)],
        "originals": count_alarms(recordings.folder),
    }


def _review_all(library: ClassLibrary, tasks: list[Task]) -> list[Results]:
    reviewer = Reviewer(library)
    return [reviewer.review(task) for task in tasks]


def _names(recordings: Recordings) -> list[str]:
    """A clip of each class by the unseen actor, and the other recordings."""
    first: dict[str, str] = {}
    for clip in recordings.of(actors=[UNSEEN]):
        first.setdefault(clip.motion_class, f"hdm05/{clip.name}")
    return [*first.values(), *OTHERS]


def _summary(kind: str, rows: list[Results]) -> Results:
    """What became of one kind of variant."""
    mine = [row for row in rows if row["kind"] == kind]
    read_ones = [row for row in mine if "flips" in row]
    counts = {
        suffix: dict(Counter(row["verdict"] for row in mine if row["format"] == suffix))
        for suffix in variants.KINDS[kind].formats
    }
    return {
        "kind": kind,
        "expected": variants.KINDS[kind].expected,
        "verdicts": dict(Counter(row["verdict"] for row in mine)),
        "formats": counts,
        "flips": float(np.mean([row["flips"] for row in read_ones])) if read_ones else None,
        "most_flips": max((row["flips"] for row in read_ones), default=None),
        "missed": sum(row["verdict"] == WRONG for row in mine) / max(1, len(mine)),
        "labels": sum(row["labels"] for row in read_ones),
        "labels_same": sum(row["labels_same"] for row in read_ones),
        "labels_more": sum(row["labels_more"] for row in read_ones),
        "more": dict(Counter(name for row in read_ones for name in row["more"]).most_common()),
    }


def _short(row: Results) -> Results:
    return {key: row.get(key) for key in ("kind", "format", "source", "verdict", "error", "which")}


@house_style()
def draw(results: Results) -> dict[str, Any]:
    """A square per kind and format: the worst that happened there, and how often."""
    from matplotlib.figure import Figure

    kinds = results["kinds"]
    figure = Figure(figsize=(5.6, 0.2 * len(kinds) + 0.9), layout="constrained")
    axes = figure.subplots()
    for y, row in enumerate(kinds):
        for suffix, counts in row["formats"].items():
            worst = max(counts, key=VERDICTS.index)
            x = variants.ALL.index(suffix)
            axes.barh(y, 0.92, left=x - 0.46, height=0.86, color=_COLOURS[worst], linewidth=0)
            total = sum(counts.values())
            text = str(total) if counts[worst] == total else f"{counts[worst]} of {total}"
            axes.text(x, y + 0.03, text, ha="center", va="center", color="white", size=7)
    axes.set(xlim=(-0.5, len(variants.ALL) - 0.5), ylim=(len(kinds) - 0.5, -0.5))
    axes.set_yticks(range(len(kinds)), [row["kind"] for row in kinds])
    axes.set_xticks(range(len(variants.ALL)), [s.upper() for s in variants.ALL])
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    shown = [v for v in VERDICTS if results["totals"][v]]
    handles: list[Any] = [axes.barh(-9, 0, color=_COLOURS[v]) for v in shown]
    figure.legend(handles, shown, loc="outside lower left", ncols=3, frameon=False)
    return {"variants": figure}
