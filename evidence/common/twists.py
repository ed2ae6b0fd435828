"""Products of exponentials of twists, by which the thesis poses a chain: (6.1) and (6.2)."""

import numpy as np
from numpy.typing import NDArray

from motionary.body import Body
from motionary.rotations import rotation_vectors_to_matrices

Floats = NDArray[np.float64]


def revolute_twists(axes: Floats, points: Floats) -> Floats:
    """Twists (..., 6) of turns about axes through points: (-axis x point, axis), as (6.1)."""
    axes = np.asarray(axes, dtype=np.float64)
    return np.concatenate([-np.cross(axes, points), axes], axis=-1)


def exponentials(twists: Floats) -> Floats:
    """Rigid motions of twists (..., 6), as matrices (..., 4, 4).

    Turns by the last three components' length; with none of them, a translation.
    """
    given = np.asarray(twists, dtype=np.float64)
    v, w = given[..., :3], given[..., 3:]
    angle = np.linalg.norm(w, axis=-1)[..., None]
    result = np.zeros((*given.shape[:-1], 4, 4))
    result[..., :3, :3] = rotation_vectors_to_matrices(w)
    # V v with V = I + (1 - cos) / a² [w] + (a - sin) / a³ [w]²; series where a is small.
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    second = np.where(small, 1 / 6 - angle**2 / 120, (safe - np.sin(safe)) / safe**3)
    once = np.cross(w, v)
    result[..., :3, 3] = v + first * once + second * np.cross(w, once)
    result[..., 3, 3] = 1.0
    return result


def pose_by_twists(body: Body, vectors: Floats, twist_of_root: Floats) -> Floats:
    """Rigid motions of all bones of one pose as products of exponentials (6.2).

    Parameters
    ----------
    body : Body
    vectors : array, shape (joints, 3), axis times angle of each joint's turn, at rest
    twist_of_root : array, shape (6,), applied to the whole body last

    Returns
    -------
    array, shape (joints, 4, 4), from rest to the pose
    """
    own = exponentials(revolute_twists(vectors, body.joints))
    result = np.empty_like(own)
    root = exponentials(twist_of_root)
    for joint, parent in enumerate(body.parents):
        result[joint] = (root if parent < 0 else result[parent]) @ own[joint]
    return result
