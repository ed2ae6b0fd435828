"""Frames classified one by one, beside labels by templates.

Labelled are clips of two people that nothing was learned from, and motion of CMU that holds
none of the classes. Both ways label every frame with a class or none.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.baselines import FrameClassifier, position_windows, train_frame_classifier
from evidence.common.examples import Frames, smallest
from evidence.common.ranking import TOLERANCE_2006, clip_costs, corpus_of, patterns_of, templates_of
from evidence.common.recordings import ACTORS, Clip, Recordings, clips_packed, examples
from evidence.common.streams import AMC_SEGMENTS, CHOOSING, REPORTING
from motionary.evaluation import score_classification
from motionary.features import FeatureSequence
from motionary.models.library import TrainingOptions, learn_classes
from motionary.retrieval.annotation import annotate

Floats = NDArray[np.float64]
Codes = NDArray[np.intp]

NONE = -1
COSTS = (0.05, 0.07, 0.09, 0.12, 0.15, 0.2)
SCORES = tuple(np.round(np.arange(-1.0, 1.0, 0.1), 1).tolist())


class Item(NamedTuple):
    """Features and windows of a recording; `label` is its class, or empty."""

    label: str
    packed: FeatureSequence
    windows: Floats


def windows_of(recordings: Recordings) -> dict[str, Floats]:
    """Windows of all clips by name."""
    return {c.name: position_windows(recordings.motion(c.name)) for c in recordings.clips}


def train(clips: Sequence[Clip], windows: Mapping[str, Floats]) -> FrameClassifier:
    """A machine of some clips."""
    trained: dict[str, list[Any]] = {}
    for clip in clips:
        trained.setdefault(clip.motion_class, []).append(windows[clip.name])
    return train_frame_classifier(trained)


def score_clips(
    machine: FrameClassifier, clips: Sequence[Clip], windows: Mapping[str, Floats]
) -> dict[str, float]:
    """Fraction of frames, and of clips by their mean score, that get the right class."""
    right = frames = clips_right = 0
    for clip in clips:
        scores = machine.scores(windows[clip.name])
        code = machine.names.index(clip.motion_class)
        right += int((scores.argmax(axis=1) == code).sum())
        frames += len(scores)
        clips_right += int(scores.mean(axis=0).argmax() == code)
    return {"frames": right / frames, "clips": clips_right / len(clips)}


def label_among_others(recordings: Recordings, windows: Mapping[str, Floats]) -> dict[str, Any]:
    """F of frames at the threshold chosen on half of the pairs of people, by way."""
    others = _others(recordings)
    found: dict[str, list[list[Floats]]] = {"frames": [], "templates": []}
    for pair in (*CHOOSING, *REPORTING):
        learned = recordings.of(actors=set(ACTORS) - set(pair))
        items = others + [
            Item(c.motion_class, c.packed, windows[c.name]) for c in recordings.of(actors=pair)
        ]
        names = recordings.classes
        found["frames"].append(_by_frames(train(learned, windows), items, names))
        found["templates"].append(_by_templates(learned, items, names))
    return {way: _chosen(rows, way) for way, rows in found.items()} | {
        "minutes of others": sum(len(d.packed) for d in others) / 1800
    }


def _others(recordings: Recordings) -> list[Item]:
    items = []
    for name, start_s, end_s, _ in AMC_SEGMENTS:
        packed = recordings.others[name]
        first, stop = round(start_s * 30), min(round(end_s * 30), len(packed))
        windows = position_windows(recordings.motion(name))[first:stop]
        items.append(Item("", packed.part(first, stop), windows))
    return items


def _by_frames(
    machine: FrameClassifier, items: Sequence[Item], names: Sequence[str]
) -> list[Floats]:
    """Counts at each threshold: rows (right, predicted, true, segments, true segments)."""
    scores = [machine.scores(item.windows) for item in items]
    rows = []
    for threshold in SCORES:
        labels = [np.where(s.max(axis=1) > threshold, s.argmax(axis=1), NONE) for s in scores]
        rows.append(_count(labels, items, names))
    return rows


def _by_templates(
    clips: Sequence[Clip], items: Sequence[Item], names: Sequence[str]
) -> list[Floats]:
    library = learn_classes(examples(clips), training=TrainingOptions(mirror=False))
    rows = []
    for threshold in COSTS:
        labels = []
        for item in items:
            label = np.full(len(item.packed), NONE)
            for one in annotate(item.packed, library, threshold=threshold, preselect=False):
                label[round(one.start_s * 30) : round(one.end_s * 30)] = names.index(one.name)
            labels.append(label)
        rows.append(_count(labels, items, names))
    return rows


def _count(labels: Sequence[Codes], items: Sequence[Item], names: Sequence[str]) -> Floats:
    total = np.zeros(5)
    for label, item in zip(labels, items, strict=True):
        true = names.index(item.label) if item.label else NONE
        n_runs = int((np.diff(label, prepend=NONE - 1) != 0)[label != NONE].sum())
        total += [
            ((label == true) & (label != NONE)).sum(),
            (label != NONE).sum(),
            len(label) if true != NONE else 0,
            n_runs,
            true != NONE,
        ]
    return total


def _chosen(rows: Sequence[Sequence[Floats]], way: str) -> dict[str, float]:
    """Measures on the reporting pairs, at the threshold that is best on the choosing ones."""
    counts = np.array(rows)
    choosing = counts[: len(CHOOSING)].sum(axis=0)
    best = int(np.argmax([_measures(one)["f"] for one in choosing]))
    threshold = (SCORES if way == "frames" else COSTS)[best]
    return _measures(counts[len(CHOOSING) :, best].sum(axis=0)) | {"threshold": threshold}


def _measures(counts: Floats) -> dict[str, float]:
    right, predicted, true, runs, clips = counts.tolist()
    precision, recall = right / max(predicted, 1), right / true
    return {
        "precision": precision,
        "recall": recall,
        "f": 2 * right / (predicted + true),
        "labels a clip": runs / clips,
    }


def right_class(
    recordings: Recordings,
    learned: Sequence[Clip],
    tested: Sequence[Clip],
    windows: Mapping[str, Floats],
) -> dict[str, float]:
    """Fraction of clips that get their class: nearest template, nearest example, frames."""
    names = recordings.classes
    truth = [clip.motion_class for clip in tested]
    patterns = patterns_of(templates_of(learned), tolerance=TOLERANCE_2006)
    costs = clip_costs(patterns, corpus_of(clips_packed(tested)))
    result = {"MT": score_classification(costs, truth, names=names).accuracy}
    for way in ("RF", "3D heading"):
        frames = Frames(recordings, [*learned, *tested], way)
        among = frames.join(tested)
        nearest = np.full((len(tested), len(names)), np.inf)
        for query in learned:
            column = names.index(query.motion_class)
            cost = smallest(frames.distance(query, among), tested)
            nearest[:, column] = np.minimum(nearest[:, column], cost)
        result[f"{way} all"] = score_classification(nearest, truth, names=names).accuracy
    by_frame = score_clips(train(learned, windows), tested, windows)
    return result | {"frames: clips": by_frame["clips"], "frames: frames": by_frame["frames"]}
