"""How well are recordings labelled that people have labelled, and what is each false label?"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from evidence.common.drawing import Panel, draw_panels
from evidence.common.labelling import (
    Labelled,
    Setting,
    Sought,
    best_of,
    labels_at,
    learn_all,
    measure,
    seek,
    with_setting,
)
from evidence.common.recordings import (
    ACTORS,
    CMU,
    HDM05,
    TRUTH,
    Clip,
    Recordings,
    data_entry,
    examples,
)
from evidence.common.running import Evidence, Results, main
from evidence.common.streams import CHOOSING, make_streams, negatives
from evidence.true_recordings_page import write
from motionary.evaluation import Segment, rename_segments, to_segments
from motionary.io import read_labels
from motionary.library import Teaching, suggest_thresholds
from motionary.plots import plot_sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEED = 12
THRESHOLDS = (0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12, 0.13)
#: Recordings and their names in the table of truth.
LABELLED = {
    "cmu/01_01.amc": "01_01",
    "cmu/49_08.amc": "49_08",
    "cmu/86_01.amc": "86_01",
    "hdm05_takes/HDM_bd_03-03_01_120.amc": "HDM_bd_03-03_01_120",
}
#: The actor of the last.
UNSEEN = "bd"
#: What the authors of the truth call the classes of the clips.
NAMES = {
    "depositFloorR": "grabDepR",
    "grabHighR": "grabDepR",
    "elbowToKnee1RepsLelbowStart": "exercise",
    "squat1Reps": "exercise",
    "hopBothLegs1hops": "jump",
    "jogLeftCircle4StepsRstart": "move",
    "sneak2StepsLStart": "move",
    "kickLFront1Reps": "kick",
    "lieDownFloor": "sitLieDown",
    "rotateArmsBothBackward1Reps": "rotateArms",
    "throwBasketball": "throwR",
}
WAYS = {
    "by surprise": Setting(mirrored=True),
    "all alike": Setting(mirrored=True, by_surprise=False),
}

Truth = Mapping[str, Sequence[Segment]]


def measure_recordings(recordings: Recordings) -> Results:
    """Labels of the four recordings, by threshold, and what is false."""
    truth = _truth(recordings)
    thresholds = {
        name: {way: _choose(recordings, setting, without) for way, setting in WAYS.items()}
        for name, without in {"without": tuple(LABELLED), "with": ()}.items()
    }
    clips = recordings.of(actors=set(ACTORS) - {UNSEEN})
    found = {way: _seek(recordings, clips, setting) for way, setting in WAYS.items()}
    suggested = {
        "told from each other": _suggest(clips, []),
        "told from other recordings too": _suggest(clips, negatives(recordings)),
    }
    chosen = thresholds["without"]["by surprise"]
    by_class = {
        name: _label(recordings, found["by surprise"], own, truth)
        for name, own in suggested.items()
    }
    everyone = _seek(recordings, recordings.clips, WAYS["by surprise"])
    main_labels = _label(recordings, found["by surprise"], chosen, truth)
    return {
        "thresholds": THRESHOLDS,
        "chosen": thresholds,
        "curves": {
            way: [measure(list(_label(recordings, own, t, truth).values())) for t in THRESHOLDS]
            for way, own in found.items()
        },
        "one": {
            way: measure(list(_label(recordings, own, thresholds["without"][way], truth).values()))
            for way, own in found.items()
        },
        "everyone": measure(list(_label(recordings, everyone, chosen, truth).values())),
        "suggested": {name: measure(list(own.values())) for name, own in by_class.items()},
        "suggested_thresholds": suggested,
        "trivial": _trivial(recordings, truth),
        "seconds": {name: len(recordings.others[name]) / 30 for name in LABELLED},
        "recordings": _by_recording(main_labels),
        "false": _false(main_labels, by_class["told from other recordings too"]),
        "missed": _missed(main_labels),
    }


def _truth(recordings: Recordings) -> dict[str, list[Segment]]:
    """Labels of the authors, of classes that the clips' classes belong to."""
    tables = read_labels(recordings.folder / "truth" / "annotation_2009.csv")
    known = set(NAMES.values())
    return {
        name: [s for s in to_segments(tables[row], where=row) if s.name in known]
        for name, row in LABELLED.items()
    }


def _choose(recordings: Recordings, setting: Setting, without: Sequence[str]) -> float:
    """Threshold with the best mean of F1 and F2 on streams."""
    found: list[tuple[Sought, tuple[Segment, ...], float]] = []
    for pair in CHOOSING:
        clips = recordings.of(actors=set(ACTORS) - set(pair))
        classes = with_setting(learn_all(clips), setting, clips)
        for stream in make_streams(recordings, pair, seed=SEED, without=without).values():
            sought = seek(stream.words, classes, most=THRESHOLDS[-1], setting=setting)
            found.append((sought, stream.truth, stream.seconds))
    curve = {
        t: measure([Labelled(labels_at(one, t), truth, seconds) for one, truth, seconds in found])
        for t in THRESHOLDS
    }
    return best_of(curve)


def _seek(recordings: Recordings, clips: Sequence[Clip], setting: Setting) -> dict[str, Sought]:
    classes = with_setting(learn_all(clips), setting, clips)
    return {
        name: seek(recordings.others[name], classes, most=THRESHOLDS[-1], setting=setting)
        for name in LABELLED
    }


def _suggest(clips: Sequence[Clip], others: Sequence[Any]) -> dict[str, float]:
    suggestions = suggest_thresholds(
        examples(clips), groups="HDM_(..)_", negatives=others, teaching=Teaching(mirror=True)
    )
    return {name: one.threshold for name, one in suggestions.items()}


def _label(
    recordings: Recordings,
    found: Mapping[str, Sought],
    thresholds: float | Mapping[str, float],
    truth: Truth,
) -> dict[str, Labelled]:
    """Labels under the names of the truth; the class is kept by `_false` through its cost."""
    return {
        name: Labelled(
            rename_segments(labels_at(sought, thresholds), NAMES),
            truth[name],
            len(recordings.others[name]) / 30,
        )
        for name, sought in found.items()
    }


def _trivial(recordings: Recordings, truth: Truth) -> Results:
    """No labels at all, and the most frequent class from end to end."""
    lengths: dict[str, float] = {}
    for segments in truth.values():
        for s in segments:
            lengths[s.name] = lengths.get(s.name, 0.0) + s.end - s.start
    most = max(sorted(lengths), key=lambda name: lengths[name])
    seconds = {name: len(recordings.others[name]) / 30 for name in LABELLED}
    everywhere = [
        Labelled([Segment(most, 0.0, seconds[name])], truth[name], seconds[name])
        for name in LABELLED
    ]
    nothing = [Labelled([], truth[name], seconds[name]) for name in LABELLED]
    return {"most": most, "everywhere": measure(everywhere), "nothing": measure(nothing)}


def _by_recording(labelled: Mapping[str, Labelled]) -> Results:
    return {name: measure([one]) for name, one in labelled.items()}


def _overlaps(a: Segment, b: Segment) -> bool:
    return min(a.end, b.end) > max(a.start, b.start) + 1e-6


def _false(one: Mapping[str, Labelled], several: Mapping[str, Labelled]) -> list[Results]:
    """Labels that overlap no true one, by either way of thresholds."""
    rows: dict[tuple[str, str, int], Results] = {}
    for way, labelled in (("one τ", one), ("per class", several)):
        for name, own in labelled.items():
            for x in own.predicted:
                if any(t.name == x.name and _overlaps(t, x) for t in own.truth):
                    continue
                known = _same(rows, name, x)
                if known:
                    known["ways"].append(way)
                else:
                    rows[name, x.name, int(x.start)] = _false_row(name, x, own.truth, way)
    return sorted(rows.values(), key=lambda row: (row["recording"], row["start"]))


def _same(rows: Mapping[tuple[str, str, int], Results], name: str, x: Segment) -> Results | None:
    for (recording, label, _), row in rows.items():
        if (recording, label) == (name, x.name) and _overlaps(
            Segment(label, row["start"], row["end"]), x
        ):
            return row
    return None


def _false_row(name: str, x: Segment, truth: Sequence[Segment], way: str) -> Results:
    return {
        "recording": name, "label": x.name, "start": x.start, "end": x.end, "cost": x.cost,
        "truth": sorted({t.name for t in truth if _overlaps(t, x)}), "ways": [way],
    }  # fmt: skip


def _missed(labelled: Mapping[str, Labelled]) -> list[list[Any]]:
    """True labels that no label of their class overlaps: class, missed, of how many."""
    counts: dict[str, list[int]] = {}
    for own in labelled.values():
        for t in own.truth:
            row = counts.setdefault(t.name, [0, 0])
            row[0] += not any(x.name == t.name and _overlaps(t, x) for x in own.predicted)
            row[1] += 1
    return [[name, *row] for name, row in sorted(counts.items())]


def draw(results: Results) -> "Mapping[str, Figure]":
    """F1 and F2 against the threshold."""
    panels = [
        Panel(
            title,
            {
                way: (results["thresholds"], [row[key] for row in curve])
                for way, curve in results["curves"].items()
            },
            "threshold τ",
            "",
            (0.0, 1.0),
        )
        for key, title in (("F1", "F1, frames"), ("F2", "F2, segments"))
    ]
    return {"true_recordings": draw_panels(panels, columns=2, size=(3.2, 2.3))}


def draw_recordings(recordings: Recordings, results: Results) -> "Mapping[str, Figure]":
    """A strip of stick figures of every false label."""
    motions = {name: recordings.motion(name) for name in LABELLED}
    strips = []
    for row in results["false"]:
        motion = motions[row["recording"]]
        first, stop = (round(row[key] * motion.rate_hz) for key in ("start", "end"))
        title = f"{row['recording']}  {row['start']:.1f}–{row['end']:.1f} s: {row['label']}"
        strips.append((title, motion.generic_positions()[first:stop]))
    return {"true_recordings_false": plot_sheet(None, strips)} if strips else {}


def describe_data(recordings: Recordings) -> list[dict[str, Any]]:
    """Entries of the record."""
    return [
        data_entry(HDM05, [clip.words for clip in recordings.clips]),
        data_entry(
            f"four recordings of HDM05 and {CMU}, with {TRUTH}",
            [recordings.others[name] for name in LABELLED],
        ),
    ]


EVIDENCE = Evidence(
    name="true_recordings",
    title="Labels of recordings that people have labelled",
    split="clips of four actors teach, the fifth and CMU are labelled; thresholds are chosen on "
    "streams in which none of the four recordings is",
    seed=SEED,
    describe_data=describe_data,
    measure=measure_recordings,
    write=write,
    draw=draw,
    draw_recordings=draw_recordings,
)

if __name__ == "__main__":
    main(EVIDENCE)
