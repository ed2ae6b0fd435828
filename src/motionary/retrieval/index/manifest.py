"""What does an index hold, and what was it made with?

One JSON file, replaced as a whole: it names the shards that count. Whatever else lies in
the folder is left over from a run that ended before its time.
"""

import json
import zlib
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

from motionary import __version__
from motionary.batch import write_atomically
from motionary.errors import InvalidInput, UnreadableFile
from motionary.features import FeatureSet
from motionary.io import FileState, ReadOptions
from motionary.io.text import read_text

#: Raised when arrays or their meaning change.
VERSION = 1
FILE = "index.json"
_FORMAT = "motionary index"
_KEYS = {
    "version": int, "feature_set": str, "features": list, "reading": dict, "written_by": str,
    "shards": list, "failures": dict, "surroundings": dict,
}  # fmt: skip


class FailedFile(NamedTuple):
    """Why a file could not be read, and the state in which it could not."""

    state: FileState
    sidecar: int
    problem: str


class Making(NamedTuple):
    """What an index is made with; another making gives other words."""

    feature_set: str
    features: tuple[str, ...]
    reading: dict[str, Any]

    @classmethod
    def of(cls, feature_set: FeatureSet, reading: ReadOptions) -> "Making":
        """The making of words over a feature set, read as told."""
        told: dict[str, Any] = dict.fromkeys(f.name for f in fields(reading)) | reading.given()
        for key in ("asf", "skeleton", "body_model"):
            # Names, not paths: an index may be passed on. A skeleton's state counts elsewhere.
            told[key] = told[key] and Path(told[key]).name
        if reading.skeleton is not None and str(reading.skeleton).lower().endswith(".toml"):
            # A mapping that was edited gives other words under the same name.
            text = read_text(Path(reading.skeleton))
            told["skeleton"] += f" ({zlib.crc32(text.encode()):08x})"
        return cls(feature_set.name, feature_set.ids, told)


@dataclass(frozen=True, slots=True)
class Manifest:
    """Contents of an index.

    Attributes
    ----------
    making : what it is made with
    shards : names of the shards that count
    failures : by name of the recording
    surroundings : state of what the recordings of each folder depend on, by its name
    written_by : version of motionary that read the files
    """

    making: Making
    shards: tuple[str, ...] = ()
    failures: dict[str, FailedFile] = field(default_factory=dict)
    dependency_digest: dict[str, int] = field(default_factory=dict)
    written_by: str = __version__


def write_manifest(manifest: Manifest, folder: Path) -> None:
    """Write the manifest of an index, whole or not at all.

    Raises
    ------
    UnwritableFile
    """
    making = manifest.making
    content = {
        "format": _FORMAT,
        "version": VERSION,
        "written_by": manifest.written_by,
        "feature_set": making.feature_set,
        "features": making.features,
        "reading": making.reading,
        "shards": manifest.shards,
        "failures": {
            name: [*f.state, f.sidecar, f.problem] for name, f in manifest.failures.items()
        },
        "surroundings": manifest.dependency_digest,
    }
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
    try:
        content = json.loads(path.read_text("utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        raise UnreadableFile(f"{path}: cannot be read as an index: {error}") from error
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise UnreadableFile(f"{path}: is no index of motionary")
    version = content.get("version")
    if isinstance(version, int) and version > VERSION:
        raise UnreadableFile(
            f"{path}: written by a newer motionary (version {version}, this one reads up to "
            f"{VERSION}); update motionary, or name another place for the index"
        )
    for key, kind in _KEYS.items():
        if not isinstance(content.get(key), kind):
            raise UnreadableFile(f"{path}: {key} is missing or not what it should be")
    try:
        return _parse(content)
    except (TypeError, ValueError) as error:
        raise UnreadableFile(f"{path}: damaged: {error}") from error


def check_making(wanted: Making, found: Making, folder: Path) -> None:
    """Refuse an index that was made otherwise.

    Raises
    ------
    InvalidInput
    """
    if found[:2] != wanted[:2]:
        raise InvalidInput(
            f"{folder}: an index of {found.feature_set!r} ({len(found.features)} features), asked "
            f"for is {wanted.feature_set!r} ({len(wanted.features)}); name another place for it"
        )
    other = [
        f"{key} {found.reading.get(key) or 'not told'}, now {wanted.reading.get(key) or 'not told'}"
        for key in found.reading | wanted.reading
        if found.reading.get(key) != wanted.reading.get(key)
    ]
    if other:
        raise InvalidInput(
            f"{folder}: its files were read with {'; '.join(other)}; read them the same way, or "
            "name another place for the index"
        )


def _parse(content: dict[str, Any]) -> Manifest:
    failures = {}
    for name, (mtime_ns, size, ctime_ns, sidecar, problem) in content["failures"].items():
        state = FileState(int(mtime_ns), int(size), int(ctime_ns))
        failures[name] = FailedFile(state, int(sidecar), str(problem))
    shards = tuple(content["shards"])
    if not all(isinstance(name, str) and Path(name).name == name for name in shards):
        raise ValueError("a shard needs the name of a folder")
    return Manifest(
        Making(content["feature_set"], tuple(content["features"]), content["reading"]),
        shards,
        failures,
        {name: int(state) for name, state in content["surroundings"].items()},
        content["written_by"],
    )
