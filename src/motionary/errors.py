"""The errors that motionary raises on purpose.

Each is also the built-in error that people catch. Nothing decides by an error's text: what
a program must tell apart has a class of its own.
"""

import re
from collections.abc import Collection, Sequence
from json import JSONDecodeError
from os import PathLike
from pathlib import Path, PurePath
from typing import NotRequired, TypedDict

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]+")
# Longer than any text of our own; what is longer quotes a file.
_LONGEST, _KEPT_AT_END = 1300, 300
# Abstract kinds by what people call them.
_CALLED = {
    "Real": "a number", "Integral": "a whole number", "PathLike": "Path", "Iterable": "a list",
    "Mapping": "a dict", "ndarray": "a NumPy array",
}  # fmt: skip

_QUOTED, _LONGEST_CAUSE = 40, 200
_NO_NUMBER = re.compile(r"(?:to float|with base 10): (.*)", re.DOTALL)
_DAMAGED = "its content is not whole or not of this kind; is it damaged?"
#: What errors of Python mean where a file was read that should be of a known layout.
_CAUSES: tuple[tuple[tuple[type[BaseException], ...], str], ...] = (
    ((RecursionError,), "it has lists within lists without end; is it damaged?"),
    ((MemoryError, OverflowError), "a number in it is impossibly large; is it damaged?"),
    ((IndexError,), "a list in it is shorter than expected; is it whole?"),
    ((TypeError, AttributeError), "a value in it is of another kind than expected"),
)


class Where(TypedDict):
    """A place in a file, as errors take it: `raise UnreadableFile(text, **where)`."""

    file: str | PurePath
    place: NotRequired[str]


class MotionaryError(Exception):
    """Parent of all errors that motionary raises on purpose.

    Its text is one line of bearable length, whatever it quotes of a file: the file and the
    place, if they are known, then what is wrong.

    Attributes
    ----------
    file : the file that is at fault, as the reader calls it; empty where there is none
    place : where in the file, as far as it is known: a line, a row, a section
    """

    def __init__(self, *args: object, file: str | PurePath = "", place: str = "") -> None:
        super().__init__(*args)
        self.file, self.place = str(file), place

    def __str__(self) -> str:
        where = ", ".join(part for part in (self.file, self.place) if part)
        return _shorten(f"{where}: {self.problem}" if where else self.problem)

    @property
    def problem(self) -> str:
        """What is wrong, without the file and the place."""
        return _shorten(super().__str__())

    def text_after(self, *files: str | PurePath) -> str:
        """The text as it follows the name of a file that is one of these: ", line 3: ..."."""
        names = {name for file in files for name in (str(file), PurePath(file).name)}
        if self.file not in names:
            return f": {self}"
        return f"{', ' if self.place else ''}{self.place}: {self.problem}"


class InvalidInput(MotionaryError, ValueError):
    """An argument or a file's content is not what the call needs.

    Attributes
    ----------
    key : which value is wrong, by its name in the file; empty where there is none
    """

    def __init__(
        self, *args: object, key: str = "", file: str | PurePath = "", place: str = ""
    ) -> None:
        super().__init__(*args, file=file, place=place)
        self.key = key


class WrongKind(InvalidInput, TypeError):
    """An argument is of a kind that the call does not take."""


class UnknownSkeleton(InvalidInput):
    """Joint names belong to no known skeleton, or no skeleton has the given name."""


class NotHuman(InvalidInput):
    """A motion is not one of a person: an animal on four legs."""


class SeveralRecordings(InvalidInput):
    """A file holds several recordings, and none of them is named.

    Attributes
    ----------
    takes : their names, in their sequence
    """

    def __init__(self, source: str, takes: Sequence[str]) -> None:
        shown = [take[:30] for take in takes]
        some = ", ".join(shown[:4]) + (f", ... {shown[-1]}" if len(takes) > 4 else "")
        super().__init__(
            f"holds {len(takes)} recordings ({some}); name one with --take {shown[0]} (take=...) "
            f"or as {source}#1, or make a file of each: motionary convert FILE -o FOLDER --to .npz",
            file=source,
        )
        self.takes = tuple(takes)

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[object, ...], dict[str, object]]:
        return InvalidInput, self.args, self.__dict__


class UnreadableFile(MotionaryError, OSError):
    """A file cannot be read: missing, broken, or of an unknown format."""


class NotAFile(UnreadableFile):
    """A path leads to a folder, a named pipe, a device or a socket."""


class NotAMotion(UnreadableFile):
    """A file can be read and holds something else than a motion."""


class UnwritableFile(MotionaryError, OSError):
    """A result cannot be written where it was asked for."""


class Unreachable(MotionaryError, ConnectionError):
    """Another computer does not answer, or no longer, or cannot do what is asked of it."""


class ProgramFault(MotionaryError, RuntimeError):
    """Something went wrong in the program, not by its input, while one of many was done."""


def _shorten(text: str) -> str:
    text = _CONTROL.sub(" ", text)
    if len(text) <= _LONGEST:
        return text
    return f"{text[: _LONGEST - _KEPT_AT_END]} ... {text[-_KEPT_AT_END:]}"


def describe_cause(error: BaseException) -> str:
    """What an error of Python or of a library says of a file's content, in plain words.

    Texts of our own errors stay as they are.
    """
    if isinstance(error, MotionaryError):
        return error.problem
    if isinstance(error, UnicodeDecodeError):
        return f"expected text in UTF-8, got other bytes from byte {error.start}; is it whole?"
    if isinstance(error, JSONDecodeError):
        return _describe_json(error)
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if isinstance(error, KeyError):
        return f"{str(error.args[0] if error.args else '')[:_QUOTED]!r} is missing"
    text = str(error)
    if type(error).__name__ == "TOMLDecodeError":
        # What it says is for people, and names line and column.
        return text[:_LONGEST_CAUSE]
    no_number = _NO_NUMBER.search(text)
    if no_number:
        return f"expected a number, got {no_number[1][: _QUOTED + 1]}"
    if "digits" in text and "limit" in text:
        # Python takes whole numbers of 4300 digits.
        return "it has a number of thousands of digits; is it damaged?"
    return next((said for kinds, said in _CAUSES if isinstance(error, kinds)), _DAMAGED)


def _describe_json(error: JSONDecodeError) -> str:
    rest = " ".join(error.doc[error.pos : error.pos + _QUOTED].split())
    if not rest:
        said = f"it ends too early, in line {error.lineno}" if error.doc.strip() else "it is empty"
        return f"{said}; get the whole file"
    place = f"line {error.lineno}, column {error.colno}"
    remedy = "have its program write it again"
    return f"in {place} stands {rest[:30]!r}, which JSON does not have there; {remedy}"


def check_kind(
    value: object, kinds: tuple[type, ...], *, name: str, remedy: str, role: str = ""
) -> None:
    """Refuse an argument of another kind.

    Parameters
    ----------
    value : the argument
    kinds : what the call takes
    name : of the argument
    remedy : what to do instead
    role : what the argument is to be, before its kinds

    Raises
    ------
    WrongKind
    """
    if not isinstance(value, kinds):
        wanted = " or ".join(_CALLED.get(kind.__name__, kind.__name__) for kind in kinds)
        wanted = f"{role}: {wanted}" if role else wanted
        raise WrongKind(f"{name} must be {wanted}, got {type(value).__name__}; {remedy}")


def check_choice(value: str, choices: Collection[str], *, name: str) -> str:
    """The value, which is one of some names.

    Raises
    ------
    InvalidInput
    """
    if value not in choices:
        raise InvalidInput(f"{name} must be one of {', '.join(choices)}, got {value!r}")
    return value


def check_path(path: object, *, remedy: str = "give the name of a file") -> Path:
    """The path that an argument names.

    Raises
    ------
    WrongKind
    """
    check_kind(path, (str, PathLike), name="path", remedy=remedy)
    return Path(path)  # type: ignore[arg-type]
