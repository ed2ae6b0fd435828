"""Labels of a motion that is still going on.

Positions arrive in chunks of any size; labels that are final are, in all, those that
`annotate` gives for the whole recording. Until then they are provisional: what the labels
would be if nothing more came.

Conventions: times in seconds from the first pose; frames of features are at 30 Hz.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import SEQUENCE_HZ, FeatureSequence, FeatureStream, motion_from_array
from motionary.features.body import Floats
from motionary.labels import Label
from motionary.live.assignment import (
    Arrays,
    Decisions,
    Detail,
    Found,
    encode,
    read_state,
    restore,
    save_state,
)
from motionary.live.poses import EvenTimes
from motionary.matching import StreamedPath
from motionary.models.library import ClassLibrary, load_everyday, thresholds_for
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.packing import PackedFeatures, count, count_integers
from motionary.recording import Recording, Segment
from motionary.retrieval.explanation import ASSESSED_FROM, Evidence, explain
from motionary.retrieval.labelling import find_evidence, make_label

Status = Literal["provisional", "revised", "withdrawn", "final", "unassessed"]

# Provisional labels are looked at every so many frames of features.
_EVERY = 3
# A provisional label that moved or changed by less is not told again.
_MOVED_S, _SURER = 0.2, 0.1
_N_REASONS = 3


@dataclass(frozen=True, slots=True)
class LiveEvent:
    """What became known of one label.

    Attributes
    ----------
    status : "provisional" when it is first foreseen, "revised" when it changed,
        "withdrawn" when it is no longer foreseen, and "final", after which it stays;
        "unassessed" of a segment that is over, of which too little was seen to judge
    id : the same for all events of one label, counted from 1
    label : as it is now
    why : of a final label, what told most for it, in words
    """

    status: Status
    id: int
    label: Label
    why: tuple[str, ...] = ()


class LiveAnnotator:
    """Labels of one person's motion while it goes on.

    Parameters
    ----------
    library : with scores; by default the library of everyday motion that ships
    rate_hz : poses per second; poses that come with times of their own are brought to it
    skeleton : the joints of a pose, as `compute_features` takes them
    threshold, at_most_false_per_min : as `annotate` takes them
    name : of the recording

    Raises
    ------
    InvalidInput
        If the rate is too low, the skeleton unknown, or the library has no scores.
    """

    REMEMBERED = (
        "_recording", "_times", "_features", "_matches", "_packed", "_known", "_told", "_n_ids",
        "_looked_at", "_unseen_since", "is_finished",
    )  # fmt: skip

    def __init__(
        self,
        library: ClassLibrary | None = None,
        *,
        rate_hz: float,
        skeleton: str | Sequence[str] | None = None,
        threshold: float | None = None,
        at_most_false_per_min: float | None = None,
        name: str = "live",
    ) -> None:
        if not 1.0 <= rate_hz < np.inf:
            raise InvalidInput(f"rate_hz must be at least 1 pose per second, got {rate_hz}")
        library = load_everyday() if library is None else library
        if threshold is not None and at_most_false_per_min is not None:
            raise InvalidInput("threshold or at_most_false_per_min: give one, not both")
        least = thresholds_for(library, at_most_false_per_min, given=threshold)
        self.library, self._skeleton = library, skeleton
        self._settings: dict[str, Any] = {
            "rate_hz": rate_hz,
            "skeleton": skeleton if skeleton is None or isinstance(skeleton, str) else [*skeleton],
            "threshold": threshold,
            "at_most_false_per_min": at_most_false_per_min,
        }
        self._recording = Recording(name, rate_hz=rate_hz)
        self._times = EvenTimes(rate_hz)
        self._features = FeatureStream(library.feature_set, rate_hz)
        self._matches = Decisions(library, least, self._judge)
        n_integers = count_integers(len(library.feature_set))
        self._packed = np.empty((0, n_integers), dtype=np.uint64)
        self._known = self._packed.copy()
        self._first_motion: Motion | None = None
        #: The last pose, shape (24, 3), metres, of the generic joints.
        self.pose: Floats = np.full((len(GENERIC_JOINTS), 3), np.nan)
        self._told: dict[int, Label] = {}
        self._n_ids = 0
        self._looked_at = 0
        self._unseen_since: int | None = None
        self.is_finished = False

    def save(self, path: str | Path) -> None:
        """Write what the stream remembers into a file (npz), to go on from there later."""
        arrays: Arrays = {}
        save_state(path, self.to_state(arrays), arrays, self.library)

    def to_state(self, arrays: Arrays) -> dict[str, Any]:
        """What the stream remembers as JSON has it, with the numbers of its arrays."""
        return {"settings": self._settings, "state": encode(self, arrays)}

    @classmethod
    def from_state(
        cls, content: Mapping[str, Any], arrays: Arrays, library: ClassLibrary
    ) -> "LiveAnnotator":
        """The stream of what `to_state` gave."""
        stream = cls(library, **content["settings"])
        restore(stream, content["state"], arrays)
        return stream

    @classmethod
    def resume(cls, path: str | Path, library: ClassLibrary | None = None) -> "LiveAnnotator":
        """The stream that was saved: its further events are those without the break.

        Raises
        ------
        UnreadableFile
            If the file is none that `save` wrote, or damaged.
        InvalidInput
            If it was saved with another library.
        """
        library = load_everyday() if library is None else library
        content, arrays = read_state(path, library, ("settings", "state"))
        try:
            return cls.from_state(content, arrays, library)
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            raise UnreadableFile("damaged: its parts do not fit", file=str(path)) from error

    @property
    def look_ahead_s(self) -> float:
        """How long after its end a label of an event is final."""
        return self._features.delay_s + self._matches.look_ahead / SEQUENCE_HZ

    @property
    def rate_hz(self) -> float:
        """Poses per second."""
        return self._recording.rate_hz

    @property
    def duration_s(self) -> float:
        """Time that the poses so far last."""
        return self._recording.duration_s

    def push(self, positions: ArrayLike, times_s: ArrayLike | None = None) -> tuple[LiveEvent, ...]:
        """What poses make known.

        Parameters
        ----------
        positions : array, shape (joints, 3) or (poses, joints, 3), metres, y up, NaN where a
            joint is not seen
        times_s : when they were seen, by a clock of any beginning; all or none come with times

        Raises
        ------
        InvalidInput
            If the joints are not those of the skeleton, a time does not grow or is a minute
            later, or the stream has been finished. Nothing is kept of such poses.
        """
        if self.is_finished:
            raise InvalidInput("the stream is finished; a new recording needs a new annotator")
        array = np.asarray(positions, dtype=np.float64)
        array = array[np.newaxis] if array.ndim == 2 else array
        if len(array) == 0:
            return ()
        generic = self._to_generic(array)
        if times_s is not None:
            times = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
            if times.shape != (len(array),):
                raise InvalidInput(f"{len(array)} poses need as many times, got {times.shape}")
            generic = self._times.push(generic, times)
        n_frames = self._recording.n_frames + len(generic)
        self._recording = replace(self._recording, n_frames=n_frames)
        if len(generic):
            self.pose = generic[-1]
        return self._advance(*self._features.push(generic), at_end=False)

    def _to_generic(self, positions: Floats) -> Floats:
        """Positions of the generic joints; the skeleton is looked up once."""
        first = self._first_motion
        if first is not None and positions.shape[1:] == first.positions.shape[1:]:
            return replace(first, positions=positions).generic_positions()
        motion = motion_from_array(positions, self._recording.rate_hz, self._skeleton)
        if motion.mapping is not None and motion.mapping.normals:
            raise InvalidInput(
                f"the markers of {motion.mapping.name!r} give joints only over a whole recording; "
                "send joints, or markers that lie at them"
            )
        self._first_motion = motion
        return motion.generic_positions()

    def finish(self) -> tuple[LiveEvent, ...]:
        """What is left when no more poses come: all labels are final then."""
        if self.is_finished:
            return ()
        self.is_finished = True
        return self._advance(*self._features.finish(), at_end=True)

    def _advance(
        self, packed: PackedFeatures, known: PackedFeatures, *, at_end: bool
    ) -> tuple[LiveEvent, ...]:
        kept = self._matches.n_remembered
        self._packed = np.concatenate([self._packed, packed])
        self._known = np.concatenate([self._known, known])
        for row in zip(packed, known, strict=True):
            self._matches.push(*row)
        events = self._find_unassessed(known, at_end=at_end)
        for found in self._matches.decide(at_end=at_end):
            label, why = self._describe(found)
            number = _find(label, self._told) or self._new_id()
            events.append(LiveEvent("final", number, label, why))
            self._told.pop(number, None)
        n_frames = self._matches.n_frames
        if at_end or n_frames - self._looked_at >= _EVERY:
            self._looked_at = n_frames
            events += self._foresee(at_end)
        self._packed, self._known = self._packed[-kept:], self._known[-kept:]
        return tuple(events)

    def _find_unassessed(self, known: PackedFeatures, *, at_end: bool) -> list[LiveEvent]:
        """Segments that end in the last frames and of which too little was seen to judge."""
        events = []
        n_frames = self._matches.n_frames
        unseen = (count(known) / len(self.library.feature_set) < ASSESSED_FROM).tolist()
        # What is not seen up to the end ends there.
        last = [False] if at_end else []
        for frame, is_unseen in enumerate([*unseen, *last], start=n_frames - len(known)):
            if is_unseen and self._unseen_since is None:
                self._unseen_since = frame
            elif not is_unseen and self._unseen_since is not None:
                segment, self._unseen_since = self._segment(self._unseen_since, frame), None
                label = self._in_frames(Label("unassessed", segment.start_s, segment.end_s))
                events.append(LiveEvent("unassessed", self._new_id(), label))
        return events

    def _in_frames(self, label: Label) -> Label:
        """A label with the numbers of the frames of its times."""
        return replace(
            label,
            start_frame=self._recording.frame_at(label.start_s),
            end_frame=self._recording.last_frame_before(label.end_s),
        )

    @property
    def _sequence(self) -> FeatureSequence:
        """The last features, of the whole recording so far."""
        return FeatureSequence(self._packed, self._known, self.library.feature_set, self._recording)

    def _segment(self, start: int, stop: int) -> Segment:
        last = self._recording.duration_s
        return Segment(min(start / SEQUENCE_HZ, last), min(stop / SEQUENCE_HZ, last))

    def _evidence(self, path: StreamedPath) -> Evidence:
        first = self._matches.n_frames - len(self._packed)
        place = self._matches.places[path.pattern]
        return find_evidence(self._sequence, self.library, place, path.stop - first)

    def _judge(self, path: StreamedPath) -> Detail:
        """Label of a match, and what told most for it."""
        evidence = self._evidence(path)
        if not evidence.is_assessed:
            return None
        place, segment = self._matches.places[path.pattern], self._segment(path.start, path.stop)
        label = make_label(self.library, place, path.score, evidence, segment)
        gains = sorted(explain(evidence).gains, key=lambda gain: -gain.part)[:_N_REASONS]
        return replace(label, evidence=None), tuple(g.name for g in gains if g.part > 0)

    def _describe(self, found: Found) -> tuple[Label, tuple[str, ...]]:
        """Label of all matches of one that is open or final, and what told most for it."""
        segment = self._segment(found.start, found.stop)
        if found.detail is not None:
            label, why = found.detail
            label = replace(label, start_s=segment.start_s, end_s=segment.end_s)
            return self._in_frames(label), why
        place = self._matches.places[found.best.pattern]
        label = Label(
            self.library.names[place.class_index],
            segment.start_s,
            segment.end_s,
            cost=found.best.cost,
            score=found.best.score,
            probability=self._matches.probability_of(found.best),
        )
        return label, ()

    def _foresee(self, at_end: bool) -> list[LiveEvent]:
        """Provisional labels that are new, or not as they were told."""
        told, events = self._told, list[LiveEvent]()
        self._told = {}
        for found in [] if at_end else self._matches.foresee():
            label, _ = self._describe(found)
            number = _find(label, told)
            before = told.pop(number, None)
            number = number or self._new_id()
            if before is None or _differs(label, before):
                status: Status = "provisional" if before is None else "revised"
                events.append(LiveEvent(status, number, label))
                before = label
            self._told[number] = before
        return [LiveEvent("withdrawn", i, label) for i, label in told.items()] + events

    def _new_id(self) -> int:
        self._n_ids += 1
        return self._n_ids


def _find(label: Label, told: Mapping[int, Label]) -> int:
    """Number of the label of the same name that overlaps most; 0 without one."""
    overlaps = {
        i: min(label.end_s, other.end_s) - max(label.start_s, other.start_s)
        for i, other in told.items()
        if other.name == label.name
    }
    best = max(overlaps, key=lambda i: overlaps[i], default=0)
    return best if best and overlaps[best] > 0 else 0


def _differs(label: Label, before: Label) -> bool:
    moved = abs(label.start_s - before.start_s) + abs(label.end_s - before.end_s)
    surer = (label.probability or 0.0) - (before.probability or 0.0)
    return moved > _MOVED_S or abs(surer) > _SURER
