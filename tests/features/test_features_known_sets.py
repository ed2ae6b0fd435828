"""Sets beside the 40 relations: their size, their mirror images, how they are written down."""

from dataclasses import replace

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.features import (
    FULL_BODY,
    LEGS,
    THREE_LEVELS,
    FeatureSet,
    compute_features,
    describe_set,
    find_feature,
    known_sets,
    set_from_rows,
)
from motionary.packing import unpack
from motionary.samples import synthetic_motion


def test_sets_are_known_by_name():
    assert {name: len(one) for name, one in known_sets().items()} == {
        "full-body-40": 40,
        "full-body-39": 39,
        "legs-14": 14,
        "three-levels-129": 129,
        "everyday-448": 448,
    }
    assert all(one.name == name for name, one in known_sets().items())


def test_the_middle_level_is_the_published_relation():
    middle = {r.id: r for r in THREE_LEVELS.features}
    split = {"F25", "F26", "F32"}
    assert all(middle[r.id] == r for r in FULL_BODY.features if r.id not in split)
    packed = compute_features(synthetic_motion("squat", seed=0), feature_set=THREE_LEVELS)
    published = compute_features(synthetic_motion("squat", seed=0))
    features = dict(zip(THREE_LEVELS.ids, packed.features.T, strict=True))
    for feature, row in zip(FULL_BODY.features, published.features.T, strict=True):
        if feature.id not in split:
            assert np.array_equal(features[feature.id], row), feature.id


@pytest.mark.parametrize("motion", ["squat", "kick_left", "jump"])
def test_a_harder_level_holds_less_often(motion):
    packed = compute_features(synthetic_motion(motion, seed=1), feature_set=THREE_LEVELS)
    fraction = dict(zip(THREE_LEVELS.ids, packed.features.mean(axis=0), strict=True))
    for id_ in THREE_LEVELS.ids[1::3]:
        # One frame: the switches of two levels may close in another order.
        slack = 1 / len(packed)
        assert fraction[f"{id_}-"] + slack >= fraction[id_] >= fraction[f"{id_}+"] - slack, id_


def test_words_of_129_relations_pack_into_three_integers():
    packed = compute_features(synthetic_motion("kick_left", seed=0), feature_set=THREE_LEVELS)
    assert packed.packed.shape == (len(packed), 3)
    assert np.array_equal(unpack(packed.packed, 129), packed.features)
    swapped = THREE_LEVELS.mirror_order
    assert np.array_equal(swapped[swapped], np.arange(129))
    assert swapped[THREE_LEVELS.ids.index("F13+")] == THREE_LEVELS.ids.index("F14+")


@pytest.mark.parametrize("one", known_sets().values(), ids=lambda s: s.name)
def test_a_set_that_is_written_down_is_the_same_set(one):
    rows = describe_set(one)
    assert set_from_rows(one.name, rows) == one


def test_a_quantity_of_ones_own_cannot_be_written_down():
    own = replace(FULL_BODY.features[16], quantity=lambda body, window_s, joint: body[joint][1])
    assert describe_set(FeatureSet("own", (replace(own, mirror=own.id),))) is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weak": None}, "'F17': weak has no meaning as None"),
        ({"weak": True}, "'F17': weak has no meaning as True"),
        ({"weak": [1.0]}, "'F17': weak must be a number, or a pair"),
        ({"weak": [1.0, "a"]}, "'F17': weak must be a number, or a pair"),
        ({"weak": 9.0}, "F17: the strong threshold must lie at or beyond the weak one"),
        ({"quantity": "len"}, "'F17': no quantity 'len'; .* plane, "),
        ({"test": "=="}, "'F17': test must be one of >"),
        ({"joints": ["rtoes", "ltoes", 3]}, "F17: 3 is no generic joint"),
        ({"quantity": "tilt"}, "'F17': its quantity takes other joints"),
        ({"unit": "cubit"}, "F17: unit must be one of"),
        ({"id": 5}, "5: id has no meaning as 5"),
        ({"window_s": -1.0}, "F17: window_s must be at least 0"),
        ({"mirror": "F99"}, "the mirror of 'F17' must be a feature"),
    ],
)
def test_rows_that_make_no_sense_name_relation_and_field(change, message):
    rows = describe_set(LEGS)
    row = next(row for row in rows if row["id"] == "F17")
    row.update(change)
    with pytest.raises(InvalidInput, match=message):
        set_from_rows("legs", rows)


def test_a_missing_field_is_named():
    rows = describe_set(LEGS)
    del rows[2]["unit"]
    with pytest.raises(InvalidInput, match="'F17': unit is missing"):
        set_from_rows("legs", rows)


def test_rows_without_a_phrase_for_no_still_read():
    rows = describe_set(LEGS)
    without = [{key: value for key, value in row.items() if key != "no"} for row in rows]
    read = set_from_rows("legs", without)
    assert [f.phrase(False) for f in read.features] == [f"not {name}" for name in LEGS.names]
    assert describe_set(read) == without


def test_relations_are_found_by_name_and_id():
    assert find_feature("F13", FULL_BODY) == find_feature(" Right  hand FAST ", FULL_BODY) == 12
    assert find_feature("f13+", THREE_LEVELS) == THREE_LEVELS.ids.index("F13+")
    with pytest.raises(InvalidInput, match="did you mean 'right hand fast'"):
        find_feature("right hand fsat", FULL_BODY)
    with pytest.raises(InvalidInput, match="'right hand above neck'"):
        find_feature("neck", FULL_BODY)
    with pytest.raises(InvalidInput, match="it has right foot behind left leg, left foot"):
        find_feature("xyz", LEGS)
    twice = [replace(r, name="same") for r in LEGS.features[:2]]
    with pytest.raises(InvalidInput, match="may be each of F15, F16; write the id"):
        find_feature("same", FeatureSet("twice", tuple(twice)))
