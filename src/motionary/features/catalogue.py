"""The 40 published relational features, and the sets that come with the package.

Müller and Röder (2006), table 6, F1 to F39; F40 after Müller, Baak and Seidel (2009),
section 3. Thresholds are those of the authors' programs, weak before strong. As there, the
right arm, or the left one, measures both sides, and F1 and F2 count from the left hip: the
mirror image of a feature is exact on a symmetric body whose hips keep their direction.

To add one: write a `Feature` with a quantity of `quantities`, or a function of your own
with the same arguments, and put it into a `FeatureSet` of another name. The fields, in
the sequence used here: id, name, group, quantity, joints, test, weak, strong, unit,
sentence.

Beside the 40 stand those of the legs alone, and a finer set that asks every quantity behind
the 40 at three levels, for motions that differ by how far or how fast.
"""

from dataclasses import replace

from motionary.features import quantities as q
from motionary.features.feature_set import DEGREE, Comparison, Feature, FeatureSet, Threshold

#: Suffix of the id, of the phrases for yes and for no, and by how many steps the thresholds
#: are harder: what is not even slightly bent is clearly straight.
_LEVELS = (
    ("-", " (slightly)", " (clearly)", -1),
    ("", "", "", 0),
    ("+", " (very)", " (more or less)", 1),
)
_VELOCITIES = (q.move_plane, q.move_along, q.move_against, q.speed, q.turning)
#: A step: fraction of a velocity; else degrees, or lengths in the feature's unit.
_VELOCITY_STEP = 0.5
_LENGTH_STEP = 0.3
_STEPS = {DEGREE: 20.0, "body height": 0.1}


def _both(pattern: Feature) -> list[Feature]:
    """The feature of the right and of the left side: {side} and {s} are filled in."""

    def fill(id: str, mirror: str, side: str) -> Feature:
        joints = tuple(joint.format(s=side[0]) for joint in pattern.joints)
        phrases = {
            key: getattr(pattern, key).format(side=side) for key in ("name", "sentence", "no")
        }
        return replace(pattern, id=id, mirror=mirror, joints=joints, **phrases)

    right, left = pattern.id, pattern.mirror
    return [fill(right, left, "right"), fill(left, right, "left")]


_UPPER = [
    *_both(Feature(
        "F1", "{side} hand moves forward", "upper",
        q.move_plane, ("neck", "rhip", "lhip", "{s}wrist"), ">", 1.3, 1.8, "left humerus",
        "The {side} wrist moves forward, away from the plane of neck and hips.",
        window_s=0.25, mirror="F2",
        no="{side} hand stays or moves back",
    )),
    *_both(Feature(
        "F3", "{side} hand above neck", "upper",
        q.along, ("chest", "neck", "neck", "{s}wrist"), ">=", 0.0, 0.2, "chest to neck",
        "The {side} wrist lies beyond the neck, seen along the spine.", mirror="F4",
        no="{side} hand below neck",
    )),
    *_both(Feature(
        "F5", "{side} hand moves up", "upper",
        q.move_along, ("chest", "neck", "neck", "{s}wrist"), ">", 1.3, 1.8, "left humerus",
        "The {side} wrist moves up along the spine, relative to the neck.",
        window_s=0.25, mirror="F6",
        no="{side} hand stays or moves down",
    )),
    *_both(Feature(
        "F7", "{side} elbow bent", "upper",
        q.angle, ("{s}elbow", "{s}shoulder", "{s}elbow", "{s}wrist"),
        "<=", 120.0, 110.0, "degree",
        "The angle at the {side} elbow is small.", mirror="F8",
        no="{side} elbow straight",
    )),
    Feature(
        "F9", "hands far apart", "upper",
        q.reach, ("lshoulder", "rshoulder", "lwrist", "rwrist"), ">=", 2.0, 2.5,
        "shoulder width", "The wrists are far apart, seen along the line of the shoulders.",
        no="hands near each other",
    ),
    Feature(
        "F10", "hands approach each other", "upper",
        q.move_along, ("lwrist", "rwrist", "rwrist", "lwrist"), ">=", 1.2, 1.4, "humerus",
        "The left wrist moves towards the right one.", window_s=0.1,
        no="hands stay or move apart",
    ),
    *_both(Feature(
        "F11", "{side} hand moves away from the body", "upper",
        q.move_along, ("root", "{s}wrist", "root", "{s}wrist"), ">=", 1.2, 1.4, "humerus",
        "The {side} wrist moves away from the root.", mirror="F12",
        no="{side} hand stays or moves towards the body",
    )),
    *_both(Feature(
        "F13", "{side} hand fast", "upper",
        q.speed, ("{s}fingers",), ">=", 2.0, 2.5, "humerus",
        "The fingers of the {side} hand move fast.", window_s=0.1, mirror="F14",
        no="{side} hand slow",
    )),
]  # fmt: skip

_LOWER = [
    Feature(
        "F15", "right foot behind left leg", "lower",
        q.plane, ("root", "lhip", "lankle", "rankle"), ">=", 0.0, 0.375, "humerus",
        "The right ankle is behind the plane of the left leg.", mirror="F16",
        no="right foot level with or ahead of left leg",
    ),
    Feature(
        "F16", "left foot behind right leg", "lower",
        q.plane, ("root", "rankle", "rhip", "lankle"), ">=", 0.0, 0.375, "humerus",
        "The left ankle is behind the plane of the right leg.", mirror="F15",
        no="left foot level with or ahead of right leg",
    ),
    *_both(Feature(
        "F17", "{side} foot raised", "lower",
        q.above_lowest, ("{s}toes",), ">=", 1.0, 1.2, "humerus",
        "The toes of the {side} foot are far above the lowest joint.", mirror="F18",
        no="{side} foot low",
    )),
    Feature(
        "F19", "feet far apart sideways", "lower",
        q.reach, ("lhip", "rhip", "lankle", "rankle"), ">=", 1.8, 2.1, "humerus",
        "The ankles are far apart, seen along the line of the hips.",
        no="feet close together sideways",
    ),
    *_both(Feature(
        "F20", "{side} knee bent", "lower",
        q.angle, ("{s}knee", "{s}hip", "{s}knee", "{s}ankle"), "<=", 120.0, 110.0, "degree",
        "The angle at the {side} knee is small.", mirror="F21",
        no="{side} knee straight",
    )),
    Feature(
        "F22", "feet crossed", "lower",
        q.along, ("lhip", "rhip", "lankle", "rankle"), "<=", 0.0, -0.125, "hip width",
        "The right ankle lies on the left of the left one, seen along the line of the hips.",
        no="feet uncrossed",
    ),
    Feature(
        "F23", "feet move towards each other sideways", "lower",
        q.move_along, ("lhip", "rhip", "rankle", "lankle"), ">=", 1.3, 1.5, "humerus",
        "The left ankle moves towards the right one along the line of the hips.",
        window_s=0.1,
        no="feet stay or move apart sideways",
    ),
    Feature(
        "F24", "feet move apart sideways", "lower",
        q.move_against, ("lhip", "rhip", "rankle", "lankle"), ">=", 1.3, 1.5, "humerus",
        "The left ankle moves away from the right one along the line of the hips.",
        window_s=0.1,
        no="feet stay or move together sideways",
    ),
    *_both(Feature(
        "F25", "{side} foot fast", "lower",
        q.speed, ("{s}toes", "{s}ankle"), ">=", 2.0, 2.5, "humerus",
        "Toes and ankle of the {side} foot both move fast.", window_s=0.1, mirror="F26",
        no="{side} foot slow",
    )),
]  # fmt: skip

_MIX = [
    *_both(Feature(
        "F27", "{side} upper arm away from the body", "mix",
        q.angle, ("root", "neck", "{s}shoulder", "{s}elbow"), "<", 155.0, 150.0, "degree",
        "The {side} upper arm does not hang along the spine.", mirror="F28",
        no="{side} arm hangs",
    )),
    *_both(Feature(
        "F29", "{side} hip bent", "mix",
        q.angle, ("root", "neck", "{s}knee", "{s}hip"), ">", 45.0, 50.0, "degree",
        "The {side} thigh is turned out of line with the spine.", mirror="F30",
        no="{side} hip straight",
    )),
    Feature(
        "F31", "hips behind the feet", "mix",
        q.plane, ("lankle", "neck", "rankle", "root"), "<", -0.35, -0.5, "humerus",
        "The root lies behind the plane of the ankles and the neck.",
        no="hips above or ahead of the feet",
    ),
    Feature(
        "F32", "spine horizontal", "mix",
        q.tilt, ("root", "neck"), "within", (60.0, 120.0), (70.0, 110.0), "degree",
        "The line from the root to the neck is nearly horizontal.",
        no="spine steep",
    ),
    *_both(Feature(
        "F33", "{side} hand low", "mix",
        q.above_lowest, ("{s}fingers", "{s}fingers", "{s}wrist"), "<", 1.4, 1.2, "humerus",
        "The fingers of the {side} hand are near the height of the lowest other joint.",
        mirror="F34",
        no="{side} hand clear of the ground",
    )),
    Feature(
        "F35", "left shoulder turned forward", "mix",
        q.plane_difference, ("rhip", "lhip", "neck", "lshoulder", "rshoulder"),
        ">", 0.35, 0.40, "left humerus",
        "The left shoulder lies further ahead of the plane of hips and neck than the right.",
        mirror="F36",
        no="left shoulder level or back",
    ),
    Feature(
        "F36", "right shoulder turned forward", "mix",
        q.plane_difference, ("rhip", "lhip", "neck", "lshoulder", "rshoulder"),
        "<", -0.35, -0.40, "left humerus",
        "The right shoulder lies further ahead of the plane of hips and neck than the left.",
        mirror="F35",
        no="right shoulder level or back",
    ),
    Feature(
        "F37", "body low", "mix",
        q.extent_up, ("headtop",), "<=", 0.9, 0.8, "body height",
        "The highest joint is less far above the lowest than in an upright pose.",
        no="body at full height",
    ),
    Feature(
        "F38", "body spread out on the floor", "mix",
        q.extent_aside, q.EXTREMITIES, ">=", 3.0, 3.25, "humerus",
        "Feet, hands, head and root reach far apart horizontally.",
        no="body gathered",
    ),
    Feature(
        "F39", "body moves fast", "mix",
        q.speed, ("root",), ">=", 2.0, 2.3, "humerus",
        "The root moves fast.",
        no="body slow or still",
    ),
    Feature(
        "F40", "body turns", "mix",
        q.turning, ("rhip", "lhip"), ">=", 50.0, 100.0, "degree",
        "The line of the hips turns about the vertical.",
        no="body keeps its direction",
    ),
]  # fmt: skip

FULL_BODY = FeatureSet("full-body-40", tuple(_UPPER + _LOWER + _MIX))
FULL_BODY_2006 = FULL_BODY.select(FULL_BODY.ids[:39], name="full-body-39")


def _one_threshold_each(feature: Feature) -> list[Feature]:
    """Features of one quantity and one threshold that together are the given one."""
    if feature.quantity is q.speed and len(feature.joints) == 2:
        side = feature.name.partition(" ")[0]
        return [
            replace(
                feature, id=f"{feature.id}{joint[1]}", mirror=f"{feature.mirror}{joint[1]}",
                name=f"{side} {joint[1:]} fast", no=f"{side} {joint[1:]} slow",
                sentence=f"The {side} {joint[1:]} moves fast.", joints=(joint,),
            )
            for joint in feature.joints
        ]  # fmt: skip
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
            feature, id=feature.id + sign, mirror=feature.mirror + sign,
            name=feature.name + yes, no=feature.no + no,
            weak=_moved(feature.weak, feature, steps),
            strong=_moved(feature.strong, feature, steps),
        )
        for sign, yes, no, steps in _LEVELS
    ]  # fmt: skip


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
