"""Features of many files.

Reads and measures recordings, several at once if asked; a file that cannot be read
becomes a `Failure` in its place and the others go on.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

from motionary.batch import Failure, Workers, map_ordered
from motionary.features.catalogue import FULL_BODY
from motionary.features.computing import FeatureSequence, compute_features
from motionary.features.feature_set import FeatureSet
from motionary.io import ReadOptions, read

#: A recording's name and its path.
NamedFile = tuple[str, Path]


def read_features(
    files: Iterable[NamedFile],
    *,
    options: ReadOptions | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: Workers = 1,
    on_done: Callable[[NamedFile], None] | None = None,
) -> Iterator[FeatureSequence | Failure[NamedFile]]:
    """Features of files, in their order.

    Parameters
    ----------
    files : pairs of a recording's name and its path
    options : what the files do not say themselves; each takes those that concern it
    jobs : processes; the result does not depend on it
    on_done : called with each file once it is done
    """
    work = partial(_measure, options=options or ReadOptions(), feature_set=feature_set)
    return map_ordered(work, files, jobs=jobs, on_done=on_done)


def _measure(file: NamedFile, *, options: ReadOptions, feature_set: FeatureSet) -> FeatureSequence:
    name, path = file
    motion = read(path, options.for_file(path))
    return compute_features(motion.renamed(name), feature_set=feature_set)
