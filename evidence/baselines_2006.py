"""Templates and the methods that they are compared with: table 4 of Müller and Röder (2006)."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.common.drawing import Panel, draw_panels
from evidence.common.examples import (
    BASELINE,
    INFINITE,
    MOST,
    RANKS,
    Frames,
    as_joined,
    score_distance,
)
from evidence.common.framewise import label_among_others, right_class, windows_of
from evidence.common.ranking import (
    TOLERANCE_2006,
    corpus_of,
    patterns_of,
    template_of,
    templates_of,
)
from evidence.common.recordings import (
    Clip,
    Recordings,
    Results,
    clips_of_2006,
    clips_packed,
    of_class,
)
from evidence.common.running import timed
from evidence.common.streams import AMC_SEGMENTS
from motionary.matching import corpus_distance
from motionary.models.templates import pattern_of, quantise

TITLE = "Templates beside other methods, as table 4 of 2006"
SPLIT = (
    "templates are learned from the authors' training half; up to ten clips a class of the "
    "evaluation half; three people train, two are tested; five pairs of unseen people choose, "
    "five report"
)
SEED = 0
DATA = ("clips", ("segments of {cmu}", (len(AMC_SEGMENTS), 1.3)))

Floats = NDArray[np.float64]

#: As the rows of the publication: templates, relational features, quaternions, 3-D.
WAYS = {
    "MT": "template of all training clips, quantised, masked cost",
    "RF": "features of the first training clip, equal weights, Manhattan distance",
    "Q": "its local rotations as unit quaternions, geodesic distance",
    "3D": "its joints, root, rotation of the root and size removed, Euclidean distance",
    "3D heading": "the same, of the rotation the heading only removed",
}
#: Of five classes in print three are at hand; the last two take the place of the others.
FIVE = ("squat1Reps", "lieDownFloor", "grabHighR", "depositFloorR", "kickLFront1Reps")


def measure(recordings: Recordings) -> Results:
    """Table 4, all examples, nearest examples, and frames one by one."""
    train_half, test = map(clips_of_2006, recordings.halves())
    names = recordings.classes
    chosen = [clip for name in names for clip in of_class(test, name)[:MOST]]
    corpus = corpus_of(clips_packed(chosen))
    relevant = {name: np.array([c.motion_class == name for c in chosen]) for name in names}
    rows: dict[str, dict[str, Any]] = {name: {} for name in names}
    patterns = patterns_of(templates_of(train_half), tolerance=TOLERANCE_2006)
    seconds: dict[str, float] = {}
    distances, seconds["MT"] = timed(
        lambda: {
            n: as_joined(corpus_distance(p, corpus, engine="numpy")) for n, p in patterns.items()
        }
    )
    for name in names:
        rows[name]["MT"] = score_distance(distances[name], chosen, relevant[name])
    for way in BASELINE:
        seconds[way] = _examples(recordings, way, train_half, chosen, relevant, rows)
    packed = [pattern_of(quantise(template_of([c.packed]), tolerance=0.0)) for c in train_half]
    _, seconds["all packed"] = timed(
        lambda: [corpus_distance(pattern, corpus, engine="numpy") for pattern in packed]
    )
    windows = windows_of(recordings)
    return {
        "classes": rows,
        "of_class": {name: int(relevant[name].sum()) for name in names},
        "clips": len(chosen),
        "examples": len(train_half),
        "frames": int(sum(len(c.packed) for c in chosen)),
        "seconds": seconds,
        "right": {
            "halves": right_class(recordings, train_half, test, windows),
            "three people, two unseen": right_class(
                recordings,
                clips_of_2006(recordings.of(actors=("bd", "bk", "dg"))),
                clips_of_2006(recordings.of(actors=("mm", "tr"))),
                windows,
            ),
        },
        "among others": label_among_others(recordings, windows),
    }


def _examples(
    recordings: Recordings,
    way: str,
    train_half: Sequence[Clip],
    chosen: Sequence[Clip],
    relevant: Mapping[str, NDArray[np.bool_]],
    rows: dict[str, dict[str, Any]],
) -> float:
    """Fill in the rows of one way: first example, mean of all, and all together."""
    frames = Frames(recordings, [*train_half, *chosen], way)
    among = frames.join(chosen)
    total = 0.0
    for name, flags in relevant.items():
        queries = of_class(train_half, name)
        distances, taken = timed(partial(frames.distances, queries, among))
        total += taken
        rows[name][way] = score_distance(distances[0], chosen, flags)
        each = [score_distance(one, chosen, flags)["average_precision"] for one in distances]
        rows[name][way]["mean_average_precision"] = float(np.mean(each))
        rows[name][f"{way} all"] = score_distance(np.min(distances, axis=0), chosen, flags)
    return total


def medians_of(classes: Mapping[str, Any]) -> dict[str, float]:
    """Median separation of each way; infinite where right hits cost nothing."""
    return {
        way: float(np.median([_separation(row[way]["separation"]) for row in classes.values()]))
        for way in classes[FIVE[0]]
    }


def means_of(classes: Mapping[str, Any], key: str = "average_precision") -> dict[str, float]:
    """Mean of a measure over the classes, of the ways that have it."""
    return {
        way: float(np.mean([row[way][key] for row in classes.values()]))
        for way, cells in classes[FIVE[0]].items()
        if key in cells
    }


def ranked_better(classes: Mapping[str, Any]) -> dict[str, list[str]]:
    """Classes that a single example ranks better than the template, and by which way."""
    better = {
        name: [w for w in WAYS if _ap(row, w) > _ap(row, "MT") + 0.004]
        for name, row in classes.items()
    }
    return {name: ways for name, ways in better.items() if ways}


def best_of_all(means: Mapping[str, float]) -> str:
    """Way that ranks best with all examples."""
    return max(BASELINE, key=lambda way: means[f"{way} all"])


def _ap(row: Mapping[str, Any], way: str) -> float:
    return float(row[way]["average_precision"])


def _separation(value: float | str | None) -> float:
    return np.inf if value == INFINITE else float("nan" if value is None else value)


def draw(results: Results) -> dict[str, Any]:
    """Right clips among the first hits."""
    panels = [
        Panel(
            name,
            {way: (RANKS, results["classes"][name][way]["first"])
             for way in ("MT", "RF", "Q", "3D")},
            "first hits", "right" if i == 0 else "", (0, 10.5),
        )
        for i, name in enumerate(FIVE)
    ]  # fmt: skip
    return {"baselines_2006": draw_panels(panels, columns=5, size=(1.75, 1.9))}
