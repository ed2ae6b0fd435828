"""Geodesic extrema of a cloud: the points farthest from its middle along the surface.

After Baak (2012), section 8.4.2 with its Algorithm 4: only the first extremum needs a full pass of
Dijkstra's algorithm; each further one starts where the last was found and stops where nothing
gets nearer.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.depth.preparation import COMPILED, Cloud
from motionary.errors import InvalidInput
from motionary.matching.distance import Engine, load_twin

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Neighbours are so many pixels apart at most, times depth / focal length, and more by the noise:
#: a constant, or the step of structured light, which grows with the square of the depth. Three
#: pixels join hanging hands to thighs, one breaks the head off.
REACH_PX, REACH_M, REACH_STEP = 1.5, 0.015, 3.1e-3
_LEAST_COMPONENT = 15
_LONGEST_JOINT_M = 0.5
_EVERY = 3
N_EXTREMA = 20


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


def build_graph(
    cloud: Cloud, focal: float, *, reach_px: float = REACH_PX, engine: Engine = "auto"
) -> Graph:
    """The graph of a cloud: neighbouring pixels near each other, components joined.

    Parameters
    ----------
    cloud : Cloud
    focal : the camera's focal length in pixels
    reach_px : neighbours are joined up to so many pixels' distance, and some more for the noise
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
    link, to_rows = (_link, _to_rows) if kernels is None else (kernels.link, kernels.to_rows)
    first, second, weights, labels = link(
        cloud.points, cloud.pixels, cloud.depth, reach_px / focal, REACH_M, REACH_STEP
    )
    sizes = np.bincount(labels)
    kept = sizes >= _LEAST_COMPONENT
    largest = int(sizes.argmax())
    kept[largest] = True
    keep = kept[labels]
    more = _join(cloud.points, labels, np.flatnonzero(kept), largest)
    number = np.where(keep, np.cumsum(keep) - 1, -1)
    starts, neighbours, lengths = to_rows(
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
