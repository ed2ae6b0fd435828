"""Which sets of relations come with the package?

Beside the 40 published relations: those of the legs alone, and a finer set that asks every
quantity behind the 40 at three levels, for motions that differ by how far or how fast.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from motionary.features import quantities as q
from motionary.features.catalogue import FULL_BODY, FULL_BODY_2006
from motionary.features.feature_set import DEGREE, Comparison, Feature, FeatureSet, Threshold

#: Suffix of the id, of the phrases for yes and for no, and by how many steps the thresholds
#: are harder: what is not even slightly bent is clearly straight.
_LEVELS = (
    ("-", " (slightly)", " (clearly)", -1),
    ("", "", "", 0),
    ("+", " (very)", " (more or less)", 1),
)
_VELOCITIES = (q.move_plane, q.move_along, q.move_against, q.speed, q.turning)
#: A step: share of a velocity; else degrees, or lengths in the relation's unit.
_VELOCITY_STEP = 0.5
_LENGTH_STEP = 0.3
_STEPS = {DEGREE: 20.0, "body height": 0.1}


def known_sets() -> Mapping[str, FeatureSet]:
    """Sets that files may name without saying what is in them."""
    sets = (FULL_BODY, FULL_BODY_2006, LEGS, THREE_LEVELS)
    return MappingProxyType({one.name: one for one in sets})


def _one_threshold_each(feature: Feature) -> list[Feature]:
    """Relations of one quantity and one threshold that together are the given one."""
    if feature.quantity is q.speed and len(feature.joints) == 2:
        side = feature.name.partition(" ")[0]
        return [
            replace(
                feature,
                id=f"{feature.id}{joint[1]}",
                mirror=f"{feature.mirror}{joint[1]}",
                name=f"{side} {joint[1:]} fast",
                joints=(joint,),
                sentence=f"The {side} {joint[1:]} moves fast.",
                no=f"{side} {joint[1:]} slow",
            )
            for joint in feature.joints
        ]
    if isinstance(feature.weak, tuple) and isinstance(feature.strong, tuple):
        ends: tuple[tuple[Comparison, str, str, str], ...] = (
            (">=", "spine far from upright", "spine near upright",
             "The spine is turned far from upright."),
            ("<=", "neck above the root", "neck far below the root",
             "The neck is not far below the root."),
        )  # fmt: skip
        return [
            replace(
                feature, id=f"{feature.id}{'ab'[i]}", mirror=f"{feature.id}{'ab'[i]}",
                name=name, no=no, sentence=sentence, test=test,
                weak=feature.weak[i], strong=feature.strong[i],
            )
            for i, (test, name, no, sentence) in enumerate(ends)
        ]  # fmt: skip
    return [feature]


def _at_levels(feature: Feature) -> list[Feature]:
    return [
        replace(
            feature,
            id=feature.id + sign,
            mirror=feature.mirror + sign,
            name=feature.name + yes,
            no=feature.no + no,
            weak=_moved(feature.weak, feature, steps),
            strong=_moved(feature.strong, feature, steps),
        )
        for sign, yes, no, steps in _LEVELS
    ]


def _moved(threshold: Threshold, feature: Feature, steps: int) -> Threshold:
    """A threshold that is harder to pass by so many steps, or easier."""
    if isinstance(threshold, tuple):
        return threshold
    if feature.quantity in _VELOCITIES:
        return round(threshold * (1 + _VELOCITY_STEP * steps), 6)
    harder = 1 if feature.test in (">", ">=") else -1
    return round(threshold + harder * steps * _STEPS.get(feature.unit, _LENGTH_STEP), 6)


LEGS = FULL_BODY.select(
    [r.id for r in FULL_BODY.features if r.group == "lower" or r.id in ("F39", "F40")],
    name="legs-14",
)
THREE_LEVELS = FeatureSet(
    "three-levels-129",
    tuple(
        level
        for feature in FULL_BODY.features
        for single in _one_threshold_each(feature)
        for level in _at_levels(single)
    ),
)
