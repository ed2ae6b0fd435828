"""Labels at many thresholds.

Matches up to a large cost are computed once per class; for each threshold only the
decision between the classes is made anew. `annotate` with that threshold gives the same.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.recordings import ACTORS, Clip, Recordings, examples
from evidence.common.streams import Stream
from motionary.evaluation import (
    LabelledSegment,
    compute_mean_average_precision,
    compute_rates,
    count_false,
    count_frames,
    count_overlaps,
    interval,
    pool_counts,
)
from motionary.features import FULL_BODY, FeatureSequence
from motionary.matching import SKIP_WEIGHT, Alignment, annotate_distances, distance_function, modify
from motionary.models.library import (
    ClassLibrary,
    MotionClass,
    TrainingOptions,
    learn_classes,
    measure_background,
    mix_prior,
    scoring_for,
)
from motionary.recording import split_runs
from motionary.retrieval.annotation import annotate
from motionary.retrieval.labelling import ClassDistance, class_distance

#: Overlap at which average precision is reported.
IOU = 0.5


class Setting(NamedTuple):
    """How classes are searched for.

    Attributes
    ----------
    by_self_information : what is rare weighs more; all alike otherwise, as published
    tolerance : δ
    mirrored : with the mirror images of the templates
    skip_weight : how often the cell after a (2, 1) step counts
    extended : whether labels are extended while the class's own distance does not rise
    to_plateau_end : whether a match goes on as long as it costs the same
    """

    by_self_information: bool = True
    tolerance: float = 0.05
    mirrored: bool = False
    skip_weight: float = SKIP_WEIGHT
    extended: bool = True
    to_plateau_end: bool = False


class Matches(NamedTuple):
    """Matches of several classes in one recording, up to a large cost."""

    matches: Mapping[str, Sequence[Alignment]]
    n_frames: int


class Labelled(NamedTuple):
    """Labels of a recording, what is true, and its length."""

    predicted: Sequence[LabelledSegment]
    truth: Sequence[LabelledSegment]
    seconds: float


class Task(NamedTuple):
    """What is labelled, what is true of it, and what classes are learned from."""

    packed: FeatureSequence
    truth: Sequence[LabelledSegment]
    clips: Sequence[Clip]
    learned: Sequence[MotionClass]

    @property
    def seconds(self) -> float:
        """Length."""
        return len(self.packed) / 30


Tasks = Mapping[Any, Task]
Found = Mapping[Any, Matches]
Pair = tuple[str, str]


def tasks_of(
    recordings: Recordings, streams: Mapping[Pair, Mapping[str, Stream]]
) -> dict[tuple[Pair, str], Task]:
    """Streams of pairs of actors by pair and kind, learned from the other actors."""
    tasks = {}
    for pair, kinds in streams.items():
        clips = recordings.of(actors=set(ACTORS) - set(pair))
        learned = learn_all(clips)
        for kind, stream in kinds.items():
            tasks[pair, kind] = Task(stream.packed, stream.truth, clips, learned)
    return tasks


def find_all(
    tasks: Tasks, setting: Setting, *, most: float, names: Collection[str] = ()
) -> dict[Any, Matches]:
    """Matches in every task, of all classes by default."""
    found = {}
    for key, task in tasks.items():
        known = [one for one in task.learned if not names or one.name in names]
        classes = with_setting(known, setting, task.clips)
        found[key] = find_matches(task.packed, classes, most=most, setting=setting)
    return found


def label_all(
    tasks: Tasks,
    found: Found,
    thresholds: float | Mapping[str, float],
    *,
    names: Sequence[str] | None = None,
    extended: bool = True,
) -> dict[Any, Labelled]:
    """Labels of every task in which something was found; of some classes only."""
    result = {}
    for key, matches in found.items():
        task = tasks[key]
        truth = [s for s in task.truth if names is None or s.name in names]
        labels = labels_at(matches, thresholds, names=names, extended=extended)
        result[key] = Labelled(labels, truth, task.seconds)
    return result


def label_by_scores(tasks: Tasks, *, names: Sequence[str] | None = None) -> dict[Any, Labelled]:
    """Labels of every task by scores, the default, with mirror images; of some classes only."""
    scoring = scoring_for(FULL_BODY)
    found = {}
    for key, task in tasks.items():
        clips = [c.packed for c in task.clips if names is None or c.motion_class in names]
        prior = mix_prior(clips, scoring, mirror=True)
        known = [one for one in task.learned if names is None or one.name in names]
        library = ClassLibrary(
            tuple(replace(one, prior=prior) for one in known), FULL_BODY, scoring=scoring
        )
        track = annotate(task.packed, library, assignment="scores")
        labels = [LabelledSegment(x.name, x.start_s, x.end_s) for x in track]
        truth = [s for s in task.truth if names is None or s.name in names]
        found[key] = Labelled(labels, truth, task.seconds)
    return found


def curve_of(
    tasks: Tasks, found: Found, thresholds: Iterable[float], **how: Any
) -> dict[float, dict[str, float]]:
    """Measures over all tasks at each threshold."""
    return {t: measure(label_all(tasks, found, t, **how).values()) for t in thresholds}


def of_kind(found: Mapping[Any, Any], kind: str) -> dict[Any, Any]:
    """What is of one kind of streams."""
    return {key: one for key, one in found.items() if key[1] == kind}


def learn_all(clips: Iterable[Clip]) -> tuple[MotionClass, ...]:
    """Classes with mirror images; `with_setting` says how they are searched for."""
    return learn_classes(examples(clips), training=TrainingOptions(mirror=True)).classes


def with_setting(
    classes: Sequence[MotionClass], setting: Setting, clips: Sequence[Clip]
) -> tuple[MotionClass, ...]:
    """Classes as they would have been learned under another setting.

    Parameters
    ----------
    classes : from `learn_all`, or some of them
    clips : the examples; what is rare is measured on those of `classes` alone
    """
    names = {one.name for one in classes}
    background: tuple[float, ...] = ()
    if setting.by_self_information:
        known = examples(clip for clip in clips if clip.motion_class in names)
        background = measure_background(known, training=TrainingOptions(mirror=setting.mirrored))
    return tuple(
        replace(
            one,
            background=background,
            tolerance=setting.tolerance,
            prototypes=one.prototypes if setting.mirrored else one.prototypes[:1],
        )
        for one in classes
    )


def find_matches(
    packed: FeatureSequence, classes: Sequence[MotionClass], *, most: float, setting: Setting
) -> Matches:
    """Matches of classes that a setting was given, up to a cost of `most`."""
    matches = {}
    for one in classes:
        found = class_distance(packed, one, threshold=most, skip_weight=setting.skip_weight)
        matches[one.name] = (
            _to_plateau_ends(packed, found, setting)
            if setting.to_plateau_end
            else [match.alignment for match in found.matches]
        )
    return Matches(matches, len(packed))


def _to_plateau_ends(
    packed: FeatureSequence, found: ClassDistance, setting: Setting
) -> list[Alignment]:
    """Matches, each to the last frame at which it costs no more."""
    curves: dict[int, NDArray[np.float32]] = {}
    longer = []
    for match in found.matches:
        curve = curves.get(id(match.pattern))
        if curve is None:
            curve = distance_function(
                match.pattern, packed.packed, packed.known, skip_weight=setting.skip_weight
            )
            curves[id(match.pattern)] = curve
        end = match.alignment.end
        other = np.flatnonzero(curve[end:] != curve[end])
        last = end + int(other[0]) - 1 if len(other) else len(curve) - 1
        longer.append(match.alignment._replace(end=last))
    return longer


def labels_at(
    found: Matches,
    thresholds: float | Mapping[str, float],
    *,
    names: Sequence[str] | None = None,
    extended: bool = True,
) -> list[LabelledSegment]:
    """Labels with one threshold, or one per class; of some classes only."""
    chosen = [name for name in found.matches if names is None or name in names]
    modified = []
    for name in chosen:
        most = thresholds if isinstance(thresholds, int | float) else thresholds[name]
        matches = [match for match in found.matches[name] if match.cost <= most]
        modified.append(modify(matches, n_frames=found.n_frames)[0])
    segments = (
        [(s.class_index, *s.frames) for s in annotate_distances(modified)]
        if extended
        else _not_extended(modified)
    )
    return [
        LabelledSegment(
            chosen[index], start / 30, stop / 30, float(modified[index][start:stop].min())
        )
        for index, start, stop in segments
    ]


def _not_extended(modified: Sequence[NDArray[np.float64]]) -> list[tuple[int, int, int]]:
    matrix = np.array(modified)
    best = np.where(np.isfinite(matrix.min(axis=0)), matrix.argmin(axis=0), -1)
    return [(int(best[a]), a, b) for a, b in split_runs(best) if best[a] >= 0]


def measure(labels: Iterable[Labelled]) -> dict[str, float]:
    """The measures that are drawn against the threshold, over all recordings."""
    labelled = list(labels)
    pairs = [(list(one.predicted), list(one.truth)) for one in labelled]
    frames = compute_rates(pool_counts(c for pair in pairs for c in count_frames(*pair).values()))
    segments = compute_rates(
        pool_counts(c for pair in pairs for c in count_overlaps(*pair).values())
    )
    minutes = sum(one.seconds for one in labelled) / 60
    average = compute_mean_average_precision(
        [one.predicted for one in labelled], [one.truth for one in labelled], ious=(IOU,)
    )
    return {
        "P1": frames.precision, "R1": frames.recall, "F1": frames.f,
        "P2": segments.precision, "R2": segments.recall, "F2": segments.f,
        "mean_average_precision": float(average[0]),
        "false_per_minute": sum(count_false(*pair) for pair in pairs) / minutes,
    }  # fmt: skip


def best_of(curve: Mapping[float, Mapping[str, float]]) -> float:
    """Threshold with the best mean of F1 and F2; of equal ones the least."""
    return max(sorted(curve), key=lambda threshold: merit(curve[threshold]))


def merit(scores: Mapping[str, float]) -> float:
    """Mean of F1 and F2."""
    return (scores["F1"] + scores["F2"]) / 2


def interval_over_actors(values: Mapping[tuple[str, str], Sequence[float]]) -> dict[str, Any]:
    """Mean of values by pair of actors, with limits; a value counts for both actors."""
    by_actor: dict[str, list[float]] = {}
    for pair, own in values.items():
        for actor in pair:
            by_actor.setdefault(actor, []).extend(own)
    return interval(by_actor, seed=0)._asdict()
