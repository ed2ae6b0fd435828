"""Are points without a tree told by their names, in several spellings and languages?"""

from dataclasses import replace

import numpy as np
import pytest

from motionary import read, write
from motionary.features import compute_features
from motionary.io import ReadOptions, save_skeleton
from motionary.motion import Motion
from motionary.recording import Recording
from motionary.retrieval.index import Index
from motionary.samples import synthetic_motion
from motionary.skeletons import find_mapping

LIMBS = ("hip", "knee", "ankle", "toes", "clavicle", "shoulder", "elbow", "wrist")
MIDDLE = ("root", "belly", "chest", "neck", "head")

#: Side and joint as words of a name, and the names of the middle of the body.
SPELLINGS = {
    "Left Hip": ("{Side} {Joint}", ("Pelvis", "Spine", "Chest", "Neck", "Head")),
    "hip.l": ("{joint}.{s}", ("hips", "spine", "spine1", "neck", "head")),
    "L_HIP": ("{S}_{JOINT}", ("PELVIS", "ABDOMEN", "THORAX", "NECK", "HEAD")),
    "lHip": ("{s}{Joint}", ("hips", "abdomen", "chest", "neck", "head")),
    "HipLeft": ("{Joint}{Side}", ("Pelvis", "Waist", "Chest", "Neck", "Head")),
    "rig:left_hip_jnt": (
        "rig:{side}_{joint}_jnt",
        ("rig:root_jnt", "rig:spine_jnt", "rig:chest_jnt", "rig:neck_jnt", "rig:head_jnt"),
    ),
}

GERMAN = {
    "hip": "Huefte", "knee": "Knie", "ankle": "Knoechel", "toes": "Zehen",
    "clavicle": "Schluesselbein", "shoulder": "Schulter", "elbow": "Ellbogen",
    "wrist": "Handgelenk", "root": "Becken", "belly": "Bauch", "chest": "Brust", "neck": "Hals",
    "head": "Kopf",
}  # fmt: skip


def spelled(joint, pattern, middle):
    if joint in MIDDLE:
        return middle[MIDDLE.index(joint)]
    side = {"l": "left", "r": "right"}[joint[0]]
    part = joint[1:]
    return pattern.format(
        side=side, Side=side.title(), s=side[0], S=side[0].upper(),
        joint=part, Joint=part.title(), JOINT=part.upper(),
    )  # fmt: skip


def points(rename):
    motion = synthetic_motion("kick_left", seed=2)
    kept = [*MIDDLE, *(side + joint for joint in LIMBS for side in "lr")]
    columns = [motion.names.index(joint) for joint in kept]
    names = tuple(rename(joint) for joint in kept)
    plain = Motion(names, motion.positions[:, columns], Recording(rate_hz=120.0))
    known = replace(motion, positions=np.where(
        np.isin(motion.names, kept)[None, :, None], motion.positions, np.nan
    ))  # fmt: skip
    return plain, known


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_points_are_told_by_their_names(spelling, tmp_path):
    pattern, middle = SPELLINGS[spelling]
    plain, known = points(lambda joint: spelled(joint, pattern, middle))
    write(plain, tmp_path / "a.c3d")
    motion = read(tmp_path / "a.c3d")
    assert motion.mapping.name == "guessed"
    assert "by their names" in motion.mapping.note
    expected = compute_features(known)
    words = compute_features(motion)
    np.testing.assert_array_equal(words.known_features, expected.known_features)
    # Places in a C3D are rounded.
    assert (words.features == expected.features).mean() > 0.999


def test_points_with_german_names():
    def rename(joint):
        if joint in MIDDLE:
            return GERMAN[joint]
        return f"{GERMAN[joint[1:]]} {'links' if joint[0] == 'l' else 'rechts'}"

    plain, _ = points(rename)
    mapping = find_mapping(plain.names)
    assert mapping.weights["lknee"] == {"Knie links": 1.0}
    assert mapping.weights["rshoulder"] == {"Schulter rechts": 1.0}
    assert mapping.weights["chest"] == {"Brust": 1.0}


def test_markers_of_another_set_are_not_taken_for_joints():
    markers = ("L.ASIS", "R.ASIS", "L.Knee.Lat", "R.Knee.Lat", "L.Heel", "R.Heel", "L.Thigh.Front")
    assert find_mapping(markers) is None


def test_an_index_counts_what_a_mapping_says_not_what_it_is_called(tmp_path):
    folder = tmp_path / "takes"
    folder.mkdir()
    write(synthetic_motion("squat", seed=1), folder / "squat.bvh")
    table = tmp_path / "rig.toml"
    save_skeleton(read(folder / "squat.bvh"), table)
    reading = ReadOptions(skeleton=str(table))
    Index.open(folder, reading=reading).update()
    assert len(Index.open(folder, reading=reading)) == 1
    table.write_text(table.read_text().replace('lfingers = "lfingers"\n', ""))
    assert len(Index.open(folder, reading=reading)) == 0
