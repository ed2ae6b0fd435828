"""What is new, changed or gone in sources of recordings, by the state of its files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from motionary.io import FileState, ReadOptions, Sidecars, has_sidecar
from motionary.io.finding import NO_SIDECAR
from motionary.retrieval.index.sources import Source


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
    sources: Sequence[Source],
    seen: Mapping[str, Seen],
    dependency_digest: Mapping[str, int],
    reading: ReadOptions,
) -> Changes:
    """Recordings of sources that differ from what was seen of them."""
    found = Changes((), (), (), {}, {}, {})
    for source in sources:
        prefix = source.prefix
        inside = {n.removeprefix(prefix): s for n, s in seen.items() if n.startswith(prefix)}
        around = {
            f"{place}/".removeprefix(prefix).rstrip("/"): state
            for place, state in dependency_digest.items()
            if f"{place}/".startswith(prefix)
        }
        one = _find_in(source, inside, around, reading)
        found = Changes(
            found.new + tuple(prefix + name for name in one.new),
            found.changed + tuple(prefix + name for name in one.changed),
            (),
            found.states | {prefix + name: state for name, state in one.states.items()},
            found.sidecars | {prefix + name: state for name, state in one.sidecars.items()},
            found.dependency_digest
            | {(prefix + n).rstrip("/"): state for n, state in one.dependency_digest.items()},
            found.skipped + one.skipped,
        )
    return found._replace(gone=tuple(sorted(seen.keys() - found.states.keys())))


def _find_in(
    source: Source,
    seen: Mapping[str, Seen],
    dependency_digest: Mapping[str, int],
    reading: ReadOptions,
) -> Changes:
    """Changes of one source, by names in it; without what is gone."""
    folder, skipped = Path(source.folder), list[str]()
    files = source.scan(on_skip=skipped.append)
    states = files if reading.take is not None else _split(source, files, seen)
    sidecars = Sidecars(reading.acclaim_skeleton)
    # Skeletons that are fetched are part of the state of a file.
    has_here = not source.is_remote or reading.acclaim_skeleton is not None
    around = {
        place: sidecars.dependency_digest(folder / place)
        for place in {_place(name) for name in states if has_here and has_sidecar(name)}
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
        read_with[name] = sidecars.state(folder / name) if has_here else NO_SIDECAR
    return Changes(tuple(new), tuple(changed), (), states, read_with, around, tuple(skipped))


def _split(
    source: Source, files: Mapping[str, FileState], seen: Mapping[str, Seen]
) -> dict[str, FileState]:
    """States of recordings; files that were read as one and have not changed are not opened."""
    states: dict[str, FileState] = {}
    for name, state in files.items():
        before = seen.get(name)
        if before is not None and not _is_other(state, before):
            states[name] = state
            continue
        states |= dict.fromkeys(source.split(name), state)
    return states


def _is_other(state: FileState, before: Seen) -> bool:
    if (state.mtime_ns, state.size) != (before.mtime_ns, before.size):
        return True
    # A file that could not be read is read again after its rights changed, too.
    return before.ctime_ns is not None and state.ctime_ns != before.ctime_ns


def _place(name: str) -> str:
    return name.rpartition("/")[0]
