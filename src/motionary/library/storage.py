"""How does a library lie on disk?

A folder: `library.toml` says what the library is, and each class has a TOML file with its
settings, which names the NPZ file that holds the values of its templates. Values are named
after their content and written first, and a class keeps its file, so that each class is
the old one or the new one whenever writing ends. Files of others are left alone.

Class files are named after their classes; characters that file systems dislike become
`_`, and `library.toml` lists file and class.
"""

import hashlib
import io
import re
import struct
import tomllib
import zipfile
import zlib
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from motionary.batch import write_atomically
from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.features import FULL_BODY, FULL_BODY_2006, FeatureSet
from motionary.keyframes import KeyframeQuery, format_queries, parse_queries
from motionary.library.classes import ClassLibrary, MotionClass, Subclass
from motionary.library.naming import choose_stems, to_stem
from motionary.library.tables import check_keys, read_toml, to_toml
from motionary.templates import MotionTemplate

#: Raised when a reader of the version before could misunderstand the files.
VERSION = 1
INDEX = "library.toml"

_FEATURE_SETS = {s.name: s for s in (FULL_BODY, FULL_BODY_2006)}
_INDEX_KEYS = {
    "version": int, "feature_set": str, "features": list, "provenance": str, "licence": str,
    "classes": dict,
}  # fmt: skip
_CLASS_KEYS = {
    "name": str, "threshold": float, "tolerance": float, "background": list, "values": str,
    "templates": list,
}  # fmt: skip
_TEMPLATE_KEYS = {"name": str, "examples": int, "columns": int, "provenance": str}
_VALUES = re.compile(r"(.+)\.[0-9a-f]{8}\.npz")

#: What reading a broken archive of arrays ends in.
_BROKEN_ARCHIVE = (
    ValueError, TypeError, KeyError, EOFError, OSError, MemoryError, OverflowError, RuntimeError,
    zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip

Arrays = Mapping[str, np.ndarray[Any, Any]]


def save_library(library: ClassLibrary, folder: str | Path) -> None:
    """Write a library to a folder; classes that it had before are replaced.

    Raises
    ------
    UnwritableFile
        If the folder cannot be written, or holds something that is no library.
    """
    folder = Path(folder)
    _check_target(folder)
    before = _read_stems(folder, library.feature_set)
    stems = choose_stems(
        library.names,
        kept={name: before[name] for name in library.names if name in before},
        taken={Path(INDEX).stem, *before.values(), *_stems_of_others(folder)},
    )
    if not (folder / INDEX).exists():
        # So that a first save that ends early leaves a library, and can be done again.
        _write_index(library, {}, folder)
    written = {folder / INDEX}
    for motion_class in library:
        written |= _save_class(motion_class, folder, stems[motion_class.name], library.feature_set)
    _write_index(library, stems, folder)
    _remove_stale(folder, {*before.values(), *stems.values()}, kept=written)


def load_library(folder: str | Path) -> ClassLibrary:
    """Read a library from its folder.

    Raises
    ------
    UnreadableFile
        If the folder is no library, was written by a newer version, or was edited into
        something that does not fit; the message names file and key.
    """
    folder = Path(folder)
    path = folder / INDEX
    if not path.is_file():
        raise UnreadableFile(f"{folder}: no library there ({INDEX} is missing)")
    index = read_toml(path, _INDEX_KEYS)
    if not 1 <= index["version"] <= VERSION:
        raise UnreadableFile(
            f"{path}: written by a newer motionary (version {index['version']}, "
            f"this one reads up to {VERSION}); update motionary"
        )
    feature_set = _find_feature_set(path, index)
    classes = []
    for name, stem in index["classes"].items():
        if not isinstance(stem, str) or Path(stem).name != stem:
            raise UnreadableFile(f"{path}: classes.{name} must be a file name, got {stem!r}")
        if not (folder / f"{stem}.toml").is_file():
            raise UnreadableFile(f"{path}: classes.{name} means {stem}.toml, which is missing")
        classes.append(_load_class(folder, stem, name, feature_set))
    try:
        return ClassLibrary(tuple(classes), feature_set, index["provenance"], index["licence"])
    except InvalidInput as error:
        raise UnreadableFile(f"{folder}: {error}") from error


# -- writing ----------------------------------------------------------------------------


def _check_target(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise UnwritableFile(f"{folder}: is a file; a library needs a folder")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / INDEX).exists():
        raise UnwritableFile(f"{folder}: holds files but no library; give a new or empty folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UnwritableFile(f"{folder}: cannot be made ({error.strerror})") from error


def _read_stems(folder: Path, feature_set: FeatureSet) -> dict[str, str]:
    """Files of the classes that a folder has; under no class's name if they are not kept."""
    try:
        index = read_toml(folder / INDEX, _INDEX_KEYS)
    except UnreadableFile:
        return {}
    stems = {n: s for n, s in index["classes"].items() if isinstance(s, str) and s == to_stem(s)}
    if index["feature_set"] == feature_set.name:
        return stems
    # Until the index is replaced these are classes of the other feature set.
    return {f"{feature_set.name}/{number}": stem for number, stem in enumerate(stems.values())}


def _stems_of_others(folder: Path) -> set[str]:
    """Tables beside the classes' that a class must not replace."""
    return {path.stem for path in folder.glob("*.toml") if not _is_class(path)}


def _is_class(path: Path) -> bool:
    try:
        content = tomllib.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return False
    return content.keys() >= _CLASS_KEYS.keys()


def _save_class(
    motion_class: MotionClass, folder: Path, stem: str, feature_set: FeatureSet
) -> set[Path]:
    """Write one class and return its files."""
    arrays: dict[str, np.ndarray[Any, Any]] = {}
    tables = ""
    for i, subclass in enumerate(motion_class.subclasses):
        template = subclass.template
        entry: dict[str, Any] = {
            "name": subclass.name,
            "examples": template.n_examples,
            "columns": template.n_columns,
            "provenance": template.provenance,
        }
        if subclass.queries:
            # Line by line, as a person writes a query.
            text = format_queries(subclass.queries, vocabulary=feature_set)
            entry |= {"query": text.splitlines(), "votes": subclass.votes}
        tables += "\n[[templates]]\n" + to_toml(entry)
        arrays[f"values_{i}"], arrays[f"weights_{i}"] = template.values, template.weights
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    content = buffer.getvalue()
    values = folder / f"{stem}.{hashlib.sha256(content).hexdigest()[:8]}.npz"
    settings = {
        k: getattr(motion_class, k) for k in ("name", "threshold", "tolerance", "background")
    }
    path = folder / f"{stem}.toml"
    _write(values, content)
    _write_text(path, to_toml(settings | {"values": values.name}) + tables)
    return {values, path}


def _write_index(library: ClassLibrary, stems: Mapping[str, str], folder: Path) -> None:
    index = {
        "version": VERSION,
        "feature_set": library.feature_set.name,
        "features": list(library.feature_set.ids),
        "provenance": library.provenance,
        "licence": library.licence,
    }
    text = "# A motionary library: classes of motion and where they come from.\n"
    _write_text(folder / INDEX, text + to_toml(index) + "\n[classes]\n" + to_toml(stems))


def _remove_stale(folder: Path, stems: Collection[str], *, kept: Collection[Path]) -> None:
    """Remove what classes of these files had before."""
    for path in set(folder.glob("*.toml")) | set(folder.glob("*.npz")):
        values = _VALUES.fullmatch(path.name)
        stem = path.stem if path.suffix == ".toml" else values and values[1]
        if stem in stems and path not in kept:
            # The library is complete without them: no reason to call it a failure.
            with suppress(OSError):
                path.unlink()


def _write_text(path: Path, text: str) -> None:
    try:
        content = text.encode()
    except UnicodeEncodeError as error:
        raise UnwritableFile(f"{path}: a name in it is no valid text ({error})") from error
    _write(path, content)


def _write(path: Path, content: bytes) -> None:
    with write_atomically(path) as beside:
        beside.write_bytes(content)


# -- reading ----------------------------------------------------------------------------


def _find_feature_set(path: Path, index: dict[str, Any]) -> FeatureSet:
    name, ids = index["feature_set"], tuple(index["features"])
    known = _FEATURE_SETS.get(name)
    if known is None:
        raise UnreadableFile(
            f"{path}: feature_set {name!r} is not known; known are {', '.join(_FEATURE_SETS)}"
        )
    if ids != known.ids:
        raise UnreadableFile(f"{path}: features are not those of {name!r}; learn it again")
    return known


def _load_class(folder: Path, stem: str, name: str, feature_set: FeatureSet) -> MotionClass:
    path = folder / f"{stem}.toml"
    content = read_toml(path, _CLASS_KEYS)
    if content["name"] != name:
        raise UnreadableFile(
            f"{path}: name is {content['name']!r}, but {INDEX} calls this class {name!r}"
        )
    if not content["templates"]:
        raise UnreadableFile(f"{path}: templates must list at least one, got none")
    background = content["background"]
    if not all(isinstance(share, int | float) for share in background):
        raise UnreadableFile(f"{path}: background must be a list of numbers, got {background!r}")
    arrays = _read_values(path, content["values"])
    subclasses = []
    for i, entry in enumerate(content["templates"]):
        check_keys(path, entry, _TEMPLATE_KEYS, place=f"templates[{i}].")
        subclasses.append(_load_subclass(path, i, entry, arrays, feature_set))
    try:
        return MotionClass(
            name, tuple(subclasses), content["threshold"], content["tolerance"], tuple(background)
        )
    except InvalidInput as error:
        raise UnreadableFile(f"{path}: {error}") from error


def _load_subclass(
    path: Path, number: int, entry: dict[str, Any], arrays: Arrays, feature_set: FeatureSet
) -> Subclass:
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
        )
    if values.dtype.kind not in "fiu" or weights.dtype.kind not in "fiu":
        raise UnreadableFile(f"{path}: {place} needs numbers in the .npz beside it")
    try:
        template = MotionTemplate(
            values, weights, feature_set.ids, feature_set.name, entry["provenance"],
            entry["examples"],
        )  # fmt: skip
        queries = _load_queries(entry, feature_set)
        votes = entry.get("votes", 1)
        if not isinstance(votes, int):
            raise InvalidInput(f"votes must be a whole number, got {votes!r}")
        return Subclass(entry["name"], template, queries, votes)
    except InvalidInput as error:
        raise UnreadableFile(f"{path}: {place}: {error}") from error


def _load_queries(entry: dict[str, Any], feature_set: FeatureSet) -> tuple[KeyframeQuery, ...]:
    if "query" not in entry:
        return ()
    lines = entry["query"]
    if not isinstance(lines, list) or not all(isinstance(line, str) for line in lines):
        raise InvalidInput(f"query must be a list of lines, got {lines!r}")
    try:
        return parse_queries("\n".join(lines), vocabulary=feature_set)
    except InvalidInput as error:
        raise InvalidInput(f"query: {error}") from error


def _read_values(path: Path, name: str) -> Arrays:
    """Arrays of the file that a class's table names."""
    file = path.parent / name
    if not name or Path(name).name != name:
        raise UnreadableFile(f"{path}: values must name a file beside it, got {name!r}")
    if not file.is_file():
        raise UnreadableFile(f"{path}: values means {name}, which is missing")
    try:
        # Not the path: after an error NumPy would leave the file open.
        loaded = np.load(io.BytesIO(file.read_bytes()), allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            raise ValueError("one array, no archive of arrays")
        with loaded:
            return {key: loaded[key] for key in loaded.files}
    except _BROKEN_ARCHIVE as error:
        raise UnreadableFile(f"{path}: values {name} cannot be read ({error})") from error
