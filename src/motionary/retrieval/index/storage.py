"""What an index holds, and what it is made with: one manifest, beside a folder for each shard.

The manifest is one JSON file, replaced as a whole: it names the shards that count. Whatever
else lies beside is left over from a run that was interrupted.
"""

import hashlib
import json
import os
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

from motionary import __version__
from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile, describe_cause
from motionary.features import FeatureSet
from motionary.files import read_bytes, write_atomically
from motionary.io import FileState, ReadOptions
from motionary.io.text import read_text
from motionary.retrieval.index.shard_files import FILE, SHARD_NAME, is_own

#: Environment variable with the folder of the cache, instead of the system's.
CACHE_VARIABLE = "MOTIONARY_CACHE"

#: Raised when arrays or their meaning change.
VERSION = 1
_FORMAT = "motionary index"
_KEYS = {
    "version": int, "feature_set": str, "features": list, "reading": dict, "written_by": str,
    "shards": list, "failures": dict, "surroundings": dict,
}  # fmt: skip

_LATER_OPTIONS = ("body_model",)
_REMEDY = "delete the index to make it anew"


class DamagedIndex(UnreadableFile):
    """An index of ours is not as it was written; it can be made anew."""


class FailedFile(NamedTuple):
    """Why a file could not be read, and the state in which it could not.

    Attributes
    ----------
    problem : what the error says after the name of the file
    kind : class of the error; empty in indexes written before kinds were kept
    """

    state: FileState
    sidecar: int
    problem: str
    kind: str = ""


class Recipe(NamedTuple):
    """What an index is made with; another recipe gives other features."""

    feature_set: str
    features: tuple[str, ...]
    reading: dict[str, Any]

    @classmethod
    def of(cls, feature_set: FeatureSet, reading: ReadOptions) -> "Recipe":
        """The recipe of a feature set, and of what the files do not say themselves."""
        given: dict[str, Any] = dict.fromkeys(f.name for f in fields(reading)) | reading.given()
        for key in _LATER_OPTIONS:
            if given[key] is None:
                # Indexes that were made before the option came are the same without it.
                del given[key]
        for key in ("asf", "skeleton", "body_model"):
            # Names, not paths: an index may be passed on. A skeleton's state counts elsewhere.
            if given.get(key):
                given[key] = Path(given[key]).name
        if reading.skeleton is not None and str(reading.skeleton).lower().endswith(".toml"):
            # A mapping that was edited gives other features under the same name.
            text = read_text(Path(reading.skeleton))
            given["skeleton"] += f" ({zlib.crc32(text.encode()):08x})"
        return cls(feature_set.name, feature_set.ids, given)


@dataclass(frozen=True, slots=True)
class Manifest:
    """Contents of an index.

    Attributes
    ----------
    recipe : what it is made with
    shards : names of the shards that count
    failures : by name of the recording
    dependency_digest : state of what the recordings of each folder depend on, by its name
    written_by : version of motionary that read the files
    """

    recipe: Recipe
    shards: tuple[str, ...] = ()
    failures: dict[str, FailedFile] = field(default_factory=dict)
    dependency_digest: dict[str, int] = field(default_factory=dict)
    written_by: str = __version__


def cache_place(folder: Path, recipe: Recipe) -> Path:
    """Where the user's cache has the index of a folder that is made with a recipe."""
    given = os.environ.get(CACHE_VARIABLE)
    if given:
        cache = Path(given)
    else:
        from platformdirs import user_cache_path

        cache = user_cache_path("motionary", appauthor=False)
    resolved = folder.resolve()
    # Spelt as by the first versions, whose indexes are found again.
    made = f"Making({', '.join(f'{k}={v!r}' for k, v in recipe._asdict().items())})"
    key = f"({str(resolved)!r}, {made})".encode("utf-8", "surrogateescape")
    name = re.sub(r"[^\w.-]", "_", resolved.name)[:40] or "folder"
    return cache / "indexes" / f"{name}-{hashlib.sha256(key).hexdigest()[:16]}"


def write_manifest(manifest: Manifest, folder: Path) -> None:
    """Write the manifest of an index, whole or not at all.

    Raises
    ------
    UnwritableFile
        If it cannot be written, or the folder holds files but no index.
    """
    if folder.is_dir() and not (folder / FILE).exists():
        foreign = [e.name for e in folder.iterdir() if not is_own(e)]
        if foreign:
            problem = f"holds files but no index ({foreign[0]}); give a new or empty folder"
            raise UnwritableFile(problem, file=folder)
    content = {
        "format": _FORMAT,
        "version": VERSION,
        "written_by": manifest.written_by,
        **manifest.recipe._asdict(),
        "shards": manifest.shards,
        "failures": {
            name: [*f.state, f.sidecar, f.problem, f.kind] for name, f in manifest.failures.items()
        },
        "surroundings": manifest.dependency_digest,
    }
    content["checksum"] = _checksum(content)
    with write_atomically(folder / FILE) as beside:
        beside.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def read_manifest(folder: Path) -> Manifest | None:
    """The manifest of an index; None where there is none yet.

    Raises
    ------
    UnreadableFile
        If the folder holds something else, or an index that is damaged or newer.
    """
    path = folder / FILE
    if not os.path.lexists(path):
        return None
    try:
        content = json.loads(read_bytes(path))
    except (OSError, ValueError, RecursionError) as error:
        problem = f"cannot be read as an index: {describe_cause(error)}; {_REMEDY}"
        raise UnreadableFile(problem, file=path) from error
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise UnreadableFile("is no index of motionary", file=path)
    version = content.get("version")
    if isinstance(version, int) and version > VERSION:
        raise UnreadableFile(
            f"written by a newer motionary (version {version}, this one reads up to "
            f"{VERSION}); update motionary, or name another place for the index",
            file=path,
        )
    for key, kind in _KEYS.items():
        if not isinstance(content.get(key), kind):
            raise UnreadableFile(f"{key} is missing or not what it should be; {_REMEDY}", file=path)
    if "checksum" in content and content.pop("checksum") != _checksum(content):
        raise DamagedIndex("damaged: its checksum is another", file=path)
    try:
        return _parse(content)
    except (TypeError, ValueError) as error:
        raise UnreadableFile(f"damaged: {describe_cause(error)}; {_REMEDY}", file=path) from error


def check_recipe(wanted: Recipe, found: Recipe, folder: Path) -> None:
    """Refuse an index that was made otherwise.

    Raises
    ------
    InvalidInput
    """
    if found[:2] != wanted[:2]:
        raise InvalidInput(
            f"an index of {found.feature_set!r} ({len(found.features)} features), asked for is "
            f"{wanted.feature_set!r} ({len(wanted.features)}); name another place, where an index "
            "of these is made",
            file=folder,
        )
    before, now = found.reading, wanted.reading
    other = [
        f"{key} {before.get(key) or 'not given'}, now {now.get(key) or 'not given'}"
        for key in before | now
        if before.get(key) != now.get(key)
    ]
    if other:
        way_out = "read them the same way, or name another place for the index"
        raise InvalidInput(f"its files were read with {'; '.join(other)}; {way_out}", file=folder)


def _checksum(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True)
    return f"{zlib.crc32(text.encode()):08x}"


def _parse(content: dict[str, Any]) -> Manifest:
    failures = {}
    for name, (mtime_ns, size, ctime_ns, sidecar, *told) in content["failures"].items():
        state = FileState(int(mtime_ns), int(size), int(ctime_ns))
        problem, kind = told if len(told) == 2 else (*told, "")
        failures[name] = FailedFile(state, int(sidecar), str(problem), str(kind))
    shards = tuple(content["shards"])
    if not all(isinstance(name, str) and SHARD_NAME.fullmatch(name) for name in shards):
        raise InvalidInput("a shard has a name that no index gives")
    return Manifest(
        Recipe(content["feature_set"], tuple(content["features"]), content["reading"]),
        shards,
        failures,
        {name: int(state) for name, state in content["surroundings"].items()},
        content["written_by"],
    )
