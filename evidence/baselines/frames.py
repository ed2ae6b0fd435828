"""What is compared frame by frame: features, rotations, or places of joints.

The features of the methods that Müller and Röder (2006), section 5.5, compare templates
with. All at 30 Hz, as features are.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features import SEQUENCE_HZ, compute_features
from motionary.motion import GENERIC_JOINTS, Motion, resample
from motionary.rotations import unit_vectors

Floats = NDArray[np.float64]
Removed = Literal["heading", "rotation"]

#: Whose length is 1 after normalising: both thighs and the trunk.
_SEGMENTS = (("lhip", "lknee"), ("rhip", "rknee"), ("root", "neck"))


def feature_frames(motion: Motion) -> Floats:
    """The 40 features of a motion, shape (frames, 40): 0, 1, or NaN where unknown."""
    packed = compute_features(motion)
    frames = packed.features.astype(np.float64)
    frames[packed.known_features == 0] = np.nan
    return frames


def rotation_frames(motion: Motion) -> Floats:
    """Local rotations of all joints but the roots, shape (frames, joints, 4), wxyz.

    Roots are left out: they say where the body faces.

    Raises
    ------
    InvalidInput
        If the file had no rotations.
    """
    if motion.rotations is None or motion.skeleton is None:
        raise InvalidInput(
            f"{motion.source or 'motion'}: quaternions need local rotations, as AMC and BVH "
            "files have them; compare positions instead"
        )
    rotations = motion.rotations[:, motion.skeleton.parents >= 0]
    # Between frames signs must agree: a quaternion and its negative are one rotation.
    agree = np.sign(np.einsum("fji,fji->fj", rotations[1:], rotations[:-1]))
    signs = np.concatenate([np.ones_like(agree[:1]), np.cumprod(np.where(agree < 0, -1, 1), 0)])
    steady = rotations * signs[..., np.newaxis] if len(agree) else rotations
    frames = resample(steady, rate_hz=motion.rate_hz, to_hz=SEQUENCE_HZ)
    unit: Floats = frames / np.linalg.norm(frames, axis=-1, keepdims=True)
    return unit


def position_frames(motion: Motion, *, removed: Removed = "heading") -> Floats:
    """Generic joints seen from the root, shape (frames, 24, 3), NaN where not seen.

    Parameters
    ----------
    motion : Motion
    removed : "heading" turns each frame about the vertical until the hips lie along x;
        "rotation" turns the whole frame of root, hips and belly upright, as in print: then
        nothing tells lying from standing

    Returns
    -------
    array
        In units of the body: the mean of both thighs and the trunk, its median over the
        frames, is 1.

    Raises
    ------
    InvalidInput
        If root, hips or what gives the size are never seen, or `removed` is neither.
    """
    if removed not in ("heading", "rotation"):
        raise InvalidInput(f"removed must be 'heading' or 'rotation', got {removed!r}")
    places = resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=SEQUENCE_HZ)
    axes = body_axes(places, removed=removed)
    return to_body(places, centre=_joint(places, "root"), axes=axes, size=body_size(places))


def body_axes(places: Floats, *, removed: Removed) -> Floats:
    """Axes of the body in each frame, shape (frames, 3, 3), rows right, up and back."""
    right = _joint(places, "rhip") - _joint(places, "lhip")
    up = np.zeros_like(right)
    up[:, 1] = 1.0
    if removed == "rotation":
        up = _joint(places, "belly") - _joint(places, "root")
        right = unit_vectors(right)
        up = unit_vectors(up - np.sum(up * right, axis=1, keepdims=True) * right)
    else:
        right[:, 1] = 0.0
        right = unit_vectors(right)
    return np.stack([right, up, np.cross(right, up)], axis=1)


def body_size(places: Floats) -> float:
    """Median over the frames of the mean length of thighs and trunk, metres."""
    lengths = np.mean(
        [np.linalg.norm(_joint(places, a) - _joint(places, b), axis=1) for a, b in _SEGMENTS],
        axis=0,
    )
    seen = lengths[np.isfinite(lengths) & (lengths > 0)]
    if not len(seen):
        raise InvalidInput(
            "positions are normalised by thighs and trunk, and no frame shows hips, knees, "
            "root and neck together"
        )
    return float(np.median(seen))


def to_body(places: Floats, *, centre: Floats, axes: Floats, size: float) -> Floats:
    """Places (frames, ..., 3) from a centre (frames, 3), along axes, by a size."""
    spread = centre.reshape(len(centre), *[1] * (places.ndim - 2), 3)
    seen: Floats = np.einsum("f...i,fki->f...k", places - spread, axes) / size
    return seen


def _joint(places: Floats, joint: str) -> Floats:
    track: Floats = places[:, GENERIC_JOINTS.index(joint)]
    return track
