"""What has changed in a folder since its recordings were read?

A recording is told from its earlier self by the time and the size of its file, and of the
file that it is read with.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from motionary.io import FileState, ReadOptions, Sidecars, has_sidecar, scan_folder


class Changes(NamedTuple):
    """Names of recordings, sorted.

    Attributes
    ----------
    new, changed : to be read
    gone : no longer there
    states : of all recordings that are there
    companions : states of the companions of those to be read
    surroundings : by folder, state of what its recordings depend on
    """

    new: tuple[str, ...]
    changed: tuple[str, ...]
    gone: tuple[str, ...]
    states: dict[str, FileState]
    sidecars: dict[str, int]
    dependency_digest: dict[str, int]

    @property
    def to_read(self) -> list[str]:
        """New and changed recordings, sorted."""
        return sorted(self.new + self.changed)


class Seen(NamedTuple):
    """State in which a recording was last read, or could not be read."""

    mtime_ns: int
    size: int
    sidecar: int
    ctime_ns: int | None = None


def find_changes(
    folder: Path,
    seen: Mapping[str, Seen],
    dependency_digest: Mapping[str, int],
    reading: ReadOptions,
) -> Changes:
    """Recordings of a folder that differ from what was seen of them.

    Parameters
    ----------
    folder : searched to the bottom
    seen : by name
    surroundings : by folder, state of what its recordings depend on when they were seen
    reading : names the skeleton of Acclaim motions, where one is told

    Raises
    ------
    UnreadableFile
        If the folder is missing, or may not be read.
    """
    states = scan_folder(folder)
    sidecars = Sidecars(reading.acclaim_skeleton)
    around = {place: sidecars.dependency_digest(folder / place) for place in _places(states)}
    moved = {place for place, state in around.items() if dependency_digest.get(place) != state}
    new, changed, read_with = [], [], {}
    for name, state in states.items():
        before = seen.get(name)
        if before is None:
            new.append(name)
        elif _is_other(state, before) or (
            _place(name) in moved and sidecars.state(folder / name) != before.sidecar
        ):
            changed.append(name)
        else:
            continue
        read_with[name] = sidecars.state(folder / name)
    gone = sorted(seen.keys() - states.keys())
    return Changes(tuple(new), tuple(changed), tuple(gone), states, read_with, around)


def _is_other(state: FileState, before: Seen) -> bool:
    if (state.mtime_ns, state.size) != (before.mtime_ns, before.size):
        return True
    # A file that could not be read is read again after its rights changed, too.
    return before.ctime_ns is not None and state.ctime_ns != before.ctime_ns


def _places(names: Iterable[str]) -> set[str]:
    return {_place(name) for name in names if has_sidecar(name)}


def _place(name: str) -> str:
    return name.rpartition("/")[0]
