"""Damage to the content of a file: bytes, lines, numbers and fields changed at random.

Everything is drawn from one generator, so that a seed gives the same content again.
"""

import re
from collections.abc import Callable, Sequence
from random import Random

Change = Callable[[Random, bytes, Sequence[bytes]], bytes]

_NUMBER = re.compile(rb"-?\d[\d.]*(?:[eE][-+]?\d+)?")
_HEAD = 3000
_MOST_BYTES = 1 << 20

#: What takes the place of a number in a text.
NUMBERS = (
    b"0", b"-1", b"1", b"2", b"65536", b"999999999", b"2147483648", b"-9223372036854775809",
    b"1e308", b"-1e308", b"1e-320", b"1e400", b"nan", b"NaN", b"-inf", b"Infinity", b"-nan(ind)",
    b"1.#IND", b"12.3.4", b"1,5", b"0x10", b"1_0", b"9" * 400, b"9" * 5000, b"0." + b"0" * 5000,
    b"", b"\xd9\xa3", b"\xff", b"true", b"\"1\"", b"[]", b"{}", b"+", b"-", b".", b"1e", b"--1",
)  # fmt: skip
#: What is put into a text.
TOKENS = (
    b"\0", b"\r", b"\n", b"\r\n", b"\t", b" ", b",", b";", b":", b'"', b"'", b"{", b"}", b"[", b"]",
    b"#", b"\\", b"/", b"..", b"\xef\xbb\xbf", b"\xff\xfe", b"\x1b[31m", b"\x85", b"\x0c",
    "\u2028".encode(), "\u202e".encode(), b"\xed\xa0\x80", b"=", b"\n\n\n", b"x" * 300, b"[" * 3000,
    b"{" * 3000, b"(" * 3000, b" " * 5000, b"\n" * 5000, b"a = 1\n", b"JOINT a\n{\n" * 300,
)  # fmt: skip
#: Fields of two, four and eight bytes as programs write them.
FIELDS = (
    b"\0\0", b"\xff\xff", b"\xff\x7f", b"\x00\x80", b"\0\0\0\0", b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\xff\xff\x7f\x7f",
    b"\0" * 6 + b"\xf8\x7f", b"\0" * 6 + b"\xf0\x7f", b"\xff" * 8, b"\0" * 8, b"\xff" * 7 + b"\x7f",
)  # fmt: skip


def damage(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """The content after one to several changes; `others` is what it is spliced with."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        content = rng.choice(CHANGES)(rng, content, others)[:_MOST_BYTES]
    return content


def _place(rng: Random, content: bytes | bytearray) -> int:
    # Heads decide what the rest means.
    return rng.randrange(max(1, min(len(content), rng.choice((64, 600, _HEAD, len(content))))))


def _set_bytes(rng: Random, content: bytes, _: Sequence[bytes]) -> bytes:
    changed = bytearray(content or b"x")
    for _unused in range(rng.choice((1, 1, 4, 16))):
        changed[_place(rng, changed)] = rng.randrange(256)
    return bytes(changed)


def _flip_bit(rng: Random, content: bytes, _: Sequence[bytes]) -> bytes:
    changed = bytearray(content or b"x")
    changed[_place(rng, changed)] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _cut(rng: Random, content: bytes, _: Sequence[bytes]) -> bytes:
    return content[: _place(rng, content)]


def _delete(rng: Random, content: bytes, _: Sequence[bytes]) -> bytes:
    start = _place(rng, content)
    return content[:start] + content[start + rng.randrange(1, rng.choice((4, 40, 400))) :]


def _repeat(rng: Random, content: bytes, _: Sequence[bytes]) -> bytes:
    start = _place(rng, content)
    piece = content[start : start + rng.randrange(1, rng.choice((4, 40, 400)))]
    return content[:start] + piece * rng.choice((2, 2, 3, 50)) + content[start + len(piece) :]


def _splice(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    other = rng.choice(others) if others else content
    start, length = _place(rng, other), rng.choice((8, 80, 800))
    at = _place(rng, content)
    return content[:at] + other[start : start + length] + content[at + rng.choice((0, length)) :]


def _insert(rng: Random, content: bytes, _: Sequence[bytes]) -> bytes:
    at = _place(rng, content)
    return content[:at] + rng.choice(TOKENS) + content[at:]


def _set_field(rng: Random, content: bytes, _: Sequence[bytes]) -> bytes:
    at, field = _place(rng, content), rng.choice(FIELDS)
    at -= at % rng.choice((1, 2, 4))
    return content[:at] + field + content[at + len(field) :]


def _change_number(rng: Random, content: bytes, _: Sequence[bytes]) -> bytes:
    numbers = list(_NUMBER.finditer(content[: rng.choice((200, _HEAD))]))
    if not numbers:
        return content
    one = rng.choice(numbers)
    return content[: one.start()] + rng.choice(NUMBERS) + content[one.end() :]


def _change_lines(rng: Random, content: bytes, _: Sequence[bytes]) -> bytes:
    lines = content.split(b"\n")
    a, b, n = rng.randrange(len(lines)), rng.randrange(len(lines)), rng.choice((1, 1, 3, 10))
    how = rng.randrange(4)
    if how == 0:
        del lines[a : a + n]
    elif how == 1:
        lines[a:a] = lines[b : b + n]
    elif how == 2:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        words = lines[a].split()
        rng.shuffle(words)
        lines[a] = b" ".join(words[: rng.randrange(len(words) + 1)])
    return b"\n".join(lines)


def _recode(rng: Random, content: bytes, _: Sequence[bytes]) -> bytes:
    how = rng.randrange(5)
    if how == 0:
        return content.replace(b"\n", b"\r")
    if how == 1:
        return content.replace(b"\n", b"\r\r\n")
    if how == 2:
        return content.replace(b".", b",")
    text = content.decode("latin-1")
    return text.encode("utf-16-le" if how == 3 else "utf-16")


CHANGES: tuple[Change, ...] = (
    _set_bytes, _flip_bit, _cut, _delete, _repeat, _splice, _insert, _set_field, _set_field,
    _change_number, _change_number, _change_number, _change_lines, _change_lines, _recode,
)  # fmt: skip
