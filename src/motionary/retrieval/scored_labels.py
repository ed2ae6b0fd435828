"""Labels of one recording, assigned by scores.

The matches that `choose_candidates` keeps become labels; those of a state that follow each
other are one. Each carries its score, how many false labels a minute of such a score are to
be expected of its class, and the evidence that `explain` reads.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motionary.features import FeatureSequence
from motionary.labels import Label
from motionary.matching import Alignment, find_paths_to
from motionary.models.library import (
    Candidates,
    ClassLibrary,
    MotionClass,
    PrototypePlace,
    choose_candidates,
    false_rates_of,
    join_matches,
    thresholds_for,
)
from motionary.recording import Segment
from motionary.retrieval.explanation import Evidence, explain

#: Templates that differ less from their mirror image, on the mean, have no side.
_LEAST_DIFFERENCE = 0.05
_MOST_LACKS = 2


def limits_for(
    library: ClassLibrary, threshold: float | None, at_most_false_per_min: float | None
) -> NDArray[np.float64]:
    """Least score of a label of each class: one for all, or by its expected false labels.

    Raises
    ------
    InvalidInput
        If the library has no rates of false labels where they are asked for.
    """
    if threshold is not None:
        return np.full(len(library), threshold, dtype=np.float64)
    return thresholds_for(library, at_most_false_per_min)


def label_by_scores(
    sequence: FeatureSequence,
    library: ClassLibrary,
    found: Candidates,
    *,
    limits: NDArray[np.float64],
) -> tuple[tuple[Label, ...], str]:
    """Labels; without any, what came nearest, if a match was good enough to be scored.

    Parameters
    ----------
    sequence : of the library's features
    library : with scores
    found : scored matches in the sequence
    limits : array, shape (classes,), least score of a label
    """
    chosen = choose_candidates(found, library, threshold=limits)
    matches = [(int(i), _evidence(sequence, library, found, int(i))) for i in chosen]
    matches = [(i, one) for i, one in matches if one.is_assessed]
    if not matches:
        return (), _nearest(sequence, library, found, limits)
    kept = np.array([i for i, _ in matches], dtype=np.intp)
    evidence = [one for _, one in matches]
    labels = []
    for members in join_matches(found, library, kept, threshold=limits):
        best = max(members, key=lambda j: found.paths.scores[kept[j]])
        start = int(min(found.paths.starts[kept[j]] for j in members))
        stop = int(max(found.paths.stops[kept[j]] for j in members))
        index = int(kept[best])
        place, score = found.place_of(index), float(found.paths.scores[index])
        segment = sequence.segment(start, stop)
        labels.append(make_label(library, place, score, evidence[best], segment))
    return tuple(labels), ""


def make_label(
    library: ClassLibrary, place: PrototypePlace, score: float, evidence: Evidence, segment: Segment
) -> Label:
    """The label of a match, with all that the library knows of labels of its score."""
    motion_class, recording = library.classes[place.class_index], evidence.sequence.recording
    rates, scoring = false_rates_of(library), library.scoring
    least = thresholds_for(library)[place.class_index]
    return Label(
        motion_class.name,
        segment.start_s,
        segment.end_s,
        cost=evidence.alignment.cost,
        known=evidence.known,
        start_frame=recording.frame_at(segment.start_s),
        end_frame=recording.last_frame_before(segment.end_s),
        evidence=evidence,
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
    sequence: FeatureSequence, library: ClassLibrary, found: Candidates, limits: NDArray[np.float64]
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
    against = [gain for gain in sorted(why.gains, key=lambda g: g.part) if gain.part < 0]
    return text + _format_lacks([gain.name for gain in against[:_MOST_LACKS]])


def _format_lacks(names: Sequence[str]) -> str:
    return f", against it: {', '.join(names)}" if names else ""
