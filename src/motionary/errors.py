"""The errors that motionary raises on purpose.

Each is also the built-in error that people catch. Nothing decides by an error's text: what
a program must tell apart has a class of its own.
"""

import re
from collections.abc import Sequence
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


class ProgramFault(MotionaryError, RuntimeError):
    """Something went wrong in the program, not by its input, while one of many was done."""


def _shorten(text: str) -> str:
    text = _CONTROL.sub(" ", text)
    if len(text) <= _LONGEST:
        return text
    return f"{text[: _LONGEST - _KEPT_AT_END]} ... {text[-_KEPT_AT_END:]}"


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


def check_path(path: object, *, remedy: str = "give the name of a file") -> Path:
    """The path that an argument names.

    Raises
    ------
    WrongKind
    """
    check_kind(path, (str, PathLike), name="path", remedy=remedy)
    return Path(path)  # type: ignore[arg-type]
