"""What does a search find?"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from motionary.batch import Failure
from motionary.features import NamedFile
from motionary.models.keyframes import KeyframeQuery
from motionary.models.templates import MotionTemplate
from motionary.retrieval.explanation import Evidence


@dataclass(frozen=True, slots=True)
class Hit:
    """A stretch of a recording that matches.

    Attributes
    ----------
    recording : name of the recording
    start_s, end_s : seconds, half-open
    start_frame, end_frame : the file's own frame numbers, inclusive
    cost : 0 fits in every relation
    known : share of the asked-for relations that were seen, in [0, 1]
    evidence : what `explain` needs
    """

    recording: str
    start_s: float
    end_s: float
    start_frame: int
    end_frame: int
    cost: float
    known: float
    evidence: Evidence = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult(Sequence[Hit]):
    """Hits, best first, and what they were found with.

    Attributes
    ----------
    hits : best first
    templates : what was sought; grown from the example where one was given
    failures : files that could not be read, and why
    nearest : without hits, a sentence on what came closest
    queries : keyframes that chose where to match; none if everything was matched
    share_matched : share of all frames that was matched
    """

    hits: tuple[Hit, ...]
    templates: tuple[MotionTemplate, ...]
    failures: tuple[Failure[NamedFile], ...] = ()
    nearest: str = ""
    queries: tuple[KeyframeQuery, ...] = ()
    fraction_matched: float = 1.0

    def __len__(self) -> int:
        return len(self.hits)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        return self.hits[index]

    def __iter__(self) -> Iterator[Hit]:
        return iter(self.hits)


def hit_of(evidence: Evidence) -> Hit:
    """The hit that stands on some evidence."""
    sequence, alignment = evidence.sequence, evidence.alignment
    start_s, end_s = sequence.seconds(alignment.start), sequence.seconds(alignment.end + 1)
    return Hit(
        recording=sequence.source,
        start_s=start_s,
        end_s=end_s,
        start_frame=sequence.file_frame(start_s),
        end_frame=sequence.last_file_frame(end_s),
        cost=alignment.cost,
        known=evidence.known,
        evidence=evidence,
    )
