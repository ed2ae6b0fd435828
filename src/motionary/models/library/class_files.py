"""How does one class of a library lie on disk?

A TOML file with its settings and a table for each template, which names the NPZ file that
holds the values: of the templates and, where they are kept, the words of their examples.
"""

import hashlib
import io
import re
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.batch import write_atomically
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FeatureSequence, FeatureSet
from motionary.models.keyframes import KeyframeQuery, format_queries, parse_queries
from motionary.models.library.classes import MotionClass, Prototype
from motionary.models.library.lines import refuse, tell_line
from motionary.models.library.tables import check_keys, read_toml, to_toml, write_text
from motionary.models.templates import MotionTemplate
from motionary.packing import count_integers, full_mask

CLASS_KEYS = {
    "name": str, "threshold": float, "tolerance": float, "background": list, "values": str,
    "templates": list,
}  # fmt: skip
_TEMPLATE_KEYS = {"name": str, "examples": int, "columns": int, "provenance": str}
# Keys of the file and attributes of a class.
_ESTIMATES = {
    "promised_precision": "estimated_precision", "promised_recall": "estimated_recall",
}  # fmt: skip

#: What reading a broken archive of arrays ends in.
_BROKEN_ARCHIVE = (
    ValueError, TypeError, KeyError, EOFError, OSError, MemoryError, OverflowError, RuntimeError,
    zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip

Arrays = Mapping[str, NDArray[Any]]


# -- writing ----------------------------------------------------------------------------


def write_class(
    motion_class: MotionClass, folder: Path, stem: str, feature_set: FeatureSet
) -> set[Path]:
    """Write one class and return its files."""
    arrays: dict[str, NDArray[Any]] = {}
    tables = ""
    for i, prototype in enumerate(motion_class.prototypes):
        template = prototype.template
        entry: dict[str, Any] = {
            "name": prototype.name,
            "examples": template.n_examples,
            "columns": template.n_columns,
            "provenance": template.provenance,
        }
        if prototype.queries:
            # Line by line, as a person writes a query.
            text = format_queries(prototype.queries, vocabulary=feature_set)
            entry |= {"query": text.splitlines(), "votes": prototype.votes}
        tables += "\n[[templates]]\n" + to_toml(entry)
        arrays[f"values_{i}"], arrays[f"weights_{i}"] = template.values, template.weights
        arrays |= _pack_examples(prototype, i)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    content = buffer.getvalue()
    values = folder / f"{stem}.{hashlib.sha256(content).hexdigest()[:8]}.npz"
    attributes = ("name", "threshold", "tolerance", *_ESTIMATES.values(), "background")
    keys = ("name", "threshold", "tolerance", *_ESTIMATES, "background")
    settings = {
        key: value
        for key, attribute in zip(keys, attributes, strict=True)
        if (value := getattr(motion_class, attribute)) is not None
    }
    path = folder / f"{stem}.toml"
    with write_atomically(values) as beside:
        beside.write_bytes(content)
    write_text(path, to_toml(settings | {"values": values.name}) + tables)
    return {values, path}


def _pack_examples(prototype: Prototype, number: int) -> dict[str, NDArray[Any]]:
    """Arrays of a template's examples, one behind the other; without their names."""
    if not prototype.examples:
        return {}
    arrays: dict[str, NDArray[Any]] = {
        f"lengths_{number}": np.array([len(e) for e in prototype.examples], dtype=np.int64),
        f"words_{number}": np.concatenate([e.packed for e in prototype.examples]),
    }
    known = np.concatenate([e.known for e in prototype.examples])
    if not (known == full_mask(1, len(prototype.examples[0].feature_set))).all():
        arrays[f"known_{number}"] = known
    return arrays


# -- reading ----------------------------------------------------------------------------


def read_class(folder: Path, stem: str, name: str, feature_set: FeatureSet) -> MotionClass:
    """Read one class.

    Raises
    ------
    UnreadableFile
        If its table or its values are missing, broken, or do not fit.
    """
    path = folder / f"{stem}.toml"
    content = read_toml(path, CLASS_KEYS)
    if content["name"] != name:
        raise refuse(path, "name", f"is {content['name']!r}, but the library says {name!r}")
    if not content["templates"]:
        raise refuse(path, "templates", "must list at least one, got none")
    background = content["background"]
    if not all(isinstance(fraction, int | float) for fraction in background):
        raise refuse(path, "background", f"must be a list of numbers, got {background!r}")
    for key in _ESTIMATES:
        if key in content:
            check_keys(path, content, {key: float})
    arrays = _read_values(path, content["values"])
    prototypes = []
    for i, entry in enumerate(content["templates"]):
        check_keys(path, entry, _TEMPLATE_KEYS, place=f"templates[{i}].")
        prototypes.append(_read_prototype(path, i, entry, arrays, feature_set))
    try:
        return MotionClass(
            name, tuple(prototypes), content["threshold"], content["tolerance"], tuple(background),
            *(content.get(key) for key in _ESTIMATES),
        )  # fmt: skip
    except InvalidInput as error:
        raise UnreadableFile(f"{path}: {error}{_line_of(path, str(error))}") from error


def _line_of(path: Path, problem: str, *, place: str = "") -> str:
    """Where the key stands that an error of a class is about."""
    keys = (*CLASS_KEYS, *_ESTIMATES, *_TEMPLATE_KEYS, "query", "votes")
    named = [key for key in keys if re.search(rf"\b(?:n_)?{key}\b", problem)]
    return next(filter(None, (tell_line(path, key, place=place) for key in named)), "")


def _read_prototype(
    path: Path, number: int, entry: dict[str, Any], arrays: Arrays, feature_set: FeatureSet
) -> Prototype:
    place = f"templates[{number}]"
    keys = (f"values_{number}", f"weights_{number}")
    if any(key not in arrays for key in keys):
        raise UnreadableFile(f"{path}: {place} has no values in the .npz beside it")
    values, weights = (arrays[key] for key in keys)
    shape = (entry["columns"], len(feature_set))
    if values.shape != shape:
        raise UnreadableFile(
            f"{path}: {place} needs values of shape {shape} (columns, features), "
            f"the .npz beside it has {values.shape}"
            f"{tell_line(path, 'columns', place=f'{place}.')}"
        )
    if values.dtype.kind not in "fiu" or weights.dtype.kind not in "fiu":
        raise UnreadableFile(f"{path}: {place} needs numbers in the .npz beside it")
    try:
        template = MotionTemplate(
            values, weights, feature_set.ids, feature_set.name, entry["provenance"],
            entry["examples"],
        )  # fmt: skip
        queries = _read_queries(entry, feature_set)
        votes = entry.get("votes", 1)
        if not isinstance(votes, int):
            raise InvalidInput(f"votes must be a whole number, got {votes!r}")
        examples = _unpack_examples(arrays, number, feature_set)
        return Prototype(entry["name"], template, queries, votes, examples)
    except InvalidInput as error:
        line = _line_of(path, str(error), place=f"{place}.")
        raise UnreadableFile(f"{path}: {place}: {error}{line}") from error


def _read_queries(entry: dict[str, Any], feature_set: FeatureSet) -> tuple[KeyframeQuery, ...]:
    if "query" not in entry:
        return ()
    lines = entry["query"]
    if not isinstance(lines, list) or not all(isinstance(line, str) for line in lines):
        raise InvalidInput(f"query must be a list of lines, got {lines!r}")
    try:
        return parse_queries("\n".join(lines), vocabulary=feature_set)
    except InvalidInput as error:
        raise InvalidInput(f"query: {error}") from error


def _unpack_examples(
    arrays: Arrays, number: int, feature_set: FeatureSet
) -> tuple[FeatureSequence, ...]:
    if f"lengths_{number}" not in arrays:
        return ()
    lengths = arrays[f"lengths_{number}"]
    full = full_mask(1, len(feature_set))
    packed = arrays.get(f"words_{number}", np.empty(0))
    known = arrays.get(f"known_{number}")
    known = np.repeat(full, len(packed), axis=0) if known is None else known
    fits = (
        lengths.ndim == 1
        and lengths.dtype.kind == "i"
        and bool((lengths > 0).all())
        and packed.dtype == known.dtype == np.uint64
        and packed.shape == known.shape == (lengths.sum(), count_integers(len(feature_set)))
    )
    if not fits:
        raise InvalidInput("the words of its examples, in the .npz beside it, do not fit together")
    known = known & full
    ends = np.cumsum(lengths)[:-1]
    parts = zip(np.split(packed & known, ends), np.split(known, ends), strict=True)
    return tuple(FeatureSequence(part, seen, feature_set) for part, seen in parts)


def _read_values(path: Path, name: str) -> Arrays:
    """Arrays of the file that a class's table names."""
    file = path.parent / name
    if not name or Path(name).name != name:
        raise refuse(path, "values", f"must name a file beside it, got {name!r}")
    if not file.is_file():
        raise refuse(path, "values", f"means {name}, which is missing")
    try:
        # Not the path: after an error NumPy would leave the file open.
        loaded = np.load(io.BytesIO(file.read_bytes()), allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            raise ValueError("one array, no archive of arrays")
        with loaded:
            return {key: loaded[key] for key in loaded.files}
    except _BROKEN_ARCHIVE as error:
        raise UnreadableFile(f"{path}: values {name} cannot be read ({error})") from error
