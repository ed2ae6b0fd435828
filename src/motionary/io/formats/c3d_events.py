"""A copy of a C3D file with further events: all else stays, byte for byte.

The group EVENT is written anew behind the other parameters, in the numbers of the machine that
wrote the file; what stands behind the parameters moves by whole blocks, and with it the words
that say where frames begin.
"""

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from motionary.errors import InvalidInput, UnreadableFile
from motionary.files import read_bytes, write_atomically
from motionary.io.formats.c3d_head import BLOCK, Head, Machine, decode, parse_head

_EVENT = "EVENT"
#: A dimension of a parameter is a byte.
MOST_EVENTS = 255
_MOST_BLOCKS = 255


class _Raw(NamedTuple):
    """A group or parameter as it stands in the file."""

    name: str
    number: int
    content: bytes


def copy_with_events(source: Path, target: Path, events: Sequence[tuple[str, float]]) -> None:
    """Write a copy of a file with events behind those it has.

    Parameters
    ----------
    source : a C3D file
    target : the copy
    events : texts, and seconds from frame 1

    Raises
    ------
    InvalidInput
        If there are more events than the format holds, or a text is too long.
    UnreadableFile
        If the file's parameters are damaged.
    """
    content = read_bytes(source)
    head = parse_head(content, source.name)
    start = (content[0] - 1) * BLOCK
    n_blocks = content[start + 2]
    end = start + n_blocks * BLOCK
    if start != BLOCK or not n_blocks or end > (head.header.data_block - 1) * BLOCK:
        raise UnreadableFile(
            "the parameters are not where events can be added (header, "
            "parameters, frames); export the file anew",
            file=source.name,
        )
    records = list(_split(content[start + 4 : end], head.machine, source.name))
    number = _number_of_group(records)
    kept = [raw for raw in records if abs(raw.number) != number]
    block = _format_events(head, events, number)
    size = 4 + sum(len(raw.content) for raw in kept) + len(block) + 2
    grown = max(-(-size // BLOCK), n_blocks)
    if grown > _MOST_BLOCKS:
        raise InvalidInput(
            f"its parameters have no room for {len(events)} more events", file=source.name
        )
    shift = grown - n_blocks
    parameters = b"".join(_moved(raw, shift, head.machine) for raw in kept) + block + b"\0\0"
    section = content[start : start + 2] + bytes((grown, content[start + 3])) + parameters
    header = bytearray(content[:BLOCK])
    struct.pack_into(f"{head.machine.order}H", header, 16, head.header.data_block + shift)
    with write_atomically(target) as beside:
        beside.write_bytes(bytes(header) + section.ljust(grown * BLOCK, b"\0") + content[end:])


def _split(content: bytes, machine: Machine, name: str) -> Iterator[_Raw]:
    """Records one after the other, each with a link to the next."""
    at = 0
    while at + 2 <= len(content):
        length, number = struct.unpack_from("bb", content, at)
        if length == 0 or number == 0:
            return
        link = at + 2 + abs(length)
        try:
            (offset,) = struct.unpack_from(f"{machine.order}h", content, link)
            stop = link + (offset if offset > 0 else _length(content, link + 2, number))
        except (struct.error, IndexError):
            raise UnreadableFile("the parameters are damaged", file=name) from None
        body = content[link + 2 : stop]
        linked = struct.pack(f"{machine.order}h", 2 + len(body))
        yield _Raw(decode(content[at + 2 : link]).upper(), number, content[at:link] + linked + body)
        if offset <= 0:
            return
        at = stop


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


def _moved(raw: _Raw, shift: int, machine: Machine) -> bytes:
    """A record; of one that says where frames begin, with that place moved."""
    if not shift or raw.number < 0 or raw.name != "DATA_START":
        return raw.content
    # Length, number, name and link stand before its type.
    at = 2 + len(raw.name) + 2
    kind, n_dimensions = struct.unpack_from("bB", raw.content, at)
    if kind != 2 or n_dimensions > 1:
        return raw.content
    content = bytearray(raw.content)
    place = at + 2 + n_dimensions
    (block,) = struct.unpack_from(f"{machine.order}H", content, place)
    struct.pack_into(f"{machine.order}H", content, place, block + shift)
    return bytes(content)


def _format_events(head: Head, events: Sequence[tuple[str, float]], number: int) -> bytes:
    """The group EVENT: the events that were there, then the new ones."""
    machine = head.machine
    texts = list(head.texts(_EVENT, "LABELS", "LABELS2"))
    before = head.numbers(_EVENT, "TIMES").reshape(2, -1).T[: len(texts)].tolist()
    texts = texts[: len(before)]
    columns = {
        "CONTEXTS": (list(head.texts(_EVENT, "CONTEXTS", "CONTEXTS2")), "General"),
        "SUBJECTS": (list(head.texts(_EVENT, "SUBJECTS")), ""),
        "DESCRIPTIONS": (list(head.texts(_EVENT, "DESCRIPTIONS", "DESCRIPTIONS2")), ""),
    }
    times = [*before, *([t // 60, t % 60] for _, t in events)]
    labels = [*texts, *(text for text, _ in events)]
    if len(labels) > MOST_EVENTS:
        raise InvalidInput(
            f"C3D files hold {MOST_EVENTS} events, two a label, got {len(labels)}; write fewer "
            "labels, or another format"
        )
    filled = {
        name: [*found[: len(texts)], *[""] * (len(texts) - len(found)), *[default] * len(events)]
        for name, (found, default) in columns.items()
    }
    records = [
        _pack("USED", number, 2, (), struct.pack(f"{machine.order}h", len(labels)), machine),
        _pack_texts("LABELS", number, labels, machine),
        *(_pack_texts(name, number, found, machine) for name, found in filled.items()),
        _pack("TIMES", number, 4, (2, len(times)), _floats(times, machine), machine),
    ]
    return _link(_EVENT, -number, b"\0", machine) + b"".join(records)


def _floats(values: Sequence[Sequence[float]], machine: Machine) -> bytes:
    numbers = np.array(values, dtype=np.float64).ravel()
    if not machine.dec:
        return numbers.astype(f"{machine.order}f4").tobytes()
    # A VAX keeps the half with the exponent first and counts it from another zero.
    halves = (4 * numbers).astype("<f4").view("<u2").reshape(-1, 2)[:, ::-1]
    return halves.tobytes()


def _pack_texts(name: str, number: int, texts: Sequence[str], machine: Machine) -> bytes:
    raw = [text.encode("utf-8", "replace") for text in texts]
    width = max((len(text) for text in raw), default=0)
    if width > MOST_EVENTS:
        raise InvalidInput(
            f"texts in C3D files have up to {MOST_EVENTS} bytes, got {width}; shorten the name"
        )
    content = b"".join(text.ljust(width) for text in raw)
    return _pack(name, number, -1, (width, len(raw)), content, machine)


def _pack(
    name: str, number: int, kind: int, shape: tuple[int, ...], raw: bytes, machine: Machine
) -> bytes:
    body = struct.pack("bB", kind, len(shape)) + bytes(shape) + raw + b"\0"
    return _link(name, number, body, machine)


def _link(name: str, number: int, body: bytes, machine: Machine) -> bytes:
    link = struct.pack(f"{machine.order}h", 2 + len(body))
    return struct.pack("bb", len(name), number) + name.encode() + link + body
