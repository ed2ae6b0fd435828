"""Which way is up in a file, and how is a recording turned so that y is up?

By the body: now and then in a recording the head (or what is seen of the trunk) is above
the feet. A body that lies or crouches all the time does not tell.
"""

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.motion import GENERIC_JOINTS

Floats = NDArray[np.float64]

#: Axis that points up, and the file's axes (with signs) that become x, y and z.
_TURNS: dict[str, tuple[tuple[int, int], ...]] = {
    "x": ((1, -1), (0, 1), (2, 1)),
    "y": ((0, 1), (1, 1), (2, 1)),
    "z": ((0, 1), (2, 1), (1, -1)),
    "-x": ((1, 1), (0, -1), (2, 1)),
    "-y": ((0, 1), (1, -1), (2, -1)),
    "-z": ((0, 1), (2, -1), (1, 1)),
}
UPS = tuple(_TURNS)

# Cosine: who stands along an axis has the head within 37 degrees of it, above the feet.
_CLEAR = 0.8
_NOW_AND_THEN = 0.1
_HIGH = ("headtop", "head", "neck", "chest")
_LOW = ("ltoes", "rtoes", "lankle", "rankle")


def check_up(up: str) -> str:
    """The name of an axis, lower case, without a plus.

    Raises
    ------
    InvalidInput
        If it names none.
    """
    axis = up.strip().lower().removeprefix("+")
    if axis not in _TURNS:
        raise InvalidInput(f"up must be one of {', '.join(UPS)}, got {up!r}")
    return axis


def turn_up(positions: Floats, up: str) -> Floats:
    """Positions with y up, of positions in which `up` is; right-handed stays right-handed.

    Parameters
    ----------
    positions : array, shape (..., 3)
    up : one of `UPS`
    """
    axes = _TURNS[check_up(up)]
    if up == "y":
        return positions
    result = np.empty_like(positions)
    for i, (axis, sign) in enumerate(axes):
        np.multiply(positions[..., axis], sign, out=result[..., i])
    return result


def turn_back(positions: Floats, up: str) -> Floats:
    """The inverse of `turn_up`."""
    result = np.empty_like(positions)
    for i, (axis, sign) in enumerate(_TURNS[check_up(up)]):
        np.multiply(positions[..., i], sign, out=result[..., axis])
    return result


def standing_shares(generic: Floats) -> dict[str, float]:
    """Share of frames in which the body stands along each axis; empty if none is seen.

    Parameters
    ----------
    generic : array, shape (frames, 24, 3), generic joints in any unit, NaN = not seen
    """
    low = _mean_of(generic, _LOW)
    for joints in (_HIGH, ("root", "lhip", "rhip")):
        along = _mean_of(generic, joints) - low
        along = along[~np.isnan(along).any(axis=1)]
        if len(along):
            break
    else:
        return {}
    cosines = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    shares = {}
    for i, letter in enumerate("xyz"):
        shares[letter] = float((cosines[:, i] > _CLEAR).mean())
        shares[f"-{letter}"] = float((cosines[:, i] < -_CLEAR).mean())
    return shares


def detect_up(generic: Floats, *, usual: str) -> str | None:
    """The axis along which the body stands, or None if it does not tell.

    Parameters
    ----------
    generic : as in `standing_shares`
    usual : axis of the format; it counts if the body stands along it now and then, as who
        lies on the floor stands along another one
    """
    shares = standing_shares(generic)
    if not shares or max(shares.values()) < _NOW_AND_THEN:
        return None
    if shares[usual] >= _NOW_AND_THEN:
        return usual
    return max(shares, key=lambda axis: shares[axis])


def _mean_of(generic: Floats, joints: tuple[str, ...]) -> Floats:
    """Mean over those of the joints that are ever seen."""
    places = [GENERIC_JOINTS.index(joint) for joint in joints]
    seen = [place for place in places if not np.isnan(generic[:, place]).all()]
    if not seen:
        return np.full((len(generic), 3), np.nan)
    result: Floats = generic[:, seen].mean(axis=1)
    return result
