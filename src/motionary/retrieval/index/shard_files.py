"""How a shard lies on disk: a folder of NumPy files, mapped into memory when they are read.

It is written beside its place and moved there when it is complete: it is there as a whole or
not at all. Its name is a digest of what it holds, so that a shard that is written twice, as by
a worker whose answer was lost, is there once.
"""

import base64
import hashlib
import itertools
import json
import os
import re
import tempfile
import tokenize
import warnings
import zlib
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile, describe_cause
from motionary.features import FeatureSet
from motionary.files import is_leftover, open_regular, read_bytes
from motionary.retrieval.index.shard import ROW, Shard, StoredShard, indexed_set

#: The manifest that the shards stand beside.
FILE = "index.json"
#: What a shard is called.
SHARD_NAME = re.compile(r"[a-z0-9_]{8}")

_UNFINISHED = ".unfinished-"
_NAMES = "names.json"
# Of each other file of a shard; shards of the first versions have none.
_CHECKSUMS = "checksums.json"
_PIECE = 1 << 24
# On damaged headers of arrays NumPy raises whatever its parser of Python raises.
_DAMAGE = (
    OSError, ValueError, TypeError, LookupError, EOFError, SyntaxError, tokenize.TokenError,
    OverflowError, UserWarning, RecursionError)  # fmt: skip
# NumPy's format, but no .npy: an index among recordings must not be taken for motion.
_ARRAYS = {name: f"{name}.array" for name in ("table", "words", "masks", "planes")}
# Frames of each bitmap; shards of earlier versions have none.
_COUNTS = "counts.array"
_FILES = (_NAMES, *_ARRAYS.values(), _COUNTS)
# By far the largest, beside which the others are checked in no time.
_LARGE = (_ARRAYS["words"], _ARRAYS["planes"])


def write_shard(shard: Shard, folder: Path) -> str:
    """Write a shard into a folder of its own below `folder`; its name comes back.

    Raises
    ------
    UnwritableFile
    """
    beside = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(dir=folder, prefix=_UNFINISHED))
        index = shard.posting_index
        arrays = (shard.table, shard.packed, shard.masks, index.planes, np.array(index.counts))
        for name, array in zip((*_ARRAYS.values(), _COUNTS), arrays, strict=True):
            with (beside / name).open("wb") as file:
                np.save(file, array)
        (beside / _NAMES).write_text(json.dumps(shard.names), encoding="utf-8")
        checksums = {name: _sum_file(beside / name) for name in _FILES}
        (beside / _CHECKSUMS).write_text(json.dumps(checksums), encoding="utf-8")
        # mkdtemp makes folders for their owner only.
        beside.chmod(folder.stat().st_mode & 0o777)
        return _move(beside, folder)
    except BaseException as error:
        if beside is not None:
            remove_shard(folder, beside.name)
        if isinstance(error, OSError):
            reason = error.strerror or str(error)
            raise UnwritableFile(
                f"the index cannot be written: {reason}; name another place for it", file=folder
            ) from error
        raise


def _move(beside: Path, folder: Path) -> str:
    """Give a complete shard its name, unless one with the same content has it."""
    content = (beside / _CHECKSUMS).read_bytes()
    for again in itertools.count():
        digest = hashlib.sha256(content + b"%d" % again).digest()
        place = folder / base64.b32encode(digest)[:8].decode().lower()
        if not os.path.lexists(place):
            try:
                beside.rename(place)
            except OSError:
                # Another process may have written the same meanwhile.
                if not os.path.lexists(place):
                    raise
                continue
            return place.name
        if is_own(place) and _holds(place, content):
            # Not left over, whatever happened to the run that wrote it.
            os.utime(place)
            remove_shard(folder, beside.name)
            return place.name
    raise AssertionError("names never end")


def _holds(place: Path, checksums: bytes) -> bool:
    """Whether a shard is as it was written, with these checksums."""
    try:
        if (place / _CHECKSUMS).read_bytes() != checksums:
            return False
        _check_sums(place, _FILES)
    except _DAMAGE:
        return False
    return True


def read_shard(
    folder: Path, name: str, feature_set: FeatureSet, *, is_checked: bool = True
) -> Shard:
    """A shard of an index; its arrays are read when they are used.

    Parameters
    ----------
    folder : of the index
    name : of the shard
    feature_set : what the bits mean
    is_checked : whether all is read once, to compare checksums; of large arrays otherwise
        only the length is

    Raises
    ------
    UnreadableFile
        If a file is missing, cut off, of another form, or not as it was written.
    """
    path = folder / name
    try:
        _check_sums(path, [file for file in _FILES if is_checked or file not in _LARGE])
        names = json.loads(read_bytes(path / _NAMES))
        table, packed, masks, planes = (_map(path / file) for file in _ARRAYS.values())
        if table.dtype != ROW:
            raise InvalidInput("its table has other columns")
        if planes.shape[0] != 2 * len(indexed_set(feature_set)) + 1:
            raise InvalidInput("its bitmaps are of another feature set")
        _check_counts(names, table, packed, masks)
        counts = None
        if os.path.lexists(path / _COUNTS):
            counts = tuple(_map(path / _COUNTS).tolist())
            if len(counts) != len(planes):
                raise InvalidInput("its counts do not fit its bitmaps")
        place = StoredShard(folder.absolute(), name, feature_set, feature_set)
        return Shard(tuple(names), table, packed, masks, feature_set, planes, counts, place)
    except _DAMAGE as error:
        raise UnreadableFile(
            f"incomplete or damaged: {describe_cause(error)}", file=path
        ) from error


def size_of_shard(folder: Path, name: str) -> int:
    """Bytes of the files of a shard; 0 of what is missing."""
    total = 0
    for file in _FILES:
        with suppress(OSError):
            total += (folder / name / file).stat().st_size
    return total


def remove_shard(folder: Path, name: str) -> None:
    """Remove a shard of an index, or what is left of one.

    Files that are in use stay, and so does a folder that holds anything else or has a name
    that no shard has.
    """
    path = folder / name
    # The name may come out of a manifest that somebody else wrote.
    if not is_own(path):
        return
    with suppress(OSError):
        for file in list(path.iterdir()):
            file.unlink()
        path.rmdir()


def remove_leftovers(folder: Path, kept: Collection[str], *, before: float) -> None:
    """Remove shards that do not count, and manifests that were never finished.

    Parameters
    ----------
    folder : of the index
    kept : names of the shards that count
    before : what was changed later stays: it may belong to a process that is at work
    """
    for path in folder.iterdir() if folder.is_dir() else ():
        with suppress(OSError):
            if path.name in kept or not is_own(path) or path.lstat().st_mtime >= before:
                continue
            if path.is_dir():
                remove_shard(folder, path.name)
            else:
                path.unlink()


def is_own(path: Path) -> bool:
    """Whether a shard, or what is left of one or of a manifest; nothing else is touched."""
    if path.is_symlink():
        return False
    if is_leftover(path, FILE):
        return path.is_file()
    is_named = path.name.startswith(_UNFINISHED) or SHARD_NAME.fullmatch(path.name)
    if not is_named or not path.is_dir():
        return False
    return {file.name for file in path.iterdir()} <= {_CHECKSUMS, *_FILES}


def _sum_file(path: Path) -> str:
    """CRC-32 of a file's content, in hexadecimal digits."""
    found = 0
    with open_regular(path) as file:
        while piece := file.read(_PIECE):
            found = zlib.crc32(piece, found)
    return f"{found:08x}"


def _check_sums(path: Path, files: Collection[str]) -> None:
    if not os.path.lexists(path / _CHECKSUMS):
        return
    checksums = json.loads(read_bytes(path / _CHECKSUMS))
    for name in files:
        if name == _COUNTS and name not in checksums:
            continue
        if checksums[name] != _sum_file(path / name):
            raise InvalidInput(f"{name} is not what was written")


def _check_counts(
    names: Any, table: NDArray[np.void], packed: NDArray[Any], masks: NDArray[Any]
) -> None:
    """Refuse numbers that lead past the ends of the arrays."""
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InvalidInput("its names are no texts")
    lengths = table["length"]
    if ((lengths < 0) | (lengths > len(packed))).any():
        raise InvalidInput("a recording has an impossible number of frames")
    stops = masks[:, 0].astype(np.int64)
    if (np.diff(stops, prepend=0) <= 0).any() or (stops[-1] if len(stops) else 0) != len(packed):
        raise InvalidInput("its masks do not fit its features")


def _map(path: Path) -> NDArray[Any]:
    # A plain view of the same memory: slices of it need no class of their own.
    with open_regular(path), warnings.catch_warnings():
        # Heads of another version of Python are none that we wrote.
        warnings.simplefilter("error")
        mapped: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False).view(np.ndarray)
    return mapped
