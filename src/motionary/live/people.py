"""Labels of several people at once, each by an annotator of their own."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from motionary.errors import InvalidInput
from motionary.live.annotator import LiveAnnotator, LiveEvent
from motionary.live.poses import Pose, PoseLines
from motionary.models.library import ClassLibrary, load_everyday

#: Of a clock that goes back by more, what follows is another recording.
_RESTART_S = 1.0
# Nobody sends so many people: a sender that numbers its poses instead would fill the memory.
MOST_PEOPLE = 64


class PersonEvent(NamedTuple):
    """An event of one person.

    Attributes
    ----------
    person : as the poses name them
    event : what became known
    """

    person: str
    event: LiveEvent

    def as_json(self) -> dict[str, Any]:
        """The event as `motionary live` prints it."""
        label, event = self.event.label, self.event
        return {
            "event": event.status,
            "id": event.id,
            "person": self.person,
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


@dataclass(slots=True)
class _Person:
    annotator: LiveAnnotator
    joints: str | tuple[str, ...] | None
    last_s: float | None = None


class LivePeople:
    """Labels of the people whose poses arrive as lines of JSON, from one sender or several.

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
        self._readers: dict[str, PoseLines] = {}
        self._people: dict[tuple[str, str], _Person] = {}

    def push(self, line: str | bytes, *, sender: str = "") -> list[PersonEvent]:
        """What a line makes known.

        Raises
        ------
        InvalidInput
            If it is no pose, or one that does not fit; other lines and people go on.
        """
        reader = self._readers.setdefault(sender, PoseLines(self._rate_hz, self._skeleton))
        pose = reader.read(line)
        if pose is None:
            return []
        key = sender, pose.person
        events: list[PersonEvent] = []
        person = self._people.get(key)
        if person is not None and _starts_anew(pose, person):
            events, person = self._finish(key), None
        if person is None:
            person = self._people[key] = self._start(pose, reader.rate_hz)
        times = None if pose.time_s is None else [pose.time_s]
        found = person.annotator.push(pose.positions[np.newaxis], times)
        person.last_s = pose.time_s
        return events + [PersonEvent(pose.person, event) for event in found]

    def finish(self) -> list[PersonEvent]:
        """What is left of all people when no more poses come."""
        return [event for key in list(self._people) for event in self._finish(key)]

    def _start(self, pose: Pose, rate_hz: float | None) -> _Person:
        if rate_hz is None:
            raise InvalidInput(
                'how many poses a second come is unknown: a first line {"rate_hz": 60} or '
                "--rate-hz (rate_hz=) says it"
            )
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
        return _Person(annotator, pose.joints)

    def _finish(self, key: tuple[str, str]) -> list[PersonEvent]:
        return [PersonEvent(key[1], e) for e in self._people.pop(key).annotator.finish()]


def _starts_anew(pose: Pose, person: _Person) -> bool:
    """Whether a pose begins another recording: other joints, or a clock set back."""
    if pose.joints != person.joints:
        return True
    if pose.time_s is None or person.last_s is None:
        return (pose.time_s is None) != (person.last_s is None)
    return pose.time_s < person.last_s - _RESTART_S
