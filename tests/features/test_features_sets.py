"""Are arrays of positions and sets of other relations taken as they are meant?"""

from dataclasses import replace

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.features import (
    FULL_BODY,
    FULL_BODY_2006,
    Feature,
    FeatureSet,
    compute_features,
    feature_matrix,
    known_sets,
)
from motionary.features import quantities as q
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.recording import Recording
from motionary.samples import synthetic_motion
from motionary.skeletons import find_mapping, named_mapping
from oracles.features import as_array, standing

POSITIONS = as_array([standing()] * 3)


@pytest.fixture(scope="module")
def bow():
    return synthetic_motion("bow", seed=3)


# -- arrays -----------------------------------------------------------------------------


def test_an_array_gives_the_words_of_its_motion(bow):
    packed = compute_features(bow).packed
    got = compute_features(bow.positions, rate_hz=bow.rate_hz)
    assert np.array_equal(got.packed, packed)
    order = np.random.default_rng(0).permutation(24)
    names = [GENERIC_JOINTS[i] for i in order]
    got = compute_features(bow.positions[:, order].tolist(), rate_hz=120, skeleton=names)
    assert np.array_equal(got.packed, packed)


def test_an_array_of_smpl_joints_is_known_but_for_the_top_of_the_head(bow):
    mapping = named_mapping("smpl")
    generic = {source: joint for joint, weights in mapping.weights.items() for source in weights}
    # SMPL has a joint more in the spine and none on the head.
    place = [GENERIC_JOINTS.index(generic.get(name, "chest")) for name in mapping.order]
    got = compute_features(bow.positions[:, place], rate_hz=120, skeleton="smpl")
    full = compute_features(bow)
    unknown = np.flatnonzero(~got.known_features.any(axis=0))
    assert [FULL_BODY.ids[i] for i in unknown] == ["F37", "F38"]
    differ = (full.packed ^ got.packed) & got.known
    assert not differ.any()
    assert "F37" in mapping.note


def test_tables_of_arrays_name_each_joint_of_their_order():
    for name in ("generic", "smpl"):
        mapping = named_mapping(name)
        used = {source for weights in mapping.weights.values() for source in weights}
        assert len(mapping.order) == len(set(mapping.order)) == 24
        # Arrays of SMPL end at the head; files that name its top are taken at their word.
        assert used - {"head_top"} <= set(mapping.order)
        assert find_mapping(mapping.order).name == name


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(motion=POSITIONS), "needs rate_hz="),
        (dict(motion=POSITIONS, rate_hz=0), "rate_hz must be a positive"),
        (dict(motion=POSITIONS, rate_hz=0.01), "at least 1 frames per second, got 0.01"),
        (dict(motion=POSITIONS[0], rate_hz=30), r"\(frames, joints, 3\), got \(24, 3\)"),
        (dict(motion=POSITIONS[:0], rate_hz=30), "at least one frame"),
        (dict(motion=POSITIONS[:, :22], rate_hz=30), "24 joints, the array has 22"),
        (
            dict(motion=POSITIONS[:, :22], rate_hz=30, skeleton="smpl"),
            "24 joints, the array has 22",
        ),
        (dict(motion=POSITIONS, rate_hz=30, skeleton="spml"), "skeleton must be one of .*smpl"),
        (dict(motion=POSITIONS, rate_hz=30, skeleton="acclaim"), "no usual order"),
        (dict(motion=POSITIONS, rate_hz=30, skeleton=[f"j{i}" for i in range(24)]), "no known"),
        (dict(motion=np.full((3, 24, 3), np.inf), rate_hz=30), "finite"),
        (
            dict(motion=Motion(("a",), np.zeros((3, 1, 3)), Recording(rate_hz=30.0))),
            "no known skeleton",
        ),
        (dict(motion=synthetic_motion("bow", seed=0), rate_hz=30), "go with arrays"),
    ],
)
def test_what_does_not_fit_is_told_clearly(arguments, message):
    motion = arguments.pop("motion")
    with pytest.raises(InvalidInput, match=message):
        compute_features(motion, **arguments)


def test_relations_need_all_generic_joints():
    with pytest.raises(InvalidInput, match="24 generic joints"):
        feature_matrix(np.zeros((3, 23, 3)), FULL_BODY)
    with pytest.raises(InvalidInput, match="one state a feature"):
        feature_matrix(POSITIONS, FULL_BODY, before=np.zeros(39, dtype=bool))


# -- sets of other relations ------------------------------------------------------------


def knee_flexed(degrees):
    return Feature(
        id=f"K{degrees}",
        name=f"right knee flexed beyond {180 - degrees} degrees",
        group="lower",
        quantity=q.angle,
        joints=("rknee", "rhip", "rknee", "rankle"),
        test="<=",
        weak=float(degrees),
        strong=float(degrees),
        unit="degree",
        sentence="The angle at the right knee is at most so large.",
    )


def test_a_set_may_have_more_relations_than_a_word_has_bits(bow):
    ladder = FeatureSet("knee ladder", tuple(knee_flexed(a) for a in range(90, 180)))
    got = compute_features(bow, feature_set=ladder)
    assert got.packed.shape == (len(got), 2)
    angles = relation_angles(bow)
    expected = angles[:, None] <= np.arange(90, 180)
    assert np.array_equal(got.features, expected)
    assert got.known_features.all()


def relation_angles(motion):
    hip, knee, ankle = (
        motion.positions[::4, GENERIC_JOINTS.index(j)] for j in ("rhip", "rknee", "rankle")
    )
    a, b = hip - knee, ankle - knee
    lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    return np.degrees(np.arccos((a * b).sum(axis=1) / lengths))


def head_height(body, window_s, joint):
    return body[joint][1]


def test_a_person_adds_a_relation_with_a_function_of_their_own(bow):
    tall = replace(
        knee_flexed(90), id="T", quantity=head_height, joints=("headtop",), test=">",
        weak=1.0, strong=1.1, unit="hip width", mirror="",
    )  # fmt: skip
    got = compute_features(bow, feature_set=FeatureSet("mine", (tall,)))
    assert got.features.all()
    assert tall.mirror == "T"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (dict(unit="metre"), "unit must be one of humerus"),
        (dict(joints=("rknee", "hip", "rknee", "rankle")), "'hip' is no generic joint"),
        (dict(strong=(10.0, 20.0)), "two pairs of thresholds"),
        (dict(test="within"), "two pairs of thresholds"),
        (dict(strong=95.0), "at or beyond the weak one"),
        (dict(test=">=", strong=85.0), "at or beyond the weak one"),
        (dict(test="within", weak=(60.0, 120.0), strong=(50.0, 110.0)), "at or beyond"),
        (dict(weak=float("nan")), "at or beyond"),
        (dict(window_s=-1.0), "window_s must be at least 0"),
        (dict(mirror="K91"), "mirror of 'K90'"),
    ],
)
def test_a_relation_that_contradicts_itself_is_refused(changes, message):
    with pytest.raises(InvalidInput, match=message):
        FeatureSet("set", (replace(knee_flexed(90), **changes),))


def test_a_set_needs_a_name_relations_and_unique_ids():
    for arguments in (("", (knee_flexed(90),)), ("set", ())):
        with pytest.raises(InvalidInput, match="a name and at least one"):
            FeatureSet(*arguments)
    with pytest.raises(InvalidInput, match="unique"):
        FeatureSet("set", (knee_flexed(90), knee_flexed(90)))


def test_a_quantity_of_the_wrong_shape_is_refused():
    wrong = replace(knee_flexed(90), quantity=lambda body, window_s, *joints: np.zeros(1))
    with pytest.raises(InvalidInput, match=r"one value a frame, shape \(3,\), got \(1,\)"):
        feature_matrix(POSITIONS, FeatureSet("set", (wrong,)))


def test_selecting_keeps_order_and_needs_both_sides():
    assert FULL_BODY_2006.ids == FULL_BODY.ids[:39]
    assert FULL_BODY.select(["F8", "F7"], name="elbows").mirror_order.tolist() == [1, 0]
    with pytest.raises(InvalidInput, match="mirror of 'F7'"):
        FULL_BODY.select(["F7"], name="one elbow")
    with pytest.raises(InvalidInput, match="no feature 'F41'"):
        FULL_BODY.select(["F41"], name="more")


def test_mirror_pairs_are_those_of_the_table():
    pairs = [(1, 2), (3, 4), (5, 6), (7, 8), (11, 12), (13, 14), (15, 16), (17, 18), (20, 21),
             (25, 26), (27, 28), (29, 30), (33, 34), (35, 36)]  # fmt: skip
    expected = np.arange(40)
    for a, b in pairs:
        expected[[a - 1, b - 1]] = b - 1, a - 1
    assert FULL_BODY.mirror_order.tolist() == expected.tolist()
    groups = [r.group for r in FULL_BODY.features]
    assert groups == ["upper"] * 14 + ["lower"] * 12 + ["mix"] * 14


def test_relations_are_told_in_words():
    assert len(set(FULL_BODY.names)) == 40
    for feature in FULL_BODY.features:
        assert feature.sentence.endswith(".")
        assert "{" not in feature.name + feature.sentence


@pytest.mark.parametrize("one", known_sets().values(), ids=lambda s: s.name)
def test_every_feature_has_a_phrase_for_yes_and_one_for_no(one):
    phrases = [feature.phrase(holds) for feature in one.features for holds in (True, False)]
    assert len(set(phrases)) == 2 * len(one)
    assert not any("not" in phrase.split() for phrase in phrases)
    assert not any("{" in phrase or "  " in phrase for phrase in phrases)


def test_phrases_follow_the_side_and_the_level():
    by_id = {feature.id: feature for feature in known_sets()["three-levels-129"].features}
    assert by_id["F28"].phrase(True) == "left upper arm away from the body"
    assert by_id["F28"].phrase(False) == "left arm hangs"
    assert by_id["F7-"].phrase(False) == "right elbow straight (clearly)"
    assert by_id["F7+"].phrase(False) == "right elbow straight (more or less)"


def test_a_feature_without_a_phrase_for_no_says_not():
    assert knee_flexed(90).phrase(False) == f"not {knee_flexed(90).name}"
