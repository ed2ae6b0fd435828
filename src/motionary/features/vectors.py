"""How are joint tracks added up, measured and turned into directions?

Conventions: a track is an array (3, frames), so that arithmetic runs along frames; NaN
where something is not seen or a direction has no length.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def dot(a: Floats, b: Floats) -> Floats:
    """Scalar product of two tracks, shape (frames,)."""
    result: Floats = a[0] * b[0]
    result += a[1] * b[1]
    result += a[2] * b[2]
    return result


def norm(a: Floats) -> Floats:
    """Length of a track's vectors, shape (frames,)."""
    result = dot(a, a)
    return np.sqrt(result, out=result)


def cross(a: Floats, b: Floats) -> Floats:
    """Vector product of two tracks, shape (3, frames)."""
    result = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[j], b[k], out=result[i])
        result[i] -= a[k] * b[j]
    return result


def unit(a: Floats) -> Floats:
    """Unit vectors, shape (3, frames); NaN where the length is zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        result: Floats = a / norm(a)
    return result


def angle_between(a: Floats, b: Floats) -> Floats:
    """Angle in degrees, shape (frames,); NaN where a vector has no length."""
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = dot(a, b) / (norm(a) * norm(b))
    result: Floats = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return result
