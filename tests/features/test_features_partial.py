"""What is known of a body of which only a part was recorded?"""

from dataclasses import replace

import numpy as np
import pytest

from motionary import compute_features
from motionary.features import FULL_BODY, LEGS, describe_reference_lengths
from motionary.motion import GENERIC_JOINTS
from motionary.samples import synthetic_motion

ARMS = ("shoulder", "elbow", "wrist", "fingers", "clavicle")
LEGS_OF_BODY = {
    "root", *(side + joint for side in "lr" for joint in ("hip", "knee", "ankle", "toes"))
}  # fmt: skip


def without(motion, joints):
    positions = motion.positions.copy()
    positions[:, [motion.names.index(joint) for joint in joints]] = np.nan
    return replace(motion, positions=positions, skeleton=None, rotations=None)


@pytest.fixture
def kick():
    return synthetic_motion("kick_left", seed=3)


def test_legs_alone_give_the_relations_of_legs(kick):
    legs = without(kick, set(GENERIC_JOINTS) - LEGS_OF_BODY)
    packed = compute_features(legs, feature_set=LEGS)
    assert packed.known_features.all()
    whole = compute_features(kick, feature_set=LEGS)
    # The figure's upper arm is .69 of its thigh: a threshold is 3 % off.
    assert (packed.features == whole.features).mean() > 0.98
    known = compute_features(legs).known_features.any(axis=0)
    assert {FULL_BODY.ids[i] for i in np.flatnonzero(known)} == set(LEGS.ids)
    (note,) = describe_reference_lengths(legs)
    assert note.startswith("no upper arm: .71 of the thigh takes its place")


def test_one_arm_measures_for_the_other(kick):
    one = without(kick, [f"r{joint}" for joint in ARMS])
    (note,) = describe_reference_lengths(one)
    assert note.startswith("no right upper arm: the left upper arm takes its place")
    packed, whole = compute_features(one), compute_features(kick)
    known = packed.known_features.astype(bool)
    assert (packed.features == whole.features)[known].all()
    assert known[:, FULL_BODY.ids.index("F25")].all()


def test_whole_bodies_need_no_stand_in(kick):
    assert describe_reference_lengths(kick) == ()


def test_without_arms_and_legs_nothing_stands_in(kick):
    trunk = without(kick, set(GENERIC_JOINTS) - {"root", "belly", "chest", "neck", "head"})
    assert describe_reference_lengths(trunk) == ()
    known = compute_features(trunk).known_features.any(axis=0)
    assert {FULL_BODY.ids[i] for i in np.flatnonzero(known)} == {"F32"}
