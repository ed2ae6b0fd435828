"""Compiled kernels of poses from depth, behind the extra `fast`: twins of NumPy and SciPy."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


@njit(cache=True, error_model="numpy")
def clean(depth: Floats, least: int, near: float) -> Floats:
    """Floating pixels dropped, then the median; see `clouds._clean`."""
    height, width = depth.shape
    kept = np.full((height, width), np.nan)
    for row in range(height):
        for column in range(width):
            here = depth[row, column]
            if np.isnan(here):
                continue
            alike = -1
            for r in range(max(row - 2, 0), min(row + 3, height)):
                for c in range(max(column - 2, 0), min(column + 3, width)):
                    if abs(depth[r, c] - here) < near:
                        alike += 1
            if alike >= least:
                kept[row, column] = here
    result = np.full((height, width), np.nan)
    around = np.empty(9)
    for row in range(height):
        for column in range(width):
            if np.isnan(kept[row, column]):
                continue
            count = 0
            for r in range(max(row - 1, 0), min(row + 2, height)):
                for c in range(max(column - 1, 0), min(column + 2, width)):
                    value = kept[r, c]
                    if np.isnan(value):
                        continue
                    place = count
                    while place > 0 and around[place - 1] > value:
                        around[place] = around[place - 1]
                        place -= 1
                    around[place] = value
                    count += 1
            result[row, column] = around[(count - 1) // 2]
    return result


@njit(cache=True, error_model="numpy")
def link(
    points: Floats, pixels: Indices, depth: Floats, reach: float, reach_m: float, step: float
) -> tuple[Indices, Indices, Floats, Indices]:
    """Pairs of near neighbours, and components by union-find; see `clouds._link`."""
    height, width = depth.shape
    n = len(pixels)
    number = np.full((height + 1, width + 2), -1, np.intp)
    for k in range(n):
        number[pixels[k] // width, pixels[k] % width + 1] = k
    first, second = np.empty(4 * n, np.intp), np.empty(4 * n, np.intp)
    weights = np.empty(4 * n)
    parents = np.arange(n)
    count = 0
    for k in range(n):
        row, column = pixels[k] // width, pixels[k] % width
        here = depth[row, column]
        limit = reach * here + max(reach_m, step * here * here)
        for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
            other = number[row + down, column + 1 + right]
            if other < 0:
                continue
            x = points[k, 0] - points[other, 0]
            y = points[k, 1] - points[other, 1]
            z = points[k, 2] - points[other, 2]
            length = np.sqrt(x * x + y * y + z * z)
            if length >= limit:
                continue
            first[count], second[count], weights[count] = k, other, length
            count += 1
            a, b = _top(parents, k), _top(parents, other)
            if a != b:
                parents[max(a, b)] = min(a, b)
    labels = np.empty(n, np.intp)
    components = 0
    for k in range(n):
        top = _top(parents, k)
        if top == k:
            labels[k] = components
            components += 1
        else:
            labels[k] = labels[top]
    return first[:count].copy(), second[:count].copy(), weights[:count].copy(), labels


@njit(cache=True, error_model="numpy")
def _top(parents: Indices, node: int) -> int:
    while parents[node] != node:
        parents[node] = parents[parents[node]]
        node = parents[node]
    return node


@njit(cache=True, error_model="numpy")
def find_extrema(
    starts: Indices, neighbours: Indices, weights: Floats, source: int, n: int
) -> tuple[Indices, Floats, Indices]:
    """Algorithm 4 with a binary heap; see `clouds._search`."""
    size = len(starts) - 1
    nearest = np.full(size, np.inf)
    keys = np.empty(len(neighbours) + n + 1)
    items = np.empty(len(neighbours) + n + 1, np.intp)
    nodes, distances, visited = np.empty(n, np.intp), np.empty(n), np.zeros(n, np.intp)
    for k in range(n):
        nearest[source] = 0.0
        keys[0], items[0], count = 0.0, source, 1
        while count > 0:
            key, node = keys[0], items[0]
            count = _pop(keys, items, count)
            if key > nearest[node]:
                continue
            visited[k] += 1
            for edge in range(starts[node], starts[node + 1]):
                other, farther = neighbours[edge], key + weights[edge]
                if farther < nearest[other]:
                    nearest[other] = farther
                    _push(keys, items, count, farther, other)
                    count += 1
        best, far = source, -1.0
        for node in range(size):
            if far < nearest[node] < np.inf:
                best, far = node, nearest[node]
        nodes[k], distances[k], source = best, far, best
    return nodes, distances, visited


@njit(cache=True, error_model="numpy")
def _push(keys: Floats, items: Indices, count: int, key: float, item: int) -> None:
    place = count
    while place > 0:
        above = (place - 1) // 2
        if keys[above] <= key:
            break
        keys[place], items[place] = keys[above], items[above]
        place = above
    keys[place], items[place] = key, item


@njit(cache=True, error_model="numpy")
def _pop(keys: Floats, items: Indices, count: int) -> int:
    count -= 1
    key, item = keys[count], items[count]
    place = 0
    while True:
        below = 2 * place + 1
        if below >= count:
            break
        if below + 1 < count and keys[below + 1] < keys[below]:
            below += 1
        if keys[below] >= key:
            break
        keys[place], items[place] = keys[below], items[below]
        place = below
    keys[place], items[place] = key, item
    return count


@njit(cache=True, error_model="numpy")
def compare_images(
    poses: Floats,
    faces: Indices,
    lens: Floats,
    turn: Floats,
    eye: Floats,
    depth: Floats,
    cap: float,
    apart: Floats,
) -> Floats:
    """How far rendered poses are from an image, the last by pixel; see `fitting.compare_images`."""
    height, width = depth.shape
    result = np.empty(len(poses))
    n = poses.shape[1]
    x, y, z = np.empty(n), np.empty(n), np.empty(n)
    buffer = np.empty((height, width))
    for pose in range(len(poses)):
        for v in range(n):
            a = poses[pose, v, 0] - eye[0]
            b = poses[pose, v, 1] - eye[1]
            c = poses[pose, v, 2] - eye[2]
            z[v] = 1.0 / max(turn[0, 2] * a + turn[1, 2] * b + turn[2, 2] * c, 0.05)
            x[v] = (turn[0, 0] * a + turn[1, 0] * b + turn[2, 0] * c) * z[v] * lens[0] + lens[2]
            y[v] = (turn[0, 1] * a + turn[1, 1] * b + turn[2, 1] * c) * z[v] * lens[1] + lens[3]
        for row in range(height):
            for column in range(width):
                buffer[row, column] = 0.0
        for face in range(len(faces)):
            _fill(faces[face], x, y, z, buffer)
        total, count = 0.0, 0
        for row in range(height):
            for column in range(width):
                seen, wanted = buffer[row, column], depth[row, column]
                apart[row, column] = np.nan
                if seen > 0.0 or not np.isnan(wanted):
                    off = abs(1.0 / seen - wanted) if seen > 0.0 else cap
                    apart[row, column] = off if off < cap else cap
                    total += apart[row, column]
                    count += 1
        result[pose] = total / count if count else cap
    return result


@njit(cache=True, error_model="numpy")
def _fill(face: Indices, x: Floats, y: Floats, z: Floats, buffer: Floats) -> None:
    """Write one triangle into a buffer of inverse depths, if it faces the camera."""
    i, j, k = face[0], face[1], face[2]
    area = (x[j] - x[i]) * (y[k] - y[i]) - (x[k] - x[i]) * (y[j] - y[i])
    # Images have y down: triangles that are counter-clockwise from outside have areas below 0.
    if area >= 0.0:
        return
    height, width = buffer.shape
    left = max(0, int(np.ceil(min(x[i], x[j], x[k]))))
    right = min(width - 1, int(np.floor(max(x[i], x[j], x[k]))))
    top = max(0, int(np.ceil(min(y[i], y[j], y[k]))))
    bottom = min(height - 1, int(np.floor(max(y[i], y[j], y[k]))))
    for row in range(top, bottom + 1):
        for column in range(left, right + 1):
            a = ((x[j] - column) * (y[k] - row) - (x[k] - column) * (y[j] - row)) / area
            b = ((x[k] - column) * (y[i] - row) - (x[i] - column) * (y[k] - row)) / area
            c = ((x[i] - column) * (y[j] - row) - (x[j] - column) * (y[i] - row)) / area
            if a >= 0.0 and b >= 0.0 and c >= 0.0:
                buffer[row, column] = max(buffer[row, column], a * z[i] + b * z[j] + c * z[k])


@njit(cache=True, error_model="numpy")
def see(
    vertices: Floats,
    turned: Floats,
    owners: Indices,
    normals: Floats,
    camera: tuple[Floats, Floats, Floats],
    depth: Floats,
    hiding: float,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Normals of vertices, and which are seen; see `solving.see`."""
    lens, turn, eye = camera
    facing = np.empty_like(vertices)
    height, width = depth.shape
    visible = np.zeros(len(vertices), np.bool_)
    for v in range(len(vertices)):
        x, y, z = vertices[v, 0] - eye[0], vertices[v, 1] - eye[1], vertices[v, 2] - eye[2]
        own, normal = turned[owners[v]], normals[v]
        for i in range(3):
            facing[v, i] = own[i, 0] * normal[0] + own[i, 1] * normal[1] + own[i, 2] * normal[2]
        if facing[v, 0] * x + facing[v, 1] * y + facing[v, 2] * z >= 0.0:
            continue
        far = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
        if far <= 0.0:
            continue
        across = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
        down = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
        column = int(np.rint(across / far * lens[0] + lens[2]))
        row = int(np.rint(down / far * lens[1] + lens[3]))
        visible[v] = True
        if 0 <= column < width and 0 <= row < height and depth[row, column] < far - hiding:
            visible[v] = False
    return facing, visible


@njit(cache=True, error_model="numpy")
def pair(
    vertices: Floats,
    normals: Floats,
    visible: NDArray[np.bool_],
    pulling: Indices,
    points: Floats,
    weighing: tuple[float, float, float],
) -> Floats:
    """Pulls of points, sorted by their height, and vertices on each other; see `solving.pair`."""
    scale, along, outward = weighing
    pulls = np.zeros((len(vertices), 9))
    seen = np.flatnonzero(visible)
    if len(seen) == 0:
        return pulls
    order = seen[np.argsort(vertices[seen, 1])]
    sorted_vertices = vertices[order]
    for k in range(len(points)):
        j, square = _nearest(sorted_vertices, points[k])
        v = order[j]
        weight = 1.0 / (1.0 + square / scale**2)
        _pull(pulls, v, weight, along, normals[v], points[k], vertices[v])
    total = 0
    for v in pulling:
        total += visible[v]
    outward *= len(points) / max(total, 1)
    for v in pulling:
        if visible[v]:
            k, square = _nearest(points, vertices[v])
            weight = outward / (1.0 + square / scale**2)
            _pull(pulls, v, weight, 1.0, normals[v], points[k], vertices[v])
    return pulls


@njit(cache=True, error_model="numpy")
def _nearest(places: Floats, point: Floats) -> tuple[int, float]:
    """The nearest of places sorted by height, and the square of how far it is."""
    x, y, z = point[0], point[1], point[2]
    low, high = 0, len(places)
    while low < high:
        middle = (low + high) // 2
        if places[middle, 1] < y:
            low = middle + 1
        else:
            high = middle
    best, least = 0, np.inf
    # Up and down from the point's height, until the height alone is farther than the best.
    for way in (1, -1):
        k = low if way == 1 else low - 1
        while 0 <= k < len(places):
            rise = (places[k, 1] - y) ** 2
            if rise >= least:
                break
            square = rise + (places[k, 0] - x) ** 2 + (places[k, 2] - z) ** 2
            if square < least:
                best, least = k, square
            k += way
    return best, least


@njit(cache=True, error_model="numpy")
def _pull(
    pulls: Floats,
    v: int,
    weight: float,
    along: float,
    normal: Floats,
    point: Floats,
    vertex: Floats,
) -> None:
    """Add weight * (along + (1 - along) normal normal^T) and its pull towards a point."""
    across = weight * (1.0 - along)
    a, b, c = normal[0], normal[1], normal[2]
    x, y, z = point[0] - vertex[0], point[1] - vertex[1], point[2] - vertex[2]
    ahead = across * (a * x + b * y + c * z)
    pulls[v, 0] += weight * along + across * a * a
    pulls[v, 1] += across * a * b
    pulls[v, 2] += across * a * c
    pulls[v, 3] += weight * along + across * b * b
    pulls[v, 4] += across * b * c
    pulls[v, 5] += weight * along + across * c * c
    pulls[v, 6] += weight * along * x + ahead * a
    pulls[v, 7] += weight * along * y + ahead * b
    pulls[v, 8] += weight * along * z + ahead * c
