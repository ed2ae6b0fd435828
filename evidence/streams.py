"""Labels of streams by unseen actors, between other motion: figure 5.6 of the thesis."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.labelling import (
    Labelled,
    Matches,
    Setting,
    best_of,
    find_matches,
    interval_over_actors,
    labels_at,
    learn_all,
    merit,
    with_setting,
)
from evidence.common.labelling import measure as measure_labels
from evidence.common.recordings import ACTORS, Clip, Recordings, Results
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
from motionary.evaluation import Measures, evaluate

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

Pair = tuple[str, str]

THRESHOLDS = (0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.1, 0.13)
N_KNOWN = 6
N_DRAWS = 5
SELF_INFORMATION, EQUAL = "by surprise", "all alike"
WAYS = (SELF_INFORMATION, EQUAL)
WORLDS = {"closed": "all 11", "open": "6 of 11"}
SOURCES = {"amc": "CMU", "bvh": "Bandai Namco"}
#: Of an earlier prototype, without queries: F1, F2 with all classes known, at its best
#: threshold, and with six of eleven at two thresholds.
PROTOTYPE_CLOSED = (0.91, 0.98)
PROTOTYPE_OPEN = {0.06: (0.81, 0.90), 0.13: (0.58, 0.68)}
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


class _Bench:
    """Streams and learned classes of each pair; each pair is not learned from."""

    def __init__(self, recordings: Recordings) -> None:
        self.names = recordings.classes
        self.streams = {p: make_streams(recordings, p, seed=SEED) for p in CHOOSING + REPORTING}
        self.clips: dict[Pair, tuple[Clip, ...]] = {
            pair: recordings.of(actors=set(ACTORS) - set(pair)) for pair in self.streams
        }
        self.learned = {pair: learn_all(clips) for pair, clips in self.clips.items()}

    def find(
        self,
        setting: Setting,
        pairs: Sequence[Pair],
        *,
        names: Sequence[str] = (),
        streams: Mapping[Pair, Mapping[str, Stream]] | None = None,
    ) -> dict[tuple[Pair, str], Matches]:
        """Matches in every stream of some pairs, of all classes by default."""
        found = {}
        for pair in pairs:
            known = [one for one in self.learned[pair] if not names or one.name in names]
            classes = with_setting(known, setting, self.clips[pair])
            for kind, stream in (streams or self.streams)[pair].items():
                found[pair, kind] = find_matches(
                    stream.packed, classes, most=THRESHOLDS[-1], setting=setting
                )
        return found

    def label(
        self,
        matches: Mapping[tuple[Pair, str], Matches],
        threshold: float,
        *,
        kinds: Sequence[str] = KINDS,
        names: Sequence[str] | None = None,
        extended: bool = True,
        streams: Mapping[Pair, Mapping[str, Stream]] | None = None,
    ) -> dict[tuple[Pair, str], Labelled]:
        """Labels and truth of every stream of some kinds, of some classes."""
        result = {}
        for (pair, kind), found in matches.items():
            if kind not in kinds:
                continue
            stream = (streams or self.streams)[pair][kind]
            labels = labels_at(found, threshold, names=names, extended=extended)
            truth = stream.known_to(names or self.names)
            result[pair, kind] = Labelled(labels, truth, stream.seconds)
        return result


def measure(recordings: Recordings) -> Results:
    """Choice on five pairs, report on the other five, and what would change."""
    bench = _Bench(recordings)
    choice, matches = _choose(bench)
    by_way = {way: _best_choice(choice, way) for way in WAYS}
    chosen = _best_choice(choice)
    setting, threshold = CHOICES[chosen["setting"]], chosen["threshold"]
    draws = _draws(bench.names)
    closed, opened = {}, {}
    for way, own in by_way.items():
        closed[way] = _closed(bench, CHOICES[own["setting"]], own["threshold"])
        opened[way] = _open(bench, CHOICES[own["setting"]], own["threshold"], draws)
    return {
        "thresholds": THRESHOLDS,
        "streams": _describe(bench),
        "other": [list(row) for row in AMC_SEGMENTS],
        "bandai": sorted(part.name for part in other_motion(recordings, "bvh")),
        "choice": choice,
        "chosen": chosen,
        "chosen_by_way": by_way,
        "draws": draws,
        "closed": closed,
        "open": opened,
        "changes": _changes(bench, recordings, setting, threshold, matches[chosen["setting"]]),
        "false": _where_false(bench, matches[chosen["setting"]], threshold),
        "pairs": {"choosing": CHOOSING, "reporting": REPORTING},
    }


def _choose(bench: _Bench) -> tuple[Results, dict[str, dict[tuple[Pair, str], Matches]]]:
    """Each setting at its threshold with the best mean of F1 and F2, all classes known."""
    table, found = {}, {}
    for name, setting in CHOICES.items():
        found[name] = bench.find(setting, CHOOSING)
        curve = {t: measure_labels(list(bench.label(found[name], t).values())) for t in THRESHOLDS}
        best = best_of(curve)
        table[name] = {"threshold": best, **curve[best]}
    return table, found


def _best_choice(choice: Results, way: str = "") -> Results:
    """Best setting, of those that weigh in one way."""
    name = max((name for name in choice if name.startswith(way)), key=lambda n: merit(choice[n]))
    return {"setting": name, "threshold": choice[name]["threshold"]}


def _draws(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Which classes are known: seeded."""
    rng = np.random.default_rng(SEED)
    return [tuple(sorted(rng.permutation(names)[:N_KNOWN].tolist())) for _ in range(N_DRAWS)]


def _closed(bench: _Bench, setting: Setting, threshold: float) -> Results:
    matches = bench.find(setting, REPORTING)
    return {
        "curves": {
            kind: [measure_labels(list(bench.label(matches, t, kinds=[kind]).values()))
                   for t in THRESHOLDS]
            for kind in KINDS
        },
        **_report([bench.label(matches, threshold)]),
        "pooled": [measure_labels(list(bench.label(matches, t).values())) for t in THRESHOLDS],
    }  # fmt: skip


def _open(
    bench: _Bench, setting: Setting, threshold: float, draws: Sequence[Sequence[str]]
) -> Results:
    """Six classes known, clips of the others are other motion; all draws pooled."""
    matches = [bench.find(setting, REPORTING, names=names) for names in draws]

    def labelled(threshold: float, kinds: Sequence[str]) -> Iterator[Any]:
        for names, found in zip(draws, matches, strict=True):
            yield bench.label(found, threshold, kinds=kinds, names=names)

    curves = {
        kind: [
            measure_labels([one for draw in labelled(t, [kind]) for one in draw.values()])
            for t in THRESHOLDS
        ]
        for kind in KINDS
    }
    pooled = [
        measure_labels([one for draw in labelled(t, KINDS) for one in draw.values()])
        for t in THRESHOLDS
    ]
    of_draws = [measure_labels(list(draw.values())) for draw in labelled(threshold, KINDS)]
    return {
        "curves": curves,
        "pooled": pooled,
        "by_draw": [{key: one[key] for key in ("F1", "F2")} for one in of_draws],
        **_report(list(labelled(threshold, KINDS))),
    }


def _report(draws: Sequence[Mapping[tuple[Pair, str], Labelled]]) -> Results:
    """All measures at the chosen threshold: AMC, BVH, both; with intervals over actors."""
    rows = {}
    for title, kinds in {"amc": ["amc"], "bvh": ["bvh"], "both": list(KINDS)}.items():
        chosen = {
            f"{number} {'+'.join(pair)} {kind}": (pair, one)
            for number, draw in enumerate(draws)
            for (pair, kind), one in draw.items()
            if kind in kinds
        }
        scores = evaluate(
            {name: one.predicted for name, (_, one) in chosen.items()},
            {name: one.truth for name, (_, one) in chosen.items()},
            durations_s={name: one.seconds for name, (_, one) in chosen.items()},
        )
        values: dict[str, dict[Pair, list[float]]] = {"F1": {}, "F2": {}}
        for name, (pair, _) in chosen.items():
            one = scores.recordings[name]
            values["F1"].setdefault(pair, []).append(one.frames.f)
            values["F2"].setdefault(pair, []).append(one.segments.f)
        rows[title] = {
            **scores.concatenated.as_dict(),
            "intervals": {key: interval_over_actors(own) for key, own in values.items()},
            "classes": {name: _short(one) for name, one in scores.classes.items()},
        }
    return {"report": rows}


def _short(one: Measures) -> dict[str, Any]:
    return {"frames": list(one.frames), "segments": list(one.segments)}


def _changes(
    bench: _Bench,
    recordings: Recordings,
    setting: Setting,
    threshold: float,
    matches: Mapping[tuple[Pair, str], Matches],
) -> Results:
    """F1 and F2 on the pairs for choosing, if one thing is changed."""
    alone = {pair: clips_alone(recordings, pair, seed=SEED) for pair in CHOOSING}
    others = tuple(name for name in bench.names if name not in NEAR)
    rows = {"as chosen": _row(bench, matches, threshold)}
    for name, change in CHANGES.items():
        rows[name] = _row(bench, bench.find(setting._replace(**change), CHOOSING), threshold)
    rows["labels not extended"] = _row(bench, matches, threshold, extended=False)
    rows["without sneaking, grabbing and throwing"] = _row(bench, matches, threshold, names=others)
    of_clips = bench.find(setting, CHOOSING, streams=alone)
    single = {"kinds": ["clips"], "streams": alone}
    rows["clips alone, nothing between"] = _row(bench, of_clips, threshold, **single)
    rows["clips alone, labels not extended"] = _row(
        bench, of_clips, threshold, extended=False, **single
    )
    return rows


def _row(
    bench: _Bench, matches: Mapping[tuple[Pair, str], Matches], threshold: float, **more: Any
) -> Results:
    curve = {t: measure_labels(list(bench.label(matches, t, **more).values())) for t in THRESHOLDS}
    best = best_of(curve)
    return {"same": curve[threshold], "best_threshold": best, "best": curve[best]}


def _where_false(
    bench: _Bench, matches: Mapping[tuple[Pair, str], Matches], threshold: float
) -> list[list[Any]]:
    """False labels by class and by what they lie on most; recordings of a kind together."""
    counts: Counter[tuple[str, str]] = Counter()
    for (pair, kind), one in bench.label(matches, threshold).items():
        stream = bench.streams[pair][kind]
        parts = [(s.name, s.start, s.end) for s in (*stream.truth, *stream.others)]
        for x in one.predicted:
            common = [(min(x.end, b) - max(x.start, a), name) for name, a, b in parts]
            if not any(name == x.name and length > 1e-6 for length, name in common):
                counts[x.name, _kind_of(max(common)[1])] += 1
    return [[name, place, n] for (name, place), n in counts.most_common(14)]


def _kind_of(name: str) -> str:
    """A recording's name without style and number."""
    return "_".join(name.split("_")[:-2]) if name.startswith("bandai/") else name


def _describe(bench: _Bench) -> Results:
    return {
        kind: {
            "seconds": [round(own[kind].seconds) for own in bench.streams.values()],
            "clips": [len(own[kind].truth) for own in bench.streams.values()],
            "share_of_clips": float(
                sum(s.end - s.start for own in bench.streams.values() for s in own[kind].truth)
                / sum(own[kind].seconds for own in bench.streams.values())
            ),
        }
        for kind in KINDS
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
