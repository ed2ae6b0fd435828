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
from motionary.features.quantities import Body, Floats, body_length

Comparison = Literal[">", ">=", "<", "<=", "within"]
Threshold = float | tuple[float, float]

UNITS = (
    "humerus", "left humerus", "shoulder width", "hip width", "chest to neck",
    "body height", "degree",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Relation:
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
    window_s : velocities are averaged over so many seconds; 0 = one frame
    sentence : what is tested, in words
    mirror : `id` of the relation with left and right exchanged; its own if symmetric
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

    def __post_init__(self) -> None:
        if self.unit not in UNITS:
            raise InvalidInput(f"{self.id}: unit must be one of {', '.join(UNITS)}")
        if (self.test == "within") != isinstance(self.weak, tuple):
            raise InvalidInput(f"{self.id}: only 'within' takes pairs of thresholds")
        if not self.mirror:
            object.__setattr__(self, "mirror", self.id)

    def measure(self, body: Body) -> Floats:
        """The quantity in units of the relation, shape (frames,); NaN = unknown."""
        return self.quantity(body, self.window_s, *self.joints) / body_length(body, self.unit)


def holds(value: Floats, test: Comparison, threshold: Threshold) -> NDArray[np.bool_]:
    """Where a quantity passes a test; NaN passes none."""
    with np.errstate(invalid="ignore"):
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
    """A named, ordered set of relations.

    Attributes
    ----------
    name : written into every file, so that sets are never mixed
    relations : in the order of the bits
    """

    name: str
    relations: tuple[Relation, ...]

    def __post_init__(self) -> None:
        ids = self.ids
        if len(set(ids)) != len(ids):
            raise InvalidInput(f"feature set {self.name!r}: ids must be unique")
        stray = [r.id for r in self.relations if r.mirror not in ids]
        if stray:
            raise InvalidInput(f"feature set {self.name!r}: no mirror partner for {stray}")

    def __len__(self) -> int:
        return len(self.relations)

    @property
    def ids(self) -> tuple[str, ...]:
        """Short names, in the order of the bits."""
        return tuple(r.id for r in self.relations)

    @property
    def names(self) -> tuple[str, ...]:
        """Phrases, in the order of the bits."""
        return tuple(r.name for r in self.relations)

    @cached_property
    def mirror_order(self) -> NDArray[np.intp]:
        """Where each relation comes from when left and right are exchanged."""
        index = {r.id: i for i, r in enumerate(self.relations)}
        return np.array([index[r.mirror] for r in self.relations], dtype=np.intp)

    def select(self, ids: Sequence[str], *, name: str) -> "FeatureSet":
        """The named relations as a set of their own."""
        index = {r.id: r for r in self.relations}
        unknown = [i for i in ids if i not in index]
        if unknown:
            raise InvalidInput(f"no relation {unknown[0]!r} in {self.name!r}; it has {self.ids}")
        return FeatureSet(name, tuple(index[i] for i in ids))
