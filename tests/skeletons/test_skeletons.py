"""Do the tables name generic joints, and is a file's skeleton recognised?"""

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.io import read
from motionary.motion import GENERIC_JOINTS
from motionary.skeletons import find_mapping, known_mappings, named_mapping


@pytest.mark.parametrize("name", known_mappings())
def test_a_table_gives_generic_joints_by_weights_that_sum_to_one(name):
    mapping = named_mapping(name)
    assert set(mapping.weights) <= set(GENERIC_JOINTS)
    if name in ("acclaim", "cmu_bvh", "bandai"):
        assert set(mapping.weights) == set(GENERIC_JOINTS)
    for joint, weights in mapping.weights.items():
        assert sum(weights.values()) == pytest.approx(1), joint
    assert set(mapping.substituted) <= set(mapping.weights)
    assert mapping.note or not mapping.substituted


@pytest.mark.parametrize("name", known_mappings())
def test_a_skeleton_is_recognised_by_its_names_whatever_their_sequence_or_prefix(name):
    weights = named_mapping(name).weights
    names = sorted({source for sources in weights.values() for source in sources}, reverse=True)
    # Bodies of one family are told apart by joints that no relation needs.
    assert find_mapping(names).weights == weights
    prefixed = find_mapping([f"Daniel:{source}" for source in names])
    assert prefixed.name == find_mapping(names).name
    assert all(s.startswith("Daniel:") for sources in prefixed.weights.values() for s in sources)


def test_too_few_joints_are_no_skeleton():
    assert find_mapping(("Hips", "Spine", "Neck", "Head")) is None
    assert find_mapping(()) is None


def test_alternatives_follow_the_names():
    names = {s for sources in named_mapping("cmu_bvh").weights.values() for s in sources}
    other = (names - {"End of LFingers", "End of RFingers"}) | {
        "End of LeftHandIndex1",
        "End of RightHandIndex1",
    }
    assert find_mapping(other).weights["lfingers"] == {"End of LeftHandIndex1": 1.0}
    assert named_mapping("cmu_bvh", other).weights["rfingers"] == {"End of RightHandIndex1": 1.0}


def test_an_unknown_name_is_answered_with_the_known_ones():
    with pytest.raises(InvalidInput, match="acclaim, bandai, body25"):
        named_mapping("horse")


def test_the_chest_of_cmu_bvh_lies_where_the_acclaim_file_has_it(data):
    # The fraction between belly and neck that the table states, measured again.
    motion = read(data / "cmu" / "01_01.amc")
    belly, chest, neck = (
        motion.positions[:, motion.names.index(name)]
        for name in ("lowerback", "upperback", "thorax")
    )
    along = neck - belly
    fraction = ((chest - belly) * along).sum(axis=1) / (along * along).sum(axis=1)
    weights = named_mapping("cmu_bvh").weights["chest"]
    assert weights["Neck"] == pytest.approx(fraction.mean(), abs=1e-3)
    assert named_mapping("cmu_bvh").substituted == ("chest",)


def test_substituting_keeps_chest_and_neck_apart(data):
    motion = read(data / "cmu" / "01_01.bvh")
    generic = motion.generic_positions()
    chest, neck, belly = (generic[:, GENERIC_JOINTS.index(j)] for j in ("chest", "neck", "belly"))
    assert np.linalg.norm(neck - chest, axis=1).min() > 0.05
    np.testing.assert_allclose(
        np.linalg.norm(neck - chest, axis=1) + np.linalg.norm(chest - belly, axis=1),
        np.linalg.norm(neck - belly, axis=1),
    )


def test_end_sites_without_length_are_unknown_joints(data):
    motion = read(data / "bandai" / "bow_old_001.bvh")
    unknown = np.isnan(motion.generic_positions()).all(axis=(0, 2))
    missing = {joint for joint, gone in zip(GENERIC_JOINTS, unknown, strict=True) if gone}
    assert missing == {"headtop", "ltoes", "rtoes", "lfingers", "rfingers"}
