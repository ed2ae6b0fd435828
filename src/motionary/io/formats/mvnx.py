"""MVNX files of Xsens MVN: segments of the body, and the sensors they were computed from.

The XML is read element by element, so that memory follows the numbers that are asked for.
Documents with a type declaration are refused: entities could unfold without end.

Conventions: metres, z up, turns from segment to world, wxyz. A segment's position is its start,
the joint to the one above; ends of head, hands and toes are computed from the points that the
file lists for them. Poses of calibration (`identity`, `tpose`, `npose`) are no frames.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple, NoReturn
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from motionary.errors import NotAMotion, SeveralRecordings, UnreadableFile
from motionary.files import open_regular
from motionary.io.formats import EVERY
from motionary.io.formats.content import FileContent, choose_take, names_file, number_doubles
from motionary.io.formats.numbers import parse_number
from motionary.io.formats.times import time_frames, timed_content
from motionary.io.normalise.units import FileMetadata
from motionary.io.options import ReadOptions
from motionary.motion import Skeleton
from motionary.rotations import Floats, conjugate_quaternions, multiply_quaternions, rotate

_XSENS = FileMetadata("m", usual_up="z", by_definition=True, origin="Xsens MVN", noted=("up",))
# The point of a segment that is its far end.
_ENDS = {
    "Head": "pTopOfHead",
    "RightHand": "pRightTopOfHand",
    "LeftHand": "pLeftTopOfHand",
    "RightToe": "pRightToe",
    "LeftToe": "pLeftToe",
}
_PIECE = 1 << 20
_SUBJECT, _TAG_BYTES = re.compile(rb"<(?:[\w-]+:)?subject[\s>]"), 80
# Joints of the model may give way by as much; beyond, turns and places are not of one rig.
_LOOSE_M = 0.01
_UNIT = 0.01


class Sensors(NamedTuple):
    """What the sensors of a recording measured, by name.

    Attributes
    ----------
    names : where each sensor is worn
    rate_hz : frames per second
    orientations : array, shape (frames, sensors, 4), wxyz, from sensor to world, z up
    accelerations : array, shape (frames, sensors, 3), m/s²; NaN where the file has none
    free : whether accelerations are in the world and without gravity, else in the sensor
    """

    names: tuple[str, ...]
    rate_hz: float
    orientations: Floats
    accelerations: Floats
    free: bool


@dataclass(slots=True)
class _Subject:
    """A person of a file: names, the model, and numbers of the frames by element."""

    label: str
    rate_hz: float
    segments: list[str] = field(default_factory=list)
    sensors: list[str] = field(default_factory=list)
    points: dict[tuple[str, str], list[float]] = field(default_factory=dict)
    parents: dict[str, str] = field(default_factory=dict)
    times_s: list[float] = field(default_factory=list)
    indices: list[float] = field(default_factory=list)
    numbers: dict[str, list[Floats]] = field(default_factory=dict)

    def table(self, name: str, things: list[str], width: int) -> Floats | None:
        """Numbers of an element, (frames, things, width); None where no frame has it."""
        rows = self.numbers.get(name, [])
        if not rows:
            return None
        n = width * len(things)
        wrong = next((row for row in rows if len(row) != n), None)
        if wrong is not None or len(rows) != len(self.times_s):
            raise UnreadableFile(
                f"a frame needs {n} numbers in <{name}>, "
                + (f"one has {len(wrong)}" if wrong is not None else "some have none")
            )
        return np.array(rows).reshape(len(rows), len(things), width)


@names_file
def read_mvnx(path: Path, options: ReadOptions) -> FileContent:
    """Segments of an MVNX file, in metres with z up, with their turns."""
    subject = _choose(path, ("position", "orientation"), options)
    segments = subject.segments
    positions = subject.table("position", segments, 3)
    if positions is None or not segments:
        raise NotAMotion(
            "holds no motion; expected frames with <position> of segments; export "
            "MVNX with segment positions"
        )
    turns = subject.table("orientation", segments, 4)
    positions[~np.isfinite(positions).all(axis=2)] = np.nan
    content = timed_content(
        segments,
        positions,
        np.array(subject.times_s),
        options,
        metadata=_XSENS,
        stated_hz=subject.rate_hz,
        first_frame=subject.indices[0],
    )
    if turns is None or options.even_times:
        return content
    return _with_turns(content, subject, turns)


@names_file
def read_mvnx_sensors(path: Path, options: ReadOptions) -> Sensors:
    """What the sensors of an MVNX file measured."""
    names = ("sensorOrientation", "sensorFreeAcceleration", "sensorAcceleration")
    subject = _choose(path, names, options)
    sensors = subject.sensors
    turns = subject.table(names[0], sensors, 4)
    if turns is None or not sensors:
        raise UnreadableFile("holds no data of sensors; export MVNX with sensor data")
    free = subject.table(names[1], sensors, 3)
    sensed = subject.table(names[2], sensors, 3) if free is None else free
    unseen = np.full((*turns.shape[:2], 3), np.nan)
    times = np.array(subject.times_s)
    timed = time_frames(unseen, times, options=options, stated_hz=subject.rate_hz)
    return Sensors(
        tuple(number_doubles(sensors)),
        timed.rate_hz,
        turns,
        unseen if sensed is None else sensed,
        free is not None,
    )


def _choose(path: Path, wanted: tuple[str, ...], options: ReadOptions) -> _Subject:
    """The person that is meant, with the numbers of the wanted elements."""
    if options.take == EVERY:
        # Only people are asked for: one needs no parsing, and several no numbers.
        if _has_one_subject(path):
            raise SeveralRecordings(path.name, ["1"])
        wanted = ()
    subjects = [s for s in _Reader(wanted).read(path) if s.times_s]
    if not subjects:
        raise NotAMotion("holds no frames of motion; expected an MVNX file")
    labels = number_doubles([subject.label or "subject" for subject in subjects])
    return subjects[choose_take(labels, options.take, path.name)]


def _has_one_subject(path: Path) -> bool:
    """Whether the tag of a person is found once; other encodings than UTF-8 hide it."""
    found, kept = 0, b""
    with open_regular(path) as file:
        while piece := file.read(_PIECE):
            # A tag may lie across two pieces.
            found += sum(x.end() > len(kept) for x in _SUBJECT.finditer(kept + piece))
            if found > 1:
                return False
            kept = piece[-_TAG_BYTES:]
    return found == 1


class _Reader:
    """Walks the document and keeps what is asked for."""

    def __init__(self, wanted: tuple[str, ...]) -> None:
        self.wanted = wanted
        self.subjects: list[_Subject] = []
        self.text: list[str] = []
        self.segment = self.point = self.connector = ""
        self.in_frame = False
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self.refuse_types
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.text.append

    def read(self, path: Path) -> list[_Subject]:
        with open_regular(path) as file:
            try:
                while piece := file.read(_PIECE):
                    self.parser.Parse(piece)
                self.parser.Parse(b"", True)
            except expat.ExpatError as error:
                problem = f"{expat.ErrorString(error.code)}; is the file whole?"
                raise UnreadableFile(problem, place=f"line {error.lineno}") from None
            except LookupError as error:
                raise UnreadableFile(f"{error}; save it as UTF-8") from None
        return self.subjects

    def fail(self, problem: str) -> NoReturn:
        raise UnreadableFile(problem, place=f"line {self.parser.CurrentLineNumber}")

    def refuse_types(self, *_: object) -> None:
        self.fail("has a document type, as no MVNX file does; remove it")

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        self.text.clear()
        tag = tag.rpartition(":")[2]
        if tag == "subject":
            rate = parse_number(attributes.get("frameRate", ""))
            self.subjects.append(_Subject(attributes.get("label", ""), rate))
        if not self.subjects:
            return
        subject, label = self.subjects[-1], attributes.get("label", "")
        if tag == "segment":
            self.segment = label
            subject.segments.append(label)
        elif tag == "sensor":
            subject.sensors.append(label)
        elif tag == "point":
            self.point = label
        elif tag == "frame":
            self.in_frame = attributes.get("type", "normal") == "normal"
            if self.in_frame:
                subject.times_s.append(parse_number(attributes.get("time", "")) / 1000)
                subject.indices.append(parse_number(attributes.get("index", "0")))

    def end(self, tag: str) -> None:
        tag = tag.rpartition(":")[2]
        content = "".join(self.text)
        self.text.clear()
        if not self.subjects:
            return
        subject = self.subjects[-1]
        if tag in self.wanted and self.in_frame:
            subject.numbers.setdefault(tag, []).append(self.numbers(tag, content))
        elif tag == "pos_b":
            subject.points[self.segment, self.point] = self.numbers(tag, content).tolist()
        elif tag == "connector1":
            self.connector = content.partition("/")[0].strip()
        elif tag == "connector2":
            subject.parents[content.partition("/")[0].strip()] = self.connector
        elif tag == "frame":
            self.in_frame = False

    def numbers(self, tag: str, content: str) -> Floats:
        try:
            return np.array(content.split(), dtype=np.float64)
        except ValueError:
            self.fail(f"expected numbers in <{tag}>, got {content.strip()[:40]!r}")


def _with_turns(content: FileContent, subject: _Subject, turns: Floats) -> FileContent:
    """The content with ends of segments, and as a rig where its segments make one."""
    names, positions = list(content.names), content.positions
    lengths = np.linalg.norm(turns, axis=2)
    if not (np.abs(lengths - 1) < _UNIT).all():
        return content
    turns = turns / lengths[..., None]
    index = {name: i for i, name in enumerate(names)}
    ends = [
        (index[segment], subject.points[segment, point])
        for segment, point in _ENDS.items()
        if segment in index and len(subject.points.get((segment, point), ())) == 3
    ]
    far = [positions[:, i] + rotate(turns[:, i], np.array(point)) for i, point in ends]
    positions = np.concatenate((positions, *(place[:, None] for place in far)), axis=1)
    names += [f"End of {names[i]}" for i, _ in ends]
    above = [index.get(subject.parents.get(name, ""), -1) for name in content.names]
    parents = np.array([*above, *(i for i, _ in ends)], dtype=np.intp)
    plain = replace(content, names=names, positions=positions)
    if (parents[1:] < 0).any() or (parents >= np.arange(len(parents))).any():
        return plain
    return _as_rig(plain, parents, turns)


def _as_rig(content: FileContent, parents: NDArray[np.intp], turns: Floats) -> FileContent:
    """The content with its tree and local turns, if bones keep their place in each other."""
    positions = content.positions
    rest = np.zeros((len(turns), len(parents) - turns.shape[1], 4))
    rest[..., 0] = 1.0
    local = np.concatenate((turns, rest), axis=1)
    offsets = positions.mean(axis=0)
    for joint in range(1, len(parents)):
        parent = int(parents[joint])
        back = conjugate_quaternions(turns[:, parent])
        away = rotate(back, positions[:, joint] - positions[:, parent])
        offsets[joint] = away.mean(axis=0)
        # Comparing with NaN is False.
        if not np.abs(away - offsets[joint]).max() < _LOOSE_M:
            note = "segments are not joined rigidly: turns are left out"
            return replace(content, notes=(*content.notes, note))
        if joint < turns.shape[1]:
            local[:, joint] = multiply_quaternions(back, turns[:, joint])
    skeleton = Skeleton(tuple(content.names), parents, offsets)
    return replace(content, skeleton=skeleton, rotations=local)
