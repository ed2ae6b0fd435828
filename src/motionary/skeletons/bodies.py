"""Whether a file holds one person: not several, and no animal."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from motionary.motion import GENERIC_JOINTS, JointMapping, Motion
from motionary.recording import Recording
from motionary.skeletons.words import is_paw, is_tail

Floats = NDArray[np.float64]

# Hips, knees, ankles and a root: with fewer points nothing is a body.
_FEWEST = 7
# An animal's trunk lies across its legs, and its fore legs go down beside them, in nearly
# every frame.
_ACROSS = 0.5
_ALONG = 0.7
_NEARLY_ALL = 0.95
# Trunk by leg: at most .56 in people of all recordings at hand, about 1 or more in dogs and horses.
_LONG_TRUNK = 0.8


def find_people(
    names: tuple[str, ...], is_body: Callable[[tuple[str, ...]], bool]
) -> tuple[str, ...]:
    """What stands before the colon in the names of each person, or the number after them.

    Parameters
    ----------
    names : of all joints
    is_body : whether joints of these names are a body
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        person, _, own = name.rpartition(":")
        number = ""
        if own.endswith(")") and " (" in own:
            own, _, number = own.rpartition(" (")
        groups.setdefault(person or number.rstrip(")"), []).append(own)
    if len(groups) < 2:
        return ()
    return tuple(
        person for person, own in groups.items() if len(own) >= _FEWEST and is_body(tuple(own))
    )


def count_people(names: tuple[str, ...], is_body: Callable[[tuple[str, ...]], bool]) -> int:
    """How many persons names tell apart; 0 where they tell none apart."""
    return len(find_people(names, is_body))


def is_four_legged(mapping: JointMapping, names: tuple[str, ...], positions: Floats) -> bool:
    """Whether a body stands on four legs: an animal under the names of a person.

    Parameters
    ----------
    mapping, names : as in a `Motion`
    positions : array, shape (frames, joints, 3), in any unit and axes
    """
    if sum(is_paw(name) for name in names) > 1:
        return True
    body = Motion(names, positions, Recording(rate_hz=1.0), mapping).generic_positions()
    where = {joint: body[:, i] for i, joint in enumerate(GENERIC_JOINTS)}
    trunk = where["neck"] - where["root"]
    legs = _mean(where, "ankle") - _mean(where, "hip")
    arms = _mean(where, "wrist") - _mean(where, "shoulder")
    across = np.abs(_cosine(trunk, legs)) < _ACROSS
    down = _cosine(arms, legs) > _ALONG
    seen = ~np.isnan(_cosine(trunk, legs) + _cosine(arms, legs))
    if not seen.any() or (across & down)[seen].mean() < _NEARLY_ALL:
        return False
    # Along the bones: a person who bends the knees has no shorter legs.
    leg = sum(
        _length(*(where[side + end] - where[side + start] for side in "lr"))
        for start, end in (("hip", "knee"), ("knee", "ankle"))
    )
    is_long = _length(trunk) > _LONG_TRUNK * leg
    return is_long or any(is_tail(name) for name in names)


def _mean(where: dict[str, Floats], joint: str) -> Floats:
    mean: Floats = (where[f"l{joint}"] + where[f"r{joint}"]) / 2
    return mean


def _length(*ways: Floats) -> float:
    """Median over frames; NaN where nothing is seen."""
    lengths = np.linalg.norm(np.concatenate(ways), axis=1)
    seen = lengths[np.isfinite(lengths)]
    return float(np.median(seen)) if len(seen) else float("nan")


def _cosine(a: Floats, b: Floats) -> Floats:
    lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    cosine: Floats = (a * b).sum(axis=1) / np.maximum(lengths, 1e-12)
    return cosine
