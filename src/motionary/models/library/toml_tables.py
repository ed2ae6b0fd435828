"""Tables of TOML files that people edit: read, checked, and written back as they were.

Errors name the file, the key, what is wrong with its value, and the line.
"""

import difflib
import tomllib
from collections.abc import Iterable, Mapping, MutableMapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile, describe_cause
from motionary.files import read_bytes, write_atomically

if TYPE_CHECKING:
    from tomlkit import TOMLDocument

#: Keys that a table needs, and of which kind their values are.
Keys = Mapping[str, type]
#: Where a value stands in a file: keys of tables, numbers of their entries.
Place = tuple[str | int, ...]

_KINDS = {
    str: "a text in quotes", int: "a whole number", float: "a number", bool: "true or false",
    list: "a list", dict: "a table",
}  # fmt: skip
_MOST = 1e300
# No file holds it.
_MARK = "\ue000here\ue000"


def read_toml(path: Path, keys: Keys) -> dict[str, Any]:
    """Content of a TOML file; UnreadableFile if it is none, or lacks a key of its kind."""
    try:
        content = tomllib.loads(read_bytes(path).decode("utf-8"))
    except UnicodeDecodeError as error:
        raise UnreadableFile(
            f"cannot be read: expected UTF-8, got other bytes from byte {error.start}; "
            "save it as UTF-8",
            file=path,
        ) from error
    # Not TOMLDecodeError alone: numbers may have more digits than Python takes.
    except (ValueError, RecursionError) as error:
        raise UnreadableFile(f"is not valid TOML: {describe_cause(error)}", file=path) from error
    check_keys(path, content, keys)
    return content


def is_number(value: Any) -> bool:
    """Whether a value is a number that a float can hold."""
    return isinstance(value, int | float) and not abs(value) > _MOST


def check_keys(
    path: Path,
    content: Any,
    keys: Keys,
    *,
    optional: Keys = MappingProxyType({}),
    place: Place = (),
) -> None:
    """Raise UnreadableFile unless a table has these keys; whole numbers pass as numbers."""
    if not isinstance(content, dict):
        raise refuse(path, place, f"must be a table, got {content!r}")
    for key, kind in (*keys.items(), *optional.items()):
        if key not in content:
            if key in optional:
                continue
            raise _missing(path, key, content, place)
        value = content[key]
        if kind is float and type(value) is int and is_number(value):
            content[key] = float(value)
        elif not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise refuse(path, (*place, key), f"must be {_KINDS[kind]}, got {value!r}")


def refuse(path: Path, place: Place, problem: str) -> UnreadableFile:
    """The error of a value: file, key, what is wrong with it, and line."""
    return UnreadableFile(f"{format_place(place)} {problem}{format_line(path, place)}", file=path)


def refuse_value(path: Path, place: Place, error: InvalidInput) -> UnreadableFile:
    """The error of a file in which a class or a template finds a wrong value."""
    where = f"{format_place(place)}: " if place else ""
    line = format_line(path, (*place, error.key)) if error.key else ""
    return UnreadableFile(f"{where}{error}{line}", file=path)


def format_line(path: Path, place: Place) -> str:
    """The end of a message, as " (line 4)"; empty if nothing stands there."""
    # Late: only who writes, or wrote something wrong, waits for it.
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    try:
        document: Any = tomlkit.parse(read_bytes(path).decode("utf-8"))
        table = document
        for step in place[:-1]:
            table = table[step]
        table[place[-1]]
        table[place[-1]] = _MARK
        lines = tomlkit.dumps(document).splitlines()
    except (OSError, ValueError, LookupError, TypeError, TOMLKitError):
        return ""
    # What stands before a value keeps its lines when the value changes.
    return next((f" (line {n})" for n, line in enumerate(lines, start=1) if _MARK in line), "")


def read_document(path: Path) -> "TOMLDocument":
    """A TOML file with all that a person wrote into it; empty if there is none to read."""
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    try:
        return tomlkit.parse(read_bytes(path).decode("utf-8"))
    except (OSError, ValueError, TOMLKitError):
        return tomlkit.document()


def write_document(path: Path, document: "TOMLDocument") -> None:
    """Write a TOML file whole or not at all; UnwritableFile if it cannot be."""
    import tomlkit

    try:
        content = tomlkit.dumps(document).encode()
    except UnicodeEncodeError as error:
        raise UnwritableFile(f"a name in it is no valid text ({error})", file=path) from error
    with write_atomically(path) as beside:
        beside.write_bytes(content)


def update_table(
    table: MutableMapping[str, Any], content: Mapping[str, Any], *, optional: Iterable[str] = ()
) -> None:
    """Give a table these values; of `optional` keys those that have none are removed."""
    for key in optional:
        if key in table and key not in content:
            del table[key]
    for key, value in content.items():
        # A value that stays keeps the way in which it is written.
        if key not in table or table[key] != value:
            table[key] = value


def _missing(path: Path, key: str, others: Iterable[str], place: Place) -> UnreadableFile:
    """The error of a key that is not there; another one may be what was meant."""
    hint = ""
    for near in difflib.get_close_matches(key, others, n=1, cutoff=0.75):
        hint = f"; is it {near!r}{format_line(path, (*place, near))}?"
    return UnreadableFile(f"{format_place((*place, key))} is missing{hint}", file=path)


def format_place(place: Place) -> str:
    """A place in words, as "templates[0].name"."""
    steps = (f"[{step}]" if isinstance(step, int) else f".{step}" for step in place)
    return "".join(steps).removeprefix(".")
