"""The instructions of a pickle, followed as far as they build plain values and arrays.

A pickle is a program for a machine with a stack. This machine knows the instructions that build
texts, numbers, lists, dicts and arrays of NumPy, and refuses every other one. What it takes is
bounded by the size of the file: no size is believed that goes beyond the end, keys are texts
(others need not be hashed in reasonable time), numbers of arrays stay in the file's bytes, and
text that stands for bytes is turned into them once.
"""

import codecs
import math
import re
import struct
from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

# Files of motions need hundreds; lists of numbers in place of arrays some millions.
_MOST_STEPS = 4_000_000
_CODE = re.compile(r"[fiub](1|2|4|8)|[US]\d{1,4}|O8?")
_MARK = object()
_NONSENSE = "its instructions make no sense"
_NUMBERS_ONLY = "only arrays of numbers are admitted"


class PickleRefusedError(ValueError):
    """The pickle is damaged, or holds more than arrays, numbers, texts, lists and dicts."""


class _Name:
    """A name of a module, one of those that are admitted."""

    __slots__ = ("build",)

    def __init__(self, build: "Callable[[_Machine, tuple[Any, ...]], Any] | None") -> None:
        self.build = build


class _Type:
    """Type of an array's numbers: a code, then the order of bytes."""

    __slots__ = ("dtype",)

    def __init__(self, dtype: "np.dtype[Any]") -> None:
        self.dtype = dtype


class PickledArray:
    """An array: empty at first, then shape, type and bytes."""

    __slots__ = ("value",)

    def __init__(self, value: Any = None) -> None:
        self.value: Any = np.empty(0) if value is None else value


class _JoblibArray(PickledArray):
    """An array of joblib: its bytes stand in the file behind the instruction that builds it."""

    __slots__ = ()


def run_pickle(content: bytes) -> Any:
    """The object that a pickle leaves on the stack; what damaged ones raise is up to Python.

    Raises
    ------
    PickleRefusedError
        If the pickle holds anything else.
    """
    return _Machine(content).run()


def plain(value: Any) -> Any:
    """A value of a list or dict of a pickle: arrays are NumPy's, of one object that object."""
    return value.value if isinstance(value, PickledArray) else value


class _Machine:
    """A stack, a memory, and the bytes that are left of a pickle."""

    def __init__(self, content: bytes) -> None:
        self.view = memoryview(content)
        self.at = 0
        self.stack: list[Any] = []
        self.memo: dict[int, Any] = {}
        self.encodable = len(content)

    def run(self) -> Any:
        """The object that the instructions leave on the stack."""
        for _ in range(_MOST_STEPS):
            code = self.take(1)[0]
            if code == _STOP:
                return self.stack[-1]
            step = _STEPS.get(code)
            if step is None:
                raise PickleRefusedError(f"has an instruction that is not followed ({chr(code)!r})")
            step(self)
        raise PickleRefusedError(f"has more than {_MOST_STEPS} instructions; save arrays instead")

    # ---- bytes of the file

    def take(self, size: int) -> memoryview:
        if size < 0 or size > len(self.view) - self.at:
            raise PickleRefusedError("promises more bytes than the file has; it is cut off")
        self.at += size
        return self.view[self.at - size : self.at]

    def number(self, layout: str) -> Any:
        return struct.unpack("<" + layout, self.take(struct.calcsize(layout)))[0]

    def sized(self, layout: str) -> memoryview:
        """Bytes behind their number."""
        return self.take(self.number(layout))

    def text(self, layout: str) -> str:
        return str(self.sized(layout), "utf-8", "surrogatepass")

    def line(self) -> bytes:
        # A piece at a time: a file without ends of lines is not copied for each instruction.
        end, start = -1, self.at
        while end < 0:
            piece = bytes(self.take(min(4096, max(1, len(self.view) - self.at))))
            end = piece.find(b"\n")
            if end >= 0:
                self.at -= len(piece) - end - 1
        return bytes(self.view[start : self.at - 1])

    # ---- the stack

    def push(self, value: Any) -> None:
        self.stack.append(value)

    def pop(self) -> Any:
        value = self.stack.pop()
        if value is _MARK:
            raise PickleRefusedError(_NONSENSE)
        return value

    def pop_to_mark(self) -> list[Any]:
        place = len(self.stack) - 1
        while self.stack[place] is not _MARK:
            place -= 1
            if place < 0:
                raise PickleRefusedError(_NONSENSE)
        values = self.stack[place + 1 :]
        del self.stack[place:]
        return values

    def top(self, kind: type) -> Any:
        if not isinstance(self.stack[-1], kind):
            raise PickleRefusedError(_NONSENSE)
        return self.stack[-1]

    def tuple_of(self, n: int) -> None:
        values = tuple(self.pop() for _ in range(n))[::-1]
        self.push(values)

    # ---- lists and dicts

    def append(self, values: list[Any]) -> None:
        self.top(list).extend(values)

    def set_items(self, values: list[Any]) -> None:
        for key, value in zip(values[::2], values[1::2], strict=True):
            if not isinstance(key, str):
                raise PickleRefusedError(f"has a key that is no text ({type(key).__name__})")
            self.top(dict)[key] = value

    def new_dict(self, values: list[Any]) -> None:
        self.push({})
        self.set_items(values)

    # ---- names, and what they build

    def name(self, module: str, name: str) -> None:
        if (module, name) not in _ADMITTED:
            shown = f"{module}.{name}"[:60].encode("unicode_escape").decode()
            raise PickleRefusedError(f"names {shown}")
        self.push(_Name(_ADMITTED[module, name]))

    def reduce(self) -> None:
        arguments, name = self.pop(), self.pop()
        if not isinstance(name, _Name) or name.build is None or not isinstance(arguments, tuple):
            raise PickleRefusedError("calls what may not be called")
        self.push(name.build(self, arguments))

    def build(self) -> None:
        state = self.pop()
        built = self.stack[-1]
        if isinstance(built, _Type):
            order = state[1]
            built.dtype = built.dtype.newbyteorder("=" if order == "|" else order)
        elif isinstance(built, _JoblibArray):
            built.value = self.following_array(state)
        elif isinstance(built, PickledArray):
            _, shape, kind, fortran, content = state
            built.value = self.array(content, kind, shape, "F" if fortran else "C")
        else:
            raise PickleRefusedError("builds an object of a class")

    def new_object(self) -> None:
        arguments, name = self.pop(), self.pop()
        if arguments != () or not isinstance(name, _Name) or name.build is not _start_joblib:
            raise PickleRefusedError("makes an object of a class")
        self.push(_JoblibArray())

    def following_array(self, state: Any) -> NDArray[Any]:
        kind, shape = state["dtype"], state["shape"]
        if not isinstance(kind, _Type) or kind.dtype.hasobject or not isinstance(shape, tuple):
            raise PickleRefusedError(_NUMBERS_ONLY)
        if state.get("numpy_array_alignment_bytes") is not None:
            self.take(self.number("B"))
        if any(not isinstance(n, int) or n < 0 for n in shape):
            raise PickleRefusedError("has an array of an impossible shape")
        content = self.take(math.prod(shape) * kind.dtype.itemsize)
        return np.frombuffer(content, dtype=kind.dtype).reshape(shape, order=state["order"])

    def raw(self, content: Any) -> Any:
        """Bytes; as text, one character each, they come from Python 2."""
        if not isinstance(content, str):
            return content
        self.encodable -= len(content)
        if self.encodable < 0:
            raise PickleRefusedError("builds more than it holds")
        return content.encode("latin-1")

    def array(self, content: Any, kind: Any, shape: Any, order: str) -> Any:
        if not isinstance(kind, _Type) or not isinstance(shape, tuple):
            raise PickleRefusedError(_NUMBERS_ONLY)
        if kind.dtype.hasobject:
            if shape == () and isinstance(content, list) and len(content) == 1:
                return plain(content[0])
            raise PickleRefusedError(f"holds Python objects; {_NUMBERS_ONLY}")
        values: NDArray[Any] = np.frombuffer(self.raw(content), dtype=kind.dtype)
        return values.reshape(shape, order="F" if order == "F" else "C")


def _type(machine: _Machine, arguments: tuple[Any, ...]) -> _Type:
    # No subarrays, no records, nothing huge.
    code = arguments[0]
    if not isinstance(code, str) or not _CODE.fullmatch(code):
        raise PickleRefusedError(_NUMBERS_ONLY)
    return _Type(np.dtype(code))


def _start_joblib(machine: _Machine, arguments: tuple[Any, ...]) -> NoReturn:
    raise PickleRefusedError("calls what may not be called")


def _array_of_buffer(machine: _Machine, arguments: tuple[Any, ...]) -> PickledArray:
    content, kind, shape, order = arguments
    return PickledArray(machine.array(content, kind, shape, order))


def _scalar(machine: _Machine, arguments: tuple[Any, ...]) -> Any:
    kind, content = arguments
    return machine.array(content, kind, (1,), "C")[0]


def _encode(machine: _Machine, arguments: tuple[Any, ...]) -> Any:
    text, encoding = (*arguments, "latin1")[:2]
    if encoding not in ("latin1", "latin-1") or not isinstance(text, str):
        raise PickleRefusedError("only bytes are admitted")
    return machine.raw(text)


def _ordered(machine: _Machine, arguments: tuple[Any, ...]) -> dict[str, Any]:
    if arguments:
        raise PickleRefusedError("only dicts of texts are admitted")
    return {}


# NumPy's array type is passed on and may not be called.
_ADMITTED: dict[tuple[str, str], Callable[[_Machine, tuple[Any, ...]], Any] | None] = {
    ("numpy", "ndarray"): None,
    ("numpy", "dtype"): _type,
    ("_codecs", "encode"): _encode,
    ("collections", "OrderedDict"): _ordered,
    ("joblib.numpy_pickle", "NumpyArrayWrapper"): _start_joblib,
}
for _core in ("numpy.core", "numpy._core"):
    # A shape that the pickle names here is not believed.
    _ADMITTED[f"{_core}.multiarray", "_reconstruct"] = lambda machine, arguments: PickledArray()
    _ADMITTED[f"{_core}.multiarray", "scalar"] = _scalar
    _ADMITTED[f"{_core}.numeric", "_frombuffer"] = _array_of_buffer


def _line_text(machine: _Machine) -> str:
    quoted = machine.line()
    if len(quoted) < 2 or quoted[:1] != quoted[-1:] or quoted[:1] not in (b"'", b'"'):
        raise PickleRefusedError("has a text without quotes")
    return codecs.escape_decode(quoted[1:-1])[0].decode("latin-1")


def _line_number(machine: _Machine) -> bool | int:
    line = machine.line()
    return line == b"01" if line in (b"00", b"01") else int(line)


def _line_name(machine: _Machine) -> None:
    machine.name(machine.line().decode(), machine.line().decode())


def _stack_name(machine: _Machine) -> None:
    name, module = machine.pop(), machine.pop()
    # Never as text what is none: a tuple of tuples of one tuple may be endless then.
    if not isinstance(name, str) or not isinstance(module, str):
        raise PickleRefusedError("names something by what is no text")
    machine.name(module, name)


def _remember(place: Callable[[_Machine], int]) -> Callable[[_Machine], None]:
    def step(machine: _Machine) -> None:
        machine.memo[place(machine)] = machine.stack[-1]

    return step


_STOP = ord(".")
_STEPS: dict[int, Callable[[_Machine], object]] = {
    ord(code): step
    for code, step in {
        "\x80": lambda m: m.take(1),
        "\x95": lambda m: m.take(8),
        "(": lambda m: m.push(_MARK),
        "0": lambda m: m.stack.pop(),
        "1": lambda m: m.pop_to_mark(),
        "2": lambda m: m.push(m.stack[-1]),
        "N": lambda m: m.push(None),
        "\x88": lambda m: m.push(True),
        "\x89": lambda m: m.push(False),
        "I": lambda m: m.push(_line_number(m)),
        "L": lambda m: m.push(int(m.line().rstrip(b"L"))),
        "F": lambda m: m.push(float(m.line())),
        "J": lambda m: m.push(m.number("i")),
        "K": lambda m: m.push(m.number("B")),
        "M": lambda m: m.push(m.number("H")),
        "G": lambda m: m.push(struct.unpack(">d", m.take(8))[0]),
        "\x8a": lambda m: m.push(int.from_bytes(m.sized("B"), "little", signed=True)),
        "\x8b": lambda m: m.push(int.from_bytes(m.sized("i"), "little", signed=True)),
        "S": lambda m: m.push(_line_text(m)),
        "T": lambda m: m.push(str(m.sized("i"), "latin-1")),
        "U": lambda m: m.push(str(m.sized("B"), "latin-1")),
        "V": lambda m: m.push(m.line().decode("raw-unicode-escape")),
        "X": lambda m: m.push(m.text("I")),
        "\x8c": lambda m: m.push(m.text("B")),
        "\x8d": lambda m: m.push(m.text("Q")),
        "B": lambda m: m.push(m.sized("I")),
        "C": lambda m: m.push(m.sized("B")),
        "\x8e": lambda m: m.push(m.sized("Q")),
        "\x96": lambda m: m.push(m.sized("Q")),
        ")": lambda m: m.push(()),
        "t": lambda m: m.push(tuple(m.pop_to_mark())),
        "\x85": lambda m: m.tuple_of(1),
        "\x86": lambda m: m.tuple_of(2),
        "\x87": lambda m: m.tuple_of(3),
        "]": lambda m: m.push([]),
        "l": lambda m: m.push(m.pop_to_mark()),
        "a": lambda m: m.append([m.pop()]),
        "e": lambda m: m.append(m.pop_to_mark()),
        "}": lambda m: m.push({}),
        "d": lambda m: m.new_dict(m.pop_to_mark()),
        "s": lambda m: m.set_items([m.pop(), m.pop()][::-1]),
        "u": lambda m: m.set_items(m.pop_to_mark()),
        "p": _remember(lambda m: int(m.line())),
        "q": _remember(lambda m: int(m.number("B"))),
        "r": _remember(lambda m: int(m.number("I"))),
        "\x94": _remember(lambda m: len(m.memo)),
        "g": lambda m: m.push(m.memo[int(m.line())]),
        "h": lambda m: m.push(m.memo[m.number("B")]),
        "j": lambda m: m.push(m.memo[m.number("I")]),
        "c": _line_name,
        "\x93": _stack_name,
        "R": lambda m: m.reduce(),
        "b": lambda m: m.build(),
        "\x81": lambda m: m.new_object(),
    }.items()
}
