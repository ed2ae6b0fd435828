"""Which other file is a recording read with, and has it changed?

An Acclaim motion is read with its skeleton; other formats stand alone. Folders are listed
once, so that thousands of recordings can be asked about.
"""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from motionary.errors import UnreadableFile

NONE = 0
_READ_WITH_SKELETON = (".amc", ".amc.gz")


def has_sidecar(name: str) -> bool:
    """Whether a recording of this file name is read with another file."""
    return name.lower().endswith(_READ_WITH_SKELETON)


class Sidecars:
    """Skeletons beside motions; what a folder holds is remembered.

    Parameters
    ----------
    asf : the skeleton of all Acclaim motions, where one is named
    """

    def __init__(self, asf: str | Path | None = None) -> None:
        self._asf = None if asf is None else Path(asf)
        self._listed: dict[Path, dict[str, Path]] = {}

    def state(self, path: Path) -> int:
        """A number that changes when the companion of a recording does; `NONE` without one."""
        if not has_sidecar(path.name):
            return NONE
        from motionary.io.formats.acclaim import find_asf

        try:
            sidecar = self._asf or find_asf(path, listing=self._list)
        except UnreadableFile:
            return _digest(["missing"])
        return _digest([_describe(sidecar)])

    def dependency_digest(self, folder: Path) -> int:
        """A number that changes when anything does that the companions there depend on."""
        if self._asf is not None:
            return _digest([_describe(self._asf)])
        from motionary.io.formats.acclaim import places_of_asf

        places = places_of_asf(folder / "any")
        lines = ([*map(_describe, sorted(self._list(p).values())), ""] for p in places)
        return _digest(line for part in lines for line in part)

    def _list(self, folder: Path) -> dict[str, Path]:
        from motionary.io.formats.acclaim import list_asf

        if folder not in self._listed:
            self._listed[folder] = list_asf(folder)
        return self._listed[folder]


def _describe(file: Path) -> str:
    try:
        stat = file.stat()
    except OSError:
        return f"{file.name} gone"
    return f"{file.name} {stat.st_mtime_ns} {stat.st_size}"


def _digest(parts: Iterable[str]) -> int:
    content = "\n".join(parts).encode("utf-8", "surrogateescape")
    return int.from_bytes(hashlib.blake2b(content, digest_size=8).digest(), "little")
