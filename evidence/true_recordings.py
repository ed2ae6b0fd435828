"""How well are recordings labelled that people have labelled, and what is each false label?"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from evidence.common.drawing import Panel, draw_panels
from evidence.common.labelled import LABELLED, NAMES, UNSEEN
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
from motionary.evaluation import LabelledSegment, rename_segments, to_segments
from motionary.io import read_labels
from motionary.models.library import TrainingOptions, calibrate_thresholds
from motionary.plots import plot_sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEED = 12
THRESHOLDS = (0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12, 0.13)
SURPRISE, EQUAL = "by surprise", "all alike"
WAYS = {
    SURPRISE: Setting(mirrored=True),
    EQUAL: Setting(mirrored=True, by_self_information=False),
}

Truth = Mapping[str, Sequence[LabelledSegment]]


def measure_recordings(recordings: Recordings) -> Results:
    """Labels of the four recordings, by threshold, and what is false."""
    truth = _truth(recordings)
    chosen = {way: _choose(recordings, setting) for way, setting in WAYS.items()}
    clips = recordings.of(actors=set(ACTORS) - {UNSEEN})
    found = {way: _seek(recordings, clips, setting) for way, setting in WAYS.items()}
    calibrated = {
        "told from each other": _calibrate(clips, []),
        "told from other recordings too": _calibrate(clips, negatives(recordings)),
    }
    everyone = _seek(recordings, recordings.clips, WAYS[SURPRISE])
    curves = {
        way: {t: _label(recordings, own, t, truth) for t in THRESHOLDS}
        for way, own in found.items()
    }
    measured = {way: {t: _all(own) for t, own in curve.items()} for way, curve in curves.items()}
    by_class = {
        name: _label(recordings, found[SURPRISE], own, truth) for name, own in calibrated.items()
    }
    seen_best = best_of(measured[SURPRISE])
    one = {way: curves[way][chosen[way]] for way in WAYS}
    return {
        "thresholds": THRESHOLDS,
        "chosen": chosen,
        "curves": {way: list(curve.values()) for way, curve in measured.items()},
        "one": {way: measured[way][chosen[way]] for way in WAYS},
        "everyone": measure(list(_label(recordings, everyone, chosen[SURPRISE], truth).values())),
        "to_plateau_end": {
            way: _to_plateau_end(recordings, clips, way, chosen[way], truth) for way in WAYS
        },
        "suggested": {name: _all(own) for name, own in by_class.items()},
        "suggested_thresholds": calibrated,
        "trivial": _trivial(recordings, truth),
        "seconds": {name: len(recordings.others[name]) / 30 for name in LABELLED},
        "recordings": {
            way: {name: measure([own]) for name, own in labelled.items()}
            for way, labelled in one.items()
        },
        "false": _false(
            {
                **one,
                "per class": by_class["told from other recordings too"],
                f"{SURPRISE}, τ = {seen_best:g}": curves[SURPRISE][seen_best],
            }
        ),
        "loosened": seen_best,
        "missed": {way: _missed(labelled) for way, labelled in one.items()},
    }


def _all(labelled: Mapping[str, Labelled]) -> dict[str, float]:
    """Measures over all recordings."""
    return measure(list(labelled.values()))


def _truth(recordings: Recordings) -> dict[str, list[LabelledSegment]]:
    """Labels of the authors, of classes that the clips' classes belong to."""
    tables = read_labels(recordings.folder / "truth" / "annotation_2009.csv")
    known = set(NAMES.values())
    return {
        name: [s for s in to_segments(tables[row], where=row) if s.name in known]
        for name, row in LABELLED.items()
    }


def _choose(recordings: Recordings, setting: Setting) -> float:
    """Threshold with the best mean of F1 and F2 on streams that hold none of the recordings."""
    found: list[tuple[Sought, tuple[LabelledSegment, ...], float]] = []
    for pair in CHOOSING:
        clips = recordings.of(actors=set(ACTORS) - set(pair))
        classes = with_setting(learn_all(clips), setting, clips)
        for stream in make_streams(recordings, pair, seed=SEED, without=tuple(LABELLED)).values():
            sought = seek(stream.packed, classes, most=THRESHOLDS[-1], setting=setting)
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


def _to_plateau_end(
    recordings: Recordings, clips: Sequence[Clip], way: str, threshold: float, truth: Truth
) -> dict[str, float]:
    """If a match goes on as long as it costs the same."""
    found = _seek(recordings, clips, WAYS[way]._replace(to_plateau_end=True))
    return _all(_label(recordings, found, threshold, truth))


def _calibrate(clips: Sequence[Clip], others: Sequence[Any]) -> dict[str, float]:
    calibrations = calibrate_thresholds(
        examples(clips), negatives=others, training=TrainingOptions(mirror=True, groups="HDM_(..)_")
    )
    return {name: one.threshold for name, one in calibrations.items()}


def _label(
    recordings: Recordings,
    found: Mapping[str, Sought],
    thresholds: float | Mapping[str, float],
    truth: Truth,
) -> dict[str, Labelled]:
    """Labels under the names of the truth."""
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
        Labelled([LabelledSegment(most, 0.0, seconds[name])], truth[name], seconds[name])
        for name in LABELLED
    ]
    nothing = [Labelled([], truth[name], seconds[name]) for name in LABELLED]
    return {"most": most, "everywhere": measure(everywhere), "nothing": measure(nothing)}


def _overlaps(a: LabelledSegment, b: LabelledSegment) -> bool:
    return min(a.end, b.end) > max(a.start, b.start) + 1e-6


def _false(ways: Mapping[str, Mapping[str, Labelled]]) -> list[Results]:
    """Labels that overlap no true one, in any of some ways to label."""
    rows: list[Results] = []
    for way, labelled in ways.items():
        for name, own in labelled.items():
            for x in own.predicted:
                if any(t.name == x.name and _overlaps(t, x) for t in own.truth):
                    continue
                known = _same(rows, name, x)
                if known is None:
                    rows.append(_false_row(name, x, own.truth, way))
                elif way not in known["ways"]:
                    known["ways"].append(way)
    return sorted(rows, key=lambda row: (row["recording"], row["start"], row["label"]))


def _same(rows: Sequence[Results], name: str, x: LabelledSegment) -> Results | None:
    """A row of the same label that overlaps."""
    for row in rows:
        if (row["recording"], row["label"]) == (name, x.name) and _overlaps(
            LabelledSegment(x.name, row["start"], row["end"]), x
        ):
            return row
    return None


def _false_row(
    name: str, x: LabelledSegment, truth: Sequence[LabelledSegment], way: str
) -> Results:
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
    if not strips:
        return {}
    sheet = plot_sheet(None, strips)
    # A sheet calls what it shows hits.
    sheet.texts[0].set_text(f"{len(strips)} false labels")
    return {"true_recordings_false": sheet}


def describe_data(recordings: Recordings) -> list[dict[str, Any]]:
    """Entries of the record."""
    return [
        data_entry(HDM05, [clip.packed for clip in recordings.clips]),
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
