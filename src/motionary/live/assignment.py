"""Label assignment in a stream of features, and the state of streams in a file.

Decided is which matches become labels, and which would if nothing more came. A state is kept as
arrays, and JSON that says where they belong: what changes while a stream goes on is named by its
classes in `REMEMBERED`; all else comes from the library and the settings. Numbers are kept
exactly; of classes only those listed here are read.

Conventions: frames of features, at 30 Hz, counted from the stream's first; half-open.
"""

import dataclasses
import hashlib
import json
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import SEQUENCE_HZ
from motionary.features.body import Body
from motionary.files import NO_SUCH_FILE, write_atomically
from motionary.labels import Label
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
from motionary.matching._interval_sets import Item
from motionary.matching.path_scores import SETTLED
from motionary.models.library import (
    ClassLibrary,
    PrototypePlace,
    check_has_scores,
    thresholds_for,
)
from motionary.packing import PackedFeatures
from motionary.recording import Recording

_MOST_GAP = SchedulingSettings().most_gap_s * SEQUENCE_HZ

#: What is known of a match: its label, and what told most for it; None if nothing yet.
Detail = tuple[Label, tuple[str, ...]] | None


@dataclass(frozen=True, slots=True)
class Found:
    """A label: one match, or of a state the best of several; frames of all together."""

    start: int
    stop: int
    best: StreamedPath
    detail: Detail

    def join(self, other: "Found") -> "Found":
        """The label of both."""
        best = max(self, other, key=lambda one: (one.best.score, -one.best.stop))
        start, stop = min(self.start, other.start), max(self.stop, other.stop)
        return Found(start, stop, best.best, best.detail)


class Decisions:
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
        judge: Callable[[StreamedPath], Detail],
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
        self._scoring = scoring = library.scoring
        self._wait = (scoring.look_ahead_s if scoring else 0.0) * SEQUENCE_HZ
        self._arriving: list[tuple[int, int, StreamedPath]] = []
        self._state = ScheduleState()
        self._waiting: dict[int, StreamedPath] = {}
        self._joiner = StateJoiner(_MOST_GAP)
        self._unjoined: list[Found] = []
        self._states: dict[int, Found] = {}

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

    def decide(self, *, at_end: bool) -> Iterator[Found]:
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

    def foresee(self) -> list[Found]:
        """Labels that are not final, as they would be if nothing more came."""
        further = [path for _, _, path in sorted(self._arriving)]
        known = {(path.pattern, path.stop) for path in further}
        further += [
            path
            for path in self._paths.find_open()
            if self._tells(path) and (path.pattern, path.stop) not in known
        ]
        paths = self._waiting | dict(enumerate(further, start=self._state.n_seen))
        numbers = foresee(self._state, self._intervals(further)).tolist()
        chosen = [Found(paths[i].start, paths[i].stop, paths[i], None) for i in numbers]
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

    def _close_states(self, joined: float) -> Iterator[Found]:
        """Join what begins up to a frame; states that nothing can join any more."""
        ready = [found for found in self._unjoined if found.start <= joined]
        self._unjoined = [found for found in self._unjoined if found.start > joined]
        self._join(self._joiner, self._states, ready)
        for number, found in list(self._states.items()):
            if found.stop + _MOST_GAP < joined:
                yield self._states.pop(number)

    def _join(self, joiner: StateJoiner, states: dict[int, Found], further: list[Found]) -> None:
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


# -- state of streams in a file -------------------------------------------------------------

_VERSION = 1
_FACTS = "facts"
_NO_STATE = (
    "no state of this kind, or damaged; give a file that LiveAnnotator.save wrote, or of several "
    "people LivePeople.save and motionary live --state"
)
_UNREADABLE = (
    OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, zipfile.BadZipFile,
    zlib.error,
)  # fmt: skip
_KINDS: dict[str, Any] = {
    kind.__name__: kind
    for kind in (Body, Found, Item, Label, Recording, ScheduleState, StateJoiner, StreamedPath)
}
Arrays = dict[str, NDArray[Any]]


def save_state(
    path: str | Path, content: Mapping[str, Any], arrays: Arrays, library: ClassLibrary
) -> None:
    """Write the state of streams: what `encode` gave, and what else JSON has."""
    facts = {"version": _VERSION, "library": _digest(library), **content}
    own = arrays | {_FACTS: np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8)}
    with write_atomically(path) as beside, beside.open("wb") as file:
        np.savez(file, **own)  # type: ignore[arg-type]


def read_state(
    path: str | Path, library: ClassLibrary, names: Sequence[str]
) -> tuple[dict[str, Any], Arrays]:
    """What `save_state` wrote: content with these names, and its arrays.

    Raises
    ------
    UnreadableFile
        If the file is none that `save_state` wrote, or not whole.
    InvalidInput
        If it was written with another library.
    """
    try:
        with Path(path).open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        content = json.loads(arrays.pop(_FACTS).tobytes())
        version, digest = content["version"], content["library"]
    except FileNotFoundError as error:
        raise UnreadableFile(NO_SUCH_FILE, file=str(path)) from error
    except _UNREADABLE as error:
        raise UnreadableFile(_NO_STATE, file=str(path)) from error
    if version != _VERSION:
        raise UnreadableFile(
            f"a state of version {version}, this program reads {_VERSION}", file=str(path)
        )
    if digest != _digest(library):
        raise InvalidInput(
            "the state was saved with another library; resume it with that one", file=str(path)
        )
    if not all(name in content for name in names):
        raise UnreadableFile(_NO_STATE, file=str(path))
    return content, arrays


def restore(stream: object, state: Any, arrays: Arrays) -> None:
    """Set what a stream remembers."""
    for name, one in state["state"].items():
        if isinstance(one, dict) and "state" in one:
            restore(getattr(stream, name), one, arrays)
        else:
            setattr(stream, name, _decode(one, arrays))


def encode(value: Any, arrays: Arrays) -> Any:
    """A value as JSON has it; its arrays go to the others."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        arrays[f"a{len(arrays)}"] = value
        return {"array": f"a{len(arrays) - 1}"}
    if isinstance(value, Mapping):
        return {"dict": _encode_all([part for pair in value.items() for part in pair], arrays)}
    if type(value).__name__ in _KINDS:
        names = _names_of(type(value))
        return {
            "kind": type(value).__name__,
            "fields": _encode_all([getattr(value, name) for name in names], arrays),
        }
    if isinstance(value, tuple | list):
        return {type(value).__name__: _encode_all(value, arrays)}
    return {"state": {name: encode(getattr(value, name), arrays) for name in value.REMEMBERED}}


def _encode_all(values: Sequence[Any], arrays: Arrays) -> list[Any]:
    return [encode(one, arrays) for one in values]


def _decode(plain: Any, arrays: Arrays) -> Any:
    if not isinstance(plain, dict):
        return plain
    if "array" in plain:
        return arrays[plain["array"]]
    if "kind" in plain:
        kind = _KINDS[plain["kind"]]
        values = [_decode(one, arrays) for one in plain["fields"]]
        return kind(**dict(zip(_names_of(kind), values, strict=True)))
    [(sort, content)] = plain.items()
    parts = [_decode(one, arrays) for one in content]
    if sort == "dict":
        return dict(zip(parts[::2], parts[1::2], strict=True))
    return tuple(parts) if sort == "tuple" else parts


def _names_of(kind: Any) -> list[str]:
    if not dataclasses.is_dataclass(kind):
        return list(kind._fields)
    return [field.name for field in dataclasses.fields(kind) if field.init]


def _digest(library: ClassLibrary) -> str:
    """What tells a library from another one, in so far as its labels depend on it."""
    found = hashlib.sha256(library.feature_set.name.encode())
    found.update(thresholds_for(library).tobytes())
    for one in library:
        found.update(one.name.encode())
        for (_, pattern), ratio in zip(one.patterns, one.ratios, strict=True):
            for array in (pattern.values, pattern.fixed, ratio.if_one, ratio.if_zero):
                found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()
