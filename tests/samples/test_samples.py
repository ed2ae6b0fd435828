"""Are synthetic motions said to be synthetic, sound as movement, and told apart?"""

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, compute_features
from motionary.matching import Pattern, distance_function
from motionary.models.templates import learn_template, quantise
from motionary.motion import GENERIC_JOINTS, forward_kinematics
from motionary.rotations import quaternions_to_matrices
from motionary.samples import (
    PHRASES,
    SYNTHETIC_CLASSES,
    parse_phrases,
    synthetic_motion,
    synthetic_stream,
)
from motionary.samples.phrases import Phrase, Target, curves, end_of, shift, vary

FLYING = ("jump", "jumping_jack")
# Relations that hold at some time in every performance of a class.
SHOWN = {
    "squat": "F20 F21 F29 F30",
    "kick_left": "F18 F26 F30",
    "kick_right": "F17 F25 F29",
    "raise_arms": "F3 F4 F5 F6 F9 F27 F28",
    "rotate_arms": "F3 F4 F5 F6",
    "jump": "F5 F6 F20 F21 F25 F26 F39",
    "walk": "F15 F16 F25 F26 F39",
    "bow": "F29 F30 F31 F32 F37",
    "pick_up_right": "F20 F21 F33 F37",
    "wave_right": "F3 F7",
    "punch_right": "F1 F7 F8",
    "spin_left": "F20 F40",
    "jumping_jack": "F3 F4 F9 F19 F23 F24",
}


@pytest.fixture(scope="module")
def performances():
    """Words of ten performances of each class."""
    return {
        name: [compute_features(synthetic_motion(name, seed=seed)) for seed in range(10)]
        for name in SYNTHETIC_CLASSES
    }


@pytest.fixture(scope="module")
def patterns(performances):
    """A quantised template of each class from its first six performances."""
    result = {}
    for name, packed in performances.items():
        template = learn_template(
            [w.features for w in packed[:6]],
            feature_names=FULL_BODY.ids,
            feature_set=FULL_BODY.name,
        )
        fixed = quantise(template, tolerance=0.1)
        result[name] = Pattern(fixed.packed_values, fixed.packed_fixed, fixed.weights)
    return result


def joint(name):
    return GENERIC_JOINTS.index(name)


# -- the figure -------------------------------------------------------------------------


@pytest.mark.parametrize("name", SYNTHETIC_CLASSES)
def test_a_motion_says_that_it_is_synthetic(name):
    motion = synthetic_motion(name, seed=11)
    assert motion.source == f"synthetic {name} 11"
    assert "synthetic" in motion.notes[0]
    assert motion.names == GENERIC_JOINTS
    assert motion.mapping.name == "generic"
    assert np.isfinite(motion.positions).all()


@pytest.mark.parametrize("name", SYNTHETIC_CLASSES)
def test_the_lowest_joint_is_on_the_floor_but_in_flight(name):
    lowest = synthetic_motion(name, seed=2).positions[:, :, 1].min(axis=1)
    assert lowest.min() > -1e-12
    assert lowest[[0, -1]] == pytest.approx(0, abs=1e-12)
    if name in FLYING:
        assert 0.05 < lowest.max() < 0.6
    else:
        assert lowest.max() < 1e-12


@pytest.mark.parametrize("name", SYNTHETIC_CLASSES)
def test_positions_are_those_of_skeleton_and_rotations(name):
    motion = synthetic_motion(name, seed=3, rate_hz=30)
    placed = forward_kinematics(
        motion.skeleton, quaternions_to_matrices(motion.rotations), motion.positions[:, 0]
    )
    np.testing.assert_allclose(placed, motion.positions, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_figure_is_symmetric_and_of_human_size(seed):
    motion = synthetic_motion("bow", seed=seed)
    offsets = dict(zip(motion.names, motion.skeleton.offsets, strict=True))
    for name in GENERIC_JOINTS:
        if name.startswith("l"):
            mirrored = offsets["r" + name[1:]] * (-1, 1, 1)
            np.testing.assert_array_equal(offsets[name], mirrored)
    height = np.ptp(motion.positions[0, :, 1])
    assert 1.3 < height < 2.1


def test_what_stands_on_the_floor_stays_where_it_is():
    positions = synthetic_motion("squat", seed=1).positions
    for toes in ("ltoes", "rtoes"):
        assert np.ptp(positions[:, joint(toes), ::2], axis=0).max() < 0.06


def test_a_walk_gets_on_in_the_direction_it_faces():
    for seed in range(5):
        positions = synthetic_motion("walk", seed=seed).positions
        across = positions[0, joint("lhip")] - positions[0, joint("rhip")]
        ahead = np.cross(across, [0, 1, 0])
        moved = positions[-1, 0] - positions[0, 0]
        assert moved @ ahead / np.linalg.norm(ahead) > 1.0


def test_a_seed_gives_the_same_bytes_and_another_one_another_motion():
    first, again, other = (synthetic_motion("kick_left", seed=s) for s in (5, 5, 6))
    assert first.positions.tobytes() == again.positions.tobytes()
    assert first.n_frames != other.n_frames
    assert not np.array_equal(first.skeleton.offsets, other.skeleton.offsets)
    twin = synthetic_motion("kick_right", seed=5)
    assert twin.positions.shape != first.positions.shape


@pytest.mark.parametrize("rate_hz", [30, 60, 240])
def test_a_motion_is_the_same_at_other_rates(rate_hz):
    motion, other = (synthetic_motion("jumping_jack", seed=4, rate_hz=r) for r in (120, rate_hz))
    assert other.duration_s == pytest.approx(motion.duration_s, abs=0.02)
    step, other_step = max(1, 120 // rate_hz), max(1, rate_hz // 120)
    common = zip(motion.positions[::step], other.positions[::other_step], strict=False)
    # Where it lands is summed up frame by frame; its poses are the same.
    for pose, other_pose in common:
        np.testing.assert_allclose(pose - pose[0], other_pose - other_pose[0], atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(name="sqat", seed=0), "no synthetic class 'sqat'; choose one of bow"),
        (dict(name="squat", seed=-1), "seed must be a whole number"),
        (dict(name="squat", seed=0, rate_hz=0), "rate_hz must lie between"),
        (dict(name="squat", seed=0, rate_hz=float("nan")), "rate_hz must lie between"),
    ],
)
def test_what_cannot_be_made_is_told(arguments, message):
    with pytest.raises(InvalidInput, match=message):
        synthetic_motion(**arguments)


# -- classes ----------------------------------------------------------------------------


def test_classes_are_a_few_lines_each():
    assert tuple(PHRASES) == SYNTHETIC_CLASSES == tuple(SHOWN)
    for text in PHRASES.values():
        assert 1 <= len(parse_phrases(text)) <= 20


@pytest.mark.parametrize("name", SYNTHETIC_CLASSES)
def test_a_class_shows_what_it_is(performances, name):
    for packed in performances[name]:
        held = {FULL_BODY.ids[i] for i in np.flatnonzero(packed.features.any(axis=0))}
        assert set(SHOWN[name].split()) <= held
        assert packed.known_features.all()


@pytest.mark.parametrize("name", SYNTHETIC_CLASSES)
def test_a_template_costs_its_own_clips_less_than_others(performances, patterns, name):
    costs = {
        other: [float(distance_function(patterns[name], w.packed).min()) for w in packed[6:]]
        for other, packed in performances.items()
    }
    own = max(costs.pop(name))
    assert own < 0.02
    assert min(min(c) for c in costs.values()) > 2 * own + 0.02


# -- streams ----------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [0, 1])
def test_a_template_finds_its_motions_in_a_stream(patterns, seed):
    order = np.random.default_rng(seed).permutation(len(SYNTHETIC_CLASSES))
    motion, labels = synthetic_stream([SYNTHETIC_CLASSES[i] for i in order], seed=seed)
    packed = compute_features(motion)
    costs = {name: distance_function(p, packed.packed) for name, p in patterns.items()}
    for name, start_s, end_s in labels:
        around = slice(int(30 * (start_s + end_s) / 2), int(30 * (end_s + 0.5)))
        assert min(costs, key=lambda n: costs[n][around].min()) == name
        assert costs[name][around].min() < 0.05


def test_a_stream_says_where_its_motions_are():
    names = ["squat", "kick_left", "squat", "spin_left"]
    motion, labels = synthetic_stream(names, seed=7)
    again, _ = synthetic_stream(names, seed=7)
    assert motion.positions.tobytes() == again.positions.tobytes()
    assert motion.source == "synthetic stream 7"
    assert [name for name, _, _ in labels] == names
    times = [0.0, *(t for _, start_s, end_s in labels for t in (start_s, end_s)), motion.duration_s]
    pauses, lengths = np.diff(times)[::2], np.diff(times)[1::2]
    assert (pauses >= 0.79).all()
    assert (pauses <= 1.61).all()
    assert (lengths > 0.7).all()


def test_a_stream_stands_between_its_motions():
    motion, labels = synthetic_stream(["squat", "jump", "bow"], seed=8)
    knees = compute_features(motion).features[:, [FULL_BODY.ids.index("F20")]]
    ends = [0.0, *(end_s for _, _, end_s in labels)]
    starts = [*(start_s for _, start_s, _ in labels), motion.duration_s]
    for end_s, start_s in zip(ends, starts, strict=True):
        assert not knees[int(end_s * 30) + 1 : int(start_s * 30)].any()


def test_a_stream_without_motions_stands():
    motion, labels = synthetic_stream([], seed=0)
    assert labels == []
    assert motion.duration_s > 0.7


# -- phrases ----------------------------------------------------------------------------


def test_phrases_are_read_as_they_are_meant():
    phrases = parse_phrases("""
        0.0-0.5 s: knees 90, left shoulder aside 30, root pitch -20
        1 - 2 s: spine twist 10.5
    """)
    assert phrases == (
        Phrase(
            0.0,
            0.5,
            (
                Target("lknee bend", 90),
                Target("rknee bend", 90),
                Target("lshoulder aside", 30),
                Target("root pitch", -20),
            ),
        ),
        Phrase(1.0, 2.0, (Target("spine twist", 10.5),)),
    )
    assert end_of(phrases) == 2.0
    assert shift(phrases, 1.5)[1] == Phrase(2.5, 3.5, (Target("spine twist", 10.5),))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "at least one phrase"),
        ("knees 90", "expected '0.0-0.6 s: knees 90"),
        ("0.0-0.5 s: ", "expected '0.0-0.6 s: knees 90"),
        ("0.0-0.5 s: ,", "'left', 'right' or a plural"),
        ("0.5-0.5 s: knees 90", "start before it ends"),
        ("0.0.1-0.5 s: knees 90", "could not convert"),
        ("0.0-0.5 s: knee 90", "'left', 'right' or a plural"),
        ("0.0-0.5 s: left knees 90", "'left', 'right' or a plural"),
        ("0.0-0.5 s: left spine 90", "'left', 'right' or a plural"),
        ("0.0-0.5 s: tail 90", "'left', 'right' or a plural"),
        ("0.0-0.5 s: knees aside 90", r"a direction of knee \(bend\) and a number"),
        ("0.0-0.5 s: root 1", "a direction of root"),
        ("0.0-0.5 s: knees bend", "could not convert string to float: 'bend'"),
        ("0.0-0.5 s: knees nan", "a finite number"),
        ("0.0-0.5 s: knees 90 80", "a direction of knee"),
        ("0.0-0.5 s: knees 90,", "'left', 'right' or a plural"),
    ],
)
def test_a_line_that_is_no_phrase_is_quoted(text, message):
    with pytest.raises(InvalidInput, match=message):
        parse_phrases(text)


def test_channels_move_smoothly_from_target_to_target():
    text = "1-2 s: left knee 80\n 3-5 s: left knee 20, root forward 1\n 6-7 s: root forward 1"
    times = np.array([0.0, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 9.0])
    got = curves(parse_phrases(text), times)
    assert got["lknee bend"].tolist() == [0, 0, 40, 80, 80, 80, 50, 20, 20]
    # Of the root, `forward` counts from where the stretch began.
    assert got["root forward"].tolist() == [0, 0, 0, 0, 0, 0, 0.5, 1, 2]
    assert set(got) == {"lknee bend", "root forward"}


def test_a_channel_is_moved_by_one_phrase_at_a_time():
    with pytest.raises(InvalidInput, match="'lknee bend' at once"):
        curves(parse_phrases("0-1 s: knees 9\n 0.5-2 s: left knee 8"), np.zeros(3))


def test_variation_keeps_the_sequence_and_none_keeps_the_phrases():
    phrases = parse_phrases(PHRASES["jump"])
    rng = np.random.default_rng(0)
    assert vary(phrases, rng, tempo=0.0, amplitude=0.0) == phrases
    varied = vary(phrases, rng, tempo=0.2, amplitude=0.2)
    assert varied != phrases
    bounds = [[t for p in some for t in (p.start_s, p.end_s)] for some in (phrases, varied)]
    ranks = [np.unique(b, return_inverse=True)[1].tolist() for b in bounds]
    assert ranks[0] == ranks[1]
    for before, after in zip(phrases, varied, strict=True):
        assert [t.channel for t in before.targets] == [t.channel for t in after.targets]
