"""What are the words of many files?

Reads and measures recordings, several at once if asked; a file that cannot be read
becomes a `Failure` in its place and the others go on.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from motionary.batch import Failure, map_ordered
from motionary.features.catalogue import FULL_BODY
from motionary.features.computing import compute_features
from motionary.features.relations import FeatureSet
from motionary.features.sequence import FeatureSequence
from motionary.io import read

#: A recording's name and its path.
NamedFile = tuple[str, Path]


@dataclass(frozen=True, slots=True)
class Reading:
    """What files do not say themselves; see `motionary.io.read`."""

    asf: str | None = None
    rate_hz: float | None = None
    skeleton: str | None = None
    unit: float | str | None = None


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
    # A folder mixes formats: what only one of them needs is kept from the others.
    acclaim = path.suffix.lower() == ".amc"
    motion = read(
        path,
        asf=reading.asf if acclaim else None,
        rate_hz=reading.rate_hz,
        skeleton=reading.skeleton,
        unit=None if acclaim else reading.unit,
    )
    return compute_features(replace(motion, source=name), feature_set=feature_set)
