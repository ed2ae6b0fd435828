"""Geodesic extrema and cleaned images by their definitions, one node and pixel at a time."""

import heapq

import numpy as np


def extrema(edges, n_nodes, source, n):
    """Extrema of a graph {node: [(other, weight)]}: Dijkstra from the start for each of them."""
    sources, found, lengths = [source], [], []
    for _ in range(n):
        nearest = {}
        queue = [(0.0, one) for one in sources]
        heapq.heapify(queue)
        while queue:
            far, node = heapq.heappop(queue)
            if node in nearest:
                continue
            nearest[node] = far
            for other, weight in edges.get(node, ()):
                if other not in nearest:
                    heapq.heappush(queue, (far + weight, other))
        best = max(sorted(nearest), key=lambda node: nearest[node])
        found.append(best)
        lengths.append(nearest[best])
        sources.append(best)
    return found, lengths


def cleaned(depth, least, near):
    """Pixels with fewer than `least` of 24 neighbours nearby dropped, then the 3 x 3 median."""
    height, width = depth.shape
    kept = np.full_like(depth, np.nan)
    for r in range(height):
        for c in range(width):
            around = depth[max(r - 2, 0) : r + 3, max(c - 2, 0) : c + 3]
            if (np.abs(around - depth[r, c]) < near).sum() - 1 >= least:
                kept[r, c] = depth[r, c]
    result = np.full_like(depth, np.nan)
    for r in range(height):
        for c in range(width):
            if not np.isnan(kept[r, c]):
                around = kept[max(r - 1, 0) : r + 2, max(c - 1, 0) : c + 2]
                known = np.sort(around[~np.isnan(around)])
                result[r, c] = known[(len(known) - 1) // 2]
    return result
