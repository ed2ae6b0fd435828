"""Are points without a tree told by their names, in several spellings and languages?"""

import unicodedata
from dataclasses import replace

import numpy as np
import pytest

from motionary import read, write
from motionary.features import compute_features
from motionary.io import ReadOptions, save_skeleton
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.recording import Recording
from motionary.retrieval.index import Index
from motionary.samples import synthetic_motion
from motionary.skeletons import find_mapping, named_mapping

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


# -- tables in other letters ---------------------------------------------------------------

BODY25 = named_mapping("body25").order
PLUG_IN_GAIT = [
    "LFHD",
    "RFHD",
    "LBHD",
    "RBHD",
    "C7",
    "T10",
    "CLAV",
    "STRN",
    "LASI",
    "RASI",
    "LPSI",
    "RPSI",
    "LSHO",
    "LELB",
    "LWRA",
    "LWRB",
    "LFIN",
    "RSHO",
    "RELB",
    "RWRA",
    "RWRB",
    "RFIN",
    "LKNE",
    "LANK",
    "LHEE",
    "LTOE",
    "RKNE",
    "RANK",
    "RHEE",
    "RTOE",
]
HELEN_HAYES = [
    "LASI",
    "RASI",
    "SACR",
    "LTHI",
    "LKNE",
    "LTIB",
    "LANK",
    "LHEE",
    "LTOE",
    "RTHI",
    "RKNE",
    "RTIB",
    "RANK",
    "RHEE",
    "RTOE",
]
ISB = [
    "LASIS",
    "RASIS",
    "LPSIS",
    "RPSIS",
    "LFLE",
    "LFME",
    "RFLE",
    "RFME",
    "LFAL",
    "LTAM",
    "RFAL",
    "RTAM",
    "C7",
    "LAC",
    "RAC",
    "LHLE",
    "LHME",
]


@pytest.mark.parametrize(
    "write_name",
    [str.lower, str.upper, "S1_{}".format, "S1-{}".format, "Bob_{}".format, "lab_Bob:{}".format],
    ids=["lower", "upper", "S1_", "S1-", "Bob_", "Bob:"],
)
@pytest.mark.parametrize(
    ("table", "names"), [("body25", BODY25), ("plug_in_gait", PLUG_IN_GAIT)], ids=lambda x: str(x)
)
def test_a_table_is_found_in_other_letters_and_behind_a_prefix(table, names, write_name):
    plain, found = find_mapping(names), find_mapping([write_name(name) for name in names])
    assert found.name == plain.name == table
    assert found.weights == {
        joint: {write_name(name): weight for name, weight in source.items()}
        if set(source) <= set(names)
        else source
        for joint, source in plain.weights.items()
    }


def test_names_that_differ_by_case_alone_are_told_apart():
    names = (*BODY25, *(name.lower() for name in BODY25))
    assert find_mapping(names).weights == find_mapping(BODY25).weights


@pytest.mark.parametrize("form", ["NFC", "NFD"])
def test_forms_of_unicode_are_one_name(form):
    names = ("Becken", "Hüfte_L", "Hüfte_R", "Knie_L", "Knie_R", "Knöchel_L", "Knöchel_R")
    written = {name: unicodedata.normalize(form, name) for name in names}
    assert find_mapping(written.values()).weights["lhip"] == {written["Hüfte_L"]: 1.0}
    assert find_mapping(written.values()).weights["rankle"] == {written["Knöchel_R"]: 1.0}


@pytest.mark.parametrize("names", [HELEN_HAYES, ISB], ids=["Helen Hayes", "ISB"])
def test_marker_sets_of_laboratories_have_pelvis_and_legs(names):
    mapping = find_mapping(names)
    legs = ["root", *(side + joint for side in "lr" for joint in ("hip", "knee", "ankle"))]
    assert all(set(mapping.weights[joint]) <= set(names) for joint in legs)
    assert set(mapping.normals) == {"lhip", "rhip"}
    assert all(set(normal[:3]) <= set(names) for normal in mapping.normals.values())


def test_hips_lie_below_and_between_the_markers_of_the_pelvis():
    places = {"LASI": (0.13, 1, 0.1), "RASI": (-0.13, 1, 0.1), "SACR": (0, 1, -0.1)}
    positions = np.array([[places.get(name, (0, 0.5, 0)) for name in HELEN_HAYES]], dtype=float)
    motion = Motion(
        tuple(HELEN_HAYES), positions, Recording(rate_hz=100.0), find_mapping(HELEN_HAYES)
    )
    body = motion.generic_positions()[0]
    for joint, side in (("lhip", 1), ("rhip", -1)):
        x, y, z = body[GENERIC_JOINTS.index(joint)]
        assert 0.05 < side * x < 0.12
        assert 0.88 < y < 0.95
        assert 0 < z < 0.08


def test_points_that_are_never_seen_yield_to_those_that_are():
    names = (*PLUG_IN_GAIT, "LKJC", "RKJC", "LHJC", "RHJC")
    positions = np.zeros((4, len(names), 3))
    positions[:, names.index("LKJC")] = np.nan
    mapping = find_mapping(names, None, positions)
    assert mapping.weights["lknee"] == {"LKNE": 1.0}
    assert mapping.weights["rknee"] == {"RKJC": 1.0}
    assert mapping.weights["lhip"] == {"LHJC": 1.0}


def test_clusters_are_no_joints():
    markers = [
        f"{side}{name}" for side in "LR"
        for name in ("Thigh1", "Thigh2", "Thigh3", "Shank1", "Shank2", "Shank3", "Ankle", "Toe")
    ]  # fmt: skip
    assert find_mapping(markers) is None
    found = find_mapping([*markers, "LHip", "RHip", "LKnee", "RKnee"])
    assert found.weights["lhip"] == {"LHip": 1.0}
    assert found.weights["rknee"] == {"RKnee": 1.0}
