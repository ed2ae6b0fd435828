"""Labels, the track of all labels of a recording, and how often each class occurs.

Conventions: times in seconds from the recording's first frame, half-open; frames as the
file counts them, inclusive, as people look them up.
"""

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from numbers import Real
from statistics import fmean, median
from typing import Any, Literal, NamedTuple

from motionary.errors import InvalidInput, check_kind
from motionary.recording import Recording, Segment
from motionary.tables import Table, Tabular

#: Ends of labels that differ by less are the same: formats round to milliseconds.
SAME_S = 0.0005 + 1e-9
# Overlap from which a label of another name is taken for the same one renamed.
_RENAMED_IOU = 0.5

# Of a label, in tables; the first one is called "label" there.
_COLUMNS = (
    "name", "start_s", "end_s", "start_frame", "end_frame", "cost", "known", "score",
    "probability", "false_per_min", "side",
)  # fmt: skip
# So many names of labels stand in a track's short form.
_SHOWN = 6


@dataclass(frozen=True, slots=True)
class Label:
    """A named segment of a recording.

    Attributes
    ----------
    name : class
    start_s, end_s : seconds, half-open
    start_frame, end_frame : the file's own frame numbers, inclusive; None if unknown
    cost : smallest matching cost within; None for labels made by hand
    known : fraction of the features that were seen, in [0, 1]
    evidence : what `explain` needs; None for labels that were read from a table
    score : what its frames tell for the class against motion in general; None for labels
        that were assigned by costs or made by hand
    probability : that the label is right; None if unknown
    false_per_min : false labels of the class, of this score or a higher one, that are to be
        expected in a minute of motion without right labels; None if unknown
    side : "as learned" or "mirrored", where the class is learned with its mirror image and
        differs from it; else empty
    extra : further columns of the table it was read from, as text
    """

    name: str
    start_s: float
    end_s: float
    cost: float | None = None
    known: float = 1.0
    start_frame: int | None = None
    end_frame: int | None = None
    evidence: Any = field(default=None, compare=False, repr=False)
    extra: Mapping[str, str] = field(default_factory=dict, compare=False)
    score: float | None = None
    probability: float | None = None
    false_per_min: float | None = None
    side: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            raise InvalidInput("a label needs a name")
        for time in (self.start_s, self.end_s):
            check_kind(time, (Real,), name="a time", remedy="give seconds as a number")
        if not -math.inf < self.start_s <= self.end_s < math.inf:
            raise InvalidInput(
                f"label {self.name[:40]!r}: times must be finite and start must not come after "
                f"end, got {self.start_s} to {self.end_s} s"
            )


def label_frames(
    recording: Recording, name: str, first: int, stop: int, extra: Mapping[str, str]
) -> Label:
    """The label of frames of a recording, counted from its first one, `stop` one past the last."""
    return Label(
        name,
        float(first / recording.rate_hz),
        float(stop / recording.rate_hz),
        start_frame=int(recording.first_frame + first),
        end_frame=int(recording.first_frame + stop - 1),
        extra=extra,
    )


@dataclass(frozen=True, slots=True)
class LabelTrack(Tabular):
    """Labels of one recording, sorted by start; they may overlap.

    Attributes
    ----------
    recording : what the labels are of
    labels : sorted by start, end, name
    unassessed : segments of which too little was seen to judge
    nearest : for a track without labels, a sentence on the class that came closest
    """

    recording: Recording
    labels: tuple[Label, ...] = ()
    unassessed: tuple[Segment, ...] = ()
    nearest: str = ""

    def __post_init__(self) -> None:
        remedy = "LabelTrack(Recording(name), [Label(name, start_s, end_s), ...])"
        check_kind(self.recording, (Recording,), name="recording", remedy=remedy)
        for label in self.labels:
            check_kind(label, (Label,), name="a label", remedy=remedy)
        order = tuple(sorted(self.labels, key=lambda x: (x.start_s, x.end_s, x.name)))
        object.__setattr__(self, "labels", order)

    def __repr__(self) -> str:
        counts = Counter(label.name for label in self.labels)
        said = ", ".join(f"{name} {n}" for name, n in sorted(counts.items())[:_SHOWN])
        more = ", ..." if len(counts) > _SHOWN else ""
        return (
            f"LabelTrack({self.recording.name!r}, {len(self)} labels: {said or 'none'}{more}; "
            f"{len(self.unassessed)} unassessed segments)"
        )

    def joined(self, other: "LabelTrack") -> "LabelTrack":
        """The labels of two tracks of one recording."""
        return replace(
            self,
            recording=self.recording if self.rate_hz else other.recording,
            labels=(*self.labels, *other.labels),
            unassessed=tuple(sorted({*self.unassessed, *other.unassessed})),
        )

    def renamed(self, name: str) -> "LabelTrack":
        """The labels under another name of their recording."""
        return replace(self, recording=self.recording.renamed(name))

    def list_rows(self) -> Table:
        """A row for each label and for each segment that was not assessed, by time."""
        further = dict.fromkeys(column for label in self for column in label.extra)
        columns = tuple(column for column in further if column not in _COLUMNS)
        rows = [
            (
                *(getattr(label, column) for column in _COLUMNS),
                False,
                *(label.extra.get(column) for column in columns),
            )
            for label in self
        ]
        for segment in self.unassessed:
            empty = (None,) * (len(_COLUMNS) - 3)
            rows.append((None, *segment, *empty, True, *[None] * len(columns)))
        named = [(self.recording.name, *row) for row in sorted(rows, key=lambda row: row[1:3])]
        return Table(("recording", "label", *_COLUMNS[1:], "unassessed", *columns), named)

    def __iter__(self) -> Iterator[Label]:
        return iter(self.labels)

    def __len__(self) -> int:
        return len(self.labels)

    def show(self, motion: Any = None) -> Any:
        """A page of the labels, over the motion that they are of; notebooks show it.

        Parameters
        ----------
        motion : the recording; without it labels stand over the features that they were
            found by, and over nothing where they were read from a table

        Returns
        -------
        motionary.reporting.Page
        """
        # Late, through the front door: pages know labels, not the other way round.
        from motionary import report

        found = (label.evidence.sequence for label in self if label.evidence is not None)
        shown = next(found, self.recording) if motion is None else motion
        if shown is self.recording and self.duration_s is None:
            last_s = max((label.end_s for label in self), default=0.0)
            shown = replace(self.recording, rate_hz=30.0, n_frames=math.ceil(30.0 * last_s))
        return report(shown, labels=self)

    @property
    def duration_s(self) -> float | None:
        """Length of the recording in seconds; None if unknown."""
        return self.recording.duration_s or None

    @property
    def rate_hz(self) -> float | None:
        """Frames per second of the recording; None if unknown."""
        return self.recording.rate_hz or None

    @property
    def names(self) -> tuple[str, ...]:
        """Names that occur, sorted."""
        return tuple(sorted({label.name for label in self.labels}))


class Change(NamedTuple):
    """What became of a label.

    Attributes
    ----------
    kind : "kept", "moved" (its ends), "renamed" (its ends, too, perhaps), "added", "removed"
    before, after : the label in the one track and in the other; None where it is not
    """

    kind: Literal["kept", "moved", "renamed", "added", "removed"]
    before: Label | None
    after: Label | None


def compare_labels(
    before: Iterable[Label], after: Iterable[Label], *, tolerance_s: float = SAME_S
) -> list[Change]:
    """What became of each label, sorted by start.

    Labels are paired one to one: those that are equal first, then those of one name that
    overlap, the most first, then those of other names that overlap by half.

    Parameters
    ----------
    before, after : labels of one recording
    tolerance_s : ends that differ by no more are the same
    """
    old, new = list(before), sorted(after, key=lambda label: label.start_s)
    pairs = sorted(_candidates(old, new, tolerance_s))
    free_old, free_new = set(range(len(old))), set(range(len(new)))
    changes = []
    for _, i, j in pairs:
        if i in free_old and j in free_new:
            free_old.discard(i)
            free_new.discard(j)
            changes.append(Change(_kind(old[i], new[j], tolerance_s), old[i], new[j]))
    changes += [Change("removed", old[i], None) for i in free_old]
    changes += [Change("added", None, new[j]) for j in free_new]
    return sorted(changes, key=_place)


def _candidates(
    old: list[Label], new: list[Label], tolerance_s: float
) -> Iterator[tuple[tuple[int, float], int, int]]:
    """Pairs that may be one label, with their rank: smaller first."""
    longest = max((label.end_s - label.start_s for label in new), default=0.0)
    starts = [label.start_s for label in new]
    for i, one in enumerate(old):
        first = bisect_left(starts, one.start_s - longest - tolerance_s)
        for j in range(first, bisect_left(starts, one.end_s + tolerance_s + 1e-9)):
            other = new[j]
            iou = _iou(one, other)
            if _kind(one, other, tolerance_s) == "kept":
                yield (0, -iou), i, j
            elif one.name == other.name and iou > 0:
                yield (1, -iou), i, j
            elif iou >= _RENAMED_IOU:
                yield (2, -iou), i, j


def _iou(one: Label, other: Label) -> float:
    both = min(one.end_s, other.end_s) - max(one.start_s, other.start_s)
    union = max(one.end_s, other.end_s) - min(one.start_s, other.start_s)
    return both / union if union > 0 else 0.0


def _kind(one: Label, other: Label, tolerance_s: float) -> Literal["kept", "moved", "renamed"]:
    if one.name != other.name:
        return "renamed"
    shifts = abs(one.start_s - other.start_s), abs(one.end_s - other.end_s)
    return "kept" if max(shifts) <= tolerance_s else "moved"


def _place(change: Change) -> tuple[float, float, str]:
    return min(
        (label.start_s, label.end_s, label.name) for label in change[1:] if label is not None
    )


def of_recording(track: LabelTrack, recording: Recording) -> LabelTrack:
    """The track as one of a recording, whose rate and length it then knows.

    Raises
    ------
    InvalidInput
        If a label ends more than a frame after the recording: it is of another one.
    """
    late = [label for label in track if label.end_s > recording.duration_s + 1 / recording.rate_hz]
    if late:
        raise InvalidInput(
            f"{recording.name}: lasts {recording.duration_s:.2f} s, and a label ends at "
            f"{late[0].end_s:.2f} s ({late[0].name!r}); are the labels of another recording?"
        )
    return replace(track, recording=recording)


# -- counts -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ClassCount:
    """Occurrences of one class on one side in one recording.

    Attributes
    ----------
    recording : its name
    name : of the class
    side : "as learned" or "mirrored"; empty where the class has no sides
    number : of labels
    durations_s : of the labels, in their order
    starts_s : starts of the labels
    unassessed_s : seconds of the recording of which too little was seen to judge
    """

    recording: str
    name: str
    side: str
    number: int
    durations_s: tuple[float, ...]
    starts_s: tuple[float, ...]
    unassessed_s: float

    @property
    def mean_s(self) -> float:
        """Mean duration."""
        return fmean(self.durations_s) if self.durations_s else 0.0

    @property
    def total_s(self) -> float:
        """Sum of the durations."""
        return float(sum(self.durations_s))

    @property
    def per_min(self) -> float | None:
        """Repetitions a minute, by the median time from start to start; None of one label."""
        gaps = [after - before for before, after in pairwise(self.starts_s)]
        typical = median(gaps) if gaps else 0.0
        return 60.0 / typical if typical > 0 else None


class ClassCounts(list[ClassCount], Tabular):
    """Counts by recording, class and side."""

    __slots__ = ()

    def __repr__(self) -> str:
        recordings = {one.recording for one in self}
        return f"ClassCounts({len(self)} classes in {len(recordings)} recordings)"

    def list_rows(self) -> Table:
        """A row for each class and side of a recording."""
        columns = ("recording", "name", "side", "number", "mean_s", "total_s", "per_min",
                   "unassessed_s")  # fmt: skip
        rows = [tuple(getattr(one, column) for column in columns) for one in self]
        return Table(("recording", "label", *columns[2:]), rows)


def count(tracks: LabelTrack | Iterable[LabelTrack]) -> ClassCounts:
    """Occurrences by recording, class and side.

    Parameters
    ----------
    tracks : of `annotate`, or labels made by hand

    Returns
    -------
    ClassCounts, a list of ClassCount in the order of the tracks, then by class and side
    """
    remedy = "count what annotate returns, or LabelTrack(Recording(name), labels)"
    check_kind(tracks, (Iterable,), name="tracks", remedy=remedy)
    given = [tracks] if isinstance(tracks, LabelTrack) else list(tracks)
    for track in given:
        check_kind(track, (LabelTrack,), name="a track", remedy=remedy)
    return ClassCounts(one for track in given for one in _count_track(track))


def _count_track(track: LabelTrack) -> list[ClassCount]:
    kinds: dict[tuple[str, str], list[Label]] = {}
    for label in track:
        kinds.setdefault((label.name, label.side), []).append(label)
    unassessed_s = float(sum(segment.duration_s for segment in track.unassessed))
    return [
        ClassCount(
            track.recording.name,
            name,
            side,
            len(labels),
            tuple(label.end_s - label.start_s for label in labels),
            tuple(label.start_s for label in labels),
            unassessed_s,
        )
        for (name, side), labels in sorted(kinds.items())
    ]
