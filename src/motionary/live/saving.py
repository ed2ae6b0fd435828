"""The state of a stream in a file: arrays, and JSON that says where they belong.

What changes while a stream goes on is named by its classes in `REMEMBERED`; all else comes from
the library and the settings. Numbers are kept exactly; of classes only those listed here are
read.
"""

import dataclasses
import hashlib
import json
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.features.body import Body
from motionary.files import NO_SUCH_FILE, write_atomically
from motionary.labels import Label
from motionary.live.deciding import Found
from motionary.matching import ScheduleState, StateJoiner, StreamedPath
from motionary.matching._interval_sets import Item
from motionary.models.library import ClassLibrary, thresholds_for
from motionary.recording import Recording

_VERSION = 1
_FACTS = "facts"
_NO_STATE = (
    "no state of this kind, or damaged; give a file that LiveAnnotator.save wrote, or of several "
    "people LivePeople.save and motionary live --state"
)
_UNREADABLE = (
    OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, zipfile.BadZipFile,
    zlib.error,
)  # fmt: skip
_KINDS: dict[str, Any] = {
    kind.__name__: kind
    for kind in (Body, Found, Item, Label, Recording, ScheduleState, StateJoiner, StreamedPath)
}
Arrays = dict[str, NDArray[Any]]


def save_state(
    path: str | Path, content: Mapping[str, Any], arrays: Arrays, library: ClassLibrary
) -> None:
    """Write the state of streams: what `encode` gave, and what else JSON has."""
    facts = {"version": _VERSION, "library": _digest(library), **content}
    own = arrays | {_FACTS: np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8)}
    with write_atomically(path) as beside, beside.open("wb") as file:
        np.savez(file, **own)  # type: ignore[arg-type]


def read_state(
    path: str | Path, library: ClassLibrary, names: Sequence[str]
) -> tuple[dict[str, Any], Arrays]:
    """What `save_state` wrote: content with these names, and its arrays.

    Raises
    ------
    UnreadableFile
        If the file is none that `save_state` wrote, or not whole.
    InvalidInput
        If it was written with another library.
    """
    try:
        with Path(path).open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        content = json.loads(arrays.pop(_FACTS).tobytes())
        version, digest = content["version"], content["library"]
    except FileNotFoundError as error:
        raise UnreadableFile(NO_SUCH_FILE, file=str(path)) from error
    except _UNREADABLE as error:
        raise UnreadableFile(_NO_STATE, file=str(path)) from error
    if version != _VERSION:
        raise UnreadableFile(
            f"a state of version {version}, this program reads {_VERSION}", file=str(path)
        )
    if digest != _digest(library):
        raise InvalidInput(
            "the state was saved with another library; resume it with that one", file=str(path)
        )
    if not all(name in content for name in names):
        raise UnreadableFile(_NO_STATE, file=str(path))
    return content, arrays


def restore(stream: object, state: Any, arrays: Arrays) -> None:
    """Set what a stream remembers."""
    for name, one in state["state"].items():
        if isinstance(one, dict) and "state" in one:
            restore(getattr(stream, name), one, arrays)
        else:
            setattr(stream, name, _decode(one, arrays))


def encode(value: Any, arrays: Arrays) -> Any:
    """A value as JSON has it; its arrays go to the others."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        arrays[f"a{len(arrays)}"] = value
        return {"array": f"a{len(arrays) - 1}"}
    if isinstance(value, Mapping):
        return {"dict": _encode_all([part for pair in value.items() for part in pair], arrays)}
    if type(value).__name__ in _KINDS:
        names = _names_of(type(value))
        return {
            "kind": type(value).__name__,
            "fields": _encode_all([getattr(value, name) for name in names], arrays),
        }
    if isinstance(value, tuple | list):
        return {type(value).__name__: _encode_all(value, arrays)}
    return {"state": {name: encode(getattr(value, name), arrays) for name in value.REMEMBERED}}


def _encode_all(values: Sequence[Any], arrays: Arrays) -> list[Any]:
    return [encode(one, arrays) for one in values]


def _decode(plain: Any, arrays: Arrays) -> Any:
    if not isinstance(plain, dict):
        return plain
    if "array" in plain:
        return arrays[plain["array"]]
    if "kind" in plain:
        kind = _KINDS[plain["kind"]]
        values = [_decode(one, arrays) for one in plain["fields"]]
        return kind(**dict(zip(_names_of(kind), values, strict=True)))
    [(sort, content)] = plain.items()
    parts = [_decode(one, arrays) for one in content]
    if sort == "dict":
        return dict(zip(parts[::2], parts[1::2], strict=True))
    return tuple(parts) if sort == "tuple" else parts


def _names_of(kind: Any) -> list[str]:
    if not dataclasses.is_dataclass(kind):
        return list(kind._fields)
    return [field.name for field in dataclasses.fields(kind) if field.init]


def _digest(library: ClassLibrary) -> str:
    """What tells a library from another one, in so far as its labels depend on it."""
    found = hashlib.sha256(library.feature_set.name.encode())
    found.update(thresholds_for(library).tobytes())
    for one in library:
        found.update(one.name.encode())
        for (_, pattern), ratio in zip(one.patterns, one.ratios, strict=True):
            for array in (pattern.values, pattern.fixed, ratio.if_one, ratio.if_zero):
                found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()
