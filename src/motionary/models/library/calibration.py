"""Thresholds calibrated by cross-validation: below which cost a match is believed.

What is learned from a fold is tried on what it holds out, in a stream: held-out examples
stand between each other and between pieces of other recordings, since every minute of other
motion gives chances for false hits. Matches up to a large cost are kept, so that any
threshold can be judged without matching again.

Of each class the threshold with the best F of segments is taken and, as few examples would
decide by chance, drawn towards the one threshold that is best for all. Precision and recall
are estimated as annotation decides between classes, in each fold with thresholds chosen on
the others.

Conventions: frames are packed features at 30 Hz, segments half-open; seeded.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.batch import Failure, map_ordered
from motionary.errors import InvalidInput
from motionary.evaluation import Counts, LabelledSegment, count_overlaps, pool_counts
from motionary.features import SEQUENCE_HZ, FeatureSequence
from motionary.matching import (
    Alignment,
    align,
    annotate_distances,
    distance_function,
    local_minima,
    modify,
)
from motionary.models.library.classes import TrainingOptions
from motionary.models.library.storage import ClassLibrary
from motionary.models.library.training import (
    Examples,
    Fold,
    learn_class,
    make_folds,
    measure_background,
)
from motionary.models.templates import Learning
from motionary.packing import PackedFeatures

Floats = NDArray[np.float64]

#: Thresholds that are tried.
TRIED = tuple(round(0.005 * step, 3) for step in range(1, 31))
#: Frames of other motion for each frame of the examples, in the recordings to be labelled.
#: Where fewer are at hand, each false hit stands for several.
OTHER_PER_FRAME = 3.0
#: What is common to all classes weighs as much as so many examples.
COMMON_WEIGHS = 20.0
#: Pieces of other recordings, in frames: 2 to 5 s.
_PIECE = (60, 150)
#: Later passes change little, and learning takes most of the time of a fold.
_LEARNING = Learning(max_passes=4)
_NOTHING = Counts(0, 0, 0, 0)


class Calibration(NamedTuple):
    """A threshold, and what to expect of it on examples that were not learned.

    Attributes
    ----------
    threshold : largest cost of a match
    precision : fraction of the labels that are right, in recordings with `OTHER_PER_FRAME`
        as much other motion as examples, as if one more label had been right and one false
    recall : fraction of the examples that are found, with one more found and one more missed
    n_positives : examples that were held out
    negative_minutes : minutes of other motion, other classes included, that they were
        told from
    """

    threshold: float
    precision: float
    recall: float
    n_positives: int
    negative_minutes: float


class Stream(NamedTuple):
    """Packed features of pieces, one after the other.

    Attributes
    ----------
    packed, known : arrays, shape (frames, n_integers)
    truth : where which class is
    other_frames : frames of recordings that are no examples
    """

    packed: PackedFeatures
    known: PackedFeatures
    truth: Sequence[LabelledSegment]
    other_frames: int


class Trial(NamedTuple):
    """Classes learned from a fold, in the stream of what it holds out.

    Attributes
    ----------
    n_frames, other_frames : length of the stream; frames of recordings without the classes
    truth : where which class is
    matches : per class, those up to the largest cost that was asked for
    """

    n_frames: int
    other_frames: int
    truth: Sequence[LabelledSegment]
    matches: Mapping[str, Sequence[Alignment]]


def calibrate_thresholds(
    examples: Examples,
    *,
    training: TrainingOptions | None = None,
    negatives: Sequence[FeatureSequence] = (),
    seed: int = 0,
    jobs: int = 1,
    on_done: Callable[[tuple[int, Fold]], None] | None = None,
) -> dict[str, Calibration]:
    """Threshold for each class of which examples can be held out.

    Parameters
    ----------
    examples : class -> prototype -> packed features
    training : how classes are learned, and which examples are held out together: with
        `groups` of actors the estimates hold for actors never seen. Without, examples are
        dealt at random.
    negatives : other recordings, without any of the classes: the more, the better
    seed : of the folds and the streams
    jobs : processes; the result does not depend on it
    on_done : called after each fold, of which there are `N_FOLDS` at most

    Returns
    -------
    dict of Calibration by class; without classes of which nothing can be held out, or that
    there is nothing to tell from

    Raises
    ------
    InvalidInput
        If `groups` is no regular expression, matches nothing in an example's name, or puts all
        examples into one group.
    """
    options = training or TrainingOptions()
    folds = make_folds(examples, groups=options.groups, seed=seed)
    work = partial(
        run_trial,
        others=negatives,
        other_per_frame=OTHER_PER_FRAME,
        training=options,
        most_cost=TRIED[-1],
        seed=seed,
    )
    trials: list[Trial] = []
    for trial in map_ordered(work, enumerate(folds), jobs=jobs, on_done=on_done):
        if isinstance(trial, Failure):
            raise trial.error
        trials.append(trial)
    other_frames_of = _count_other_frames(trials)
    names = [name for name in examples if other_frames_of[name] > 0]
    if not names:
        return {}
    total = sum(trial.n_frames for trial in trials)
    of_examples = total - sum(trial.other_frames for trial in trials)
    # So many false hits one of the streams stands for.
    weight = max((1 + OTHER_PER_FRAME) * of_examples / total, 1.0)
    counts = np.array([[count_alone(t, name, TRIED) for name in names] for t in trials])
    chosen = dict(zip(names, _choose(counts, weight), strict=True))
    estimates = _estimate(trials, names, counts, weight)
    return {
        name: Calibration(
            chosen[name],
            _cautious(seen.correct, weight * (seen.predicted - seen.correct), weight),
            _cautious(seen.found, seen.true - seen.found, 1.0),
            seen.true,
            other_frames_of[name] / SEQUENCE_HZ / 60,
        )
        for name, seen in estimates.items()
    }


def apply_calibrations(
    library: ClassLibrary, calibrations: Mapping[str, Calibration]
) -> ClassLibrary:
    """Library whose classes have the calibrated thresholds, with their estimates."""
    classes = []
    for one in library:
        if one.name in calibrations:
            calibrated = calibrations[one.name]
            one = replace(
                one,
                threshold=calibrated.threshold,
                estimated_precision=round(calibrated.precision, 3),
                estimated_recall=round(calibrated.recall, 3),
            )
        classes.append(one)
    return replace(library, classes=tuple(classes))


def _count_other_frames(trials: Sequence[Trial]) -> Counter[str]:
    """Frames of other motion that each class was searched in."""
    frames: Counter[str] = Counter()
    for trial in trials:
        for name in {segment.name for segment in trial.truth}:
            own = sum(round(s.end - s.start) for s in trial.truth if s.name == name)
            frames[name] += trial.n_frames - own
    return frames


def _choose(counts: NDArray[np.int64], weight: float) -> list[float]:
    """Thresholds of counts (trials, classes, thresholds, 4)."""
    of_classes = counts.sum(axis=0)
    n_examples = of_classes[:, 0, 3]
    own = np.array([_best(_f_score(one, weight)) for one in of_classes])
    common = _best(_f_score(of_classes.sum(axis=0), weight))
    drawn = (n_examples * own + COMMON_WEIGHS * common) / (n_examples + COMMON_WEIGHS)
    return [round(float(threshold), 4) for threshold in drawn]


def _f_score(counts: NDArray[np.int64], weight: float) -> Floats:
    """F of segments at each threshold, with false ones weighed."""
    correct, claimed, found, true = counts.T
    precision = correct / np.maximum(correct + weight * (claimed - correct), 1)
    recall = found / np.maximum(true, 1)
    score: Floats = 2 * precision * recall / np.maximum(precision + recall, 1e-9)
    return score


def _best(scores: Floats) -> float:
    """Threshold of the best score, smoothed; of equal ones that in the middle."""
    around = np.pad(scores, 1, mode="edge")
    smooth = (around[:-2] + 2 * around[1:-1] + around[2:]) / 4
    best = np.flatnonzero(smooth >= smooth.max() - 1e-9)
    return TRIED[int(best[len(best) // 2])]


def _estimate(
    trials: Sequence[Trial], names: Sequence[str], counts: NDArray[np.int64], weight: float
) -> dict[str, Counts]:
    """Counts of each class, in each trial with thresholds chosen on the others."""
    totals: dict[str, list[Counts]] = {name: [] for name in names}
    for i, trial in enumerate(trials):
        others = np.delete(counts, i, axis=0) if len(trials) > 1 else counts
        thresholds = dict(zip(names, _choose(others, weight), strict=True))
        for name, counted in count_together(trial, thresholds).items():
            if name in totals:
                totals[name].append(counted)
    return {name: pool_counts(rows) for name, rows in totals.items()}


def _cautious(right: float, wrong: float, weight: float) -> float:
    """Fraction of the right ones, had there been one more right and one more wrong."""
    return (right + 1) / (right + 1 + wrong + weight)


# -- trials -------------------------------------------------------------------------------


def make_stream(
    held_out: Sequence[tuple[str, FeatureSequence]],
    others: Sequence[FeatureSequence],
    *,
    other_per_frame: float,
    rng: np.random.Generator,
) -> Stream:
    """Stream of examples in any order, pieces of other recordings spread between them.

    `others` show none of the classes; at most `other_per_frame` frames of them are taken for
    each frame of the examples.
    """
    n_frames = sum(len(item) for _, item in held_out)
    pieces = _cut(others, int(other_per_frame * n_frames), rng)
    between = np.sort(rng.integers(0, len(held_out) + 1, size=len(pieces)))
    parts: list[FeatureSequence] = []
    truth = []
    end = taken = 0
    for place, index in enumerate([*rng.permutation(len(held_out)), -1]):
        while taken < len(pieces) and between[taken] <= place:
            parts.append(pieces[taken])
            end += len(pieces[taken])
            taken += 1
        if index >= 0:
            name, item = held_out[index]
            parts.append(item)
            truth.append(LabelledSegment(name, end, end + len(item)))
            end += len(item)
    packed = np.concatenate([part.packed for part in parts])
    known = np.concatenate([part.known for part in parts])
    return Stream(packed, known, truth, len(packed) - n_frames)


def _cut(
    others: Sequence[FeatureSequence], most_frames: int, rng: np.random.Generator
) -> list[FeatureSequence]:
    """Pieces of recordings, in any order, together no longer than asked."""
    pieces = []
    for other in others:
        start = 0
        while start < len(other):
            stop = min(start + int(rng.integers(*_PIECE, endpoint=True)), len(other))
            pieces.append(other.part(start, stop))
            start = stop
    chosen = []
    for i in rng.permutation(len(pieces)):
        if len(pieces[i]) <= most_frames:
            chosen.append(pieces[i])
            most_frames -= len(pieces[i])
    return chosen


def run_trial(
    numbered: tuple[int, Fold],
    *,
    others: Sequence[FeatureSequence],
    other_per_frame: float,
    training: TrainingOptions,
    most_cost: float,
    seed: int,
) -> Trial:
    """Matches up to `most_cost` of what a fold teaches, in a stream of what it holds out.

    The number of the fold seeds its stream, which is made as by `make_stream`.
    """
    number, fold = numbered
    rng = np.random.default_rng([seed, number])
    stream = make_stream(fold.held_out, others, other_per_frame=other_per_frame, rng=rng)
    packed, known = stream.packed, stream.known
    background = measure_background(fold.learned, training=training)
    matches: dict[str, list[Alignment]] = {}
    for name, prototypes in fold.learned.items():
        try:
            learned = learn_class(
                name, prototypes, background=background, training=training, learning=_LEARNING
            )
        except InvalidInput:
            # Nothing in common: told where the class is learned in earnest.
            continue
        matches[name] = []
        for _, pattern in learned.patterns:
            ends = local_minima(distance_function(pattern, packed, known), threshold=most_cost)
            matches[name] += align(pattern, packed, known, ends)
    return Trial(len(packed), stream.other_frames, stream.truth, matches)


def count_alone(trial: Trial, name: str, thresholds: Sequence[float]) -> list[Counts]:
    """Counts of a class's segments at each threshold, as if there were no other class."""
    truth = [segment for segment in trial.truth if segment.name == name]
    counts = []
    for threshold in thresholds:
        below = [m for m in trial.matches.get(name, ()) if m.cost <= threshold]
        counts.append(count_overlaps(_join(below, name), truth).get(name, _NOTHING))
    return counts


def count_together(trial: Trial, thresholds: Mapping[str, float]) -> dict[str, Counts]:
    """Counts of each class's segments as annotation decides between the classes."""
    names = list(trial.matches)
    modified = []
    for name in names:
        matches = [m for m in trial.matches[name] if m.cost <= thresholds.get(name, 0.0)]
        modified.append(modify(matches, n_frames=trial.n_frames)[0])
    claimed = [
        LabelledSegment(names[s.class_index], *s.frames) for s in annotate_distances(modified)
    ]
    return count_overlaps(claimed, trial.truth)


def _join(matches: Sequence[Alignment], name: str) -> list[LabelledSegment]:
    """Segments that matches cover; those that touch are one."""
    joined: list[LabelledSegment] = []
    for start, end in sorted((m.start, m.end + 1) for m in matches):
        if joined and start <= joined[-1].end:
            joined[-1] = joined[-1]._replace(end=max(joined[-1].end, end))
        else:
            joined.append(LabelledSegment(name, start, end))
    return joined
