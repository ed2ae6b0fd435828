"""Header and parameters of C3D files, before the frames.

A file begins with a block of 512 bytes (the header), then groups of named parameters, then
frames. Numbers are those of the machine that wrote it: Intel, DEC (VAX floats) or MIPS.
Where header and parameters disagree, the parameters count, as programs correct only those.

Sources: the C3D user guide (c3d.org), and files of Vicon, Motion Analysis and Qualisys.
"""

import math
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import UnreadableFile
from motionary.rotations import Floats

#: Texts, or numbers of any shape, first dimension first.
Value = tuple[str, ...] | Floats | NDArray[np.int16]
Groups = Mapping[str, Mapping[str, Value]]

BLOCK = 512
#: Enough for header and parameters of any file: a parameter section has at most 255 blocks.
LONGEST_HEAD = 600 * BLOCK
KEY = 0x50
#: The largest number that the header's 16 bits hold; longer recordings stop counting there.
MOST_COUNTED = 65535
#: Names of points in a parameter.
MOST_LABELS = 255

INTEL, _DEC, _MIPS = 84, 85, 86
TEXT, _BYTE, INTEGER, FLOAT = -1, 1, 2, 4
_EVENTS_KEY, _MOST_EVENTS = 12345, 18


class Header(NamedTuple):
    """The words of the first block."""

    n_points: int
    n_analog: int
    first_frame: int
    last_frame: int
    scale: float
    data_block: int
    rate_hz: float
    events: tuple[tuple[str, float], ...]
    analog_samples: int = 0


@dataclass(frozen=True, slots=True)
class Machine:
    """How numbers are written.

    Attributes
    ----------
    order : "<" or ">"
    dec : whether floats are those of a VAX
    """

    order: str
    dec: bool = False

    def integers(self, content: bytes) -> NDArray[np.int16]:
        """16-bit numbers."""
        return np.frombuffer(content, dtype=f"{self.order}i2")

    def format_floats(self, values: Floats) -> bytes:
        """The bytes of 32-bit numbers, the first dimension fastest."""
        if not self.dec:
            return values.astype(f"{self.order}f4").tobytes(order="F")
        halves = (4 * values.ravel(order="F")).astype("<f4").view("<u2").reshape(-1, 2)
        return halves[:, ::-1].tobytes()

    def floats(self, content: bytes) -> Floats:
        """32-bit numbers; what no number is becomes NaN."""
        if not self.dec:
            with np.errstate(invalid="ignore"):
                values = np.frombuffer(content, dtype=f"{self.order}f4").astype(np.float64)
            values[~np.isfinite(values)] = np.nan
            return values
        # A VAX keeps the half with the exponent first and counts it from another zero.
        halves = np.frombuffer(content, dtype="<u2").reshape(-1, 2)[:, ::-1]
        with np.errstate(invalid="ignore"):
            values = np.ascontiguousarray(halves).view("<f4")[:, 0].astype(np.float64) / 4
        return np.where(np.isfinite(values), values, np.nan)


@dataclass(frozen=True, slots=True)
class Head:
    """Header and parameters of a file; `end_block` is the first one behind the parameters."""

    machine: Machine
    header: Header
    groups: Groups
    end_block: int = 0

    def texts(self, group: str, *names: str) -> tuple[str, ...]:
        """Texts of a parameter and of those that continue it; empty if there are none."""
        found: list[str] = []
        for name in names:
            value = self.groups.get(group, {}).get(name, ())
            found += value if isinstance(value, tuple) else ()
        return tuple(found)

    def numbers(self, group: str, name: str) -> Floats:
        """Numbers of a parameter, flat; empty if there are none."""
        value = self.groups.get(group, {}).get(name)
        if value is None or isinstance(value, tuple):
            return np.empty(0)
        return value.ravel().astype(np.float64)

    def number(self, group: str, name: str, default: float) -> float:
        """The first number of a parameter."""
        values = self.numbers(group, name)
        return float(values[0]) if len(values) and np.isfinite(values[0]) else default

    def count(self, group: str, name: str, default: int) -> int:
        """A whole number that is never negative: 16 bits that passed 32767, or two words."""
        values = self.numbers(group, name)
        if not len(values) or not np.isfinite(values).all():
            return default
        # Two words are one long number. One word may stand for one above 32767.
        if len(values) == 2:
            return int(values[0]) % 65536 + 65536 * (int(values[1]) % 65536)
        return int(values[0]) % 65536 if values[0] < 0 else int(min(values[0], 2**31))


def parse_head(content: bytes) -> Head:
    """Header and parameters.

    Parameters
    ----------
    content : the file's first blocks; more does no harm
    """
    if len(content) < 2 or content[1] != KEY or not content[0]:
        raise UnreadableFile("expected a C3D file, its first bytes are others")
    if len(content) < 2 * BLOCK:
        raise UnreadableFile(
            f"a C3D file has at least {2 * BLOCK} bytes, this one ends after {len(content)}"
        )
    start = (content[0] - 1) * BLOCK
    processor = content[start + 3] if start + 4 <= len(content) else 0
    if processor not in (INTEL, _DEC, _MIPS):
        raise UnreadableFile(
            f"the parameters name no known processor (84, 85 or 86), got {processor}; "
            "is the file damaged?"
        )
    machine = Machine(">" if processor == _MIPS else "<", dec=processor == _DEC)
    header = _parse_header(content[:BLOCK], machine)
    end = (header.data_block - 1) * BLOCK if header.data_block > content[0] else len(content)
    try:
        groups = _collect(content[:end], start + 4, machine)
    except (struct.error, IndexError, ValueError):
        raise UnreadableFile("the parameters are damaged") from None
    return Head(machine, header, groups, end_block=content[0] + content[start + 2])


def _parse_header(block: bytes, machine: Machine) -> Header:
    words = machine.integers(block).astype(np.uint16)
    scale, rate = machine.floats(block[12:16] + block[20:24])
    return Header(
        n_points=int(words[1]),
        n_analog=int(words[2]),
        first_frame=int(words[3]),
        last_frame=int(words[4]),
        scale=float(scale),
        data_block=int(words[8]),
        rate_hz=float(rate),
        events=_parse_events(block, machine, words),
        analog_samples=int(words[9]),
    )


def _parse_events(
    block: bytes, machine: Machine, words: NDArray[np.uint16]
) -> tuple[tuple[str, float], ...]:
    """Up to 18 events of the header: four letters and seconds."""
    if words[149] != _EVENTS_KEY:
        return ()
    n_events = min(int(words[150]), _MOST_EVENTS)
    times = machine.floats(block[304 : 304 + 4 * n_events])
    names = [decode(block[396 + 4 * i : 400 + 4 * i]) for i in range(n_events)]
    return tuple((name, float(t)) for name, t in zip(names, times, strict=True) if np.isfinite(t))


class Record(NamedTuple):
    """A group (a negative number) or a parameter of one: where it starts, its value, and it ends.

    Where the last one ends nothing says: 0.
    """

    name: str
    number: int
    start: int
    value: int
    end: int


def find_records(content: bytes, at: int, machine: Machine) -> Iterator[Record]:
    """Groups and parameters one after the other, each with a link to the next."""
    while at + 2 <= len(content):
        length, number = struct.unpack_from("bb", content, at)
        if length == 0 or number == 0:
            return
        link = at + 2 + abs(length)
        (offset,) = struct.unpack_from(f"{machine.order}h", content, link)
        end = link + offset if offset > 0 else 0
        yield Record(decode(content[at + 2 : link]).upper(), number, at, link + 2, end)
        if not end:
            return
        at = end


def parse_value(content: bytes, at: int, machine: Machine) -> Value:
    """The value of a parameter; what damaged ones raise is up to Python."""
    kind, n_dimensions = struct.unpack_from("bB", content, at)
    shape = tuple(content[at + 2 : at + 2 + n_dimensions])
    size = abs(kind) * math.prod(shape)
    start = at + 2 + n_dimensions
    raw = content[start : start + size]
    if kind not in (TEXT, _BYTE, INTEGER, FLOAT) or len(raw) < size:
        raise ValueError("a parameter of unknown type, or cut off")
    if kind == TEXT:
        width = shape[0] if shape else 1
        return tuple(decode(raw[i : i + width]) for i in range(0, size, width)) if width else ()
    if kind == FLOAT:
        values = machine.floats(raw)
    elif kind == INTEGER:
        values = machine.integers(raw).astype(np.float64)
    else:
        values = np.frombuffer(raw, dtype=np.uint8).astype(np.float64)
    # The first dimension runs fastest.
    return values.reshape(shape[::-1]).T


def _collect(content: bytes, at: int, machine: Machine) -> Groups:
    """Parameters by group and name; groups may be defined after their parameters."""
    names: dict[int, str] = {}
    values: dict[int, dict[str, Value]] = {}
    for record in find_records(content, at, machine):
        if record.number < 0:
            names[-record.number] = record.name
        else:
            value = parse_value(content, record.value, machine)
            values.setdefault(record.number, {})[record.name] = value
    groups: dict[str, dict[str, Value]] = {}
    for number, parameters in values.items():
        groups.setdefault(names.get(number, str(number)), {}).update(parameters)
    return groups


def decode(raw: bytes) -> str:
    """A text of a parameter without what fills it up."""
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    return text.split("\0", 1)[0].strip() if text.strip("\0 ") else ""
