"""Tables of labels: how they are checked, and which belong to the same recording.

Every measure compares two tables of `LabelledSegment`: what was predicted and what is true.
Where a segment comes from (a `Label`, a row of a file, an array) does not matter here. A
recording is known by its name, as the two sides write it.

Conventions: half-open, `start` belongs to the segment and `end` does not; seconds or frames,
as long as both tables use the same; segments may overlap and come in any order.
"""

import math
import unicodedata
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, WrongKind
from motionary.tables import enumerate_names

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
Recordings: TypeAlias = Mapping[str, Labels] | Iterable[tuple[str, Labels]]
Missing: TypeAlias = Literal["error", "skip", "empty"]


class ComparedRecording(NamedTuple):
    """Both tables of one recording.

    Attributes
    ----------
    name : name of the recording
    predicted, truth : in seconds
    seconds : length of the recording, at least up to its last label
    """

    name: str
    predicted: list[LabelledSegment]
    truth: list[LabelledSegment]
    seconds: float


def check_segments(
    segments: Iterable[LabelledSegment], *, where: str = "the table"
) -> list[LabelledSegment]:
    """The segments as a list, in the given order.

    Parameters
    ----------
    segments : iterable of LabelledSegment
    where : what an error calls the table

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


def pair_recordings(
    predicted: Recordings,
    truth: Recordings,
    *,
    durations_s: Mapping[str, float],
    missing: Missing = "error",
    classes: Collection[str] | None = None,
) -> tuple[list[ComparedRecording], tuple[str, ...]]:
    """Recordings, sorted by name, and the names of recordings that were left out.

    Parameters are those of `motionary.evaluation.evaluate`.
    """
    claimed = _to_mapping(predicted, side="the prediction")
    real = _to_mapping(truth, side="the truth")
    chosen = _choose(set(claimed), set(real), missing)
    compared = [
        _to_compared(name, claimed.get(name, ()), real.get(name, ()), durations_s.get(name))
        for name in sorted(chosen)
    ]
    if classes is not None:
        kept = _check_classes(classes)
        compared = [_keep(one, kept) for one in compared]
    return compared, tuple(sorted((set(claimed) | set(real)) - chosen))


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


def _to_compared(
    recording: str,
    predicted: Labels,
    truth: Labels,
    duration_s: float | None,
) -> ComparedRecording:
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
    return ComparedRecording(recording, claimed, real, max(seconds, last))


def _check_classes(classes: Collection[str]) -> frozenset[str]:
    if isinstance(classes, str):
        raise InvalidInput(f"classes need a list of names, got the one text {classes!r}")
    return frozenset(classes)


def _keep(one: ComparedRecording, classes: frozenset[str]) -> ComparedRecording:
    return one._replace(
        predicted=[segment for segment in one.predicted if segment.name in classes],
        truth=[segment for segment in one.truth if segment.name in classes],
    )
