"""Features of many files: read in parallel, and written as one table.

A file that cannot be read becomes a `Failure` in its place and the others go on.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.batch import Cluster, Failure, Workers, map_ordered
from motionary.errors import InvalidInput, check_path
from motionary.features.batches import Computed, FeatureBatch
from motionary.features.catalogue import FULL_BODY
from motionary.features.computing import (
    SEQUENCE_HZ,
    FeatureSequence,
    Resampled,
    compute_together,
    resample_motion,
)
from motionary.features.feature_set import FeatureSet
from motionary.files import write_atomically
from motionary.io import TAKE_MARK, Cell, ReadOptions, format_suffix, read_poses, write_table
from motionary.tables import write_parquet

#: A recording's name and its path.
NamedFile = tuple[str, Path]

#: Features that come back of a file, or why there are none.
Measured = Computed | Failure[NamedFile]

# Short recordings are measured together, in one array.
_MOST_TOGETHER = 16
_SHORT_BYTES = 1 << 18

# Recordings that are laid out as columns at once: memory stays small, and so do files.
_PORTION = 1000


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
    jobs : processes, or a cluster whose workers see the files under the same absolute paths; the
        result does not depend on it
    on_done : called with each file once it is done
    """
    options = options or ReadOptions()
    if isinstance(jobs, Cluster):
        # Its workers run in folders of their own.
        options, files = options.absolute(), ((name, path.absolute()) for name, path in files)
    work = partial(_measure, options=options, feature_set=feature_set)
    for done in map_ordered(work, _join_short(files), jobs=jobs):
        for file, item in (
            done if not isinstance(done, Failure) else _measure_alone(work, done, jobs)
        ):
            if on_done is not None:
                on_done(file)
            # The set is here already: sending it takes as long as reading a short file.
            yield (
                item
                if isinstance(item, Failure)
                else FeatureSequence(item.packed, item.known, feature_set, item.recording)
            )


def _join_short(files: Iterable[NamedFile]) -> Iterator[list[NamedFile]]:
    """Files to be measured together: more and more of short ones, so that few are spread."""
    some: list[NamedFile] = []
    for number, file in enumerate(files):
        if some and not (_is_short(file[1]) and _is_short(some[0][1])):
            yield some
            some = []
        some.append(file)
        if len(some) >= min(_MOST_TOGETHER, 1 + number // _MOST_TOGETHER):
            yield some
            some = []
    if some:
        yield some


def _is_short(path: Path) -> bool:
    """Whether a recording is one of many: a take, or a small file."""
    if TAKE_MARK in path.suffix:
        return True
    try:
        return path.stat().st_size < _SHORT_BYTES
    except OSError:
        # Reading says what is wrong.
        return True


def _measure(
    files: list[NamedFile], *, options: ReadOptions, feature_set: FeatureSet
) -> list[tuple[NamedFile, Measured]]:
    """Of each file what features it has, or why none."""
    failures: dict[NamedFile, Failure[NamedFile]] = {}

    def read_each() -> Iterator[Resampled]:
        for item in map_ordered(partial(_read, options=options), files):
            if isinstance(item, Failure):
                failures[item.item] = item
            else:
                yield item

    computed = iter(list(compute_together(read_each(), feature_set)))
    return [
        (file, failures[file] if file in failures else Computed.of(next(computed)))
        for file in files
    ]


def _read(file: NamedFile, *, options: ReadOptions) -> Resampled:
    name, path = file
    return resample_motion(read_poses(path, options.for_file(path)).renamed(name))


def _measure_alone(
    work: Callable[[list[NamedFile]], list[tuple[NamedFile, Measured]]],
    failure: Failure[list[NamedFile]],
    jobs: Workers,
) -> Iterator[tuple[NamedFile, Measured]]:
    """Each of the files that failed together, as one of them may have ended a process."""
    files = failure.item
    if len(files) == 1:
        yield files[0], Failure(files[0], failure.error)
        return
    for file, done in zip(
        files, map_ordered(work, [[one] for one in files], jobs=jobs), strict=True
    ):
        yield from [(file, Failure(file, done.error))] if isinstance(done, Failure) else done


def write_features(batch: FeatureBatch, path: str | Path, *, excel: bool = False) -> None:
    """Write features frame by frame; the suffix of the file's name says how.

    `.npz` has `features` and `known`, arrays of 0 and 1 of shape (frames, features), `names`
    and `rate_hz`; of several recordings, one after the other, also `recordings`, `starts` (the
    first row of each) and, where they are known, `persons` and `splits`. `.parquet` and `.csv`
    have a row a frame, in which unknown features are empty; in CSV one recording alone is not
    named. The file is written whole or not at all.

    Parameters
    ----------
    excel : CSV as Excel of the person's country reads it

    Raises
    ------
    InvalidInput
        If the suffix is another, or pyarrow is needed and not installed.
    UnwritableFile
        If the file cannot be written.
    """
    path = check_path(path, remedy="the features come first: write_features(batch, path)")
    suffix = format_suffix(path)
    if suffix == ".npz":
        with write_atomically(path) as beside:
            np.savez_compressed(beside, **_to_arrays(batch))  # type: ignore[arg-type]
    elif suffix == ".parquet":
        with write_atomically(path) as beside:
            write_parquet(_portions(batch), beside)
    elif suffix == ".csv":
        write_table(_to_table(batch), path, excel=excel)
    else:
        raise InvalidInput(
            f"features are written as .npz, .parquet or .csv, got {suffix!r}", file=path.name
        )


def _identity(batch: FeatureBatch) -> dict[str, tuple[str, ...]]:
    """What is known of each recording, by the name of its column."""
    columns = {"recording": batch.names, "person": batch.persons, "split": batch.splits}
    return {name: column for name, column in columns.items() if any(column)}


def _to_arrays(batch: FeatureBatch) -> dict[str, NDArray[Any]]:
    lengths = [len(item) for item in batch]
    arrays: dict[str, NDArray[Any]] = {
        "features": np.concatenate([item.features for item in batch]),
        "known": np.concatenate([item.known_features for item in batch]),
        "names": np.array(batch.feature_set.names),
        "rate_hz": np.array(SEQUENCE_HZ),
    }
    if len(batch) > 1:
        arrays["starts"] = np.cumsum([0, *lengths[:-1]])
        arrays |= {f"{name}s": np.array(column) for name, column in _identity(batch).items()}
    return arrays


def _to_table(batch: FeatureBatch) -> list[list[Cell]]:
    identity = _identity(batch) if len(batch) > 1 else {}
    table: list[list[Cell]] = [[*identity, "time_s", *batch.feature_set.names]]
    for number, item in enumerate(batch):
        own = [column[number] for column in identity.values()]
        for i, (held, known) in enumerate(zip(item.features, item.known_features, strict=True)):
            cells = [int(h) if k else None for h, k in zip(held, known, strict=True)]
            table.append([*own, round(i / SEQUENCE_HZ, 4), *cells])
    return table


def _portions(batch: FeatureBatch) -> Iterator[dict[str, NDArray[Any]]]:
    """Columns of some recordings after the other: a row a frame, unknown features masked."""
    identity = _identity(batch)
    for start in range(0, len(batch), _PORTION):
        some = batch.sequences[start : start + _PORTION]
        lengths = [len(item) for item in some]
        columns: dict[str, NDArray[Any]] = {
            name: np.repeat(column[start : start + _PORTION], lengths)
            for name, column in identity.items()
        }
        columns["time_s"] = np.concatenate([np.arange(n) for n in lengths]) / SEQUENCE_HZ
        features = np.concatenate([item.features for item in some]).T.copy()
        unknown = np.concatenate([item.known_features for item in some]).T == 0
        yield columns | {
            name: np.ma.MaskedArray(held, mask)
            for name, held, mask in zip(batch.feature_set.names, features, unknown, strict=True)
        }
