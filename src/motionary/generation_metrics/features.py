"""What numbers describe a generated motion: as published, or right at any rate?

`published` gives the 32 numbers of the widespread code, faults included; `corrected` the
40 relations of this package, measured at 120 Hz whatever the rate of the motion, with the
lengths of the body that moves, averaged velocities and two thresholds.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence, compute_features
from motionary.generation_metrics.published import JOINTS, published_features
from motionary.motion import GENERIC_JOINTS, Motion

Floats = NDArray[np.float64]
Mode = Literal["published", "corrected"]

_SMPL = "smpl"


def motion_features(
    motion: Motion | ArrayLike,
    *,
    mode: Mode = "corrected",
    rate_hz: float | None = None,
    skeleton: str | Sequence[str] = _SMPL,
) -> Floats:
    """Shares of the frames of one motion in which each relation holds.

    Parameters
    ----------
    motion : Motion, or array, shape (frames, joints, 3), metres, y up
    mode : "corrected", or "published" for numbers that are equal to those in print
    rate_hz : frames per second, for arrays; the published mode pays no heed to any rate
    skeleton : for arrays, as `compute_features` takes it

    Returns
    -------
    array, shape (40,) corrected or (32,) published
        Corrected, a relation that the skeleton never shows is NaN; published, all joints
        must be seen. Of a Motion whose skeleton has no second spine joint, the published
        mode puts it halfway between its neighbours, where it is never the lowest joint.

    Raises
    ------
    InvalidInput
        If the mode is unknown, or joints, rate or shape do not do for it.
    """
    if mode not in ("published", "corrected"):
        raise InvalidInput(f"mode must be 'published' or 'corrected', got {mode!r}")
    if mode == "published":
        return published_features(_smpl_positions(motion, skeleton))
    if isinstance(motion, Motion):
        return _fractions(compute_features(motion))
    return _fractions(compute_features(motion, rate_hz=rate_hz, skeleton=skeleton))


def _fractions(packed: FeatureSequence) -> Floats:
    known = packed.known_features.sum(axis=0, dtype=np.float64)
    held = (packed.features & packed.known_features).sum(axis=0, dtype=np.float64)
    fractions = np.full(len(known), np.nan)
    np.divide(held, known, out=fractions, where=known > 0)
    return fractions


def _smpl_positions(motion: Motion | ArrayLike, skeleton: str | Sequence[str]) -> ArrayLike:
    if not isinstance(motion, Motion):
        if skeleton != _SMPL:
            raise InvalidInput(
                "published features take arrays in the order of SMPL's 24 joints only, got "
                f"skeleton={skeleton!r}; pass a Motion, or mode='corrected'"
            )
        return motion
    generic = motion.generic_positions()
    belly, chest = (generic[:, GENERIC_JOINTS.index(joint)] for joint in ("belly", "chest"))
    result = np.empty((motion.n_frames, len(JOINTS), 3))
    for i, joint in enumerate(JOINTS):
        if joint in GENERIC_JOINTS:
            result[:, i] = generic[:, GENERIC_JOINTS.index(joint)]
        elif "spine2" in motion.names:
            result[:, i] = motion.positions[:, motion.names.index("spine2")]
        else:
            result[:, i] = (belly + chest) / 2
    return result
