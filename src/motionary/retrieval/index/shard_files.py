"""How does a shard lie on disk?

A folder of its own, written beside its place and moved there when it is complete: it is
there as a whole or not at all. Arrays are NumPy files, mapped into memory when they are
read; names are JSON.
"""

import json
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile, UnwritableFile
from motionary.features import FeatureSet
from motionary.retrieval.index.shard import DOCUMENT, Shard

UNFINISHED = ".unfinished-"
_NAMES = "names.json"
# NumPy's format, but no .npy: an index among recordings must not be taken for motion.
_ARRAY = ".array"
_ARRAYS = ("table", "words", "masks", "planes")


def write_shard(shard: Shard, folder: Path) -> str:
    """Write a shard into a new folder below `folder`; its name comes back.

    Raises
    ------
    UnwritableFile
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(dir=folder, prefix=UNFINISHED))
    except OSError as error:
        raise _unwritable(folder, error) from error
    try:
        arrays = {"table": shard.table, "words": shard.packed, "masks": shard.masks}
        for name, array in (arrays | {"planes": shard.word_index.planes}).items():
            with (beside / f"{name}{_ARRAY}").open("wb") as file:
                np.save(file, array)
        (beside / _NAMES).write_text(json.dumps(shard.names), encoding="utf-8")
        # mkdtemp makes folders for their owner only.
        beside.chmod(folder.stat().st_mode & 0o777)
        place = folder / beside.name.removeprefix(UNFINISHED)
        beside.rename(place)
    except BaseException as error:
        shutil.rmtree(beside, ignore_errors=True)
        if isinstance(error, OSError):
            raise _unwritable(folder, error) from error
        raise
    return place.name


def read_shard(folder: Path, feature_set: FeatureSet) -> Shard:
    """The shard in a folder; its arrays are read when they are used.

    Raises
    ------
    UnreadableFile
        If a file is missing, cut off or of another form.
    """
    try:
        names = json.loads((folder / _NAMES).read_text("utf-8"))
        arrays = {name: _map(folder / f"{name}{_ARRAY}") for name in _ARRAYS}
        if arrays["table"].dtype != DOCUMENT:
            raise InvalidInput("its table has other columns")
        if arrays["planes"].shape[0] != 2 * len(feature_set) + 1:
            raise InvalidInput("its bitmaps are of another feature set")
        shard = Shard(
            tuple(names), arrays["table"], arrays["words"], arrays["masks"], feature_set,
            arrays["planes"],
        )  # fmt: skip
    except (OSError, ValueError, TypeError, EOFError) as error:
        raise UnreadableFile(f"{folder}: incomplete or damaged: {error}") from error
    return shard


def remove_shard(folder: Path) -> None:
    """Remove a shard, or what is left of one; files that are in use stay."""
    with suppress(OSError):
        shutil.rmtree(folder)


def _map(path: Path) -> NDArray[Any]:
    # A plain view of the same memory: slices of it need no class of their own.
    mapped: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False).view(np.ndarray)
    return mapped


def _unwritable(folder: Path, error: OSError) -> UnwritableFile:
    reason = error.strerror or str(error)
    return UnwritableFile(
        f"{folder}: the index cannot be written: {reason}; name another place for it"
    )
