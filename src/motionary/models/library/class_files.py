"""One class of a library on disk: a TOML file that people edit, and an NPZ file.

The TOML file holds the settings and a table for each template, and names the NPZ file that
holds the values: of the templates and, where they are kept, the packed features of their
examples. What a person wrote into the TOML file besides stays when it is written again.
"""

import hashlib
import io
import itertools
import re
import struct
import tokenize
import unicodedata
import warnings
import zipfile
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile, describe_cause
from motionary.features import FeatureSequence, FeatureSet
from motionary.files import read_bytes, write_atomically
from motionary.models.keyframes import KeyframeQuery
from motionary.models.library.classes import MotionClass, Prototype
from motionary.models.library.toml_tables import (
    Keys,
    check_keys,
    format_line,
    format_place,
    is_number,
    read_document,
    read_toml,
    refuse,
    refuse_value,
    update_table,
    write_document,
)
from motionary.models.templates import MotionTemplate
from motionary.packing import count_integers, full_mask

if TYPE_CHECKING:
    from tomlkit import TOMLDocument

Arrays = Mapping[str, NDArray[Any]]

CLASS_KEYS: Keys = {
    "name": str, "threshold": float, "tolerance": float, "background": list, "values": str,
    "templates": list,
}  # fmt: skip
_TEMPLATE_KEYS: Keys = {"name": str, "examples": int, "columns": int, "provenance": str}
_OPTIONAL_KEYS: Keys = {"mirror_of": str, "unmeasured": list}
# Keys of the file, by attributes of a class.
_ESTIMATES = {
    "estimated_precision": "promised_precision", "estimated_recall": "promised_recall",
}  # fmt: skip
_LONGEST_BYTES = 100
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)
# Written only where a class differs from the defaults.
_OWN_KEYS: Keys = {
    "prior": list, "parts": list, "provenance": str, "licence": str, "kind": str,
    "score_threshold": float, "false_level": float,
}  # fmt: skip
_DEFAULTS = {one.name: one.default for one in fields(MotionClass)}

#: What reading a broken archive of arrays ends in.
_BROKEN_ARCHIVE = (
    ValueError, TypeError, KeyError, EOFError, OSError, MemoryError, OverflowError, RuntimeError,
    zipfile.BadZipFile, zlib.error, struct.error, SyntaxError, tokenize.TokenError,
)  # fmt: skip

# -- writing ----------------------------------------------------------------------------


def write_class(
    motion_class: MotionClass, folder: Path, stem: str, feature_set: FeatureSet
) -> set[Path]:
    """Write one class and return its files."""
    arrays: dict[str, NDArray[Any]] = {}
    entries = []
    for i, prototype in enumerate(motion_class.prototypes):
        template = prototype.template
        arrays[f"values_{i}"], arrays[f"weights_{i}"] = template.values, template.weights
        arrays |= _pack_examples(prototype, i)
        entries.append(_to_entry(prototype, feature_set))
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    content = buffer.getvalue()
    values = folder / f"{stem}.{hashlib.sha256(content).hexdigest()[:8]}.npz"
    settings = {key: getattr(motion_class, key) for key in ("name", "threshold", "tolerance")}
    estimates = {key: getattr(motion_class, attribute) for attribute, key in _ESTIMATES.items()}
    settings |= {key: value for key, value in estimates.items() if value is not None}
    settings |= {"background": list(motion_class.background), "values": values.name}
    own = {key: getattr(motion_class, key) for key in _OWN_KEYS}
    for key, value in own.items():
        if value != _DEFAULTS[key]:
            settings[key] = list(value) if isinstance(value, tuple) else value
    path = folder / f"{stem}.toml"
    document = read_document(path)
    update_table(document, settings, optional=(*_ESTIMATES.values(), *_OWN_KEYS))
    _update_entries(document, entries)
    with write_atomically(values) as beside:
        beside.write_bytes(content)
    write_document(path, document)
    return {values, path}


def _to_entry(prototype: Prototype, feature_set: FeatureSet) -> dict[str, Any]:
    """The table of a template."""
    template = prototype.template
    entry: dict[str, Any] = {
        "name": prototype.name, "examples": template.n_examples, "columns": template.n_columns,
        "provenance": template.provenance,
    }  # fmt: skip
    if prototype.mirror_of:
        entry["mirror_of"] = prototype.mirror_of
    if template.unmeasured:
        entry["unmeasured"] = list(template.unmeasured)
    if prototype.queries:
        from motionary.models.keyframes import format_queries

        # Line by line, as a person writes a query.
        text = format_queries(prototype.queries, vocabulary=feature_set)
        entry |= {"query": text.splitlines(), "votes": prototype.votes}
    return entry


def _update_entries(document: "TOMLDocument", entries: list[dict[str, Any]]) -> None:
    """Give a class its templates; tables of the same number of templates are kept."""
    import tomlkit
    from tomlkit.items import AoT

    tables = document.get("templates")
    if not isinstance(tables, AoT) or len(tables) != len(entries):
        document.pop("templates", None)
        tables = tomlkit.aot()
        tables.extend(tomlkit.table() for _ in entries)
        for table in tables[1:]:
            table.trivia.indent = "\n"
        document["templates"] = tables
    for table, entry in zip(tables, entries, strict=True):
        update_table(table, entry, optional=(*_OPTIONAL_KEYS, "query", "votes"))


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
    """Read one class; UnreadableFile if its table or values are missing, broken, or do not fit."""
    path = folder / f"{stem}.toml"
    content = read_toml(path, CLASS_KEYS)
    if content["name"] != name:
        raise refuse(path, ("name",), f"is {content['name']!r}, but the library says {name!r}")
    if not content["templates"]:
        raise refuse(path, ("templates",), "must list at least one, got none")
    check_keys(path, content, {}, optional=_OWN_KEYS)
    own = {key: content[key] for key in _OWN_KEYS if key in content}
    for key in ("background", "prior"):
        if not all(map(is_number, content.get(key, ()))):
            raise refuse(path, (key,), f"must be a list of numbers, got {content[key]!r}")
    for attribute, key in _ESTIMATES.items():
        if key in content:
            check_keys(path, content, {key: float})
            if not 0 <= content[key] <= 1:
                raise refuse(path, (key,), f"must lie in [0, 1], got {content[key]}")
            own[attribute] = content[key]
    arrays = _read_values(path, content["values"])
    prototypes = []
    for i, entry in enumerate(content["templates"]):
        check_keys(path, entry, _TEMPLATE_KEYS, optional=_OPTIONAL_KEYS, place=("templates", i))
        prototypes.append(_read_prototype(path, i, entry, arrays, feature_set))
    try:
        return MotionClass(
            name, tuple(prototypes), content["threshold"], content["tolerance"],
            tuple(content["background"]), **own,
        )  # fmt: skip
    except InvalidInput as error:
        raise refuse_value(path, (), error) from error


def _read_prototype(
    path: Path, number: int, entry: dict[str, Any], arrays: Arrays, feature_set: FeatureSet
) -> Prototype:
    place = ("templates", number)
    keys = (f"values_{number}", f"weights_{number}")
    if any(key not in arrays for key in keys):
        raise UnreadableFile(
            f"{format_place(place)} has no values in the .npz beside it", file=path
        )
    values, weights = (arrays[key] for key in keys)
    shape = (entry["columns"], len(feature_set))
    if values.shape != shape:
        raise UnreadableFile(
            f"{format_place(place)} needs values of shape {shape} (columns, features), the "
            f".npz beside it has {values.shape}{format_line(path, (*place, 'columns'))}",
            file=path,
        )
    if values.dtype.kind not in "fiu" or weights.dtype.kind not in "fiu":
        raise UnreadableFile(
            f"{format_place(place)} needs numbers in the .npz beside it", file=path
        )
    try:
        template = MotionTemplate(
            values, weights, feature_set.ids, feature_set.name, entry["provenance"],
            entry["examples"], tuple(entry.get("unmeasured", ())),
        )  # fmt: skip
        queries, votes = _read_queries(entry, feature_set)
        examples = _unpack_examples(arrays, number, feature_set)
        mirror_of = entry.get("mirror_of", "")
        return Prototype(entry["name"], template, queries, votes, examples, mirror_of)
    except InvalidInput as error:
        raise refuse_value(path, place, error) from error


def _read_queries(
    entry: dict[str, Any], feature_set: FeatureSet
) -> tuple[tuple[KeyframeQuery, ...], int]:
    """Queries of a template, and how many must agree."""
    lines, votes = entry.get("query", []), entry.get("votes", 1)
    if not isinstance(lines, list) or not all(isinstance(line, str) for line in lines):
        raise InvalidInput(f"query must be a list of lines, got {lines!r}", key="query")
    if not isinstance(votes, int):
        raise InvalidInput(f"votes must be a whole number, got {votes!r}", key="votes")
    if "query" not in entry:
        return (), votes
    from motionary.models.keyframes import parse_queries

    try:
        return parse_queries("\n".join(lines), vocabulary=feature_set), votes
    except InvalidInput as error:
        raise InvalidInput(f"query: {error}", key="query") from error


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
        raise InvalidInput("the packed features of its examples, in the .npz, do not fit together")
    known = known & full
    ends = np.cumsum(lengths)[:-1]
    parts = zip(np.split(packed & known, ends), np.split(known, ends), strict=True)
    return tuple(FeatureSequence(part, seen, feature_set) for part, seen in parts)


def _read_values(path: Path, name: str) -> Arrays:
    """Arrays of the file that a class's table names."""
    file = path.parent / name
    if not name or Path(name).name != name:
        raise refuse(path, ("values",), f"must name a file beside it, got {name!r}")
    is_there = False
    # A name may be too long for the system.
    with suppress(OSError):
        is_there = file.is_file()
    if not is_there:
        raise refuse(path, ("values",), f"means {name[:80]}, which is missing")
    try:
        # Not the path: after an error NumPy would leave the file open.
        with warnings.catch_warnings():
            # Of heads as Python 2 wrote them.
            warnings.simplefilter("ignore", UserWarning)
            loaded = np.load(io.BytesIO(read_bytes(file)), allow_pickle=False)
            if isinstance(loaded, np.ndarray):
                raise InvalidInput("one array, no archive of arrays")
            with loaded:
                arrays = {key: loaded[key] for key in loaded.files}
        # NumPy gives the bytes of what is no array.
        odd = next((key for key, one in arrays.items() if not isinstance(one, np.ndarray)), None)
        if odd is not None:
            raise InvalidInput(f"{odd} is no array")
        return arrays
    except _BROKEN_ARCHIVE as error:
        raise UnreadableFile(
            f"values {name} cannot be read ({describe_cause(error)})", file=path
        ) from error


# -- names of files -----------------------------------------------------------------------


def choose_stems(
    names: Iterable[str], *, kept: Mapping[str, str], taken: Collection[str]
) -> dict[str, str]:
    """File name without suffix for each class: the kept one, or a new one that is not taken.

    Some file systems fold case, some decompose accents, some keep names of devices to
    themselves, all limit the length.
    """
    used = {_fold(stem) for stem in (*taken, *kept.values())}
    stems = {}
    for name in names:
        free = (stem for stem in number_names(to_stem(name)) if _fold(stem) not in used)
        stems[name] = kept[name] if name in kept else next(free)
        used.add(_fold(stems[name]))
    return stems


def number_names(name: str) -> Iterator[str]:
    """A name itself, and numbered from 2 on."""
    yield name
    yield from (f"{name}-{number}" for number in itertools.count(2))


def to_stem(name: str) -> str:
    """The nearest name that every file system takes; not unique."""
    stem = re.sub(r"[^\w.-]", "_", unicodedata.normalize("NFC", name))
    stem = stem.encode()[:_LONGEST_BYTES].decode(errors="ignore").strip(".-")
    return f"_{stem}" if _DEVICES.match(stem) else stem or "class"


def _fold(stem: str) -> str:
    return unicodedata.normalize("NFC", stem).casefold()
