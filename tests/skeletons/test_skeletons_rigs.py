"""Is every rig recognised, and is a rig that no table knows mapped as its table would?"""

import re
from dataclasses import replace

import numpy as np
import pytest

from motionary import read, write
from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, compute_features
from motionary.io import save_skeleton
from motionary.motion import GENERIC_JOINTS, Motion, Skeleton
from motionary.recording import Recording
from motionary.samples import synthetic_motion
from motionary.skeletons import find_mapping, known_mappings, named_mapping
from rig_cases import RIGS, STRANGERS, dog, rest_places, rig_motion, standing

ENDS = {"headtop", "ltoes", "rtoes", "lfingers", "rfingers"}
HANDS = {"lfingers", "rfingers"}
#: Joints that a rig has no names for.
MISSING = {
    "optitrack": {"headtop"} | HANDS,
    "xsens_segments": {"headtop"} | HANDS,
    "bandai": {"headtop"} | HANDS,
    "unreal": {"headtop"},
    "vrm": {"headtop"},
    "smpl": {"headtop"},
    "smplh": {"headtop"},
    "smplx": {"headtop"},
    "humanml3d": {"headtop"} | HANDS,
    "kinect_v2": {"headtop"},
    "kinect_azure": {"headtop"},
}

#: Where the automatic mapping differs from the table, and why.
DIFFERENT = {
    "cmu_bvh": {
        ("lwrist", "rwrist"): "LeftHand ends the radius of the Acclaim file; its wrist is the next"
    },
    "character_creator": {
        ("belly",): "Waist is the first joint of the spine; the table takes the next, at the belly",
        ("headtop",): "the table puts it by eyes and jaw, which a guess leaves out",
    },
    "smplh": {("lfingers", "rfingers"): "the table takes the knuckle, as SMPL has it"},
    "smplx": {("lfingers", "rfingers"): "the table takes the knuckle, as SMPL has it"},
    "kinect_v2": {
        ("neck", "lclavicle", "rclavicle"): "Neck is the throat; the table takes SpineShoulder",
        ("chest",): "the table puts it between SpineMid and SpineShoulder",
    },
}


def round_trip(name, folder, **options):
    motion = rig_motion(name, **options)
    write(motion, folder / "rig.bvh")
    return motion, read(folder / "rig.bvh")


@pytest.mark.parametrize("name", RIGS)
def test_a_file_of_each_rig_has_its_relations(name, tmp_path):
    made, motion = round_trip(name, tmp_path)
    assert motion.mapping is not None
    known = {"humanml3d": {"smpl", "humanml3d", "smplh", "smplx"}}.get(name, {name})
    assert motion.mapping.name in known
    assert motion.notes[0].startswith("unit cm, by legs of 0.83 m")
    generic = motion.generic_positions()
    missing = {j for i, j in enumerate(GENERIC_JOINTS) if np.isnan(generic[:, i]).all()}
    assert missing == MISSING.get(name, set())
    places = replace(made, mapping=motion.mapping).generic_positions()
    np.testing.assert_allclose(generic, places, atol=1e-5)
    unknown = {
        FULL_BODY.ids[i]
        for i in np.flatnonzero(~compute_features(motion).known_features.any(axis=0))
    }
    lacking = {
        feature.id
        for feature in FULL_BODY.features
        if missing
        & set(feature.joints[:1] if "lowest" in str(feature.quantity) else feature.joints)
    }
    lengths = {"F37"} if "headtop" in missing else set()
    assert unknown == lacking | lengths
    assert motion.mapping.note or not missing - HANDS - {"headtop"}


@pytest.mark.parametrize("name", RIGS)
def test_the_automatic_mapping_equals_the_table(name, tmp_path):
    _, motion = round_trip(name, tmp_path)
    table = motion.mapping
    guess = find_mapping(motion.names, motion.skeleton, motion.positions, without=known_mappings())
    assert guess.name == "guessed"
    there = set(motion.names)
    different = {
        joint
        for joint, source in table.weights.items()
        if set(source) <= there and set(guess.weights.get(joint, ())) != set(source)
    }
    assert different == {joint for joints in DIFFERENT.get(name, {}) for joint in joints}
    # What the table does not have, nor has the guess, but for ends of bones.
    assert set(guess.weights) - set(table.weights) <= ENDS


@pytest.mark.parametrize(
    "path", ["cmu/01_01.amc", "cmu/01_01.bvh", "cmu/iclone_07_01.bvh", "bandai/bow_old_001.bvh"]
)
def test_the_automatic_mapping_of_recordings(data, path):
    motion = read(data / path)
    guess = find_mapping(motion.names, motion.skeleton, motion.positions, without=known_mappings())
    there = set(motion.names)
    different = {
        joint
        for joint, source in motion.mapping.weights.items()
        if set(source) <= there and set(guess.weights.get(joint, ())) != set(source)
    }
    allowed = DIFFERENT.get(motion.mapping.name, {})
    assert different == {joint for joints in allowed for joint in joints}


@pytest.mark.parametrize("prefix", ["mixamorig:", "mixamorig1:", ""])
def test_mixamo_with_each_of_its_prefixes(prefix, tmp_path):
    _, motion = round_trip(
        "mixamo", tmp_path, rename=lambda joint: joint.replace("mixamorig:", prefix)
    )
    assert motion.mapping.name == "mixamo"
    assert motion.mapping.weights["lknee"] == {f"{prefix}LeftLeg": 1.0}


SPELLINGS = {
    "Bip01 L Thigh": {"Left": "Bip01 L ", "Right": "Bip01 R ", "UpLeg": "Thigh", "Leg": "Calf"},
    "thigh.L": {"Left(.*)": r"\1.L", "Right(.*)": r"\1.R", "UpLeg": "thigh", "Leg": "shin"},
    "lThigh": {"Left": "l", "Right": "r", "UpLeg": "Thigh", "Leg": "Shin"},
    "LTHIGH": {"Left": "L", "Right": "R", "UpLeg": "THIGH", "Leg": "SHIN"},
    "Oberschenkel_links": {"Left(.*)": r"\1_links", "Right(.*)": r"\1_rechts"},
    "左足": {"Left": "左", "Right": "右", "UpLeg": "足", "Leg": "ひざ", "Foot": "足首"},
    "left_ThighBone": {"Left": "left_", "Right": "right_", "UpLeg": "ThighBone"},
}


def spell(joint, spelling):
    joint = joint.removeprefix("mixamorig:")
    for old, new in SPELLINGS[spelling].items():
        joint = re.sub(old, new, joint)
    return joint


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_sides_are_told_in_many_spellings(spelling, tmp_path):
    made, motion = round_trip("mixamo", tmp_path, rename=lambda joint: spell(joint, spelling))
    assert motion.mapping.name == "guessed"
    known = replace(
        made, names=rig_motion("mixamo").names, mapping=named_mapping("mixamo"), skeleton=None
    )
    known = replace(known, mapping=named_mapping("mixamo", known.names))
    np.testing.assert_allclose(motion.generic_positions(), known.generic_positions(), atol=1e-5)


#: Joints that a stranger lacks.
WITHOUT = {
    "daz": {"headtop"},
    "rigify": {"headtop"},
    "vroid": {"headtop"},
    "mmd": {"headtop"},
}


@pytest.mark.parametrize("name", STRANGERS)
def test_rigs_of_other_programs_are_mapped(name, tmp_path):
    made, motion = round_trip(name, tmp_path)
    assert motion.mapping.name == "guessed"
    at_rest = Motion(made.names, rest_places(name)[None], motion.recording, motion.mapping)
    generic = at_rest.generic_positions()[0]
    missing = {j for j, place in zip(GENERIC_JOINTS, generic, strict=True) if np.isnan(place).any()}
    assert missing == WITHOUT.get(name, set())
    for joint, place in zip(GENERIC_JOINTS, generic, strict=True):
        if joint in missing or joint in motion.mapping.substituted:
            continue
        np.testing.assert_allclose(place, standing()[joint], atol=1e-9, err_msg=joint)


def without_joints(motion, pattern):
    """A recording without the joints of these names and what hangs on them."""
    gone = {name for name in motion.names if re.search(pattern, name)}
    parents = motion.skeleton.parents
    for name, parent in zip(motion.names, parents.tolist(), strict=True):
        if parent >= 0 and motion.names[parent] in gone:
            gone.add(name)
    kept = [i for i, name in enumerate(motion.names) if name not in gone]
    place = {joint: i for i, joint in enumerate(kept)} | {-1: -1}
    names = tuple(motion.names[i] for i in kept)
    above = np.array([place[int(parents[i])] for i in kept])
    skeleton = Skeleton(names, above, motion.skeleton.offsets[kept])
    return names, skeleton, motion.positions[:, kept]


LEGS = {side + joint for side in "lr" for joint in ("hip", "knee", "ankle", "toes")}
TRUNK = {"root", "belly", "chest", "neck", "head", "headtop"}


@pytest.mark.parametrize(
    ("pattern", "there"),
    [
        ("Shoulder|Arm", LEGS | TRUNK),
        ("Shoulder|Arm|Spine", LEGS | {"root"}),
        ("LeftShoulder", LEGS | TRUNK),
        ("UpLeg", set()),
        ("LeftUpLeg", set()),
    ],
    ids=["no arms", "legs alone", "one arm", "no legs", "one leg"],
)
def test_a_rig_that_lacks_limbs_is_mapped_as_far_as_it_goes(pattern, there):
    motion = rig_motion("mixamo")
    names, skeleton, positions = without_joints(motion, pattern)
    mapping = find_mapping(names, skeleton, positions, without=known_mappings())
    assert set(mapping.weights if mapping else ()) == there


def without_names(motion):
    names = tuple(f"b{i}" for i in range(len(motion.names)))
    skeleton = Skeleton(names, motion.skeleton.parents, motion.skeleton.offsets)
    return replace(motion, names=names, skeleton=skeleton, mapping=None)


@pytest.mark.parametrize("name", ["mixamo", "bandai", "xsens_segments", "optitrack"])
def test_a_rig_without_any_names_is_mapped_by_its_shape(name, tmp_path):
    made = rig_motion(name)
    write(without_names(made), tmp_path / "b.bvh")
    motion = read(tmp_path / "b.bvh")
    table = replace(made, mapping=named_mapping(name, made.names)).generic_positions()
    mine = motion.generic_positions()
    needed = [i for i, j in enumerate(GENERIC_JOINTS) if j not in ENDS and j != "head"]
    np.testing.assert_allclose(mine[:, needed], table[:, needed], atol=1e-5)
    assert any("by the shape of their tree alone" in note for note in [motion.mapping.note])


def test_the_mapping_is_said_saved_edited_and_given_back(tmp_path):
    _, motion = round_trip("mixamo", tmp_path, rename=lambda joint: spell(joint, "lThigh"))
    assert "lhip lThigh" in motion.mapping.note
    save_skeleton(motion, tmp_path / "my rig.toml")
    again = read(tmp_path / "rig.bvh", skeleton=tmp_path / "my rig.toml")
    assert again.mapping.name == "my rig"
    assert again.mapping.weights == motion.mapping.weights
    text = (tmp_path / "my rig.toml").read_text()
    assert 'lfingers = "lHandMiddle4"' in text
    text = text.replace('lfingers = "lHandMiddle4"', 'lfingers = ["no such joint", "lHandIndex1"]')
    (tmp_path / "edited.toml").write_text(text)
    edited = read(tmp_path / "rig.bvh", skeleton=str(tmp_path / "edited.toml"))
    assert edited.mapping.weights["lfingers"] == {"lHandIndex1": 1.0}
    # An array file keeps what its joints are, even by a table called as a known skeleton.
    (tmp_path / "mixamo.toml").write_text(text)
    namesake = read(tmp_path / "rig.bvh", skeleton=tmp_path / "mixamo.toml")
    for motion in (edited, namesake):
        write(motion, tmp_path / "kept.npz")
        kept = read(tmp_path / "kept.npz")
        np.testing.assert_array_equal(kept.generic_positions(), edited.generic_positions())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("about = ", "no TOML"),
        ('about = "x"', r"\[joints\] is not there"),
        ('[joints]\nlhipp = "a"', "'lhipp' is none of the joints"),
        ("[joints]\nlhip = 3", "a name or a sum of names"),
        ('colour = "x"\n[joints]\nlhip = "a"', "got 'colour'"),
        ('[joints]\nlhip = "a"', "has none of the joints of skeleton rig"),
    ],
)
def test_a_wrong_table_is_told(text, message, tmp_path):
    write(rig_motion("mixamo"), tmp_path / "take.bvh")
    (tmp_path / "rig.toml").write_text(text)
    with pytest.raises(InvalidInput, match=message):
        read(tmp_path / "take.bvh", skeleton=tmp_path / "rig.toml")


# -- what is no single person -----------------------------------------------------------


def beside(first, second, names):
    """Two motions in one tree file."""
    parents = [
        *first.skeleton.parents,
        *(p + len(first.names) if p >= 0 else -1 for p in second.skeleton.parents),
    ]
    offsets = np.concatenate(
        [first.skeleton.offsets, second.skeleton.offsets + np.array([1.0, 0, 0])]
    )
    both = np.concatenate([first.positions, second.positions], axis=1)
    return Motion(
        names, both, Recording(rate_hz=60.0),
        skeleton=Skeleton(names, np.array(parents, dtype=np.intp), offsets),
        rotations=np.concatenate([first.rotations, second.rotations], axis=1),
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["prefix", "numbered", "suffix"])
def test_two_people_in_a_file_are_told_and_not_measured(kind, tmp_path):
    one = rig_motion("mixamo")
    plain = [name.removeprefix("mixamorig:") for name in one.names]
    others = {
        "prefix": ([f"anna:{n}" for n in plain], [f"bert:{n}" for n in plain]),
        "numbered": (plain, plain),
        "suffix": (plain, [f"{n}_B" for n in plain]),
    }[kind]
    names = tuple(
        f"{n}#{i}" if kind == "numbered" else n for i, part in enumerate(others) for n in part
    )
    write(beside(one, one, names), tmp_path / "two.bvh")
    if kind == "numbered":
        text = (tmp_path / "two.bvh").read_text()
        (tmp_path / "two.bvh").write_text(re.sub(r"#\d", "", text))
    motion = read(tmp_path / "two.bvh")
    assert motion.mapping is None
    with pytest.raises(InvalidInput, match="2 people in one file"):
        compute_features(motion)


@pytest.mark.parametrize("named", [True, False])
def test_an_animal_is_told_and_not_measured(named, tmp_path):
    animal = dog()
    if not named:
        names = tuple(name.replace("Arm", "Leg").replace("Hand", "Paw") for name in animal.names)
        animal = replace(animal, names=names, skeleton=replace(animal.skeleton, names=names))
    write(animal, tmp_path / "dog.npz")
    motion = read(tmp_path / "dog.npz")
    assert motion.mapping is None
    with pytest.raises(InvalidInput, match="four legs"):
        compute_features(motion)


def test_who_bends_down_with_bent_knees_is_no_animal(data):
    motion = read(data / "hdm05" / "depositFloorR" / "HDM_tr_depositFloorR_029_120.amc")
    for first in range(0, motion.n_frames - 60, 12):
        places = motion.positions[first : first + 60]
        assert find_mapping(motion.names, motion.skeleton, places) == motion.mapping


def test_people_on_all_fours_are_people(data):
    for name in ("squat", "kick_left"):
        motion = synthetic_motion(name, seed=1)
        assert find_mapping(motion.names, motion.skeleton, motion.positions) is not None


def test_a_prop_is_told(tmp_path):
    names = ("Sword", "Blade", "End of Blade")
    skeleton = Skeleton(
        names, np.array([-1, 0, 1]), np.array([[0, 1, 0], [0, 0.1, 0], [0, 0.9, 0.0]])
    )
    positions = np.tile(np.cumsum(skeleton.offsets, axis=0), (5, 1, 1))
    write(
        Motion(names, positions, Recording(rate_hz=30.0), skeleton=skeleton), tmp_path / "sword.npz"
    )
    motion = read(tmp_path / "sword.npz")
    with pytest.raises(InvalidInput, match="a prop"):
        compute_features(motion)
