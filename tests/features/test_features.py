"""Are the words of a recording right: golden values, invariances, gaps, arrays, sets?"""

from dataclasses import replace

import numpy as np
import pytest

from motionary.errors import InvalidInput
from motionary.features import (
    FULL_BODY,
    FULL_BODY_2006,
    SEQUENCE_HZ,
    FeatureSequence,
    compute_features,
    feature_matrix,
)
from motionary.io import read
from motionary.motion import GENERIC_JOINTS, Motion, resample
from motionary.packing import pack, permute
from motionary.recording import Recording
from motionary.samples import SYNTHETIC_CLASSES, synthetic_motion
from motionary.skeletons import named_mapping
from oracles.features import as_array, standing

# The authors' matrix (39 x 1073) of a take; clips cut from it, the column that each begins
# at, and the offset of its first 120 Hz frame that falls on a column.
TAKE = "feature_matrix_HDM_mm_3-5_c.npz"
ELBOW = "elbowToKnee1RepsLelbowStart"
CLIPS = [
    ("squat1Reps", "037", 806, 3),
    ("squat1Reps", "039", 904, 2),
    ("squat1Reps", "040", 955, 1),
    (ELBOW, "019", 619, 1),
    (ELBOW, "020", 688, 2),
]
# Of each joint the relations that measure with it, or take their length from it.
NEEDS = {
    "root": "F11 F12 F15 F16 F27 F28 F29 F30 F31 F32 F37 F38 F39",
    "lhip": "F1 F2 F15 F19 F21 F22 F23 F24 F30 F35 F36 F40",
    "rhip": "F1 F2 F16 F19 F20 F22 F23 F24 F29 F35 F36 F37 F40",
    "lknee": "F21 F30",
    "rknee": "F20 F29 F37",
    "lankle": "F15 F16 F19 F21 F22 F23 F24 F26 F31 F38",
    "rankle": "F15 F16 F19 F20 F22 F23 F24 F25 F31 F37 F38",
    "ltoes": "F18 F26",
    "rtoes": "F17 F25",
    "belly": "F37",
    "chest": "F3 F4 F5 F6 F37",
    "neck": "F1 F2 F3 F4 F5 F6 F27 F28 F29 F30 F31 F32 F35 F36 F37",
    "head": "F37",
    "headtop": "F37 F38",
    "lclavicle": "",
    "rclavicle": "",
    "lshoulder": "F8 F9 F28 F35 F36",
    "rshoulder": "F7 F9 F27 F35 F36",
    "lelbow": "F8 F28",
    "relbow": "F7 F27",
    "lwrist": "F2 F4 F6 F8 F9 F10 F12 F38",
    "rwrist": "F1 F3 F5 F7 F9 F10 F11 F38",
    "lfingers": "F14 F34",
    "rfingers": "F13 F33",
}
HUMERUS = (
    "F1 F2 F5 F6 F10 F11 F12 F13 F14 F15 F16 F17 F18 F19 F23 F24 F25 F26 F31 F33 F34 F35 F36 "
    "F38 F39"
)


@pytest.fixture(scope="module")
def motions():
    return [synthetic_motion(name, seed=3) for name in SYNTHETIC_CLASSES]


def golden_pieces(data, golden, *, continued):
    """Pairs (our relations, the authors') at 30 Hz, each clip."""
    take = np.load(golden / TAKE)["features"].T.astype(bool)
    for folder, number, column, offset in CLIPS:
        path = data / "hdm05" / folder / f"HDM_mm_{folder}_{number}_120.amc"
        before = take[column - 1] if continued else None
        features, known = feature_matrix(
            read(path).generic_positions(), FULL_BODY_2006, before=before
        )
        assert known.all()
        ours = features[offset::4]
        yield ours, take[column : column + len(ours)]


# -- golden: the authors' own feature matrix --------------------------------------------


def test_golden_interior_values_agree_all(data, golden):
    pairs = list(golden_pieces(data, golden, continued=False))
    agree = sum(int((ours[4:-4] == theirs[4:-4]).sum()) for ours, theirs in pairs)
    assert (agree, sum(ours[4:-4].size for ours, _ in pairs)) == (7293, 7293)


@pytest.mark.parametrize(("continued", "agreeing"), [(False, 8838), (True, 8846)])
def test_golden_values_with_the_ends(data, golden, continued, agreeing):
    pairs = list(golden_pieces(data, golden, continued=continued))
    agree = sum(int((ours == theirs).sum()) for ours, theirs in pairs)
    assert (agree, sum(ours.size for ours, _ in pairs)) == (agreeing, 8853)


# -- what must not change the words -----------------------------------------------------


def words_of(motion, positions=None, **changes):
    if positions is not None:
        changes["positions"] = positions
    return compute_features(replace(motion, **changes) if changes else motion)


def count_flips(first, second):
    assert np.array_equal(first.known, second.known)
    return int(np.bitwise_count(first.packed ^ second.packed).sum())


def ids_where(mask):
    return {FULL_BODY.ids[i] for i in np.flatnonzero(mask)}


def on_a_grid(motion):
    """The motion on a binary grid, so that moving and doubling it is exact."""
    return replace(motion, positions=np.round(motion.positions * 2**16) / 2**16)


def test_words_do_not_tell_where_the_body_is(motions):
    for motion in map(on_a_grid, motions):
        moved = motion.positions + np.array([1.5, -0.25, 8.0])
        assert count_flips(words_of(motion), words_of(motion, moved)) == 0


@pytest.mark.parametrize("factor", [0.25, 2.0, 64.0])
def test_words_do_not_tell_how_large_the_body_is(motions, factor):
    for motion in motions:
        assert count_flips(words_of(motion), words_of(motion, factor * motion.positions)) == 0


def test_words_do_not_tell_where_the_body_faces(motions):
    turned = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    for motion in motions:
        assert count_flips(words_of(motion), words_of(motion, motion.positions @ turned.T)) == 0


def test_any_turn_place_and_size_flips_next_to_nothing(motions):
    angle, n_integers, flips = 0.7, 0, 0
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    for motion in motions:
        moved = 0.83 * motion.positions @ turn.T + np.array([3.1, 0.7, -11.3])
        n_integers += len(words_of(motion))
        flips += count_flips(words_of(motion), words_of(motion, moved))
    assert n_integers > 700
    assert flips <= 1


def test_a_mirrored_motion_has_mirrored_words(motions):
    flips = np.zeros(40, dtype=int)
    for motion in motions:
        partner = [GENERIC_JOINTS.index(_other_side(j)) for j in GENERIC_JOINTS]
        mirrored = words_of(motion, motion.positions[:, partner] * np.array([-1.0, 1.0, 1.0]))
        expected = permute(words_of(motion).packed, FULL_BODY.mirror_order)
        differ = FeatureSequence(mirrored.packed ^ expected, mirrored.known, FULL_BODY).features
        flips += differ.sum(axis=0, dtype=int)
    # F1 and F2 are both measured from the left hip: they differ where the hips turn.
    assert ids_where(flips > 0) <= {"F1", "F2"}
    assert flips.sum() <= 30


def _other_side(joint):
    if joint == "root" or joint[0] not in "lr":
        return joint
    return ("r" if joint[0] == "l" else "l") + joint[1:]


def test_on_an_asymmetric_body_the_mirror_image_is_not_exact(motions):
    # Lengths of the right arm measure both sides, as the published features have it.
    motion = motions[SYNTHETIC_CLASSES.index("wave_right")]
    positions = motion.positions.copy()
    right = [GENERIC_JOINTS.index(j) for j in ("relbow", "rwrist", "rfingers")]
    shoulder = GENERIC_JOINTS.index("rshoulder")
    positions[:, right] += positions[:, [right[0]]] - positions[:, [shoulder]]
    assert count_flips(words_of(motion), words_of(motion, positions)) > 0


# -- rates ------------------------------------------------------------------------------


def test_resampling_there_and_back_keeps_the_samples(motions):
    positions = synthetic_motion("walk", seed=5, rate_hz=60).positions
    there = resample(positions, rate_hz=60, to_hz=120)
    assert len(there) == 2 * len(positions) - 1
    np.testing.assert_array_equal(resample(there, rate_hz=120, to_hz=60), positions)


@pytest.mark.parametrize(
    ("rate_hz", "fraction"), [(30, 0.002), (60, 0.0006), (100, 0.0006), (240, 0.0003)]
)
def test_the_same_motion_at_other_rates_has_nearly_the_same_words(rate_hz, fraction):
    flips = total = 0
    for name in SYNTHETIC_CLASSES:
        fine = synthetic_motion(name, seed=4, rate_hz=1200)
        step = {30: 40, 60: 20, 100: 12, 120: 10, 240: 5}
        reference, other = (
            compute_features(replace(fine, positions=fine.positions[:: step[r]], rotations=None,
                                     recording=Recording(rate_hz=float(r))))
            for r in (120, rate_hz)
        )  # fmt: skip
        n = min(len(reference), len(other))
        assert abs(len(reference) - len(other)) <= 1
        flips += int((reference.features[:n] != other.features[:n]).sum())
        total += 40 * n
    assert flips <= fraction * total


@pytest.mark.parametrize(("step", "fraction"), [(2, 0.001), (4, 0.002)])
def test_a_recording_at_a_half_or_a_quarter_of_its_rate_has_nearly_the_same_words(
    data, step, fraction
):
    motion = read(data / "cmu" / "86_01.amc")
    coarse = replace(
        motion,
        positions=motion.positions[::step],
        rotations=None,
        recording=Recording(rate_hz=120.0 / step),
    )
    first, second = compute_features(motion), compute_features(coarse)
    assert len(first) == len(second)
    # Measured: .0008 and .0016, most of them F40 and F39, which are not averaged over time.
    assert count_flips(first, second) <= fraction * 40 * len(first)


def test_a_gap_stays_a_gap_when_resampled():
    positions = np.zeros((40, 24, 3)) + np.arange(40)[:, None, None]
    positions[10:15, 3] = np.nan
    finer = resample(positions, rate_hz=30, to_hz=120)
    missing = np.isnan(finer[:, 3, 0])
    # Frames between a seen and an unseen one are unseen too.
    assert np.flatnonzero(missing).tolist() == list(range(37, 60))
    assert not np.isnan(np.delete(finer, 3, axis=1)).any()


# -- what is not seen -------------------------------------------------------------------


@pytest.mark.parametrize("joint", GENERIC_JOINTS)
def test_an_unseen_joint_makes_unknown_exactly_what_needs_it(motions, joint):
    motion = motions[0]
    positions = motion.positions.copy()
    positions[:, GENERIC_JOINTS.index(joint)] = np.nan
    got = words_of(motion, positions)
    expected = set(NEEDS[joint].split())
    unknown = ids_where(~got.known_features.any(axis=0))
    assert unknown == expected
    assert (got.packed & ~got.known == 0).all()


def test_without_upper_arms_and_thighs_nothing_is_measured_in_them(motions):
    positions = motions[0].positions.copy()
    hidden = ("lelbow", "relbow", "lknee", "rknee")
    positions[:, [GENERIC_JOINTS.index(joint) for joint in hidden]] = np.nan
    unknown = ids_where(~words_of(motions[0], positions).known_features.any(axis=0))
    needed = {name for joint in hidden for name in NEEDS[joint].split()}
    assert unknown == needed | set(HUMERUS.split())


def test_known_relations_do_not_mind_what_is_not_seen(motions):
    motion = motions[SYNTHETIC_CLASSES.index("pick_up_right")]
    positions = motion.positions.copy()
    positions[:, GENERIC_JOINTS.index("lfingers")] = np.nan
    full, less = words_of(motion), words_of(motion, positions)
    assert not ((full.packed ^ less.packed) & less.known).any()


def test_a_gap_hides_a_relation_for_as_long_as_its_window_meets_it(motions):
    positions = np.repeat(as_array([standing()]), 200, axis=0)
    positions[100:110, GENERIC_JOINTS.index("rfingers")] = np.nan
    _, known = feature_matrix(positions, FULL_BODY)
    unknown = ~known[:, FULL_BODY.ids.index("F33")]
    assert np.flatnonzero(unknown).tolist() == list(range(100, 110))
    # F13: differences 99 to 109 are missing, windows reach 5 back and 6 ahead.
    unknown = ~known[:, FULL_BODY.ids.index("F13")]
    assert np.flatnonzero(unknown).tolist() == list(range(93, 115))


def test_a_length_unseen_at_first_is_its_median(motions):
    motion = motions[0]
    positions = motion.positions.copy()
    positions[:7, GENERIC_JOINTS.index("relbow")] = np.nan
    full, late = words_of(motion), words_of(motion, positions)
    assert late.known_features[0, FULL_BODY.ids.index("F7")] == 0
    assert late.known_features[0, FULL_BODY.ids.index("F17")] == 1
    assert not ((full.packed ^ late.packed) & late.known)[2:].any()


def test_a_body_without_extent_is_unknown_not_false():
    got = compute_features(np.zeros((20, 24, 3)), rate_hz=30)
    unknown = ids_where(~got.known_features.any(axis=0))
    assert unknown == set(FULL_BODY.ids) - {"F40"}


def test_one_frame_shows_poses_but_no_movement():
    got = compute_features(as_array([standing()]), rate_hz=30)
    assert len(got) == 1
    moving = "F1 F2 F5 F6 F10 F11 F12 F13 F14 F23 F24 F25 F26 F39 F40"
    assert ids_where(got.known_features[0] == 0) == set(moving.split())


@pytest.mark.parametrize("frames", [2, 3, 5])
def test_few_frames_are_enough(frames):
    got = compute_features(np.repeat(as_array([standing()]), frames, axis=0), rate_hz=120)
    assert got.known_features.all()


# -- time -------------------------------------------------------------------------------


def sequence(n_integers, **arguments):
    packed = pack(np.zeros((n_integers, 40), dtype=bool))
    return FeatureSequence(packed, packed, FULL_BODY, Recording(**arguments))


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 100.0, 120.0, 240.0])
def test_words_frames_and_seconds_belong_together(rate_hz):
    n_frames = 1001
    motion = Motion(
        GENERIC_JOINTS, np.repeat(as_array([standing()]), n_frames, axis=0),
        Recording("take.amc", rate_hz=rate_hz, first_frame=7), named_mapping("generic"),
    )  # fmt: skip
    got = compute_features(motion)
    assert got.source == "take.amc"
    assert got.rate_hz == SEQUENCE_HZ
    assert got.duration_s == pytest.approx(n_frames / rate_hz)
    assert len(got) == int((n_frames - 1) / rate_hz * 30 + 1e-9) + 1
    assert got.seconds(0) == 0
    assert got.seconds(30) == 1.0
    assert got.seconds(len(got)) == pytest.approx(min(len(got) / 30, n_frames / rate_hz))
    assert got.recording.frame_at(0.0) == 7
    assert got.recording.frame_at(1.0) == 7 + rate_hz
    assert got.recording.frame_at(1e9) == 7 + n_frames - 1
    assert got.recording.last_frame_before(1.0) == 7 + rate_hz - 1
    assert got.recording.last_frame_before(1e9) == 7 + n_frames - 1
    for frame in range(0, n_frames, 37):
        assert got.recording.frame_at(frame / rate_hz) == 7 + frame


def test_a_part_counts_from_its_own_start():
    part = sequence(300, rate_hz=120.0, n_frames=1200, first_frame=1).part(30, 90)
    assert len(part) == 60
    assert part.duration_s == 2.0
    assert part.recording.frame_at(0.0) == 121
    assert part.seconds(60) == 2.0
    for bounds in ((5, 5), (-1, 4), (0, 301)):
        with pytest.raises(InvalidInput, match="a part needs"):
            sequence(300).part(*bounds)


def test_words_alone_are_as_long_as_they_are_many():
    alone = sequence(45, rate_hz=120.0)
    assert (alone.recording.n_frames, alone.duration_s) == (180, 1.5)
    with pytest.raises(InvalidInput, match=r"shape \(frames, 1\), got \(5, 2\)"):
        FeatureSequence(np.zeros((5, 2), np.uint64), np.zeros((5, 2), np.uint64), FULL_BODY)
