"""What is new, changed or gone in a folder of recordings, by the state of its files."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from motionary.io import FileState, ReadOptions, Sidecars, has_sidecar, scan_folder, split_files


class Changes(NamedTuple):
    """Names of recordings, sorted.

    Attributes
    ----------
    new, changed : to be read
    gone : no longer there
    states : of all recordings that are there
    sidecars : states of the sidecars of those to be read
    dependency_digest : by folder, state of what its recordings depend on
    skipped : why links to folders are passed over, a line each
    """

    new: tuple[str, ...]
    changed: tuple[str, ...]
    gone: tuple[str, ...]
    states: dict[str, FileState]
    sidecars: dict[str, int]
    dependency_digest: dict[str, int]
    skipped: tuple[str, ...] = ()

    @property
    def to_read(self) -> list[str]:
        """New and changed recordings, sorted."""
        return sorted(self.new + self.changed)

    @property
    def leaves_nothing(self) -> bool:
        """Whether nothing of what was read is there: another folder, or a disk that is missing."""
        return bool(self.gone) and len(self.new) == len(self.states)


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
    """Recordings of a folder that differ from what was seen of them."""
    skipped: list[str] = []
    files = scan_folder(folder, on_skip=skipped.append)
    states = files if reading.take is not None else _split(folder, files, seen)
    sidecars = Sidecars(reading.acclaim_skeleton)
    around = {
        place: sidecars.dependency_digest(folder / place)
        for place in {_place(name) for name in states if has_sidecar(name)}
    }
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
    return Changes(
        tuple(new), tuple(changed), tuple(gone), states, read_with, around, tuple(skipped)
    )


def _split(
    folder: Path, files: Mapping[str, FileState], seen: Mapping[str, Seen]
) -> dict[str, FileState]:
    """States of recordings; files that were read as one and have not changed are not opened."""
    states: dict[str, FileState] = {}
    for name, state in files.items():
        before = seen.get(name)
        if before is not None and not _is_other(state, before):
            states[name] = state
            continue
        states |= dict.fromkeys(split_files({name: folder / name}), state)
    return states


def _is_other(state: FileState, before: Seen) -> bool:
    if (state.mtime_ns, state.size) != (before.mtime_ns, before.size):
        return True
    # A file that could not be read is read again after its rights changed, too.
    return before.ctime_ns is not None and state.ctime_ns != before.ctime_ns


def _place(name: str) -> str:
    return name.rpartition("/")[0]
