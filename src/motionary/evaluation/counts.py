"""Counts, the rates that follow from them, and counts of frames.

Precision, recall and their harmonic mean (thesis, 2012, eqs 5.10-5.12) of counts that are
kept apart for the two tables, because a segment may overlap several. P1, R1 and F1 are
those of pairs (frame, class) (eqs 5.8-5.14), so that a frame may bear several labels; a frame
without a label is in no pair, and a prediction there is false.

Conventions: frame i lasts from i / rate to (i + 1) / rate seconds and bears a label if its
centre lies within; for segments in frames the rate is 1.

Conventions for what is undefined:

- A rate 0/0 is 1 where both tables are empty (nothing was to be found and nothing was
  claimed: a perfect answer), and 0 where only one of them is.
- What can only be measured on something that is there (the distance of matched
  boundaries, the average precision of a class that does not occur, a number per minute of
  no time) is NaN, left out of means, and null in JSON.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.evaluation.tables import ROUNDING, Segments, check_segments, list_names

# Rate of the words of motionary and of the papers.
RATE_HZ = 30.0


class Rates(NamedTuple):
    """Fractions in [0, 1].

    Attributes
    ----------
    precision : of what was predicted, the fraction that is right
    recall : of what is true, the fraction that was found
    f : their harmonic mean
    """

    precision: float
    recall: float
    f: float


class Counts(NamedTuple):
    """Numbers that rates are made of.

    Attributes
    ----------
    correct : predictions that are right
    predicted : predictions
    found : true ones that were found
    true : true ones
    """

    correct: int
    predicted: int
    found: int
    true: int


class Confusion(NamedTuple):
    """Confusion matrix of classes.

    Attributes
    ----------
    names : classes
    matrix : shape (names + 1, names + 1), int; row true, column predicted; the last row
        and column stand for "no label"
    """

    names: tuple[str, ...]
    matrix: NDArray[np.int64]


class _Timeline(NamedTuple):
    """Parts within which no label changes."""

    lengths: NDArray[np.int64]  # (parts,), frames
    predicted: NDArray[np.bool_]  # (parts, names)
    truth: NDArray[np.bool_]


def pool_counts(counts: Iterable[Counts]) -> Counts:
    """Sum of counts: of classes, or of recordings as if they were one."""
    total = np.zeros(4, dtype=np.int64)
    for one in counts:
        total += np.array(one, dtype=np.int64)
    return Counts(*total.tolist())


def compute_rates(counts: Counts) -> Rates:
    """Precision, recall and F of counts."""
    empty = 1.0 if counts.predicted == counts.true == 0 else 0.0
    precision = counts.correct / counts.predicted if counts.predicted else empty
    recall = counts.found / counts.true if counts.true else empty
    return Rates(precision, recall, _harmonic_mean(precision, recall))


def count_frames(
    predicted: Segments, truth: Segments, *, rate_hz: float = RATE_HZ
) -> dict[str, Counts]:
    """Counts of frames by class.

    Parameters
    ----------
    predicted, truth : sequences of Segment
        In seconds (in frames with a rate of 1).
    rate_hz : float
        Frames per unit of time.

    Returns
    -------
    dict
        Counts of each class that occurs in either table; `pool_counts` of all and
        `compute_rates` give P1, R1, F1.
    """
    rate = check_rate(rate_hz)
    predicted = check_segments(predicted, where="the prediction")
    truth = check_segments(truth, where="the truth")
    names = list_names(predicted, truth)
    line = _cut(_to_frames(predicted, rate), _to_frames(truth, rate), names)
    both = line.lengths @ (line.predicted & line.truth)
    claimed, real = line.lengths @ line.predicted, line.lengths @ line.truth
    return {
        name: Counts(int(both[k]), int(claimed[k]), int(both[k]), int(real[k]))
        for k, name in enumerate(names)
    }


def confuse_frames(
    predicted: Segments,
    truth: Segments,
    *,
    rate_hz: float = RATE_HZ,
    duration: float = 0.0,
    names: tuple[str, ...] | None = None,
) -> Confusion:
    """Confusion matrix by frames.

    A label that both tables bear at a frame counts on the diagonal. Of the rest of that
    frame, every true label is paired with every predicted one, or with "no label" where
    the other table has none left. Without overlapping labels each frame counts once.

    Parameters
    ----------
    predicted, truth : sequences of Segment
    rate_hz : float
        Frames per unit of time.
    duration : float
        Length of the recording, for the frames that neither table labels; at least from
        0 to the last label.
    names : tuple of str, optional
        Classes and their order; by default those that occur, sorted.
    """
    rate = check_rate(rate_hz)
    predicted = check_segments(predicted, where="the prediction")
    truth = check_segments(truth, where="the truth")
    names = _check_names(names, list_names(predicted, truth))
    whole = _round_to_frames(np.array([0.0, duration]), rate)
    line = _cut(_to_frames(predicted, rate), _to_frames(truth, rate), list(names), whole)
    return Confusion(names, _confuse(line.lengths, line.predicted, line.truth))


def check_rate(rate_hz: float) -> float:
    """A sampling rate: positive and finite."""
    if not (np.isfinite(rate_hz) and rate_hz > 0):
        raise InvalidInput(f"a rate must be a positive number of frames a second, got {rate_hz}")
    return float(rate_hz)


def _harmonic_mean(precision: float, recall: float) -> float:
    total = precision + recall
    return 2 * precision * recall / total if total else 0.0


def _check_names(names: tuple[str, ...] | None, occurring: list[str]) -> tuple[str, ...]:
    if names is None:
        return tuple(occurring)
    missing = sorted(set(occurring) - set(names))
    if missing or len(set(names)) < len(names):
        raise InvalidInput(
            f"names must hold every class once, got {list(names)}, missing {missing}"
        )
    return tuple(names)


def _round_to_frames(times: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """First frame whose centre does not lie before a time; whole numbers."""
    return np.asarray(np.ceil(times * rate - 0.5 - ROUNDING), dtype=np.float64)


def _to_frames(segments: Segments, rate: float) -> list[tuple[str, float, float]]:
    times = np.array([(s.start, s.end) for s in segments], dtype=np.float64).reshape(-1, 2)
    return [
        (segment.name, first, end)
        for segment, (first, end) in zip(segments, _round_to_frames(times, rate), strict=True)
    ]


def _cut(
    predicted: list[tuple[str, float, float]],
    truth: list[tuple[str, float, float]],
    names: list[str],
    whole: NDArray[np.float64] | None = None,
) -> _Timeline:
    """Cut time wherever a label changes: cost depends on labels, not on hours."""
    bounds = [bound for _, first, end in (*predicted, *truth) for bound in (first, end)]
    edges = np.unique(np.concatenate([bounds, [] if whole is None else whole]))
    lengths = np.diff(edges).astype(np.int64)
    codes = {name: code for code, name in enumerate(names)}
    tables = []
    for rows in (predicted, truth):
        covered = np.zeros((len(lengths), len(names)), dtype=np.bool_)
        for name, first, end in rows:
            span = slice(*np.searchsorted(edges, (first, end)))
            covered[span, codes[name]] = True
        tables.append(covered)
    return _Timeline(lengths, *tables)


def _confuse(
    lengths: NDArray[np.int64], predicted: NDArray[np.bool_], truth: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Confusion matrix, shape (names + 1, names + 1), of parts."""
    both = predicted & truth
    missed, surplus = truth & ~predicted, predicted & ~truth
    rows = np.column_stack([missed, ~missed.any(axis=1)])
    columns = np.column_stack([surplus, ~surplus.any(axis=1)])
    matrix = np.asarray((rows * lengths[:, None]).T @ columns.astype(np.int64), dtype=np.int64)
    diagonal = np.arange(both.shape[1])
    matrix[diagonal, diagonal] += lengths @ both
    matrix[-1, -1] = lengths[~(predicted | truth).any(axis=1)].sum()
    return matrix
