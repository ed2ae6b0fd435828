"""Labels, and the track of all labels of a recording.

Conventions: times in seconds from the recording's first frame, half-open; frames as the
file counts them, inclusive, as people look them up.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from motionary.errors import InvalidInput
from motionary.recording import Recording, Segment


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
    false_per_min : false labels of the class a minute, of this score or a higher one, that
        are to be expected; None if unknown
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
        if not self.start_s <= self.end_s:
            raise InvalidInput(
                f"label {self.name!r}: start must not come after end, "
                f"got {self.start_s} to {self.end_s} s"
            )


@dataclass(frozen=True, slots=True)
class LabelTrack:
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
        order = tuple(sorted(self.labels, key=lambda x: (x.start_s, x.end_s, x.name)))
        object.__setattr__(self, "labels", order)

    def __iter__(self) -> Iterator[Label]:
        return iter(self.labels)

    def __len__(self) -> int:
        return len(self.labels)

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
