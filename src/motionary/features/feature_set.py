"""What is a relation, and what is a set of them?

A `Relation` turns a measured quantity into yes or no with two thresholds: it becomes
true where the strong test becomes true and stays so until the weak test fails.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput
from motionary.features.body import LENGTHS, Body
from motionary.features.vectors import Floats
from motionary.motion import GENERIC_JOINTS

Comparison = Literal[">", ">=", "<", "<=", "within"]
Threshold = float | tuple[float, float]

DEGREE = "degree"
UNITS = (*LENGTHS, DEGREE)


@dataclass(frozen=True, slots=True)
class Feature:
    """One yes/no relation of the body.

    Attributes
    ----------
    id : short name, unique in its set ("F13")
    name : phrase that holds when the relation does ("right hand fast")
    group : part of the body ("upper", "lower", "mix")
    quantity : function (body, window_s, *joints) -> (frames,), see `quantities`
    joints : generic joints, in the order that the quantity takes them
    test : how the quantity is compared with the thresholds
    weak, strong : thresholds in `unit`; a pair (least, most) for "within"
    unit : a length of the body, or degree; per second where the quantity is a velocity
    sentence : what is tested, in words
    window_s : velocities are averaged over so many seconds; 0 = one frame
    mirror : `id` of the relation with left and right exchanged; its own if symmetric
    no : phrase that holds when the feature does not ("right hand slow"); see `phrase`
    """

    id: str
    name: str
    group: str
    quantity: Callable[..., Floats]
    joints: tuple[str, ...]
    test: Comparison
    weak: Threshold
    strong: Threshold
    unit: str
    sentence: str
    window_s: float = 0.0
    mirror: str = ""
    no: str = ""

    def __post_init__(self) -> None:
        if self.unit not in UNITS:
            raise InvalidInput(
                f"{self.id}: unit must be one of {', '.join(UNITS)}, got {self.unit!r}"
            )
        if not 0 <= self.window_s < float("inf"):
            raise InvalidInput(f"{self.id}: window_s must be at least 0, got {self.window_s}")
        _check_thresholds(self)
        if not self.mirror:
            object.__setattr__(self, "mirror", self.id)

    def phrase(self, holds: bool) -> str:
        """What a body shows while the feature holds, or while it does not."""
        return self.name if holds else self.no or f"not {self.name}"

    def measure(self, body: Body) -> Floats:
        """The quantity in units of the relation, shape (frames,); NaN = unknown."""
        value = self.quantity(body, self.window_s, *self.joints)
        if np.shape(value) != (body.n_frames,):
            raise InvalidInput(
                f"{self.id}: its quantity must give one value a frame, shape "
                f"({body.n_frames},), got {np.shape(value)}"
            )
        return value if self.unit == DEGREE else value / body.length(self.unit)


def _check_thresholds(feature: Feature) -> None:
    weak, strong = feature.weak, feature.strong
    pairs = isinstance(weak, tuple), isinstance(strong, tuple)
    if pairs != ((feature.test == "within"),) * 2:
        raise InvalidInput(
            f"{feature.id}: 'within' takes two pairs of thresholds, other tests two numbers, "
            f"got {feature.test!r}, {weak}, {strong}"
        )
    # What passes the strong test must pass the weak one: the switch relies on it.
    if not holds(np.atleast_1d(strong), feature.test, weak).all():
        raise InvalidInput(
            f"{feature.id}: the strong threshold must lie at or beyond the weak one, "
            f"got weak {weak}, strong {strong} for {feature.test!r}"
        )


def _check_joints(feature: Feature) -> None:
    unknown = [joint for joint in feature.joints if joint not in GENERIC_JOINTS]
    if unknown:
        raise InvalidInput(
            f"{feature.id}: {unknown[0]!r} is no generic joint; "
            f"expected some of {', '.join(GENERIC_JOINTS)}"
        )


def holds(value: Floats, test: Comparison, threshold: Threshold) -> NDArray[np.bool_]:
    """Where a quantity passes a test; NaN passes none."""
    if isinstance(threshold, tuple):
        return np.asarray((value >= threshold[0]) & (value <= threshold[1]))
    if test == ">":
        return np.asarray(value > threshold)
    if test == ">=":
        return np.asarray(value >= threshold)
    if test == "<":
        return np.asarray(value < threshold)
    return np.asarray(value <= threshold)


@dataclass(frozen=True)
class FeatureSet:
    """A named, ordered set of relations, of any number.

    Attributes
    ----------
    name : written into every file, so that sets are never mixed
    relations : in the order of the bits
    """

    name: str
    features: tuple[Feature, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "features", tuple(self.features))
        if not self.name or not self.features:
            raise InvalidInput("a feature set needs a name and at least one relation")
        for feature in self.features:
            _check_joints(feature)
        mirrors = {feature.id: feature.mirror for feature in self.features}
        if len(mirrors) != len(self):
            raise InvalidInput(f"feature set {self.name!r}: ids must be unique")
        stray = [i for i, mirror in mirrors.items() if mirrors.get(mirror) != i]
        if stray:
            raise InvalidInput(
                f"feature set {self.name!r}: the mirror of {stray[0]!r} must be a relation of the "
                f"set that names {stray[0]!r} as its own mirror, got {mirrors[stray[0]]!r}"
            )

    def __len__(self) -> int:
        return len(self.features)

    @property
    def ids(self) -> tuple[str, ...]:
        """Short names, in the order of the bits."""
        return tuple(r.id for r in self.features)

    @property
    def names(self) -> tuple[str, ...]:
        """Phrases, in the order of the bits."""
        return tuple(r.name for r in self.features)

    @cached_property
    def mirror_order(self) -> NDArray[np.intp]:
        """Where each relation comes from when left and right are exchanged."""
        index = {r.id: i for i, r in enumerate(self.features)}
        return np.array([index[r.mirror] for r in self.features], dtype=np.intp)

    def select(self, ids: Sequence[str], *, name: str) -> "FeatureSet":
        """The named relations as a set of their own.

        Raises
        ------
        InvalidInput
            If an id is unknown, or a relation is chosen without its mirror image.
        """
        index = {r.id: r for r in self.features}
        unknown = [i for i in ids if i not in index]
        if unknown:
            raise InvalidInput(
                f"no relation {unknown[0]!r} in {self.name!r}; it has {', '.join(self.ids)}"
            )
        return FeatureSet(name, tuple(index[i] for i in ids))
