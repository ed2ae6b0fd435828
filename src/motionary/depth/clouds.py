"""A person's pixels of a depth image as points of the world, their graph and geodesic extrema.

After Baak (2012), section 8.3.1. Printed: the background is subtracted, contour pixels are
deleted, a 3 x 3 median is taken. Deleting all contours takes thin limbs away at three metres, so
that by default only pixels that float between surfaces are dropped.

Extrema are the points farthest from the middle along the surface. Section 8.4.2 with its Algorithm
4: only the first needs a full pass of Dijkstra's algorithm; each further one starts where the last
was found and stops where nothing gets nearer.

Conventions: depth along the camera's axis in metres, NaN where nothing is; the world's y is up.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.body.rendering import Camera
from motionary.errors import InvalidInput
from motionary.matching.distance import Engine, load_twin

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

COMPILED = "motionary.depth._compiled"
# A pixel belongs to a surface if so many of its 24 neighbours lie so near to its depth.
_LEAST_NEIGHBOURS = 5
_SAME_SURFACE_M = 0.10
#: Neighbours are so many pixels apart at most, times depth / focal length, and more by the noise:
#: a constant, or the step of structured light, which grows with the square of the depth. Three
#: pixels join hanging hands to thighs, one breaks the head off.
REACH_PX, REACH_M, REACH_STEP = 1.5, 0.015, 3.1e-3
_LEAST_COMPONENT = 15
_LONGEST_JOINT_M = 0.5
_EVERY = 3
N_EXTREMA = 20


@dataclass(frozen=True, slots=True)
class PreparationSettings:
    """What of a depth image is the person.

    Attributes
    ----------
    near_m, far_m : depths between which the person is
    floor_m : height of the floor in the world; what is less than 4 cm above it is dropped; None
        if no floor is seen
    margin_m : so much nearer than the background is in front of it; it grows with the noise
    contours : "floating" drops pixels between surfaces; "delete" drops all contours, as printed
    """

    near_m: float = 0.3
    far_m: float = 8.0
    floor_m: float | None = None
    margin_m: float = 0.05
    contours: str = "floating"

    def __post_init__(self) -> None:
        if not 0 < self.near_m < self.far_m:
            raise InvalidInput(
                f"the person needs to be between two depths, 0 < near < far, got {self.near_m:g} "
                f"and {self.far_m:g} m"
            )
        if self.contours not in ("floating", "delete"):
            raise InvalidInput(f"contours: choose floating or delete, got {self.contours!r}")


class Cloud(NamedTuple):
    """Points of one image.

    Attributes
    ----------
    points : array, shape (points, 3), metres, in the world
    pixels : array, shape (points,), row * width + column of each
    depth : array, shape (height, width), the cleaned image; NaN where no point is
    """

    points: Floats
    pixels: Indices
    depth: Floats


def prepare(
    image: Floats,
    camera: Camera,
    settings: PreparationSettings | None = None,
    *,
    background: Floats | None = None,
    engine: Engine = "auto",
) -> Cloud:
    """The points of what is in front of the background.

    Parameters
    ----------
    image : array, shape (height, width), depth in metres; 0 or NaN where nothing is
    camera : whose image it is
    settings : what of it is the person
    background : depth of the empty scene, as from `learn_background`
    engine : which twin computes

    Raises
    ------
    InvalidInput
        If the sizes of image, camera and background differ.
    """
    settings = settings or PreparationSettings()
    size = (camera.height, camera.width)
    for what, one in (("image", image), ("background", background)):
        if one is not None and one.shape != size:
            raise InvalidInput(
                f"the camera's images are {size[1]} x {size[0]}, got the {what} with shape "
                f"{one.shape}; give the intrinsics of this size"
            )
    depth = np.array(image, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        keep = (depth >= settings.near_m) & (depth <= settings.far_m)
        if background is not None:
            # The step of structured light grows with the square of the depth.
            margin = np.maximum(settings.margin_m, 2 * 2.78e-3 * background**2)
            keep &= ~(depth > background - margin)
    depth[~keep] = np.nan
    rows, columns = np.flatnonzero(keep.any(axis=1)), np.flatnonzero(keep.any(axis=0))
    if not len(rows):
        return Cloud(np.empty((0, 3)), np.empty(0, np.intp), depth)
    # Two pixels of margin: neighbours of neighbours are looked at.
    box = (
        slice(max(rows[0] - 2, 0), rows[-1] + 3),
        slice(max(columns[0] - 2, 0), columns[-1] + 3),
    )
    kernels = load_twin(COMPILED, engine, pays=True)
    part = np.ascontiguousarray(depth[box])
    if settings.contours == "delete":
        part[_contours(part)] = np.nan
    clean = _clean if kernels is None else kernels.clean
    depth[box] = clean(part, _LEAST_NEIGHBOURS, _SAME_SURFACE_M)
    pixels = np.flatnonzero(~np.isnan(depth))
    points = unproject_pixels(depth, pixels, camera)
    if settings.floor_m is not None:
        above = points[:, 1] > settings.floor_m + 0.04
        depth.reshape(-1)[pixels[~above]] = np.nan
        points, pixels = points[above], pixels[above]
    return Cloud(points, pixels, depth)


def unproject_pixels(depth: Floats, pixels: Indices, camera: Camera) -> Floats:
    """Places in the world of some pixels (n,) of a depth image, shape (n, 3)."""
    z = depth.reshape(-1)[pixels]
    seen = np.empty((len(pixels), 3))
    seen[:, 0] = (pixels % camera.width - camera.centre[0]) / camera.focal[0] * z
    seen[:, 1] = (pixels // camera.width - camera.centre[1]) / camera.focal[1] * z
    seen[:, 2] = z
    placed: Floats = seen @ camera.world_from_camera.T + camera.position
    return placed


def unpack_camera(camera: Camera) -> tuple[Floats, Floats, Floats]:
    """Focal lengths and centre (4,), turn and place of a camera, as kernels take them."""
    return (
        np.array([*camera.focal, *camera.centre]),
        np.ascontiguousarray(camera.world_from_camera),
        np.asarray(camera.position, dtype=np.float64),
    )


def learn_background(images: Floats) -> Floats:
    """The depth of the empty scene from images (n, height, width) of it; NaN where never seen."""
    if images.ndim != 3 or not len(images):
        raise InvalidInput(f"a background needs images (n, height, width), got {images.shape}")
    known = np.where(images > 0, images, np.nan)
    result = np.full(images.shape[1:], np.nan)
    seen = ~np.isnan(known).all(axis=0)
    result[seen] = np.nanmedian(known[:, seen], axis=0)
    return result


def _neighbours(depth: Floats, reach: int) -> Floats:
    """All pixels that are at most `reach` away, and the pixel itself, along a first axis."""
    padded = np.pad(depth, reach, constant_values=np.nan)
    height, width = depth.shape
    side = range(2 * reach + 1)
    return np.stack([padded[r : r + height, c : c + width] for r in side for c in side])


def _clean(depth: Floats, least: int, near: float) -> Floats:
    """Floating pixels dropped, then the 3 x 3 median of what is left."""
    with np.errstate(invalid="ignore"):
        # The pixel itself is among them.
        alike = (np.abs(_neighbours(depth, 2) - depth) < near).sum(axis=0) - 1
    kept = np.where(alike >= least, depth, np.nan)
    around = np.sort(_neighbours(kept, 1), axis=0)
    known = (~np.isnan(around)).sum(axis=0)
    middle = np.take_along_axis(around, np.maximum(known - 1, 0)[None] // 2, axis=0)[0]
    return np.where(np.isnan(kept), np.nan, middle)


def _contours(depth: Floats) -> Mask:
    """Pixels beside a hole or a jump, as the printed method deletes them."""
    around = _neighbours(depth, 1)
    with np.errstate(invalid="ignore"):
        return np.asarray(~(np.abs(around - depth) < _SAME_SURFACE_M).all(axis=0))


# ---- graph and extrema


class Graph(NamedTuple):
    """Neighbours on the surface, as rows of a sparse matrix.

    Attributes
    ----------
    starts, neighbours, weights : rows of the matrix; weights are distances in metres
    nodes : array, shape (nodes,), the points of the cloud that are nodes
    points : array, shape (nodes, 3), their places
    torso : array, shape (nodes,), whether a node is in the largest component
    source : the node from which distances count
    """

    starts: Indices
    neighbours: Indices
    weights: Floats
    nodes: Indices
    points: Floats
    torso: NDArray[np.bool_]
    source: int


class Extrema(NamedTuple):
    """Geodesic extrema, the farthest first.

    `nodes` (n,) of the graph, `points` (n, 3), `distances` (n,) when each was found, and how many
    nodes each pass visited.
    """

    nodes: Indices
    points: Floats
    distances: Floats
    visited: Indices


def build_graph(cloud: Cloud, focal: float, *, engine: Engine = "auto") -> Graph:
    """The graph of a cloud: neighbouring pixels near each other, components joined.

    Parameters
    ----------
    cloud : Cloud
    focal : the camera's focal length in pixels
    engine : which twin computes

    Raises
    ------
    InvalidInput
        If there are too few points.
    """
    n = len(cloud.points)
    if n < _LEAST_COMPONENT:
        raise InvalidInput(f"a graph needs at least {_LEAST_COMPONENT} points, got {n}")
    kernels = load_twin(COMPILED, engine, pays=True)
    link = _link if kernels is None else kernels.link
    first, second, weights, labels = link(
        cloud.points, cloud.pixels, cloud.depth, REACH_PX / focal, REACH_M, REACH_STEP
    )
    sizes = np.bincount(labels)
    kept = sizes >= _LEAST_COMPONENT
    largest = int(sizes.argmax())
    kept[largest] = True
    keep = kept[labels]
    more = _join(cloud.points, labels, np.flatnonzero(kept), largest)
    number = np.where(keep, np.cumsum(keep) - 1, -1)
    starts, neighbours, lengths = _to_rows(
        np.concatenate([number[first], number[more[0]]]),
        np.concatenate([number[second], number[more[1]]]),
        np.concatenate([weights, more[2]]),
        int(keep.sum()),
    )
    points, torso = cloud.points[keep], labels[keep] == largest
    middle = np.median(points[torso], axis=0)
    away = np.where(torso, ((points - middle) ** 2).sum(axis=1), np.inf)
    nodes = np.flatnonzero(keep)
    return Graph(starts, neighbours, lengths, nodes, points, torso, int(away.argmin()))


def _link(
    points: Floats, pixels: Indices, depth: Floats, reach: float, reach_m: float, step: float
) -> tuple[Indices, Indices, Floats, Indices]:
    """Pairs of neighbouring pixels' points near each other, once each, and components."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    height, width = depth.shape
    number = np.full((height + 1, width + 2), -1, dtype=np.intp)
    rows, columns = pixels // width, pixels % width
    number[rows, columns + 1] = np.arange(len(rows))
    firsts, seconds = [], []
    for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        other = number[rows + down, columns + 1 + right]
        has = np.flatnonzero(other >= 0)
        firsts.append(has)
        seconds.append(other[has])
    first, second = np.concatenate(firsts), np.concatenate(seconds)
    weights = np.sqrt(((points[first] - points[second]) ** 2).sum(axis=1))
    z = depth.reshape(-1)[pixels[first]]
    near = weights < reach * z + np.maximum(reach_m, step * z * z)
    first, second, weights = first[near], second[near], weights[near]
    n = len(points)
    matrix = coo_matrix((np.ones(len(first), np.int8), (first, second)), shape=(n, n)).tocsr()
    labels = connected_components(matrix, directed=False)[1].astype(np.intp)
    return first, second, weights, labels


def _to_rows(
    first: Indices, second: Indices, weights: Floats, n: int
) -> tuple[Indices, Indices, Floats]:
    """Rows of the symmetric matrix of n nodes; edges of dropped nodes (-1) are left out."""
    inside = first >= 0
    ends = np.concatenate([first[inside], second[inside]])
    others = np.concatenate([second[inside], first[inside]])
    order = np.argsort(ends, kind="stable")
    starts = np.zeros(n + 1, dtype=np.intp)
    np.cumsum(np.bincount(ends, minlength=n), out=starts[1:])
    return starts, others[order], np.concatenate([weights[inside]] * 2)[order]


def _join(
    points: Floats, labels: Indices, components: Indices, largest: int
) -> tuple[Indices, Indices, Floats]:
    """An edge from each component to the largest one, between their closest points."""
    from scipy.spatial import cKDTree

    others = components[components != largest]
    if not len(others):
        return np.empty(0, np.intp), np.empty(0, np.intp), np.empty(0)
    # Every third point of the torso: some pixel's width more or less makes no joint another one.
    torso = np.flatnonzero(labels == largest)[::_EVERY]
    tree = cKDTree(points[torso], balanced_tree=False, compact_nodes=False)
    pairs = []
    for component in others:
        own = np.flatnonzero(labels == component)
        distances, nearest = tree.query(points[own], distance_upper_bound=_LONGEST_JOINT_M)
        best = int(distances.argmin())
        if np.isfinite(distances[best]):
            pairs.append((own[best], torso[nearest[best]], distances[best]))
    if not pairs:
        return np.empty(0, np.intp), np.empty(0, np.intp), np.empty(0)
    first, second, weights = zip(*pairs, strict=True)
    return np.array(first), np.array(second), np.array(weights)


def find_extrema(graph: Graph, n: int = N_EXTREMA, *, engine: Engine = "auto") -> Extrema:
    """The first n geodesic extrema (Algorithm 4).

    Parameters
    ----------
    graph : Graph
    n : how many
    engine : which twin computes; all give the same extrema

    Raises
    ------
    InvalidInput
        If there is not one to be found.
    """
    if n < 1:
        raise InvalidInput(f"there must be at least one extremum to find, got {n}")
    kernels = load_twin(COMPILED, engine, pays=True)
    if kernels is None:
        nodes, distances, visited = _search(graph, n)
    else:
        nodes, distances, visited = kernels.find_extrema(
            graph.starts, graph.neighbours, graph.weights, graph.source, n
        )
    return Extrema(nodes, graph.points[nodes], distances, visited)


def _search(graph: Graph, n: int) -> tuple[Indices, Floats, Indices]:
    """Algorithm 4 by SciPy: a pass reaches no farther than its source was from the others."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import dijkstra

    size = len(graph.points)
    matrix = csr_matrix((graph.weights, graph.neighbours, graph.starts), shape=(size, size))
    nearest = dijkstra(matrix, indices=graph.source)
    nodes, distances = np.empty(n, np.intp), np.empty(n)
    visited = np.empty(n, np.intp)
    visited[0] = np.isfinite(nearest).sum()
    for k in range(n):
        # Nodes that were not reached have no distance to compare.
        reached = np.where(np.isinf(nearest), -1.0, nearest)
        nodes[k] = reached.argmax()
        distances[k] = reached[nodes[k]]
        if k + 1 < n:
            closer = dijkstra(matrix, indices=nodes[k], limit=max(distances[k], 1e-12))
            visited[k + 1] = (closer < nearest).sum()
            nearest = np.minimum(nearest, closer)
    return nodes, distances, visited
