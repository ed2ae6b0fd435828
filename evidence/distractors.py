"""Classes found between their clips and everything else at hand."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from evidence.common.drawing import Panel, draw_panels
from evidence.common.ranking import clip_costs, corpus_of, hits_of, patterns_by_setting
from evidence.common.recordings import Clip, Recordings, Results, clips_packed
from motionary.features import FeatureSequence
from motionary.matching import Pattern

TITLE = "Classes among everything else at hand"
SPLIT = (
    "templates are learned from the authors' training half; the evaluation half and all other "
    "recordings are searched"
)
SEED = 0
DATA = (
    "clips",
    ("of these searched: the evaluation half, 142 clips", lambda r: clips_packed(r.halves()[1])),
    ("distractors, {cmu}", "cmu"),
    ("distractors, uncut takes of HDM05", "hdm05_takes"),
    ("distractors, {bandai}", "bandai"),
)

RECALLS = (0.5, 0.8, 0.9, 1.0)
SHOWN_FALSE = 3
#: A take from which a clip was cut: class, recording, and the frames of the clip in it.
CUT_FROM = ("throwBasketball", "hdm05_takes/HDM_bd_03-03_01_120.amc", 443, 585)


class Found(NamedTuple):
    """A hit: what it costs, where it is, and the number of the clip, -1 in a distractor."""

    cost: float
    recording: str
    clip: int


def measure(recordings: Recordings) -> Results:
    """Precision at recall by class, without and with distractors."""
    train, test = recordings.halves()
    results = {
        setting: {
            name: _class(pattern, name, test, recordings.others)
            for name, pattern in patterns.items()
        }
        for setting, patterns in patterns_by_setting(train).items()
    }
    return {"recalls": RECALLS, "settings": results}


def _class(
    pattern: Pattern, name: str, test: Sequence[Clip], others: Mapping[str, FeatureSequence]
) -> dict[str, Any]:
    relevant = [i for i, clip in enumerate(test) if clip.motion_class == name]
    costs = clip_costs({name: pattern}, corpus_of(clips_packed(test)))[:, 0]
    # Hits that cost more than the last clip of the class count for no recall.
    most = max(costs[i] for i in relevant if np.isfinite(costs[i]))
    hits = _hits(pattern, {c.name: c.packed for c in test}, most, clips=True)
    distracting = _hits(pattern, others, most, clips=False)
    return {
        "clips": len(relevant),
        "alone": _precisions(hits, relevant),
        "among": _precisions(hits + distracting, relevant),
        "false_before_half": _first_false(hits + distracting, relevant),
    }


def _hits(
    pattern: Pattern, recordings: Mapping[str, FeatureSequence], most: float, *, clips: bool
) -> list[Found]:
    names = list(recordings)
    return [
        Found(hit.cost, names[i], i if clips else -1)
        for i, hit in hits_of(pattern, list(recordings.values()), threshold=most)
        if not (names[i] == CUT_FROM[1] and hit.start < CUT_FROM[3] and hit.stop > CUT_FROM[2])
    ]


def _precisions(hits: Sequence[Found], relevant: Sequence[int]) -> list[float | None]:
    """Precision where so much recall is reached; None if it never is.

    Of several hits in one clip of the class the first is right and the others are left out;
    of equal costs the false come first.
    """
    ranked = _rank(hits, set(relevant))
    right = np.cumsum(ranked)
    precision = right / np.arange(1, len(ranked) + 1)
    result: list[float | None] = []
    for recall in RECALLS:
        needed = int(np.ceil(recall * len(relevant) - 1e-9))
        at = int(np.searchsorted(right, needed))
        result.append(float(precision[at]) if at < len(right) else None)
    return result


def _rank(hits: Sequence[Found], relevant: set[int]) -> list[bool]:
    seen: set[int] = set()
    ranked = []
    for hit in sorted(hits, key=lambda h: (h.cost, h.clip in relevant, h.recording)):
        if hit.clip in seen:
            continue
        if hit.clip in relevant:
            seen.add(hit.clip)
        ranked.append(hit.clip in relevant)
    return ranked


def _first_false(hits: Sequence[Found], relevant: Sequence[int]) -> list[dict[str, Any]]:
    """The cheapest false hits, one per recording."""
    shown: dict[str, float] = {}
    for hit in sorted(hits):
        if hit.clip not in relevant:
            shown.setdefault(hit.recording, hit.cost)
    first = list(shown.items())[:SHOWN_FALSE]
    return [{"recording": name, "cost": cost} for name, cost in first]


def mean_precisions(classes: Mapping[str, Any], where: str) -> list[float]:
    """Means over the classes; recall that is never reached counts as precision 0."""
    rows = [[value or 0.0 for value in row[where]] for row in classes.values()]
    return [float(value) for value in np.mean(rows, axis=0)]


def draw(results: Results) -> dict[str, Any]:
    """Precision over recall by class."""
    panels = []
    for name in results["settings"]["by surprise"]:
        curves = {
            setting: (results["recalls"], classes[name]["among"])
            for setting, classes in results["settings"].items()
        }
        panels.append(Panel(name, curves, "recall", "precision", (0, 1.04)))
    return {"distractors": draw_panels(panels, columns=4, size=(2.3, 1.6))}
