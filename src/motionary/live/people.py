"""Labels of several people at once, each by an annotator of their own."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from motionary.errors import InvalidInput, UnreadableFile
from motionary.features.body import Floats
from motionary.live.annotator import LiveAnnotator, LiveEvent
from motionary.live.assignment import Arrays, read_state, save_state
from motionary.live.poses import Pose, PoseLines
from motionary.models.library import ClassLibrary, load_everyday
from motionary.motion import GENERIC_JOINTS
from motionary.skeletons import named_mapping

# Of a clock that goes back by more, what follows is another recording.
_RESTART_S = 1.0
#: Who is not sent for longer has left; a return begins another recording.
ABSENT_S = 10.0
# Nobody sends so many people: a sender that numbers its poses instead would fill the memory.
MOST_PEOPLE = 64
# First lines of senders that have no people are kept of so many.
_MOST_SENDERS = 256
# What is saved of a person beside the annotator.
_REMEMBERED = ("joints", "name", "sender", "recording", "begin_s", "last_s", "last_round")


class PersonEvent(NamedTuple):
    """An event of one person.

    Attributes
    ----------
    person : as the poses name them
    event : what became known
    sender : whose poses they are
    recording : its number, from 1; ids of events count anew in each
    recording_start_s : when its first pose was, by the sender's clock, from which times of
        labels count; None if it has none
    """

    person: str
    event: LiveEvent
    sender: str = ""
    recording: int = 1
    recording_start_s: float | None = None

    def as_json(self) -> dict[str, Any]:
        """The event as `motionary live` prints it."""
        label, event = self.event.label, self.event
        return {
            "event": event.status,
            "id": event.id,
            "sender": self.sender,
            "person": self.person,
            "recording": self.recording,
            "recording_start_s": self.recording_start_s,
            "label": label.name,
            "start_s": round(label.start_s, 4),
            "end_s": round(label.end_s, 4),
            "start_frame": label.start_frame,
            "end_frame": label.end_frame,
            "score": label.score,
            "probability": label.probability,
            "side": label.side,
            "why": list(event.why),
        }


class PersonPose(NamedTuple):
    """A pose as it was labelled.

    Attributes
    ----------
    person, sender, recording : as of `PersonEvent`
    rate_hz : poses per second
    time_s : since the recording's first pose
    positions : array, shape (24, 3), metres, of the generic joints, NaN = not seen
    """

    person: str
    sender: str
    recording: int
    rate_hz: float
    time_s: float
    positions: Floats


@dataclass(slots=True)
class _Person:
    annotator: LiveAnnotator
    joints: str | tuple[str, ...] | None
    name: str
    sender: str
    recording: int = 0
    begin_s: float | None = None
    last_s: float | None = None
    last_round: int = 0

    def tell(self, events: Iterable[LiveEvent]) -> list[PersonEvent]:
        """Events as those of this person."""
        facts = self.sender, self.recording, self.begin_s
        return [PersonEvent(self.name, event, *facts) for event in events]

    def show(self) -> PersonPose:
        """The last pose as that of this person."""
        own = self.annotator
        facts = self.name, self.sender, self.recording
        last_s = max(own.duration_s - 1 / own.rate_hz, 0.0)
        return PersonPose(*facts, own.rate_hz, last_s, own.pose)


@dataclass(slots=True)
class _Sender:
    """What a sender says of all its poses, and how far they are.

    A round is over when one of its people is sent again: poses without times have no other
    clock, and clocks are set.
    """

    reader: PoseLines
    round: int = 0
    sent: set[str] = field(default_factory=set)

    def count(self, name: str) -> int:
        """Number of the round of a person's pose."""
        if name in self.sent:
            self.round += 1
            self.sent.clear()
        self.sent.add(name)
        return self.round


class LivePeople:
    """Labels of people whose poses arrive as lines of JSON, from one or more senders.

    Parameters
    ----------
    library : with scores; by default the library of everyday motion that ships
    rate_hz : poses per second, where a sender's first line does not say
    skeleton : of poses that list joints without names
    at_most_false_per_min : as `LiveAnnotator` takes it
    """

    def __init__(
        self,
        library: ClassLibrary | None = None,
        *,
        rate_hz: float | None = None,
        skeleton: str | None = None,
        at_most_false_per_min: float | None = None,
    ) -> None:
        self._library = load_everyday() if library is None else library
        self._rate_hz, self._skeleton = rate_hz, skeleton
        self._at_most_false = at_most_false_per_min
        self._senders: dict[str, _Sender] = {}
        self._people: dict[tuple[str, str], _Person] = {}
        self._n_recordings = 0
        self._due: list[PersonEvent] = []
        #: The pose of the last line; None if it had none.
        self.pose: PersonPose | None = None

    @property
    def senders(self) -> tuple[str, ...]:
        """Whose people are there."""
        return tuple(dict.fromkeys(sender for sender, _ in self._people))

    def save(self, path: str | Path) -> None:
        """Write what is remembered of all people into a file (npz), to go on from there."""
        arrays: Arrays = {}
        people = [
            {name: getattr(one, name) for name in _REMEMBERED} | one.annotator.to_state(arrays)
            for one in self._people.values()
        ]
        senders = [
            [name, one.reader.rate_hz, one.reader.joints, one.round, sorted(one.sent)]
            for name, one in self._senders.items()
        ]
        content = {"people": people, "senders": senders, "n_recordings": self._n_recordings}
        save_state(path, content, arrays, self._library)

    def resume(self, path: str | Path) -> None:
        """Go on with the people that were saved, exactly as if there had been no break.

        Raises
        ------
        UnreadableFile
            If the file is none that `save` wrote, or damaged.
        InvalidInput
            If it was saved with another library.
        """
        content, arrays = read_state(path, self._library, ("people", "senders", "n_recordings"))
        try:
            people = [self._recall(one, arrays) for one in content["people"]]
            for name, rate_hz, joints, n_rounds, sent in content["senders"]:
                reader = PoseLines(rate_hz, _as_joints(joints))
                self._senders[name] = _Sender(reader, n_rounds, set(sent))
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            raise UnreadableFile("damaged: its parts do not fit", file=str(path)) from error
        self._people = {(one.sender, one.name): one for one in people}
        self._n_recordings = content["n_recordings"]

    def _recall(self, content: Mapping[str, Any], arrays: Arrays) -> _Person:
        annotator = LiveAnnotator.from_state(content, arrays, self._library)
        facts = {name: content[name] for name in _REMEMBERED}
        return _Person(annotator, **facts | {"joints": _as_joints(content["joints"])})

    def push(self, line: str | bytes, *, sender: str = "") -> list[PersonEvent]:
        """What a line makes known.

        Raises
        ------
        InvalidInput
            If it is no pose, or one that does not fit; other lines and people go on.
        """
        self.pose = None
        # What was due before an error comes with the next line.
        self._push(line, sender)
        return self._take()

    def leave(self, sender: str) -> list[PersonEvent]:
        """What is left of the people of a sender that has gone or is silent."""
        for key in [key for key in self._people if key[0] == sender]:
            self._finish(key)
        return self._take()

    def finish(self) -> list[PersonEvent]:
        """What is left of all people when no more poses come."""
        for key in list(self._people):
            self._finish(key)
        return self._take()

    def _push(self, line: str | bytes, sender: str) -> None:
        own = self._senders.get(sender) or self._meet(sender)
        pose = own.reader.read(line)
        if pose is None:
            return
        _check_joints(pose)
        key = sender, pose.person
        person = self._people.get(key)
        if person is not None and _starts_anew(pose, person):
            self._finish(key)
            person = None
        if person is None:
            person = self._people[key] = self._start(pose, sender, own.reader.rate_hz)
        times = None if pose.time_s is None else [pose.time_s]
        events = person.annotator.push(pose.positions[np.newaxis], times)
        if not person.recording:
            self._n_recordings += 1
            person.recording, person.begin_s = self._n_recordings, pose.time_s
        self._due += person.tell(events)
        self.pose = person.show()
        person.last_s, person.last_round = pose.time_s, own.count(pose.person)
        for other, one in list(self._people.items()):
            n_absent = own.round - one.last_round if one.sender == sender else 0
            if n_absent > ABSENT_S * one.annotator.rate_hz:
                self._finish(other)

    def _meet(self, sender: str) -> _Sender:
        if len(self._senders) >= _MOST_SENDERS:
            with_people = {key[0] for key in self._people}
            del self._senders[next(one for one in self._senders if one not in with_people)]
        new = self._senders[sender] = _Sender(PoseLines(self._rate_hz, self._skeleton))
        return new

    def _start(self, pose: Pose, sender: str, rate_hz: float | None) -> _Person:
        if rate_hz is None:
            raise InvalidInput(
                'how many poses a second come is unknown: a first line {"rate_hz": 60} or '
                "--rate (rate_hz=) says it"
            )
        if len(self._people) >= MOST_PEOPLE:
            # Those of whom no pose was of use hold no place.
            self._people = {k: one for k, one in self._people.items() if one.annotator.duration_s}
        if len(self._people) >= MOST_PEOPLE:
            raise InvalidInput(
                f"more than {MOST_PEOPLE} people at once; does the sender number its poses where "
                "a person's name is expected?"
            )
        annotator = LiveAnnotator(
            self._library,
            rate_hz=rate_hz,
            skeleton=pose.joints,
            at_most_false_per_min=self._at_most_false,
        )
        return _Person(annotator, pose.joints, pose.person, sender)

    def _finish(self, key: tuple[str, str]) -> None:
        person = self._people.pop(key)
        self._due += person.tell(person.annotator.finish())

    def _take(self) -> list[PersonEvent]:
        events, self._due = self._due, []
        return events


def _check_joints(pose: Pose) -> None:
    """Refuse positions that are not as many as the joints that they are of."""
    joints = GENERIC_JOINTS if pose.joints is None else pose.joints
    whose = "a pose without names" if pose.joints is None else "the first line"
    if isinstance(joints, str):
        joints, whose = named_mapping(joints).order, f"skeleton {joints!r}"
    if len(pose.positions) != len(joints):
        raise InvalidInput(
            f"{whose} has {len(joints) or 'no usual order of'} joints, got {len(pose.positions)} "
            'positions; a first line with "joints" names them, in the order of the positions'
        )


def _as_joints(joints: Any) -> str | tuple[str, ...] | None:
    """Joints as JSON has them."""
    return tuple(joints) if isinstance(joints, list) else joints


def _starts_anew(pose: Pose, person: _Person) -> bool:
    """Whether other joints, a clock set back or a return begin another recording."""
    if pose.joints != person.joints:
        return True
    if pose.time_s is None or person.last_s is None:
        return (pose.time_s is None) != (person.last_s is None)
    return not -_RESTART_S <= pose.time_s - person.last_s <= ABSENT_S
