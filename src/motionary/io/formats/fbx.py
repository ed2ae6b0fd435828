"""FBX files: reading the bones.

The format is read by ufbx (extra `fbx`) in a process of its own, so that a file on which it
crashes is an error like any other. Bones of the first take become joints; axes and unit are
those that the file states. The child, `fbx_child`, writes names, parents, local turns and places
in metres with y up.
"""

import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motionary.errors import UnreadableFile
from motionary.io.formats.content import FileContent, number_doubles
from motionary.io.formats.npz import Array, read_npz
from motionary.io.normalise.units_axes import FileMetadata
from motionary.io.options import ReadOptions
from motionary.motion import Skeleton
from motionary.rotations import (
    conjugate_quaternions,
    multiply_quaternions,
    rotate,
)

Floats = NDArray[np.float64]

_CHILD = "motionary.io.formats.fbx_child"
_PATIENCE_S = 120.0
_FARTHEST_M = 1e6

_RECIPE = (
    'blender --background --python-expr "import bpy; '
    "bpy.ops.import_scene.fbx(filepath='{name}'); "
    "bpy.ops.export_anim.bvh(filepath='{stem}.bvh')\""
)


def read_fbx(path: Path, options: ReadOptions) -> FileContent:
    """Bones of an FBX file, in metres with y up by what the file says.

    Raises
    ------
    UnreadableFile
        If the file is missing or damaged, crashes its reader, holds no bones, or ufbx is not
        installed; the message then has the line that converts the file with Blender.
    """
    if not path.is_file():
        raise UnreadableFile(f"{path}: cannot be read: no such file")
    if importlib.util.find_spec("ufbx") is None:
        recipe = _RECIPE.format(name=path.name, stem=path.stem)
        raise UnreadableFile(
            f"{path.name}: FBX needs ufbx: pip install 'motionary[fbx]'; or convert the file with "
            f"Blender: {recipe}"
        )
    arrays = _read_in_child(path)
    is_told = options.unit is not None or options.up is not None
    notes = [] if is_told else ["axes and unit as the file says"]
    if int(arrays["n_takes"]) > 1:
        notes.append(f"the first of {int(arrays['n_takes'])} takes")
    return _to_content(arrays, path.name, options.rate_hz, notes)


def _read_in_child(path: Path) -> dict[str, Array]:
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "bones.npz"
        command = [sys.executable, "-m", _CHILD, str(path.absolute()), str(target)]
        try:
            done = subprocess.run(
                command, capture_output=True, timeout=_PATIENCE_S, check=False, cwd=folder
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise UnreadableFile(f"{path.name}: its reader did not finish: {error}") from error
        if done.returncode < 0:
            raise UnreadableFile(f"{path.name}: the reader of FBX crashed on it; is it damaged?")
        if done.returncode or not target.is_file():
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            reason = lines[-1] if lines else "its reader says nothing"
            raise UnreadableFile(f"{path.name}: cannot be read as FBX: {reason}")
        return read_npz(target)


def _to_content(
    arrays: dict[str, Array], source: str, rate_hz: float | None, notes: list[str]
) -> FileContent:
    names = tuple(number_doubles([str(name) for name in arrays["names"].tolist()]))
    if not names:
        raise UnreadableFile(f"{source}: holds no bones")
    turns = np.array(arrays["turns"], dtype=np.float64)
    finite = np.isfinite(turns).all() and (np.linalg.norm(turns, axis=-1) > 0.5).all()
    parents = arrays["parents"].astype(np.intp)
    if not finite:
        raise UnreadableFile(f"{source}: its bones have impossible turns")
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    positions, world = _place(parents, turns, arrays["places"], arrays["scales"])
    if not (np.abs(positions) < _FARTHEST_M).all():
        raise UnreadableFile(f"{source}: has impossibly large numbers")
    offsets = positions[0].copy()
    for joint, parent in enumerate(parents.tolist()):
        if parent >= 0:
            away = positions[0, joint] - positions[0, parent]
            offsets[joint] = rotate(conjugate_quaternions(world[0, parent]), away)
    skeleton = Skeleton(names, parents, offsets)
    return FileContent(
        names=names,
        positions=positions,
        rate_hz=float(arrays["rate_hz"]) if rate_hz is None else rate_hz,
        source=source,
        metadata=FileMetadata("m", "y", noted=()),
        skeleton=skeleton,
        rotations=turns,
        notes=tuple(notes),
    )


def _place(
    parents: NDArray[np.intp], turns: Floats, places: Floats, scales: Floats
) -> tuple[Floats, Floats]:
    """Positions (frames, joints, 3) and turns in the world (frames, joints, 4)."""
    positions, world = np.empty_like(places), np.empty_like(turns)
    sizes = np.empty_like(scales)
    for joint, parent in enumerate(parents.tolist()):
        if parent < 0:
            positions[:, joint], world[:, joint] = places[:, joint], turns[:, joint]
            sizes[:, joint] = scales[:, joint]
            continue
        away = rotate(world[:, parent], places[:, joint] * sizes[:, parent])
        positions[:, joint] = positions[:, parent] + away
        world[:, joint] = multiply_quaternions(world[:, parent], turns[:, joint])
        sizes[:, joint] = sizes[:, parent] * scales[:, joint]
    return positions, world
