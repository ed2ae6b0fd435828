"""C3D files: writing motions, copies with further events, and clips.

In a copy with events the group EVENT is written anew behind the other parameters, in the numbers
of the machine that wrote the file; what stands behind the parameters moves by whole blocks, and
with it the words that say where frames begin. All else stays, byte for byte.

A clip is bytes of the file itself, so that analog signals and parameters stay; only what counts
frames changes, and events keep their times in the recording, as its frames keep their numbers.
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.files import open_regular, read_bytes, write_atomically
from motionary.io.formats.c3d_head import (
    BLOCK,
    FLOAT,
    INTEGER,
    INTEL,
    KEY,
    LONGEST_HEAD,
    MOST_COUNTED,
    MOST_LABELS,
    TEXT,
    Head,
    Machine,
    Value,
    find_records,
    parse_head,
    parse_value,
)
from motionary.io.formats.c3d_layout import find_layout
from motionary.io.formats.content import at_fault, names_file
from motionary.io.formats.numbers import check_frames
from motionary.io.normalise.axes import turn_back
from motionary.motion import Motion
from motionary.rotations import Floats

_EVENT = "EVENT"
#: A dimension of a parameter is a byte, and so is the length of a name, with a sign.
MOST_EVENTS = 255
_MOST_BLOCKS, _LONGEST_LABEL = 255, 127
# Frames that are converted together.
_TOGETHER = 2048


def write_c3d(motion: Motion, path: str | Path) -> None:
    """Write positions and events as C3D: millimetres, z up, unseen points with residual -1."""
    if len(motion.names) > MOST_COUNTED:
        raise InvalidInput(f"C3D holds at most {MOST_COUNTED} points, got {len(motion.names)}")
    if len(motion.events) > MOST_EVENTS:
        raise InvalidInput(
            f"C3D holds at most {MOST_EVENTS} events, got {len(motion.events)}; write .npz"
        )
    too_long = [n for n in motion.names if len(n.encode()) > _LONGEST_LABEL or not n.strip()]
    if too_long:
        raise InvalidInput(
            f"names of C3D points have 1 to {_LONGEST_LABEL} bytes, got {too_long[0]!r}"
        )
    # A file counts from 1, as programs expect, where the motion counts from 0.
    head = _format_head(motion, max(1, motion.first_frame))
    with write_atomically(path) as beside, beside.open("wb") as file:
        file.write(head)
        for start in range(0, motion.n_frames, _TOGETHER):
            file.write(_format_frames(motion.positions[start : start + _TOGETHER]))


def _format_frames(positions: Floats) -> bytes:
    table = np.zeros((*positions.shape[:2], 4), dtype="<f4")
    table[..., :3] = turn_back(positions, "z") * 1000
    unseen = np.isnan(positions).any(axis=2)
    # A point exactly at the origin would read as not seen.
    table[~unseen & (table[..., :3] == 0).all(axis=2), 0] = 1e-6
    table[unseen] = (0, 0, 0, -1)
    return table.tobytes()


def _describe(motion: Motion, first: int, data_block: int) -> dict[str, dict[str, Value]]:
    labels = {
        f"LABELS{'' if i == 0 else 1 + i // MOST_LABELS}": motion.names[i : i + MOST_LABELS]
        for i in range(0, len(motion.names), MOST_LABELS)
    }
    point: dict[str, Value] = {
        "USED": _word(len(motion.names)),
        "SCALE": np.array(-1.0),
        "RATE": np.array(motion.rate_hz),
        "FRAMES": _word(min(motion.n_frames, MOST_COUNTED)),
        "LONG_FRAMES": np.array(float(motion.n_frames)),
        "UNITS": ("mm",),
        "X_SCREEN": ("+X",),
        "Y_SCREEN": ("+Z",),
        **labels,
        "DATA_START": _word(data_block),
    }
    trial: dict[str, Value] = {
        "ACTUAL_START_FIELD": _long(first),
        "ACTUAL_END_FIELD": _long(first + motion.n_frames - 1),
    }
    analog: dict[str, Value] = {"USED": _word(0), "RATE": np.array(motion.rate_hz)}
    groups = {"POINT": point, "TRIAL": trial, "ANALOG": analog}
    if motion.events:
        times = np.array([e.time_s + (first - 1) / motion.rate_hz for e in motion.events])
        groups["EVENT"] = {
            "USED": _word(len(times)),
            "CONTEXTS": tuple(e.side.capitalize() or "General" for e in motion.events),
            "LABELS": tuple(e.name for e in motion.events),
            "TIMES": np.stack((times // 60, times % 60)),
        }
    return groups


def _word(number: int) -> NDArray[np.int16]:
    """A 16-bit number, unsigned."""
    return np.array(number, dtype=np.uint16).astype(np.int16)


def _long(number: int) -> NDArray[np.int16]:
    """A number in two 16-bit words, the lower one first."""
    return np.array([number % 65536, number // 65536], dtype=np.uint16).astype(np.int16)


def _format_head(motion: Motion, first: int) -> bytes:
    """Header and parameters of a new file, Intel, up to the block where frames begin."""
    # How long parameters are does not depend on where frames begin.
    n_blocks = -(-(4 + len(_format_groups(motion, first, 0))) // BLOCK)
    data_block = 2 + n_blocks
    header = bytearray(BLOCK)
    last = min(first + motion.n_frames - 1, MOST_COUNTED)
    n_points = len(motion.names)
    struct.pack_into("<BBHHHH", header, 0, 2, KEY, n_points, 0, min(first, MOST_COUNTED), last)
    struct.pack_into("<HfHHf", header, 10, 0, -1.0, data_block, 0, motion.rate_hz)
    start = bytes((1, KEY, min(n_blocks, 255), INTEL))
    parameters = start + _format_groups(motion, first, data_block)
    return bytes(header) + parameters.ljust(n_blocks * BLOCK, b"\0")


def _format_groups(motion: Motion, first: int, data_block: int) -> bytes:
    packed = [
        _pack_group(group, number, parameters, Machine("<"))
        for number, (group, parameters) in enumerate(
            _describe(motion, first, data_block).items(), start=1
        )
    ]
    return b"".join(packed) + b"\0\0"


# -- parameters ---------------------------------------------------------------------------


def _pack_group(name: str, number: int, parameters: Mapping[str, Value], machine: Machine) -> bytes:
    """A group and its parameters: texts, 16-bit integers, or numbers that become 32-bit floats."""
    packed = [_link(_head_of(name, -number), b"\0", machine)]
    for parameter, value in parameters.items():
        packed.append(_link(_head_of(parameter, number), _pack_value(value, machine), machine))
    return b"".join(packed)


def _head_of(name: str, number: int) -> bytes:
    return struct.pack("bb", len(name), number) + name.encode()


def _link(head: bytes, body: bytes, machine: Machine) -> bytes:
    """A record: its body follows the way to the next one."""
    return head + struct.pack(f"{machine.order}h", 2 + len(body)) + body


def _pack_value(value: Value, machine: Machine) -> bytes:
    if isinstance(value, tuple):
        texts = [text.encode("utf-8", "replace") for text in value]
        width = max((len(text) for text in texts), default=0)
        if width > MOST_EVENTS:
            raise InvalidInput(
                f"texts in C3D files have up to {MOST_EVENTS} bytes, got {width}; shorten the name"
            )
        kind, shape = TEXT, (width, len(texts))
        raw = b"".join(text.ljust(width) for text in texts)
    elif value.dtype == np.int16:
        kind, shape = INTEGER, value.shape
        raw = value.astype(f"{machine.order}i2").tobytes(order="F")
    else:
        kind, shape = FLOAT, value.shape
        raw = machine.format_floats(value.astype(np.float64))
    return struct.pack("bB", kind, len(shape)) + bytes(shape) + raw + b"\0"


# -- copies with events -------------------------------------------------------------------


class _Raw(NamedTuple):
    """A group or parameter as it stands in the file: up to its link, and behind it."""

    name: str
    number: int
    head: bytes
    body: bytes


def copy_with_events(source: Path, target: Path, events: Sequence[tuple[str, float]]) -> None:
    """Write a copy of a file with events behind those it has.

    Parameters
    ----------
    source : a C3D file
    target : the copy
    events : texts, and seconds from frame 1
    """
    content = read_bytes(source)
    with at_fault(source.name):
        head = parse_head(content)
        start = (content[0] - 1) * BLOCK
        n_blocks = content[start + 2]
        end = start + n_blocks * BLOCK
        if start != BLOCK or not n_blocks or end > (head.header.data_block - 1) * BLOCK:
            raise UnreadableFile(
                "the parameters are not where events can be added (header, "
                "parameters, frames); export the file anew"
            )
        records = list(_split(content[start + 4 : end], head.machine))
    number = _number_of_group(records)
    kept = [raw for raw in records if abs(raw.number) != number]
    block = _pack_group(_EVENT, number, _describe_events(head, events), head.machine)
    size = 4 + sum(len(raw.head) + 2 + len(raw.body) for raw in kept) + len(block) + 2
    grown = max(-(-size // BLOCK), n_blocks)
    if grown > _MOST_BLOCKS:
        raise InvalidInput(
            f"its parameters have no room for {len(events)} more events", file=source.name
        )
    shift = grown - n_blocks
    moved = [_link(raw.head, _move(raw, shift, head.machine), head.machine) for raw in kept]
    parameters = b"".join(moved) + block + b"\0\0"
    section = content[start : start + 2] + bytes((grown, content[start + 3])) + parameters
    header = bytearray(content[:BLOCK])
    struct.pack_into(f"{head.machine.order}H", header, 16, head.header.data_block + shift)
    with write_atomically(target) as beside:
        beside.write_bytes(bytes(header) + section.ljust(grown * BLOCK, b"\0") + content[end:])


def _split(content: bytes, machine: Machine) -> Iterator[_Raw]:
    """Records one after the other."""
    try:
        for name, number, start, value, end in find_records(content, 0, machine):
            stop = end or value - 2 + _length(content, value, number)
            yield _Raw(name, number, content[start : value - 2], content[value:stop])
    except (struct.error, IndexError):
        raise UnreadableFile("the parameters are damaged") from None


def _length(content: bytes, at: int, number: int) -> int:
    """Bytes from the link of the last record, which leads nowhere, to its end."""
    size = 0
    if number > 0:
        kind, n_dimensions = struct.unpack_from("bB", content, at)
        shape = content[at + 2 : at + 2 + n_dimensions]
        size = 2 + n_dimensions + abs(kind) * int(np.prod([int(x) for x in shape]))
    return 2 + size + 1 + content[at + size]


def _number_of_group(records: Sequence[_Raw]) -> int:
    """The number of the group EVENT; a free one where there is none."""
    for raw in records:
        if raw.number < 0 and raw.name == _EVENT:
            return -raw.number
    return next(i for i in range(1, 128) if i not in {abs(raw.number) for raw in records})


def _move(raw: _Raw, shift: int, machine: Machine) -> bytes:
    """The body of a record; of one that says where frames begin, with that place moved."""
    if not shift or raw.number < 0 or raw.name != "DATA_START":
        return raw.body
    kind, n_dimensions = struct.unpack_from("bB", raw.body)
    if kind != INTEGER or n_dimensions > 1:
        return raw.body
    body = bytearray(raw.body)
    (block,) = struct.unpack_from(f"{machine.order}H", body, 2 + n_dimensions)
    struct.pack_into(f"{machine.order}H", body, 2 + n_dimensions, block + shift)
    return bytes(body)


def _describe_events(head: Head, events: Sequence[tuple[str, float]]) -> dict[str, Value]:
    """The group EVENT: the events that were there, then the new ones."""
    before = head.numbers(_EVENT, "TIMES").reshape(2, -1).T
    there = head.texts(_EVENT, "LABELS", "LABELS2")[: len(before)]
    n = len(there)
    labels = (*there, *(text for text, _ in events))
    if len(labels) > MOST_EVENTS:
        raise InvalidInput(
            f"C3D files hold {MOST_EVENTS} events, two a label, got {len(labels)}; write fewer "
            "labels, or another format"
        )

    def column(default: str, *names: str) -> tuple[str, ...]:
        found = head.texts(_EVENT, *names)[:n]
        return (*found, *[""] * (n - len(found)), *[default] * len(events))

    seconds = np.array([time for _, time in events])
    return {
        "USED": _word(len(labels)),
        "LABELS": labels,
        "CONTEXTS": column("General", "CONTEXTS", "CONTEXTS2"),
        "SUBJECTS": column("", "SUBJECTS"),
        "DESCRIPTIONS": column("", "DESCRIPTIONS", "DESCRIPTIONS2"),
        "TIMES": np.concatenate((before[:n], np.stack((seconds // 60, seconds % 60), axis=1))).T,
    }


# -- clips --------------------------------------------------------------------------------


@names_file
def cut_c3d(path: Path, first: int, last: int, take: str | int | None = None) -> bytes:
    """A clip of a C3D file; frames as the file counts them, both included.

    Files with rotations are refused: these lie behind the frames.
    """
    with open_regular(path) as file:
        head = parse_head(file.read(LONGEST_HEAD))
        if head.count("ROTATION", "USED", 0):
            raise UnreadableFile(
                "holds rotations, which clips cannot be cut out of; convert it to .npz first"
            )
        layout, _ = find_layout(file, head)
        check_frames(first, last, first_number=layout.first_frame, n_frames=layout.n_frames)
        file.seek(0)
        before = _recount(file.read(layout.start), head.machine, first_frame=first, last_frame=last)
        file.seek(layout.start + (first - layout.first_frame) * layout.frame)
        return before + file.read((last - first + 1) * layout.frame)


def _recount(content: bytes, machine: Machine, *, first_frame: int, last_frame: int) -> bytes:
    """The blocks before the frames, with the numbers of other frames wherever they stand."""
    changed = bytearray(content)
    n_frames = last_frame - first_frame + 1
    words = (min(first_frame, MOST_COUNTED), min(last_frame, MOST_COUNTED))
    struct.pack_into(f"{machine.order}2H", changed, 6, *words)
    counts = {
        ("POINT", "FRAMES"): n_frames,
        ("POINT", "LONG_FRAMES"): n_frames,
        ("TRIAL", "ACTUAL_START_FIELD"): first_frame,
        ("TRIAL", "ACTUAL_END_FIELD"): last_frame,
    }
    records = list(find_records(content, (content[0] - 1) * BLOCK + 4, machine))
    groups = {-record.number: record.name for record in records if record.number < 0}
    for record in records:
        count = counts.get((groups.get(record.number, ""), record.name))
        if count is None or record.number < 0:
            continue
        value = parse_value(content, record.value, machine)
        if isinstance(value, tuple):
            continue
        kind, n_dimensions = struct.unpack_from("bB", content, record.value)
        start, size = record.value + 2 + n_dimensions, value.size
        if kind == FLOAT and size == 1:
            changed[start : start + 4] = machine.format_floats(np.array([float(count)]))
        elif kind == INTEGER and size in (1, 2):
            numbers = [min(count, MOST_COUNTED)] if size == 1 else [count % 65536, count // 65536]
            struct.pack_into(f"{machine.order}{size}H", changed, start, *numbers)
    return bytes(changed)
