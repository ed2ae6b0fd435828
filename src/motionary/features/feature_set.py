"""Features, sets of them, how they are found by name and written down.

A `Feature` turns a measured quantity into yes or no with two thresholds: it becomes
true where the strong test becomes true and stays so until the weak test fails.

A feature is data but for its quantity; quantities of this package go by their names, so that
another program has the same: rows of strings, numbers and lists, as TOML and JSON have them.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from motionary.errors import InvalidInput, check_choice
from motionary.features import quantities
from motionary.features.body import LENGTHS, Body, Floats
from motionary.motion import GENERIC_JOINTS
from motionary.recording import find_runs
from motionary.tables import near_names

Comparison = Literal[">", ">=", "<", "<=", "within"]
Threshold = float | tuple[float, float]
Bools = NDArray[np.bool_]

DEGREE = "degree"
UNITS = (*LENGTHS, DEGREE)

#: Fields that later files have; left out where a feature has none.
_OPTIONAL = ("no",)
_KINDS: dict[str, tuple[type, ...]] = {
    "joints": (list,),
    "weak": (int, float, list),
    "strong": (int, float, list),
    "window_s": (int, float),
}
_TESTS = (">", ">=", "<", "<=", "within")
#: Velocities in the room, and those that are if they are relative to no joint.
_ABSOLUTE = (quantities.speed, quantities.travel, quantities.fastest, quantities.mean_speed)
_RELATIVE = (quantities.move_ahead, quantities.move_left, quantities.move_up)


@dataclass(frozen=True, slots=True)
class Feature:
    """One yes/no feature of the body.

    Attributes
    ----------
    id : short name, unique in its set ("F13")
    name : phrase that holds when the feature does ("right hand fast")
    group : part of the body ("upper", "lower", "mix")
    quantity : function (body, window_s, *joints) -> (frames,), see `quantities`
    joints : generic joints, in the order that the quantity takes them
    test : how the quantity is compared with the thresholds
    weak, strong : thresholds in `unit`; a pair (least, most) for "within"
    unit : a length of the body, or degree; per second where the quantity is a velocity
    sentence : what is tested, in words
    window_s : velocities are averaged over so many seconds; 0 = one frame
    mirror : `id` of the feature with left and right exchanged; its own if symmetric
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
        check_choice(self.unit, UNITS, name=f"{self.id}: unit")
        if not 0 <= self.window_s < float("inf"):
            raise InvalidInput(f"{self.id}: window_s must be at least 0, got {self.window_s}")
        _check_thresholds(self)
        if not self.mirror:
            object.__setattr__(self, "mirror", self.id)

    def phrase(self, holds: bool) -> str:
        """What a body shows while the feature holds, or while it does not."""
        return self.name if holds else self.no or f"not {self.name}"

    def measure(self, body: Body) -> Floats:
        """The quantity in units of the feature, shape (frames,); NaN = unknown."""
        value = self.quantity(body, self.window_s, *self.joints)
        if np.shape(value) != (body.n_frames,):
            raise InvalidInput(
                f"{self.id}: its quantity must give one value a frame, shape "
                f"({body.n_frames},), got {np.shape(value)}"
            )
        return value if self.unit == DEGREE else body.in_units(value, self.unit)


_FIELDS = tuple(field.name for field in fields(Feature))


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


def hysteresis(
    strong: Bools,
    weak: Bools,
    known: Bools,
    *,
    before: bool = False,
    starts: tuple[int, ...] = (0,),
) -> Bools:
    """State of a two-threshold switch.

    As what passes the strong test passes the weak one too, the switch is on after a
    strong frame until the weak test fails.

    Parameters
    ----------
    strong, weak, known : arrays, shape (frames,)
    before : state before a recording; of a stream, the last state so far
    starts : first frame of each recording

    Returns
    -------
    array, shape (frames,), bool; False where not known
    """
    on = strong & known
    off = ~(weak & known)
    has_event = on | off
    on &= ~off
    # A recording begins as what was before it ended.
    first = list(starts)
    on[first] |= before & ~has_event[first]
    has_event[first] = True
    begins, ends = find_runs(~has_event).T
    on[~has_event] = np.repeat(on[begins - 1], ends - begins)
    return on


@dataclass(frozen=True)
class FeatureSet:
    """A named, ordered set of features, of any number.

    Attributes
    ----------
    name : written into every file, so that sets are never mixed
    features : in the order of the bits
    """

    name: str
    features: tuple[Feature, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "features", tuple(self.features))
        if not self.name or not self.features:
            raise InvalidInput("a feature set needs a name and at least one feature")
        for feature in self.features:
            _check_joints(feature)
        mirrors = {feature.id: feature.mirror for feature in self.features}
        if len(mirrors) != len(self):
            raise InvalidInput(f"feature set {self.name!r}: ids must be unique")
        stray = [i for i, mirror in mirrors.items() if mirrors.get(mirror) != i]
        if stray:
            raise InvalidInput(
                f"feature set {self.name!r}: the mirror of {stray[0]!r} must be a feature of the "
                f"set that names {stray[0]!r} as its own mirror, got {mirrors[stray[0]]!r}"
            )

    def __repr__(self) -> str:
        return f"FeatureSet({self.name!r}, {len(self)} features)"

    def __len__(self) -> int:
        return len(self.features)

    @cached_property
    def ids(self) -> tuple[str, ...]:
        """Short names, in the order of the bits."""
        return tuple(r.id for r in self.features)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Phrases, in the order of the bits."""
        return tuple(r.name for r in self.features)

    @cached_property
    def is_of_package(self) -> bool:
        """Whether all quantities are of this package."""
        own = set(_quantities().values())
        return all(feature.quantity in own for feature in self.features)

    @cached_property
    def mirror_order(self) -> NDArray[np.intp]:
        """Where each feature comes from when left and right are exchanged."""
        index = {r.id: i for i, r in enumerate(self.features)}
        return np.array([index[r.mirror] for r in self.features], dtype=np.intp)

    def select(self, ids: Sequence[str], *, name: str) -> "FeatureSet":
        """The named features as a set of their own.

        Raises
        ------
        InvalidInput
            If an id is unknown, or a feature is chosen without its mirror image.
        """
        index = {r.id: r for r in self.features}
        unknown = [i for i in ids if i not in index]
        if unknown:
            raise InvalidInput(
                f"no feature {unknown[0]!r} in {self.name!r}; it has {', '.join(self.ids)}"
            )
        return FeatureSet(name, tuple(index[i] for i in ids))


def find_feature(name: str, feature_set: FeatureSet) -> int:
    """Number of a feature by its id or its phrase.

    Raises
    ------
    InvalidInput
        If the set has none of that name, or several; says which come nearest.
    """
    wanted = _even(name)
    for known in (feature_set.ids, feature_set.names):
        places = [i for i, other in enumerate(known) if _even(other) == wanted]
        if len(places) > 1:
            ids = ", ".join(feature_set.ids[i] for i in places)
            raise InvalidInput(f"{name!r} may be each of {ids}; write the id")
        if places:
            return places[0]
    raise InvalidInput(f"{feature_set.name} has no feature {name!r}; {_hint(wanted, feature_set)}")


def needs_travel(feature: Feature) -> bool:
    """Whether a feature asks how fast a joint moves through the room.

    Where a body is kept in place, such features are lost. Of the 40 these are F25, F26 and
    F39, and F13 and F14: a hand that is fast because its body walks is slow on the spot.
    """
    if feature.quantity in _RELATIVE:
        return len(feature.joints) == 1
    return feature.quantity in _ABSOLUTE


def describe_set(feature_set: FeatureSet) -> list[dict[str, Any]] | None:
    """Rows that `set_from_rows` reads; None if a quantity is not of this package."""
    if not feature_set.is_of_package:
        return None
    named = {function: name for name, function in _quantities().items()}
    rows = []
    for feature in feature_set.features:
        row = {name: getattr(feature, name) for name in _FIELDS}
        row = {key: v for key, v in row.items() if v or key not in _OPTIONAL}
        row |= {key: list(v) for key, v in row.items() if isinstance(v, tuple)}
        rows.append(row | {"quantity": named[feature.quantity]})
    return rows


def set_from_rows(name: str, rows: Sequence[Mapping[str, Any]]) -> FeatureSet:
    """Set of features that rows describe.

    Raises
    ------
    InvalidInput
        If a row lacks something or says something impossible; names feature and field.
    """
    return FeatureSet(name, tuple(_feature(i, row) for i, row in enumerate(rows)))


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


def _hint(wanted: str, feature_set: FeatureSet) -> str:
    """The names that come nearest: by their letters, else by their words."""
    near = near_names(wanted, feature_set.names)
    if near:
        return f"did you mean {' or '.join(map(repr, near))}?"
    return f"it has {', '.join(feature_set.names)}"


def _even(name: str) -> str:
    return " ".join(name.split()).casefold()


def _feature(number: int, row: Mapping[str, Any]) -> Feature:
    where = f"feature {row.get('id', number + 1)!r}"
    missing = [name for name in _FIELDS if name not in row and name not in _OPTIONAL]
    if missing:
        raise InvalidInput(f"{where}: {missing[0]} is missing")
    values = {name: row[name] for name in _FIELDS if name in row}
    for name, value in values.items():
        if not isinstance(value, _KINDS.get(name, (str,))) or isinstance(value, bool):
            raise InvalidInput(f"{where}: {name} has no meaning as {value!r}")
    known = _quantities()
    if values["quantity"] not in known:
        raise InvalidInput(
            f"{where}: no quantity {values['quantity']!r}; known: {', '.join(known)}"
        )
    if values["test"] not in _TESTS:
        raise InvalidInput(f"{where}: test must be one of {', '.join(_TESTS)}")
    values["quantity"] = known[values["quantity"]]
    values["joints"] = tuple(values["joints"])
    for name in ("weak", "strong"):
        values[name] = _threshold(where, name, values[name])
    _check_arguments(where, values["quantity"], values["joints"])
    return Feature(**values)


def _threshold(where: str, name: str, value: Any) -> float | tuple[float, float]:
    if not isinstance(value, list):
        return float(value)
    if len(value) != 2 or not all(isinstance(v, int | float) for v in value):
        raise InvalidInput(f"{where}: {name} must be a number, or a pair [least, most]")
    return float(value[0]), float(value[1])


def _check_arguments(where: str, quantity: Any, joints: tuple[Any, ...]) -> None:
    try:
        inspect.signature(quantity).bind(None, 0.0, *joints)
    except TypeError as error:
        raise InvalidInput(f"{where}: its quantity takes other joints ({error})") from error


def _quantities() -> dict[str, Any]:
    """Quantities of the package by name: public functions of a body."""
    return {
        name: function
        for name, function in vars(quantities).items()
        if inspect.isfunction(function)
        and function.__module__ == quantities.__name__
        and not name.startswith("_")
    }
