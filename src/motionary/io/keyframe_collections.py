"""Collections of keyframe queries in JSON files.

JSON files of named collections of named queries, in the form in which the queries of
Baak, Müller and Seidel (2008) and of Müller, Baak and Seidel (2009) are passed on: per
query "keyframes" (a sign 0, 1 or * for every feature of a group), "groups", "positions",
"distances", "stiffness" and "template_length".

Conventions: positions count from 1 in the file and from 0 in what is read.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.text import read_json

_MOST_NAMES = 5
_KINDS: Mapping[str, type] = {
    "keyframes": str, "groups": str, "distances": int, "stiffness": float, "positions": int,
}  # fmt: skip


class QueryRecord(NamedTuple):
    """One query as it is written.

    Attributes
    ----------
    keyframes : per keyframe, a sign 0, 1 or * for every feature of its group
    groups : per keyframe, the group of its features
    distances, stiffness : per gap, frames and stiffness
    positions : per keyframe, column of the template it comes from, from 0
    template_length : columns of that template
    """

    keyframes: tuple[str, ...]
    groups: tuple[str, ...]
    distances: tuple[int, ...]
    stiffness: tuple[float, ...]
    positions: tuple[int, ...]
    template_length: int


def read_query_collections(path: str | Path) -> dict[str, dict[str, QueryRecord]]:
    """Queries of a file, by collection and name.

    Raises
    ------
    UnreadableFile
        If the file is missing, is no JSON, or a query is incomplete or malformed; names the
        query.
    """
    path = Path(path)
    content = read_json(path)
    if not isinstance(content, dict) or not all(isinstance(x, dict) for x in content.values()):
        raise UnreadableFile(
            "needs an object of collections, each an object of queries by name", file=path
        )
    return {
        collection: {
            name: _read_record(path, f"{collection}/{name}", entry) for name, entry in part.items()
        }
        for collection, part in content.items()
    }


def read_query_record(path: str | Path, name: str | None = None) -> QueryRecord:
    """One query of a file, by its name or as COLLECTION/NAME; the only one without a name.

    Raises
    ------
    UnreadableFile
        As of `read_query_collections`.
    InvalidInput
        If there is no such query, or more than one.
    """
    path = Path(path)
    records = {
        f"{collection}/{query}": record
        for collection, queries in read_query_collections(path).items()
        for query, record in queries.items()
    }
    found = [full for full in records if name in (None, full, full.split("/", 1)[1])]
    if len(found) == 1:
        return records[found[0]]
    what = f"{len(found)} queries" + (f" called {name!r}" if name else "")
    near = [full for full in records if name and name.lower() in full.lower()]
    names = found or near or list(records)
    some = ", ".join(names[:_MOST_NAMES]) + (", ..." if len(names) > _MOST_NAMES else "")
    what = what if found else f"no query {name!r}"
    raise InvalidInput(f"{path.name} has {what}; choose one by its name: {some}", key="name")


def _read_record(path: Path, name: str, entry: Any) -> QueryRecord:
    def refuse(problem: str) -> UnreadableFile:
        return UnreadableFile(f"query {name!r}: {problem}", file=path)

    if not isinstance(entry, dict):
        raise refuse("needs to be an object")
    missing = [key for key in QueryRecord._fields if key not in entry]
    if missing:
        raise refuse(f"lacks {', '.join(missing)}")
    wrong = [key for key, kind in _KINDS.items() if not _is_list(entry[key], kind)]
    if wrong or not _is_number(entry["template_length"], int):
        raise refuse(f"{(*wrong, 'template_length')[0]} is not what it should be")
    n_keyframes = len(entry["keyframes"])
    for key in _KINDS:
        expected = n_keyframes - 1 if key in ("distances", "stiffness") else n_keyframes
        if n_keyframes == 0 or len(entry[key]) != expected:
            raise refuse(f"{n_keyframes} keyframes do not go with {len(entry[key])} {key}")
    if min(entry["positions"]) < 1 or max(entry["positions"]) > entry["template_length"]:
        raise refuse("positions lie outside the template")
    return QueryRecord(
        tuple(entry["keyframes"]),
        tuple(entry["groups"]),
        tuple(entry["distances"]),
        tuple(float(value) for value in entry["stiffness"]),
        tuple(position - 1 for position in entry["positions"]),
        entry["template_length"],
    )


def _is_list(values: Any, kind: type) -> bool:
    """Whether there is a list of values of that kind."""
    return isinstance(values, list) and all(
        isinstance(value, str) if kind is str else _is_number(value, kind) for value in values
    )


def _is_number(value: Any, kind: type) -> bool:
    allowed = int if kind is int else (int, float)
    # Beyond, a whole number is no float.
    is_one = isinstance(value, allowed) and not isinstance(value, bool)
    return is_one and not abs(value) > 1e300
