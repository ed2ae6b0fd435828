"""Joints of other readers beside ours, and files that they cannot read.

BVH by pybvh, and by bvhsdk those that it refuses; C3D by ezc3d; FBX by the world transforms of
ufbx, which our reader does not use; glTF, made of other recordings, by pygltflib and the scene of
trimesh. What the others leave as the file says it, axes and unit, is
taken from the positions: of the 24 turns of axes that which brings both together, and the ratio
of sizes. `python -m evidence.other_readers FILE TAKE FRAMES OUT` writes places of ufbx.
"""

import contextlib
import importlib
import io
import itertools
import os
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evidence.common.recordings import BANDAI, CMU, HDM05, Recordings, Results
from motionary.errors import MotionaryError
from motionary.io import find_recordings, read
from motionary.motion import Motion

TITLE = "Beside other readers"
SPLIT = "nothing is learned or chosen"
SEED = 0

Floats = NDArray[np.float64]

#: Folders whose files are read; faults are not: readers differ in what they mend.
FOLDERS = ("accad", "bandai", "cmu", "hdm05_takes", "rigs", "sensors", "ui_prmd", "wild")
SUFFIXES = {".bvh", ".c3d", ".fbx"}
DATA = (
    (
        f"every BVH, C3D and FBX of {HDM05}; {CMU}; {BANDAI}; ACCAD Open Motion Project, "
        "CC BY 3.0; UI-PRMD, PDDL 1.0; rigs of AnimatedDrawings, MIT; sensors of the NEURA walk, "
        "GPL-3; files of 20 public repositories",
        lambda recordings: _extent(recordings.folder),
    ),
)
TOLERANCE_M = 1e-9
#: No glTF of a person is at hand: recordings that become one, how it is packed, what it has.
GLTF: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("cmu/01_01.bvh", "data", {}),
    ("rigs/jumping.bvh", "glb", {"unit_m": 0.01, "humanoid": "vrm1"}),
    ("rigs/jumping_jacks.bvh", "data", {"humanoid": "vrma"}),
    ("accad/Male1/Male1_B3_Walk.bvh", "glb", {"start_s": 1.5}),
    ("wild/20tab+bvh-python/test_mocapbank.bvh", "glb", {"matrix": True, "humanoid": "vrm0"}),
)
#: So many frames of an FBX or a glTF are evaluated, each of the whole scene.
FRAMES = 25
_PATIENCE_S = 120


class Theirs(NamedTuple):
    """Places by another reader: names, positions (frames, points, 3), and which of our frames."""

    names: list[str]
    positions: Floats
    frames: slice | NDArray[np.intp] = slice(None)


def measure(recordings: Recordings) -> Results:
    """Each kind of file by each of its readers."""
    readers = {
        ".bvh": {"pybvh": by_pybvh, "bvhsdk": by_bvhsdk},
        ".c3d": {"ezc3d": by_ezc3d},
        ".fbx": {"ufbx": by_ufbx},
    }
    results: Results = {}
    for suffix, ways in readers.items():
        left = list(_files(recordings.folder, suffix))
        for reader, way in ways.items():
            row = compare(recordings.folder, left, way)
            results[f"{suffix[1:].upper()} by {reader}"] = row
            refused = {name for entry in row["unread"] for name in entry["files"]}
            left = [path for path in left if _name(recordings.folder, path) in refused]
    with tempfile.TemporaryDirectory() as folder:
        made = _make_gltf(recordings.folder, Path(folder))
        results["glTF by trimesh"] = compare(Path(folder), made, by_trimesh)
    return results


def _make_gltf(data: Path, folder: Path) -> list[Path]:
    """Files of the writer of the tests, which shares no code with the reader."""
    gltf_of = importlib.import_module("tests.oracles.rig_files").gltf_of
    paths = []
    for number, (name, packing, options) in enumerate(GLTF):
        figure = gltf_of(read(data / name), **options)
        for file, content in figure.pack(packing, f"{number} {Path(name).stem}").items():
            (folder / file).write_bytes(content)
            paths.append(folder / file)
    return [path for path in paths if path.suffix in (".gltf", ".glb")]


def _files(data: Path, suffix: str) -> Iterator[Path]:
    found = find_recordings([data / folder for folder in FOLDERS])
    yield from (path for path in found if path.suffix.lower() == suffix)


def _name(data: Path, path: Path) -> str:
    return path.relative_to(data).as_posix()


def _extent(data: Path) -> tuple[int, float]:
    """Number of files, and minutes of those that are read."""
    paths = [path for suffix in SUFFIXES for path in _files(data, suffix)]
    seconds = 0.0
    for path in paths:
        with contextlib.suppress(MotionaryError):
            seconds += (motion := read(path)).n_frames / motion.rate_hz
    return len(paths), round(seconds / 60, 2)


def compare(data: Path, paths: list[Path], way: Callable[[Path, Motion, int], Theirs]) -> Results:
    """Largest difference in metres per file, or why there is none."""
    differences: dict[str, float] = {}
    unread: dict[str, str] = {}
    ours_refuse: dict[str, str] = {}
    unseen = 0
    for path in paths:
        name = _name(data, path)
        try:
            takes = list(takes_of(path))
        except MotionaryError as error:
            ours_refuse[name] = str(error)[:200]
            continue
        try:
            for take, motion in enumerate(takes, 1):
                theirs = quietly(way, path, motion, take)
                apart, differ = difference(theirs, motion)
                differences[name] = max(apart, differences.get(name, 0.0))
                unseen += differ
        except Exception as error:
            differences.pop(name, None)
            message = (str(error).replace(str(path), "the file").splitlines() or [""])[0]
            unread[name] = f"{type(error).__name__}: {message[:100]}"
    apart_m = {
        name: {"m": d, "notes": "; ".join(read(data / name).notes)[:400]}
        for name, d in differences.items()
        if not d <= TOLERANCE_M
    }
    largest = max((d for name, d in differences.items() if name not in apart_m), default=0.0)
    return {
        "files": len(paths),
        "agree": len(differences) - len(apart_m),
        "largest_pm": 1e12 * largest,
        "seen_by_one": unseen,
        "apart_m": apart_m,
        "ours_refuse": ours_refuse,
        "unread": [
            {"reason": why, "files": sorted(name for name in unread if unread[name] == why)}
            for why, _ in Counter(unread.values()).most_common()
        ],
    }


def takes_of(path: Path) -> Iterator[Motion]:
    """Each take of a file, in their sequence."""
    motion = read(path)
    takes = next((note for note in motion.notes if note.startswith("take ")), "")
    if not takes:
        yield motion
        return
    for take in itertools.count(1):
        try:
            yield read(path, take=take)
        except MotionaryError:
            return


def quietly(way: Callable[..., Theirs], path: Path, motion: Motion, take: int) -> Theirs:
    """What another reader makes of a take, without what it prints and warns."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        return way(path, motion, take)


def difference(theirs: Theirs, motion: Motion) -> tuple[float, int]:
    """Largest difference of coordinates in metres; how many points one reader alone sees."""
    places = {name: i for i, name in enumerate(motion.names)}
    both = [(i, places[name]) for i, name in enumerate(theirs.names) if name in places]
    if not both:
        raise ValueError("no point has the same name")
    other = theirs.positions[:, [i for i, _ in both]]
    ours = motion.positions[theirs.frames][:, [i for _, i in both]]
    if len(other) != len(ours):
        raise ValueError(f"{len(other)} frames instead of {len(ours)}")
    known, seen = ~np.isnan(ours).any(axis=2), ~np.isnan(other).any(axis=2)
    a, b = ours[known & seen], other[known & seen]
    metres = np.linalg.norm(a - a.mean(axis=0)) / np.linalg.norm(b - b.mean(axis=0))
    apart = min(float(np.abs(b @ turn.T * metres - a).max()) for turn in _turns())
    return apart, int((known != seen).sum())


def _turns() -> Iterator[Floats]:
    """The 24 turns of axes onto axes."""
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            turn = np.eye(3)[list(order)] * signs
            if np.linalg.det(turn) > 0:
                yield turn


# -- the other readers --------------------------------------------------------------------


def by_pybvh(path: Path, motion: Motion, take: int) -> Theirs:
    """Joints in file units, without ends."""
    import pybvh

    other = pybvh.read_bvh_file(str(path))
    return Theirs(list(other.joint_names), other.joint_positions())


def by_bvhsdk(path: Path, motion: Motion, take: int) -> Theirs:
    """Joints in file units; slow, but with positions on every joint."""
    import bvhsdk

    joints = list((other := bvhsdk.ReadFile(str(path))).getlistofjoints())
    places = [[joint.getPosition(frame) for joint in joints] for frame in range(other.frames)]
    return Theirs([joint.name for joint in joints], np.array(places))


def by_ezc3d(path: Path, motion: Motion, take: int) -> Theirs:
    """Points in file units."""
    import ezc3d

    other = ezc3d.c3d(str(path))
    labels = other["parameters"]["POINT"]["LABELS"]["value"]
    return Theirs(list(labels), np.moveaxis(other["data"]["points"][:3], 0, -1).swapaxes(0, 1))


def by_trimesh(path: Path, motion: Motion, take: int) -> Theirs:
    """Keys by pygltflib become transforms of nodes; where these are is told by trimesh."""
    import pygltflib
    import trimesh

    gltf = pygltflib.GLTF2().load(str(path))
    gltf.convert_buffers(pygltflib.BufferFormat.BINARYBLOB)
    blob, (animation,) = gltf.binary_blob(), gltf.animations

    def values(accessor: int) -> Floats:
        row = gltf.accessors[accessor]
        start = gltf.bufferViews[row.bufferView].byteOffset + (row.byteOffset or 0)
        width = {"VEC3": 3, "VEC4": 4}[row.type]
        return np.frombuffer(blob, "<f4", row.count * width, start).reshape(-1, width).astype(float)

    keys = [(channel.target, values(animation.samplers[channel.sampler].output))
            for channel in animation.channels]  # fmt: skip
    for node in gltf.nodes:
        node.mesh = node.skin = None
    gltf.meshes, gltf.skins, gltf.animations, gltf.extensions = [], [], [], {}
    below = {child for node in gltf.nodes for child in node.children or ()}
    roots = [i for i in range(len(gltf.nodes)) if i not in below]
    gltf.scene, gltf.scenes = 0, [pygltflib.Scene(nodes=roots)]
    frames, places = _some(motion), []
    for frame in frames:
        for target, rows in keys:
            setattr(gltf.nodes[target.node], target.path, rows[frame].tolist())
        packed = io.BytesIO(b"".join(gltf.save_to_bytes()))
        graph = trimesh.load_scene(packed, file_type="glb").graph
        names = sorted(set(graph.nodes) & set(motion.names))
        places.append([graph.get(name)[0][:3, 3] for name in names])
    return Theirs(names, np.array(places), frames)


def _some(motion: Motion) -> NDArray[np.intp]:
    return np.unique(np.linspace(0, motion.n_frames - 1, FRAMES).round().astype(np.intp))


def by_ufbx(path: Path, motion: Motion, take: int) -> Theirs:
    """World transforms of nodes at some frames, by a process that may crash."""
    frames = _some(motion)
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "places.npz"
        done = subprocess.run(
            [sys.executable, "-m", "evidence.other_readers", str(path.absolute()), str(take - 1),
             ",".join(map(str, frames)), str(target)],
            capture_output=True, timeout=_PATIENCE_S, check=False,
        )  # fmt: skip
        if done.returncode:
            raise ValueError(done.stderr.decode(errors="replace").strip()[-100:])
        content = np.load(target)
        return Theirs(content["names"].tolist(), content["places"], frames)


def _write_places(arguments: list[str]) -> None:
    """World transforms of all nodes, by ufbx alone; its objects cannot be taken apart."""
    import gc

    import ufbx

    gc.disable()
    kept: list[Any] = [scene := ufbx.load_file(arguments[0])]
    kept += [stacks := list(scene.anim_stacks), settings := scene.settings]
    anim = stacks[int(arguments[1])].anim if stacks else scene.anim
    kept.append(anim)
    places = []
    for frame in map(int, arguments[2].split(",")):
        at_s = anim.time_begin + frame / settings.frames_per_second
        kept += [posed := ufbx.evaluate_scene(scene, anim, at_s), nodes := list(posed.nodes)]
        kept += [worlds := [node.node_to_world for node in nodes]]
        kept += [origins := [world.c3 for world in worlds]]
        places.append([(one.x, one.y, one.z) for one in origins])
    np.savez(arguments[3], names=np.array([node.name for node in nodes]), places=np.array(places))
    sys.stderr.flush()
    os._exit(0)


if __name__ == "__main__":
    _write_places(sys.argv[1:])
