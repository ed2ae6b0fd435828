"""How does a library lie on disk?

A folder: `library.toml` says what the library is, and each class has a TOML file with its
settings, which names the NPZ file that holds the values of its templates. Values are named
after their content and written first, so that a class is the old one or the new one
whenever writing ends.

Class files are named after their classes; characters that file systems dislike become
`_`, and `library.toml` lists file and class.
"""

import hashlib
import io
import json
import re
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from motionary.batch import write_atomically
from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.features import FULL_BODY, FULL_BODY_2006, FeatureSet
from motionary.library.classes import ClassLibrary, MotionClass, Subclass
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


def save_library(library: ClassLibrary, folder: str | Path) -> None:
    """Write a library to a folder; classes that it had before are replaced.

    Raises
    ------
    UnwritableFile
        If the folder cannot be written, or holds something that is no library.
    """
    folder = Path(folder)
    _check_target(folder)
    before = set(folder.glob("*.toml")) | set(folder.glob("*.npz"))
    files: dict[str, str] = {}
    written = {folder / INDEX}
    for motion_class in library:
        stem = _file_stem(motion_class.name, taken=set(files.values()))
        files[motion_class.name] = stem
        written |= _save_class(motion_class, folder, stem)
    index = {
        "version": VERSION,
        "feature_set": library.feature_set.name,
        "features": list(library.feature_set.ids),
        "provenance": library.provenance,
        "licence": library.licence,
    }
    text = "# A motionary library: classes of motion and where they come from.\n"
    text += _toml(index) + "\n[classes]\n" + _toml(files)
    _write(folder / INDEX, text.encode())
    for stale in before - written:
        stale.unlink()


def load_library(folder: str | Path) -> ClassLibrary:
    """Read a library from its folder.

    Raises
    ------
    UnreadableFile
        If the folder is no library, was written by a newer version, or was edited into
        something that does not fit; the message names file and key.
    """
    folder = Path(folder)
    index = _read_toml(folder / INDEX, _INDEX_KEYS)
    if index["version"] > VERSION:
        raise UnreadableFile(
            f"{folder / INDEX}: written by a newer motionary (version {index['version']}, "
            f"this one reads up to {VERSION}); update motionary"
        )
    feature_set = _find_feature_set(folder / INDEX, index)
    classes = []
    for name, stem in index["classes"].items():
        if not isinstance(stem, str) or Path(stem).name != stem:
            raise UnreadableFile(f"{folder / INDEX}: classes.{name} must be a file name")
        classes.append(_load_class(folder, stem, name, feature_set))
    try:
        return ClassLibrary(tuple(classes), feature_set, index["provenance"], index["licence"])
    except InvalidInput as error:
        raise UnreadableFile(f"{folder}: {error}") from error


# -- classes ----------------------------------------------------------------------------


def _save_class(motion_class: MotionClass, folder: Path, stem: str) -> set[Path]:
    """Write one class and return its files."""
    arrays: dict[str, np.ndarray[Any, Any]] = {}
    tables = ""
    for i, subclass in enumerate(motion_class.subclasses):
        template = subclass.template
        entry = {
            "name": subclass.name,
            "examples": template.n_examples,
            "columns": template.n_columns,
            "provenance": template.provenance,
        }
        tables += "\n[[templates]]\n" + _toml(entry)
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
    _write(path, (_toml(settings | {"values": values.name}) + tables).encode())
    return {values, path}


def _load_class(folder: Path, stem: str, name: str, feature_set: FeatureSet) -> MotionClass:
    path = folder / f"{stem}.toml"
    content = _read_toml(path, _CLASS_KEYS)
    if content["name"] != name:
        raise UnreadableFile(
            f"{path}: name is {content['name']!r}, but {INDEX} calls this class {name!r}"
        )
    if Path(content["values"]).name != content["values"]:
        raise UnreadableFile(f"{path}: values must name a file beside it")
    arrays = _read_arrays(folder / content["values"])
    subclasses = []
    for i, entry in enumerate(content["templates"]):
        _check_keys(path, entry, _TEMPLATE_KEYS, prefix=f"templates[{i}].")
        subclasses.append(_load_subclass(path, i, entry, arrays, feature_set))
    try:
        return MotionClass(
            name, tuple(subclasses), content["threshold"], content["tolerance"],
            tuple(float(share) for share in content["background"]),
        )  # fmt: skip
    except (InvalidInput, TypeError, ValueError) as error:
        raise UnreadableFile(f"{path}: {error}") from error


def _load_subclass(
    path: Path,
    number: int,
    entry: dict[str, Any],
    arrays: dict[str, np.ndarray[Any, Any]],
    feature_set: FeatureSet,
) -> Subclass:
    keys = (f"values_{number}", f"weights_{number}")
    if any(key not in arrays for key in keys):
        raise UnreadableFile(f"{path}: templates[{number}] has no values in the .npz beside it")
    values, weights = (arrays[key] for key in keys)
    shape = (entry["columns"], len(feature_set))
    if values.shape != shape:
        raise UnreadableFile(
            f"{path}: templates[{number}] needs values of shape {shape} (columns, features), "
            f"the .npz beside it has {values.shape}"
        )
    try:
        template = MotionTemplate(
            values, weights, feature_set.ids, feature_set.name, entry["provenance"],
            entry["examples"],
        )  # fmt: skip
    except InvalidInput as error:
        raise UnreadableFile(f"{path}: templates[{number}]: {error}") from error
    return Subclass(entry["name"], template)


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


# -- files ------------------------------------------------------------------------------


def _write(path: Path, content: bytes) -> None:
    with write_atomically(path) as beside:
        beside.write_bytes(content)


def _check_target(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise UnwritableFile(f"{folder}: is a file; a library needs a folder")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / INDEX).exists():
        raise UnwritableFile(f"{folder}: holds files but no library; give a new or empty folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UnwritableFile(f"{folder}: cannot be made ({error.strerror})") from error


def _file_stem(name: str, *, taken: set[str]) -> str:
    stem = re.sub(r"[^\w.-]", "_", name).strip(".") or "class"
    # Not only equal names collide: file systems fold case.
    lowered = {t.lower() for t in taken} | {"library"}
    candidate, number = stem, 2
    while candidate.lower() in lowered:
        candidate, number = f"{stem}-{number}", number + 1
    return candidate


def _toml(content: dict[str, Any]) -> str:
    """Lines of a TOML table of strings, numbers and lists: JSON values are TOML ones."""
    bare = re.compile(r"[A-Za-z0-9_-]+")
    lines = []
    for key, value in content.items():
        shown = key if bare.fullmatch(key) else json.dumps(key, ensure_ascii=False)
        lines.append(f"{shown} = {json.dumps(value, ensure_ascii=False)}\n")
    return "".join(lines)


def _read_toml(path: Path, keys: dict[str, type]) -> dict[str, Any]:
    try:
        content = tomllib.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise UnreadableFile(f"{path.parent}: no library there ({path.name} is missing)") from None
    except (OSError, UnicodeDecodeError) as error:
        raise UnreadableFile(f"{path}: cannot be read ({error})") from error
    except tomllib.TOMLDecodeError as error:
        raise UnreadableFile(f"{path}: is not valid TOML: {error}") from error
    _check_keys(path, content, keys)
    return content


def _check_keys(
    path: Path, content: dict[str, Any], keys: dict[str, type], *, prefix: str = ""
) -> None:
    for key, kind in keys.items():
        if key not in content:
            raise UnreadableFile(f"{path}: {prefix}{key} is missing")
        value = content[key]
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            content[key] = float(value)
        elif not isinstance(value, kind) or isinstance(value, bool):
            raise UnreadableFile(f"{path}: {prefix}{key} must be a {kind.__name__}, got {value!r}")


def _read_arrays(path: Path) -> dict[str, np.ndarray[Any, Any]]:
    try:
        with np.load(path, allow_pickle=False) as file:
            return {key: file[key] for key in file.files}
    except (OSError, ValueError, zipfile.BadZipFile, EOFError) as error:
        raise UnreadableFile(f"{path}: cannot be read ({error})") from error
