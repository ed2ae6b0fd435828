"""Thresholds calibrated by cross-validation: below which cost a match is believed.

Of each class the threshold with the best F of segments on held-out examples is taken and, as
few examples would decide by chance, drawn towards the one threshold that is best for all.
Precision and recall are estimated as annotation decides between classes, in each fold with
thresholds chosen on the others.

Conventions: frames are packed features at 30 Hz; seeded.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.batch import Failure, map_ordered
from motionary.evaluation import Counts, pool_counts
from motionary.features import SEQUENCE_HZ, FeatureSequence
from motionary.models.library.classes import TrainingOptions
from motionary.models.library.cross_validation import (
    Fold,
    Trial,
    count_alone,
    count_together,
    make_folds,
    run_trial,
)
from motionary.models.library.storage import ClassLibrary
from motionary.models.library.training import Examples

Floats = NDArray[np.float64]

#: Thresholds that are tried.
TRIED = tuple(round(0.005 * step, 3) for step in range(1, 31))
#: Frames of other motion for each frame of the examples, in the recordings to be labelled.
#: Where fewer are at hand, each false hit stands for several.
OTHER_PER_FRAME = 3.0
#: What is common to all classes weighs as much as so many examples.
COMMON_WEIGHS = 20.0


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
    names = [name for name in examples if other_frames_of.get(name, 0) > 0]
    if not names:
        return {}
    weight = _weight_of_false(trials)
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


def _count_other_frames(trials: Sequence[Trial]) -> dict[str, int]:
    """Frames of other motion that each class was searched in."""
    frames: dict[str, int] = {}
    for trial in trials:
        for name in trial.names:
            other = trial.n_frames - trial.frames_of(name)
            frames[name] = frames.get(name, 0) + other
    return frames


def _weight_of_false(trials: Sequence[Trial]) -> float:
    """So many false hits one of the streams stands for."""
    total = sum(trial.n_frames for trial in trials)
    of_examples = total - sum(trial.other_frames for trial in trials)
    return max((1 + OTHER_PER_FRAME) * of_examples / total, 1.0)


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
