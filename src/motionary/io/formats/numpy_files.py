"""Which arrays are in a .npy or .npz file, read without trusting it?

No pickles, and nothing larger is made than what the file holds.
"""

import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from motionary.errors import UnreadableFile

Array = NDArray[Any]

# Ten times two hours of a body in motion: more is a mistake or an attack.
_MOST_BYTES = 1 << 35


def read_npy(path: Path) -> Array:
    """The array of a .npy file.

    Raises
    ------
    UnreadableFile
        If the file is missing, damaged, or holds Python objects.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            return _read_array(file, size)
    except Exception as error:
        # On damaged headers NumPy raises whatever its parser of Python raises.
        raise _unreadable(path, error) from error


def read_npz(path: Path) -> dict[str, Array]:
    """The arrays of a .npz file by name; those that hold Python objects are left out.

    Raises
    ------
    UnreadableFile
        If the file is missing or damaged.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = [m for m in archive.infolist() if m.filename.endswith(".npy")]
            if sum(member.file_size for member in members) > _MOST_BYTES:
                raise ValueError(f"unpacks to more than {_MOST_BYTES >> 30} GB")
            arrays = {}
            for member in members:
                with archive.open(member) as file:
                    array = _read_member(file, member.file_size)
                if array is not None:
                    arrays[member.filename.removesuffix(".npy")] = array
            return arrays
    except Exception as error:
        raise _unreadable(path, error) from error


def _read_member(file: IO[bytes], size: int) -> Array | None:
    try:
        return _read_array(file, size)
    except _HoldsObjectsError:
        return None


class _HoldsObjectsError(ValueError):
    """The array is one of Python objects, which only a pickle can hold."""


def _read_array(file: IO[bytes], size: int) -> Array:
    version = npy.read_magic(file)
    if version == (1, 0):
        shape, fortran, dtype = npy.read_array_header_1_0(file)
    else:
        shape, fortran, dtype = npy.read_array_header_2_0(file)
    if dtype.hasobject:
        raise _HoldsObjectsError("holds Python objects; expected an array of numbers")
    count = 1
    for length in shape:
        count *= length
    if count < 0 or count * dtype.itemsize > size:
        raise ValueError(f"promises {count} numbers and is shorter")
    content = file.read(count * dtype.itemsize)
    if len(content) < count * dtype.itemsize:
        raise ValueError("is cut off")
    array: Array = np.frombuffer(content, dtype=dtype)
    return array.reshape(shape[::-1]).T if fortran else array.reshape(shape)


def _unreadable(path: Path, error: Exception) -> UnreadableFile:
    if isinstance(error, OSError) and error.strerror:
        return UnreadableFile(f"{path}: cannot be read: {error.strerror}")
    reason = str(error).splitlines()[0][:100] if str(error) else type(error).__name__
    return UnreadableFile(f"{path.name}: damaged, or no file of arrays: {reason}")
