"""Does each relation switch at its thresholds, for movement planted at known values?

Every relation is shown a value just short of its strong threshold (stays off), just
beyond (on), just beyond the weak one (still on) and just short of it (off). Thresholds are
typed here once more, from the published table; the figure's lengths are known.
"""

import numpy as np
import pytest

from motionary.features import FULL_BODY, feature_matrix
from oracles.features import as_array, standing

HUMERUS, SHOULDERS, HIPS, CHEST_TO_NECK, HEIGHT = 0.25, 0.5, 0.25, 0.125, 1.625
EPSILON = 1e-6


def towards(angle_deg, *, forward=0.0, left=0.0):
    """Unit vector at an angle from up, tilted forward or to the left."""
    angle = np.radians(angle_deg)
    return np.array([left * np.sin(angle), np.cos(angle), forward * np.sin(angle)])


# -- poses: each moves single joints so that the relation measures `v` -------------------


def hand_above_neck(pose, v, s):
    pose[s + "wrist"][1] = pose["neck"][1] + v * CHEST_TO_NECK


def elbow_angle(pose, v, s):
    pose[s + "wrist"] = pose[s + "elbow"] + 0.25 * towards(v, forward=1)


def hands_apart(pose, v, s):
    for side, sign in (("l", 1), ("r", -1)):
        pose[side + "wrist"][0] = sign * v * SHOULDERS / 2


def hands_crossed(pose, v, s):
    hands_apart(pose, -v, s)


def foot_behind(pose, v, s):
    pose[s + "ankle"][2] = -v * HUMERUS


def foot_raised(pose, v, s):
    pose[s + "toes"][1] = v * HUMERUS


def feet_apart(pose, v, s):
    for side, sign in (("l", 1), ("r", -1)):
        pose[side + "ankle"][0] = sign * v * HUMERUS / 2


def feet_far_crossed(pose, v, s):
    feet_apart(pose, -v, s)


def knee_angle(pose, v, s):
    pose[s + "ankle"] = pose[s + "knee"] + 0.375 * towards(v, forward=-1)


def feet_crossed(pose, v, s):
    pose["rankle"][0] = pose["lankle"][0] - v * HIPS


def upper_arm_angle(pose, v, s):
    pose[s + "elbow"] = pose[s + "shoulder"] + 0.25 * towards(v, left=1 if s == "l" else -1)


def thigh_forward(pose, v, s):
    pose[s + "knee"] = pose[s + "hip"] - 0.5 * towards(v, forward=-1)


def thigh_backward(pose, v, s):
    pose[s + "knee"] = pose[s + "hip"] - 0.5 * towards(v, forward=1)


def root_behind_feet(pose, v, s):
    pose["root"][2] = v * HUMERUS


def spine_forward(pose, v, s):
    pose["neck"] = pose["root"] + 0.375 * towards(v, forward=1)


def spine_sideways(pose, v, s):
    pose["neck"] = pose["root"] + 0.375 * towards(v, left=1)


def hand_low(pose, v, s):
    pose[s + "fingers"][1] = v * HUMERUS


def left_shoulder_forward(pose, v, s):
    pose["lshoulder"][2] = v * HUMERUS


def right_shoulder_forward(pose, v, s):
    pose["rshoulder"][2] = -v * HUMERUS


def body_low(pose, v, s):
    for joint in pose:
        pose[joint][1] *= v * HEIGHT / 1.75


def body_wide(pose, v, s):
    pose["lankle"][0], pose["rankle"][0] = v * HUMERUS / 2, -v * HUMERUS / 2


def body_long(pose, v, s):
    pose["headtop"][2], pose["root"][2] = 0.6 * v * HUMERUS, -0.4 * v * HUMERUS


# Relation, side, pose, weak, strong.
POSES = [
    ("F3", "r", hand_above_neck, 0, 0.2),
    ("F4", "l", hand_above_neck, 0, 0.2),
    ("F7", "r", elbow_angle, 120, 110),
    ("F8", "l", elbow_angle, 120, 110),
    ("F9", "", hands_apart, 2, 2.5),
    ("F9", "", hands_crossed, 2, 2.5),
    ("F15", "r", foot_behind, 0, 0.375),
    ("F16", "l", foot_behind, 0, 0.375),
    ("F17", "r", foot_raised, 1, 1.2),
    ("F18", "l", foot_raised, 1, 1.2),
    ("F19", "", feet_apart, 1.8, 2.1),
    ("F19", "", feet_far_crossed, 1.8, 2.1),
    ("F20", "r", knee_angle, 120, 110),
    ("F21", "l", knee_angle, 120, 110),
    ("F22", "", feet_crossed, 0, -0.125),
    ("F27", "r", upper_arm_angle, 155, 150),
    ("F28", "l", upper_arm_angle, 155, 150),
    ("F29", "r", thigh_forward, 45, 50),
    ("F29", "r", thigh_backward, 45, 50),
    ("F30", "l", thigh_forward, 45, 50),
    ("F30", "l", thigh_backward, 45, 50),
    ("F31", "", root_behind_feet, -0.35, -0.5),
    ("F32", "", spine_forward, 60, 70),
    ("F32", "", spine_forward, 120, 110),
    ("F32", "", spine_sideways, 60, 70),
    ("F33", "r", hand_low, 1.4, 1.2),
    ("F34", "l", hand_low, 1.4, 1.2),
    ("F35", "", left_shoulder_forward, 0.35, 0.40),
    ("F35", "", right_shoulder_forward, 0.35, 0.40),
    ("F36", "", left_shoulder_forward, -0.35, -0.40),
    ("F36", "", right_shoulder_forward, -0.35, -0.40),
    ("F37", "", body_low, 0.9, 0.8),
    ("F38", "", body_wide, 3, 3.25),
    ("F38", "", body_long, 3, 3.25),
]


def planted_pose(change, value, side):
    pose = standing()
    change(pose, value, side)
    return pose


def values_around(weak, strong):
    """Short of strong, beyond strong, beyond weak, short of weak."""
    outwards = np.sign(strong - weak) * EPSILON * max(1.0, abs(strong))
    return [strong - outwards, strong + outwards, weak + outwards, weak - outwards]


def mirror_of(id):
    return FULL_BODY.features[FULL_BODY.ids.index(id)].mirror


def state_of(id, positions):
    features, known = feature_matrix(positions, FULL_BODY)
    column = FULL_BODY.ids.index(id)
    assert known[:, column].all()
    return features[:, column].tolist()


@pytest.mark.parametrize(("id", "side", "change", "weak", "strong"), POSES)
def test_a_pose_switches_at_its_thresholds(id, side, change, weak, strong):
    poses = [planted_pose(change, v, side) for v in values_around(weak, strong)]
    # The figure stands first: its lengths are measured there.
    off = id in ("F15", "F16")
    start = planted_pose(change, -0.1, side) if off else standing()
    assert state_of(id, as_array([start, *poses])) == [False, False, True, True, False]


@pytest.mark.parametrize(
    ("id", "side", "change", "weak", "strong"),
    [row for row in POSES if mirror_of(row[0]) != row[0]],
)
def test_only_its_own_side_switches(id, side, change, weak, strong):
    pose = planted_pose(change, values_around(weak, strong)[1], side)
    start = planted_pose(foot_behind, -0.1, "l" if id == "F15" else "r")
    assert state_of(mirror_of(id), as_array([start, pose]))[1] is False


def test_a_document_that_starts_strong_starts_true():
    pose = planted_pose(knee_angle, 100, "r")
    assert state_of("F20", as_array([pose, planted_pose(knee_angle, 115, "r")])) == [True, True]


@pytest.mark.parametrize(("id", "side", "other"), [("F33", "r", "l"), ("F34", "l", "r")])
def test_a_hand_is_low_beside_other_joints_than_its_own(id, side, other):
    pose = standing()
    pose[side + "fingers"][1], pose[side + "wrist"][1] = 0.2, -1.0
    assert state_of(id, as_array([standing(), pose])) == [False, True]
    pose[other + "wrist"][1] = -1.0
    assert state_of(id, as_array([standing(), pose])) == [False, False]


@pytest.mark.parametrize(
    ("id", "change", "at", "passes"),
    [
        ("F3", hand_above_neck, 0.0, True),  # at least
        ("F19", feet_apart, 1.8, True),
        ("F22", feet_crossed, 0.0, True),  # at most
        ("F35", left_shoulder_forward, 0.35, False),  # more than
        ("F36", left_shoulder_forward, -0.35, False),  # less than
    ],
)
def test_the_threshold_itself_belongs_to_at_least_and_at_most(id, change, at, passes):
    beyond = {"F3": 1.0, "F19": 3.0, "F22": -1.0, "F35": 1.0, "F36": -1.0}[id]
    # Lengths of a power of two keep the planted values exact.
    poses = [standing(), planted_pose(change, beyond, "r"), planted_pose(change, at, "r")]
    assert state_of(id, as_array(poses)) == [False, True, passes]


# -- movement: joints that move at known speeds -----------------------------------------


def moving(joints, direction, speeds, *, start=None):
    """Poses of a figure whose joints move along a line, each speed for half a second."""
    steps = np.repeat(np.array([0.0, *speeds, 0.0]), 60) / 120
    distance = np.concatenate([[0.0], np.cumsum(steps)])
    poses = []
    for d in distance:
        pose = start() if start else standing()
        for joint in joints:
            pose[joint] = pose[joint] + d * np.array(direction, dtype=float)
        poses.append(pose)
    return as_array(poses)


def arms_stretched():
    """Hands level with the root, so that they leave it straight to the side."""
    pose = standing()
    pose["lwrist"], pose["rwrist"] = np.array([0.5, 1.0, 0.0]), np.array([-0.5, 1.0, 0.0])
    return pose


def hands_far():
    pose = standing()
    pose["lwrist"][0] = 4.0
    return pose


def foot_far():
    pose = standing()
    pose["lankle"][0] = 4.0
    return pose


# Relation, joints that move, direction, starting pose, weak, strong in humeri per second.
MOVEMENTS = [
    ("F1", ["rwrist"], (0, 0, 1), None, 1.3, 1.8),
    ("F2", ["lwrist"], (0, 0, 1), None, 1.3, 1.8),
    ("F5", ["rwrist"], (0, 1, 0), None, 1.3, 1.8),
    ("F6", ["lwrist"], (0, 1, 0), None, 1.3, 1.8),
    ("F10", ["lwrist"], (-1, 0, 0), hands_far, 1.2, 1.4),
    ("F11", ["rwrist"], (-1, 0, 0), arms_stretched, 1.2, 1.4),
    ("F12", ["lwrist"], (1, 0, 0), arms_stretched, 1.2, 1.4),
    ("F13", ["rfingers"], (0.6, 0, 0.8), None, 2, 2.5),
    ("F14", ["lfingers"], (0, 0.6, -0.8), None, 2, 2.5),
    ("F23", ["lankle"], (-1, 0, 0), foot_far, 1.3, 1.5),
    ("F24", ["lankle"], (1, 0, 0), None, 1.3, 1.5),
    ("F24", ["rankle"], (-1, 0, 0), None, 1.3, 1.5),
    ("F25", ["rtoes", "rankle"], (0, 0, 1), None, 2, 2.5),
    ("F26", ["ltoes", "lankle"], (0, 0, 1), None, 2, 2.5),
    ("F39", ["root"], (0, 0, 1), None, 2, 2.3),
]


@pytest.mark.parametrize(("id", "joints", "direction", "start", "weak", "strong"), MOVEMENTS)
def test_a_movement_switches_at_its_thresholds(id, joints, direction, start, weak, strong):
    speeds = [v * HUMERUS for v in values_around(weak, strong)]
    state = state_of(id, moving(joints, direction, speeds, start=start))
    assert state[30::60] == [False, False, True, True, False, False]


@pytest.mark.parametrize(("id", "joints", "direction", "start", "weak", "strong"), MOVEMENTS)
def test_the_other_direction_does_not_count_unless_speed_does(
    id, joints, direction, start, weak, strong
):
    back = [-v * HUMERUS for v in values_around(weak, strong)]
    state = state_of(id, moving(joints, direction, back, start=start))
    absolute = id in ("F13", "F14", "F25", "F26", "F39")
    assert any(state) == absolute


@pytest.mark.parametrize(("id", "joint"), [("F25", "rtoes"), ("F25", "rankle"), ("F26", "ltoes")])
def test_a_foot_is_fast_only_when_toes_and_ankle_are(id, joint):
    assert not any(state_of(id, moving([joint], (0, 0, 1), [3 * HUMERUS])))


def turning(speeds_deg, axis_height=0.0):
    steps = np.repeat(np.radians([0.0, *speeds_deg, 0.0]), 60) / 120
    poses = []
    for angle in np.concatenate([[0.0], np.cumsum(steps)]):
        pose = standing()
        for joint, sign in (("lhip", 1), ("rhip", -1)):
            side = sign * HIPS / 2
            pose[joint] = np.array(
                [side * np.cos(angle), 1.0 + sign * axis_height, side * np.sin(angle)]
            )
        poses.append(pose)
    return as_array(poses)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("axis_height", [0.0, 0.3])
def test_turning_switches_at_its_thresholds_either_way(sign, axis_height):
    speeds = [sign * v for v in values_around(50, 100)]
    state = state_of("F40", turning(speeds, axis_height))
    assert state[30::60] == [False, False, True, True, False, False]


def test_the_last_frame_does_not_turn():
    positions = turning([200.0])[:100]
    assert state_of("F40", positions)[-2:] == [True, False]


def test_every_relation_is_planted():
    assert {row[0] for row in POSES} | {row[0] for row in MOVEMENTS} | {"F40"} == set(FULL_BODY.ids)
