"""Distance functions of classes in a recording: what labels by costs are assigned by.

After Müller, Baak and Seidel (2009), section 4: the modified distance function of a class gives
every frame of a match the cost of the match. Where a class has keyframes, its distance is
computed around their hits only and infinite elsewhere (section 5).

Conventions: frames are those of the sequence, at 30 Hz, 0-based.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.features import FeatureSequence
from motionary.matching import (
    SKIP_WEIGHT,
    Alignment,
    Pattern,
    align,
    concatenate,
    corpus_distance,
    local_minima,
    modify,
)
from motionary.models.library import MotionClass, Prototype
from motionary.packing import full_mask
from motionary.retrieval.explanation import Evidence

Floats = NDArray[np.float64]
Single = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class ClassDistance:
    """Modified distance function of one class in one recording, and its matches.

    Attributes
    ----------
    modified : array, shape (frames,), cost of the cheapest match that covers a frame
    owner : array, shape (frames,), index into `matches` of that match, -1 without one
    matches : every local minimum below the threshold of which enough was seen
    least : cheapest match of the recording, whatever the threshold; None if none fits
    unmodified : array, shape (frames,), least cost of a match that ends in a frame, infinite
        where keyframes rule the class out
    """

    modified: Floats
    owner: NDArray[np.intp]
    matches: tuple[Evidence, ...]
    least: Evidence | None
    unmodified: Single


def class_distance(
    sequence: FeatureSequence,
    motion_class: MotionClass,
    *,
    threshold: float | None = None,
    preselect: bool = True,
    skip_weight: float = SKIP_WEIGHT,
) -> ClassDistance:
    """Modified distance function of a class: the least over its templates."""
    limit = motion_class.threshold if threshold is None else threshold
    matches: list[Evidence] = []
    cheapest: list[Evidence] = []
    unmodified = np.full(len(sequence), np.inf, dtype=np.float32)
    whole = [(0, len(sequence))]
    for prototype, (template, pattern) in zip(
        motion_class.prototypes, motion_class.patterns, strict=True
    ):
        windows = _windows(prototype, sequence) if preselect and prototype.queries else whole
        distance = _distance(pattern, sequence, windows, skip_weight)
        np.minimum(unmodified, distance, out=unmodified)
        minima = local_minima(distance, threshold=limit)
        least = [int(np.argmin(distance))] if np.isfinite(distance).any() else []
        for ends, into in ((minima, matches), (least, cheapest)):
            for found in _align(pattern, sequence, windows, np.asarray(ends), skip_weight):
                evidence = Evidence(motion_class.name, template, pattern, sequence, found)
                if evidence.is_assessed:
                    into.append(evidence)
    modified, owner = modify([match.alignment for match in matches], n_frames=len(sequence))
    nearest = min(cheapest, key=lambda e: e.alignment.cost, default=None)
    return ClassDistance(modified, owner, tuple(matches), nearest, unmodified)


def _windows(prototype: Prototype, sequence: FeatureSequence) -> list[tuple[int, int]]:
    """Where a prototype is matched: around the hits of its keyframes."""
    from motionary.models.keyframes import select_in_sequence

    ranges = select_in_sequence(
        prototype.queries,
        prototype.template.n_columns,
        sequence.packed,
        sequence.known,
        votes=prototype.votes,
    )
    return ranges.of(0)


def _distance(
    pattern: Pattern,
    sequence: FeatureSequence,
    windows: Sequence[tuple[int, int]],
    skip_weight: float,
) -> Single:
    """Distance function, infinite outside of the windows; no path leaves one."""
    distance = np.full(len(sequence), np.inf, dtype=np.float32)
    if not windows:
        return distance
    corpus = concatenate(
        [sequence.packed[start:stop] for start, stop in windows],
        [sequence.known[start:stop] for start, stop in windows],
        full=full_mask(1, len(sequence.feature_set))[0],
    )
    inside = corpus_distance(pattern, corpus, skip_weight=skip_weight)
    for (start, stop), part in zip(windows, corpus.split(inside), strict=True):
        distance[start:stop] = part
    return distance


def _align(
    pattern: Pattern,
    sequence: FeatureSequence,
    windows: Sequence[tuple[int, int]],
    ends: NDArray[np.intp],
    skip_weight: float,
) -> list[Alignment]:
    """Matches that end at some frames, each within the window of its end."""
    if len(ends) == 0:
        return []
    starts = np.array([start for start, _ in windows])
    since = starts[np.searchsorted(starts, ends, side="right") - 1]
    packed, known = sequence.packed, sequence.known
    return align(pattern, packed, known, ends, skip_weight=skip_weight, since=since)
