"""Tables of labels, counts of their frames, and the rates that follow from counts.

Every measure compares two tables of `LabelledSegment`: what was predicted and what is true.
Where a segment comes from (a `Label`, a row of a file, an array) does not matter here.

Precision, recall and their harmonic mean (thesis, 2012, eqs 5.10-5.12) of counts that are
kept apart for the two tables, because a segment may overlap several. P1, R1 and F1 are
those of pairs (frame, class) (eqs 5.8-5.14), so that a frame may bear several labels; a frame
without a label is in no pair, and a prediction there is false.

Conventions: segments are half-open, may overlap and come in any order, in seconds or frames as
long as both tables use the same. Frame i lasts from i / rate to (i + 1) / rate seconds and bears
a label if its centre lies within; for segments in frames the rate is 1.

Conventions for what is undefined:

- A rate 0/0 is 1 where both tables are empty (nothing was to be found and nothing was
  claimed: a perfect answer), and 0 where only one of them is.
- What can only be measured on something that is there (the distance of matched
  boundaries, the average precision of a class that does not occur, a number per minute of
  no time) is NaN, left out of means, and null in JSON.
"""

import math
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput

# Rate of the words of motionary and of the papers.
RATE_HZ = 30.0

# Times that differ by less are equal: the rest is rounding.
ROUNDING = 1e-6


class LabelledSegment(NamedTuple):
    """A named segment, its times in the unit of its table.

    Attributes
    ----------
    name : class
    start, end : seconds or frames, half-open
    cost : of a prediction, smaller is surer; infinite means never found
    """

    name: str
    start: float
    end: float
    cost: float = 0.0


class LabelLike(Protocol):
    """Anything with a name and times in seconds; a `cost` is used where there is one."""

    @property
    def name(self) -> str:
        """Class."""

    @property
    def start_s(self) -> float:
        """Start, seconds."""

    @property
    def end_s(self) -> float:
        """End, seconds, not included."""


Segments: TypeAlias = Sequence[LabelledSegment]
Labels: TypeAlias = Iterable[LabelLike | LabelledSegment]


def check_segments(
    segments: Iterable[LabelledSegment], *, where: str = "the table"
) -> list[LabelledSegment]:
    """The segments as a list, in the given order; `where` is what an error calls the table.

    Raises
    ------
    InvalidInput
        For something else than a `LabelledSegment`, an empty name, times that are not finite
        numbers, a segment without length, or a cost that is not a number.
    """
    checked = list(segments)
    for number, segment in enumerate(checked, start=1):
        problem = _find_problem(segment)
        if problem:
            raise InvalidInput(f"segment {number} of {where}: {problem}")
    return checked


def check_tables(
    predicted: Segments, truth: Segments
) -> tuple[list[LabelledSegment], list[LabelledSegment]]:
    """Both tables of a measure, checked."""
    return (
        check_segments(predicted, where="the prediction"),
        check_segments(truth, where="the truth"),
    )


def to_segments(labels: Labels, *, where: str) -> list[LabelledSegment]:
    """Segments, in seconds, of labels; a label without a cost costs 0.

    Labelled segments are taken as they are, so they must be in seconds.

    Raises
    ------
    InvalidInput
        For labels without name, start and end, and as `check_segments`.
    """
    segments = []
    for number, label in enumerate(labels, start=1):
        if isinstance(label, LabelledSegment):
            segments.append(label)
            continue
        try:
            cost = getattr(label, "cost", None)
            # Letters with accents come in two forms, which are the same label.
            name = unicodedata.normalize("NFC", label.name)
            segments.append(
                LabelledSegment(name, label.start_s, label.end_s, 0.0 if cost is None else cost)
            )
        except AttributeError:
            raise InvalidInput(
                f"label {number} of {where}: expected name, start_s and end_s, got {label!r}"
            ) from None
    return check_segments(segments, where=where)


def rename_segments(
    segments: Iterable[LabelledSegment], names: Mapping[str, str]
) -> list[LabelledSegment]:
    """The segments under other names; a name that is not in `names` stays.

    For tables whose classes differ in words or in depth: {"squat": "exercise"}.
    """
    return [s._replace(name=names.get(s.name, s.name)) for s in segments]


def list_names(*tables: Iterable[LabelledSegment]) -> list[str]:
    """Names that occur in any of the tables, sorted."""
    return sorted({segment.name for table in tables for segment in table})


def select_name(segments: Iterable[LabelledSegment], name: str) -> list[LabelledSegment]:
    """The segments of one name, in the given order."""
    return [segment for segment in segments if segment.name == name]


def to_times(segments: Segments) -> NDArray[np.float64]:
    """Starts and ends, shape (segments, 2)."""
    return np.array([(s.start, s.end) for s in segments], dtype=np.float64).reshape(-1, 2)


def compute_overlap(predicted: Segments, truth: Segments) -> NDArray[np.float64]:
    """Common length of every pair, whatever the names, shape (predicted, true)."""
    a, b = to_times(predicted)[:, None], to_times(truth)[None]
    common = np.minimum(a[..., 1], b[..., 1]) - np.maximum(a[..., 0], b[..., 0])
    return np.where(common > ROUNDING, common, 0.0)


def compute_iou(predicted: Segments, truth: Segments) -> NDArray[np.float64]:
    """Temporal intersection over union of every pair, shape (predicted, true)."""
    common = compute_overlap(predicted, truth)
    lengths = np.diff(to_times(predicted)), np.diff(to_times(truth)).T
    return np.asarray(common / (lengths[0] + lengths[1] - common), dtype=np.float64)


def check_iou(iou: float) -> float:
    """The least overlap asked of a match, in (0, 1]."""
    if not 0 < iou <= 1:
        raise InvalidInput(f"an overlap (IoU) must lie above 0 and up to 1, got {iou}")
    return iou


def _find_problem(segment: object) -> str | None:
    if not isinstance(segment, LabelledSegment):
        return f"expected LabelledSegment(name, start, end), got {segment!r}"
    if not isinstance(segment.name, str) or not segment.name:
        return f"expected a name, got {segment.name!r}"
    try:
        times_are_finite = math.isfinite(segment.start) and math.isfinite(segment.end)
        cost_is_number = not math.isnan(segment.cost)
    except TypeError:
        return f"expected numbers for start, end and cost, got {tuple(segment)}"
    if not times_are_finite:
        return f"expected finite times, got {segment.start} to {segment.end}"
    if not segment.end - segment.start > ROUNDING:
        return (
            f"{segment.name!r} must end after it starts, got {segment.start} to {segment.end}; "
            "give it a length or drop it"
        )
    return None if cost_is_number else "expected a cost, got NaN; infinite means not found"


# -- counts and rates -----------------------------------------------------------------------


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
    total = precision + recall
    return Rates(precision, recall, 2 * precision * recall / total if total else 0.0)


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
    predicted, truth = check_tables(predicted, truth)
    names = list_names(predicted, truth)
    line = _cut(predicted, truth, names, check_rate(rate_hz))
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
    predicted, truth = check_tables(predicted, truth)
    names = _check_names(names, list_names(predicted, truth))
    line = _cut(predicted, truth, names, check_rate(rate_hz), whole=(0.0, duration))
    return Confusion(names, _confuse(line))


def check_rate(rate_hz: float) -> float:
    """A sampling rate: positive and finite."""
    if not (np.isfinite(rate_hz) and rate_hz > 0):
        raise InvalidInput(f"a rate must be a positive number of frames a second, got {rate_hz}")
    return float(rate_hz)


def _check_names(names: tuple[str, ...] | None, occurring: list[str]) -> tuple[str, ...]:
    if names is None:
        return tuple(occurring)
    missing = sorted(set(occurring) - set(names))
    if missing or len(set(names)) < len(names):
        raise InvalidInput(
            f"names must hold every class once, got {list(names)}, missing {missing}"
        )
    return tuple(names)


def _cut(
    predicted: Segments,
    truth: Segments,
    names: Sequence[str],
    rate: float,
    whole: tuple[float, ...] = (),
) -> _Timeline:
    """Cut time wherever a label changes: cost depends on labels, not on hours."""
    times = [to_times(predicted), to_times(truth), np.array(whole)]
    # First frame whose centre does not lie before a time; whole numbers.
    frames = [np.ceil(one * rate - 0.5 - ROUNDING) for one in times]
    edges = np.unique(np.concatenate([one.ravel() for one in frames]))
    codes = {name: code for code, name in enumerate(names)}
    tables = []
    for segments, own in zip((predicted, truth), frames, strict=False):
        covered = np.zeros((max(len(edges) - 1, 0), len(names)), dtype=np.bool_)
        for segment, (first, stop) in zip(segments, np.searchsorted(edges, own), strict=True):
            covered[first:stop, codes[segment.name]] = True
        tables.append(covered)
    return _Timeline(np.diff(edges).astype(np.int64), *tables)


def _confuse(line: _Timeline) -> NDArray[np.int64]:
    """Confusion matrix, shape (names + 1, names + 1), of parts."""
    lengths, predicted, truth = line
    both = predicted & truth
    missed, surplus = truth & ~predicted, predicted & ~truth
    rows = np.column_stack([missed, ~missed.any(axis=1)])
    columns = np.column_stack([surplus, ~surplus.any(axis=1)])
    matrix = np.asarray((rows * lengths[:, None]).T @ columns.astype(np.int64), dtype=np.int64)
    diagonal = np.arange(both.shape[1])
    matrix[diagonal, diagonal] += lengths @ both
    matrix[-1, -1] = lengths[~(predicted | truth).any(axis=1)].sum()
    return matrix
