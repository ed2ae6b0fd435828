"""Motions in .pkl files of AIST++.

A pickle is a program, so this one is not run: its loader builds arrays of NumPy, numbers,
texts, lists and dicts, and refuses every other name. Keypoints (`keypoints3d`, 17 of COCO,
centimetres) and pose parameters (`smpl_poses`, `smpl_trans`, `smpl_scaling`) are read; both
have y up and 60 Hz.
"""

import io
import pickle
import re
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from motionary.errors import NO_MOTION, InvalidInput, NotAMotion, UnreadableFile
from motionary.io.formats.arrays import array_content, check_positions, name_joints
from motionary.io.formats.content import FileContent
from motionary.io.formats.npz import Array
from motionary.io.formats.smpl import check_pose, pose_content
from motionary.io.normalise.units_axes import FileMetadata, metres_per_unit
from motionary.io.options import ReadOptions

RATE_HZ = 60.0
_AIST = FileMetadata("m", by_definition=True, origin="AIST++", noted=("up",), takes_unit=False)
_KEYPOINTS = ("keypoints3d_optim", "keypoints3d")

# Names of NumPy's array type, which a pickle passes on and may not call.
_ARRAY_TYPE = "numpy.ndarray"


class _Dtype:
    """Type of an array's numbers, as a pickle builds it: a code, then the order of bytes."""

    def __init__(self, code: Any, *_: object) -> None:
        # A code such as "f8": no subarrays, no records, nothing huge.
        if not isinstance(code, str) or not re.fullmatch("[fiub][1248]", code):
            raise pickle.UnpicklingError("only arrays of numbers are admitted")
        self.dtype = np.dtype(code)

    def __setstate__(self, state: Any) -> None:
        self.dtype = self.dtype.newbyteorder("=" if state[1] == "|" else state[1])


class _Array:
    """An array, as a pickle builds it: empty, then shape, type and bytes."""

    value: Array = np.empty(0)

    def __setstate__(self, state: Any) -> None:
        _, shape, kind, fortran, content = state
        raw = content.encode("latin-1") if isinstance(content, str) else content
        self.value = _from_bytes(raw, kind).reshape(shape, order="F" if fortran else "C")


def _from_bytes(content: Any, kind: Any) -> Array:
    if not isinstance(kind, _Dtype):
        raise pickle.UnpicklingError("only arrays of numbers are admitted")
    return np.frombuffer(content, dtype=kind.dtype)


def _start_array(kind: object, shape: object, code: object) -> _Array:
    """The array that is filled later; a shape that the pickle names here is not believed."""
    return _Array()


def _array_of_buffer(content: Any, kind: Any, shape: Any, order: Any) -> _Array:
    array = _Array()
    array.value = _from_bytes(content, kind).reshape(shape, order=order)
    return array


def _scalar(kind: Any, content: Any) -> Any:
    raw = content.encode("latin-1") if isinstance(content, str) else content
    return _from_bytes(raw, kind)[0]


def _encode(text: Any, encoding: Any = "latin1") -> bytes:
    # Python 2's bytes come as a text that is encoded.
    if encoding not in ("latin1", "latin-1") or not isinstance(text, str):
        raise pickle.UnpicklingError("only bytes are admitted")
    return text.encode("latin-1")


_ADMITTED: dict[tuple[str, str], Any] = {
    ("numpy", "ndarray"): _ARRAY_TYPE,
    ("numpy", "dtype"): _Dtype,
    ("_codecs", "encode"): _encode,
}
for _core in ("numpy.core", "numpy._core"):
    _ADMITTED[f"{_core}.multiarray", "_reconstruct"] = _start_array
    _ADMITTED[f"{_core}.multiarray", "scalar"] = _scalar
    _ADMITTED[f"{_core}.numeric", "_frombuffer"] = _array_of_buffer


# The loader written in Python: the other one makes room for as many objects as a pickle says.
class _Loader(pickle._Unpickler):
    """Builds arrays and plain values; refuses all other names."""

    def find_class(self, module_name: str, global_name: str, /) -> Any:
        admitted = _ADMITTED.get((module_name, global_name))
        if admitted is None:
            raise pickle.UnpicklingError(f"names {module_name}.{global_name}")
        return admitted

    def persistent_load(self, pid: Any) -> NoReturn:
        raise pickle.UnpicklingError("refers to something outside")

    def get_extension(self, code: int) -> NoReturn:
        raise pickle.UnpicklingError("refers to something outside")


def read_pickle(path: Path, options: ReadOptions) -> FileContent:
    """Content of a .pkl file of AIST++; without a rate that is given at 60 Hz.

    Raises
    ------
    UnreadableFile
        If the file is missing, damaged, holds anything but arrays, or no motion.
    InvalidInput
        If a skeleton is given and the file has an SMPL body.
    """
    content = _load(path)
    notes: tuple[str, ...] = ()
    rate = options.rate_hz
    if rate is None:
        rate, notes = RATE_HZ, (f"rate assumed {RATE_HZ:g} Hz, as AIST++ has",)
    for key in _KEYPOINTS:
        if key in content:
            positions = check_positions(content[key], path.name)
            joints = name_joints(positions, path.name, options.skeleton_table())
            joints = joints._replace(notes=(*joints.notes, *notes))
            return array_content(positions, joints, path.name, rate_hz=rate)
    if not {"smpl_poses", "smpl_trans"} <= set(content):
        raise NotAMotion(
            f"{path.name}: {NO_MOTION}; expected keypoints3d or smpl_poses and smpl_trans, "
            f"got {', '.join(sorted(content))[:80] or 'no arrays'}"
        )
    if options.skeleton is not None:
        raise InvalidInput(f"{path.name}: has an SMPL body; leave out skeleton=")
    pose = check_pose(content["smpl_poses"], content["smpl_trans"], path.name)
    metres = _metres(content) if options.unit is None else metres_per_unit(options.unit)
    pose = pose._replace(root=pose.root * metres)
    return pose_content(pose, path.name, rate_hz=rate, metadata=_AIST, notes=notes)


def _metres(content: dict[str, Array]) -> float:
    """AIST++ scales the body up; places are in units of the scaled one."""
    scaling = content.get("smpl_scaling")
    if scaling is None or scaling.size != 1 or not float(scaling.reshape(())) > 0:
        return 1.0
    return 1.0 / float(scaling.reshape(()))


def _load(path: Path) -> dict[str, Array]:
    """The arrays of a pickled dict."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read: {error.strerror or error}") from error
    try:
        loaded = _Loader(io.BytesIO(content), encoding="latin1").load()
    except Exception as error:
        # A damaged pickle makes its loader raise whatever there is.
        reason = str(error).splitlines()[0][:100] if str(error) else type(error).__name__
        raise UnreadableFile(
            f"{path.name}: damaged, or more than arrays of NumPy, which is not loaded: {reason}"
        ) from error
    if not isinstance(loaded, dict):
        raise NotAMotion(f"{path.name}: {NO_MOTION}; expected a dict of arrays")
    arrays = {}
    for key, value in loaded.items():
        if isinstance(value, _Array):
            arrays[str(key)] = value.value
        elif isinstance(value, float | np.number):
            arrays[str(key)] = np.asarray(value)
    return arrays
