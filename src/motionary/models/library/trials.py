"""How do classes do on examples that they were not learned from?

A trial learns from the examples of a fold and matches every class in the stream of those
that were held out. Matches up to a large cost are kept, so that any threshold can be
judged afterwards without matching again.

Conventions: frames are words at 30 Hz, segments half-open.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput
from motionary.evaluation import Counts, Segment, count_overlaps
from motionary.features import FeatureSequence
from motionary.matching import (
    Alignment,
    align,
    annotate_distances,
    distance_function,
    local_minima,
    modify,
)
from motionary.models.library.classes import MotionClass
from motionary.models.library.examples import find_feature_set
from motionary.models.library.holding_out import Fold, Stream, make_stream
from motionary.models.library.training import TrainingOptions, learn_class, measure_background
from motionary.models.templates import Learning

_NOTHING = Counts(0, 0, 0, 0)
#: Later passes change little, and a trial learns most of its time.
_LEARNING = Learning(max_passes=4)


class Trial(NamedTuple):
    """Classes of a fold in their stream.

    Attributes
    ----------
    n_frames, other_frames : length of the stream; frames of recordings without the classes
    truth : where which class is
    matches : per class, those up to the largest cost that was asked for
    """

    n_frames: int
    other_frames: int
    truth: Sequence[Segment]
    matches: Mapping[str, Sequence[Alignment]]

    @property
    def names(self) -> tuple[str, ...]:
        """Classes that were learned and held out."""
        return tuple(dict.fromkeys(segment.name for segment in self.truth))

    def frames_of(self, name: str) -> int:
        """Frames of one class's examples."""
        return sum(round(s.end - s.start) for s in self.truth if s.name == name)


def run_trial(
    numbered: tuple[int, Fold],
    *,
    others: Sequence[FeatureSequence],
    other_per_frame: float,
    training: TrainingOptions,
    most_cost: float,
    seed: int,
) -> Trial:
    """Learn from a fold, and match in a stream of what it holds out.

    Parameters
    ----------
    numbered : a fold and its number, which seeds its stream
    others, other_per_frame : as in `make_stream`
    teaching : how classes are learned
    most_cost : matches that cost more are left out
    """
    number, fold = numbered
    rng = np.random.default_rng([seed, number])
    stream = make_stream(fold.held_out, others, other_per_frame=other_per_frame, rng=rng)
    background: tuple[float, ...] = ()
    if training.by_self_information:
        feature_set = find_feature_set(fold.learned)
        background = measure_background(fold.learned, feature_set, mirror=training.mirror)
    matches = {}
    for name, prototypes in fold.learned.items():
        try:
            motion_class = learn_class(
                name, prototypes, background=background, training=training, learning=_LEARNING
            )
        except InvalidInput:
            # Nothing in common: told where the class is learned in earnest.
            continue
        matches[name] = _match(motion_class, stream, most_cost)
    return Trial(len(stream.packed), stream.other_frames, stream.truth, matches)


def count_alone(trial: Trial, name: str, thresholds: Sequence[float]) -> list[Counts]:
    """Counts of a class's segments at each threshold, as if there were no other class."""
    truth = [segment for segment in trial.truth if segment.name == name]
    matches = sorted(trial.matches.get(name, ()), key=lambda m: m.cost)
    counts = []
    for threshold in thresholds:
        claimed = _join([m for m in matches if m.cost <= threshold], name)
        counts.append(count_overlaps(claimed, truth).get(name, _NOTHING))
    return counts


def count_together(trial: Trial, thresholds: Mapping[str, float]) -> dict[str, Counts]:
    """Counts of each class's segments as annotation decides between the classes."""
    names = list(trial.matches)
    modified = []
    for name in names:
        matches = [m for m in trial.matches[name] if m.cost <= thresholds.get(name, 0.0)]
        modified.append(modify(matches, n_frames=trial.n_frames)[0])
    claimed = [Segment(names[s.class_index], *s.frames) for s in annotate_distances(modified)]
    return count_overlaps(claimed, trial.truth)


def _match(motion_class: MotionClass, stream: Stream, most_cost: float) -> list[Alignment]:
    packed, known = stream.packed, stream.known
    matches = []
    for _, pattern in motion_class.sought():
        distance = distance_function(pattern, packed, known)
        matches += align(pattern, packed, known, local_minima(distance, threshold=most_cost))
    return matches


def _join(matches: Sequence[Alignment], name: str) -> list[Segment]:
    """Stretches that matches cover; those that touch are one."""
    joined: list[Segment] = []
    for start, end in sorted((m.start, m.end + 1) for m in matches):
        if joined and start <= joined[-1].end:
            joined[-1] = joined[-1]._replace(end=max(joined[-1].end, end))
        else:
            joined.append(Segment(name, start, end))
    return joined
