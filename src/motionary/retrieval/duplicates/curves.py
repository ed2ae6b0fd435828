"""Do two recordings show one performance, or two of the same?

A person repeats a motion so well that relations change alike; how the acceleration of the
joints changes, 0.1 s at a time, is never the same twice. Compared are angles that hardly
depend on the rig: at elbows, knees, shoulders and hips, between the limbs, and of the trunk.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from motionary.motion import GENERIC_JOINTS, Motion, resample

Floats = NDArray[np.float64]

RATE_HZ = 120.0
#: Curves of the mirrored motion: left and right exchanged.
MIRROR_ORDER = np.array([4, 5, 6, 7, 0, 1, 2, 3, 8, 9, 10])

_SMOOTHED = 11
_DIFFERENCES = 3
_SHORTEST = 48
_JOINT = {name: i for i, name in enumerate(GENERIC_JOINTS)}


def curves_of(motion: Motion) -> Floats:
    """Angles in radians at 120 Hz, shape (frames, 11); NaN where a joint is not seen."""
    positions = resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=RATE_HZ)

    def direction(a: str, b: str) -> Floats:
        vector = positions[:, _JOINT[b]] - positions[:, _JOINT[a]]
        length = np.linalg.norm(vector, axis=1, keepdims=True)
        return np.asarray(vector / np.where(length > 0, length, np.nan))

    trunk = direction("root", "neck")
    bones = {
        (side, name): direction(side + a, side + b) for side, (name, a, b) in product("lr", _BONES)
    }
    curves = []
    for side in "lr":
        arm, forearm, thigh, shin = (bones[side, name] for name, _, _ in _BONES)
        curves += [_angle(arm, forearm), _angle(thigh, shin)]
        curves += [_angle(trunk, arm), _angle(trunk, thigh)]
    up = np.broadcast_to([0.0, 1.0, 0.0], trunk.shape)
    curves.append(_angle(trunk, up))
    curves += [_angle(bones["l", name], bones["r", name]) for name in ("thigh", "arm")]
    return np.stack(curves, axis=1)


_BONES = (
    ("arm", "shoulder", "elbow"),
    ("forearm", "elbow", "wrist"),
    ("thigh", "hip", "knee"),
    ("shin", "knee", "ankle"),
)


def agreement(left: Floats, right: Floats, offset: int, *, within: int) -> tuple[float, int]:
    """How well the changes of acceleration agree, and at which offset near the given one.

    Parameters
    ----------
    left, right : curves
    offset : frame of the left curves at which the right ones begin
    within : frames around it that are tried

    Returns
    -------
    agreement : mean over the curves of the correlation of their third differences, at
        most 1; 0 where too little is seen of both
    offset : where it is best
    """
    best = (0.0, offset)
    for at in range(offset - within, offset + within + 1):
        first, last = max(0, at), min(len(left), len(right) + at)
        if last - first >= _SHORTEST:
            value = _correlate(left[first:last], right[first - at : last - at])
            best = max(best, (value, at))
    return best


def _correlate(left: Floats, right: Floats) -> float:
    a, b = _jerks(left), _jerks(right)
    seen = np.isfinite(a) & np.isfinite(b)
    enough = seen.sum(axis=0) >= _SHORTEST // 2
    if enough.sum() * 2 < len(enough):
        return 0.0
    a, b = np.where(seen, a, 0.0)[:, enough], np.where(seen, b, 0.0)[:, enough]
    power = np.sqrt((a**2).sum(axis=0) * (b**2).sum(axis=0))
    return float(np.mean((a * b).sum(axis=0) / np.where(power > 0, power, 1.0)))


def _jerks(curves: Floats) -> Floats:
    window = np.hanning(_SMOOTHED + 2)[1:-1]
    window /= window.sum()
    smooth = np.stack([np.convolve(curve, window, "valid") for curve in curves.T], axis=1)
    return np.asarray(np.diff(smooth, n=_DIFFERENCES, axis=0))


def _angle(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.arccos(np.clip((a * b).sum(axis=1), -1.0, 1.0)))
