"""FBX files: reading the bones.

The format is read by ufbx (extra `fbx`) in a process of its own, so that a file on which it
crashes is an error like any other. Bones become joints; of several takes the first one that moves
is read; axes and unit are those that the file states.

`python -m motionary.io.formats.fbx IN.fbx OUT.npz [TAKE]` is that process: it writes names,
parents, local turns and places of the bones in metres with y up, or one line on stderr.
"""

import gc
import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, UnreadableFile
from motionary.files import open_regular
from motionary.io.formats import blender_line
from motionary.io.formats.content import (
    FileContent,
    choose_take,
    names_file,
    note_take,
    number_doubles,
    rest_offsets,
)
from motionary.io.formats.npz import ArchivedArrays, Array
from motionary.io.normalise.units import FileMetadata
from motionary.io.options import ReadOptions
from motionary.motion import Skeleton
from motionary.rotations import Floats, multiply_quaternions, quaternions_to_matrices

_CHILD = "motionary.io.formats.fbx"
_PATIENCE_S = 120.0
_FARTHEST_M = 1e6

# A day at 120 Hz.
_MOST_FRAMES = 120 * 86400

# How children inherit scale, as ufbx numbers it.
_IGNORES_SCALE = 1

# Exit code of the process where the take that is given is not there.
_NO_SUCH_TAKE = 3
_LOOKED_AT, _STILL, _FRAMES_HZ = 9, 1e-6, 30.0

# Objects of ufbx 0.0.5 crash or hang when they are taken apart, or looked at by the search
# for cycles: all are kept until the process ends.
_kept: list[Any] = []


@names_file
def read_fbx(path: Path, options: ReadOptions) -> FileContent:
    """Bones of an FBX file, in metres with y up by what the file says.

    A file that crashes its reader is damaged. Without ufbx the error has the line that converts the
    file with Blender.
    """
    open_regular(path).close()
    if importlib.util.find_spec("ufbx") is None:
        raise UnreadableFile(
            "FBX needs ufbx: pip install 'motionary[fbx]'; or convert the file with "
            f"Blender: {blender_line(path)}"
        )
    arrays = _read_in_child(path, options.take)
    is_given = options.unit is not None or options.up is not None
    notes = [] if is_given else ["axes and unit as the file says"]
    takes = [str(name) for name in arrays["takes"].tolist()]
    if not takes:
        notes.append("holds no take: one frame, the pose that the bones have")
    is_named = options.take is not None
    notes += note_take(takes, int(arrays["take"]), is_given=is_named, called="take")
    return _to_content(arrays, options.rate_hz, notes)


def _read_in_child(path: Path, take: str | int | None) -> dict[str, Array]:
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "bones.npz"
        # Safe path: nothing is imported from where the program happens to be run.
        command = [sys.executable, "-P", "-m", _CHILD, str(path.absolute()), str(target)]
        command += [] if take is None else [str(take)]
        known = [str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")]
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, known))}
        try:
            done = subprocess.run(
                command, capture_output=True, timeout=_PATIENCE_S, check=False, cwd=folder, env=env
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise UnreadableFile(f"its reader did not finish: {error}") from error
        if done.returncode < 0:
            raise UnreadableFile("the reader of FBX crashed on it; is it damaged?")
        if done.returncode or not target.is_file():
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            reason = lines[-1] if lines else "its reader says nothing"
            if done.returncode == _NO_SUCH_TAKE:
                raise InvalidInput(reason)
            raise UnreadableFile(f"cannot be read as FBX: {reason}")
        return dict(ArchivedArrays(target))


def _to_content(arrays: dict[str, Array], rate_hz: float | None, notes: list[str]) -> FileContent:
    names = tuple(number_doubles([str(name) for name in arrays["names"].tolist()]))
    if not names:
        raise UnreadableFile("holds no bones")
    turns = np.array(arrays["turns"], dtype=np.float64)
    finite = np.isfinite(turns).all() and (np.linalg.norm(turns, axis=-1) > 0.5).all()
    parents = arrays["parents"].astype(np.intp)
    if not finite:
        raise UnreadableFile("its bones have impossible turns")
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    positions = _place(arrays, parents, turns)
    if not (np.abs(positions) < _FARTHEST_M).all():
        raise UnreadableFile("has impossibly large numbers")
    skeleton = Skeleton(names, parents, rest_offsets(positions[0], turns[0], parents))
    return FileContent(
        names=names,
        positions=positions,
        rate_hz=float(arrays["rate_hz"]) if rate_hz is None else rate_hz,
        metadata=FileMetadata("m", "y", noted=()),
        skeleton=skeleton,
        rotations=turns,
        notes=tuple(notes),
    )


def _place(arrays: dict[str, Array], parents: NDArray[np.intp], turns: Floats) -> Floats:
    """Positions, shape (frames, joints, 3)."""
    places, scales = arrays["places"], arrays["scales"]
    positions, world = np.empty_like(places), np.empty_like(turns)
    sizes, axes = np.empty_like(scales), np.empty((*places.shape, 3))
    for joint, parent in enumerate(parents.tolist()):
        own, local = scales[:, joint], turns[:, joint]
        if parent < 0:
            positions[:, joint], world[:, joint], sizes[:, joint] = places[:, joint], local, own
            axes[:, joint] = quaternions_to_matrices(local) * own[:, None]
            continue
        away = (axes[:, parent] @ places[:, joint, :, None])[..., 0]
        positions[:, joint] = positions[:, parent] + away
        world[:, joint] = multiply_quaternions(world[:, parent], local)
        above = sizes[:, parent]
        if arrays["ignores_scale"][joint]:
            # The place is scaled with the parent, the bone is not (segment scale compensate).
            theirs = scales[:, parent]
            above = np.divide(above, theirs, out=np.ones_like(theirs), where=theirs != 0)
            turned, own_size = quaternions_to_matrices(world[:, joint]), above * own
        else:
            # Sizes that differ along axes shear what turns below them.
            turned, own_size = axes[:, parent] @ quaternions_to_matrices(local), own
        axes[:, joint] = turned * own_size[:, None]
        sizes[:, joint] = above * own
    return positions


# ---- the process of its own


def main(arguments: list[str]) -> int:
    """Exit code: 0 when the file was written, 1 with the reason on stderr."""
    gc.disable()
    import ufbx

    source, target = arguments[:2]
    try:
        scene = ufbx.load_file(
            source,
            ignore_geometry=True,
            ignore_embedded=True,
            load_external_files=False,
            target_axes=ufbx.axes_right_handed_y_up,
            target_unit_meters=1.0,
            space_conversion=ufbx.SpaceConversion.ADJUST_TRANSFORMS,
        )
        _kept.append(scene)
        arrays = _bake(scene, (*arguments[2:], None)[0], Path(source).name)
    except InvalidInput as error:
        sys.stderr.write(f"{error.problem}\n")
        return _NO_SUCH_TAKE
    except Exception as error:
        # Whatever it is, the parent tells it as one line.
        sys.stderr.write(f"{str(error) or type(error).__name__}\n")
        return 1
    np.savez(target, **arrays)
    return 0


def _bake(scene: Any, wanted: str | None, source: str) -> dict[str, Any]:
    """Names, parents and, for each frame of a take, transforms of the bones."""
    nodes = _keep(list(_keep([scene.nodes])[0]))
    above = _keep([node.parent for node in nodes])
    ids = [node.typed_id for node in nodes]
    parent_ids = [-1 if node is None else node.typed_id for node in above]
    parents = [ids.index(i) if i in ids else -1 for i in parent_ids]
    kept = _choose(nodes, parents)
    chosen = [nodes[i] for i in kept]
    (settings,) = _keep([scene.settings])
    fps = float(settings.frames_per_second)
    stacks = _keep(list(_keep([scene.anim_stacks])[0]))
    anims = _keep([stack.anim for stack in stacks] or [scene.anim])
    takes = [str(stack.name) for stack in stacks]
    take = (
        choose_take(takes, wanted, source)
        if wanted is not None
        else _first_that_moves(scene, chosen, anims)
    )
    start_s, n_frames = _extent(scene, anims[take], fps)
    numbers = np.empty((n_frames, len(kept), 10))
    for i in range(n_frames):
        numbers[i] = _transforms(chosen, anims[take], start_s + i / fps)
    index = {place: j for j, place in enumerate(kept)}
    return {
        "names": np.array([node.name for node in chosen], dtype=np.str_),
        "parents": np.array([index.get(parents[i], -1) for i in kept]),
        "ignores_scale": np.array([int(n.inherit_mode) == _IGNORES_SCALE for n in chosen], bool),
        "places": numbers[..., :3],
        "turns": numbers[..., 3:7],
        "scales": numbers[..., 7:],
        "rate_hz": np.array(fps),
        "takes": np.array(takes, dtype=np.str_),
        "take": np.array(take),
    }


def _transforms(nodes: list[Any], anim: Any, at_s: float) -> list[tuple[float, ...]]:
    """Place, turn (wxyz) and scale of each bone at a time."""
    rows = []
    for node in nodes:
        transform = node.evaluate_transform(anim, at_s)
        x, y, z, w = transform.rotation
        rows.append((*transform.translation, w, x, y, z, *transform.scale))
    return rows


def _first_that_moves(scene: Any, nodes: list[Any], anims: list[Any]) -> int:
    """Programs write an empty take before the one that was made."""
    for number, anim in enumerate(anims if len(anims) > 1 else []):
        start_s, n_frames = _extent(scene, anim, _FRAMES_HZ)
        times = start_s + np.linspace(0, (n_frames - 1) / _FRAMES_HZ, _LOOKED_AT)
        poses = np.array([_transforms(nodes, anim, float(at_s)) for at_s in times])
        if poses.size and (np.ptp(poses, axis=0) > _STILL).any():
            return number
    return 0


def _keep(objects: list[Any]) -> list[Any]:
    _kept.extend(objects)
    return objects


def _choose(nodes: list[Any], parents: list[int]) -> list[int]:
    """Bones and what they hang on, parents first; without bones, nodes that show nothing."""
    roots = [node.is_root for node in nodes]
    wanted = [bone is not None for bone in _keep([node.bone for node in nodes])]
    if not any(wanted):
        shown = (_keep([node.mesh, node.camera, node.light]) for node in nodes)
        wanted = [all(part is None for part in parts) for parts in shown]
    kept = set()
    for place, is_wanted in enumerate(wanted):
        while is_wanted and place >= 0 and not roots[place]:
            kept.add(place)
            place = parents[place]
    depths = [node.node_depth for node in nodes]
    return sorted(kept, key=lambda place: (depths[place], place))


def _extent(scene: Any, anim: Any, fps: float) -> tuple[float, int]:
    """Start in seconds and number of frames; by the keys where the take does not say."""
    if not 0 < fps < 1e6:
        raise ValueError(f"says {fps:g} frames per second")
    start_s, end_s = float(anim.time_begin), float(anim.time_end)
    curves = _keep(list(_keep([scene.anim_curves])[0]))
    if not end_s > start_s and curves:
        start_s = min(curve.min_time for curve in curves)
        end_s = max(curve.max_time for curve in curves)
    n_frames = 1 + max(0, round((end_s - start_s) * fps))
    if n_frames > _MOST_FRAMES:
        raise ValueError(f"says that it has {n_frames} frames")
    return start_s, n_frames


if __name__ == "__main__":
    code = main(sys.argv[1:])
    sys.stderr.flush()
    # Without taking objects apart, for the same reason.
    os._exit(code)
