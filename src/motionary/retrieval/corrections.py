"""Classes that learn from what a person changed in their labels.

The labels that a library gives to recordings are compared with those that a person left there:
what is kept, moved, renamed or added is an example of its class. Each example goes to the
prototype of its class that it fits best, or to its mirror image, and those of a class make a
prototype of their own beside it. Labels that were removed count in the estimates: of
precision and recall before, and of what was learned on parts that were held out.

Conventions: times in seconds; a label is right if it overlaps one of its class by half.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput
from motionary.evaluation import Counts, LabelledSegment, Rates, compute_rates, pool_counts
from motionary.evaluation.segments import count_matches
from motionary.features import SEQUENCE_HZ, FeatureSequence
from motionary.labels import Label, LabelTrack, compare_labels
from motionary.matching import distance_function
from motionary.models.library import (
    ClassLibrary,
    MotionClass,
    cut_example,
    learn_beside,
    mirror_sequence,
)
from motionary.retrieval.annotation import annotate

__all__ = ["ClassCorrections", "Corrections", "learn_corrections", "split_parts"]

#: Overlap from which a label is right.
_IOU = 0.5
_MOST_FOLDS = 5
_KINDS = ("kept", "moved", "renamed", "added", "removed")

_NOBODY = Label("?", 0.0, 0.0)

#: A corrected track, and the features of its recording.
Corrected = tuple[LabelTrack, FeatureSequence]


class ClassCorrections(NamedTuple):
    """What a person changed in labels of one class, and what that tells.

    Attributes
    ----------
    name : of the class
    kept, moved, renamed, added, removed : labels; renamed are those that got this name
    before : precision and recall of the library's labels, by those that the person left
    after : the same of what was learned, on recordings or parts of them that were held out;
        None where nothing is held out
    """

    name: str
    kept: int
    moved: int
    renamed: int
    added: int
    removed: int
    before: Rates
    after: Rates | None


@dataclass(frozen=True, slots=True)
class Corrections:
    """What came of corrections.

    Attributes
    ----------
    library : with what was learned
    classes : changes and estimates of each class that is in the labels
    before, after : estimates of all classes together
    """

    library: ClassLibrary
    classes: tuple[ClassCorrections, ...]
    before: Rates
    after: Rates | None

    @property
    def n_changed(self) -> int:
        """Number of labels that are not as the library gave them."""
        return sum(x.moved + x.renamed + x.added + x.removed for x in self.classes)


def learn_corrections(
    library: ClassLibrary,
    corrected: Sequence[Corrected],
    *,
    estimate: bool = True,
    on_done: Callable[[], None] | None = None,
) -> Corrections:
    """The library with what corrected labels of recordings teach.

    Parameters
    ----------
    library : that gave the labels before they were corrected
    corrected : tracks with all labels that are right, and the features of their recordings
    estimate : whether to tell by held-out parts what was gained, which takes most of the time
    on_done : called after each recording, or part of one, that was held out

    Raises
    ------
    InvalidInput
        If there is no track, or features are others than the library's.
    """
    if not corrected:
        raise InvalidInput("there are no corrected labels to learn from; give at least one track")
    own = [annotate(sequence, library) for _, sequence in corrected]
    before = _count(own, [track for track, _ in corrected])
    after: dict[str, list[Counts]] = {}
    parts = split_parts(corrected) if estimate else []
    for held_out in parts if len(parts) > 1 else ():
        learned = _learn(library, [pair for part in parts if part is not held_out for pair in part])
        tracks = [annotate(sequence, learned) for _, sequence in held_out]
        for name, counts in _count(tracks, [track for track, _ in held_out]).items():
            after.setdefault(name, []).append(counts)
        if on_done:
            on_done()
    pooled = {name: pool_counts(counts) for name, counts in after.items()}
    changes = _count_changes(own, [track for track, _ in corrected])
    return Corrections(
        _learn(library, corrected),
        tuple(
            ClassCorrections(
                name,
                **changes.get(name, dict.fromkeys(_KINDS, 0)),
                before=compute_rates(before[name]),
                after=compute_rates(pooled[name]) if name in pooled else None,
            )
            for name in sorted({*before, *changes})
        ),
        compute_rates(pool_counts(before.values())),
        compute_rates(pool_counts(pooled.values())) if pooled else None,
    )  # fmt: skip


def split_parts(corrected: Sequence[Corrected]) -> list[list[Corrected]]:
    """Recordings in groups to hold out, one after the other; of one recording, parts of it."""
    if len(corrected) > 1:
        n = min(_MOST_FOLDS, len(corrected))
        return [list(corrected[i::n]) for i in range(n)]
    ((track, sequence),) = corrected
    cuts = [0, *_find_cuts(track, len(sequence)), len(sequence)]
    return [[_cut(track, sequence, *ends)] for ends in pairwise(cuts)]


def _find_cuts(track: LabelTrack, n_frames: int) -> list[int]:
    """Frames between labels that part a recording about evenly."""
    free = np.ones(n_frames + 1, dtype=np.bool_)
    free[[0, -1]] = False
    starts = np.zeros(n_frames + 1, dtype=np.int64)
    for label in track:
        start, stop = (round(t * SEQUENCE_HZ) for t in (label.start_s, label.end_s))
        free[start + 1 : stop] = False
        starts[min(start, n_frames)] += 1
    # Labels before each frame: parts hold about as many each.
    before = np.cumsum(starts) - starts
    places = np.flatnonzero(free)
    if not len(places) or len(track) < 2:
        return []
    n_parts = min(_MOST_FOLDS, len(track))
    wanted = len(track) * np.arange(1, n_parts) / n_parts
    cuts = {int(places[np.argmin(np.abs(before[places] - at))]) for at in wanted}
    return sorted(cuts)


def _cut(track: LabelTrack, sequence: FeatureSequence, start: int, stop: int) -> Corrected:
    part, first_s, last_s = sequence.part(start, stop), start / SEQUENCE_HZ, stop / SEQUENCE_HZ
    labels = tuple(
        replace(x, start_s=x.start_s - first_s, end_s=x.end_s - first_s)
        for x in track
        if first_s <= (x.start_s + x.end_s) / 2 < last_s
    )
    return LabelTrack(part.recording, labels), part


def _learn(library: ClassLibrary, corrected: Sequence[Corrected]) -> ClassLibrary:
    """The library with what labels teach that a person left as they are right."""
    examples: dict[str, dict[str, list[FeatureSequence]]] = {}
    for track, sequence in corrected:
        for label in track:
            try:
                example = cut_example(sequence, label)
            except InvalidInput:
                # Too short to be cut; it still counts in the estimates.
                continue
            prototype = label.name
            if label.name in library.names:
                prototype, example = _place(example, library[label.name])
            examples.setdefault(label.name, {}).setdefault(prototype, []).append(example)
    return learn_beside(library, examples)


def _place(example: FeatureSequence, motion_class: MotionClass) -> tuple[str, FeatureSequence]:
    """The prototype that an example fits best, and the example on its side."""
    costs = [
        float(np.min(distance_function(pattern, example.packed, example.known), initial=np.inf))
        for _, pattern in motion_class.patterns
    ]
    nearest = motion_class.prototypes[int(np.argmin(costs))]
    if nearest.mirror_of:
        return nearest.mirror_of, mirror_sequence(example)
    return nearest.name, example


def _count(tracks: Sequence[LabelTrack], truth: Sequence[LabelTrack]) -> dict[str, Counts]:
    """Counts of labels by class, over all recordings."""
    found: dict[str, list[Counts]] = {}
    for pair in zip(tracks, truth, strict=True):
        segments = [[LabelledSegment(x.name, x.start_s, x.end_s) for x in track] for track in pair]
        for name, counts in count_matches(*segments, iou=_IOU).items():
            found.setdefault(name, []).append(counts)
    return {name: pool_counts(counts) for name, counts in found.items()}


def _count_changes(
    own: Sequence[LabelTrack], corrected: Sequence[LabelTrack]
) -> Mapping[str, Mapping[str, int]]:
    changes: dict[str, dict[str, int]] = {}
    for before, after in zip(own, corrected, strict=True):
        for change in compare_labels(before, after):
            name = (change.after or change.before or _NOBODY).name
            changes.setdefault(name, dict.fromkeys(_KINDS, 0))[change.kind] += 1
    return changes
