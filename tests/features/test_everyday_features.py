"""The set of ranked quantities: the published bits first, its thresholds, sides and directions."""

from dataclasses import replace

import numpy as np
import pytest

from motionary.features import FULL_BODY, Body, compute_features, load_everyday_set
from motionary.features.everyday import QUANTILES, list_quantities
from motionary.features.feature_set import needs_travel
from motionary.motion import GENERIC_JOINTS
from motionary.packing import permute
from motionary.samples import synthetic_motion

EVERYDAY = load_everyday_set()


@pytest.fixture(scope="module")
def kick():
    return synthetic_motion("kick_left", seed=1)


@pytest.fixture(scope="module")
def features(kick):
    return compute_features(kick, feature_set=EVERYDAY)


def moved(motion, *, ahead=0.0, left=0.0, turn=0.0):
    """The motion while its body goes (m/s, seen from itself) and turns left (degrees/s)."""
    t = np.arange(motion.n_frames) / motion.rate_hz
    first = motion.generic_positions()[:1]
    hips = [GENERIC_JOINTS.index(j) for j in ("lhip", "rhip")]
    line = (first[0, hips[0]] - first[0, hips[1]]) * [1, 0, 1]
    line /= np.linalg.norm(line)
    facing = np.array([-line[2], 0, line[0]])
    angle = np.radians(turn * t)
    c, s, z, one = np.cos(angle), np.sin(angle), 0 * t, 1 + 0 * t
    about_up = np.array([[c, z, s], [z, one, z], [-s, z, c]]).transpose(2, 0, 1)
    still = np.einsum("fij,fkj->fki", about_up, np.repeat(first, len(t), axis=0))
    positions = still + (ahead * facing + left * line) * t[:, np.newaxis, np.newaxis]
    return compute_features(positions, rate_hz=motion.rate_hz, feature_set=EVERYDAY)


def fraction(sequence, id_):
    return sequence.features[5:-5, EVERYDAY.ids.index(id_)].mean()


def test_the_first_bits_are_the_published_features(kick, features):
    published = compute_features(kick)
    assert EVERYDAY.features[:40] == FULL_BODY.features
    assert np.array_equal(features.features[:, :40], published.features)
    assert np.array_equal(features.known_features[:, :40], published.known_features)


def test_the_others_compare_a_quantity_with_its_quantiles(kick, features):
    body = Body.from_positions(kick.generic_positions(), rate_hz=kick.rate_hz)
    assert kick.rate_hz == 120
    for i, quantity in enumerate(list_quantities()):
        four = EVERYDAY.features[40 + 4 * i : 44 + 4 * i]
        value = quantity.measure(body)[::4]
        thresholds = [f.weak for f in four]
        assert thresholds == sorted(thresholds)
        rank = (value[:, np.newaxis] >= np.array(thresholds)).sum(axis=1)
        bits = features.features[:, 40 + 4 * i : 44 + 4 * i].astype(int)
        below = np.array([f.test == "<=" for f in four])
        assert below.sum() == (2 if quantity.is_signed else 0)
        assert np.array_equal(np.where(below, 1 - bits, bits).sum(axis=1), rank), quantity.name


def test_as_many_bits_differ_as_ranks_lie_apart(features):
    bits = features.features[:, 40:].reshape(len(features), -1, len(QUANTILES)).astype(int)
    signed = np.array([quantity.is_signed for quantity in list_quantities()])
    ranks = np.where(signed, bits[..., 2:].sum(-1) - bits[..., :2].sum(-1), bits.sum(-1))
    differ = np.abs(bits[0] - bits).sum(axis=-1)
    assert np.array_equal(differ, np.abs(ranks[0] - ranks))


def test_a_mirrored_motion_has_mirrored_bits(kick, features):
    partner = [
        GENERIC_JOINTS.index({"l": "r", "r": "l"}.get(j[0], j[0]) + j[1:] if j != "root" else j)
        for j in GENERIC_JOINTS
    ]
    positions = kick.generic_positions()[:, partner] * np.array([-1.0, 1.0, 1.0])
    mirrored = compute_features(positions, rate_hz=kick.rate_hz, feature_set=EVERYDAY)
    expected = permute(features.packed, EVERYDAY.mirror_order)
    differ = np.bitwise_count(mirrored.packed ^ expected).sum()
    # F1 and F2, which are both measured from the left hip.
    assert differ <= 0.001 * features.features.size


@pytest.mark.parametrize(
    ("move", "held", "failed"),
    [
        ({"ahead": 1.2}, "body goes ahead over 0.5 s>80", "body goes to the left over 0.5 s>80"),
        ({"left": 0.6}, "body goes to the left over 1 s>80", "body goes ahead over 1 s>80"),
        ({"left": -0.6}, "body goes to the left over 1 s<20", "body goes to the left over 1 s>60"),
        (
            {"turn": 40},
            "body turns to the left over 0.3 s>80",
            "body turns to the left over 1 s<40",
        ),
        ({"turn": -40}, "body turns to the left over 1 s<20", "body goes ahead over 0.2 s>80"),
    ],
)
def test_directions_are_those_of_the_body(kick, move, held, failed):
    sequence = moved(kick, **move)
    assert fraction(sequence, held) > 0.9
    assert fraction(sequence, failed) < 0.1


def test_what_needs_travel_is_unknown_in_place(kick):
    kept = compute_features(replace(kick, in_place=True), feature_set=EVERYDAY)
    lost = [f.id for f, seen in zip(EVERYDAY.features, kept.known_features.T, strict=True)
            if not seen.any()]  # fmt: skip
    assert lost == [f.id for f in EVERYDAY.features if needs_travel(f)]
    assert "body goes to the left over 1 s<20" in lost
    assert "left wrist moves ahead>20" not in lost
