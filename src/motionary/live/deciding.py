"""Which matches of a stream become labels, and which would if nothing more came.

Conventions: frames of features, at 30 Hz, counted from the stream's first; half-open.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from motionary.features import SEQUENCE_HZ
from motionary.matching import (
    Intervals,
    PathStream,
    ScheduleState,
    SchedulingSettings,
    StateJoiner,
    StreamedPath,
    advance,
    foresee,
    intervals,
)
from motionary.matching.path_scores import SETTLED
from motionary.models.library import ClassLibrary, PrototypePlace, check_has_scores
from motionary.packing import PackedFeatures

_MOST_GAP = SchedulingSettings().most_gap_s * SEQUENCE_HZ


Detail = TypeVar("Detail")


@dataclass(frozen=True, slots=True)
class Found(Generic[Detail]):
    """A label: one match, or of a state the best of several.

    Attributes
    ----------
    start, stop : frames of all matches together
    best : the match that tells most
    detail : what is known of the best match
    """

    start: int
    stop: int
    best: StreamedPath
    detail: Detail

    def join(self, other: "Found[Detail]") -> "Found[Detail]":
        """The label of both."""
        best = max(self, other, key=lambda one: (one.best.score, -one.best.stop))
        start, stop = min(self.start, other.start), max(self.stop, other.stop)
        return Found(start, stop, best.best, best.detail)


class Decisions(Generic[Detail]):
    """Matches of a library in a stream of features, and the choice among them.

    Parameters
    ----------
    library : with scores
    least : array, shape (classes,): least score of the labels of each class
    judge : what is to be known of a match that is chosen; None if too little was seen of it

    Attributes
    ----------
    places : prototype of each pattern
    look_ahead : frames after its end at which a match is decided
    """

    REMEMBERED = (
        "_paths", "_arriving", "_state", "_waiting", "_joiner", "_unjoined", "_states",
    )  # fmt: skip

    def __init__(
        self,
        library: ClassLibrary,
        least: NDArray[np.float64],
        judge: Callable[[StreamedPath], Detail | None],
    ) -> None:
        check_has_scores(library)
        self._judge = judge
        self.places = tuple(
            PrototypePlace(i, j)
            for i, one in enumerate(library)
            for j in range(len(one.prototypes))
        )
        patterns = [pattern for one in library for _, pattern in one.patterns]
        self._paths = PathStream(patterns, [ratio for one in library for ratio in one.ratios])
        self._longest = 2 * max(map(len, patterns))
        classes = [place.class_index for place in self.places]
        self._least = least[classes]
        self._parts = np.array([one.parts_mask for one in library], dtype=np.int64)[classes]
        self._is_state = [library.classes[i].kind == "state" for i in classes]
        self._class_of = classes
        scoring = library.scoring
        self._scoring = scoring
        self._wait = (scoring.look_ahead_s if scoring else 0.0) * SEQUENCE_HZ
        self._arriving: list[tuple[int, int, StreamedPath]] = []
        self._state = ScheduleState()
        self._waiting: dict[int, StreamedPath] = {}
        self._joiner = StateJoiner(_MOST_GAP)
        self._unjoined: list[Found[Detail]] = []
        self._states: dict[int, Found[Detail]] = {}

    @property
    def look_ahead(self) -> float:
        """Frames after its end at which a match is decided."""
        return self._wait + SETTLED

    @property
    def n_frames(self) -> int:
        """Frames so far."""
        return self._paths.n_frames

    @property
    def n_remembered(self) -> int:
        """How many of the last frames a match that is not decided can reach back to."""
        return int(self.look_ahead) + self._longest + 2

    def push(self, packed: PackedFeatures, known: PackedFeatures) -> None:
        """One more frame."""
        self._arrive(self._paths.push(packed, known))

    def probability_of(self, path: StreamedPath) -> float | None:
        """That a label of this match is right; None if the library does not know."""
        if self._scoring is None:
            return None
        return self._scoring.probability_of(path.score - self._least[path.pattern])

    def decide(self, *, at_end: bool) -> Iterator[Found[Detail]]:
        """Labels that became final."""
        if at_end:
            self._arrive(self._paths.finish())
        now = np.inf if at_end else float(self.n_frames + 1 - SETTLED)
        if not now > self._state.now:
            return
        due: list[StreamedPath] = []
        while self._arriving and self._arriving[0][0] <= now:
            due.append(heappop(self._arriving)[2])
        self._waiting |= dict(enumerate(due, start=self._state.n_seen))
        chosen, self._state = advance(
            self._state, self._intervals(due), now=now, look_ahead=self._wait
        )
        for number in chosen.tolist():
            path = self._waiting[number]
            detail = self._judge(path)
            if detail is not None:
                found = Found(path.start, path.stop, path, detail)
                self._unjoined.append(found)
                if not self._is_state[path.pattern]:
                    yield found
        decided = now - self._wait
        self._waiting = {n: path for n, path in self._waiting.items() if path.stop > decided}
        yield from self._close_states(decided - self._longest)

    def foresee(self, detail: Detail) -> list[Found[Detail]]:
        """Labels that are not final, as they would be if nothing more came.

        Parameters
        ----------
        detail : of matches that are not chosen yet
        """
        further = [path for _, _, path in sorted(self._arriving)]
        known = {(path.pattern, path.stop) for path in further}
        further += [
            path
            for path in self._paths.find_open()
            if self._tells(path) and (path.pattern, path.stop) not in known
        ]
        paths = self._waiting | dict(enumerate(further, start=self._state.n_seen))
        numbers = foresee(self._state, self._intervals(further)).tolist()
        chosen = [Found(paths[i].start, paths[i].stop, paths[i], detail) for i in numbers]
        joiner, states = self._joiner.copy(), dict(self._states)
        self._join(joiner, states, [*self._unjoined, *chosen])
        events = [one for one in chosen if not self._is_state[one.best.pattern]]
        return [*events, *states.values()]

    def _arrive(self, paths: Sequence[StreamedPath]) -> None:
        for path in paths:
            if self._tells(path):
                heappush(self._arriving, (path.stop, path.pattern, path))

    def _tells(self, path: StreamedPath) -> bool:
        return bool(path.score > self._least[path.pattern])

    def _intervals(self, paths: Sequence[StreamedPath]) -> Intervals:
        pattern = np.array([path.pattern for path in paths], dtype=np.intp)
        scores = np.array([path.score for path in paths], dtype=np.float64)
        return intervals(
            [path.start for path in paths],
            [path.stop for path in paths],
            scores - self._least[pattern],
            self._parts[pattern],
        )

    def _close_states(self, joined: float) -> Iterator[Found[Detail]]:
        """Join what begins up to a frame; states that nothing can join any more."""
        ready = [found for found in self._unjoined if found.start <= joined]
        self._unjoined = [found for found in self._unjoined if found.start > joined]
        self._join(self._joiner, self._states, ready)
        for number, found in list(self._states.items()):
            if found.stop + _MOST_GAP < joined:
                yield self._states.pop(number)

    def _join(
        self, joiner: StateJoiner, states: dict[int, Found[Detail]], further: list[Found[Detail]]
    ) -> None:
        """Join matches to the states that are open."""
        for found in sorted(further, key=lambda one: (one.start, one.stop)):
            pattern = found.best.pattern
            number = joiner.add(
                found.start,
                found.stop,
                self._class_of[pattern],
                int(self._parts[pattern]),
                is_state=self._is_state[pattern],
            )
            if self._is_state[pattern]:
                before = states.get(number)
                states[number] = found if before is None else before.join(found)
