"""What a pickle holds, read without running it: texts, numbers, lists, dicts and arrays."""

import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.files import most_unpacked
from motionary.io.formats.pickle_machine import PickleRefusedError, plain, run_pickle

# What joblib packs: zlib's first byte, and gzip's.
_PACKED = (b"x", b"\x1f\x8b")
_ANY_HEADER = 47


def read_pickled(content: bytes) -> Any:
    """The object of a pickle, which joblib may have packed.

    `plain` gives the values of its lists and dicts.

    Raises
    ------
    PickleRefusedError
        If the pickle is damaged, or holds anything else.
    """
    try:
        return plain(run_pickle(_inflate(content)))
    except PickleRefusedError:
        raise
    except (IndexError, KeyError, struct.error):
        raise PickleRefusedError("is cut off, or its instructions make no sense") from None
    except (ValueError, TypeError, AttributeError, OverflowError, MemoryError) as error:
        raise PickleRefusedError(str(error).split("\n")[0][:100] or "damaged") from None


def _inflate(content: bytes) -> bytes:
    if not content.startswith(_PACKED):
        return content
    most = most_unpacked(len(content))
    try:
        unpacked = zlib.decompressobj(_ANY_HEADER).decompress(content, most + 1)
    except zlib.error:
        raise PickleRefusedError("is packed and damaged") from None
    if len(unpacked) > most:
        raise PickleRefusedError(f"unpacks to more than {most >> 20} MB")
    return unpacked


def plain_dict(value: Any) -> dict[str, Any]:
    """Names and values of a dict; empty for anything else."""
    return {key: plain(item) for key, item in value.items()} if isinstance(value, dict) else {}


def to_arrays(content: dict[str, Any]) -> dict[str, NDArray[Any]]:
    """The arrays and numbers of a dict, as arrays."""
    kinds = (np.ndarray, np.number, float, int)
    return {key: np.asarray(value) for key, value in content.items() if isinstance(value, kinds)}
