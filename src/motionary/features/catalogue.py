"""Which 40 relations describe a body in motion?

Müller and Röder (2006), table 6, F1 to F39; F40 after Müller, Baak and Seidel (2009),
section 3. Thresholds are those of the authors' programs, weak before strong.

To add one: write a `Relation` with a quantity of `quantities`, and put it into a
`FeatureSet` of another name.
"""

from collections.abc import Callable

from motionary.features import quantities as q
from motionary.features.relations import FeatureSet, Relation

_SIDES = (("right", "r"), ("left", "l"))


def _pair(first: int, make: Callable[..., Relation]) -> list[Relation]:
    """The relations F(first) for the right and F(first + 1) for the left side."""
    ids = (f"F{first}", f"F{first + 1}")
    return [
        make(id=ids[i], mirror=ids[1 - i], side=side, s=s) for i, (side, s) in enumerate(_SIDES)
    ]


def _hand_moves_forward(id: str, mirror: str, side: str, s: str) -> Relation:
    return Relation(
        id, f"{side} hand moves forward", "upper",
        q.move_plane, ("neck", "rhip", "lhip", f"{s}wrist"), ">", 1.3, 1.8, "left humerus",
        f"The {side} wrist moves forward, away from the plane of neck and hips.",
        window_s=0.25, mirror=mirror,
    )  # fmt: skip


def _hand_above_neck(id: str, mirror: str, side: str, s: str) -> Relation:
    return Relation(
        id, f"{side} hand above neck", "upper",
        q.along, ("chest", "neck", "neck", f"{s}wrist"), ">=", 0.0, 0.2, "chest to neck",
        f"The {side} wrist lies beyond the neck, seen along the spine.", mirror=mirror,
    )  # fmt: skip


def _hand_moves_up(id: str, mirror: str, side: str, s: str) -> Relation:
    return Relation(
        id, f"{side} hand moves up", "upper",
        q.move_along, ("chest", "neck", "neck", f"{s}wrist"), ">", 1.3, 1.8, "left humerus",
        f"The {side} wrist moves up along the spine, relative to the neck.",
        window_s=0.25, mirror=mirror,
    )  # fmt: skip


def _elbow_bent(id: str, mirror: str, side: str, s: str) -> Relation:
    elbow = f"{s}elbow"
    return Relation(
        id, f"{side} elbow bent", "upper",
        q.angle, (elbow, f"{s}shoulder", elbow, f"{s}wrist"), "<=", 120.0, 110.0, "degree",
        f"The angle at the {side} elbow is small.", mirror=mirror,
    )  # fmt: skip


def _hand_leaves_root(id: str, mirror: str, side: str, s: str) -> Relation:
    wrist = f"{s}wrist"
    return Relation(
        id, f"{side} hand moves away from the body", "upper",
        q.move_along, ("root", wrist, "root", wrist), ">=", 1.2, 1.4, "humerus",
        f"The {side} wrist moves away from the root.", mirror=mirror,
    )  # fmt: skip


def _hand_fast(id: str, mirror: str, side: str, s: str) -> Relation:
    return Relation(
        id, f"{side} hand fast", "upper", q.speed, (f"{s}fingers",), ">=", 2.0, 2.5, "humerus",
        f"The fingers of the {side} hand move fast.", window_s=0.1, mirror=mirror,
    )  # fmt: skip


def _foot_raised(id: str, mirror: str, side: str, s: str) -> Relation:
    return Relation(
        id, f"{side} foot raised", "lower",
        q.above_lowest, (f"{s}toes",), ">=", 1.0, 1.2, "humerus",
        f"The toes of the {side} foot are far above the lowest joint.", mirror=mirror,
    )  # fmt: skip


def _knee_bent(id: str, mirror: str, side: str, s: str) -> Relation:
    knee = f"{s}knee"
    return Relation(
        id, f"{side} knee bent", "lower",
        q.angle, (knee, f"{s}hip", knee, f"{s}ankle"), "<=", 120.0, 110.0, "degree",
        f"The angle at the {side} knee is small.", mirror=mirror,
    )  # fmt: skip


def _foot_fast(id: str, mirror: str, side: str, s: str) -> Relation:
    return Relation(
        id, f"{side} foot fast", "lower",
        q.speed, (f"{s}toes", f"{s}ankle"), ">=", 2.0, 2.5, "humerus",
        f"Toes and ankle of the {side} foot both move fast.", window_s=0.1, mirror=mirror,
    )  # fmt: skip


def _arm_off_body(id: str, mirror: str, side: str, s: str) -> Relation:
    return Relation(
        id, f"{side} upper arm away from the body", "mix",
        q.angle, ("root", "neck", f"{s}shoulder", f"{s}elbow"), "<", 155.0, 150.0, "degree",
        f"The {side} upper arm does not hang along the spine.", mirror=mirror,
    )  # fmt: skip


def _thigh_off_spine(id: str, mirror: str, side: str, s: str) -> Relation:
    return Relation(
        id, f"{side} hip bent", "mix",
        q.angle, ("root", "neck", f"{s}knee", f"{s}hip"), ">", 45.0, 50.0, "degree",
        f"The {side} thigh is turned out of line with the spine.", mirror=mirror,
    )  # fmt: skip


def _hand_low(id: str, mirror: str, side: str, s: str) -> Relation:
    fingers, wrist = f"{s}fingers", f"{s}wrist"
    return Relation(
        id, f"{side} hand low", "mix",
        q.above_lowest, (fingers, fingers, wrist), "<", 1.4, 1.2, "humerus",
        f"The fingers of the {side} hand are near the height of the lowest other joint.",
        mirror=mirror,
    )  # fmt: skip


_UPPER = [
    *_pair(1, _hand_moves_forward),
    *_pair(3, _hand_above_neck),
    *_pair(5, _hand_moves_up),
    *_pair(7, _elbow_bent),
    Relation(
        "F9", "hands far apart", "upper",
        q.reach, ("lshoulder", "rshoulder", "lwrist", "rwrist"), ">=", 2.0, 2.5,
        "shoulder width", "The wrists are far apart, seen along the line of the shoulders.",
    ),
    Relation(
        "F10", "hands approach each other", "upper",
        q.move_along, ("lwrist", "rwrist", "rwrist", "lwrist"), ">=", 1.2, 1.4, "humerus",
        "The left wrist moves towards the right one.", window_s=0.1,
    ),
    *_pair(11, _hand_leaves_root),
    *_pair(13, _hand_fast),
]  # fmt: skip

_LOWER = [
    Relation(
        "F15", "right foot behind left leg", "lower",
        q.plane, ("root", "lhip", "lankle", "rankle"), ">=", 0.0, 0.375, "humerus",
        "The right ankle is behind the plane of the left leg.", mirror="F16",
    ),
    Relation(
        "F16", "left foot behind right leg", "lower",
        q.plane, ("root", "rankle", "rhip", "lankle"), ">=", 0.0, 0.375, "humerus",
        "The left ankle is behind the plane of the right leg.", mirror="F15",
    ),
    *_pair(17, _foot_raised),
    Relation(
        "F19", "feet far apart sideways", "lower",
        q.reach, ("lhip", "rhip", "lankle", "rankle"), ">=", 1.8, 2.1, "humerus",
        "The ankles are far apart, seen along the line of the hips.",
    ),
    *_pair(20, _knee_bent),
    Relation(
        "F22", "feet crossed", "lower",
        q.along, ("lhip", "rhip", "lankle", "rankle"), "<=", 0.0, -0.125, "hip width",
        "The right ankle lies on the left of the left one, seen along the line of the hips.",
    ),
    Relation(
        "F23", "feet move towards each other sideways", "lower",
        q.move_along, ("lhip", "rhip", "rankle", "lankle"), ">=", 1.3, 1.5, "humerus",
        "The left ankle moves towards the right one along the line of the hips.",
        window_s=0.1,
    ),
    Relation(
        "F24", "feet move apart sideways", "lower",
        q.move_against, ("lhip", "rhip", "rankle", "lankle"), ">=", 1.3, 1.5, "humerus",
        "The left ankle moves away from the right one along the line of the hips.",
        window_s=0.1,
    ),
    *_pair(25, _foot_fast),
]  # fmt: skip

_MIX = [
    *_pair(27, _arm_off_body),
    *_pair(29, _thigh_off_spine),
    Relation(
        "F31", "hips behind the feet", "mix",
        q.plane, ("lankle", "neck", "rankle", "root"), "<", -0.35, -0.5, "humerus",
        "The root lies behind the plane of the ankles and the neck.",
    ),
    Relation(
        "F32", "spine horizontal", "mix",
        q.tilt, ("root", "neck"), "within", (60.0, 120.0), (70.0, 110.0), "degree",
        "The line from the root to the neck is nearly horizontal.",
    ),
    *_pair(33, _hand_low),
    Relation(
        "F35", "left shoulder turned forward", "mix",
        q.plane_difference, ("rhip", "lhip", "neck", "lshoulder", "rshoulder"),
        ">", 0.35, 0.40, "left humerus",
        "The left shoulder lies further ahead of the plane of hips and neck than the right.",
        mirror="F36",
    ),
    Relation(
        "F36", "right shoulder turned forward", "mix",
        q.plane_difference, ("rhip", "lhip", "neck", "lshoulder", "rshoulder"),
        "<", -0.35, -0.40, "left humerus",
        "The right shoulder lies further ahead of the plane of hips and neck than the left.",
        mirror="F35",
    ),
    Relation(
        "F37", "body low", "mix",
        q.extent_up, ("headtop",), "<=", 0.9, 0.8, "body height",
        "The highest joint is less far above the lowest than in an upright pose.",
    ),
    Relation(
        "F38", "body spread out on the floor", "mix",
        q.extent_aside, q.EXTREMITIES, ">=", 3.0, 3.25, "humerus",
        "Feet, hands, head and root reach far apart horizontally.",
    ),
    Relation(
        "F39", "body moves fast", "mix", q.speed, ("root",), ">=", 2.0, 2.3, "humerus",
        "The root moves fast.",
    ),
    Relation(
        "F40", "body turns", "mix", q.turning, ("rhip", "lhip"), ">=", 50.0, 100.0, "degree",
        "The line of the hips turns about the vertical.",
    ),
]  # fmt: skip

FULL_BODY = FeatureSet("full-body-40", tuple(_UPPER + _LOWER + _MIX))
FULL_BODY_2006 = FULL_BODY.select(FULL_BODY.ids[:39], name="full-body-39")
