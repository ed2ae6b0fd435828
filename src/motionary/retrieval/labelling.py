"""Labels of one recording, assigned by costs or by scores.

By costs, after Müller, Baak and Seidel (2009), section 4: the modified distance function of a
class gives every frame of a match the cost of the match. Where a class has keyframes, its
distance is computed around their hits only and infinite elsewhere (section 5).

By scores, the matches that `choose_candidates` keeps become labels; those of a state that
follow each other are one. Each carries its score, how many false labels a minute of such a
score are to be expected of its class, and the evidence that `explain` reads.

Conventions: frames are those of the sequence, at 30 Hz, 0-based.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motionary.features import SEQUENCE_HZ, FeatureSequence
from motionary.labels import Label
from motionary.matching import (
    SKIP_WEIGHT,
    Alignment,
    Pattern,
    align,
    annotate_distances,
    concatenate,
    corpus_distance,
    find_paths_to,
    local_minima,
    modify,
)
from motionary.models.library import (
    Candidates,
    ClassLibrary,
    MotionClass,
    Prototype,
    PrototypePlace,
    choose_candidates,
    false_rates_of,
    join_matches,
    thresholds_for,
)
from motionary.packing import full_mask
from motionary.recording import Segment
from motionary.retrieval.explanation import Evidence, describe_nearest, explain

Floats = NDArray[np.float64]
Single = NDArray[np.float32]

#: Templates that differ less from their mirror image, on the mean, have no side.
_LEAST_DIFFERENCE = 0.05
_MOST_LACKS = 2


# -- by costs ----------------------------------------------------------------------------


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
        starts = np.array([start for start, _ in windows])
        for ends, into in ((np.asarray(minima), matches), (np.asarray(least), cheapest)):
            if not len(ends):
                continue
            # Each within the window of its end.
            since = starts[np.searchsorted(starts, ends, side="right") - 1]
            for found in align(
                pattern, sequence.packed, sequence.known, ends,
                skip_weight=skip_weight, since=since,
            ):  # fmt: skip
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
        prototype.queries, prototype.template.n_columns, sequence.packed, sequence.known,
        votes=prototype.votes,
    )  # fmt: skip
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


def label_by_costs(
    sequence: FeatureSequence, distances: Sequence[ClassDistance]
) -> tuple[Label, ...]:
    """Labels of the frames in which a class has the least modified distance."""
    labels = []
    for segment in annotate_distances([d.modified for d in distances]):
        distance, (start, stop) = distances[segment.class_index], segment.frames
        best = start + int(np.argmin(distance.modified[start:stop]))
        evidence = distance.matches[distance.owner[best]]
        labels.append(evidence.label(sequence.segment(start, stop)))
    return tuple(labels)


def describe_cheapest(
    sequence: FeatureSequence,
    everywhere: Sequence[ClassDistance],
    limits: Sequence[float | None],
) -> str:
    """What came closest, with keyframes or without, for a recording without labels.

    Limits are the largest costs of matches, by class; None where no match is worth a score.
    """
    found = [(d.least, limit) for d, limit in zip(everywhere, limits, strict=True) if d.least]
    if not found:
        return f"no class fits into what was seen in {sequence.duration_s:.1f} s"
    evidence, limit = min(found, key=lambda f: f[0].alignment.cost)
    cost, start = evidence.alignment.cost, evidence.alignment.start
    if limit is not None and cost <= limit:
        return (
            "no class shows the keyframes that it needs; nearest without them: "
            f"{evidence.name} {cost:.3f} at {start / SEQUENCE_HZ:.1f} s"
        )
    return describe_nearest(evidence, what=evidence.name, threshold=limit)


# -- by scores ---------------------------------------------------------------------------


def label_by_scores(
    sequence: FeatureSequence,
    library: ClassLibrary,
    found: Candidates,
    *,
    limits: Floats,
) -> tuple[tuple[Label, ...], str]:
    """Labels; without any, what came nearest, if a match was good enough to be scored.

    Parameters
    ----------
    sequence : of the library's features
    library : with scores
    found : scored matches in the sequence
    limits : array, shape (classes,), least score of a label
    """
    chosen = choose_candidates(found, library, threshold=limits).tolist()
    evidence = {i: _evidence(sequence, library, found, i) for i in chosen}
    kept = np.array([i for i in chosen if evidence[i].is_assessed], dtype=np.intp)
    if not len(kept):
        return (), _nearest(sequence, library, found, limits)
    paths, labels = found.paths, []
    for members in join_matches(found, library, kept, threshold=limits):
        matches = kept[members]
        best = int(matches[np.argmax(paths.scores[matches])])
        start, stop = int(paths.starts[matches].min()), int(paths.stops[matches].max())
        segment, score = sequence.segment(start, stop), float(paths.scores[best])
        labels.append(make_label(library, found.place_of(best), score, evidence[best], segment))
    return tuple(labels), ""


def make_label(
    library: ClassLibrary, place: PrototypePlace, score: float, evidence: Evidence, segment: Segment
) -> Label:
    """The label of a match, with all that the library knows of labels of its score."""
    motion_class = library.classes[place.class_index]
    rates, scoring = false_rates_of(library), library.scoring
    least = thresholds_for(library)[place.class_index]
    return evidence.label(
        segment,
        score=score,
        probability=scoring.probability_of(score - least) if scoring else None,
        false_per_min=None if rates is None else rates.of_class(place.class_index, score),
        side=_side_of(motion_class, place.prototype_index, evidence.sequence),
    )


def _side_of(motion_class: MotionClass, index: int, sequence: FeatureSequence) -> str:
    """Whether a template is as its examples are or mirrored; empty where both look alike."""
    if not any(one.mirror_of for one in motion_class.prototypes):
        return ""
    prototype = motion_class.prototypes[index]
    values = prototype.template.values
    image = values[:, sequence.feature_set.mirror_order]
    if np.abs(values - image).mean() < _LEAST_DIFFERENCE:
        return ""
    return "mirrored" if prototype.mirror_of else "as learned"


def _evidence(
    sequence: FeatureSequence, library: ClassLibrary, found: Candidates, index: int
) -> Evidence:
    return find_evidence(sequence, library, found.place_of(index), int(found.paths.stops[index]))


def find_evidence(
    sequence: FeatureSequence, library: ClassLibrary, place: PrototypePlace, stop: int
) -> Evidence:
    """The warping path of a match that ends before frame `stop`, and what it is made of."""
    motion_class = library.classes[place.class_index]
    template, pattern = motion_class.patterns[place.prototype_index]
    paths = find_paths_to(pattern, sequence.packed, sequence.known, np.array([stop - 1]))
    frames = paths.frames[0]
    columns = np.flatnonzero(frames >= 0)
    path = np.column_stack([columns, frames[columns]]).astype(np.intp)
    alignment = Alignment(int(frames[0]), stop - 1, float(paths.costs[0]), path)
    ratios = motion_class.ratios[place.prototype_index]
    return Evidence(motion_class.name, template, pattern, sequence, alignment, ratios)


def _nearest(
    sequence: FeatureSequence, library: ClassLibrary, found: Candidates, limits: Floats
) -> str:
    """What came closest in a recording without labels, and what spoke against it."""
    scores = found.paths.scores
    if not len(scores):
        return ""
    least = limits[found.classes]
    best = int(np.argmax(scores - least))
    why = explain(_evidence(sequence, library, found, best))
    nearest = f"{why.name} {scores[best]:.1f} at {why.start_s:.1f} s"
    text = f"nothing of score {least[best]:g}; nearest: {nearest}"
    against = [gain.name for gain in sorted(why.gains, key=lambda g: g.part) if gain.part < 0]
    return f"{text}, against it: {', '.join(against[:_MOST_LACKS])}" if against else text
