"""Which segments were found, whatever their exact ends?

- P2, R2, F2 of the thesis (2012), eqs 5.15-5.16: a predicted segment is right if it
  overlaps any true segment of its class, a true one is found if any predicted segment of
  its class overlaps it. One may serve several; touching is not overlapping.
- Segment F1 at an overlap (IoU), after Lea et al., Temporal convolutional networks for
  action segmentation and detection, 2017: each true segment is matched at most once, so
  that a segment in pieces counts as errors.
- Edit score, after Lea et al., Segmental spatiotemporal CNNs for fine-grained action
  segmentation, 2016: is the order of labels right?

Conventions: segments in seconds or frames, half-open; stretches without a label are no
segments; scores in [0, 1] (Lea et al. print percent).
"""

from collections.abc import Iterator

import numpy as np

from motionary.evaluation.counts import Counts
from motionary.evaluation.tables import (
    Segment,
    Segments,
    check_iou,
    check_segments,
    compute_iou,
    compute_overlap,
    list_names,
    select_name,
)


def count_overlaps(predicted: Segments, truth: Segments) -> dict[str, Counts]:
    """Counts of segments by class, found if they overlap at all.

    Parameters
    ----------
    predicted, truth : sequences of Segment

    Returns
    -------
    dict
        Counts of each class that occurs in either table; `pool_counts` of all and
        `compute_rates` give P2, R2, F2.
    """
    counts = {}
    for name, claimed, real in _by_class(predicted, truth):
        overlaps = compute_overlap(claimed, real) > 0
        right, found = overlaps.any(axis=1).sum(), overlaps.any(axis=0).sum()
        counts[name] = Counts(int(right), len(claimed), int(found), len(real))
    return counts


def count_matches(predicted: Segments, truth: Segments, *, iou: float) -> dict[str, Counts]:
    """Counts of segments by class, matched one to one.

    As Lea et al. (2017): each predicted segment takes the true segment of its class that
    it overlaps most, the earlier of equals; it is right if that overlap reaches `iou` and
    no other took the same before. It never falls back on its second best, so swapping
    the tables may change the result where `iou` is below a half.

    Parameters
    ----------
    predicted, truth : sequences of Segment
    iou : float
        Least temporal intersection over union, inclusive.

    Returns
    -------
    dict
        Counts of each class that occurs in either table.
    """
    least = check_iou(iou)
    counts = {}
    for name, claimed, real in _by_class(predicted, truth):
        right = _count_taken(claimed, sorted(real), least)
        counts[name] = Counts(right, len(claimed), right, len(real))
    return counts


def compute_edit_distance(predicted: Segments, truth: Segments) -> int:
    """Least number of labels to add, delete or rename to get the true order of labels.

    Labels are ordered by start, then end, then name; when they happen does not matter.
    """
    predicted = check_segments(predicted, where="the prediction")
    truth = check_segments(truth, where="the truth")
    return _levenshtein(_to_order(predicted), _to_order(truth))


def compute_edit_score(predicted: Segments, truth: Segments) -> float:
    """1 minus the edit distance divided by the larger number of labels."""
    distance = compute_edit_distance(predicted, truth)
    return 1 - distance / max(len(predicted), len(truth), 1)


def count_false(predicted: Segments, truth: Segments) -> int:
    """Number of predicted segments that overlap no true segment of their class."""
    counts = count_overlaps(predicted, truth).values()
    return sum(one.predicted - one.correct for one in counts)


def _by_class(
    predicted: Segments, truth: Segments
) -> Iterator[tuple[str, list[Segment], list[Segment]]]:
    predicted = check_segments(predicted, where="the prediction")
    truth = check_segments(truth, where="the truth")
    for name in list_names(predicted, truth):
        yield name, select_name(predicted, name), select_name(truth, name)


def _count_taken(predicted: list[Segment], truth: list[Segment], least: float) -> int:
    if not truth:
        return 0
    taken: set[int] = set()
    for row in compute_iou(predicted, truth):
        best = int(row.argmax())
        if row[best] >= least:
            taken.add(best)
    return len(taken)


def _to_order(segments: Segments) -> list[str]:
    ordered = sorted(segments, key=lambda s: (s.start, s.end, s.name))
    return [segment.name for segment in ordered]


def _levenshtein(source: list[str], target: list[str]) -> int:
    """Edit distance, a row of the table at a time."""
    codes = {name: code for code, name in enumerate(sorted({*source, *target}))}
    letters = np.array([codes[name] for name in target], dtype=np.int64)
    steps = np.arange(len(target) + 1)
    row = steps.copy()
    for name in source:
        changed = row[:-1] + (letters != codes[name])
        row = np.concatenate([row[:1] + 1, np.minimum(row[1:] + 1, changed)])
        # Insertions run along the row: a running minimum of what is left after them.
        row = np.minimum.accumulate(row - steps) + steps
    return int(row[-1])
