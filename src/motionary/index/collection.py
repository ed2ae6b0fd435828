"""What is searched: the words of many recordings, and what could not be read."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from motionary.batch import Failure
from motionary.errors import InvalidInput
from motionary.features import (
    FULL_BODY,
    FeatureSequence,
    FeatureSet,
    NamedFile,
    Reading,
    compute_features,
    read_features,
)
from motionary.io import name_recordings
from motionary.matching import Corpus, concatenate
from motionary.motion import Motion
from motionary.words import full_mask


@dataclass(frozen=True, eq=False)
class Collection:
    """Recordings as words.

    Attributes
    ----------
    sequences : words of the recordings
    feature_set : what the bits mean
    failures : files that could not be read, and why
    """

    sequences: tuple[FeatureSequence, ...]
    feature_set: FeatureSet = FULL_BODY
    failures: tuple[Failure[NamedFile], ...] = field(default=())

    def __post_init__(self) -> None:
        stray = [s for s in self.sequences if s.feature_set.name != self.feature_set.name]
        if stray:
            raise InvalidInput(
                f"{stray[0].source}: words of {stray[0].feature_set.name!r}, the collection "
                f"is of {self.feature_set.name!r}"
            )

    def __len__(self) -> int:
        return len(self.sequences)

    @cached_property
    def corpus(self) -> Corpus:
        """All recordings as one padded stretch of words."""
        if not self.sequences:
            raise InvalidInput("there is no readable recording to search")
        return concatenate(
            [s.words for s in self.sequences],
            [s.known for s in self.sequences],
            full=np.asarray(full_mask(1, len(self.feature_set))[0]),
        )


def collect(
    recordings: str | Path | Sequence[str | Path | Motion | FeatureSequence],
    *,
    reading: Reading | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: int = 1,
    on_done: Callable[[NamedFile], None] | None = None,
) -> Collection:
    """Words of recordings.

    Parameters
    ----------
    recordings : a folder, file or pattern, or a sequence of such, of motions or of words
    reading : what the files do not say themselves
    jobs : processes that read; the result does not depend on it
    on_done : called after each file

    Raises
    ------
    UnreadableFile
        If a path does not exist or holds no recording. A file that is there and cannot be
        read is listed in `failures` instead.
    """
    given = [recordings] if isinstance(recordings, str | Path) else list(recordings)
    paths = [g for g in given if isinstance(g, str | Path)]
    words = [_words(g, feature_set) for g in given if isinstance(g, Motion | FeatureSequence)]
    if not paths:
        return Collection(tuple(words), feature_set)
    read = read_collection(
        name_recordings(paths).items(),
        reading=reading,
        feature_set=feature_set,
        jobs=jobs,
        on_done=on_done,
    )
    return replace(read, sequences=(*words, *read.sequences))


def read_collection(
    files: Iterable[NamedFile],
    *,
    reading: Reading | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: int = 1,
    on_done: Callable[[NamedFile], None] | None = None,
) -> Collection:
    """Words of files whose names are settled; otherwise as `collect`.

    Parameters
    ----------
    files : pairs of a recording's name and its path
    reading, jobs, on_done : as in `collect`
    """
    items = list(
        read_features(files, reading=reading, feature_set=feature_set, jobs=jobs, on_done=on_done)
    )
    return Collection(
        tuple(item for item in items if not isinstance(item, Failure)),
        feature_set,
        tuple(item for item in items if isinstance(item, Failure)),
    )


def _words(item: Motion | FeatureSequence, feature_set: FeatureSet) -> FeatureSequence:
    if isinstance(item, Motion):
        return compute_features(item, feature_set=feature_set)
    return item
