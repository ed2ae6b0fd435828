"""Cross-validation of classes: what is learned from a fold, tried on what it holds out.

A recording is more than examples: held-out ones stand in a stream between each other and
between pieces of other recordings, since every minute of other motion gives chances for
false hits. Matches up to a large cost are kept, so that any threshold can be judged
afterwards without matching again.

Conventions: frames are packed features at 30 Hz, segments half-open; seeded.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput
from motionary.evaluation import Counts, LabelledSegment, count_overlaps
from motionary.features import FeatureSequence
from motionary.matching import (
    Alignment,
    align,
    annotate_distances,
    distance_function,
    local_minima,
    modify,
)
from motionary.models.library.classes import MotionClass, TrainingOptions
from motionary.models.library.training import (
    Examples,
    learn_class,
    measure_background,
    name_groups,
)
from motionary.models.templates import Learning
from motionary.packing import PackedFeatures

#: Groups, or examples without groups, are dealt into so many folds at most.
N_FOLDS = 5

#: Pieces of other recordings, in frames: 2 to 5 s.
_PIECE = (60, 150)
#: Later passes change little, and learning takes most of the time of a fold.
_LEARNING = Learning(max_passes=4)
_NOTHING = Counts(0, 0, 0, 0)


class Fold(NamedTuple):
    """Examples to learn from, and others, by class, to try what was learned."""

    learned: Examples
    held_out: Sequence[tuple[str, FeatureSequence]]


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

    @property
    def names(self) -> tuple[str, ...]:
        """Classes that were learned and held out."""
        return tuple(dict.fromkeys(segment.name for segment in self.truth))

    def frames_of(self, name: str) -> int:
        """Frames of one class's examples."""
        return sum(round(s.end - s.start) for s in self.truth if s.name == name)


def make_folds(examples: Examples, *, groups: str | None, seed: int) -> list[Fold]:
    """Folds in which every example is held out once, but for lone ones of a prototype.

    Parameters
    ----------
    examples : class -> prototype -> packed features
    groups : regular expression; examples whose names have the same match (its first
        parentheses, if it has any) are held out together; without one, those of a person
        are, where all examples say whose they are
    seed : of the order in which they are dealt

    Returns
    -------
    list of Fold; of one fold nothing can be learned, so there are at least two, or none

    Raises
    ------
    InvalidInput
        If the expression is none, matches some example nowhere, or puts all into one group.
    """
    items = [
        (name, prototype, item)
        for name, prototypes in examples.items()
        for prototype, of_prototype in prototypes.items()
        for item in of_prototype
    ]
    rng = np.random.default_rng(seed)
    keys = _find_groups([item for *_, item in items], groups)
    fold_of = _deal_groups(keys, rng) if keys else _deal(items, rng)
    folds = []
    for fold in range(N_FOLDS):
        learned: dict[str, dict[str, list[FeatureSequence]]] = {}
        held_out = []
        for (name, prototype, item), own in zip(items, fold_of, strict=True):
            if own == fold:
                held_out.append((name, item))
            else:
                learned.setdefault(name, {}).setdefault(prototype, []).append(item)
        # What was not learned is not to be found.
        folds.append(Fold(learned, [held for held in held_out if held[0] in learned]))
    return [one for one in folds if one.held_out]


def make_stream(
    held_out: Sequence[tuple[str, FeatureSequence]],
    others: Sequence[FeatureSequence],
    *,
    other_per_frame: float,
    rng: np.random.Generator,
) -> Stream:
    """Stream of examples in any order, pieces of other recordings spread between them.

    Parameters
    ----------
    held_out : class and packed features
    others : recordings without any of the classes
    other_per_frame : most frames of them for each frame of the examples
    rng : source of the order
    """
    n_frames = sum(len(item) for _, item in held_out)
    pieces = _cut(others, int(other_per_frame * n_frames), rng)
    between = np.sort(rng.integers(0, len(held_out) + 1, size=len(pieces)))
    parts: list[tuple[PackedFeatures, PackedFeatures]] = []
    truth = []
    end = taken = 0
    for place, index in enumerate([*rng.permutation(len(held_out)), -1]):
        while taken < len(pieces) and between[taken] <= place:
            parts.append((pieces[taken].packed, pieces[taken].known))
            end += len(pieces[taken])
            taken += 1
        if index >= 0:
            name, item = held_out[index]
            parts.append((item.packed, item.known))
            truth.append(LabelledSegment(name, end, end + len(item)))
            end += len(item)
    packed, known = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return Stream(packed, known, truth, len(packed) - n_frames)


def _find_groups(examples: Sequence[FeatureSequence], groups: str | None) -> list[str]:
    """Group of each example, by its name or its person; none where people are not known."""
    if not groups:
        people = [item.recording.person for item in examples]
        return people if all(people) and len(set(people)) > 1 else []
    keys = name_groups(examples, groups)
    if len(set(keys)) == 1:
        raise InvalidInput(
            f"groups {groups!r} puts all examples into one group, {keys[0]!r}, and none can be "
            "held out; write an expression that tells them apart, or leave it out"
        )
    return keys


def _deal_groups(keys: Sequence[str], rng: np.random.Generator) -> Sequence[int | None]:
    """Folds of examples, those of one group together."""
    names = sorted(set(keys))
    order = rng.permutation(len(names))
    parts = {names[k]: place % N_FOLDS for place, k in enumerate(order)}
    return [parts[key] for key in keys]


def _deal(
    items: Sequence[tuple[str, str, FeatureSequence]], rng: np.random.Generator
) -> list[int | None]:
    """Folds of examples, those of each prototype spread evenly; a lone one is in none."""
    places: dict[tuple[str, str], list[int]] = {}
    for i, (name, prototype, _) in enumerate(items):
        places.setdefault((name, prototype), []).append(i)
    fold_of: list[int | None] = [None] * len(items)
    n_dealt = 0
    for own in places.values():
        if len(own) > 1:
            for i in rng.permutation(own):
                fold_of[i] = n_dealt % N_FOLDS
                n_dealt += 1
    return fold_of


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
    """Learn from a fold, and match in a stream of what it holds out.

    Parameters
    ----------
    numbered : a fold and its number, which seeds its stream
    others, other_per_frame : as in `make_stream`
    training : how classes are learned
    most_cost : matches that cost more are left out
    """
    number, fold = numbered
    rng = np.random.default_rng([seed, number])
    stream = make_stream(fold.held_out, others, other_per_frame=other_per_frame, rng=rng)
    background = measure_background(fold.learned, training=training)
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
    claimed = [
        LabelledSegment(names[s.class_index], *s.frames) for s in annotate_distances(modified)
    ]
    return count_overlaps(claimed, trial.truth)


def _match(motion_class: MotionClass, stream: Stream, most_cost: float) -> list[Alignment]:
    packed, known = stream.packed, stream.known
    matches = []
    for _, pattern in motion_class.patterns:
        distance = distance_function(pattern, packed, known)
        matches += align(pattern, packed, known, local_minima(distance, threshold=most_cost))
    return matches


def _join(matches: Sequence[Alignment], name: str) -> list[LabelledSegment]:
    """Segments that matches cover; those that touch are one."""
    joined: list[LabelledSegment] = []
    for start, end in sorted((m.start, m.end + 1) for m in matches):
        if joined and start <= joined[-1].end:
            joined[-1] = joined[-1]._replace(end=max(joined[-1].end, end))
        else:
            joined.append(LabelledSegment(name, start, end))
    return joined
