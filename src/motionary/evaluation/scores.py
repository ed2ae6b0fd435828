"""All measures of predicted labels against the truth, at once.

`evaluate` pairs recordings, and gives every measure of this package four times: over all
recordings as if they were one (as the thesis, 2012, section 5.4, does), as the
mean over recordings, for each recording, and for each class.

Conventions: times in seconds; frames are sampled only for P1, R1, F1 and the confusion;
what is undefined follows `motionary.evaluation.counts`.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from motionary.errors import InvalidInput, WrongKind
from motionary.evaluation.counts import (
    RATE_HZ,
    Confusion,
    Counts,
    LabelledSegment,
    Labels,
    Rates,
    check_rate,
    compute_rates,
    confuse_frames,
    count_frames,
    list_names,
    pool_counts,
    to_segments,
)
from motionary.evaluation.ranking import IOUS, compute_mean_average_precision
from motionary.evaluation.segments import (
    TOLERANCE_S,
    BoundaryError,
    compute_boundary_error,
    compute_boundary_offsets,
    compute_edit_distance,
    count_edits,
    count_false,
    count_matches,
    count_overlaps,
)
from motionary.tables import enumerate_names

Recordings: TypeAlias = Mapping[str, Labels] | Iterable[tuple[str, Labels]]
Missing: TypeAlias = Literal["error", "skip", "empty"]

# Overlaps at which Lea et al. (2017) report segment F1.
SEGMENT_IOUS = (0.1, 0.25, 0.5)


class _Compared(NamedTuple):
    """Both tables of one recording, in seconds."""

    name: str
    predicted: list[LabelledSegment]
    truth: list[LabelledSegment]
    seconds: float  # its length, at least up to its last label

    def restricted(self, names: Collection[str]) -> "_Compared":
        """As if there were no labels of other names."""
        claimed, real = ([s for s in one if s.name in names] for one in self[1:3])
        return self._replace(predicted=claimed, truth=real)


@dataclass(frozen=True, slots=True)
class Measures:
    """All measures of some labels.

    Attributes
    ----------
    frames : P1, R1, F1
    segments : P2, R2, F2
    segment_f : segment F1 by least IoU
    edit_score : is the order of labels right, in [0, 1]
    boundary : distance of the ends of matched segments, seconds
    mean_average_precision : by least IoU; of one class its average precision
    edits_per_minute : corrections to a correct labelling
    false_per_minute : predicted segments that overlap no true one of their class
    minutes : length of what was labelled
    """

    frames: Rates
    segments: Rates
    segment_f: Mapping[float, float]
    edit_score: float
    boundary: BoundaryError
    mean_average_precision: Mapping[float, float]
    edits_per_minute: float
    false_per_minute: float
    minutes: float

    def as_dict(self) -> dict[str, Any]:
        """The numbers for JSON; None for what is undefined."""
        values: dict[str, Any] = _to_json(
            {
                "frames": self.frames._asdict(),
                "segments": self.segments._asdict(),
                "segment_f": self.segment_f,
                "edit_score": self.edit_score,
                "boundary_s": self.boundary._asdict(),
                "mean_average_precision": self.mean_average_precision,
                "edits_per_minute": self.edits_per_minute,
                "false_per_minute": self.false_per_minute,
                "minutes": self.minutes,
            }
        )
        return values


@dataclass(frozen=True, slots=True)
class Scores:
    """The result of `evaluate`.

    Attributes
    ----------
    concatenated : all recordings as if they were one
    mean : mean of `recordings`, without what is undefined; `boundary.matched` is a sum
    recordings : by recording
    classes : by class, all recordings as one, as if there were no other class
    confusion : by frames; row true, column predicted
    rate_hz : frames per second of `frames` and `confusion`
    tolerance_s : distance of an end that is no edit
    skipped : recordings that only one side has, left out on request
    """

    concatenated: Measures
    mean: Measures
    recordings: Mapping[str, Measures]
    classes: Mapping[str, Measures]
    confusion: Confusion
    rate_hz: float
    tolerance_s: float
    skipped: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """The numbers for JSON; None for what is undefined."""
        return {
            "rate_hz": self.rate_hz,
            "tolerance_s": self.tolerance_s,
            "concatenated": self.concatenated.as_dict(),
            "mean": self.mean.as_dict(),
            "recordings": {name: one.as_dict() for name, one in self.recordings.items()},
            "classes": {name: one.as_dict() for name, one in self.classes.items()},
            "confusion": {
                "names": list(self.confusion.names),
                "matrix": self.confusion.matrix.tolist(),
            },
            "skipped": list(self.skipped),
        }


def evaluate(
    predicted: Recordings,
    truth: Recordings,
    *,
    rate_hz: float = RATE_HZ,
    tolerance_s: float = TOLERANCE_S,
    durations_s: Mapping[str, float] | None = None,
    missing: Missing = "error",
    classes: Collection[str] | None = None,
) -> Scores:
    """Scores of predicted labels against the truth.

    Parameters
    ----------
    predicted, truth : mapping of recording to labels, or iterable of such pairs
        A label has `name`, `start_s`, `end_s` and perhaps a `cost`; a `LabelTrack` is an
        iterable of labels. Without costs average precision is that of one big tie.
    rate_hz : float
        Frames per second at which labels are sampled.
    tolerance_s : float
        Distance of a start or an end that needs no correction.
    durations_s : mapping of recording to seconds, optional
        Else the `duration_s` of a track, else the end of a recording's last label. It
        matters for numbers per minute and for frames that neither side labels.
    missing : {"error", "skip", "empty"}
        What to do with recordings that only one side has: raise, leave them out, or take
        them as recordings without labels (which have no row in a table).
    classes : collection of str, optional
        Count only labels of these, on both sides; the others are as if not there. For a
        truth with classes that the predictor was not trained for.

    Returns
    -------
    Scores

    Raises
    ------
    InvalidInput
        If the recordings are not the same (unless `missing` allows it), there is none,
        or a label is malformed.
    """
    compared, skipped = _pair(predicted, truth, durations_s or {}, missing)
    if isinstance(classes, str):
        raise InvalidInput(f"classes need a list of names, got the one text {classes!r}")
    if classes is not None:
        compared = [one.restricted(frozenset(classes)) for one in compared]
    rate = check_rate(rate_hz)
    names = list_names(*(side for one in compared for side in (one.predicted, one.truth)))
    recordings = {one.name: _measure([one], rate, tolerance_s) for one in compared}
    return Scores(
        concatenated=_measure(compared, rate, tolerance_s),
        mean=_average(list(recordings.values())),
        recordings=recordings,
        classes={
            name: _measure([one.restricted((name,)) for one in compared], rate, tolerance_s)
            for name in names
        },
        confusion=_confuse(compared, rate, tuple(names)),
        rate_hz=rate,
        tolerance_s=tolerance_s,
        skipped=skipped,
    )


def _measure(compared: Sequence[_Compared], rate_hz: float, tolerance_s: float) -> Measures:
    pairs = [(one.predicted, one.truth) for one in compared]
    minutes = sum(one.seconds for one in compared) / 60
    offsets = [compute_boundary_offsets(*pair) for pair in pairs]
    precisions = compute_mean_average_precision(*zip(*pairs, strict=True), ious=IOUS)
    edits = sum(count_edits(*pair, tolerance=tolerance_s) for pair in pairs)
    false = sum(count_false(*pair) for pair in pairs)
    return Measures(
        frames=_pool(count_frames(*pair, rate_hz=rate_hz) for pair in pairs),
        segments=_pool(count_overlaps(*pair) for pair in pairs),
        segment_f={
            iou: _pool(count_matches(*pair, iou=iou) for pair in pairs).f for iou in SEGMENT_IOUS
        },
        edit_score=_pool_edit_scores(pairs),
        boundary=compute_boundary_error(np.concatenate(offsets)),
        mean_average_precision=dict(zip(IOUS, precisions.tolist(), strict=True)),
        edits_per_minute=edits / minutes if minutes else math.nan,
        false_per_minute=false / minutes if minutes else math.nan,
        minutes=minutes,
    )


def _pool(counts: Iterable[Mapping[str, Counts]]) -> Rates:
    return compute_rates(pool_counts(row for one in counts for row in one.values()))


def _pool_edit_scores(
    pairs: Sequence[tuple[list[LabelledSegment], list[LabelledSegment]]],
) -> float:
    """Edit score of recordings one after the other, none mixed with the next."""
    longest = sum(max(len(claimed), len(real)) for claimed, real in pairs)
    return 1 - sum(compute_edit_distance(*pair) for pair in pairs) / max(longest, 1)


def _average(rows: Sequence[Measures]) -> Measures:
    return Measures(
        frames=Rates(*(_mean(row.frames[k] for row in rows) for k in range(3))),
        segments=Rates(*(_mean(row.segments[k] for row in rows) for k in range(3))),
        segment_f={iou: _mean(row.segment_f[iou] for row in rows) for iou in SEGMENT_IOUS},
        edit_score=_mean(row.edit_score for row in rows),
        boundary=BoundaryError(
            _mean(row.boundary.median for row in rows),
            _mean(row.boundary.mean for row in rows),
            sum(row.boundary.matched for row in rows),
        ),
        mean_average_precision={
            iou: _mean(row.mean_average_precision[iou] for row in rows) for iou in IOUS
        },
        edits_per_minute=_mean(row.edits_per_minute for row in rows),
        false_per_minute=_mean(row.false_per_minute for row in rows),
        minutes=_mean(row.minutes for row in rows),
    )


def _mean(values: Iterable[float]) -> float:
    """Mean of what is defined, NaN if nothing is."""
    defined = [value for value in values if not math.isnan(value)]
    return math.fsum(defined) / len(defined) if defined else math.nan


def _confuse(compared: Sequence[_Compared], rate_hz: float, names: tuple[str, ...]) -> Confusion:
    matrices = [
        confuse_frames(
            one.predicted, one.truth, rate_hz=rate_hz, duration=one.seconds, names=names
        ).matrix
        for one in compared
    ]
    return Confusion(names, np.sum(matrices, axis=0))


def _to_json(value: Any) -> Any:
    if isinstance(value, Mapping):
        keys = (key if isinstance(key, str) else f"{key:g}" for key in value)
        return dict(zip(keys, map(_to_json, value.values()), strict=True))
    return None if isinstance(value, float) and math.isnan(value) else value


# -- which tables belong together ------------------------------------------------------------


def _pair(
    predicted: Recordings, truth: Recordings, durations_s: Mapping[str, float], missing: Missing
) -> tuple[list[_Compared], tuple[str, ...]]:
    """Recordings, sorted by name, and the names of recordings that were left out."""
    claimed = _to_mapping(predicted, side="the prediction")
    real = _to_mapping(truth, side="the truth")
    chosen = _choose(set(claimed), set(real), missing)
    compared = [
        _compare(name, claimed.get(name, ()), real.get(name, ()), durations_s.get(name))
        for name in sorted(chosen)
    ]
    return compared, tuple(sorted((set(claimed) | set(real)) - chosen))


def _choose(claimed: set[str], real: set[str], missing: Missing) -> set[str]:
    if missing not in ("error", "skip", "empty"):
        raise InvalidInput(f'missing must be "error", "skip" or "empty", got {missing!r}')
    if missing == "error" and claimed != real:
        raise InvalidInput(
            "prediction and truth must label the same recordings; "
            f"only in the prediction: {enumerate_names(sorted(claimed - real))}; "
            f"only in the truth: {enumerate_names(sorted(real - claimed))}; "
            'pass missing="skip" to leave them out, "empty" to count them as without labels'
        )
    chosen = claimed | real if missing == "empty" else claimed & real
    if not chosen:
        raise InvalidInput(
            "there is no recording to evaluate; "
            f"in the prediction: {enumerate_names(sorted(claimed))}; "
            f"in the truth: {enumerate_names(sorted(real))}"
        )
    return chosen


def _to_mapping(recordings: Recordings, *, side: str) -> dict[str, Labels]:
    if hasattr(recordings, "recording"):
        recordings = [recordings]  # type: ignore[list-item]
    if not isinstance(recordings, Iterable) or isinstance(recordings, str):
        raise WrongKind(f"{side}: expected labels by recording, got {type(recordings).__name__}")
    items: Iterable[Any] = recordings.items() if isinstance(recordings, Mapping) else recordings
    mapping: dict[str, Labels] = {}
    for item in items:
        if hasattr(item, "recording"):
            # A track, which knows what it is of.
            item = (item.recording.name, item)
        if not (isinstance(item, tuple) and len(item) == 2 and isinstance(item[0], str)):
            raise InvalidInput(
                f"{side}: expected a mapping of recording to labels or pairs "
                f"(recording, labels), got {item!r}"
            )
        name, labels = item
        if name in mapping:
            raise InvalidInput(f"{side}: recording {name!r} comes twice; join its labels")
        mapping[name] = labels
    return mapping


def _compare(
    recording: str, predicted: Labels, truth: Labels, duration_s: float | None
) -> _Compared:
    told = (duration_s, getattr(truth, "duration_s", None), getattr(predicted, "duration_s", None))
    seconds = next((value for value in told if value is not None), 0.0)
    if not (math.isfinite(seconds) and seconds >= 0):
        raise InvalidInput(
            f"the duration of {recording} must be finite and not negative, got {seconds}"
        )
    claimed = to_segments(predicted, where=f"the prediction of {recording}")
    real = to_segments(truth, where=f"the truth of {recording}")
    # A table may be rounded up past the end of its recording.
    last = max((segment.end for segment in (*claimed, *real)), default=0.0)
    return _Compared(recording, claimed, real, max(seconds, last))
