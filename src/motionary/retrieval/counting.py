"""How often each class occurs in a recording, how long and how regularly.

Conventions: seconds; rates a minute; a label without a side counts under the empty side.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean, median

from motionary.errors import check_kind
from motionary.labels import Label, LabelTrack
from motionary.tables import Table, Tabular


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
