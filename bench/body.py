"""Skinning and depth images of the body, beside what others do.

Skinning: the body's one matrix product for 512 poses, beside matrices blended for each vertex as
linear blend skinning is usually written (such as in SMPL's code). Depth of 320 x 240: the compiled
z-buffer beside its NumPy twin and, where they are installed, rays of trimesh with embree, whose
tree is built anew for each pose.
"""

from collections.abc import Callable

import numpy as np

from motionary.body import (
    Body,
    Camera,
    Pose,
    blend_matrix,
    load_body,
    pose_body,
    render_depth,
    skin,
)
from motionary.rotations import quaternions_to_matrices, rotation_vectors_to_quaternions
from timing import compare, print_ratios

N_POSES = 512
#: Promised: poses a second on one thread, and milliseconds of an image.
LEAST_POSES, MOST_MS = 25_000, 3.0


def main() -> None:
    body = load_body()
    vectors = np.random.default_rng(0).normal(size=(N_POSES, len(body.names), 3)) * 0.4
    poses = pose_body(body, quaternions_to_matrices(rotation_vectors_to_quaternions(vectors)))
    double = blend_matrix(body)
    single = double.astype(np.float32)
    print(f"{N_POSES} poses of {len(body.vertices)} vertices")
    medians = compare(
        {
            "one product, double": lambda: skin(body, poses, blend=double),
            "one product, single": lambda: skin(body, poses, blend=single),
            "a matrix a vertex": lambda: blend_matrices(body, poses),
        },
        runs=5,
    )
    print_ratios(medians, reference="a matrix a vertex")
    rate = N_POSES / medians["one product, double"]
    print(f"  {rate:,.0f} poses a second; wanted at least {LEAST_POSES:,}")
    assert np.allclose(skin(body, poses), blend_matrices(body, poses), atol=1e-9)
    images(body, poses)


def blend_matrices(body: Body, poses: Pose) -> np.ndarray:
    """The mesh in all poses by a blended matrix for each vertex."""
    dense = np.zeros((len(body.vertices), len(body.names)))
    np.add.at(dense, (np.arange(len(dense))[:, None], body.surface.bones), body.surface.weights)
    steps = poses.joints - np.einsum("fjab,jb->fja", poses.rotations, body.joints)
    matrices = np.concatenate([poses.rotations, steps[..., None]], axis=3)
    of_vertices = (dense @ matrices.reshape(len(matrices), len(body.names), 12)).reshape(
        len(matrices), len(dense), 3, 4
    )
    return (of_vertices[..., :3] @ body.vertices[:, :, None])[..., 0] + of_vertices[..., 3]


def images(body: Body, poses: Pose) -> None:
    camera = Camera().looking_at(np.array([0, 1.0, 3.0]), np.array([0, 0.9, 0]))
    vertices = np.asarray(skin(body, Pose(poses.rotations[:1], poses.joints[:1])))[0]
    ways: dict[str, Callable[[], object]] = {
        f"z-buffer, {engine}": lambda engine=engine: render_depth(  # type: ignore[misc]
            vertices, body.faces, camera, engine=engine
        )
        for engine in ("compiled", "numpy")
    }
    try:
        import trimesh
        from trimesh.ray.ray_pyembree import RayMeshIntersector
    except ImportError:
        print("  rays: trimesh with embreex is not installed")
    else:
        ends = camera.unproject(np.ones((camera.height, camera.width))).reshape(-1, 3)
        starts = np.broadcast_to(camera.position, ends.shape)

        def rays() -> object:
            mesh = trimesh.Trimesh(vertices, body.faces, process=False)
            return RayMeshIntersector(mesh).intersects_first(starts, ends - starts)

        ways["trimesh, embree"] = rays
    print(f"depth of {camera.width} x {camera.height}, {len(body.faces)} triangles")
    medians = compare(ways, runs=5)
    print_ratios(medians, reference=list(ways)[-1])
    print(f"  compiled: wanted at most {MOST_MS:.0f} ms")
