"""How are the tables of a library written, and checked after a person has edited them?

Tables are TOML of text, numbers, lists and tables of text.
"""

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from motionary.batch import write_atomically
from motionary.errors import UnreadableFile, UnwritableFile
from motionary.models.library.lines import refuse, refuse_missing

#: Keys that a table needs, and of which kind their values are.
Keys = Mapping[str, type]

_KINDS = {
    str: "a text in quotes",
    int: "a whole number",
    float: "a number",
    list: "a list",
    dict: "a table",
}
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def to_toml(content: Mapping[str, Any]) -> str:
    """Lines of a TOML table of texts, numbers and lists: JSON values are TOML ones."""
    return "".join(
        f"{key if _BARE.fullmatch(key) else _to_value(key)} = {_to_value(value)}\n"
        for key, value in content.items()
    )


def read_toml(path: Path, keys: Keys) -> dict[str, Any]:
    """Content of a TOML file that has these keys.

    Raises
    ------
    UnreadableFile
        If it cannot be read, is not TOML, or a key is missing or of another kind.
    """
    try:
        content = tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise UnreadableFile(f"{path}: cannot be read ({error})") from error
    except tomllib.TOMLDecodeError as error:
        raise UnreadableFile(f"{path}: is not valid TOML: {error}") from error
    check_keys(path, content, keys)
    return content


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all.

    Raises
    ------
    UnwritableFile
        If it cannot be written, or the text cannot be encoded.
    """
    try:
        content = text.encode()
    except UnicodeEncodeError as error:
        raise UnwritableFile(f"{path}: a name in it is no valid text ({error})") from error
    with write_atomically(path) as beside:
        beside.write_bytes(content)


def check_keys(path: Path, content: Any, keys: Keys, *, place: str = "") -> None:
    """Raise UnreadableFile unless a table has these keys; whole numbers pass as numbers.

    Parameters
    ----------
    path : file, for the message
    content : the table
    keys : what it needs
    place : where in the file it stands, for the message ("templates[0].")

    Raises
    ------
    UnreadableFile
        Names file, key and line.
    """
    if not isinstance(content, dict):
        raise refuse(path, place.rstrip("."), f"must be a table, got {content!r}")
    for key, kind in keys.items():
        if key not in content:
            raise refuse_missing(path, key, content, place=place)
        value = content[key]
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            content[key] = float(value)
        elif not isinstance(value, kind) or isinstance(value, bool):
            raise refuse(path, key, f"must be {_KINDS[kind]}, got {value!r}", place=place)


def _to_value(value: Any) -> str:
    # The one character that JSON leaves as it is and TOML forbids.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
