"""Labels of streams by unseen actors, between other motion: figure 5.6 of the thesis."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.labelling import (
    Found,
    Labelled,
    Setting,
    Tasks,
    best_of,
    curve_of,
    find_all,
    interval_over_actors,
    label_all,
    label_by_scores,
    merit,
    tasks_of,
)
from evidence.common.labelling import measure as measure_labels
from evidence.common.recordings import Recordings, Results
from evidence.common.streams import (
    AMC_SEGMENTS,
    CHOOSING,
    KINDS,
    REPORTING,
    Stream,
    clips_alone,
    make_streams,
    other_motion,
)
from motionary.evaluation import evaluate

TITLE = "Labels of streams by unseen actors, beside figure 5.6 of the thesis"
SPLIT = (
    "two actors unseen, the clips of three train; setting and threshold chosen on five pairs of "
    "actors, reported once on the other five"
)
SEED = 12
DATA = (
    "clips",
    ("segments of {cmu}", lambda r: [part.packed for part in other_motion(r, "amc")]),
    ("{bandai}", lambda r: [part.packed for part in other_motion(r, "bvh")]),
)


THRESHOLDS = (0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.1, 0.13)
MOST = THRESHOLDS[-1]
N_KNOWN = 6
N_DRAWS = 5
SELF_INFORMATION, EQUAL = "by surprise", "all alike"
WAYS = (SELF_INFORMATION, EQUAL)
#: One of these is chosen.
CHOICES = {
    f"{SELF_INFORMATION}, δ = .05": Setting(),
    f"{SELF_INFORMATION}, δ = .1": Setting(tolerance=0.1),
    f"{EQUAL}, δ = .05": Setting(by_self_information=False),
    f"{EQUAL}, δ = .1": Setting(by_self_information=False, tolerance=0.1),
}
#: What else could be done with the chosen one; measured where settings are chosen.
CHANGES: dict[str, dict[str, Any]] = {
    "with mirror images": {"mirrored": True},
    "step (2, 1) counted once": {"skip_weight": 1.0},
    "matches go on while they cost the same": {"to_plateau_end": True},
}
#: Classes that are near to some of the other motion: walks, reaching and waving hands.
NEAR = ("sneak2StepsLStart", "grabHighR", "throwBasketball")


def measure(recordings: Recordings) -> Results:
    """Choice on five pairs, report on the other five, and what would change."""
    streams = {p: make_streams(recordings, p, seed=SEED) for p in CHOOSING + REPORTING}
    tasks = tasks_of(recordings, streams)
    choosing = {key: task for key, task in tasks.items() if key[0] in CHOOSING}
    reporting = {key: task for key, task in tasks.items() if key[0] in REPORTING}
    found = {name: find_all(choosing, one, most=MOST) for name, one in CHOICES.items()}
    choice = {name: _at_best(curve_of(choosing, one, THRESHOLDS)) for name, one in found.items()}
    by_way = {way: _best_choice(choice, way) for way in WAYS}
    chosen = _best_choice(choice)
    matches, threshold = found[chosen["setting"]], chosen["threshold"]
    rng = np.random.default_rng(SEED)
    draws = [
        tuple(sorted(rng.permutation(recordings.classes)[:N_KNOWN].tolist()))
        for _ in range(N_DRAWS)
    ]
    closed, opened = {}, {}
    for way, own in by_way.items():
        setting = CHOICES[own["setting"]]
        closed[way], _ = _report(reporting, setting, own["threshold"], [None])
        opened[way], opened[way]["by_draw"] = _report(reporting, setting, own["threshold"], draws)
    alone = tasks_of(recordings, {p: clips_alone(recordings, p, seed=SEED) for p in CHOOSING})
    return {
        "thresholds": THRESHOLDS,
        "streams": {kind: _describe([own[kind] for own in streams.values()]) for kind in KINDS},
        "other": [list(row) for row in AMC_SEGMENTS],
        "bandai": sorted(part.name for part in other_motion(recordings, "bvh")),
        "choice": choice,
        "chosen": chosen,
        "chosen_by_way": by_way,
        "draws": draws,
        "closed": closed,
        "open": opened,
        "changes": _changes(choosing, alone, CHOICES[chosen["setting"]], threshold, matches),
        "scores": {
            "closed": _score([label_by_scores(reporting)]),
            "open": _score(label_by_scores(reporting, names=names) for names in draws),
        },
        "false": _where_false(streams, label_all(choosing, matches, threshold)),
        "pairs": {"choosing": CHOOSING, "reporting": REPORTING},
    }


def _at_best(curve: Mapping[float, Mapping[str, float]]) -> Results:
    """Measures at the threshold with the best mean of F1 and F2."""
    best = best_of(curve)
    return {"threshold": best, **curve[best]}


def _best_choice(choice: Results, way: str = "") -> Results:
    """Best setting, of those that weigh in one way."""
    name = max((name for name in choice if name.startswith(way)), key=lambda n: merit(choice[n]))
    return {"setting": name, "threshold": choice[name]["threshold"]}


def _report(
    tasks: Tasks, setting: Setting, threshold: float, draws: Sequence[Sequence[str] | None]
) -> tuple[Results, list[dict[str, float]]]:
    """Curves, and all measures at the chosen threshold; and F1 and F2 of each draw.

    Of a draw some classes are known, clips of the others are other motion; all are pooled.
    """
    found = [find_all(tasks, setting, most=MOST, names=names or ()) for names in draws]

    def labelled(t: float, kinds: Sequence[str]) -> Iterator[dict[Any, Labelled]]:
        for names, matches in zip(draws, found, strict=True):
            own = {key: one for key, one in matches.items() if key[1] in kinds}
            yield label_all(tasks, own, t, names=names)

    def pooled(kinds: Sequence[str]) -> list[dict[str, float]]:
        return [
            measure_labels(one for draw in labelled(t, kinds) for one in draw.values())
            for t in THRESHOLDS
        ]

    kinds = {"amc": ["amc"], "bvh": ["bvh"], "both": list(KINDS)}
    by_draw = [measure_labels(draw.values()) for draw in labelled(threshold, KINDS)]
    return {
        "curves": {kind: pooled([kind]) for kind in KINDS},
        "pooled": pooled(KINDS),
        "report": {title: _score(labelled(threshold, own)) for title, own in kinds.items()},
    }, [{key: one[key] for key in ("F1", "F2")} for one in by_draw]


def _score(draws: Iterable[Mapping[Any, Labelled]]) -> Results:
    """All measures, with intervals over actors."""
    chosen = {
        f"{number} {'+'.join(pair)} {kind}": (pair, one)
        for number, draw in enumerate(draws)
        for (pair, kind), one in draw.items()
    }
    scores = evaluate(
        {name: one.predicted for name, (_, one) in chosen.items()},
        {name: one.truth for name, (_, one) in chosen.items()},
        durations_s={name: one.seconds for name, (_, one) in chosen.items()},
    )
    values: dict[str, dict[tuple[str, str], list[float]]] = {"F1": {}, "F2": {}}
    for name, (pair, _) in chosen.items():
        one = scores.recordings[name]
        values["F1"].setdefault(pair, []).append(one.frames.f)
        values["F2"].setdefault(pair, []).append(one.segments.f)
    return {
        **scores.concatenated.as_dict(),
        "intervals": {key: interval_over_actors(own) for key, own in values.items()},
        "classes": {
            name: {"frames": list(one.frames), "segments": list(one.segments)}
            for name, one in scores.classes.items()
        },
    }


def _changes(
    tasks: Tasks, alone: Tasks, setting: Setting, threshold: float, matches: Found
) -> Results:
    """F1 and F2 on the pairs for choosing, if one thing is changed."""

    def row(tasks: Tasks, found: Found, **how: Any) -> Results:
        curve = curve_of(tasks, found, THRESHOLDS, **how)
        best = best_of(curve)
        return {"same": curve[threshold], "best_threshold": best, "best": curve[best]}

    classes = next(iter(tasks.values())).learned
    others = [one.name for one in classes if one.name not in NEAR]
    of_clips = find_all(alone, setting, most=MOST)
    return {
        "as chosen": row(tasks, matches),
        **{
            name: row(tasks, find_all(tasks, setting._replace(**change), most=MOST))
            for name, change in CHANGES.items()
        },
        "labels not extended": row(tasks, matches, extended=False),
        "without sneaking, grabbing and throwing": row(tasks, matches, names=others),
        "clips alone, nothing between": row(alone, of_clips),
        "clips alone, labels not extended": row(alone, of_clips, extended=False),
    }


def _where_false(
    streams: Mapping[Any, Mapping[str, Stream]], labelled: Mapping[Any, Labelled]
) -> list[list[Any]]:
    """False labels by class and by what they lie on most; recordings of a kind together."""
    counts: Counter[tuple[str, str]] = Counter()
    for (pair, kind), one in labelled.items():
        parts = (*streams[pair][kind].truth, *streams[pair][kind].others)
        for x in one.predicted:
            common = [(min(x.end, s.end) - max(x.start, s.start), s.name) for s in parts]
            if not any(name == x.name and length > 1e-6 for length, name in common):
                counts[x.name, _kind_of(max(common)[1])] += 1
    return [[name, place, n] for (name, place), n in counts.most_common(14)]


def _kind_of(name: str) -> str:
    """A recording's name without style and number."""
    return "_".join(name.split("_")[:-2]) if name.startswith("bandai/") else name


def _describe(streams: Sequence[Stream]) -> Results:
    of_clips = sum(s.end - s.start for own in streams for s in own.truth)
    return {
        "seconds": [round(own.seconds) for own in streams],
        "clips": [len(own.truth) for own in streams],
        "share_of_clips": float(of_clips / sum(own.seconds for own in streams)),
    }


def best_of_pooled(curve: Sequence[Mapping[str, float]]) -> Mapping[str, float]:
    """Measures at the best threshold."""
    return max(curve, key=merit)


def draw(results: Results) -> dict[str, Any]:
    """Figure 5.6, in four measures, all and some of the classes known."""
    measures = {
        "F1": "F1, frames",
        "F2": "F2, segments",
        "mean_average_precision": "mAP at IoU .5",
        "false_per_minute": "false a minute",
    }
    panels = []
    for world, title in (("closed", "all 11 known"), ("open", "6 of 11 known")):
        for key, label in measures.items():
            curves = {
                f"{way}, {kind.upper()}": (
                    results["thresholds"],
                    [row[key] for row in results[world][way]["curves"][kind]],
                )
                for way in WAYS
                for kind in KINDS
            }
            limits = (0.0, 25.0) if key == "false_per_minute" else (0.0, 1.0)
            panels.append(Panel(f"{label}; {title}", curves, "threshold τ", "", limits))

    def decorate(axes: Any, index: int) -> None:
        axes.set_xticks([0.0, 0.05, 0.1])

    return {"streams": draw_panels(panels, columns=4, size=(2.5, 2.1), decorate=decorate)}
