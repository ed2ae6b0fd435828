"""What are the words of many files?

Reads and measures recordings, several at once if asked; a file that cannot be read
becomes a `Failure` in its place and the others go on.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from motionary.batch import Failure, map_ordered
from motionary.features.catalogue import FULL_BODY
from motionary.features.computing import compute_features
from motionary.features.feature_set import FeatureSet
from motionary.features.sequence import FeatureSequence
from motionary.io import options_of, read

#: A recording's name and its path.
NamedFile = tuple[str, Path]


@dataclass(frozen=True, slots=True)
class Reading:
    """What files do not say themselves; see `motionary.io.read`."""

    asf: str | None = None
    rate_hz: float | None = None
    skeleton: str | None = None
    unit: float | str | None = None
    up: str | None = None
    sides: str | None = None
    fill_gaps_s: float | None = None
    fill_by: str | None = None

    def of(self, path: Path) -> dict[str, Any]:
        """What is told of one file: a folder mixes formats, and not all take everything."""
        told = ((name, getattr(self, name, None)) for name in sorted(options_of(path)))
        return {name: value for name, value in told if value is not None}


def read_features(
    files: Iterable[NamedFile],
    *,
    reading: Reading | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: int = 1,
    on_done: Callable[[NamedFile], None] | None = None,
) -> Iterator[FeatureSequence | Failure[NamedFile]]:
    """Words of files, in their order.

    Parameters
    ----------
    files : pairs of a recording's name and its path
    reading : what the files do not say themselves
    jobs : processes; the result does not depend on it
    on_done : called with each file once it is done
    """
    work = partial(_measure, reading=reading or Reading(), feature_set=feature_set)
    return map_ordered(work, files, jobs=jobs, on_done=on_done)


def _measure(file: NamedFile, *, reading: Reading, feature_set: FeatureSet) -> FeatureSequence:
    name, path = file
    motion = read(path, **reading.of(path))
    return compute_features(replace(motion, source=name), feature_set=feature_set)
