"""How does a library lie on disk?

A folder: `library.toml` says what the library is, and each class has a TOML file with its
settings, which names the NPZ file that holds the values of its templates. Values are named
after their content and written first, and a class keeps its file, so that each class is
the old one or the new one whenever writing ends. Files of others are left alone.

Class files are named after their classes; characters that file systems dislike become
`_`, and `library.toml` lists file and class. It also lists the relations of a feature set
that does not come with the package, so that the library can be used without it.
"""

import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.features import FeatureSet, describe_set, known_sets, set_from_rows
from motionary.models.library.class_files import CLASS_KEYS, read_class, write_class
from motionary.models.library.classes import ClassLibrary
from motionary.models.library.lines import refuse, tell_line
from motionary.models.library.naming import choose_stems, to_stem
from motionary.models.library.tables import read_toml, to_toml, write_text

#: Raised when a reader of the version before could misunderstand the files.
VERSION = 1
INDEX = "library.toml"

_INDEX_KEYS = {
    "version": int, "feature_set": str, "features": list, "provenance": str, "licence": str,
    "classes": dict,
}  # fmt: skip
_VALUES = re.compile(r"(.+)\.[0-9a-f]{8}\.npz")


def save_library(library: ClassLibrary, folder: str | Path) -> None:
    """Write a library to a folder; classes that it had before are replaced.

    Raises
    ------
    UnwritableFile
        If the folder cannot be written, or holds something that is no library.
    InvalidInput
        If the feature set has the name of another one that comes with the package.
    """
    folder = Path(folder)
    _check_name(library.feature_set)
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
        written |= write_class(motion_class, folder, stems[motion_class.name], library.feature_set)
    _write_index(library, stems, folder)
    _remove_stale(folder, {*before.values(), *stems.values()}, kept=written)


def load_library(folder: str | Path, *, feature_sets: Sequence[FeatureSet] = ()) -> ClassLibrary:
    """Read a library from its folder.

    Parameters
    ----------
    folder : folder of the library
    feature_sets : sets with quantities of one's own, which no file can tell

    Raises
    ------
    UnreadableFile
        If the folder is no library, was written by a newer version, or was edited into
        something that does not fit; the message names file, key and line.
    """
    folder = Path(folder)
    path = folder / INDEX
    if not path.is_file():
        raise UnreadableFile(f"{folder}: no library there ({INDEX} is missing)")
    index = read_toml(path, _INDEX_KEYS)
    if not 1 <= index["version"] <= VERSION:
        raise UnreadableFile(
            f"{path}: written by a newer motionary (version {index['version']}, "
            f"this one reads up to {VERSION}){tell_line(path, 'version')}; update motionary"
        )
    feature_set = _find_feature_set(path, index, feature_sets)
    classes = []
    for name, stem in index["classes"].items():
        if not isinstance(stem, str) or Path(stem).name != stem:
            raise refuse(path, name, f"must be a file name, got {stem!r}", place="classes.")
        if not (folder / f"{stem}.toml").is_file():
            raise refuse(path, name, f"means {stem}.toml, which is missing", place="classes.")
        classes.append(read_class(folder, stem, name, feature_set))
    try:
        return ClassLibrary(tuple(classes), feature_set, index["provenance"], index["licence"])
    except InvalidInput as error:
        raise UnreadableFile(f"{folder}: {error}") from error


# -- writing ----------------------------------------------------------------------------


def _check_name(feature_set: FeatureSet) -> None:
    if known_sets().get(feature_set.name, feature_set) != feature_set:
        raise InvalidInput(
            f"the feature set {feature_set.name!r} is not the one of that name that comes with "
            "motionary; give yours another name"
        )


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
    return content.keys() >= CLASS_KEYS.keys()


def _write_index(library: ClassLibrary, stems: Mapping[str, str], folder: Path) -> None:
    index = {
        "version": VERSION,
        "feature_set": library.feature_set.name,
        "features": list(library.feature_set.ids),
        "provenance": library.provenance,
        "licence": library.licence,
    }
    text = "# A motionary library: classes of motion and where they come from.\n"
    text += to_toml(index) + "\n[classes]\n" + to_toml(stems)
    if library.feature_set.name not in known_sets():
        for row in describe_set(library.feature_set) or ():
            text += "\n[[relations]]\n" + to_toml(row)
    write_text(folder / INDEX, text)


def _remove_stale(folder: Path, stems: Collection[str], *, kept: Collection[Path]) -> None:
    """Remove what classes of these files had before."""
    for path in set(folder.glob("*.toml")) | set(folder.glob("*.npz")):
        values = _VALUES.fullmatch(path.name)
        stem = path.stem if path.suffix == ".toml" else values and values[1]
        if stem in stems and path not in kept:
            # The library is complete without them: no reason to call it a failure.
            with suppress(OSError):
                path.unlink()


# -- reading ----------------------------------------------------------------------------


def _find_feature_set(path: Path, index: dict[str, Any], given: Sequence[FeatureSet]) -> FeatureSet:
    name, ids = index["feature_set"], tuple(index["features"])
    sets = {**known_sets(), **{one.name: one for one in given}}
    if "relations" in index and name not in sets:
        sets[name] = _read_features(path, name, index["relations"])
    found = sets.get(name)
    if found is None:
        raise refuse(
            path,
            "feature_set",
            f"{name!r} is not known; known are {', '.join(sets)}; "
            "sets of one's own are passed as feature_sets=",
        )
    if ids != found.ids:
        raise refuse(path, "features", f"are not those of {name!r}; learn it again")
    return found


def _read_features(path: Path, name: str, rows: Any) -> FeatureSet:
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise refuse(path, "relations", "must be tables of relations")
    try:
        return set_from_rows(name, rows)
    except InvalidInput as error:
        raise UnreadableFile(f"{path}: relations: {error}") from error
