"""Compiled kernels of the body, behind the extra `fast`: twins of `jacobian` and `rendering`."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


@njit(cache=True)
def turn_columns(
    parents: Indices,
    turned: Floats,
    carried: Floats,
    joints: Floats,
    seen: Floats,
    bones: Indices,
    weights: Floats,
    out: Floats,
) -> None:
    """Columns of the joints' turns; see `jacobian._turn_columns`."""
    arms = np.zeros((len(joints), 3))
    for point in range(len(seen)):
        touched = 0
        for influence in range(bones.shape[1]):
            weight = weights[point, influence]
            if weight == 0.0:
                continue
            bone = bones[point, influence]
            x = y = z = 0.0
            for axis in range(3):
                step = seen[point, influence, axis]
                x += carried[bone, 0, axis] * step
                y += carried[bone, 1, axis] * step
                z += carried[bone, 2, axis] * step
            x += joints[bone, 0]
            y += joints[bone, 1]
            z += joints[bone, 2]
            joint = bone
            while joint >= 0:
                arms[joint, 0] += weight * (x - joints[joint, 0])
                arms[joint, 1] += weight * (y - joints[joint, 1])
                arms[joint, 2] += weight * (z - joints[joint, 2])
                joint = parents[joint]
            touched = max(touched, bone + 1)
        for joint in range(touched):
            a, b, c = arms[joint]
            if a == 0.0 and b == 0.0 and c == 0.0:
                continue
            for axis in range(3):
                u, v, w = turned[joint, 0, axis], turned[joint, 1, axis], turned[joint, 2, axis]
                column = 3 * joint + axis
                out[point, 0, column] = v * c - w * b
                out[point, 1, column] = w * a - u * c
                out[point, 2, column] = u * b - v * a
            arms[joint] = 0.0


@njit(cache=True)
def fill_buffer(
    corners: Floats, inverse: Floats, width: int, height: int, depth: Floats, which: Indices
) -> None:
    """Nearest depth and triangle at each pixel; see `rendering._fill_buffer`."""
    for triangle in range(len(corners)):
        x0, y0 = corners[triangle, 0]
        x1, y1 = corners[triangle, 1]
        x2, y2 = corners[triangle, 2]
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if area == 0.0:
            continue
        left = max(0, int(np.ceil(min(x0, x1, x2))))
        right = min(width - 1, int(np.floor(max(x0, x1, x2))))
        top = max(0, int(np.ceil(min(y0, y1, y2))))
        bottom = min(height - 1, int(np.floor(max(y0, y1, y2))))
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                a = ((x1 - column) * (y2 - row) - (x2 - column) * (y1 - row)) / area
                b = ((x2 - column) * (y0 - row) - (x0 - column) * (y2 - row)) / area
                c = ((x0 - column) * (y1 - row) - (x1 - column) * (y0 - row)) / area
                if a < 0.0 or b < 0.0 or c < 0.0:
                    continue
                here = 1.0 / (
                    a * inverse[triangle, 0] + b * inverse[triangle, 1] + c * inverse[triangle, 2]
                )
                if here < depth[row, column]:
                    depth[row, column] = here
                    which[row, column] = triangle
