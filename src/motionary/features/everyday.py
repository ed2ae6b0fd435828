"""The set of features that search between people and styles stands on.

The 40 published features first, in the same bits; behind them 102 quantities of the body, each
with four thresholds: the quantiles .2, .4, .6 and .8 of everyday motion of CMU and of exercises
of UI-PRMD, mirror images included. How many of the four differ is how far two ranks lie apart,
so that the Hamming distance compares quantities by their ranks. `recipes/quantiles.py` makes
the thresholds.

Conventions: ids are the quantity and which part of the frames passes, in percent:
"rwrist ahead of root>80" holds in a fifth of the frames.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from motionary.features import quantities as q
from motionary.features.body import Body, Floats
from motionary.features.catalogue import FULL_BODY, FULL_BODY_2006, LEGS, THREE_LEVELS
from motionary.features.feature_set import DEGREE, Comparison, Feature, FeatureSet

QUANTILES = (20, 40, 60, 80)
THRESHOLDS = Path(__file__).with_name("everyday_quantiles.json")
#: Of the whole body through the room: what tells a walk to the left from one ahead.
TRAVEL = "travel"

_SIDES = {"l": "left", "r": "right"}
_SPEED_S = 0.1
_MOVE_S = 0.15
_FAST = ("lwrist", "rwrist", "lankle", "rankle", "head", "root")


class Quantity(NamedTuple):
    """One quantity of a body, measured in humeri or degrees.

    Attributes
    ----------
    name, mirror : phrase, and that of the quantity with left and right exchanged
    group : part of the body, or "travel"
    function, joints, window_s, unit : as of a feature
    is_signed : whether its mirror image is its negative
    """

    name: str
    mirror: str
    group: str
    function: Callable[..., Floats]
    joints: tuple[str, ...]
    window_s: float = 0.0
    unit: str = "humerus"
    is_signed: bool = False

    @property
    def threshold_key(self) -> str:
        """Name that both sides share."""
        return self.name.replace("left ", "").replace("right ", "") if self.is_sided else self.name

    def measure(self, body: Body) -> Floats:
        """The quantity in its unit, shape (frames,); NaN = unknown."""
        value = self.function(body, self.window_s, *self.joints)
        return value if self.unit == DEGREE else body.in_units(value, self.unit)

    @property
    def is_sided(self) -> bool:
        """Whether there is another of the other side."""
        return self.name != self.mirror


@cache
def load_everyday_set() -> FeatureSet:
    """The set: 448 features, of which the first 40 are the published ones."""
    thresholds = json.loads(THRESHOLDS.read_text(encoding="utf-8"))["thresholds"]
    steps = [
        step
        for quantity in list_quantities()
        for step in _steps(quantity, thresholds[quantity.threshold_key])
    ]
    return FeatureSet(f"everyday-{len(FULL_BODY) + len(steps)}", (*FULL_BODY.features, *steps))


def known_sets() -> Mapping[str, FeatureSet]:
    """Sets that files may name without saying what is in them."""
    sets = (FULL_BODY, FULL_BODY_2006, LEGS, THREE_LEVELS, load_everyday_set())
    return MappingProxyType({one.name: one for one in sets})


@cache
def list_quantities() -> tuple[Quantity, ...]:
    """The quantities, in the order of their bits."""
    return (*_places(), *_moves(), *_postures(), *_travels())


def _places() -> Iterator[Quantity]:
    """Where joints are, seen from the root or the shoulder."""
    for part in ("wrist", "elbow", "knee", "ankle", "toes"):
        yield from _sided(f"{part} ahead of the root", q.ahead, part, "root")
        yield from _sided(f"{part} out to its side of the root", q.outward, part, "root")
        yield from _sided(f"{part} above the root", q.above, part, "root")
    yield _middle("head ahead of the root", "mix", q.ahead, "head", "root")
    yield _middle("head to the left of the root", "mix", q.to_left, "head", "root", signed=True)
    yield _middle("head above the root", "mix", q.above, "head", "root")
    yield _middle("neck above the root", "mix", q.above, "neck", "root")
    for way, function in (("ahead of", q.ahead), ("out to the side of", q.outward),
                          ("above", q.above)):  # fmt: skip
        yield from _sided(f"wrist {way} its shoulder", function, "wrist", "shoulder")
    yield from _sided("hand to head", q.distance, "wrist", "head")


def _moves() -> Iterator[Quantity]:
    """How joints move, seen from the root; feet in the room."""
    for part in ("wrist", "elbow", "knee", "ankle"):
        yield from _sided(f"{part} moves ahead", q.move_ahead, part, "root", _MOVE_S)
        yield from _sided(f"{part} moves out to its side", q.move_outward, part, "root", _MOVE_S)
        yield from _sided(f"{part} moves up", q.move_up, part, "root", _MOVE_S)
        yield from _sided(f"{part} speed", q.relative_speed, part, "root", _MOVE_S)
    for part in ("toes", "ankle"):
        yield from _sided(f"{part} speed in the room", q.speed, part, None, _SPEED_S)
    yield _middle("speed of the fastest part", "mix", q.fastest, *_FAST, window_s=_SPEED_S)
    yield _middle("mean speed of the parts", "mix", q.mean_speed, *_FAST, window_s=_SPEED_S)


def _postures() -> Iterator[Quantity]:
    """Heights, leaning, and how far limbs are apart."""
    for joint in ("root", "head"):
        yield _middle(f"{joint} above the feet", "mix", q.above_feet, joint)
    trunk = ("root", "neck")
    yield _middle("trunk leans ahead", "mix", q.lean_ahead, *trunk, unit=DEGREE)
    yield _middle("trunk leans to the left", "mix", q.lean_left, *trunk, unit=DEGREE, signed=True)
    shoulders = ("lshoulder", "rshoulder")
    yield _middle(
        "shoulders turned to the right", "mix", q.twist, *shoulders, unit=DEGREE, signed=True
    )
    yield _middle("hands apart", "upper", q.distance, "lwrist", "rwrist")
    yield _middle("feet apart", "lower", q.distance, "lankle", "rankle")


def _travels() -> Iterator[Quantity]:
    """How the body goes through the room, over different times."""
    ways = (
        ("ahead", q.move_ahead), ("to the left", q.move_left), ("up", q.move_up),
        ("along the floor", q.travel),
    )  # fmt: skip
    for window_s in (0.2, 0.5, 1.0):
        for way, function in ways:
            name = f"body goes {way} over {window_s:g} s"
            is_left = function is q.move_left
            yield _middle(name, TRAVEL, function, "root", window_s=window_s, signed=is_left)
    for window_s in (0.3, 0.6, 1.0):
        name, hips = f"body turns to the left over {window_s:g} s", ("rhip", "lhip")
        yield _middle(
            name, TRAVEL, q.turning_left, *hips, window_s=window_s, unit=DEGREE, signed=True
        )


def _sided(
    name: str, function: Callable[..., Floats], part: str, other: str | None, window_s: float = 0.0
) -> Iterator[Quantity]:
    """The quantity of the left and of the right side."""
    group = "upper" if part in ("wrist", "elbow") else "lower"
    for s, side in _SIDES.items():
        away = "right" if s == "l" else "left"
        origin = f"{s}{other}" if other == "shoulder" else other
        joints = (f"{s}{part}",) if origin is None else (f"{s}{part}", origin)
        yield Quantity(f"{side} {name}", f"{away} {name}", group, function, joints, window_s)


def _middle(
    name: str,
    group: str,
    function: Callable[..., Floats],
    *joints: str,
    window_s: float = 0.0,
    unit: str = "humerus",
    signed: bool = False,
) -> Quantity:
    """A quantity of the whole body; if it is signed, its mirror image is its negative."""
    return Quantity(name, name, group, function, joints, window_s, unit, signed)


def _steps(quantity: Quantity, thresholds: list[float]) -> Iterator[Feature]:
    """A feature for each threshold, so that the mirror image is one of them."""
    for percent, threshold in zip(QUANTILES, thresholds, strict=True):
        below = quantity.is_signed and percent < 50
        sign = "<" if below else ">"
        test: Comparison = "<=" if below else ">="
        mirrored = f"{'<' if sign == '>' else '>'}{100 - percent}"
        passed = percent if below else 100 - percent
        ends = ("lowest", "highest") if below else ("highest", "lowest")
        yield Feature(
            id=f"{quantity.name}{sign}{percent}",
            name=f"{quantity.name}: in the {ends[0]} {passed} %", group=quantity.group,
            quantity=quantity.function, joints=quantity.joints, test=test, weak=threshold,
            strong=threshold, unit=quantity.unit,
            sentence=f"{quantity.name[0].upper()}{quantity.name[1:]}, "
            f"{'less' if below else 'more'} than in {100 - passed} % of everyday motion.",
            window_s=quantity.window_s,
            mirror=f"{quantity.mirror}{mirrored if quantity.is_signed else f'{sign}{percent}'}",
            no=f"{quantity.name}: in the {ends[1]} {100 - passed} %",
        )  # fmt: skip
