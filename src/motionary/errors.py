"""The errors that motionary raises on purpose.

Each is also the built-in error that people catch. Nothing decides by an error's text: what
a program must tell apart has a class of its own.
"""

from collections.abc import Sequence


class MotionaryError(Exception):
    """Parent of all errors that motionary raises on purpose."""


class InvalidInput(MotionaryError, ValueError):
    """An argument or a file's content is not what the call needs.

    Attributes
    ----------
    key : which value is wrong, by its name in the file; empty where there is none
    place : where in the file, as far as it is known: a line, a row, a section
    """

    def __init__(self, *args: object, key: str = "", place: str = "") -> None:
        super().__init__(*args)
        self.key, self.place = key, place


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
            f"{source}: holds {len(takes)} recordings ({some}); name one with --take "
            f"{shown[0]} (take=...), or make a file of each: motionary convert FILE -o FOLDER "
            "--to .npz"
        )
        self.takes = tuple(takes)

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[object, ...]]:
        return InvalidInput, self.args


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
        wanted = " or ".join(kind.__name__ for kind in kinds)
        wanted = f"{role}: {wanted}" if role else wanted
        raise WrongKind(f"{name} must be {wanted}, got {type(value).__name__}; {remedy}")
