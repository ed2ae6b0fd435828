"""NumPy's files, read without trusting them, and motions that are written to .npz whole.

Pickles are not run: texts, numbers, lists, dicts and arrays are taken out of them. Nothing
larger is made than what a file holds.

A file of ours holds `positions` (frames, joints, 3) in metres with y up, `names`, `rate_hz`,
`first_frame` and what its joints are, of rigs also `parents`, `offsets`, `ends` and
`rotations`, of recordings with events also `event_names`, `event_sides` and
`event_times_s`.
"""

import math
import struct
import sys
import weakref
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile, describe_cause
from motionary.files import describe_opening, most_unpacked, open_regular, write_atomically
from motionary.io.formats.content import FARTHEST, FileContent
from motionary.io.formats.pickle_machine import PickleRefusedError, plain, run_pickle
from motionary.io.normalise.units import FileMetadata
from motionary.io.options import ReadOptions
from motionary.motion import Event, JointMapping, Motion, Skeleton
from motionary.rotations import Floats
from motionary.skeletons import format_table, known_mappings, named_mapping, parse_table

Array = NDArray[Any]
Result = TypeVar("Result")

_FORMAT = 1
_OWN = FileMetadata("m", "y", noted=())

# What joblib packs: zlib's first byte, and gzip's.
_PACKED = (b"x", b"\x1f\x8b")
_ANY_HEADER = 47

# Others inflate without a bound; NumPy writes these two.
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def read_npy(path: Path) -> Array | dict[str, Any]:
    """What a .npy file holds: an array, or the dict that is its one object."""
    with _as_unreadable(path), open_regular(path) as file:
        size = file.seek(0, 2)
        file.seek(0)
        content = _read_dict(file)
        file.seek(0)
        return content or _read_array(file, size)


@contextmanager
def _as_unreadable(path: Path) -> Iterator[None]:
    try:
        yield
    except UnreadableFile:
        raise
    except Exception as error:
        # On damaged headers NumPy raises whatever its parser of Python raises.
        if isinstance(error, OSError) and error.strerror:
            raise UnreadableFile(describe_opening(error), file=path) from error
        reason = f"damaged, or no file of arrays: {describe_cause(error)}"
        raise UnreadableFile(reason, file=path.name) from error


class ArchivedArrays(Mapping[str, Array]):
    """The arrays of a .npz file by name, each inflated when it is asked for.

    Those that hold Python objects are left out.

    Raises
    ------
    UnreadableFile
        If the file is missing or damaged; later, if an array is.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        opened = open_regular(path)
        # Open until the last array is read, that is, as long as this object is in use.
        weakref.finalize(self, opened.close)
        with _as_unreadable(path):
            self._archive = zipfile.ZipFile(opened)
            members = [m for m in self._archive.infolist() if m.filename.endswith(".npy")]
        self._members = {m.filename.removesuffix(".npy"): m for m in members}
        self._are_objects: dict[str, bool] = {}

    def __contains__(self, name: object) -> bool:
        return name in self._members and not self._holds_objects(str(name))

    def __getitem__(self, name: str) -> Array:
        member = self._members[name]
        if self._are_objects.get(name):
            raise KeyError(name)
        most = most_unpacked(member.compress_size)
        return self._open(name, lambda file: _read_array(file, member.file_size, most))

    def __iter__(self) -> Iterator[str]:
        return (name for name in self._members if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def read_dict(self, name: str) -> dict[str, Any]:
        """The dict that is the one object of an array; empty if it is anything else."""
        member = self._members.get(name)
        if member is None or not self._holds_objects(name):
            return {}
        with _as_unreadable(self._path):
            if member.file_size > most_unpacked(member.compress_size):
                raise InvalidInput(f"{name} {_BOMB}")
        return self._open(name, _read_dict)

    def _holds_objects(self, name: str) -> bool:
        if name not in self._are_objects:
            dtype = self._open(name, lambda file: _read_header(file)[2])
            self._are_objects[name] = bool(dtype.hasobject)
        return self._are_objects[name]

    def _open(self, name: str, read: Callable[[IO[bytes]], Result]) -> Result:
        member = self._members[name]
        with _as_unreadable(self._path):
            if member.compress_type not in _METHODS:
                raise InvalidInput(f"{name} is packed in another way than NumPy packs")
            with self._archive.open(member) as file:
                return read(file)


_BOMB = "inflates to more than numbers can; unpack the file and save it again if it is yours"


def _read_header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, "np.dtype[Any]"]:
    version = npy.read_magic(file)
    if version == (1, 0):
        return npy.read_array_header_1_0(file)
    return npy.read_array_header_2_0(file)


def _read_array(file: IO[bytes], size: int, most: int = 1 << 40) -> Array:
    shape, fortran, dtype = _read_header(file)
    if dtype.hasobject:
        raise InvalidInput("holds Python objects; expected an array of numbers")
    count = math.prod(shape)
    if count < 0 or count * dtype.itemsize > size:
        raise InvalidInput(f"promises {count} numbers and is shorter")
    # Numbers of fewer bytes become floats of eight.
    if count * max(dtype.itemsize, 8) > most:
        raise InvalidInput(f"an array {_BOMB}")
    if dtype.kind == "c":
        raise InvalidInput("holds complex numbers")
    content = file.read(count * dtype.itemsize)
    if len(content) < count * dtype.itemsize:
        raise InvalidInput("is cut off")
    if dtype.kind == "U" and count and dtype.itemsize:
        letters = np.frombuffer(content, dtype=np.dtype(np.uint32).newbyteorder(dtype.byteorder))
        if letters.max() > sys.maxunicode:
            raise InvalidInput("holds letters that there are not")
    array: Array = np.frombuffer(content, dtype=dtype)
    return array.reshape(shape[::-1]).T if fortran else array.reshape(shape)


def _read_dict(file: IO[bytes]) -> dict[str, Any]:
    shape, _, dtype = _read_header(file)
    return plain_dict(read_pickled(file.read())) if dtype.hasobject and shape == () else {}


def is_own(arrays: Mapping[str, Array]) -> bool:
    """Whether arrays are a motion that `write_npz` wrote."""
    return "motionary_motion" in arrays


def read_own(arrays: Mapping[str, Array], options: ReadOptions) -> FileContent:
    """Content of a file that `write_npz` wrote."""
    try:
        if int(arrays["motionary_motion"]) > _FORMAT:
            raise UnreadableFile("was written by a newer version; update motionary")
        names = tuple(str(name) for name in arrays["names"].tolist())
        # Of a file's own numbers, -0.0 and all, none is touched.
        positions = np.array(arrays["positions"], dtype=np.float64)
        positions[np.isnan(positions).any(axis=-1)] = np.nan
        if (np.abs(positions) > FARTHEST).any():
            raise InvalidInput("impossibly large numbers")
        skeleton = None
        if "parents" in arrays:
            skeleton = Skeleton(
                names,
                arrays["parents"].astype(np.intp),
                np.array(arrays["offsets"], dtype=np.float64),
                ends=bool(arrays["ends"]),
            )
        rate = float(arrays["rate_hz"]) if options.rate_hz is None else options.rate_hz
        if not 0 < rate < np.inf or not names or positions.shape[1:] != (len(names), 3):
            raise InvalidInput(f"{len(names)} names, positions {positions.shape}, {rate:g} Hz")
        return FileContent(
            names=names,
            positions=positions,
            rate_hz=rate,
            metadata=None if options.unit is None and options.up is None else _OWN,
            first_frame=int(arrays["first_frame"]),
            skeleton=skeleton,
            rotations=_rotations(arrays, positions.shape[:2]),
            mapping=_mapping(arrays, names) if options.skeleton is None else None,
            events=_events(arrays),
        )
    except UnreadableFile:
        raise
    except (KeyError, ValueError, TypeError, OverflowError) as error:
        raise UnreadableFile(f"is no whole motion: {describe_cause(error)}") from error


def _mapping(arrays: Mapping[str, Array], names: tuple[str, ...]) -> JointMapping | None:
    if "skeleton" not in arrays:
        return None
    name = str(arrays["skeleton"])
    if "skeleton_table" in arrays:
        return parse_table(name, str(arrays["skeleton_table"])).resolve(names)
    return named_mapping(name, names)


def _rotations(arrays: Mapping[str, Array], shape: tuple[int, ...]) -> Floats | None:
    if "rotations" not in arrays:
        return None
    rotations = np.array(arrays["rotations"], dtype=np.float64)
    if rotations.shape != (*shape, 4) or not np.isfinite(rotations).all():
        raise InvalidInput(f"rotations need shape {(*shape, 4)}, got {rotations.shape}")
    if (np.abs(np.linalg.norm(rotations, axis=-1) - 1) > 1e-6).any():
        raise InvalidInput("rotations must be unit quaternions")
    return rotations


def _events(arrays: Mapping[str, Array]) -> tuple[Event, ...]:
    if "event_names" not in arrays:
        return ()
    columns = (arrays[key].tolist() for key in ("event_names", "event_sides", "event_times_s"))
    return tuple(Event(str(n), str(s), float(t)) for n, s, t in zip(*columns, strict=True))


def _is_known(mapping: JointMapping, names: tuple[str, ...]) -> bool:
    """Whether a known skeleton tells the mapping: a file may change one and keep its name."""
    name = mapping.name
    return name in known_mappings() and named_mapping(name, names) == mapping


def write_npz(motion: Motion, path: str | Path) -> None:
    """Write all that a motion holds but its notes; the same motion gives the same bytes."""
    arrays: dict[str, Array] = {
        "motionary_motion": np.array(_FORMAT),
        "positions": motion.positions,
        "names": np.array(motion.names, dtype=np.str_),
        "rate_hz": np.array(motion.rate_hz),
        "first_frame": np.array(motion.first_frame),
    }
    if motion.mapping is not None:
        arrays["skeleton"] = np.array(motion.mapping.name)
        if not _is_known(motion.mapping, motion.names):
            table = format_table(motion.mapping, about=motion.mapping.name)
            arrays["skeleton_table"] = np.array(table)
    if motion.skeleton is not None:
        arrays["parents"] = motion.skeleton.parents.astype(np.int64)
        arrays["offsets"] = motion.skeleton.offsets
        arrays["ends"] = np.array(motion.skeleton.ends)
    if motion.rotations is not None:
        arrays["rotations"] = motion.rotations
    if motion.events:
        arrays["event_names"] = np.array([e.name for e in motion.events], dtype=np.str_)
        arrays["event_sides"] = np.array([e.side for e in motion.events], dtype=np.str_)
        arrays["event_times_s"] = np.array([e.time_s for e in motion.events])
    with write_atomically(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


# -- pickles, which are not run -----------------------------------------------------------


def read_pickled(content: bytes) -> Any:
    """The object of a pickle, which joblib may have packed.

    `plain` gives the values of its lists and dicts.
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


def to_arrays(content: dict[str, Any]) -> dict[str, Array]:
    """The arrays and numbers of a dict, as arrays."""
    kinds = (np.ndarray, np.number, float, int)
    return {key: np.asarray(value) for key, value in content.items() if isinstance(value, kinds)}
