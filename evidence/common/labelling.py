"""How do labels change with the threshold?

Matches up to a large cost are computed once per class; for each threshold only the
decision between the classes is made anew. `annotate` with that threshold gives the same.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from evidence.common.recordings import Clip, examples
from motionary.annotation import ClassDistance, class_distance
from motionary.evaluation import Segment
from motionary.features import FeatureSequence
from motionary.library import MotionClass, Teaching, learn_classes
from motionary.matching import SKIP_WEIGHT, annotate_distances, find_runs, modify


class Setting(NamedTuple):
    """How classes are sought.

    Attributes
    ----------
    by_surprise : what is rare weighs more; all alike otherwise, as published
    tolerance : δ
    mirrored : with the mirror images of the templates
    skip_weight : how often the cell after a (2, 1) step counts
    extended : whether labels are extended while the class's own distance does not rise
    """

    by_surprise: bool = True
    tolerance: float = 0.05
    mirrored: bool = True
    skip_weight: float = SKIP_WEIGHT
    extended: bool = True


class Sought(NamedTuple):
    """Matches of several classes in one recording, up to a large cost."""

    names: tuple[str, ...]
    distances: tuple[ClassDistance, ...]
    n_frames: int


def learn_all(clips: Iterable[Clip]) -> tuple[MotionClass, ...]:
    """Classes with mirror images, weighed by surprise; see `with_setting`."""
    return learn_classes(examples(clips), teaching=Teaching(mirror=True)).classes


def with_setting(classes: Sequence[MotionClass], setting: Setting) -> tuple[MotionClass, ...]:
    """The same classes as they would have been learned under another setting."""
    return tuple(
        replace(
            one,
            background=one.background if setting.by_surprise else (),
            tolerance=setting.tolerance,
            subclasses=one.subclasses if setting.mirrored else one.subclasses[:1],
        )
        for one in classes
    )


def seek(
    words: FeatureSequence,
    classes: Sequence[MotionClass],
    *,
    most: float,
    setting: Setting,
) -> Sought:
    """Matches of classes that a setting was given, up to a cost of `most`."""
    distances = [
        class_distance(words, one, threshold=most, skip_weight=setting.skip_weight)
        for one in classes
    ]
    return Sought(tuple(one.name for one in classes), tuple(distances), len(words))


def labels_at(
    sought: Sought,
    thresholds: float | Mapping[str, float],
    *,
    names: Sequence[str] | None = None,
    extended: bool = True,
) -> list[Segment]:
    """Labels with one threshold, or one per class; of some classes only."""
    chosen = [
        (name, distance)
        for name, distance in zip(sought.names, sought.distances, strict=True)
        if names is None or name in names
    ]
    modified = []
    for name, distance in chosen:
        most = thresholds if isinstance(thresholds, int | float) else thresholds[name]
        matches = [m.alignment for m in distance.matches if m.alignment.cost <= most]
        modified.append(modify(matches, n_frames=sought.n_frames)[0])
    stretches: list[tuple[int, int, int]] = (
        [tuple(segment) for segment in annotate_distances(modified)]
        if extended
        else _not_extended(modified)
    )
    return [
        Segment(chosen[index][0], start / 30, stop / 30, float(modified[index][start:stop].min()))
        for index, start, stop in stretches
    ]


def _not_extended(modified: Sequence[Any]) -> list[tuple[int, int, int]]:
    matrix = np.array(modified)
    best = np.where(np.isfinite(matrix.min(axis=0)), matrix.argmin(axis=0), -1)
    return [run for run in find_runs(best) if run[0] >= 0]
